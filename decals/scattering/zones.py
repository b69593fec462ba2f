"""Zones: parts of surfaces whose decals have images, sizes, densities and directions of their own."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from blobtree import ISO, Node
from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.errors import InvalidNode
from blobtree.files import no_file
from blobtree.lazy import Lazy
from blobtree.nodes.paths import Path, node_in_world
from blobtree.nodes.surgery import without_branches
from blobtree.validation import describe
from decals.errors import InvalidImage, InvalidScattering
from decals.scattering.appearance import Appearance, ImageChoice, image_shares
from decals.scattering.covering import random_points_around
from decals.scattering.density import PaintedImage, grey_values, region_mask
from decals.scattering.domain import (
    Density,
    Domain,
    Mask,
    OrientedPoints,
    apportion,
    checked_values,
    on_nearest,
)
from decals.scattering.neighbors import FacingTree
from decals.scattering.orientation import Direction, as_direction
from decals.surfaces.convert import TREE_SUFFIXES, as_surfaces, listed
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.mesh_file import block_triangles, read_parts
from decals.surfaces.surface import Surface
from decals.surfaces.triangulate import MeshArrays
from decals.validation import allowed_number, instance, member

SAMPLES = 16384
"""Random points on the surfaces that find all zones and their borders."""

BORDER_STEP = 0.025
"""Distance of the points that stand for a soft border, in its widths."""

SPREAD = 12
"""Random points around each point of a border, from which a finer border is found."""

NEIGHBORS = 10
"""Nearest points of each, between which a border is looked for."""

SPACED = 8.0
"""Largest distance of two points between which a border is looked for, in steps."""

HALVINGS = 10
"""Halvings of the distance between two points of different zones."""

MAX_BORDER = 50_000
"""Points of a border from which it is not made finer."""

FINEST = 1e-5
"""Least distance of the points of a border, in roots of the area."""

_SAMPLE_STREAM = 11

Region: TypeAlias = Callable[[Float32Array], BoolArray]
"""A checked mask: a function of ``points[n, 3]`` to ``bool[n]``."""

Host: TypeAlias = tuple[Any, Surface]
"""A model and its surface."""

NamedPart: TypeAlias = tuple[int, str, Callable[[], Region]]
"""The number of a model, a name that it has for a part of it, and what returns the region of that part."""

Where: TypeAlias = Mask | PaintedImage | Node | str | ArrayLike
"""Where a zone is: see `Zone`."""


@dataclass(frozen=True, eq=False)
class Zone:
    """A part of surfaces, and what its decals have of their own.

    Parameters
    ----------
    where : callable, PaintedImage, Node, str or array_like
        One of these:

        * A mask: a function of ``points[n, 3]`` to ``bool[n]``.
        * A `PaintedImage`: the zone is where it is brighter than 1/2.
        * A BlobTree that is no node of the model: the zone is inside its solid.
        * A node of the model: the zone is the part of the surface that it makes, and that equal nodes make.
        * A name: of an object or its label, of a node of a `TreeObject`, of an object in a mesh file, of a
          group or a material in an OBJ file, of a block of a pyvista `MultiBlock`, or of an array of a
          pyvista mesh. If several parts have the name, the zone is all of them.
        * Values of the vertices or triangles, if the only model is a mesh: true or false, numbers from 0
          to 1, or colours ``[n, 3]`` or ``[n, 4]``, whose brightness counts. The zone is where they are 1/2
          or more.
    density : float or callable, optional
        Density relative to other zones: a number above 0, or a function of ``points[n, 3]`` to such numbers.
    spacing : float, optional
        Distance of neighbours in model units, in place of a density. All zones state it, or none.
    factor : float, default: 1.0
        Factor of the radii, besides that of `scatter`.
    direction : array_like, callable, Orientation or str, optional
        Direction of the images' u axes, as for `scatter`; that of `scatter` by default.
    images : int or sequence of int, optional
        How many images, or a list of their numbers, as for `scatter`; those of `scatter` by default.
    weights : array_like, optional
        Relative frequency of each of these images.
    choice : ImageChoice or str, optional
        Rule for the image of each decal; that of `scatter` by default.

    Raises
    ------
    InvalidScattering
        For a value of the wrong kind or out of range, or a density beside a spacing.

    See Also
    --------
    Zones : several zones, for `scatter`.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> zone = decals.scattering.Zone(Point((0, 1, 0), radius=0.8), density=4.0, images=[1])
    >>> zone.density
    4.0
    """

    where: Where
    density: float | Density | None = None
    spacing: float | None = None
    factor: float = 1.0
    direction: Direction = None
    images: int | Sequence[int] | None = None
    weights: ArrayLike | None = None
    choice: ImageChoice | str | None = None

    def __post_init__(self) -> None:
        for name in ("density", "spacing", "factor"):
            value = getattr(self, name)
            if not (value is None and name != "factor") and not (callable(value) and name == "density"):
                number = allowed_number(
                    f"{name} of a zone",
                    value,
                    "a number above 0, at most 1e6",
                    lambda number: 0 < number <= 1e6,
                    InvalidScattering,
                )
                object.__setattr__(self, name, number)
        if self.density is not None and self.spacing is not None:
            raise InvalidScattering("expected a density or a spacing of a zone, got both; give one of them")
        object.__setattr__(self, "direction", as_direction(self.direction))
        if self.images is not None:
            image_shares(self.images, self.weights)
        if self.choice is not None:
            object.__setattr__(self, "choice", member("choice", self.choice, ImageChoice, InvalidScattering))

    def appearance(self, base: Appearance) -> Appearance:
        """Return the appearance of the zone's decals: what it states, and the rest from another."""
        own: dict[str, Any] = {
            name: value
            for name in ("direction", "images", "weights", "choice")
            if (value := getattr(self, name)) is not None
        }
        if self.images is not None:
            own["weights"] = self.weights
        return replace(base, factor=self.factor * base.factor, **own)


