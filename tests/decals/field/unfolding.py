"""Meshes with known log maps: unfolded faces, a rim by minimisation, bumps by integration."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from decals import Decals, ImageMapping, evaluate
from decals.field import Walks
from decals.surfaces import MeshSurface
from tests.decals.field import log_maps
from tests.vectors import unit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Patch:
    """A mesh, the frame of a decal on it, and points with normals and log maps float64[n, 2]."""

    vertices: Array
    faces: NDArray[Any]
    centre: Array
    normal: Array
    tangent: Array
    points: Array
    normals: Array
    log: Array

    def decal(self, radius: float) -> Decals:
        """Return the decal; it may lie on faces that turn away."""
        return Decals([self.centre], [self.normal], [self.tangent], [radius], spill=[True])

    def walks(self, radius: float) -> Walks:
        """Return the walks of the decal over the mesh."""
        return Walks.over(self.decal(radius), [MeshSurface(self.vertices, self.faces)])

    def errors(self, radius: float, mapping: ImageMapping = ImageMapping.WALKED) -> Array:
        """Return distances of drawn places from log maps, over the radius, of points within it."""
        inside = np.linalg.norm(self.log, axis=1) < 0.999 * radius
        assert inside.sum() > 100
        walks = self.walks(radius)
        seen = evaluate(
            self.decal(radius),
            self.points[inside],
            self.normals[inside],
            mapping=mapping,
            walks=walks,
            device="cpu",
        )
        assert (seen.owner == 0).all()
        drawn = 2.0 * (seen.uv.astype(np.float64) - 0.5)
        errors: Array = np.linalg.norm(drawn - self.log[inside] / radius, axis=1)
        return errors


def rms(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt((errors**2).mean()))


def edge(degrees: float, distance: float, count: int = 2000, *, shift: Any = 0.0, size: float = 1.0) -> Patch:
    """Two faces whose normals differ by an angle, with the centre on the first one, before the edge."""
    rng, turn = np.random.default_rng(0), np.radians(degrees)
    log = 1.1 * log_maps.offsets(rng, count, 1.0)
    beyond = np.maximum(log[:, 0] - distance, 0.0)
    points = np.column_stack([log[:, 0] - beyond * (1 - np.cos(turn)), log[:, 1], -beyond * np.sin(turn)])
    tilted = np.array([np.sin(turn), 0.0, np.cos(turn)])
    normals = np.where(beyond[:, None] > 0, tilted, [0.0, 0.0, 1.0])
    far = [distance + 3 * np.cos(turn), -3 * np.sin(turn)]
    x, z = np.array([-3.0, distance, far[0]]), np.array([0.0, 0.0, far[1]])
    vertices = np.column_stack([np.repeat(x, 2), np.tile([-3.0, 3.0], 3), np.repeat(z, 2)])
    faces = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    place = np.zeros(3)
    return Patch(
        size * vertices + shift,
        faces,
        place + shift,
        np.array([0, 0, 1.0]),
        np.array([1.0, 0, 0]),
        size * points + shift,
        normals,
        size * log,
    )


def corner(x: float, y: float, count: int = 4000) -> Patch:
    """The corner (1, 1, 1) of a cube, seen from (x, y, 1): the shorter of the unfoldings to both sides of it.

    Points whose unfoldings are equally long within 2 % lie on the cut and are left out.
    """
    rng = np.random.default_rng(1)
    cube = pv.Cube(x_length=2, y_length=2, z_length=2).triangulate().clean()
    axis = rng.integers(0, 3, count)
    points = 1.0 - rng.uniform(0, 1.6, (count, 3))
    points[np.arange(count), axis] = 1.0
    a, b, c = 2.0 - points.T
    direct = np.where(
        axis[:, None] == 2,
        points[:, :2],
        np.where(
            axis[:, None] == 0, np.stack([c, points[:, 1]], axis=1), np.stack([points[:, 0], c], axis=1)
        ),
    )
    other = np.where(axis[:, None] == 0, np.stack([b, c], axis=1), np.stack([c, a], axis=1))
    other[axis == 2] = 1e3
    logs = np.stack([direct, other]) - [x, y]
    lengths = np.linalg.norm(logs, axis=2)
    kept = np.abs(lengths[0] - lengths[1]) > 0.02
    log = np.where((lengths[0] < lengths[1])[:, None], *logs)
    return Patch(
        np.asarray(cube.points, np.float64),
        cube.regular_faces,
        np.array([x, y, 1.0]),
        np.array([0, 0, 1.0]),
        np.array([1.0, 0, 0]),
        points[kept],
        np.eye(3)[axis[kept]],
        log[kept],
    )


def tip(sides: int, slope: float, distance: float, count: int = 4000) -> Patch:
    """The tip of a pyramid, whose edges make an angle with its axis, seen from a distance below it.

    The centre lies in the middle of a face. Points on the far side within 0.02 of the cut, which is straight,
    are left out.
    """
    rng = np.random.default_rng(4)
    turn = np.pi / 2 + 2 * np.pi * (np.arange(sides + 1) - 0.5) / sides
    edges = np.stack([np.sin(slope) * np.cos(turn), np.sin(slope) * np.sin(turn)], axis=1)
    edges = np.column_stack([edges, np.full(sides + 1, -np.cos(slope))])
    angle = np.arccos(edges[0] @ edges[1])
    normals = unit(np.cross(edges[:-1], edges[1:]))
    half = 0.5 * sides * angle
    away, length = rng.uniform(-half, half, count), rng.uniform(0.0, 1.2, count)
    kept = length * np.sin(half - np.abs(away)) > 0.02
    away, length = away[kept], length[kept]
    face = np.floor((away / angle + 0.5) % sides).astype(int) % sides
    within = (away + 0.5 * angle) % angle
    across = np.cross(normals, edges[:-1])
    ways = np.cos(within)[:, None] * edges[face] + np.sin(within)[:, None] * across[face]
    down = unit(edges[0] + edges[1])
    i = np.arange(1, sides + 1)
    return Patch(
        np.vstack([np.zeros(3), 3.0 * edges[:-1]]),
        np.stack([0 * i, i, i % sides + 1], axis=1),
        distance * down,
        np.array([0.0, 0.0, 1.0]) if distance == 0.0 else normals[0],
        np.array([1.0, 0.0, 0.0]),
        length[:, None] * ways,
        normals[face],
        np.stack([-length * np.sin(away), length * np.cos(away) - distance], axis=1),
    )


def cylinder(sides: int) -> tuple[Array, NDArray[Any]]:
    """Vertices and faces of a cylinder of radius 1, with its flat end at z = 0."""
    turns = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    vertices = np.vstack([ring, ring - [0, 0, 2.0], [[0, 0, 0]]])
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = np.vstack(
        [
            np.stack([i, i + sides, j + sides], axis=1),
            np.stack([i, j + sides, j], axis=1),
            np.stack([i, j, np.full(sides, 2 * sides)], axis=1),
        ]
    )
    return vertices, faces


def least(length: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Where a length is least, given that it first falls and then rises."""
    for _ in range(80):
        one, other = low + (high - low) / 3, high - (high - low) / 3
        less = length(one) < length(other)
        low, high = np.where(less, low, one), np.where(less, other, high)
    return low


