"""Checks of custom kinds: samples in double precision that may contradict a definition.

They cannot prove a claim, but a wrong function seldom passes.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.custom.bounds_kernels import FARTHEST
from blobtree.custom.source import CustomSource
from blobtree.nodes.parameters import Parameter
from blobtree.transpile.python import Precision, vector

Floats = NDArray[np.float64]

TRIAL_SPREAD = 2.0
"""Distance from their limits, or from 0, up to which numbers are drawn for trials."""

SEED = 20
TRIALS = 14
"""Number of sets of parameters."""

POINTS = 80
"""Query points per set, besides the vectors among the parameters and the points between them."""

TOLERANCE = 1e-6
"""Relative error of a distance that is accepted: float32 is no better."""

SINGLE_TOLERANCE = 1e-5
"""The same in single precision."""

FAR_SHARE = 0.1
"""Distance of a closest point, relative to that of its far query, at which a skeleton counts as unbounded."""

SETTINGS = 6
"""Number of values of the parameter that are sampled."""

SAMPLES = 150
LARGEST_JUMP = 1e-3
"""Change of an operator, relative to its operands, that counts as a jump where gradients hardly turn."""

STEP = 1e-5
"""Step of the operands in finite differences."""

SLOPE_TOLERANCE = 1e-4
VALUE_TOLERANCE = 1e-6
MAX_KINK_SHARE = 0.2
"""Share of the samples that may lie on kinks, where finite differences are useless."""


def trial_value(parameter: Parameter, rng: np.random.Generator, trial: int) -> Any:
    """Return a value within the limits for a trial; the first trials take axes, zeros and limits."""
    if parameter.size == 1:
        return _trial_number(parameter, rng, trial)
    size, low, high = parameter.size, parameter.low, parameter.high
    if trial < size + 1:
        vector = np.eye(size)[trial] if trial < size else np.zeros(size)
    else:
        vector = rng.uniform(-1.0, 1.0, size)
    length = float(np.linalg.norm(vector))
    allowed = min(max(length, low), high)
    if allowed == length:
        return tuple(vector.tolist())
    direction = vector / length if length > 0.0 else np.eye(size)[0]
    return tuple((direction * allowed * (1.0 + 1e-9)).tolist())


def _trial_number(parameter: Parameter, rng: np.random.Generator, trial: int) -> float | int:
    low, high = parameter.low, parameter.high
    low = low if low > -math.inf else min(high, TRIAL_SPREAD) - 2.0 * TRIAL_SPREAD
    high = high if high < math.inf else max(low, -TRIAL_SPREAD) + 2.0 * TRIAL_SPREAD
    near = min(high, low + TRIAL_SPREAD)
    number = (low, high, near, rng.uniform(low, high), rng.uniform(low, near))[trial % 5]
    return round(number) if parameter.whole else float(number)


# -- skeletons ---------------------------------------------------------------------------------------


def check_skeleton(source: CustomSource, parameters: tuple[Parameter, ...], *, convex: bool) -> None:
    """Raise `InvalidDefinition` unless a function seems to return the closest point of a set.

    Let c be the point returned for q. Then c is returned for c itself, and no point returned for another
    query is nearer to q. Both hold for every set and, over all queries, for no other function.
    """
    rng = np.random.default_rng(SEED)
    closest, in_single = source.reference(), source.reference(np.float32)
    for trial in range(TRIALS):
        values = {parameter.name: trial_value(parameter, rng, trial) for parameter in parameters}
        arguments = [vector(*value) if isinstance(value, tuple) else value for value in values.values()]
        queries = _queries(rng, arguments)
        closest_points = np.array([_point(source, closest, q, arguments, values) for q in queries])
        _try_single_precision(source, in_single, queries, closest_points, values)
        repeated = np.array([_point(source, closest, vector(*c), arguments, values) for c in closest_points])
        scale = 1.0 + max(np.abs(queries).max(), np.abs(closest_points).max())
        moved = np.linalg.norm(repeated - closest_points, axis=1)
        hint = f", with {values}{_hint(parameters)}"
        if moved.max() > TOLERANCE * scale:
            worst = int(moved.argmax())
            raise source.refusal(
                f"{shown(closest_points[worst])} is returned as a point of the skeleton, but for that very "
                f"point it returns {shown(repeated[worst])}; return the closest point of a fixed set{hint}"
            )
        if convex:
            _try_convexity(source, closest, closest_points, arguments, values)
        distances = np.linalg.norm(queries[:, None] - closest_points[None], axis=2)
        excess = np.diagonal(distances)[:, None] - distances
        if excess.max() > TOLERANCE * scale:
            i, j = np.unravel_index(int(excess.argmax()), excess.shape)
            raise source.refusal(
                f"for q = {shown(queries[i])} it returns {shown(closest_points[i])}, though "
                f"{shown(closest_points[j])}, which it returns for {shown(queries[j])}, is nearer; "
                f"return the closest point{hint}"
            )
        _try_bounds(source, closest, arguments, values)


def _try_single_precision(
    source: CustomSource,
    closest: Callable[..., Any],
    queries: Floats,
    closest_points: Floats,
    values: dict[str, Any],
) -> None:
    """Check that distances survive float32, in which devices compute."""
    for q, c in zip(queries, closest_points, strict=True):
        arguments = [in_precision(value, np.float32) for value in (tuple(q), *values.values())]
        where = partial(_in_single_precision, q, values)
        other = result_of(source, closest, arguments, where, 3)
        one, two = np.linalg.norm(q - c), np.linalg.norm(q - other)
        if abs(one - two) > SINGLE_TOLERANCE * (1.0 + np.abs(q).max() + np.abs(c).max()):
            raise source.refusal(
                f"for {where()} it returns {shown(other)}, in double precision {shown(c)}; "
                "avoid differences of large numbers and divisions by small ones"
            )


def _try_convexity(
    source: CustomSource,
    closest: Callable[..., Any],
    closest_points: Floats,
    arguments: list[Any],
    values: dict[str, Any],
) -> None:
    """Check that the middle between two points of a convex skeleton belongs to it."""
    for one, other in zip(closest_points, np.roll(closest_points, 1, axis=0), strict=True):
        middle = 0.5 * (one + other)
        apart = float(np.linalg.norm(_point(source, closest, middle, arguments, values) - middle))
        if apart > TOLERANCE * (1.0 + np.abs(closest_points).max()):
            raise source.refusal(
                f"convex: {shown(one)} and {shown(other)} belong to the skeleton, but the middle between "
                f"them is {apart:.6g} away from it{f', with {values}' if values else ''}"
            )


def _in_single_precision(q: Floats, values: dict[str, Any]) -> str:
    return f"q = {shown(q)} and {values}, in single precision,"


def in_precision(value: Any, precision: Precision) -> Any:
    """Return a number or a vector in a floating-point type; whole numbers stay as they are."""
    if isinstance(value, tuple):
        return vector(*value, precision=precision)
    return precision(value) if isinstance(value, float) else value


def _try_bounds(
    source: CustomSource, closest: Callable[..., Any], arguments: list[Any], values: dict[str, Any]
) -> None:
    """Check that the closest points to far queries are not far away too."""
    largest = max((float(np.abs(value).max()) for value in arguments), default=1.0)
    distance = FARTHEST * max(largest, 1.0)
    for signs in product((-1.0, 0.0, 1.0), repeat=3):
        if any(signs):
            q = distance * np.array(signs) / np.linalg.norm(signs)
            c = _point(source, closest, q, arguments, values)
            if np.linalg.norm(c) > FAR_SHARE * distance:
                raise source.refusal(
                    f"for q = {shown(q)} it returns {shown(c)}, so its skeleton seems to be unbounded; "
                    f"end the skeleton at a finite distance{f', with {values}' if values else ''}"
                )


def _hint(parameters: tuple[Parameter, ...]) -> str:
    if not parameters:
        return ""
    return f"; if such values are not meant, pass limits={{{parameters[-1].name!r}: (smallest, largest)}}"


def _queries(rng: np.random.Generator, arguments: list[Any]) -> Floats:
    """Return query points all around, on the axes, and at and between the vectors among the parameters."""
    vectors = [np.zeros(3), *(np.asarray(value) for value in arguments if np.shape(value) == (3,))]
    between = [a + share * (b - a) for a, b in product(vectors, repeat=2) for share in (0.0, 0.5, 2.0)]
    beside = [a + step * axis for a in vectors for axis in np.eye(3) for step in (-1.0, 0.5)]
    spread = rng.uniform(-3.0, 3.0, (POINTS, 3)) * rng.choice([0.3, 1.0, 10.0], (POINTS, 1))
    return np.vstack([spread, *beside, *between[: POINTS // 2]])


def _point(
    source: CustomSource, closest: Callable[..., Any], q: Any, arguments: list[Any], values: dict[str, Any]
) -> Floats:
    return result_of(source, closest, [vector(*q), *arguments], lambda: f"q = {shown(q)} and {values}", 3)


def result_of(
    source: CustomSource,
    function: Callable[..., Any],
    arguments: list[Any],
    where: Callable[[], str],
    size: int,
) -> Floats:
    """Return the result of a function as `size` numbers; raise `InvalidDefinition` otherwise.

    `where` says for errors at which arguments it is called.
    """
    try:
        with np.errstate(all="ignore"):
            result = np.asarray(function(*arguments), np.float64)
    except ArithmeticError as error:
        raise source.refusal(f"for {where()} it fails: {error}; it must have a result everywhere") from error
    except Exception as error:  # the function is the user's own
        raise source.refusal(f"for {where()} it fails: {type(error).__name__}: {error}") from error
    if result.shape != (size,) or not np.isfinite(result).all():
        raise source.refusal(f"for {where()} it returns {shown(result)}; expected {size} finite numbers")
    return result


def shown(numbers: Any) -> str:
    """Return a number, or several in parentheses, as messages show them."""
    flat = np.ravel(np.asarray(numbers, np.float64)).tolist()
    text = ", ".join(f"{number:.6g}" for number in flat)
    return text if len(flat) == 1 else f"({text})"


@dataclass(frozen=True)
class Trial:
    """A user's function of a point, with one set of values of its other parameters."""

    source: CustomSource
    values: dict[str, Any]
    size: int
    """Number of numbers that it returns."""

    def call(
        self, function: CustomSource, leading: tuple[Any, ...], size: int, precision: Precision = np.float64
    ) -> Floats:
        """Return the result (size,) of a function of leading arguments, the point first, and the values."""
        plain = function.reference(precision)
        arguments = [in_precision(value, precision) for value in (*leading, *self.values.values())]
        return result_of(
            function,
            lambda *given: np.atleast_1d(plain(*given)),
            arguments,
            lambda: self.where(leading),
            size,
        )

    def where(self, leading: tuple[Any, ...]) -> str:
        """Return the arguments of a call as messages show them."""
        values = ", ".join(f"{name} = {shown(value)}" for name, value in self.values.items())
        point = f"q = {shown(leading[0])}" if leading else "these parameters"
        return point + (f" with {values}" if values else "")

    def at(self, q: Floats, precision: Precision = np.float64) -> Floats:
        """Return the function's result at a point."""
        return self.call(self.source, (tuple(q),), self.size, precision)

    def bound(self, claim: float | CustomSource, center: Floats, radius: float) -> float:
        """Return a claimed bound in a ball."""
        if isinstance(claim, float):
            return claim
        ball = (tuple(center), radius) if len(claim.parameters) > len(self.values) else ()
        return float(self.call(claim, ball, 1)[0])


