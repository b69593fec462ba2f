"""The measures that formulas of lessons can name."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from blobtree import Node, Point, SolidContact, polygonize
from blobtree._typing import Float64Array
from blobtree.formulas.falloff import RIM
from blobtree.meshing.clip import enclosed_volume
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.experiment import MAP_PIXELS, Experiment, Points, Scope, as_index
from decals.apps.lab.formulas import Evaluate, Measure
from decals.field.evaluate import Samples, evaluate
from decals.field.jacobian import folds_of, stretch_of
from decals.field.walks import evaluation_options
from decals.model import Interaction
from decals.record import Contact
from decals.scenes.objects import TreeObject

UNIT_BALL = Point((0, 0, 0), radius=RIM)
"""A primitive whose field at distance d is g(d)."""

STEP = 1e-3
"""Distance between the points at which `jump` looks, in model units."""

MAX_STEPS = 20_000
"""Most points at which it looks."""

RESOLUTION = 48
"""Cells along the longest side of a solid."""

FINE_RESOLUTION = 128
"""The same of solids that do not deform each other, whose edges may be sharp."""

BULGED = 1e-3
"""Field below ½ at which a deformed solid counts as bulged."""

Function = TypeVar("Function", bound=Callable[..., Any])

Model = TypeVar("Model", bound=Node)

MEASURES: dict[str, Measure] = {}
"""All measures, by their names."""


def measure(*arguments: str) -> Callable[[Function], Function]:
    """Register a function as a measure of its name; see `Measure` for the kinds of arguments."""

    def register(function: Function) -> Function:
        MEASURES[function.__name__] = Measure(function, arguments)
        return function

    return register


for _kind in (*Contact, *Interaction):
    MEASURES[_kind.name.lower()] = Measure(lambda scope, value=float(_kind): value, ())

# -- arithmetic -----------------------------------------------------------------------------------------


@measure("number")
def g(_scope: Scope, d: Any) -> Float64Array:
    """Return the falloff g of a distance over the influence radius (paper, equation 2)."""
    flat = np.ravel(np.asarray(d, np.float64))
    values = UNIT_BALL(np.column_stack([flat, 0.0 * flat, 0.0 * flat]).astype(np.float32))
    return np.asarray(values, np.float64).reshape(np.shape(d))


@measure("number")
def absolute(_scope: Scope, a: Any) -> Any:
    """Return the absolute value."""
    return np.abs(a)


@measure("number", "number")
def largest(_scope: Scope, a: Any, b: Any) -> Any:
    """Return the larger one of two numbers."""
    return np.maximum(a, b)


@measure("number", "number", "number")
def where(_scope: Scope, condition: Any, a: Any, b: Any) -> Any:
    """Return the second argument where the first holds, else the third."""
    return np.where(condition, a, b)


# -- numbers of the scene -------------------------------------------------------------------------------


@measure()
def count(scope: Scope) -> int:
    """Return the number of decals."""
    return len(scope.experiment.decals)


@measure("number", "number")
def distance(scope: Scope, i: Any, k: Any) -> float:
    """Return the distance between the centres of decals i and k."""
    place, other = (_center(scope.experiment, number) for number in (i, k))
    return float(np.linalg.norm(place - other))


def _value(scope: Scope, column: str, number: Any) -> Any:
    """Return the value of a decal in an array of `decals.Decals`."""
    return getattr(scope.experiment.decals, column)[scope.experiment.decal(number)].item()


DECAL_COLUMNS = {
    "radius": "radii",
    "influence": "influence",
    "layer": "layers",
    "interaction": "interactions",
}
"""Arrays of decals by the names of measures: visible and influence radius, layer and interaction."""

for _name, _column in DECAL_COLUMNS.items():
    MEASURES[_name] = Measure(lambda scope, i, column=_column: _value(scope, column, i), ("number",))


@measure()
def contact(scope: Scope) -> int:
    """Return the contact mode: product, min, radial or elastic."""
    return int(scope.experiment.rules.contact)


@measure()
def stiffness(scope: Scope) -> float:
    """Return the stiffness of elastic contact."""
    return scope.experiment.rules.stiffness


# -- fields of decals at points -------------------------------------------------------------------------


def _center(experiment: Experiment, number: Any) -> Float64Array:
    return np.asarray(experiment.decals.positions[experiment.decal(number)], np.float64)


@measure("number")
def d(scope: Scope, i: Any) -> Float64Array:
    """Return the distance from decal i over its influence radius."""
    offsets = scope.points.positions - _center(scope.experiment, i)
    return np.asarray(np.linalg.norm(offsets, axis=1) / _value(scope, "influence", i))


@measure("number")
def f(scope: Scope, i: Any) -> Float64Array:
    """Return the field of decal i before contact (paper, equation 1)."""
    return g(scope, d(scope, i))


@measure("number", "number")
def h(scope: Scope, i: Any, k: Any) -> Float64Array:
    """Return the factor h by which decal i pushes decal k (paper, equation 5)."""
    own, other = f(scope, k), f(scope, i)
    return np.where((own >= 0.5) & (own >= other), _factor(own, other), np.nan)


def _factor(own: Any, other: Any) -> Float64Array:
    """Return the factor h of equation 5 of the owner's field, at least ½, and a neighbour's lower one."""
    with np.errstate(all="ignore"):
        u = np.clip((own + other - 1.0) / (2.0 * own - 1.0), 0.0, 1.0)
        return np.where((own + other <= 1.0) | (own >= 1.0), 1.0, 1.0 - u ** (1.0 / (1.0 - own)))


@measure("number", "number")
def pushed(_scope: Scope, own: Any, other: Any) -> Float64Array:
    """Return F of an owner's field and a neighbour's lower one (paper, figure 7); NaN for a higher one."""
    own, other = np.clip(own, 0.0, 1.0), np.clip(other, 0.0, 1.0)
    deformed = np.where(own >= 0.5, 0.5 + (own - 0.5) * _factor(own, other), own)
    return np.where(other > own, np.nan, deformed)


@measure()
def top(scope: Scope) -> Float64Array:
    """Return the highest field of all decals before contact."""
    numbers = range(len(scope.experiment.decals))
    distances = [d(scope, number) for number in numbers]
    return g(scope, np.min(distances, axis=0) if distances else np.ones(len(scope.points.positions)))


def _samples(scope: Scope, *, jacobian: bool = False) -> Samples:
    points, experiment = scope.points, scope.experiment
    return evaluate(
        experiment.decals,
        points.positions.astype(np.float32),
        points.normals.astype(np.float32),
        jacobian=jacobian,
        normal_derivatives=experiment.normal_derivatives(points) if jacobian else None,
        device="cpu",
        **evaluation_options(experiment.rules, experiment.decals, experiment.objects),
    )


def _shown(scope: Scope) -> Samples:
    result: Samples = scope.shared("samples", lambda: _samples(scope))
    return result


@measure()
def F(scope: Scope) -> Float64Array:  # noqa: N802  (the paper's name)
    """Return the field after contact, in the contact mode of the view."""
    samples = _shown(scope)
    return np.where(samples.owner >= 0, samples.field, np.minimum(top(scope), 0.5))


@measure()
def owner(scope: Scope) -> Float64Array:
    """Return the number of the decal that shows; −1 for none."""
    return _shown(scope).owner.astype(np.float64)


@measure()
def stretch(scope: Scope) -> Float64Array:
    """Return by how much the image is stretched along a surface: 1 keeps shapes."""
    maps = _jacobians(scope)
    known = np.isfinite(maps[:, 0, 0]) & scope.points.normals.any(axis=1)
    return np.where(known, stretch_of(np.nan_to_num(maps)), np.nan)


@measure()
def folded(scope: Scope) -> Float64Array:
    """Return 1 where the image is folded, which means mirrored, else 0."""
    return np.where(folds_of(_jacobians(scope), scope.points.normals), 1.0, 0.0)


def _jacobians(scope: Scope) -> Float64Array:
    """Return derivatives of the image coordinates along the surface: float64[n, 2, 3]."""
    result: Float64Array = scope.shared("jacobians", lambda: _samples(scope, jacobian=True).jacobian)
    return result


# -- solids in contact ----------------------------------------------------------------------------------


def bodies_of(scope: Scope) -> tuple[Node, ...]:
    """Return the solids of the scene before contact; raise `InvalidLesson` if it has none."""
    return _model(scope, Node).children


def _solids_of(scope: Scope) -> tuple[Node, ...]:
    """Return the solids of the scene as they deform each other."""
    model = _model(scope, Node)
    return model.solids() if isinstance(model, SolidContact) else model.children


def _model(scope: Scope, kind: type[Model]) -> Model:
    trees = (item.tree for item in scope.experiment.objects if isinstance(item, TreeObject))
    model = next((tree for tree in trees if isinstance(tree, kind) and tree.children), None)
    if model is None:
        raise InvalidLesson("the scene has no such solids any more; undo, or start the lesson again")
    return model


def _solid(number: Any, solids: tuple[Node, ...]) -> Node:
    return solids[as_index("solid", number, len(solids))]


@measure("number")
def body(scope: Scope, i: Any) -> Float64Array:
    """Return the field of solid i before it deforms."""
    return _field(_solid(i, bodies_of(scope)), scope.points)


@measure("number")
def solid(scope: Scope, i: Any) -> Float64Array:
    """Return the field of solid i after it deforms."""
    return _field(_solid(i, _solids_of(scope)), scope.points)


def _field(node: Node, points: Points) -> Float64Array:
    return np.asarray(node(points.positions.astype(np.float32)), np.float64)


@measure("number", "number")
def area(scope: Scope, i: Any, k: Any) -> float:
    """Return the area of the contact of solids i and k; 0 if they are apart."""
    return float(sum(surface.area for surface in _contacts_of(_model(scope, SolidContact), i, k)))


@measure("number")
def volume(scope: Scope, i: Any) -> float:
    """Return the volume of solid i after it deforms."""
    return _volume(scope, _solid(i, _solids_of(scope)))


@measure("number")
def free_volume(scope: Scope, i: Any) -> float:
    """Return the volume of solid i alone."""
    return _volume(scope, _solid(i, bodies_of(scope)))


@measure("number", "number")
def penetration(scope: Scope, i: Any, k: Any) -> float:
    """Return how deep solids i and k would overlap without contact, on the line of their centres."""
    pair = [_solid(number, bodies_of(scope)) for number in (i, k)]
    ends = [np.mean(node.bounds, axis=0, dtype=np.float64) for node in pair]
    reach = max(float(np.ptp(node.bounds, axis=0).max()) for node in pair)
    apart = ends[1] - ends[0]
    direction = apart / max(float(np.linalg.norm(apart)), 1e-12)
    x = np.linspace(-reach, float(np.linalg.norm(apart)) + reach, 4001)
    line = Points.in_space(ends[0] + x[:, None] * direction)
    inside = np.minimum(*(_field(node, line) for node in pair)) >= 0.5
    return float(inside.sum() * (x[1] - x[0]))


@measure("number", "number")
def bulge(scope: Scope, i: Any, k: Any) -> float:
    """Return the width of the bulge of solid i around its contact with solid k."""
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    model = _model(scope, SolidContact)
    rings = [ring for surface in _contacts_of(model, i, k) for ring in surface.outlines]
    if not rings:
        return 0.0
    vertices = _mesh(_solid(i, model.solids())).vertices
    fields = np.array([node(vertices) for node in model.children])
    nearest = np.argmax(np.delete(fields, int(i), axis=0), axis=0)
    nearest += nearest >= int(i)
    bulged = vertices[(fields[int(i)] < 0.5 - BULGED) & (nearest == int(k))]
    return float(cKDTree(np.concatenate(rings)).query(bulged)[0].max(initial=0.0))


@lru_cache(maxsize=16)
def _mesh(node: Node, resolution: int = RESOLUTION) -> Any:
    return polygonize(node, resolution=resolution)


def _volume(scope: Scope, node: Node) -> float:
    deforms = isinstance(_model(scope, Node), SolidContact)
    mesh = _mesh(node, RESOLUTION if deforms else FINE_RESOLUTION)
    return enclosed_volume(mesh.vertices, mesh.faces)


def _contacts_of(model: SolidContact, i: Any, k: Any) -> list[Any]:
    """Return the surfaces at which two solids touch."""
    pair = sorted(as_index("solid", number, len(model.children)) for number in (i, k))
    return [surface for surface in _contacts(model) if surface.pair == tuple(pair)]


@lru_cache(maxsize=4)
def _contacts(model: SolidContact) -> Any:
    return tuple(model.contacts(resolution=RESOLUTION))


# -- relaxations ----------------------------------------------------------------------------------------


@measure()
def step(scope: Scope) -> int:
    """Return the number of the present step of the relaxation."""
    relaxed = scope.experiment.relaxed
    return 0 if relaxed is None else relaxed.step


def _recorded(scope: Scope, name: str, n: Any) -> Any:
    """Return a measure of `Relaxed` after steps; NaN for steps that were not taken yet."""
    values = np.array(getattr(scope.experiment.relaxed, name, ()), np.float64)
    numbers = np.rint(np.nan_to_num(n, nan=-1.0)).astype(int)
    taken = (numbers >= 0) & (numbers < len(values))
    return np.where(taken, np.append(values, np.nan)[np.where(taken, numbers, -1)], np.nan)


for _name, _column in (("energy", "energies"), ("rho", "rhos"), ("variation", "variations")):
    MEASURES[_name] = Measure(lambda scope, n, column=_column: _recorded(scope, column, n), ("number",))


# -- formulas at other points ---------------------------------------------------------------------------


@measure("formula")
def most(scope: Scope, formula: Evaluate) -> float:
    """Return the largest value of a formula on the surface that the lesson's map shows."""
    return float(np.nanmax(_on_map(scope, formula), initial=-np.inf))