class Zones:
    """Several zones, for the option `zones` of `scatter`; where some overlap, the first counts.

    One relaxation spreads the decals of all zones, so that they lie as evenly across a border as beside it.
    Elsewhere there are no decals.

    Parameters
    ----------
    *zones : Zone
        The zones.
    border_width : float, default: 0.0
        Width in model units of the band along a border in which decals of both zones mix. With 0 there is
        none: each decal belongs to the zone of its centre, and neighbours press against each other across
        the border. In the band, at a distance d inside a zone, the share of that zone is ``t² (3 - 2 t)``,
        where ``t`` is ``1/2 + d / width``. Where several bands meet, shares are scaled to a sum of 1. The
        density changes in the same way.

    Raises
    ------
    InvalidScattering
        For no zones, other values, or a negative width.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.scattering import Zone, Zones
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> cap = Zone(lambda points: points[:, 1] > 0.5, density=3.0, images=[1])
    >>> rest = Zone(lambda points: points[:, 1] <= 0.5, images=[0])
    >>> decals_of_both = decals.scatter(ball, count=90, zones=Zones(cap, rest))
    >>> bool(abs((decals_of_both.images == 1).mean() - 0.5) < 0.05)
    True
    """

    def __init__(self, *zones: Zone, border_width: float = 0.0) -> None:
        advice = "such as Zone(lambda points: points[:, 1] > 0)"
        self.zones = tuple(instance("zones", zone, Zone, InvalidScattering, advice) for zone in zones)
        if not zones:
            raise InvalidScattering("zones: expected at least one zone, got none")
        if len({zone.spacing is None for zone in zones}) > 1:
            raise InvalidScattering(
                "expected a spacing of all zones or of none, got one of some; give the rest"
            )
        self.border_width = allowed_number(
            "border_width", border_width, "a width from 0 upward", lambda width: width >= 0, InvalidScattering
        )

    def __repr__(self) -> str:
        return f"Zones({len(self.zones)} zones, border_width={self.border_width:g})"

    @property
    def have_spacings(self) -> bool:
        """True if the zones state their spacings, from which the number of decals follows."""
        return self.zones[0].spacing is not None

    def placed_on(
        self,
        models: object,
        *,
        density: Density | None = None,
        mask: Mask | None = None,
        seed: int = 0,
        device: str = "cpu",
    ) -> "_PlacedZones":
        """Return the zones on models, to relax step by step.

        Parameters
        ----------
        models : Surface, Model or object of a scene, or a sequence of these
            As for `scatter`.
        density, mask : callable, optional
            A density by which those of the zones are multiplied, and where zones may be at all.
        seed : int, default: 0
            Seed of the search for borders.
        device : str, default: "cpu"
            Warp device of that search.

        Returns
        -------
        An object to give to `Relaxation.to_decals`, and its ``density`` and ``mask`` to `Relaxation`.
        Its ``numbers(points)`` returns the zone of each point, -1 outside all zones. Its ``shares(points)``
        returns the shares of all zones at each point, ``float64[n, k]``.

        Raises
        ------
        InvalidScattering
            For a zone that these models cannot have, or that has no visible area outside the zones before it.
        """
        placed = _PlacedZones(self, models, density, mask)
        placed.measure(seed, device)
        return placed


