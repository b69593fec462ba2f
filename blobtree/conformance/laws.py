"""Conformance: the laws that every kind keeps, tried on samples. They cannot prove a law, only refute it.

A law is a function of a `Case`: a node of the kind, and what computes its field. It yields what contradicts
it, or raises `NotChecked`.
"""

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any, Literal, get_args

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from blobtree._typing import Float64Array
from blobtree.conformance.bound_kernels import evaluate_bounds
from blobtree.conformance.plain_field import PlainField
from blobtree.conformance.samples import Rng, drawn_node, falling_ball, points_around, sampled_box
from blobtree.declare.falloff import Falloff
from blobtree.declare.falloff_checks import find_rim
from blobtree.declare.formula import shown
from blobtree.declare.parameters import Parameter, Quantity, parameters_of
from blobtree.errors import InvalidNode
from blobtree.io import from_json, to_json
from blobtree.nodes.node import Node
from blobtree.nodes.primitives import Point
from blobtree.tape.model import evaluate, gradients_at
from blobtree.validation import is_whole, positive_count

Oracle = Callable[..., Any]
"""The field in double precision: values (n,) of (node, points); or of (distances) for a falloff."""

State = Literal["holds", "fails", "not checked"]

SINGLE = 1e-4
"""Largest error of values and gradients in single precision, relative to the largest, absolute below 1."""

DOUBLE = 1e-5
"""The same in double precision: tapes hold numbers in single precision, and pieces yield at their joints."""

AWAY = 2e-3
"""Field values between a point and the nearest kink, as far as an oracle tells, where gradients are tried."""

ROUNDING = 2e-6
"""Rounding of a value in single precision, relative to the largest one."""

FINE_ROUNDING = 1e-8
"""The same in double precision."""

NO_KINK = 1e-3
"""Difference of derivatives of two sides, over their size, at which a point lies on a kink."""

STEP = 1e-6
"""Step of differences, over the size of the node."""

MAX_SAMPLES = 100_000
"""Most nodes that are tried."""

MAX_TEXT = 300
"""Letters of a node in a report."""

POINTS, PLAIN_POINTS, CUBES, PRUNED_CUBES, RAYS, STEPS = 100, 40, 24, 16, 60, 12


class NotChecked(Exception):
    """A law cannot be tried here; the message says why."""


@dataclass(frozen=True)
class Law:
    """What came of one law: its name, its state, and the worst sample or the reason."""

    name: str
    state: State
    detail: str = ""


@dataclass(frozen=True, repr=False)
class KindReport:
    """What came of all laws for a kind.

    Attributes
    ----------
    kind
        The name of its class.
    laws
        One row for each law, in order.
    """

    kind: str
    laws: tuple[Law, ...]

    @property
    def failed(self) -> tuple[Law, ...]:
        """The laws that a sample contradicts."""
        return tuple(law for law in self.laws if law.state == "fails")

    @property
    def conforms(self) -> bool:
        """True if no law failed."""
        return not self.failed

    def __str__(self) -> str:
        width = max(len(law.name) for law in self.laws)
        rows = (f"  {law.name:{width}}  {law.state}{law.detail and ': '}{law.detail}" for law in self.laws)
        return "\n".join([f"{self.kind}:", *rows])

    def __repr__(self) -> str:
        counts = [f"{sum(law.state == state for law in self.laws)} {state}" for state in get_args(State)]
        return f"<KindReport {self.kind}: {', '.join(counts)}>"


@dataclass(frozen=True)
class Contradiction:
    """A sample that contradicts a law, and how far it does."""

    size: float
    text: str


