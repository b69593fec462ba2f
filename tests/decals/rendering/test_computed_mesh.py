"""Meshes of compute shaders: the nearest face at every pixel, against rays cast in float64."""

import numpy as np
import pytest
from numpy.typing import NDArray

from decals import Camera
from decals.rendering import Buffers, Projection, Renderer, RenderOptions, Viewpoint, computed_mesh
from decals.rendering.computed_mesh import ComputedMeshDrawable, mesh_drawable
from decals.rendering.mesh import MeshDrawable
from tests.decals.rendering.pictures import assert_same_surfaces
from tests.decals.shapes import Shape, View, torus
from tests.oracles.raster import edges

SIZE = (90, 60)
CAMERA = Camera((0.3, -0.2, 4.0), (0.0, 0.0, 0.0))
PARALLEL = Projection(np.diag([0.6, 0.9, -0.02, 1.0]))
MIRRORED = Projection(np.diag([-0.6, 0.9, -0.02, 1.0]))


def soup(seed: int, size: float) -> Shape:
    """Triangles around a middle size; large ones lie partly behind the eye and outside of the picture."""
    rng = np.random.default_rng(seed)
    spread = size * 10.0 ** rng.uniform(-0.5, 0.5, (60, 1, 1))
    vertices = rng.uniform(-1.5, 1.5, (60, 1, 3)) + spread * rng.normal(size=(60, 3, 3))
    return Shape(vertices.reshape(-1, 3).astype(np.float32), np.arange(180, dtype=np.int32).reshape(-1, 3))


def drawn(renderer: Renderer, viewpoint: Viewpoint, *shapes: Shape) -> Buffers:
    return renderer.buffers(View(shapes, CAMERA), RenderOptions(size=SIZE), viewpoint=viewpoint)


def hits(shape: Shape, viewpoint: Viewpoint) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """First face between the planes on each pixel's ray, or -1, and its place (Möller and Trumbore)."""
    width, height = SIZE
    rays = viewpoint.rays(width, height)
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    origins = np.broadcast_to(rays.origins(x, y), (height, width, 3)).reshape(-1, 1, 3)
    directions = np.broadcast_to(rays.directions(x, y), (height, width, 3)).reshape(-1, 1, 3)
    a, b, c = np.moveaxis(shape.vertices.astype(np.float64)[shape.faces], 1, 0)
    across = np.cross(directions, c - a)
    turned = np.cross(origins - a, b - a)
    volume = (across * (b - a)).sum(axis=-1)
    u = (across * (origins - a)).sum(axis=-1) / volume
    v = (directions * turned).sum(axis=-1) / volume
    way = (turned * (c - a)).sum(axis=-1) / volume
    matrix = viewpoint.clip_matrix(SIZE, (shape.vertices.min(axis=0), shape.vertices.max(axis=0)))
    clip = (origins + way[..., None] * directions) @ matrix[:, :3].T + matrix[:, 3]
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (np.abs(clip[..., 2]) <= clip[..., 3])
    face = np.where(inside.any(axis=1), np.where(inside, way, np.inf).argmin(axis=1), -1)
    places = (origins + way[np.arange(len(way)), face][:, None, None] * directions)[:, 0]
    return face.reshape(height, width), places.reshape(height, width, 3)


@pytest.mark.parametrize("viewpoint", [CAMERA, PARALLEL], ids=["perspective", "parallel"])
@pytest.mark.parametrize("size", [0.1, 1.0, 30.0, 1000.0])
def test_the_nearest_face_is_drawn_where_its_ray_meets_it(
    compute: Renderer, size: float, viewpoint: Viewpoint
) -> None:
    sure = 0
    for seed in range(4):
        shape = soup(seed, size)
        face, places = hits(shape, viewpoint)
        buffers = drawn(compute, viewpoint, shape)
        inner = ~edges(face)
        sure += inner.sum()
        hidden = (buffers.object_id >= 0) != (face >= 0)
        assert hidden[inner].sum() <= 2  # crumbs between pixels
        seen = inner & (face >= 0) & ~hidden
        scale = np.linalg.norm(places[seen] - CAMERA.position, axis=-1, keepdims=True)
        apart = np.abs(buffers.position[seen] - places[seen]) / scale
        assert (apart.max(axis=-1) > 2e-5).sum() <= 2
    assert sure > 0.3 * 4 * SIZE[0] * SIZE[1]


@pytest.mark.parametrize("viewpoint", [CAMERA, PARALLEL, MIRRORED])
def test_sides_colours_and_normals_are_those_of_the_rasteriser(
    fragment: Renderer, compute: Renderer, viewpoint: Viewpoint
) -> None:
    for size in (0.1, 1.0, 30.0):
        shapes = soup(5, size), soup(6, size), torus()
        assert_same_surfaces(*(drawn(renderer, viewpoint, *shapes) for renderer in (fragment, compute)))


@pytest.mark.parametrize("rows", [6, 12, 24])
def test_closed_meshes_have_no_holes(compute: Renderer, rows: int) -> None:
    shape = torus(rows=rows, columns=rows // 2)
    camera = Camera.framing(
        (shape.vertices.min(axis=0), shape.vertices.max(axis=0)), direction=(0.1, 0.4, 1.0)
    )
    face, _ = hits(shape, camera)
    buffers = drawn(compute, camera, shape)
    assert ((buffers.object_id < 0) & (face >= 0)).sum() == 0
    assert ((buffers.object_id >= 0) & (face < 0)).mean() < 1e-3


def test_faces_without_spare_shares_are_one_share(compute: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = drawn(compute, CAMERA, soup(3, 30.0))
    monkeypatch.setattr(computed_mesh, "SPARE_SHARES", 3)
    full = drawn(compute, CAMERA, soup(3, 30.0))
    assert (whole.object_id >= 0).mean() > 0.5
    np.testing.assert_array_equal(full.position, whole.position)
    np.testing.assert_array_equal(full.object_id, whole.object_id)


def test_an_interrupted_drawing_leaves_nothing_behind(
    compute: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = drawn(compute, CAMERA, torus())

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(computed_mesh, "use_base_texture", interrupted)
        with pytest.raises(KeyboardInterrupt):
            drawn(compute, CAMERA, soup(3, 30.0))
    np.testing.assert_array_equal(drawn(compute, CAMERA, torus()).position, before.position)


def test_a_mesh_beyond_the_drivers_buffers_is_rasterised(
    compute: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with compute.context.current():
        for limit, kind in ((1 << 30, ComputedMeshDrawable), (1000, MeshDrawable)):
            monkeypatch.setitem(compute.context.gl.info, "GL_MAX_SHADER_STORAGE_BLOCK_SIZE", limit)
            drawable = mesh_drawable(compute.context, torus())
            assert type(drawable) is kind
            drawable.release()


def test_flat_and_turned_away_faces_are_harmless(compute: Renderer) -> None:
    """Faces without area, faces seen from the side, and corners at the eye."""
    x, y, z = CAMERA.position
    vertices = np.array(
        [
            [0, 0, 0],
            [1, 0, 0],
            [2, 0, 0],
            [x, y, z],
            [x, y, -5],
            [x, y, 0],
            [-1, -1, 0],
            [1, -1, 0],
            [0, 1, 0],
        ],
        np.float32,
    )
    faces = np.array([[0, 1, 2], [3, 4, 5], [0, 0, 0], [3, 1, 2], [6, 7, 8]], np.int32)
    buffers = drawn(compute, CAMERA, Shape(vertices, faces))
    assert (buffers.object_id == 0).any()
    assert np.isfinite(buffers.position).all()
    assert np.isfinite(buffers.normal).all()