class _PlacedZones:
    """Zones on surfaces, see `Zones.placed_on`."""

    def __init__(self, zones: Zones, models: object, density: Density | None, mask: Mask | None) -> None:
        self._zones, self._width = zones.zones, zones.border_width
        several = listed(models)
        self._surfaces = as_surfaces(several)
        self._density, self._mask = density, mask
        hosts = list(zip(several, self._surfaces, strict=True))
        named = cache(  # of all zones: it reads files
            lambda: [(index, *part) for index, host in enumerate(hosts) for part in _named_parts(*host)]
        )
        self._wheres = [
            _region(zone.where, f"where of zone {number}", hosts, named)
            for number, zone in enumerate(self._zones, 1)
        ]
        self._border = OrientedPoints.empty()
        self._sides = np.zeros((0, 2), np.int64)

    @property
    def spacing(self) -> float | None:
        """Spacing where the density is 1: that of the first zone."""
        return self._zones[0].spacing

    @property
    def density(self) -> Density | None:
        """Relative density of decals, a function of points; None if it is the same everywhere."""
        values = [self._value(zone) for zone in self._zones]
        if self._density is None and all(value == 1.0 for value in values):
            return None
        return self._density_at

    def mask(self, points: Float32Array) -> BoolArray:
        """Return True for points (n, 3) in a zone."""
        return self.numbers(points) >= 0

    def numbers(self, points: Float32Array) -> Int64Array:
        """Return the number of the first zone around each of the points (n, 3), from 0; -1 for none."""
        numbers = np.full(len(points), -1, np.int64)
        places = np.arange(len(points))
        if self._mask is not None and len(points):
            places = places[checked_values("mask", self._mask, points, truths=True) != 0.0]
        for number, where in enumerate(self._wheres):
            if len(places):
                inside = where(points[places])
                numbers[places[inside]] = number
                places = places[~inside]
        return numbers

    def shares(self, points: Float32Array) -> Float64Array:
        """Return the share of each zone in the decals at points, ``float64[n, k]``."""
        numbers = self.numbers(points)
        shares: Float64Array = (numbers[:, None] == np.arange(len(self._zones))).astype(np.float64)
        if len(self._border) == 0 or len(points) == 0:
            return shares
        anywhere = self._border_tree.query(points, distance_upper_bound=0.5 * self._width)[0]
        rows = np.flatnonzero(np.isfinite(anywhere) & (numbers >= 0))
        there = on_nearest(self._surfaces, points[rows])
        for number, tree in self._side_trees:
            depths = tree.nearest(there.positions, there.normals)[0][:, 0]
            depths[numbers[rows] != number] *= -1.0
            t = np.clip(0.5 + depths / self._width, 0.0, 1.0)
            shares[rows, number] = t * t * (3.0 - 2.0 * t)
        shares[rows] /= shares[rows].sum(axis=1, keepdims=True)
        return shares

    def styles(
        self, base: Appearance, positions: Float32Array, seed: int
    ) -> list[tuple[Appearance, Int64Array]]:
        """Return the appearance of each zone and the rows of its decals; those outside all have the base's.

        Within the width of a soft border, the zone of a decal is drawn by the shares there.
        """
        numbers = self.numbers(positions)
        if len(self._border):
            draws = np.random.default_rng(seed).random((len(positions), 1))
            drawn = (self.shares(positions).cumsum(axis=1) <= draws).sum(axis=1)
            numbers = np.where(numbers >= 0, np.minimum(drawn, len(self._zones) - 1), numbers)
        appearances = [*(zone.appearance(base) for zone in self._zones), base]
        rows = [np.flatnonzero(numbers == number) for number in (*range(len(self._zones)), -1)]
        return list(zip(appearances, rows, strict=True))

    def measure(self, seed: int, device: str) -> None:
        """Find the borders of soft zones, and raise `InvalidScattering` for a zone without area."""
        domain = Domain(self._surfaces, seed, mask=self.mask, device=device)
        samples = OrientedPoints.empty()
        if domain.area > 0.0:
            samples = domain.sample(apportion(domain.masses, SAMPLES), stream=_SAMPLE_STREAM)
        numbers = self.numbers(samples.positions)
        missing = np.flatnonzero(np.bincount(numbers + 1, minlength=len(self._zones) + 1)[1:] == 0)
        if len(missing):
            raise InvalidScattering(
                f"expected visible area in zone {missing[0] + 1} outside the zones before it, got none in "
                f"{SAMPLES} samples; move or enlarge it, or put it first"
            )
        if self._width == 0.0:
            return
        rng = np.random.default_rng(seed)
        size = float(np.sqrt(domain.area))
        step, finest = size / np.sqrt(SAMPLES), max(BORDER_STEP * self._width, FINEST * size)
        self._find_border(domain, samples, step)
        while step > finest and 0 < len(self._border) < MAX_BORDER:
            step *= 0.5
            few = self._border[_one_of_each_cube(self._border.positions, step)]
            around = random_points_around(few, SPREAD, 2.0 * step, rng)
            samples, allowed = domain.project(around)
            self._find_border(domain, samples[np.flatnonzero(allowed)], step)

    def _find_border(self, domain: Domain, samples: OrientedPoints, step: float) -> None:
        """Find points on the borders between samples of different zones that lie some steps apart."""
        numbers = self.numbers(samples.positions)
        tree = FacingTree(samples.positions, samples.normals)
        distances, nearest = tree.nearest(samples.positions, samples.normals, count=NEIGHBORS, skip_self=True)
        rows, columns = np.nonzero((numbers[nearest] != numbers[:, None]) & (distances < SPACED * step))
        ends = np.stack([rows, nearest[rows, columns]], axis=1)
        ends = ends[_one_of_each_cube(samples.positions[ends].mean(axis=1), 0.5 * step)]
        first, second = samples.positions[ends[:, 0]], samples.positions[ends[:, 1]]
        sides, middle = numbers[ends], samples[ends[:, 0]]
        sound = np.ones(len(ends), np.bool_)
        for _ in range(HALVINGS):
            guess = replace(middle, positions=(0.5 * (first + second)).astype(np.float32))
            middle, allowed = domain.project(guess)
            number = self.numbers(middle.positions)
            sound &= allowed & (number >= 0)
            on_first = number == sides[:, 0]
            first = np.where(on_first[:, None], middle.positions, first)
            second = np.where(on_first[:, None], second, middle.positions)
            sides[:, 1] = np.where(on_first, sides[:, 1], number)
        kept = np.flatnonzero(sound)
        self._border, self._sides = middle[kept], sides[kept]

    @Lazy
    def _border_tree(self) -> Any:
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        return cKDTree(self._border.positions)

    @Lazy
    def _side_trees(self) -> list[tuple[int, FacingTree]]:
        """Each zone that has a border, and its border."""
        return [
            (number, FacingTree(part.positions, part.normals))
            for number in np.unique(self._sides).tolist()
            for part in [self._border[np.flatnonzero((self._sides == number).any(axis=1))]]
        ]

    def _value(self, zone: Zone) -> float | Density:
        """Return the density of a zone, where that of the first is 1 if zones have spacings."""
        if zone.spacing is None:
            return 1.0 if zone.density is None else zone.density
        return float((cast(float, self.spacing) / zone.spacing) ** 2)

    def _density_at(self, points: Float32Array) -> Float64Array:
        shares = self.shares(points)
        densities: Float64Array = (shares.sum(axis=1) == 0.0).astype(np.float64)  # 1 outside all zones
        for number, zone in enumerate(self._zones):
            rows, value = np.flatnonzero(shares[:, number]), self._value(zone)
            if callable(value) and len(rows):
                densities[rows] += shares[rows, number] * checked_values(
                    f"density of zone {number + 1}", value, points[rows]
                )
            else:
                densities[rows] += shares[rows, number] * cast(float, value)
        if self._density is not None and len(points):
            densities *= checked_values("density", self._density, points)
        return densities