@dataclass(frozen=True, eq=False)
class Case:
    """A node of a kind, with what the laws ask of it."""

    node: Node
    oracle: Oracle | None
    compiled: bool
    rng: Rng

    @cached_property
    def exact(self) -> PlainField:
        """The field in double precision, from the kind's own formulas."""
        return PlainField(self.node.tape)

    @property
    def rounding(self) -> float:
        """The rounding of a value, relative to the largest one."""
        return ROUNDING if self.compiled else FINE_ROUNDING

    def points(self, count: int) -> NDArray[np.float32]:
        """Return points (count, 3) in and around the node's box."""
        return points_around(self.rng, self.node, count, self.values)

    def values(self, points: ArrayLike) -> NDArray[Any]:
        """Return the field (n,) at points (n, 3)."""
        return self.node(points) if self.compiled else self.exact.values(points)

    def gradients(self, points: ArrayLike) -> NDArray[Any]:
        """Return the gradients (n, 3) at points (n, 3)."""
        return gradients_at(self.node.tape, points)[:, 1:] if self.compiled else self.exact.gradients(points)

    def bounds(self, points: Any, directions: Any, reach: Any) -> Float64Array:
        """Return (value, bound on the rise, bound on the fall) along rays up to the lengths `reach` (n,).

        A direction of 0 stands for all directions.
        """
        if not self.compiled:
            return self.exact.bounds(points, directions, reach)
        more: list[Any] = [wp.array(directions, dtype=wp.vec3), wp.array(reach, dtype=wp.float32)]
        return evaluate(evaluate_bounds, self.node.tape, points, wp.vec3, more).astype(np.float64)

    def interval(self, center: Float64Array, half: float) -> tuple[float, float]:
        """Return bounds of the field over the cube center ± half."""
        if self.compiled:
            return self.node.interval(center - half, center + half)
        return self.exact.pruned(center, half)[0]

    def told(self, points: ArrayLike) -> tuple[Float64Array, Float64Array | None]:
        """Return the oracle's values (n,), and how far a kink is from each if it tells."""
        assert self.oracle is not None
        places = np.asarray(points, np.float64)
        try:
            answer = self.oracle(self.node, places)
        except Exception as error:  # whatever an oracle does wrong
            raise InvalidNode(f"oracle: it fails: {type(error).__name__}: {error}") from error
        values, away = answer if isinstance(answer, tuple) else (answer, None)
        values = np.asarray(values, np.float64)
        if values.shape != (len(places),):
            raise InvalidNode(f"oracle: expected values of shape ({len(places)},), got {values.shape}")
        return values, away

    def reference(self, points: ArrayLike) -> tuple[Float64Array, Float64Array]:
        """Return values (n,) in double precision that may be differenced, and how far a kink is from each.

        They are the oracle's if it knows of kinks, and otherwise those of the kind's own formulas.
        """
        values, away = (None, None) if self.oracle is None else self.told(points)
        if values is not None and away is not None:
            return values, away
        return self.exact.values(points), np.full(len(np.asarray(points)), np.inf)


Contradictions = Iterator[Contradiction]
LawFunction = Callable[[Case], Contradictions]


# -- laws of fields -------------------------------------------------------------------------------------


def _compared(
    what: str, seen: NDArray[Any], expected: NDArray[Any], points: NDArray[Any], tolerance: float
) -> Contradictions:
    """Yield the point with the largest difference, if that exceeds the tolerance."""
    error = np.abs(seen - expected)
    error = error.reshape(len(error), -1).max(axis=1, initial=0.0) / max(
        1.0, np.abs(expected).max(initial=0.0)
    )
    error = np.where(np.isfinite(error), error, np.inf)
    if error.max(initial=0.0) > tolerance:
        at = int(error.argmax())
        yield Contradiction(
            float(error[at]),
            f"{what} at {shown(points[at])} is {shown(seen[at])}, expected {shown(expected[at])}",
        )


def values_match(case: Case) -> Contradictions:
    """Compare the field with the oracle's."""
    if case.oracle is None:
        raise NotChecked("no oracle is given")
    points = case.points(POINTS)
    tolerance = SINGLE if case.compiled else DOUBLE
    yield from _compared("the field", case.values(points), case.told(points)[0], points, tolerance)


def single_precision_suffices(case: Case) -> Contradictions:
    """Compare the field in single precision with the same formulas in double precision."""
    points = case.points(PLAIN_POINTS)
    seen = case.values(points) if case.compiled else PlainField(case.node.tape, np.float32).values(points)
    yield from _compared("the field in single precision", seen, case.exact.values(points), points, SINGLE)


def gradients_match(case: Case) -> Contradictions:
    """Compare gradients with differences of the field in double precision, away from kinks."""
    points = case.points(POINTS)
    seen = case.gradients(points)
    size = float(np.max(np.subtract(*sampled_box(case.node)[::-1])))
    step = STEP * size
    shifts = step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    moved = (points.astype(np.float64) + shifts[:, None]).reshape(-1, 3)
    values, away = (part.reshape(7, -1) for part in case.reference(moved))
    right, left = (values[1:4] - values[0]).T / step, (values[0] - values[4:]).T / step
    expected = 0.5 * (right + left)
    scale = max(1.0, float(np.abs(expected).max()))
    smooth = (np.abs(right - left).max(axis=1) < NO_KINK * scale) & (away[0] > AWAY)
    if smooth.mean() < 0.1:
        raise NotChecked("samples lie on kinks")
    tolerance = SINGLE if case.compiled else DOUBLE
    yield from _compared("the gradient", seen[smooth], expected[smooth], points[smooth], tolerance)


