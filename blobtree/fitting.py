"""Fitting: the parameters of a tree, recovered from samples of its surface or of its field.

Nonlinear least squares (Levenberg 1944; trust regions of Branch, Coleman & Li 1999, as in SciPy) over the
numbers of a tree, with the exact Jacobian of `parameter_gradient`. The structure of the tree stays. A field
does not depend on the length of a direction; one more equation for each keeps that length.
"""

import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array, IndexArray
from blobtree.declare.parameters import Quantity
from blobtree.errors import InvalidNode, InvalidPoints
from blobtree.formulas.falloff import ISO
from blobtree.nodes.node import Node
from blobtree.nodes.numeric_parameters import (
    NumericParameter,
    Path,
    numeric_parameters,
    numeric_values,
    with_numeric_values,
)
from blobtree.nodes.parameter_gradient import gradient_sensitivities, parameter_gradient_of
from blobtree.progress import Cancel, Progress, reporting
from blobtree.tape.model import checked_tree, gradients_at
from blobtree.validation import describe, items, point_array, positive_count, positive_number, real

MAX_EVALUATIONS = 60
TOLERANCE = 1e-9
NORMAL_WEIGHT = 0.1
LARGEST_EXACT = 10_000_000
"""Size of a problem, residuals · parameters², above which steps are computed by iteration (LSMR)."""

SMALLEST_PART = 1e-3
"""Part of its start value below which a length that must be above 0 does not fall."""

_POSITIVE = (Quantity.RADIUS, Quantity.LENGTH, Quantity.SEMI_AXES)

Selection = str | Path | NumericParameter
"""Parameters of a name; of the node at a path and those below it; or one parameter."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of `fit`.

    Attributes
    ----------
    tree
        The tree with the fitted parameters.
    parameters
        The p parameters that were free.
    values
        float64[p]: their fitted values.
    covariance
        float64[p, p]: their covariance for independent errors of the samples, estimated from the residuals. A
        parameter that no sample depends on has an infinite variance.
    residuals
        float64[n]: field minus expected value at each sample.
    normal_residuals
        float64[n, 3]: difference of unit normals, None without normals.
    converged
        False if the limit of evaluations ended the fit.
    message
        Why it ended.
    evaluations
        Number of trees that were evaluated.

    Examples
    --------
    >>> from blobtree import Fit, Point, fit
    >>> samples = [[2, 0, 0], [0, 2, 0], [0, 0, 2], [-2, 0, 0]]
    >>> found = fit(Point((0, 0, 0), radius=1.8), samples, fixed=["center"])
    >>> isinstance(found, Fit), found.converged, round(found.tree.radius, 3)
    (True, True, 2.0)
    >>> [str(parameter) for parameter in found.parameters]
    ['root: radius']
    """

    tree: Node
    parameters: tuple[NumericParameter, ...]
    values: Float64Array
    covariance: Float64Array
    residuals: Float64Array
    normal_residuals: Float64Array | None
    converged: bool
    message: str
    evaluations: int

    @property
    def standard_errors(self) -> Float64Array:
        """Standard errors (p,) of the values."""
        result: Float64Array = np.sqrt(np.diag(self.covariance))
        return result


