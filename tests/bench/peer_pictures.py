"""Picture of the methods of `decal_peers` beside each other: two large decals on a torus."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from decals import Decals, evaluate
from tests.bench.cellular_textures import HEIGHT
from tests.bench.clipped_decals import box_coordinates
from tests.bench.implicit_uvs import nearest
from tests.bench.peer_errors import SmoothMesh, exponential_map, frame_at, torus_field, torus_mesh
from tests.bench.projected_boxes import opacity
from tests.decals.field.log_maps import torus_gradient
from tests.vectors import unit

Float64Array = NDArray[np.float64]
Method = Callable[[SmoothMesh, int, Float64Array, Float64Array], tuple[Float64Array, Float64Array]]
"""Offsets over the radius [n, 2] and opacities [n] of a decal at a vertex, for points and normals."""

RADIUS = 0.5
EYE = np.array([3.6, 0.0, 3.6])
TARGET = np.array([0.9, 0.0, 0.05])
LIGHT = np.array([4.0, -1.5, 4.5])
TANGENT = 0.21
"""Of half the angle of view."""

COLUMNS, GAP = 4, 4
"""Pictures beside each other, and the pixels between them."""

CLAY = np.array([0.80, 0.74, 0.66])
COLORS = np.array([[0.16, 0.42, 0.58], [0.75, 0.33, 0.20]])


def torus_view(side: int) -> tuple[Float64Array, NDArray[np.bool_], Float64Array, Float64Array]:
    """Return rays [side², 3], whether they hit the torus, and the points and normals [n, 3] of the hits."""
    forward = unit(TARGET - EYE)
    right = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    place = TANGENT * ((np.arange(side) + 0.5) * 2 / side - 1)
    x, y = (part.reshape(-1, 1) for part in np.meshgrid(place, -place))
    rays = unit(forward + x * right + y * np.cross(right, forward))
    points = np.tile(EYE, (len(rays), 1))
    for _ in range(200):
        height = torus_field(points)
        points += height[:, None] * rays
    shown = np.abs(height) < 1e-3
    return rays, shown, points[shown], unit(torus_gradient(points[shown]))


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


def by_seeds(mesh: SmoothMesh, vertices: list[int], points: Float64Array) -> Float64Array:
    """Return colours of points by Implicit UVs: each point shows the image of its nearest seed."""
    found = nearest(torus_field, points, mesh.vertices[vertices])
    color = np.tile(CLAY, (len(points), 1))
    for number, vertex in enumerate(vertices):
        own = found.seed == number
        over, inside = pattern(found.offsets[own] @ frame_at(mesh, vertex)[:2].T / RADIUS, number)
        color[own] += inside[:, None] * (over - color[own])
    return color


def by_contact(
    mesh: SmoothMesh, vertices: list[int], points: Float64Array, normals: Float64Array
) -> Float64Array:
    """Return colours of points by implicit decals."""
    decals = Decals.concatenate([decal_at(mesh, vertex) for vertex in vertices])
    samples = evaluate(decals, points, normals, device="cpu")
    color = np.tile(CLAY, (len(points), 1))
    for number in range(len(vertices)):
        own = samples.owner == number
        color[own] = pattern(2 * samples.uv[own].astype(np.float64) - 1, number)[0]
    return color


def add_domes(
    pixels: Float64Array, mesh: SmoothMesh, vertices: list[int], rays: Float64Array, depth: Float64Array
) -> None:
    """Draw cells as domes z = h (1 − x² − y²) where they are nearer than a depth [side²]."""
    for number, vertex in enumerate(vertices):
        frame = frame_at(mesh, vertex)
        start, way = frame @ (EYE - mesh.vertices[vertex]) / RADIUS, rays @ frame.T / RADIUS
        a = HEIGHT * (way[:, :2] ** 2).sum(axis=1)
        b = way[:, 2] / 2 + HEIGHT * way[:, :2] @ start[:2]
        c = start[2] - HEIGHT * (1 - (start[:2] ** 2).sum())
        with np.errstate(invalid="ignore"):
            roots = np.sqrt(b**2 - a * c)
        for root in ((-b - roots) / a, (-b + roots) / a):
            place = start[:2] + root[:, None] * way[:, :2]
            hit = (root < depth) & ((place**2).sum(axis=1) <= 1)
            up = unit(np.column_stack([2 * HEIGHT * place, np.ones(len(place))])[hit] @ frame)
            up *= -np.sign((up * rays[hit]).sum(axis=1, keepdims=True))
            pixels[hit] = pattern(place[hit], number)[0] * lit(up)
            depth[hit] = root[hit]


def lit(normals: Float64Array) -> Float64Array:
    """Return the light on surfaces with these normals, [n, 1]."""
    light: Float64Array = 0.3 + 0.7 * np.clip(normals @ unit(LIGHT), 0, 1)[:, None]
    return light


def draw(*, side: int = 240, rows: int = 316) -> Image.Image:
    """Draw two decals that overlap by each of `METHODS`, then as cells, by seeds, and as implicit decals."""
    mesh = torus_mesh(rows=rows)
    angle = np.array([-0.27, 0.27])
    places = np.column_stack([1.4 * np.cos(angle), 1.4 * np.sin(angle), [0.0, 0.0]])
    vertices = [int(np.linalg.norm(mesh.vertices - place, axis=1).argmin()) for place in places]
    rays, shown, points, normals = torus_view(2 * side)
    colors = []
    for method in METHODS:
        color = np.tile(CLAY, (len(points), 1))
        for number, vertex in enumerate(vertices):
            offsets, alpha = method(mesh, vertex, points, normals)
            over, inside = pattern(offsets, number)
            color += (alpha * inside)[:, None] * (over - color)
        colors.append(color)
    bare = np.tile(CLAY, (len(points), 1))
    colors += [bare, by_seeds(mesh, vertices, points), by_contact(mesh, vertices, points, normals)]
    count = -(-len(colors) // COLUMNS)
    picture = Image.new("RGB", (COLUMNS * (side + GAP) - GAP, count * (side + GAP) - GAP), "white")
    for number, color in enumerate(colors):
        pixels = np.ones((len(shown), 3))
        pixels[shown] = color * lit(normals)
        if color is bare:
            depth = np.full(len(shown), np.inf)
            depth[shown] = np.linalg.norm(points - EYE, axis=1)
            add_domes(pixels, mesh, vertices, rays, depth)
        large = Image.fromarray((255 * pixels).astype(np.uint8).reshape(2 * side, 2 * side, 3))
        corner = number % COLUMNS * (side + GAP), number // COLUMNS * (side + GAP)
        picture.paste(large.resize((side, side), Image.Resampling.BOX), corner)
    return picture