def _cube(case: Case, center: Any, smallest: float) -> tuple[Float64Array, float, NDArray[np.float32]]:
    """Return a cube of a random size, and points in it, half of them at its corners and faces."""
    half = float(10.0 ** case.rng.uniform(smallest, 0.0))
    offsets = case.rng.uniform(-1.0, 1.0, (32, 3))
    offsets[::2] = np.clip(3.0 * offsets[::2], -1.0, 1.0)
    middle = np.asarray(center, np.float64)
    return middle, half, (middle + half * offsets).astype(np.float32)


def intervals_hold(case: Case) -> Contradictions:
    """Sample values in cubes, which their intervals must contain."""
    for center in case.points(CUBES):
        middle, half, points = _cube(case, center, -4.0)
        (low, high), values = case.interval(middle, half), case.values(points)
        slack = case.rounding * max(1.0, float(np.abs(values).max()))
        excess = max(low - values.min(), values.max() - high)
        if not excess <= slack:
            at = int(values.argmax() if values.max() - high > low - values.min() else values.argmin())
            yield Contradiction(
                float(excess),
                f"the field at {shown(points[at])} is {values[at]:.7g}, outside [{low:.7g}, {high:.7g}], "
                f"its interval over the cube {shown(middle)} ± {half:.6g}",
            )


def pruning_changes_nothing(case: Case) -> Contradictions:
    """Compare the pruned tapes of cubes with the whole one, in double precision."""
    for center in case.points(PRUNED_CUBES):
        middle, half, points = _cube(case, center, -2.0)
        points = points[:6]
        pruned = case.exact.pruned(middle, half)[1]
        yield from _compared(
            f"the pruned field over the cube {shown(middle)} ± {half:.6g}",
            pruned.values(points),
            case.exact.values(points),
            points,
            DOUBLE,
        )


def slopes_hold(case: Case) -> Contradictions:
    """Sample rays and balls, on which no field may change faster than its bounds."""
    starts, rng = case.points(RAYS), case.rng
    reach = (10.0 ** rng.uniform(-3.5, 0.5, RAYS)).astype(np.float32)
    headings = rng.normal(size=(RAYS, 3))
    headings[::2] = case.gradients(starts[::2]) * rng.choice([-1.0, 1.0], (len(starts[::2]), 1))
    lengths = np.linalg.norm(headings, axis=1, keepdims=True)
    headings = np.where(lengths > 0.0, headings / np.where(lengths > 0.0, lengths, 1.0), [[1.0, 0.0, 0.0]])
    headings = headings.astype(np.float32)
    claimed = headings.copy()
    claimed[::3] = 0.0  # bounds in all directions
    value, rise, fall = case.bounds(starts, claimed, reach).T
    distance = reach * np.linspace(1.0 / STEPS, 1.0, STEPS)[:, None]
    places = starts.astype(np.float64) + headings.astype(np.float64) * distance[..., None]
    rows = places.reshape(-1, 3)
    ahead = case.values(rows.astype(np.float32) if case.compiled else rows).reshape(STEPS, RAYS)
    change = ahead.astype(np.float64) - value
    steepest = np.maximum(np.abs(rise), np.abs(fall))
    slack = 2.0 * case.rounding * np.maximum(1.0, np.abs(value))
    if case.compiled:  # samples lie where single precision has a number
        slack = slack + 4e-7 * np.abs(places).max() * np.minimum(steepest, 1e6)
    excess = np.maximum(change - rise * distance, -change - fall * distance) - slack
    excess = np.where(np.isfinite(excess), excess, np.inf)
    if excess.max() > 0.0:
        at = np.unravel_index(int(excess.argmax()), excess.shape)
        yield Contradiction(
            float(excess[at]),
            f"from {shown(starts[at[1]])} to {shown(places[at])} the field changes by {change[at]:.7g}, more "
            f"than a rise of {rise[at[1]]:.6g} or a fall of {fall[at[1]]:.6g} per unit allows",
        )
    own = case.values(starts)
    yield from _compared("the value beside a bound", value, own, starts, SINGLE if case.compiled else DOUBLE)