def trials(
    source: CustomSource,
    parameters: tuple[Parameter, ...],
    size: int,
    extent: float,
    points: int,
    rng: np.random.Generator,
) -> Iterator[tuple[Trial, Floats]]:
    """Yield trials with values within the limits, each with points (n, 3) around the origin."""
    for number in range(TRIALS if parameters else 2):
        values = {parameter.name: trial_value(parameter, rng, number) for parameter in parameters}
        spread = extent * rng.choice([0.1, 0.4, 1.0], (points, 1))
        yield Trial(source, values, size), rng.uniform(-1.0, 1.0, (points, 3)) * spread


# -- operators ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Claims:
    """The claims of a definition about its operator."""

    steepest: float | CustomSource
    like: str | None
    monotone: bool
    order_free: bool


@dataclass(frozen=True, eq=False)
class _Trial:
    """An operator with one value of its parameter."""

    source: CustomSource
    parameters: tuple[float, ...]
    steepest: Callable[..., Any]
    precision: Precision = np.float64
    gradients: tuple[Floats, ...] = ()
    """The gradients of both operands, if the operator reads them."""

    @cached_property
    def function(self) -> Callable[..., Any]:
        return self.source.reference(self.precision)

    def at(self, a: float, b: float) -> Floats:
        """Return (F, ∂F/∂a, ∂F/∂b)."""
        directions = [vector(*gradient, precision=self.precision) for gradient in self.gradients]
        parameters = map(self.precision, self.parameters)
        arguments = [self.precision(a), self.precision(b), *directions, *parameters]
        return result_of(self.source, self.function, arguments, lambda: self.call(a, b), 3)

    def value(self, a: float, b: float) -> float:
        return float(self.at(a, b)[0])

    def bounds(self, max_a: float, max_b: float) -> Floats:
        """Return the claimed bounds of |∂F/∂a| and |∂F/∂b| for operands up to these."""
        arguments = [np.float64(x) for x in (max_a, max_b, *self.parameters)]
        return result_of(
            self.source, self.steepest, arguments, lambda: f"steepest of {self.call(max_a, max_b)}", 2
        )

    def call(self, *operands: float) -> str:
        numbers = [f"{float(x):.6g}" for x in operands]
        return f"F({', '.join([*numbers, *map(shown, (*self.gradients, *self.parameters))])})"


