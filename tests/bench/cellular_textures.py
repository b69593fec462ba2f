"""Cellular textures (Fleischer, Laidlaw, Currin and Barr 1995, "Cellular Texture Generation"), for the
comparison of methods.

A cell has a position, an orientation and a size. Differential equations move it towards the surface, push
overlapping cells apart, turn its normal to that of the surface and its tangent to those of its neighbours,
and let it grow. A cell with room divides; a cell under pressure, or away from the surface, dies. At rest
each cell becomes polygons in its own frame: here a low dome, a scale.

The equations are those of the paper's cell programs in words; their constants are ours. Frames replace
quaternions, and steps of Euler the paper's adaptive solver. Left out: chemicals that diffuse between cells,
kinds of cells, and levels of detail of the polygons.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals.model import FACING_LIMIT
from tests.bench.clipped_decals import ClippedMesh

Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.intp]
Surface = Callable[[Float64Array], tuple[Float64Array, Float64Array]]
"""Signed distances float64[n] of points float64[n, 3], and unit normals of the surface next to them."""

RATE = 0.5
"""Share of the way to the surface, to its normal and to the full size, in one step."""

PUSH = 0.1
ALIGNMENT = 0.2
"""Share of the overlap, and of the way to the neighbours' tangents, in one step."""

ROOM, CROWD = 0.2, 2.0
"""Pressure below which a cell of full size divides, and above which it dies."""

RIPENING = 20
"""Number of steps for which a cell has room before it divides."""

STILL = 2e-3
"""Movement of a cell at rest in one step, in sizes."""

MAX_STEPS = 2_000
RECORD_BYTES = 32
"""Position, quaternion and size, in float32."""

RINGS, SECTORS = 4, 16
HEIGHT = 0.3
"""Rings and sectors of a dome, and its height over its radius."""


@dataclass
class Cells:
    """Cells: positions, normals and tangents float64[n, 3], and sizes float64[n]."""

    positions: Float64Array
    normals: Float64Array
    tangents: Float64Array
    sizes: Float64Array

    @classmethod
    def at(cls, positions: Float64Array, surface: Surface, size: float) -> "Cells":
        """Return cells at points, upright, with tangents as like as possible."""
        normals = surface(positions)[1]
        spare = np.eye(3)[np.abs(normals).argmin(axis=1)]
        return cls(positions.copy(), normals, _across(spare, normals), np.full(len(positions), size))

    def __len__(self) -> int:
        return len(self.positions)

    def rows(self, rows: NDArray[np.generic]) -> "Cells":
        """Return some of the cells."""
        return Cells(self.positions[rows], self.normals[rows], self.tangents[rows], self.sizes[rows])


@dataclass(frozen=True)
class Rest:
    """Cells at rest, the steps that led there, and the divisions and deaths on the way."""

    cells: Cells
    steps: int
    divisions: int
    deaths: int


def simulate(cells: Cells, surface: Surface, size: float, *, seed: int = 0, unrest: float = 0.0) -> Rest:
    """Integrate the equations of cells of a full size until they rest, but for a share of them."""
    rng = np.random.default_rng(seed)
    divisions = deaths = 0
    age = rng.integers(0, RIPENING, len(cells))  # steps with room
    steps = 0
    while steps < MAX_STEPS:
        steps += 1
        cells, pressure, away, moves = _step(cells, surface, size)
        # Of a crowd not all die at once: the others may have room then.
        dying = away | ((pressure > CROWD) & (rng.random(len(cells)) < 0.1))
        age = np.where(pressure < ROOM, age + 1, 0)
        ripe = ~dying & (age > RIPENING) & (cells.sizes > 0.95 * size)
        if ((age > 0) | dying | (moves > STILL * size)).mean() <= unrest:
            break
        deaths, divisions = deaths + int(dying.sum()), divisions + int(ripe.sum())
        daughters = cells.rows(ripe)
        angle = rng.uniform(0, 2 * np.pi, (len(daughters), 1))
        across = np.cross(daughters.normals, daughters.tangents)
        shift = 0.5 * size * (np.cos(angle) * daughters.tangents + np.sin(angle) * across)
        cells.positions[ripe] -= shift
        cells.sizes[ripe] *= 0.5**0.5
        age[ripe] = 0
        daughters.positions += shift
        daughters.sizes *= 0.5**0.5
        cells = _joined(cells.rows(~dying), daughters)
        age = np.concatenate([age[~dying], np.zeros(len(daughters), age.dtype)])
    return Rest(cells, steps, divisions, deaths)


