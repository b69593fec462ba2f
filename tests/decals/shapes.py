"""Small scenes for the renderer's tests."""

from dataclasses import dataclass, field

import numpy as np

from decals import Camera, Decals
from decals.scenes.camera import Vector


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh and its colour: all that the renderer asks of one."""

    vertices: np.ndarray
    faces: np.ndarray
    color: tuple[float, float, float] = (0.7, 0.6, 0.5)
    crease_angle: float = 35.0


@dataclass(frozen=True, eq=False)
class Picture:
    """A decal image: all that the renderer asks of one."""

    pixels: np.ndarray


@dataclass(frozen=True, eq=False)
class View:
    """A scene: all that the renderer asks of one."""

    objects: tuple[object, ...]
    camera: Camera
    decals: Decals = field(default_factory=Decals.empty)
    images: tuple[Picture, ...] = ()


def grid(rows: int, columns: int) -> np.ndarray:
    """Two triangles for each cell of a grid of points that closes in both directions."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a, b = i * columns + j, (i + 1) % rows * columns + j
    c, d = (i + 1) % rows * columns + (j + 1) % columns, i * columns + (j + 1) % columns
    return np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3).astype(np.int32)


def sheet_faces(rows: int, columns: int) -> np.ndarray:
    """Two triangles for each cell of a grid of points, which are numbered row by row."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).reshape(-1)
    quads = np.stack([a, a + columns, a + columns + 1, a + 1], 1)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def torus(
    radius: float = 1.0,
    tube: float = 0.4,
    rows: int = 24,
    columns: int = 12,
    *,
    shift: Vector = (0, 0, 0),
) -> Shape:
    """A torus around the z axis, faces counter-clockwise from outside."""
    u, v = np.meshgrid(*(np.arange(n) * 2 * np.pi / n for n in (rows, columns)), indexing="ij")
    ring = radius + tube * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], -1).reshape(-1, 3) + shift
    return Shape(points.astype(np.float32), grid(rows, columns))