def box_holds_the_field(case: Case) -> Contradictions:
    """Sample values outside the support, half of them just outside its faces, which must be 0."""
    lower, upper = sampled_box(case.node)
    margin = float((upper - lower).max())
    points = case.rng.uniform(lower - 0.1 * margin, upper + 0.1 * margin, (8 * POINTS, 3))
    for number, (axis, side) in enumerate(product(range(3), (0, 1))):
        face = lower[axis] - 1e-4 * margin if side == 0 else upper[axis] + 1e-4 * margin
        points[number : 6 * POINTS : 6, axis] = face
    single = points.astype(np.float32)
    lower, upper = (corner.astype(np.float64) for corner in case.node.field_box)
    outside = single[((single < lower) | (single > upper)).any(axis=1)]
    yield from _compared(
        "the field outside its box", case.values(outside), np.zeros(len(outside)), outside, 0.0
    )


def maps_move_the_field(case: Case) -> Contradictions:
    """Compare the node under a motion, a mirroring, a similarity and another affine map with the node itself.

    An operator that reads gradients may see angles and lengths, which the last two change.
    """
    points = case.points(POINTS // 2).astype(np.float64)
    turn = Rotation.random(random_state=case.rng).as_matrix()
    factors = case.rng.uniform(0.5, 2.0, 3)
    scales = [np.ones(3), np.array([1.0, 1.0, -1.0]), factors[:1] * np.ones(3), factors]
    for scale in scales[: 2 if case.node.tape.instruction_set.reads_gradients else None]:
        linear, offset = turn * scale, case.rng.uniform(-1.0, 1.0, 3)
        matrix = np.column_stack([linear, offset])
        there = points @ linear.T + offset
        placed = replace(case, node=case.node.transform(matrix))
        yield from _compared(
            f"the field under the map {shown(matrix)}",
            placed.values(there),
            case.values(points),
            there,
            SINGLE if case.compiled else DOUBLE,
        )


# -- laws of values -------------------------------------------------------------------------------------


def _copied(copy: Callable[[Node], Any], case: Case) -> Contradictions:
    other = copy(case.node)
    if other != case.node:
        yield Contradiction(1.0, f"it gives another node, {other!r:.200}")


def bad_values_are_refused(case: Case) -> Contradictions:
    """Pass NaN, infinity, −1 and mostly 0 for sizes: the class must refuse them."""
    node: Any = case.node
    for name, parameter in parameters_of(type(node)).items():
        for wrong in _bad_values(parameter, getattr(node, name)):
            try:
                replace(node, **{name: wrong}).tape  # noqa: B018  (kinds may refuse as late as here)
            except InvalidNode:
                continue
            yield Contradiction(1.0, f"{name} = {wrong!r} is accepted")


def _bad_values(parameter: Parameter, value: Any) -> list[Any]:
    sizes = (Quantity.LENGTH, Quantity.RADIUS, Quantity.WIDTH)
    bad: list[Any] = [0.0, -1.0] if parameter.quantity in sizes else []
    bad = bad[parameter.low == 0.0 :]  # some solids have radius 0
    if isinstance(value, float) or parameter.quantity in sizes:
        return [*bad, float("nan"), float("inf")]
    if isinstance(value, tuple) and value and isinstance(value[0], float):
        return [(float("nan"), *value[1:])]
    return bad


LAWS: dict[str, LawFunction] = {
    "value": values_match,
    "single precision": single_precision_suffices,
    "gradient": gradients_match,
    "interval": intervals_hold,
    "pruning": pruning_changes_nothing,
    "Lipschitz bound": slopes_hold,
    "box": box_holds_the_field,
    "maps": maps_move_the_field,
    "file": partial(_copied, lambda node: from_json(to_json(node))),
    "pickle": partial(_copied, lambda node: pickle.loads(pickle.dumps(node))),
    "refusals": bad_values_are_refused,
}
"""The laws by their names."""


# -- the suite ------------------------------------------------------------------------------------------


def check_kind(
    kind: type[Node] | type[Falloff],
    oracle: Oracle | None = None,
    *,
    sample: Callable[[Rng], Node] | None = None,
    samples: int = 4,
    seed: int = 0,
    compiled: bool = False,
    show: Callable[[object], object] | None = print,
) -> KindReport:
    """Try all laws of kinds on samples of one kind, and print what holds.

    The laws are: the value is the oracle's, and survives single precision; the gradient is the derivative;
    the interval of a cube contains its values; a pruned tape gives the same values; no ray is steeper than
    its Lipschitz bound; the field is 0 outside the box; maps move the field; files and pickles give the node
    back; bad parameters are refused.

    Parameters
    ----------
    kind
        A class of nodes or of falloffs, of the library or of your own.
    oracle
        An independent formula in double precision: a function of a node and points (n, 3) that returns the
        field (n,); for a falloff a function of distances (n,) from 0 to 1. Without it the value is not
        checked. It may return a pair: values, and how far from the nearest kink each is, in field values.
        Then its differences are what gradients are compared with, in place of those of the kind's own
        formulas in double precision.
    sample
        A function of a random generator that returns a node to try. By default parameters are drawn from
        their declarations, and operands are balls.
    samples
        Number of nodes, at most 100,000.
    seed
        Seed of all random numbers.
    compiled
        Try the compiled kernels. By default the same formulas run in plain Python, and nothing is compiled.
    show
        What gets the report; None for nothing.

    Returns
    -------
    KindReport
        A row for each law (`laws`): its name, its state ("holds", "fails" or "not checked"), and the worst
        sample or the reason. Its `failed` are the laws that failed, and `conforms` is True if there are none.

    Raises
    ------
    InvalidNode
        `kind` is no class of nodes or falloffs, no drawn parameters make a valid node, or another argument is
        invalid.

    Examples
    --------
    >>> import numpy as np
    >>> from blobtree import Union, check_kind
    >>> report = check_kind(Union, lambda node, q: [a(q) for a in node.operands], samples=1, show=None)
    >>> report.failed[0].name
    'value'
    >>> right = lambda node, q: np.max([a(q) for a in node.operands], axis=0)
    >>> check_kind(Union, right, samples=1, show=None).conforms
    True
    """
    for name, function in (("oracle", oracle), ("sample", sample), ("show", show)):
        if function is not None and not callable(function):
            raise InvalidNode(f"{name}: expected a function or None, got {function!r:.200}")
    samples = positive_count("samples", samples, InvalidNode)
    if samples > MAX_SAMPLES:
        raise InvalidNode(f"samples: expected at most {MAX_SAMPLES:,}, got more; give fewer")
    if not is_whole(seed) or seed < 0:
        raise InvalidNode(f"seed: expected a whole number from 0, got {seed!r:.200}")
    draw = sample
    if isinstance(kind, type) and issubclass(kind, Falloff) and kind is not Falloff:
        draw, oracle = draw or falling_ball(kind()), oracle and _of_balls(oracle)
    elif not (isinstance(kind, type) and issubclass(kind, Node)):
        raise InvalidNode(f"kind: expected a class of nodes or of falloffs, got {kind!r:.200}")
    elif draw is None:
        draw = partial(drawn_node, kind)
    nodes = [draw(np.random.default_rng([seed, number])) for number in range(samples)]
    if sample is not None and not all(isinstance(node, Node) for node in nodes):
        raise InvalidNode(f"sample: expected a function that returns a node, got {nodes[0]!r:.200} from it")
    rows = []
    for place, (name, law) in enumerate(LAWS.items()):
        cases = (
            Case(node, oracle, compiled, np.random.default_rng([seed, number, place]))
            for number, node in enumerate(nodes)
        )
        rows.append(_tried(name, law, cases))
    report = KindReport(kind.__name__, tuple(rows))
    if show is not None:
        show(report)
    return report


def _tried(name: str, law: LawFunction, cases: Iterator[Case]) -> Law:
    """Return the outcome of a law, which is "not checked" if the law can be tried on no sample."""
    worst: Contradiction | None = None
    checked, reason = False, ""
    for case in cases:
        try:
            found = list(law(case))
        except NotChecked as obstacle:
            reason = str(obstacle)
            continue
        except Exception as error:  # whatever a kind does wrong
            found = [Contradiction(np.inf, f"{type(error).__name__}: {error}")]
        checked = True
        for one in found:
            if worst is None or one.size > worst.size:
                worst = replace(one, text=f"{one.text}, for {_shortened(repr(case.node))}")
    if worst is not None:
        return Law(name, "fails", worst.text)
    return Law(name, "holds") if checked else Law(name, "not checked", reason)


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_TEXT else f"{text[:MAX_TEXT]}…"


def _of_balls(oracle: Oracle) -> Oracle:
    """Return the oracle of balls with a falloff whose own oracle is given."""
    try:
        rim = find_rim(lambda distances: np.asarray(oracle(distances), np.float64))
    except Exception as error:  # whatever an oracle does wrong
        raise InvalidNode(
            f"oracle: expected a function of distances (n,) that returns the falloff (n,); it fails: {error}"
        ) from error

    def field(ball: Point, points: Float64Array) -> Float64Array:
        radii = np.linalg.norm(points - np.array(ball.center), axis=1) / ball.radius
        rate = 1.0 if ball.width is None else ball.radius * (1.0 / rim - 1.0) / ball.width
        return np.asarray(oracle(np.clip(rim * (1.0 + rate * (radii - 1.0)), 0.0, 1.0)), np.float64)

    return field
