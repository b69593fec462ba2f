"""What is visible at every pixel, against rays cast in float64."""

from dataclasses import replace

import numpy as np
import pytest

from decals import Camera, scatter
from decals.errors import InvalidScene
from decals.rendering import Renderer, RenderOptions
from decals.surfaces.normals import vertex_normals
from tests.decals.meshes import box
from tests.decals.shapes import Shape, View, torus
from tests.oracles.pixels import middle_rays
from tests.oracles.raster import cast, edges

SIZE = (80, 60)


def look(shapes: tuple[Shape, ...]) -> View:
    points = np.concatenate([shape.vertices for shape in shapes])
    camera = Camera.framing((points.min(0), points.max(0)), direction=(0.5, -0.9, 0.8), up=(0, 0, 1))
    return View(shapes, camera)


def oracle(camera: Camera, shapes: tuple[Shape, ...], size: tuple[int, int]) -> list[np.ndarray]:
    """Position, smooth normal and object of every pixel, row 0 at the top."""
    width, height = size
    origin, directions = middle_rays(camera, size)
    nearest = np.full(len(directions), np.inf)
    normal, object_id = np.zeros((len(directions), 3)), np.full(len(directions), -1)
    for number, shape in enumerate(shapes):
        t, face, weights = cast(shape.vertices, shape.faces, origin, directions)
        closer = t < nearest
        corners = vertex_normals(shape.vertices, shape.faces)[shape.faces[face[closer]]].astype(np.float64)
        smooth = np.einsum("nk,nki->ni", weights[closer], corners)
        normal[closer] = smooth / np.linalg.norm(smooth, axis=1, keepdims=True)
        nearest[closer], object_id[closer] = t[closer], number
    with np.errstate(invalid="ignore"):
        position = np.where(np.isfinite(nearest)[:, None], origin + nearest[:, None] * directions, 0)
    nearest[np.isinf(nearest)] = 0
    return [
        array.reshape(height, width, *array.shape[1:]) for array in (position, normal, object_id, nearest)
    ]


@pytest.mark.slow_cases("0.001")
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_two_meshes_against_rays(renderer: Renderer, scale: float) -> None:
    pair = torus(), torus(0.8, 0.3, shift=(0.7, 0, 0.5))
    shapes = tuple(Shape(shape.vertices * np.float32(scale), shape.faces) for shape in pair)
    view = look(shapes)
    buffers = renderer.buffers(view, RenderOptions(size=SIZE))
    position, normal, object_id, depth = oracle(view.camera, shapes, SIZE)
    sure = ~edges(object_id) & ~(np.hypot(*np.gradient(depth)) > 0.05 * scale)
    assert sure.mean() > 0.7
    assert set(np.unique(buffers.object_id[sure])) == {-1, 0, 1}
    np.testing.assert_array_equal(buffers.object_id[sure], object_id[sure])
    # a rasteriser snaps vertices to 1/256 of a pixel: a pixel is 0.04 wide here, and more at grazing angles
    np.testing.assert_allclose(buffers.position[sure], position[sure], atol=5e-4 * scale)
    assert np.abs(buffers.position[sure] - position[sure]).mean() < 2e-5 * scale
    np.testing.assert_allclose(buffers.normal[sure], normal[sure], atol=5e-3)
    assert (buffers.owner == -1).all()


def test_background_is_empty(renderer: Renderer) -> None:
    buffers = renderer.buffers(look((torus(),)), RenderOptions(size=SIZE))
    outside = buffers.object_id == -1
    assert outside.any()
    for array in (buffers.position, buffers.normal, buffers.field, buffers.uv):
        assert array.dtype == np.float32
        assert (array[outside] == 0).all()


def test_no_objects_at_all(renderer: Renderer) -> None:
    buffers = renderer.buffers(View((), Camera((0, 0, 5))), RenderOptions(size=(8, 8)))
    assert (buffers.object_id == -1).all()