def cylinder_end(inside: float, count: int = 3000, sides: int = 1024, *, clear: float = 0.01) -> Patch:
    """The side of a cylinder just below its end, seen from the end, at a distance inside the rim.

    A path crosses the rim where the sum of both straight parts is least; there are two such places. From a
    centre on the rim, another path runs along the side alone. A path that leaves the rim at an angle φ after
    2φ of it, and then goes t down the side, is as long as that one if t ≈ φ. So the cut lies at z ≈ −s²/9,
    within 0.0005. Points closer to it than `clear` are left out.
    """
    rng = np.random.default_rng(5)
    s, z = rng.uniform(-0.1, 0.75, count), rng.uniform(-0.25, 0, count)
    if inside == 0:
        kept = np.abs(z + s**2 / 9) >= clear
        s, z = s[kept], z[kept]

    def length(at: Array) -> Array:
        result: Array = np.hypot(np.cos(at) - 1 + inside, np.sin(at)) + np.hypot(s - at, z)
        return result

    tried = np.linspace(-1.7, 1.7, 401)
    nearest = np.array([length(np.full(len(s), at)) for at in tried]).argmin(axis=0)
    at = least(length, tried[nearest - 1], tried[nearest + 1])
    across = np.stack([np.sin(at), 1 - inside - np.cos(at)], axis=1)
    log = length(at)[:, None] * across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    if inside == 0:
        straight = np.hypot(s, z) <= length(at) + 1e-9
        log = np.where(straight[:, None], np.stack([s, z], axis=1), log)
    return Patch(
        *cylinder(sides),
        np.array([1.0 - inside, 0, 0]),
        np.array([0, 0, 1.0]),
        np.array([0, 1.0, 0]),
        np.stack([np.cos(s), np.sin(s), z], axis=1),
        np.stack([np.cos(s), np.sin(s), 0 * s], axis=1),
        log,
    )