def _one_of_each_cube(positions: Float32Array, side: float) -> Int64Array:
    """Return the row of one point of each cube of a size that holds some."""
    return np.unique(np.floor(positions / side), axis=0, return_index=True)[1]


# -- where zones are -------------------------------------------------------------------------------------


def _region(
    where: Where, name: str, hosts: Sequence[Host], named: Callable[[], Sequence[NamedPart]]
) -> Region:
    """Return where a zone is on models, see `Zone`; `name` is that of the value in messages."""
    if isinstance(where, PaintedImage):
        return where.mask()
    if isinstance(where, Node):
        return _solid_or_part(where, hosts)
    if isinstance(where, str):
        return _named_region(where, name, hosts, named())
    if callable(where):
        return lambda points: checked_values(name, where, points, truths=True) != 0.0
    if not (isinstance(where, Sequence) or hasattr(where, "__array__")):
        raise InvalidScattering(
            f"{name}: expected a mask, a PaintedImage, a BlobTree, a name or values, got {describe(where)}"
        )
    meshes = [surface for _, surface in hosts if isinstance(surface, MeshSurface)]
    if len(hosts) != 1 or not meshes:
        raise InvalidScattering(
            f"{name}: expected a single mesh for values of its vertices or faces; "
            "for several models, give the mask of `region_mask`"
        )
    return _painted_region(meshes[0], where, name)