def test_the_top_row_is_the_top(renderer: Renderer) -> None:
    triangle = Shape(
        np.array([[-1, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), np.array([[0, 1, 2]], np.int32)
    )
    buffers = renderer.buffers(View((triangle,), Camera((0, 0, 5), fov=45)), RenderOptions(size=(40, 40)))
    rows, columns = np.nonzero(buffers.object_id == 0)
    assert rows.max() < 21
    assert buffers.position[rows.min(), columns[rows.argmin()], 1] > 0.8
    assert buffers.position[rows.max(), columns.min(), 0] < -0.8


def test_both_sides_of_an_open_mesh_show_the_outward_normal(renderer: Renderer) -> None:
    triangle = Shape(
        np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32), np.array([[0, 1, 2]], np.int32)
    )
    for z in (4, -4):
        buffers = renderer.buffers(View((triangle,), Camera((0, 0, z))), RenderOptions(size=(16, 16)))
        seen = buffers.object_id == 0
        assert seen.any()
        np.testing.assert_allclose(
            buffers.normal[seen], np.broadcast_to([0, 0, 1], (seen.sum(), 3)), atol=1e-6
        )


def test_unknown_kinds_of_objects_are_refused(renderer: Renderer) -> None:
    with pytest.raises(InvalidScene, match=r"cannot draw a str; expected a MeshObject"):
        renderer.render(View(("mesh",), Camera((0, 0, 5))), RenderOptions(size=(4, 4)))


def test_vertex_normals_are_weighted_by_area() -> None:
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 1], [5, 5, 5]], np.float32)
    normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    expected = np.array([2, 0, 4.0]) / np.linalg.norm([2, 0, 4])
    np.testing.assert_allclose(normals[0], expected, atol=1e-6)
    np.testing.assert_allclose(normals[[1, 3, 4]], [[0, 0, 1], [1, 0, 0], [0, 0, 1]], atol=1e-6)


def test_both_sides_are_lit(renderer: Renderer) -> None:
    """A sheet is as bright from behind as from the front; so is a model whose faces wind the wrong way."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2]], np.int32)
    pixels = [
        renderer.render(View((Shape(corners, order),), Camera((0, 0, z))), RenderOptions(size=(16, 16)))[8, 8]
        for order in (faces, faces[:, ::-1])
        for z in (4, -4)
    ]
    assert (np.ptp(np.array(pixels, int), axis=0) <= 1).all()
    assert pixels[0][0] > 100


def test_silhouettes_are_not_speckled(drawer: Renderer) -> None:
    """Smooth normals of a coarse mesh look away from the eye at its edge: no pixel there may go dark."""
    shape = replace(torus(1, 0.4, 10, 5), crease_angle=180.0)
    view = look((shape,))
    buffers = drawer.buffers(view, RenderOptions(size=SIZE))
    toward = np.array(view.camera.position) - buffers.position
    toward /= np.linalg.norm(toward, axis=-1, keepdims=True)
    away = (buffers.object_id == 0) & (np.einsum("hwi,hwi->hw", buffers.normal, toward) < -0.02)
    upper = away & (buffers.normal @ view.camera.axes[1] > 0.5)
    assert upper.sum() > 3
    assert buffers.color[upper][:, :3].min() > 100


def test_a_cube_shows_the_normals_of_its_faces(renderer: Renderer) -> None:
    cube = box()
    view = look((Shape(cube.vertices, cube.faces),))
    buffers = renderer.buffers(view, RenderOptions(size=SIZE))
    seen = buffers.object_id == 0
    assert seen.sum() > 500
    np.testing.assert_allclose(np.abs(buffers.normal[seen]).max(axis=1), 1.0, atol=1e-6)


def test_no_pixel_is_bare_where_boxes_abut(renderer: Renderer) -> None:
    """Smoothed normals near the edges looked away from decals that lie across the seam."""
    boxes = [box(center=(x, 0, 0)) for x in (-0.5, 0.5)]
    shapes = tuple(Shape(part.vertices, part.faces) for part in boxes)
    decals = scatter(boxes, count=60, seed=3)
    camera = Camera.framing(([-1, -0.5, -0.5], [1, 0.5, 0.5]), direction=(0.1, -0.3, 1), up=(0, 1, 0))
    buffers = renderer.buffers(View(shapes, camera, decals), RenderOptions(size=(160, 120)))
    top = np.abs(buffers.position[..., 2] - 0.5) < 1e-4
    assert (buffers.object_id[top] >= 0).sum() > 5000
    assert (buffers.owner[top] >= 0).all()
