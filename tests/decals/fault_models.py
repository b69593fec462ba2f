"""Models on which faults of decals show: sharp edges, thin lips, inner shells and open borders."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.decals.meshes import icosphere

Arrays = tuple[np.ndarray, np.ndarray]
"""Vertices ``float64[n, 3]`` and faces ``int64[m, 3]``."""


def revolved(profile: Any, sides: int = 48) -> Arrays:
    """A closed surface: a closed profile of (distance, height), counter-clockwise, around the z axis."""
    rows = np.asarray(profile, float)
    angles = np.arange(sides) * 2 * np.pi / sides
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate(
        [rows[:, None, :1] * ring, np.broadcast_to(rows[:, None, 1:], (len(rows), sides, 1))], 2
    )
    i, j = np.meshgrid(np.arange(len(rows)), np.arange(sides), indexing="ij")
    a, b = i * sides + j, i * sides + (j + 1) % sides
    c, d = (i + 1) % len(rows) * sides + (j + 1) % sides, (i + 1) % len(rows) * sides + j
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    return points.reshape(-1, 3), faces


def extruded(outline: np.ndarray, height: float) -> Arrays:
    """A closed prism over an outline ``[n, 2]`` that its centre sees, counter-clockwise."""
    n = len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (-height / 2, height / 2))
    vertices = np.concatenate([low, high, [[0, 0, -height / 2], [0, 0, height / 2]]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    parts = [(i, j, j + n), (i, j + n, i + n), (j, i, 0 * i + 2 * n), (i + n, j + n, 0 * i + 2 * n + 1)]
    return vertices, np.concatenate([np.stack(part, axis=1) for part in parts])


def joined(*parts: Arrays) -> Arrays:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [part[1] + start for part, start in zip(parts, starts[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def gear() -> Arrays:
    """Eight teeth: convex and concave edges of a CAD part."""
    angles = np.arange(32) * 2 * np.pi / 32
    radii = np.where(np.arange(32) % 4 < 2, 1.0, 0.75)
    return extruded(radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1), 0.6)


def knob() -> Arrays:
    """A stepped cylinder: sharp rims of a turned CAD part."""
    return revolved([(0.0, -0.6), (1.0, -0.6), (1.0, -0.2), (0.6, -0.2), (0.6, 0.5), (0.0, 0.5)])


def cup() -> Arrays:
    """A cup whose wall is thinner than the spacing of decals."""
    heights = np.linspace(-0.6, 0.6, 13)
    outer = [(0.7 + 0.15 * z, z) for z in heights]
    inner = [(0.66 + 0.15 * z, z) for z in heights[:0:-1]]
    return revolved([(0.0, -0.6), *outer, *inner, (0.0, -0.55)])


def shells() -> Arrays:
    """A ball three times in one mesh, around a smaller ball and a cavity."""
    vertices, faces = icosphere(3)
    cavity = 0.5 * vertices + (0.0, 0.0, 0.3), faces[:, ::-1]
    core = 0.3 * vertices - (0.0, 0.0, 0.4), faces
    return joined((vertices, faces), (vertices, faces), (vertices, faces), cavity, core)


def bowl() -> Arrays:
    """An open organic sheet with a ragged border."""
    vertices, faces = icosphere(4)
    bumps = 1 + 0.08 * np.sin(5 * vertices[:, 0]) * np.sin(4 * vertices[:, 1] + 1)
    heights = vertices[faces].mean(axis=1)
    kept = heights[:, 2] < 0.25 + 0.1 * np.sin(9 * np.arctan2(heights[:, 1], heights[:, 0]))
    return vertices * bumps[:, None], faces[kept]


def ears() -> Arrays:
    """A smooth head with two thin ears."""
    vertices, faces = icosphere(5)
    rise = np.zeros(len(vertices))
    for x in (-1, 1):
        toward = vertices @ (np.array([0.6 * x, 0.0, 0.8]))
        rise += np.exp((toward - 1) / 0.08) * np.exp(-((vertices[:, 1] / 0.12) ** 2))
    return vertices * (1 + 0.8 * rise)[:, None], faces


def visible(name: str) -> Arrays:
    """The part of a model that can be seen from outside."""
    return icosphere(3) if name == "shells" else FAULT_MODELS[name]()


FAULT_MODELS: dict[str, Callable[[], Arrays]] = {
    "gear": gear,
    "knob": knob,
    "cup": cup,
    "shells": shells,
    "bowl": bowl,
    "ears": ears,
}
"""Models by name."""