def _painted_region(mesh: MeshSurface, values: ArrayLike, name: str) -> Region:
    """Return where values or colours of the vertices or faces of a mesh are 1/2 or more."""
    try:
        array = np.asarray(values)
        painted = array.shape[1:] in ((3,), (4,))
        return region_mask(mesh, grey_values(array[None])[0] if painted else values)
    except (InvalidImage, InvalidScattering, ValueError) as error:
        raise InvalidScattering(f"{name}: {str(error).removeprefix('image: ')}") from error


def _solid_or_part(node: Node, hosts: Sequence[Host]) -> Region:
    """Return the inside of a node, or the parts of surfaces that it makes if it is a node of their trees."""
    parts = [
        (index, _part(surface.tree, paths))
        for index, (_, surface) in enumerate(hosts)
        if isinstance(surface, ImplicitSurface) and (paths := _paths_of(surface.tree, node))
    ]
    return _on_hosts(parts, hosts) if parts else lambda points: node(points) >= ISO


def _paths_of(tree: Node, wanted: Node) -> list[Path]:
    """Return the paths of all nodes of a tree that are equal to one, without those below another."""
    found: list[Path] = []
    pending: list[tuple[Path, Node]] = [((), tree)]
    while pending:
        path, node = pending.pop()
        if node == wanted:
            found.append(path)
        else:
            pending += [((*path, step), child) for step, child in enumerate(node.children)]
    return found


