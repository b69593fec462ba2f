"""Checks of custom operators: samples of operands that may contradict a definition."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.checks import SEED, SLOPE_TOLERANCE, VALUE_TOLERANCE, trial_value
from blobtree.declare.formula import Formula, result_of, shown
from blobtree.declare.operator import Claims, OperatorFormulas
from blobtree.declare.parameters import Parameter
from blobtree.transpile.python import Precision, vector

SETTINGS = 6
"""Number of values of the parameter that are sampled."""

SAMPLES = 150
LARGEST_JUMP = 1e-3
"""Change of an operator, relative to its operands, that counts as a jump where gradients hardly turn."""

STEP = 1e-5
"""Step of the operands in finite differences."""

NO_SLOPE = 1e-15
"""Slopes below it move no surface; derived slopes of absent operands are that small, but not 0."""

MAX_KINK_SHARE = 0.2
"""Share of the samples that may lie on kinks, where finite differences are useless."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """An operator with one value of its parameter."""

    source: Formula
    parameters: tuple[float, ...]
    lipschitz: Callable[..., Any]
    precision: Precision = np.float64
    gradients: tuple[Float64Array, ...] = ()
    """The gradients of both operands, if the operator reads them."""

    @cached_property
    def function(self) -> Callable[..., Any]:
        return self.source.reference(self.precision)

    def at(self, a: float, b: float) -> Float64Array:
        """Return (F, ∂F/∂a, ∂F/∂b)."""
        directions = [vector(*gradient, precision=self.precision) for gradient in self.gradients]
        parameters = map(self.precision, self.parameters)
        arguments = [self.precision(a), self.precision(b), *directions, *parameters]
        return result_of(self.source, self.function, arguments, lambda: self.call(a, b), 3)

    def value(self, a: float, b: float) -> float:
        return float(self.at(a, b)[0])

    def bounds(self, max_a: float, max_b: float) -> Float64Array:
        """Return the claimed bounds of |∂F/∂a| and |∂F/∂b| for operands up to these."""
        arguments = [np.float64(x) for x in (max_a, max_b, *self.parameters)]
        return result_of(
            self.source, self.lipschitz, arguments, lambda: f"lipschitz of {self.call(max_a, max_b)}", 2
        )

    def call(self, *operands: float) -> str:
        numbers = [f"{float(x):.6g}" for x in operands]
        return f"F({', '.join([*numbers, *map(shown, (*self.gradients, *self.parameters))])})"


def check_operator(formulas: OperatorFormulas, parameters: Sequence[Parameter]) -> None:
    """Raise `InvalidDefinition` if sampled operands contradict a claim."""
    if formulas.reads_gradients:
        _check_directed(formulas, parameters)
        return
    rng, source, claims = np.random.default_rng(SEED), formulas.partials(), formulas.claims
    for setting in range(SETTINGS if parameters else 1):
        values = tuple(float(trial_value(parameter, rng, setting)) for parameter in parameters)
        trial = _Trial(source, values, _lipschitz(formulas))
        operands = _operands(rng)
        _try_values(trial, operands, claims)
        _try_partials(trial, operands)
        _try_continuity(trial, operands, rng)
        _try_tiny_operands(trial)
        if claims.monotone:
            _try_monotone(trial, rng, falls_with_b=claims.like == "difference")
        if claims.associative:
            _try_order(trial, rng)
        for name, check in _CHECKS_OF_FORMULAS.items():
            if name in formulas.given:
                check(trial, formulas, formulas.given[name])


def _check_directed(formulas: OperatorFormulas, parameters: Sequence[Parameter]) -> None:
    """Raise `InvalidDefinition` if samples contradict a claim about an operator that reads gradients."""
    rng, source, claims = np.random.default_rng(SEED), formulas.partials(), formulas.claims
    envelope = formulas.given["envelope"].reference()
    for setting, gradients in enumerate(_gradient_pairs(rng)):
        values = tuple(float(trial_value(parameter, rng, setting)) for parameter in parameters)
        trial = _Trial(source, values, lambda *_operands: (1e30, 1e30), gradients=gradients)
        operands = _operands(rng)
        _try_values(trial, operands, claims)
        _try_partials(trial, operands)
        _try_tiny_operands(trial)
        _try_envelope(trial, envelope, operands, rng, falls_with_b=claims.like == "difference")
        _try_turned(trial, operands, rng)


def _gradient_pairs(rng: np.random.Generator) -> list[tuple[Float64Array, Float64Array]]:
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
    operands: Float64Array,
    rng: np.random.Generator,
    *,
    falls_with_b: bool,
) -> None:
    """Check that F lies in its envelope, which is monotone."""

    def bounds(a: float, b: float) -> Float64Array:
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


def _try_turned(trial: _Trial, operands: Float64Array, rng: np.random.Generator) -> None:
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


def _operands(rng: np.random.Generator) -> Float64Array:
    """Return pairs of operands, most of them in the usual range of fields."""
    scale = rng.choice([0.05, 1.0, 1.0, 4.0], (SAMPLES, 1))
    operands: Float64Array = rng.uniform(0.0, 1.0, (SAMPLES, 2)) * scale + 2.0 * STEP
    return operands


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= VALUE_TOLERANCE * (1.0 + abs(b))


def _try_values(trial: _Trial, operands: Float64Array, claims: Claims) -> None:
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


def _try_partials(trial: _Trial, operands: Float64Array) -> None:
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


def _try_continuity(trial: _Trial, operands: Float64Array, rng: np.random.Generator) -> None:
    """Check that F changes no faster between operands than `lipschitz` says, so that it does not jump."""
    steps = rng.uniform(-1.0, 1.0, operands.shape) * 10.0 ** rng.uniform(-3.0, 0.0, (len(operands), 1))
    for one, other in zip(operands, np.abs(operands + steps), strict=True):
        bounds = trial.bounds(*np.maximum(one, other).tolist())
        change = abs(trial.value(*one) - trial.value(*other))
        if change > float(bounds @ np.abs(one - other)) + VALUE_TOLERANCE * (1.0 + change):
            raise trial.source.refusal(
                f"{trial.call(*one)} and {trial.call(*other)} are {change:.6g}, farther apart than "
                f"lipschitz = {bounds.tolist()} allows; F must be continuous, with right partial derivatives"
            )


def _lipschitz(formulas: OperatorFormulas) -> Callable[..., Any]:
    """Return the function of the claimed bounds of both partial derivatives."""
    if "lipschitz" in formulas.given:
        return formulas.given["lipschitz"].reference()
    if formulas.claims.lipschitz is None:
        slope = formulas.given["slope"].reference()
        rises = [vector(*rise, precision=np.float64) for rise in np.eye(2)]
        return lambda a, b, *given: [
            slope(rise, vector(a, b, precision=np.float64), *given) for rise in rises
        ]
    claim = float(formulas.claims.lipschitz)
    return lambda *_operands: (claim, claim)


def _try_steepness(trial: _Trial, a: float, b: float, partials: list[float]) -> None:
    bounds = trial.bounds(a, b).tolist()
    for name, slope, bound in zip("ab", partials, bounds, strict=True):
        if abs(slope) > bound * (1.0 + VALUE_TOLERANCE) + NO_SLOPE:
            raise trial.source.refusal(
                f"|∂F/∂{name}| of {trial.call(a, b)} is {abs(slope):.6g}, more than lipschitz = {bound:.6g}"
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
                f"associative: {trial.call(a, b)} = {one:.6g} but {trial.call(b, a)} = {other:.6g}"
            )
        left, right = trial.value(one, c), trial.value(a, trial.value(b, c))
        if not _near(left, right):
            raise trial.source.refusal(
                f"associative: with a, b, c = {a:.6g}, {b:.6g}, {c:.6g}, F(F(a, b), c) = {left:.6g} but "
                f"F(a, F(b, c)) = {right:.6g}"
            )


def _try_slope(trial: _Trial, formulas: OperatorFormulas, bound: Formula) -> None:
    """Check that no slope of F exceeds `slope`; those of operands that fall act where F is monotone."""
    rng, signed = (
        np.random.default_rng(SEED),
        formulas.claims.monotone and formulas.claims.like != "difference",
    )
    for a, b in _operands(rng).tolist():
        partials = trial.at(a, b)[1:]
        slopes = rng.uniform(-1.0 if signed else 0.0, 1.0, 2)
        steepest = float((partials if signed else np.abs(partials)) @ slopes)
        pairs = [vector(*pair, precision=np.float64) for pair in (slopes, (a, b))]
        arguments = [*pairs, *map(np.float64, trial.parameters)]
        (most,) = result_of(
            bound, bound.reference(), arguments, partial("slopes {}".format, shown(slopes)), 1
        )
        if steepest > most + VALUE_TOLERANCE * (1.0 + abs(most)):
            raise bound.refusal(
                f"{trial.call(a, b)} rises by {steepest:.6g} where its operands rise by {shown(slopes)}, "
                f"more than slope = {most:.6g}"
            )


def _try_interval(trial: _Trial, _formulas: OperatorFormulas, interval: Formula) -> None:
    """Check that F lies in its interval."""
    for low, high, arguments, where in _boxes(trial):
        least, most = result_of(interval, interval.reference(), arguments, where, 2)
        for share in (0.0, 0.3, 1.0):
            for other in (0.0, 0.6, 1.0):
                a, b = low + np.array([share, other]) * (high - low)
                value = trial.value(a, b)
                slack = VALUE_TOLERANCE * (1.0 + abs(value))
                if not least - slack <= value <= most + slack:
                    raise interval.refusal(
                        f"{trial.call(a, b)} = {value:.6g}, outside [{least:.6g}, {most:.6g}] {where()}"
                    )


def _try_keeps(trial: _Trial, _formulas: OperatorFormulas, keeps: Formula) -> None:
    """Check that F is the operand, or 0, that `keeps` says."""
    for low, high, arguments, where in _boxes(trial):
        (kept,) = result_of(keeps, keeps.reference(), arguments, where, 1)
        if kept not in KEPT:
            raise keeps.refusal(f"expected 0, 1, 2 or 3 {where()}, got {kept:g}")
        for a, b in (low, high, 0.5 * (low + high)):
            value, expected = trial.value(a, b), KEPT[kept](a, b)
            if expected is not None and not _near(value, expected):
                raise keeps.refusal(
                    f"{trial.call(a, b)} = {value:.6g}, but it keeps {kept:g}, which says {expected:.6g}, "
                    f"{where()}"
                )


KEPT: dict[float, Callable[[float, float], float | None]] = {
    0.0: lambda a, b: None,
    1.0: lambda a, b: a,
    2.0: lambda a, b: b,
    3.0: lambda a, b: 0.0,
}
"""F by what `keeps` returns; None for anything."""

_CHECKS_OF_FORMULAS: dict[str, Callable[[_Trial, OperatorFormulas, Formula], None]] = {
    "slope": _try_slope,
    "interval": _try_interval,
    "keeps": _try_keeps,
}
"""Checks of formulas that replace what follows from claims."""


def _boxes(trial: _Trial) -> Iterator[tuple[Float64Array, Float64Array, list[Any], Callable[[], str]]]:
    """Yield smallest and largest operands, the arguments of a formula of their ranges, and words for both."""
    rng = np.random.default_rng(SEED)
    for one, other in zip(_operands(rng), _operands(rng), strict=True):
        near = one + rng.choice([0.02, 1.0]) * (other - one) if rng.uniform() < 0.7 else one * [1.0, 0.0]
        low, high = np.minimum(one, near), np.maximum(one, near)
        ranges = [vector(low[i], high[i], precision=np.float64) for i in range(2)]
        arguments = [*ranges, *map(np.float64, trial.parameters)]
        yield low, high, arguments, partial("for operands from {} to {}".format, shown(low), shown(high))