def check_operator(source: CustomSource, parameters: tuple[Parameter, ...], claims: Claims) -> None:
    """Raise `InvalidDefinition` if sampled operands contradict a claim."""
    rng = np.random.default_rng(SEED)
    steepest = _steepest(claims.steepest)
    for setting in range(SETTINGS if parameters else 1):
        values = tuple(float(trial_value(parameter, rng, setting)) for parameter in parameters)
        trial = _Trial(source, values, steepest)
        operands = _operands(rng)
        _try_values(trial, operands, claims)
        _try_partials(trial, operands)
        _try_continuity(trial, operands, rng)
        _try_tiny_operands(trial)
        if claims.monotone:
            _try_monotone(trial, rng, falls_with_b=claims.like == "difference")
        if claims.order_free:
            _try_order(trial, rng)


def check_directed_operator(source: CustomSource, parameters: tuple[Parameter, ...], claims: Claims) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim about an operator that reads gradients."""
    rng = np.random.default_rng(SEED)
    assert isinstance(claims.steepest, CustomSource)
    envelope = claims.steepest.reference()
    for setting, gradients in enumerate(_gradient_pairs(rng)):
        values = tuple(float(trial_value(parameter, rng, setting)) for parameter in parameters)
        trial = _Trial(source, values, lambda *_operands: (1e30, 1e30), gradients=gradients)
        operands = _operands(rng)
        _try_values(trial, operands, claims)
        _try_partials(trial, operands)
        _try_tiny_operands(trial)
        _try_envelope(trial, envelope, operands, rng, falls_with_b=claims.like == "difference")
        _try_turned(trial, operands, rng)


def _gradient_pairs(rng: np.random.Generator) -> list[tuple[Floats, Floats]]:
    """Return pairs of gradients: equal, opposed, absent, of any lengths."""
    first, second = rng.normal(size=(2, 3)), rng.normal(size=(2, 3)) * 10.0 ** rng.uniform(-3.0, 1.0, (2, 1))
    none = np.zeros(3)
    return [
        (first[0], second[0]), (first[1], second[1]), (first[0], first[0]), (first[0], -0.5 * first[0]),
        (none, second[0]), (none, none),
    ]  # fmt: skip


def _try_envelope(
    trial: _Trial,
    envelope: Callable[..., Any],
    operands: Floats,
    rng: np.random.Generator,
    *,
    falls_with_b: bool,
) -> None:
    """Check that F lies in its envelope, which is monotone."""

    def bounds(a: float, b: float) -> Floats:
        arguments = [np.float64(x) for x in (a, b, *trial.parameters)]
        where = partial("the envelope at ({:.6g}, {:.6g})".format, a, b)
        return result_of(trial.source, envelope, arguments, where, 2)

    for a, b in operands.tolist():
        value, (low, high) = trial.value(a, b), bounds(a, b)
        slack = VALUE_TOLERANCE * (1.0 + abs(value))
        if not (low - slack <= value <= high + slack):
            raise trial.source.refusal(
                f"{trial.call(a, b)} = {value:.6g}, outside its envelope [{low:.6g}, {high:.6g}]"
            )
        more = float(rng.uniform(0.0, 1.0))
        with_b = (a, b - min(more, b)) if falls_with_b else (a, b + more)
        for pair in ((a + more, b), with_b):
            moved = bounds(*pair)
            if (moved < [low - slack, high - slack]).any():
                raise trial.source.refusal(
                    f"envelope: it is {shown(moved)} at {shown(pair)}, and {shown((low, high))} at "
                    f"{shown((a, b))}; it must be monotone"
                )


def _try_turned(trial: _Trial, operands: Floats, rng: np.random.Generator) -> None:
    """Check that F does not jump where gradients turn a little."""
    turned = tuple(g + 1e-7 * np.linalg.norm(g) * rng.normal(size=3) for g in trial.gradients)
    other = replace(trial, gradients=turned)
    for a, b in operands[:10].tolist():
        change = abs(other.value(a, b) - trial.value(a, b))
        if change > LARGEST_JUMP * (1.0 + a + b):
            raise trial.source.refusal(
                f"{trial.call(a, b)} changes by {change:.6g} where gradients turn by 1e-7; "
                "it must be continuous"
            )


def _operands(rng: np.random.Generator) -> Floats:
    """Return pairs of operands, most of them in the usual range of fields."""
    scale = rng.choice([0.05, 1.0, 1.0, 4.0], (SAMPLES, 1))
    operands: Floats = rng.uniform(0.0, 1.0, (SAMPLES, 2)) * scale + 2.0 * STEP
    return operands


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= VALUE_TOLERANCE * (1.0 + abs(b))


def _try_values(trial: _Trial, operands: Floats, claims: Claims) -> None:
    """Check that F ≥ 0, and its value where an operand is absent."""
    for a, b in [*operands.tolist(), [0.0, 0.5], [0.5, 0.0], [1.0, 1.0], [0.5, 0.5]]:
        value = trial.value(a, b)
        if value < 0.0:
            raise trial.source.refusal(
                f"{trial.call(a, b)} = {value:.6g} is negative, and a field is not; write wp.max(…, 0.0)"
            )
    if claims.like is None:
        value = trial.value(0.0, 0.0)
        if value != 0.0:
            raise trial.source.refusal(
                f"{trial.call(0, 0)} = {value:.6g}; where both operands are absent it must be 0"
            )
        return
    for x in np.abs(operands[:, 0]).tolist():
        with_left = x if claims.like in ("blend", "difference") else 0.0
        with_right = x if claims.like == "blend" else 0.0
        for pair, expected in (((x, 0.0), with_left), ((0.0, x), with_right)):
            value = trial.value(*pair)
            if not _near(value, expected):
                raise trial.source.refusal(
                    f"{trial.call(*pair)} = {value:.6g}, but like={claims.like!r} says {expected:.6g}"
                )


def _try_partials(trial: _Trial, operands: Floats) -> None:
    """Check that the partial derivatives are those of F, and within the claimed bounds."""
    kinks = 0
    for a, b in operands.tolist():
        f, *partials = trial.at(a, b).tolist()
        sides = [
            (trial.value(a + s * da * STEP, b + s * db * STEP) - f) / (s * STEP)
            for da, db in ((1.0, 0.0), (0.0, 1.0))
            for s in (1.0, -1.0)
        ]
        for number, name in enumerate(("a", "b")):
            right, left = sides[2 * number : 2 * number + 2]
            scale = SLOPE_TOLERANCE * (1.0 + abs(partials[number]))
            smooth = abs(right - left) <= 10.0 * scale
            kinks += not smooth
            if smooth and abs(partials[number] - 0.5 * (right + left)) > scale:
                raise trial.source.refusal(
                    f"∂F/∂{name} of {trial.call(a, b)} is {0.5 * (right + left):.6g} by differences, "
                    f"but {partials[number]:.6g} is returned"
                )
        _try_steepness(trial, a, b, partials)
    if kinks > MAX_KINK_SHARE * 2 * len(operands):
        raise trial.source.refusal(
            f"F has kinks at {kinks} of {2 * len(operands)} samples, so its derivatives cannot be tried"
        )


def _try_continuity(trial: _Trial, operands: Floats, rng: np.random.Generator) -> None:
    """Check that F changes no faster between operands than `steepest` says, so that it does not jump."""
    steps = rng.uniform(-1.0, 1.0, operands.shape) * 10.0 ** rng.uniform(-3.0, 0.0, (len(operands), 1))
    for one, other in zip(operands, np.abs(operands + steps), strict=True):
        bounds = trial.bounds(*np.maximum(one, other).tolist())
        change = abs(trial.value(*one) - trial.value(*other))
        if change > float(bounds @ np.abs(one - other)) + VALUE_TOLERANCE * (1.0 + change):
            raise trial.source.refusal(
                f"{trial.call(*one)} and {trial.call(*other)} are {change:.6g}, farther apart than "
                f"steepest = {bounds.tolist()} allows; F must be continuous and its partial derivatives right"
            )


def _steepest(claim: float | CustomSource) -> Callable[..., Any]:
    if isinstance(claim, float):
        return lambda *_operands: (claim, claim)
    return claim.reference()


def _try_steepness(trial: _Trial, a: float, b: float, partials: list[float]) -> None:
    bounds = trial.bounds(a, b).tolist()
    for name, slope, bound in zip("ab", partials, bounds, strict=True):
        if abs(slope) > bound * (1.0 + VALUE_TOLERANCE):
            raise trial.source.refusal(
                f"|∂F/∂{name}| of {trial.call(a, b)} is {abs(slope):.6g}, more than steepest = {bound:.6g}"
            )


def _try_tiny_operands(trial: _Trial) -> None:
    """Check tiny operands in single precision, where products underflow."""
    single = replace(trial, precision=np.float32)
    for a, b in product((1e-38, 1e-30, 1e-19, 1e-9, 0.5), repeat=2):
        f, *partials = single.at(a, b).tolist()
        if not _near(f, trial.value(a, b)):
            raise trial.source.refusal(
                f"{trial.call(a, b)} is {f:.6g} in single precision, {trial.value(a, b):.6g} in double"
            )
        _try_steepness(trial, a, b, partials)


def _try_monotone(trial: _Trial, rng: np.random.Generator, *, falls_with_b: bool) -> None:
    for a, b, more in (rng.uniform(0.0, 1.0, (SAMPLES, 3)) * rng.choice([1.0, 3.0], (SAMPLES, 1))).tolist():
        least, with_a, with_b = trial.value(a, b), trial.value(a + more, b), trial.value(a, b + more)
        slack = VALUE_TOLERANCE * (1.0 + least)
        if with_a < least - slack:
            raise trial.source.refusal(
                f"monotone: {trial.call(a, b)} = {least:.6g} but {trial.call(a + more, b)} = {with_a:.6g}"
            )
        if with_b > least + slack if falls_with_b else with_b < least - slack:
            raise trial.source.refusal(
                f"monotone: {trial.call(a, b)} = {least:.6g} but {trial.call(a, b + more)} = {with_b:.6g}"
            )


def _try_order(trial: _Trial, rng: np.random.Generator) -> None:
    for a, b, c in rng.uniform(0.0, 1.5, (SAMPLES, 3)).tolist():
        one, other = trial.value(a, b), trial.value(b, a)
        if not _near(one, other):
            raise trial.source.refusal(
                f"order_free: {trial.call(a, b)} = {one:.6g} but {trial.call(b, a)} = {other:.6g}"
            )
        left, right = trial.value(one, c), trial.value(a, trial.value(b, c))
        if not _near(left, right):
            raise trial.source.refusal(
                f"order_free: with a, b, c = {a:.6g}, {b:.6g}, {c:.6g}, F(F(a, b), c) = {left:.6g} but "
                f"F(a, F(b, c)) = {right:.6g}"
            )