def _step(
    cells: Cells, surface: Surface, size: float
) -> tuple[Cells, Float64Array, NDArray[np.bool_], Float64Array]:
    """Return cells after a step.

    The other results are the pressure on each cell, whether it was away from the surface, and its movement.
    """
    x, r = cells.positions, cells.sizes
    first, second = cKDTree(x).query_pairs(2 * float(r.max(initial=0.0)), output_type="ndarray").T
    offset = x[first] - x[second]
    gap = np.linalg.norm(offset, axis=1)
    overlap = r[first] + r[second] - gap
    near = (overlap > 0) & ((cells.normals[first] * cells.normals[second]).sum(axis=1) > FACING_LIMIT)
    first, second, overlap = first[near], second[near], overlap[near]
    push = (overlap / np.maximum(gap[near], 1e-12))[:, None] * offset[near]
    force, like, pressure = np.zeros_like(x), np.zeros_like(x), np.zeros(len(x))
    for one, other, sign in ((first, second, 1.0), (second, first, -1.0)):
        np.add.at(force, one, sign * push)
        np.add.at(like, one, cells.tangents[other])
        np.add.at(pressure, one, overlap / r[one])
    distance, up = surface(x)
    move = PUSH * (force - (force * up).sum(axis=1, keepdims=True) * up)
    normals = _unit(cells.normals + RATE * (up - cells.normals))
    tangents = _across(cells.tangents + ALIGNMENT * (_unit(like) - cells.tangents), normals)
    next_cells = Cells(
        x + move - RATE * distance[:, None] * up, normals, tangents, r + RATE * (size - r) / 10
    )
    return next_cells, pressure, np.abs(distance) > size, np.linalg.norm(move, axis=1)


def _unit(vectors: Float64Array) -> Float64Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: Float64Array = vectors / np.where(lengths > 0, lengths, 1.0)
    return result


def _across(vectors: Float64Array, normals: Float64Array) -> Float64Array:
    """Return unit vectors perpendicular to normals."""
    return _unit(vectors - (vectors * normals).sum(axis=1, keepdims=True) * normals)


def _joined(a: Cells, b: Cells) -> Cells:
    return Cells(
        np.concatenate([a.positions, b.positions]),
        np.concatenate([a.normals, b.normals]),
        np.concatenate([a.tangents, b.tangents]),
        np.concatenate([a.sizes, b.sizes]),
    )


def domes(cells: Cells, *, height: float = HEIGHT) -> ClippedMesh:
    """Return a dome for each cell, with texture coordinates of its disc."""
    turn = 2 * np.pi * np.arange(SECTORS) / SECTORS
    reach = np.repeat(np.arange(1, RINGS + 1) / RINGS, SECTORS)
    disc = reach[:, None] * np.tile(np.column_stack([np.cos(turn), np.sin(turn)]), (RINGS, 1))
    disc = np.vstack([[0.0, 0.0], disc])
    corner = 1 + np.arange(RINGS * SECTORS).reshape(RINGS, SECTORS)
    after = np.roll(corner, -1, axis=1)
    inner, next_inner, outer, next_outer = corner[:-1], after[:-1], corner[1:], after[1:]
    quads = [
        np.stack([inner, outer, next_outer], axis=-1),
        np.stack([inner, next_outer, next_inner], axis=-1),
    ]
    faces = np.vstack(
        [np.column_stack([0 * corner[0], corner[0], after[0]]), *(q.reshape(-1, 3) for q in quads)]
    )
    local = np.column_stack([disc, height * (1 - (disc**2).sum(axis=1))])
    frames = np.stack([cells.tangents, np.cross(cells.normals, cells.tangents), cells.normals], axis=1)
    vertices = cells.positions[:, None] + cells.sizes[:, None, None] * (local @ frames)
    shift = len(local) * np.arange(len(cells))[:, None, None]
    return ClippedMesh(
        vertices.reshape(-1, 3),
        np.tile(0.5 + 0.5 * disc, (len(cells), 1)),
        (faces + shift).reshape(-1, 3),
        np.repeat(np.arange(len(cells)), len(faces)),
    )


def cover(cells: Cells, points: Float64Array, normals: Float64Array) -> IndexArray:
    """Return the number of cells over each point of the surface, seen along the normals of the cells."""
    count = np.zeros(len(points), np.intp)
    for cell, near in enumerate(cKDTree(points).query_ball_point(cells.positions, 2**0.5 * cells.sizes)):
        rows = np.asarray(near, np.intp)
        offset, up = points[rows] - cells.positions[cell], cells.normals[cell]
        height = offset @ up
        size = cells.sizes[cell]
        over = ((offset**2).sum(axis=1) - height**2 <= size**2) & (np.abs(height) <= size)
        count[rows[over & (normals[rows] @ up > 0)]] += 1
    return count
