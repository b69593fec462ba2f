"""Random solids with sharp edges, and how far their meshes are from them."""

from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import Box, Cylinder, Frustum, Mesh, Prism, polygonize
from tests.oracles import sharp
from tests.thin_trees import is_closed

Floats = NDArray[np.float64]

CHORD_ERROR = 3e-4
"""Chord error of the meshes, over the size."""


@dataclass(frozen=True)
class Measured:
    """A mesh beside the solid that it shows.

    Attributes
    ----------
    edge
        Largest distance of a vertex on a crease from the edges, over the size.
    volume
        Relative error of the volume.
    closed
        Each edge has two triangles.
    unresolved
        Number of vertices whose sheets do not meet.
    """

    edge: float
    volume: float
    closed: bool
    unresolved: int


def random_solid(rng: np.random.Generator) -> tuple[Any, float]:
    """A sharp solid and its volume."""
    a, b = rng.uniform(-1, 1, (2, 3))
    first, last = rng.uniform(0.3, 0.8, 2).tolist()
    length = float(np.linalg.norm(b - a))
    match rng.integers(0, 4):
        case 0:
            size = rng.uniform(0.4, 2, 3)
            return Box(tuple(a), tuple(size), radius=0), float(size.prod())
        case 1:
            return Cylinder(tuple(a), tuple(b), first, radius=0), np.pi * first**2 * length
        case 2:
            volume = np.pi / 3 * (first**2 + first * last + last**2) * length
            return Frustum(tuple(a), tuple(b), first, last), volume
    count = int(rng.integers(4, 8))
    angles = np.arange(count) * 2 * np.pi / count
    flat = rng.uniform(0.6, 1, count)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    x, y = flat.T
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    return Prism(tuple(a + np.array([u, v, 0]) for u, v in flat), first), area * first


def distance_from_edges(node: Any, q: Floats) -> Floats:
    """Distances (n,) of points from the edges of a solid."""
    if isinstance(node, Cylinder | Frustum):
        corners = sharp.profile(node)[1:3]
        axis = np.subtract(node.end, node.start)
        axis = axis / np.linalg.norm(axis)
        along = (q - np.array(node.start)) @ axis
        across = np.linalg.norm(q - np.array(node.start) - along[:, None] * axis, axis=1)
        return np.asarray(np.min([np.hypot(across - r, along - x) for r, x in corners], axis=0))
    if isinstance(node, Box):
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        edges = [(i, j) for i, j in combinations(range(8), 2) if np.abs(signs[i] - signs[j]).sum() == 1]
        corners = np.array(node.center) + signs * np.array(node.size)
    else:
        base, count = np.array(node.points), len(node.points)
        corners = np.concatenate([base, base + np.array([0, 0, node.height])])
        ring = [(i, (i + 1) % count) for i in range(count)]
        edges = [*ring, *((i + count, j + count) for i, j in ring), *((i, i + count) for i in range(count))]
    best = np.full(len(q), np.inf)
    for i, j in edges:
        way, w = corners[j] - corners[i], q - corners[i]
        t = np.clip(w @ way / (way @ way), 0, 1)
        best = np.minimum(best, np.linalg.norm(w - t[:, None] * way, axis=1))
    return best


def volume_of(mesh: Mesh) -> float:
    a, b, c = mesh.vertices.astype(np.float64)[mesh.faces].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum()) / 6.0


def measured(seed: int) -> Measured:
    """A random solid, turned, beside its mesh."""
    rng = np.random.default_rng(seed)
    solid, volume = random_solid(rng)
    turned = solid.rotate(tuple(rng.normal(size=3)), float(rng.uniform(0, 180)))
    size = float((turned.bounds[1] - turned.bounds[0]).max())
    mesh = polygonize(turned, chord_error=CHORD_ERROR * size, creases=True)
    assert mesh.sheet_counts is not None
    there = mesh.vertices[mesh.sheet_counts > 1] @ np.array(turned.matrix)[:, :3]  # a rotation
    assert len(there) > 8
    return Measured(
        edge=float(distance_from_edges(solid, there).max()) / size,
        volume=abs(volume_of(mesh) / volume - 1.0),
        closed=is_closed(mesh.faces),
        unresolved=int((mesh.sheet_counts == 0).sum()),
    )