@measure("formula")
def least(scope: Scope, formula: Evaluate) -> float:
    """Return the smallest value there."""
    return float(np.nanmin(_on_map(scope, formula), initial=np.inf))


@measure("formula")
def share(scope: Scope, formula: Evaluate) -> float:
    """Return the part of that surface, from 0 to 1, on which a condition holds."""
    return float(np.mean(_on_map(scope, formula) > 0.0))


def _on_map(scope: Scope, formula: Evaluate) -> Float64Array:
    points = scope.experiment.map_points()
    values = np.asarray(formula(scope.at(points)), np.float64)
    return np.broadcast_to(values, points.exists.shape)[points.exists]


@measure("number")
def kept(scope: Scope, i: Any) -> float:
    """Return the part of the image of decal i that shows, on a flat surface that the map sees from above."""
    shown = np.sum(_on_map(scope, lambda points: owner(points) == i))
    return float(shown * _pixel(scope) / _areas(scope)[scope.experiment.decal(i)])


@measure()
def overlapped(scope: Scope) -> float:
    """Return the area on which images would lie on others without contact, over that of all images."""
    numbers = range(len(scope.experiment.decals))
    counts = _on_map(scope, lambda points: sum(np.float64(f(points, number) >= 0.5) for number in numbers))
    return float(np.maximum(counts - 1.0, 0.0).sum() * _pixel(scope) / _areas(scope).sum())


