"""`StructuredFile`, the random meshes that the files hold, and the check of what is read from a file."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.errors import InvalidMesh
from decals.surfaces import read_mesh

TOLERANCE = 2e-4
"""Difference of areas and bounds that counts as none, relative to the size of the mesh."""


class MisreadError(AssertionError):
    """A valid file was refused, or read as another mesh."""


@dataclass(frozen=True)
class PolygonMesh:
    """Points ``float64[n, 3]`` and polygons of a mesh, each of them flat."""

    points: NDArray[np.float64]
    polygons: Sequence[Sequence[int]]

    @property
    def _corners(self) -> NDArray[np.int64]:
        return np.fromiter(chain.from_iterable(self.polygons), np.int64)

    @property
    def area(self) -> float:
        """Area by the vector areas of the polygons, which needs no triangles."""
        sizes = np.array([len(polygon) for polygon in self.polygons])
        begins = np.cumsum(sizes) - sizes
        loops = self.points[self._corners] - np.repeat(self.points[self._corners[begins]], sizes, axis=0)
        following = np.arange(1, len(loops) + 1)
        following[begins + sizes - 1] = begins
        areas = np.add.reduceat(np.cross(loops, loops[following]), begins)
        return float(np.linalg.norm(areas, axis=1).sum() / 2)

    @property
    def triangles(self) -> int:
        """Number of triangles: n - 2 for each polygon of n corners."""
        return sum(len(polygon) - 2 for polygon in self.polygons)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner of the box around the polygons."""
        used = self.points[self._corners]
        return np.stack([used.min(axis=0), used.max(axis=0)])


@dataclass(frozen=True)
class StructuredFile:
    """A file to read: its content, the files beside it, and what it must give if it is valid.

    Attributes
    ----------
    suffix
        Ending of the file's name, with the dot.
    content
        Content of the file.
    mesh
        What the file holds; None if the file is broken, so that an `InvalidMesh` or any mesh is right.
    others
        Contents of further files, by name.
    """

    suffix: str
    content: bytes
    mesh: PolygonMesh | None
    others: dict[str, bytes] = field(default_factory=dict)

    def broken(self, content: bytes) -> "StructuredFile":
        """Return the file with another content of which nothing is expected."""
        return StructuredFile(self.suffix, content, None, self.others)


Format = Callable[[random.Random], StructuredFile]


def check(file: StructuredFile, folder: Path) -> None:
    """Read a file in a folder; raise MisreadError for a valid one that is refused or read as another mesh."""
    path = folder / f"case{file.suffix}"
    for place, content in {
        path: file.content,
        **{folder / key: own for key, own in file.others.items()},
    }.items():
        place.unlink(missing_ok=True)  # some file systems write to the disk at once what replaces a content
        place.write_bytes(content)
    try:
        vertices, faces = read_mesh(path)
    except InvalidMesh as error:
        if file.mesh is not None:
            raise MisreadError(f"refused: {error}") from error
        return
    if file.mesh is not None:
        _compare(np.asarray(vertices, np.float64), faces, file.mesh)


def _compare(vertices: NDArray[np.float64], faces: NDArray[Any], mesh: PolygonMesh) -> None:
    corners = vertices[faces]
    area = float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        / 2
    )
    bounds = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
    size = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])
    if len(faces) != mesh.triangles:
        raise MisreadError(f"{len(faces)} triangles, {mesh.triangles} are right")
    if abs(area - mesh.area) > TOLERANCE * mesh.area:
        raise MisreadError(f"area {area}, {mesh.area} is right")
    if np.abs(bounds - mesh.bounds).max() > TOLERANCE * size:
        raise MisreadError(f"bounds {bounds.tolist()}, {mesh.bounds.tolist()} are right")


# -- random meshes --------------------------------------------------------------------------------------


def random_mesh(chance: random.Random, *, largest: int = 70) -> PolygonMesh:
    """Return some of the shapes below, scaled, turned and moved at random."""
    shapes = [_grid, _box] if largest < 5 else [_grid, _box, _prism, _star, _ring]
    parts = [chance.choice(shapes)(chance) for _ in range(chance.choice((1, 1, 2, 3)))]
    points, polygons, count = [], [], 0
    for number, (own, loops) in enumerate(parts):
        points.append(own + np.array([3.0 * number, 0.0, 0.0]))
        polygons += [[corner + count for corner in loop] for loop in loops]
        count += len(own)
    if largest == 3:
        polygons = [[loop[0], loop[k], loop[k + 1]] for loop in polygons for k in range(1, len(loop) - 1)]
    polygons = [loop[k:] + loop[:k] for loop in polygons for k in [chance.randrange(len(loop))]]
    chance.shuffle(polygons)
    turn = np.linalg.qr(np.random.default_rng(chance.randrange(1 << 30)).normal(size=(3, 3)))[0]
    moved = np.concatenate(points) @ turn * 10.0 ** chance.uniform(-2, 3)
    moved += moved.std() * np.array([chance.uniform(-3, 3) for _ in range(3)])
    return PolygonMesh(moved, polygons)


Shape = tuple[NDArray[np.float64], list[list[int]]]


def _grid(chance: random.Random) -> Shape:
    """Return quadrilaterals, each of which may be two triangles."""
    columns, rows = chance.randint(1, 4), chance.randint(1, 4)
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    points = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    loops = []
    for row in range(rows):
        for column in range(columns):
            a = row * (columns + 1) + column
            quad = [a, a + 1, a + columns + 2, a + columns + 1]
            loops += [quad] if chance.random() < 0.6 else [quad[:3], [quad[0], *quad[2:]]]
    return points, loops


def _box(_: random.Random) -> Shape:
    points = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
    return points, [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def _circle(count: int, radius: float, height: float = 0.0) -> NDArray[np.float64]:
    around = np.arange(count) * (2.0 * np.pi / count)
    return np.stack([radius * np.cos(around), radius * np.sin(around), np.full(count, height)], axis=1)


def _prism(chance: random.Random) -> Shape:
    """Return a prism with polygons of many corners at its ends."""
    count = chance.choice((3, 5, 6, 12, 32))
    points = np.concatenate([_circle(count, 1.0), _circle(count, 1.0, 2.0)])
    sides = [[k, (k + 1) % count, (k + 1) % count + count, k + count] for k in range(count)]
    return points, [list(range(count))[::-1], [count + k for k in range(count)], *sides]


def _star(chance: random.Random) -> Shape:
    """Return one concave polygon, some of whose sides have corners that do not bend."""
    count = chance.choice((3, 5, 8, 20))
    tips, dents = _circle(2 * count, 1.0)[::2], _circle(2 * count, chance.uniform(0.1, 0.8))[1::2]
    points = np.stack([tips, dents], axis=1).reshape(-1, 3)
    if chance.random() < 0.5:
        middle = 0.5 * (points + np.roll(points, -1, axis=0))
        points = np.stack([points, middle], axis=1).reshape(-1, 3)
    loop = list(range(len(points)))
    return points, [loop if chance.random() < 0.5 else loop[::-1]]


def _ring(chance: random.Random) -> Shape:
    """Return one polygon that winds round a hole: an outline, a bridge to the hole, and back."""
    outer, inner = chance.choice((3, 4, 8, 32)), chance.choice((3, 4, 8, 32))
    points = np.concatenate([_circle(outer, 1.0), _circle(inner, chance.uniform(0.1, 0.45))[::-1]])
    loop = [*range(outer), 0, outer + inner - 1, *range(outer, outer + inner)]
    return points, [loop if chance.random() < 0.5 else loop[::-1]]
