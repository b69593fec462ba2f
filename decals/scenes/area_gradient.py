"""Gradients of the areas of decals by their centres and radii, as integrals over contact lines and rims.

The boundary of the area of a decal is a level set h = 0 on the surface. If a parameter θ changes, it moves
outward at the speed −∂h/∂θ / |∇h|, with the gradient along the surface (the transport theorem of Reynolds).
The area grows by the integral of this speed over the boundary.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.progress import Progress
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact, ContactLaw, contact_mode
from decals.model import Decals
from decals.record import Contact
from decals.scenes.outlines import STEP, LineKind, SurfaceLine, outlines
from decals.scenes.scene import Scene, require_scene
from decals.surfaces.surface import Surface
from decals.validation import real_array

LEAST_SLOPE = 1e-9
"""Least slope of a level function along the surface; where it touches the surface, the speed has no end."""

NEWTON_STEPS = 4
"""Steps that move the end of a line to where it meets others."""

END_REACH = 0.1
"""Greatest distance, in visible radii, by which an end of a line moves to where it meets others."""

LEAST_ANGLE = 1e-3
"""Least angle of two lines whose meeting point is looked for along both."""


@dataclass(frozen=True, eq=False)
class AreaGradient:
    """Gradient of a weighted sum of areas by the centres and radii of decals.

    Attributes
    ----------
    positions : float64[n, 3]
        Derivatives by the centres, while normals and surfaces stay.
    radii : float64[n]
        Derivatives by the visible radii.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> gradient = decals.area_gradient(scene)
    >>> gradient, gradient.positions.shape
    (AreaGradient(12), (12, 3))
    """

    positions: Float64Array
    radii: Float64Array

    def __repr__(self) -> str:
        """Return the number of decals."""
        return f"AreaGradient({len(self.radii)})"


def area_gradient(
    scene: Scene,
    weights: ArrayLike | None = None,
    *,
    contact: AnyContact | str | None = None,
    step: float = STEP,
    progress: Progress | None = None,
) -> AreaGradient:
    """Return the gradient of the areas of decals under contact, or of the covered area, by all decals.

    The area of a decal is where it is the topmost one, inside its rim. The covered area is the sum of all;
    divide its gradient by the area of the surfaces for that of the coverage. Images of the corrected mapping
    end a little inside of rims on curved surface, which does not count here.

    Parameters
    ----------
    scene : Scene
        The scene, with n decals.
    weights : float[n], optional
        Factor of the area of each decal. Default 1: the covered area.
    contact : Contact or str, optional
        Contact mode, by default that of the scene's ``drawing``. Laws of your own have no gradient.
    step : float
        Length of the segments of boundaries, as for `outlines`; the error falls with it.
    progress : callable, optional
        Called with the name of the stage and the fraction done.

    Returns
    -------
    AreaGradient

    Raises
    ------
    InvalidScene
        No scene, weights of another shape, or an option out of range.

    See Also
    --------
    decals.measure : the areas themselves, estimated.
    blobtree.parameter_gradient : derivatives of trees by their parameters.

    Examples
    --------
    >>> import decals
    >>> square = decals.MeshObject("square", [[-2, -2, 0], [2, -2, 0], [0, 3, 0]], [[0, 1, 2]])
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.5)
    >>> scene = decals.Scene(objects=[square], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    >>> decals.area_gradient(scene).radii.round(2)  # 2πr
    array([3.14])
    """
    require_scene("scene", scene, "take the scene that was posed, where its decals lie")
    decals = scene.decals
    mode = contact_mode(scene.drawing.contact if contact is None else contact, InvalidScene)
    if isinstance(mode, ContactLaw):
        raise InvalidScene("contact: expected a contact mode, got a law of your own; it has no gradient")
    factors = np.ones(len(decals)) if weights is None else real_array("weights", weights, InvalidScene)
    if factors.shape != (len(decals),) or not np.isfinite(factors).all():
        raise InvalidScene(f"weights: expected {len(decals)} finite numbers, one for each decal")
    factors = np.append(factors, 0.0)  # the last one is that of bare surface, −1
    lines = outlines(scene, contact=mode, mapping=ImageMapping.CHORD, step=step, progress=progress)
    surfaces = {item.name: item.surface for item in scene.objects}
    gradient = AreaGradient(np.zeros((len(decals), 3)), np.zeros(len(decals)))
    cells = mode in (Contact.RADIAL, Contact.ELASTIC)
    polylines = [line.points.astype(np.float64) for line in lines]
    for name, surface in surfaces.items():
        own = [number for number, line in enumerate(lines) if line.object == name]
        _move_ends(decals, [lines[n] for n in own], [polylines[n] for n in own], surface, cells)
    for line, points in zip(lines, polylines, strict=True):
        first, second = line.decals
        middles = 0.5 * (points[1:] + points[:-1])
        normals = surfaces[line.object].project(middles.astype(np.float32))[1].astype(np.float64)
        amounts = (factors[first] - factors[second]) * np.linalg.norm(np.diff(points, axis=0), axis=1)
        levels = [_Level.rim(decals, middles, first, 1.0)]
        if line.kind is LineKind.CONTACT:
            levels += [_Level.rim(decals, middles, second, -1.0), _Level.of(line, decals, middles, cells)]
        _add(gradient, levels, normals, amounts)
    return gradient


@dataclass(frozen=True)
class _Level:
    """A level function at points ``[m]``, negative on the side of the first decal, and its derivatives.

    `slopes` are those by the point; `moves` and `grows` those by the centres and radii of `decals`.
    """

    decals: tuple[int, ...]
    values: Float64Array
    slopes: Float64Array
    moves: tuple[Float64Array, ...]
    grows: tuple[Float64Array, ...]

    @staticmethod
    def of(line: SurfaceLine, decals: Decals, points: Float64Array, cells: bool) -> "_Level":
        """Return the level function of a rim, or of the contact line between two decals."""
        if line.kind is LineKind.RIM:
            return _Level.rim(decals, points, line.decals[0], 1.0)
        return (_Level.power if cells else _Level.ratio)(decals, points, *line.decals)

    @staticmethod
    def rim(decals: Decals, points: Float64Array, number: int, sign: float) -> "_Level":
        """Return ±(|q − p| − ρ)."""
        ways, distances = _ways(decals, points, number)
        return _Level(
            (number,),
            sign * (distances - float(decals.radii[number])),
            sign * ways,
            (-sign * ways,),
            (np.full(len(points), -sign),),
        )

    @staticmethod
    def power(decals: Decals, points: Float64Array, first: int, second: int) -> "_Level":
        """Return half the difference of the powers |q − p|² − ρ²."""
        (u, a), (v, b) = (_ways(decals, points, number) for number in (first, second))
        r, s = (float(decals.radii[number]) for number in (first, second))
        ones = np.ones(len(points))
        offset_u, offset_v = a[:, None] * u, b[:, None] * v
        return _Level(
            (first, second),
            0.5 * (a**2 - r**2 - b**2 + s**2),
            offset_u - offset_v,
            (-offset_u, offset_v),
            (-r * ones, s * ones),
        )

    @staticmethod
    def ratio(decals: Decals, points: Float64Array, first: int, second: int) -> "_Level":
        """Return the difference of |q − p|/ρ, which are equal where the fields are."""
        (u, a), (v, b) = (_ways(decals, points, number) for number in (first, second))
        r, s = (float(decals.radii[number]) for number in (first, second))
        return _Level((first, second), a / r - b / s, u / r - v / s, (-u / r, v / s), (-a / r**2, b / s**2))


def _ways(decals: Decals, points: Float64Array, number: int) -> tuple[Float64Array, Float64Array]:
    """Return the unit vectors from a centre to points, and the distances."""
    offsets = points - decals.positions[number].astype(np.float64)
    distances = np.linalg.norm(offsets, axis=1)
    return offsets / np.maximum(distances, 1e-300)[:, None], distances


def _move_ends(
    decals: Decals,
    lines: list[SurfaceLine],
    polylines: list[Float64Array],
    surface: Surface,
    cells: bool,
) -> None:
    """Move the ends of lines on a surface to where they meet, by Newton's method for their level functions.

    The labels of points place an end inexactly beside a thin wedge of a third decal. An end that would move
    farther than END_REACH stays, as it lies elsewhere, such as on a boundary. A line whose two ends move to
    one place lies within such a wedge, and becomes a point.
    """
    meetings: dict[bytes, list[int]] = defaultdict(list)
    for number, points in enumerate(polylines):
        for end in (0, -1):
            meetings[points[end].tobytes()].append(number)
    found = {place: sorted(set(numbers)) for place, numbers in meetings.items() if len(set(numbers)) > 1}
    if not found:
        return
    begun = np.array([np.frombuffer(place) for place in found])
    places, normals = begun, surface.project(begun.astype(np.float32))[1].astype(np.float64)
    for _ in range(NEWTON_STEPS):
        steps = np.zeros_like(places)
        for row, numbers in enumerate(found.values()):
            levels = [_Level.of(lines[n], decals, places[row : row + 1], cells) for n in numbers]
            slopes = np.concatenate([level.slopes for level in levels])
            slopes -= np.outer(slopes @ normals[row], normals[row])
            values = np.concatenate([level.values for level in levels])
            steps[row] = np.linalg.lstsq(slopes, -values, rcond=LEAST_ANGLE)[0]
        moved, ways = surface.project((places + steps).astype(np.float32))
        places, normals = moved.astype(np.float64), ways.astype(np.float64)
    reach = [END_REACH * decals.radii[max(lines[numbers[0]].decals)] for numbers in found.values()]
    near = np.linalg.norm(places - begun, axis=1) < reach
    ends = {place: row for place, row, kept in zip(found, places, near, strict=True) if kept}
    for points in polylines:
        first, last = (points[end].tobytes() for end in (0, -1))
        if first != last and {first, last} <= set(ends) and np.array_equal(ends[first], ends[last]):
            points[:] = ends[first]
        for end, place in ((0, first), (-1, last)):
            points[end] = ends.get(place, points[end])


def _add(gradient: AreaGradient, levels: list[_Level], normals: Float64Array, amounts: Float64Array) -> None:
    """Add the integral over segments; each belongs to the level function that is nearest to 0 there."""
    slopes = []
    for level in levels:
        along = level.slopes - np.einsum("mi,mi->m", level.slopes, normals)[:, None] * normals
        slopes.append(np.maximum(np.linalg.norm(along, axis=1), LEAST_SLOPE))
    off = np.stack([np.abs(level.values) / slope for level, slope in zip(levels, slopes, strict=True)])
    nearest = off.argmin(axis=0)
    for place, (level, slope) in enumerate(zip(levels, slopes, strict=True)):
        shares = np.where(nearest == place, -amounts / slope, 0.0)
        for number, moves, grows in zip(level.decals, level.moves, level.grows, strict=True):
            gradient.positions[number] += shares @ moves
            gradient.radii[number] += shares @ grows