@measure()
def lost(scope: Scope) -> float:
    """Return the part of the area of all images that does not show."""
    shown = np.sum(_on_map(scope, lambda points: owner(points) >= 0))
    return float(1.0 - shown * _pixel(scope) / _areas(scope).sum())


def _pixel(scope: Scope) -> float:
    return (scope.experiment.size / MAP_PIXELS) ** 2


def _areas(scope: Scope) -> Float64Array:
    return np.asarray(np.pi * scope.experiment.decals.radii.astype(np.float64) ** 2)


@measure("number", "formula")
def at(scope: Scope, i: Any, formula: Evaluate) -> float:
    """Return the value of a formula at the centre of decal i."""
    return _value_at(scope, _center(scope.experiment, i), formula)


@measure("number", "number", "formula")
def between(scope: Scope, i: Any, k: Any, formula: Evaluate) -> float:
    """Return the value of a formula between decals i and k, where their fields are equal."""
    first, last = (_center(scope.experiment, number) for number in (i, k))
    reach, other = (_value(scope, "influence", number) for number in (i, k))
    return _value_at(scope, first + reach / (reach + other) * (last - first), formula)


def _value_at(scope: Scope, position: Float64Array, formula: Evaluate) -> float:
    return float(np.ravel(formula(scope.at(scope.experiment.points_near(position))))[0])


@measure("formula")
def jump(scope: Scope, formula: Evaluate) -> float:
    """Return the largest change of a formula between points 0.001 apart on the line, with one owner."""
    ends = scope.experiment.line_points(2).variables["x"]
    along = scope.at(scope.experiment.line_points(2 + int(min(np.ptp(ends) / STEP, MAX_STEPS))))
    owners = owner(along)
    changes = np.abs(np.diff(np.asarray(formula(along), np.float64)))
    return float(np.nanmax(changes[owners[1:] == owners[:-1]], initial=0.0))


MEASURES |= {"abs": MEASURES.pop("absolute"), "max": MEASURES.pop("largest")}