def fit(
    tree: Node,
    points: ArrayLike,
    values: ArrayLike | None = None,
    *,
    normals: ArrayLike | None = None,
    fixed: Iterable[Selection] | None = None,
    normal_weight: float = NORMAL_WEIGHT,
    max_evaluations: int = MAX_EVALUATIONS,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Return a tree of the same structure whose surface, or field, passes through samples.

    The sum of squared differences of the field, and of unit normals, is minimised from the parameters of
    `tree` on. So the start must be near: a sample beyond the influence of every primitive attracts none.
    Parameters keep their declared ranges.

    Parameters
    ----------
    tree : Node
        The tree to start from.
    points : array-like (n, 3)
        Samples, in model units.
    values : array-like (n,), optional
        Field values at the samples; by default 0.5, that is, the samples lie on the surface.
    normals : array-like (n, 3), optional
        Outward normals of the surface at the samples, of any length above 0.
    fixed : iterable, optional
        Parameters to keep: names such as "radius"; paths of nodes such as (0, 1), for all parameters at and
        below them; or parameters from `numeric_parameters`. By default the maps of `Transform` nodes; ()
        frees all.
    normal_weight : float
        Weight of a difference of normals, in units of the field.
    max_evaluations : int
        Number of trees after which the fit ends at the best one.
    progress, cancel : callable, optional
        As for `polygonize`.

    Returns
    -------
    Fit
        The tree, with residuals and the covariance of its parameters.

    Raises
    ------
    InvalidNode
        No parameter is free, `fixed` names what the tree does not have, or an option is out of range.
    InvalidPoints
        The samples are not n rows of finite numbers, fewer numbers than parameters, or all out of reach.
    Cancelled
        `cancel` returned True.

    Examples
    --------
    >>> import numpy as np
    >>> from blobtree import Point, fit
    >>> way = np.random.default_rng(0).normal(size=(100, 3))
    >>> samples = 2.0 * way / np.linalg.norm(way, axis=1, keepdims=True) + [0.5, 0, 0]
    >>> found = fit(Point((0, 0, 0), radius=1.5), samples).tree
    >>> [round(x, 3) + 0.0 for x in (*found.center, found.radius)]
    [0.5, 0.0, 0.0, 2.0]
    """
    from scipy.optimize import least_squares

    checked_tree(tree)
    samples = _Samples(point_array(points), values, normals, normal_weight)
    most = positive_count("max_evaluations", max_evaluations, InvalidNode)
    free = _free(tree, fixed)
    if samples.count < len(free):
        raise InvalidPoints(
            f"points: expected at least as many numbers as free parameters ({len(free)}), got {samples.count}"
        )
    if not tree(samples.points).any():
        raise InvalidPoints(
            "points: expected samples within reach of the start's field, got none; move or enlarge the start"
        )
    start = numeric_values(tree, free)
    lower, upper = _ranges(free, start)
    with reporting(progress, cancel) as report:
        problem = _Problem(tree, free, samples, report, most)
        result = least_squares(
            problem.residuals,
            np.clip(start, lower, upper),
            problem.jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=None,
            tr_solver="lsmr" if samples.size * len(free) ** 2 > LARGEST_EXACT else "exact",
            max_nfev=most,
        )
    field, directions = samples.split(result.fun[: samples.size])
    return Fit(
        tree=problem.tree_of(result.x),
        parameters=free,
        values=result.x,
        covariance=_covariance(result.jac, result.fun),
        residuals=field,
        normal_residuals=directions,
        converged=result.status > 0,
        message=str(result.message),
        evaluations=int(result.nfev),
    )


class _Samples:
    """Samples, and what a tree has to say about them."""

    def __init__(
        self, points: Float32Array, values: ArrayLike | None, normals: ArrayLike | None, weight: float
    ) -> None:
        self.points = points
        self.weight = positive_number("normal_weight", weight)
        try:
            self.values = np.asarray(
                real(np.full(len(points), ISO) if values is None else values), np.float64
            )
        except (TypeError, ValueError, OverflowError):
            self.values = np.empty((0, 0))
        if self.values.shape != (len(points),) or not np.isfinite(self.values).all():
            raise InvalidPoints(
                f"values: expected {len(points)} finite numbers, got {reprlib.repr(values)}; "
                "give one field value per point"
            )
        self.normals: Float64Array | None = None
        if normals is not None:
            rows = point_array(normals, "normals").astype(np.float64)
            lengths = np.linalg.norm(rows, axis=1, keepdims=True)
            if rows.shape != points.shape or not lengths.all():
                raise InvalidPoints(
                    f"normals: expected {len(points)} vectors of a length above 0, got others"
                )
            self.normals = rows / lengths

    @property
    def count(self) -> int:
        """Number of independent equations; a unit normal has two."""
        return len(self.points) * (1 if self.normals is None else 3)

    @property
    def size(self) -> int:
        """Number of residuals."""
        return len(self.points) * (1 if self.normals is None else 4)

    def residuals(self, tree: Node) -> Float64Array:
        """Return the weighted differences (m,)."""
        if self.normals is None:
            return tree(self.points).astype(np.float64) - self.values
        f = gradients_at(tree.tape, self.points).astype(np.float64)
        normals, _ = _unit_normals(f[:, 1:])
        return np.concatenate([f[:, 0] - self.values, (self.weight * (normals - self.normals)).ravel()])

    def jacobian(self, tree: Node, parameters: Sequence[NumericParameter]) -> Float64Array:
        """Return the derivatives (m, p) of the differences."""
        if self.normals is None:
            return parameter_gradient_of(tree, self.points, parameters).values.astype(np.float64)
        change = gradient_sensitivities(tree, self.points, parameters).astype(np.float64)
        normals, lengths = _unit_normals(gradients_at(tree.tape, self.points)[:, 1:].astype(np.float64))
        turned = -change[:, :, 1:] / lengths[:, :, None]
        turned -= np.einsum("npi,ni->np", turned, normals)[:, :, None] * normals[:, None]
        rows = self.weight * turned.transpose(0, 2, 1).reshape(-1, len(parameters))
        return np.concatenate([change[:, :, 0], rows])

    def split(self, residuals: Float64Array) -> tuple[Float64Array, Float64Array | None]:
        """Return the differences of the field and those of the normals."""
        count = len(self.points)
        if self.normals is None:
            return residuals, None
        return residuals[:count], residuals[count:].reshape(-1, 3) / self.weight


def _unit_normals(gradients: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return outward unit normals (n, 3) and slopes (n, 1); a flat field has the normal 0 and slope 1."""
    lengths = np.linalg.norm(gradients, axis=1, keepdims=True)
    lengths[lengths == 0.0] = np.inf
    return -gradients / lengths, lengths


class _Problem:
    """The least-squares problem: residuals and Jacobian as functions of the free parameters."""

    def __init__(
        self,
        tree: Node,
        free: tuple[NumericParameter, ...],
        samples: _Samples,
        report: Progress,
        max_evaluations: int,
    ) -> None:
        self.start = tree
        self.free = free
        self.samples = samples
        self.report = report
        self.max_evaluations = max_evaluations
        self.evaluations = 0
        self.directions = _direction_columns(free)
        self.lengths = self.lengths_of(numeric_values(tree, free))

    def tree_of(self, values: Float64Array) -> Node:
        return with_numeric_values(self.start, self.free, values)

    def lengths_of(self, values: Float64Array) -> Float64Array:
        """Return the lengths of the directions among the parameters."""
        result: Float64Array = np.linalg.norm(values[self.directions], axis=1)
        return result

    def residuals(self, values: Float64Array) -> Float64Array:
        self.report("fitting", min(self.evaluations / self.max_evaluations, 1.0))
        self.evaluations += 1
        try:
            seen = self.samples.residuals(self.tree_of(values))
        except InvalidNode:
            if self.evaluations == 1:
                raise
            seen = np.full(self.samples.size, np.inf)  # SciPy tries a shorter step
        return np.concatenate([seen, self.lengths_of(values) / self.lengths - 1.0])

    def jacobian(self, values: Float64Array) -> Float64Array:
        seen = self.samples.jacobian(self.tree_of(values), self.free)
        keeping = np.zeros((len(self.directions), len(self.free)))
        units = values[self.directions] / (self.lengths_of(values) * self.lengths)[:, None]
        keeping[np.arange(len(self.directions))[:, None], self.directions] = units
        return np.concatenate([seen, keeping])


def _direction_columns(parameters: Sequence[NumericParameter]) -> IndexArray:
    """Return the columns (k, 3) of the directions whose components all are among the parameters."""
    columns = {(p.path, p.name, p.index): column for column, p in enumerate(parameters)}
    rows = [
        [columns.get((p.path, p.name, (i,)), -1) for i in range(3)]
        for p in parameters
        if p.declaration.quantity is Quantity.DIRECTION and p.index == (0,)
    ]
    return np.array([row for row in rows if min(row) >= 0], np.intp).reshape(-1, 3)


def _free(tree: Node, fixed: Iterable[Selection] | None) -> tuple[NumericParameter, ...]:
    """Return the parameters that no selection fixes."""
    parameters = numeric_parameters(tree)
    if fixed is None:
        kept = {p for p in parameters if p.declaration.quantity is Quantity.MATRIX}
    else:
        selections = items(fixed)
        if selections is None or not all(
            isinstance(one, NumericParameter) or items(one) is not None for one in selections
        ):
            raise InvalidNode(f"fixed: expected names of parameters or paths of nodes, got {describe(fixed)}")
        kept = set()
        for selection in selections:
            chosen = {parameter for parameter in parameters if _selects(selection, parameter)}
            if not chosen:
                names = ", ".join(sorted({parameter.name for parameter in parameters}))
                raise InvalidNode(
                    f"fixed: expected names of parameters ({names}), paths of nodes or parameters of the "
                    f"tree, got {selection!r}"
                )
            kept |= chosen
    free = tuple(parameter for parameter in parameters if parameter not in kept)
    if not free:
        raise InvalidNode("fixed: expected some parameters to stay free, got all of them; leave some out")
    return free


def _selects(selection: Selection, parameter: NumericParameter) -> bool:
    if isinstance(selection, NumericParameter):
        return parameter == selection
    if isinstance(selection, str):
        return parameter.name == selection
    return parameter.path[: len(selection)] == tuple(selection)


def _ranges(parameters: Sequence[NumericParameter], start: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return the smallest and largest values of parameters, by their declarations."""
    lower, upper = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    for column, parameter in enumerate(parameters):
        declaration = parameter.declaration
        if declaration.quantity in _POSITIVE:
            lower[column] = SMALLEST_PART * start[column]
        elif declaration.quantity is Quantity.EXTENTS:
            lower[column] = 0.0
        if not parameter.index:
            lower[column] = max(lower[column], declaration.low)
            upper[column] = declaration.high
    return lower, upper


def _covariance(jacobian: Float64Array, residuals: Float64Array) -> Float64Array:
    """Return s² (JᵀJ)⁻¹, of least norm where that is singular; s² is the residuals' mean square."""
    scales = np.linalg.norm(jacobian, axis=0)
    known = scales > 0.0
    scales[~known] = 1.0
    normal: Any = (jacobian / scales).T @ (jacobian / scales)
    rank = int(np.linalg.matrix_rank(normal, tol=1e-10, hermitian=True))
    variance = float(residuals @ residuals) / max(len(residuals) - rank, 1)
    covariance: Float64Array = variance * np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
    covariance /= scales[:, None] * scales
    covariance[~known, ~known] = np.inf
    return covariance