def _part(tree: Node, paths: Sequence[Path]) -> Region:
    """Return the part of a tree's surface that nodes make: the rest of the tree is farther from it."""
    parts = [node_in_world(tree, path) for path in paths]
    try:
        rest = without_branches(tree, paths)
    except InvalidNode:  # they are all of the tree
        return _everywhere
    return lambda points: (
        np.min([np.abs(part(points) - ISO) for part in parts], axis=0) <= np.abs(rest(points) - ISO)
    )


def _everywhere(points: Float32Array) -> BoolArray:
    return np.ones(len(points), np.bool_)


def _on_hosts(parts: Sequence[tuple[int, Region]], hosts: Sequence[Host]) -> Region:
    """Return the union of parts of surfaces, each by the number of its surface and a region of it."""
    if len(hosts) == 1:
        return lambda points: np.any([region(points) for _, region in parts], axis=0)
    surfaces = [surface for _, surface in hosts]

    def inside(points: Float32Array) -> BoolArray:
        nearest = on_nearest(surfaces, points).surface_ids
        flags: BoolArray = np.any([(nearest == index) & region(points) for index, region in parts], axis=0)
        return flags

    return inside


def _named_region(wanted: str, name: str, hosts: Sequence[Host], named: Sequence[NamedPart]) -> Region:
    """Return the parts of models that have a name."""
    parts = [(index, region()) for index, known, region in named if known == wanted]
    if not parts:
        names = ", ".join(sorted({repr(known) for _, known, _ in named})[:12]) or "none"
        hint = ", which is no file either" if "." in wanted and no_file(wanted) else ""
        raise InvalidScattering(
            f"{name}: expected a name of the models, which have {names}; got {wanted!r}{hint}"
        )
    return _on_hosts(parts, hosts)


def _named_parts(model: Any, surface: Surface) -> Iterator[tuple[str, Callable[[], Region]]]:
    """Yield the names that a model has for itself and its parts, and functions that return their regions."""
    if isinstance(own := getattr(model, "name", None), str):
        yield from ((known, lambda: _everywhere) for known in (own, *getattr(model, "labels", ())))
    if isinstance(surface, ImplicitSurface):
        for path, known in getattr(model, "names", {}).items():
            yield known, partial(_part, surface.tree, [path])
    if isinstance(model, str | os.PathLike) and not os.fspath(model).lower().endswith(TREE_SUFFIXES):
        for parts in read_parts(model):
            yield from _parts_of_mesh(parts)
    elif hasattr(model, "keys") and hasattr(model, "combine"):  # blocks of pyvista
        yield from _parts_of_mesh(block_triangles(model))
    elif hasattr(model, "point_data") and hasattr(model, "cell_data"):
        shell = model.extract_surface(
            pass_pointid=False, pass_cellid=False, algorithm="dataset_surface"
        ).triangulate()
        mesh = MeshSurface(shell.points, shell.regular_faces)
        for arrays in (shell.point_data, shell.cell_data):
            for known, values in arrays.items():
                yield known, partial(_painted_region, mesh, values, f"array {known!r}")


def _parts_of_mesh(parts: Sequence[tuple[str, MeshArrays]]) -> Iterator[tuple[str, Callable[[], Region]]]:
    """Yield the names of parts of a mesh, and functions that return where each is the nearest."""
    corners = [vertices[faces].reshape(-1, 3) for _, (vertices, faces) in parts]
    part_of_face = np.repeat(np.arange(len(parts)), [len(rows) // 3 for rows in corners])
    faces = np.arange(3 * len(part_of_face)).reshape(-1, 3)
    mesh = MeshSurface(np.concatenate(corners), faces, orientation="keep")
    for number, (known, _) in enumerate(parts):
        yield known, partial(region_mask, mesh, part_of_face == number)
