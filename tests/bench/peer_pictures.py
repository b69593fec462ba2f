"""Picture of the methods of `decal_peers` beside each other: two large decals on a torus."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from decals.field.evaluate import evaluate
from decals.model import Decals
from tests.bench.clipped_decals import box_coordinates
from tests.bench.decal_peers import SmoothMesh, exponential_map, frame_at, torus_mesh
from tests.bench.projected_boxes import opacity
from tests.decals.field.log_maps import torus_gradient, unit

Float64Array = NDArray[np.float64]
Method = Callable[[SmoothMesh, int, Float64Array, Float64Array], tuple[Float64Array, Float64Array]]
"""Offsets over the radius [n, 2] and opacities [n] of a decal at a vertex, for points and normals."""

RADIUS = 0.5
EYE = np.array([3.6, 0.0, 3.6])
TARGET = np.array([0.9, 0.0, 0.05])
LIGHT = np.array([4.0, -1.5, 4.5])
TANGENT = 0.21
"""Of half the angle of view."""

CLAY = np.array([0.80, 0.74, 0.66])
COLORS = np.array([[0.16, 0.42, 0.58], [0.75, 0.33, 0.20]])


def torus_view(side: int) -> tuple[NDArray[np.bool_], Float64Array, Float64Array]:
    """Return the pixels [side²] that show the torus, with their points and normals [n, 3]."""
    forward = unit(TARGET - EYE)
    right = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    place = TANGENT * ((np.arange(side) + 0.5) * 2 / side - 1)
    x, y = (part.reshape(-1, 1) for part in np.meshgrid(place, -place))
    rays = unit(forward + x * right + y * np.cross(right, forward))
    points = np.tile(EYE, (len(rays), 1))
    for _ in range(200):
        height = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2]) - 0.4
        points += height[:, None] * rays
    shown = np.abs(height) < 1e-3
    return shown, points[shown], unit(torus_gradient(points[shown]))


def decal_at(mesh: SmoothMesh, vertex: int) -> Decals:
    """Return a decal at a vertex, in the frame of all methods."""
    u, _, normal = frame_at(mesh, vertex)
    return Decals(mesh.vertices[vertex : vertex + 1], [normal], [u], [RADIUS])


def by_exponential_map(
    mesh: SmoothMesh, vertex: int, points: Float64Array, normals: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Draw by a discrete exponential map of the mesh."""
    near = np.linalg.norm(points - mesh.vertices[vertex], axis=1) < RADIUS
    offsets = np.full((len(points), 2), 2.0)
    offsets[near] = exponential_map(mesh, vertex, points[near], RADIUS) / RADIUS
    return offsets, np.ones(len(points))


def by_box(
    mesh: SmoothMesh, vertex: int, points: Float64Array, normals: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Draw all of the surface in the box, as mesh-clipped decals do."""
    local = box_coordinates(decal_at(mesh, vertex), np.zeros(len(points), np.intp), points[:, None])[:, 0]
    return local[:, :2], (np.abs(local[:, 2]) <= 1).astype(np.float64)


def by_faded_box(
    mesh: SmoothMesh, vertex: int, points: Float64Array, normals: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Draw a box that fades by angle, as engines do."""
    offsets, inside = by_box(mesh, vertex, points, normals)
    return offsets, inside * opacity(normals @ frame_at(mesh, vertex)[2])


def by_sprite(
    mesh: SmoothMesh, vertex: int, points: Float64Array, normals: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Draw what faces the sprite in its box."""
    offsets, inside = by_box(mesh, vertex, points, normals)
    return offsets, inside * (normals @ frame_at(mesh, vertex)[2] > 0)


METHODS: tuple[Method, ...] = (by_exponential_map, by_box, by_faded_box, by_sprite)


def pattern(offsets: Float64Array, number: int) -> tuple[Float64Array, Float64Array]:
    """Return colours and opacities of a round chessboard at offsets over the radius."""
    odd = np.floor(5 * (offsets + 1)).astype(int).sum(axis=1) % 2 == 1
    size = np.linalg.norm(offsets, axis=1)
    color = np.where((odd & (size < 0.9))[:, None], 0.95, COLORS[number])
    return color, (size <= 1).astype(np.float64)


def draw(*, side: int = 240, rows: int = 316) -> Image.Image:
    """Draw two decals that overlap by each of `METHODS`, and as implicit decals."""
    mesh = torus_mesh(rows=rows)
    angle = np.array([-0.27, 0.27])
    places = np.column_stack([1.4 * np.cos(angle), 1.4 * np.sin(angle), [0.0, 0.0]])
    vertices = [int(np.linalg.norm(mesh.vertices - place, axis=1).argmin()) for place in places]
    shown, points, normals = torus_view(2 * side)
    light = 0.3 + 0.7 * np.clip(normals @ unit(LIGHT), 0, 1)[:, None]
    panels = []
    for method in METHODS:
        color = np.tile(CLAY, (len(points), 1))
        for number, vertex in enumerate(vertices):
            offsets, alpha = method(mesh, vertex, points, normals)
            over, inside = pattern(offsets, number)
            color += (alpha * inside)[:, None] * (over - color)
        panels.append(color)
    decals = Decals.concatenate([decal_at(mesh, vertex) for vertex in vertices])
    samples = evaluate(decals, points, normals, device="cpu")
    color = np.tile(CLAY, (len(points), 1))
    for number in range(len(vertices)):
        own = samples.owner == number
        color[own] = pattern(2 * samples.uv[own].astype(np.float64) - 1, number)[0]
    panels.append(color)
    row = Image.new("RGB", (len(panels) * (side + 4) - 4, side), "white")
    for number, color in enumerate(panels):
        pixels = np.ones((len(shown), 3))
        pixels[shown] = color * light
        large = Image.fromarray((255 * pixels).astype(np.uint8).reshape(2 * side, 2 * side, 3))
        row.paste(large.resize((side, side), Image.Resampling.BOX), (number * (side + 4), 0))
    return row
