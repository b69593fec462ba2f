"""What the examples share: simple meshes, test images and cameras."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.scenes.camera import Camera, Vector
from decals.scenes.mesh_file import MeshArrays
from decals.scenes.scene import DecalImage, MeshObject

Floats = NDArray[np.floating[Any]]

CLAY = (0.74, 0.71, 0.66)


def plane(half: float = 1.0) -> MeshObject:
    """Make a square in the xy plane, facing +z."""
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    return MeshObject("plane", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), color=CLAY)


def box(half: float = 0.8) -> MeshArrays:
    """Make a cube whose edges are sharp: each face has its own corners."""
    vertices: list[Floats] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            normal = side * np.eye(3)[axis]
            turn = side
            faces += [[len(vertices) + i for i in face] for face in ((0, 1, 2), (0, 2, 3))]
            vertices += [
                normal - turn * u - v,
                normal + turn * u - v,
                normal + turn * u + v,
                normal - turn * u + v,
            ]
    return (half * np.array(vertices)).astype(np.float32), np.array(faces, np.int32)


def plate(hole: float = 0.3, *, half: float = 1.0, thickness: float = 0.3, around: int = 64) -> MeshArrays:
    """Make a square plate in the xy plane with a round hole in its middle."""
    angle = np.arange(around + 1) * (2 * np.pi / around) + np.pi / 4
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner, outer = hole * ring, half * ring / np.abs(ring).max(axis=1, keepdims=True)
    top, low = thickness / 2, -thickness / 2
    strips = [
        (inner, top, outer, top),
        (outer, top, outer, low),
        (outer, low, inner, low),
        (inner, low, inner, top),
    ]
    vertices: list[Floats] = []
    faces: list[list[int]] = []
    for first, z_first, second, z_second in strips:
        base = sum(len(part) for part in vertices)
        for points, z in ((first, z_first), (second, z_second)):
            vertices.append(np.column_stack([points, np.full(len(points), z)]))
        for i in range(around):
            a, b, c, d = base + i, base + i + 1, base + around + 1 + i, base + around + 2 + i
            faces += [[a, c, d], [a, d, b]]
    return np.concatenate(vertices).astype(np.float32), np.array(faces, np.int32)


def bumps(side: int = 80) -> MeshArrays:
    """Make a square of rolling bumps over the xy plane."""
    grid = np.linspace(-1, 1, side)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    z = 0.12 * np.cos(7 * x) * np.cos(7 * y)
    i, j = np.meshgrid(np.arange(side - 1), np.arange(side - 1), indexing="ij")
    a = (i * side + j).reshape(-1)
    b, c, d = a + side, a + side + 1, a + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def checker(squares: int = 8, *, edge: int = 256) -> DecalImage:
    """Draw a checkerboard with a frame and a red middle: what a mapping does to it is plain to see."""
    i, j = np.indices((edge, edge))
    x, y = (i + 0.5) / edge, (j + 0.5) / edge
    dark = (np.floor(x * squares) + np.floor(y * squares)) % 2 == 0
    pixels = np.where(dark[..., None], [38, 84, 124, 255], [240, 236, 220, 255]).astype(np.uint8)
    radius = np.hypot(x - 0.5, y - 0.5)
    pixels[radius < 0.06] = [200, 60, 40, 255]
    pixels[(radius > 0.47) & (radius <= 0.5)] = [20, 20, 20, 255]
    pixels[radius > 0.5] = 0
    return DecalImage("checker", pixels)


def rings(color: tuple[int, int, int] = (214, 156, 64), *, edge: int = 256) -> DecalImage:
    """Draw concentric rings with a black rim: they show how far a decal is pushed."""
    i, j = np.indices((edge, edge))
    radius = 2 * np.hypot((i + 0.5) / edge - 0.5, (j + 0.5) / edge - 0.5)
    shade = np.where(np.floor(radius * 6) % 2 == 0, 1.0, 0.8)[..., None]
    pixels = np.empty((edge, edge, 4), np.uint8)
    pixels[..., :3] = np.asarray(color) * shade
    pixels[..., 3] = 255
    pixels[radius > 0.93] = [15, 15, 15, 255]
    return DecalImage("rings", pixels)


def straight_down(height: float = 4.2) -> Camera:
    """Look at the xy plane from above."""
    return Camera(position=(0.0, 0.0, height), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=28.0)


def looking(
    position: Vector, target: Vector = (0.0, 0.0, 0.0), *, up: Vector = (0.0, 0.0, 1.0), fov: float = 28.0
) -> Camera:
    """Look from a place at another."""
    return Camera(position=position, target=target, up=up, fov=fov)


def scattered(rng: np.random.Generator, count: int, half: float) -> NDArray[np.float32]:
    """Points in a square of the xy plane."""
    points = np.zeros((count, 3), np.float32)
    points[:, :2] = rng.uniform(-half, half, (count, 2))
    return points