def cylinder_rim(depth: float, count: int = 3000, sides: int = 128) -> Patch:
    """The side of a cylinder of radius 1, and its flat end at z = 0, seen from a depth below it.

    A path to the end crosses the rim where the sum of both straight parts is least.
    """
    rng = np.random.default_rng(2)
    vertices, faces = cylinder(sides)
    s, z = rng.uniform(-1, 1, count), rng.uniform(-2 * depth, 0, count)
    side = np.stack([np.cos(s), np.sin(s), z], axis=1)
    disc = rng.uniform([0.2, -0.8], [1.0, 0.8], (count, 2))
    disc = disc[np.linalg.norm(disc, axis=1) < 1]

    def length(at: Array) -> Array:
        result: Array = np.hypot(at, depth) + np.hypot(np.cos(at) - disc[:, 0], np.sin(at) - disc[:, 1])
        return result

    low = least(length, np.full(len(disc), -1.5), np.full(len(disc), 1.5))
    over = length(low)[:, None] * unit(np.stack([low, np.full(len(disc), depth)], axis=1))
    ends = np.column_stack([disc, np.zeros(len(disc))])
    return Patch(
        vertices,
        faces,
        np.array([1.0, 0, -depth]),
        np.array([1.0, 0, 0]),
        np.array([0, 1.0, 0]),
        np.vstack([side, ends]),
        np.vstack([side * [1, 1, 0], np.tile([0, 0, 1.0], (len(ends), 1))]),
        np.vstack([np.stack([s, z + depth], axis=1), over]),
    )


BUMPS = 0.06
WAVES = 4.0


def bumpy_gradient(x: Array) -> Array:
    """Gradient of |x| − 1 − 0.06 sin 4x sin 4y sin 4z, whose least radius of curvature is about 0.5."""
    sine, cosine = np.sin(WAVES * x), np.cos(WAVES * x)
    wave = np.stack(
        [
            cosine[:, 0] * sine[:, 1] * sine[:, 2],
            sine[:, 0] * cosine[:, 1] * sine[:, 2],
            sine[:, 0] * sine[:, 1] * cosine[:, 2],
        ],
        axis=1,
    )
    result: Array = unit(x) - BUMPS * WAVES * wave
    return result


def on_bumps(directions: Array) -> Array:
    """Points of the bumpy sphere in these directions."""
    ways: Array = unit(directions)
    radius = np.ones((len(ways), 1))
    for _ in range(20):
        x = radius * ways
        value = radius - 1.0 - BUMPS * np.sin(WAVES * x).prod(axis=1, keepdims=True)
        radius = radius - value / log_maps.dots(bumpy_gradient(x), ways)
    result: Array = radius * ways
    return result


def bumpy(seed: int, radius: float, *, level: int = 5, count: int = 1500) -> Patch:
    """A sphere with bumps; log maps are those of integrated geodesics."""
    rng = np.random.default_rng(seed)
    ball = pv.Icosphere(nsub=level)
    centre = on_bumps(rng.normal(size=(1, 3)))
    normal: Array = unit(bumpy_gradient(centre))
    tangent: Array = log_maps.tangents(rng, normal)
    log: Array = log_maps.offsets(rng, count, radius)
    length = np.linalg.norm(log, axis=1, keepdims=True)
    away = log @ np.vstack([tangent, np.cross(normal, tangent)]) / length
    points = log_maps.walk(bumpy_gradient, np.repeat(centre, count, axis=0), away, length, steps=40)
    return Patch(
        on_bumps(np.asarray(ball.points, np.float64)),
        ball.regular_faces,
        centre[0],
        normal[0],
        tangent[0],
        points,
        unit(bumpy_gradient(points)),
        log,
    )
