"""Base colours of meshes in pictures, baked files and exports, against float64 in linear light."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from numpy.typing import NDArray

import decals
from blobtree.pyvista_views import write_polydata
from decals import MeshObject, displace
from decals.rendering import Context, Lighting, Renderer, RenderOptions
from decals.scenes.meshes import as_polydata
from decals.scenes.objects import as_object
from decals.surfaces import BaseColor, BaseTexture, Wrap
from tests.oracles.base_color import base_light, linear
from tests.oracles.pixels import middle_rays
from tests.oracles.raster import cast, edges

SIZE = (64, 48)
WRAPS = [mode.value for mode in Wrap]


def grid(seed: int, cells: int = 3) -> Any:
    """Return an uneven sheet of triangles whose texture coordinates leave [0, 1]."""
    rng = np.random.default_rng(seed)
    sheet = pv.Plane(i_resolution=cells, j_resolution=cells).triangulate()
    sheet.points += rng.normal(0.0, 0.04, sheet.points.shape).astype(np.float32)
    places = 1.6 * sheet.points[:, :2] + rng.uniform(0.2, 0.5, (sheet.n_points, 2))
    sheet.active_texture_coordinates = places.astype(np.float32)
    return sheet


def camera() -> decals.Camera:
    return decals.Camera((0.3, -0.4, 1.6), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 42.0)


def picture(item: Any, backend: str = "fragment") -> NDArray[np.float64]:
    """Return the unlit picture of an object in linear light."""
    scene = decals.Scene(objects=(item,), camera=camera())
    with Context.standalone(backend=backend) as context, Renderer(context) as renderer:
        shown = renderer.render(scene, RenderOptions(SIZE, samples=1, lights=Lighting(())))
    return linear(shown[..., :3])


def assert_picture(
    item: MeshObject, light_of: Callable[[NDArray[np.int64], NDArray[np.float64]], NDArray[np.float64]]
) -> None:
    """Compare the picture of a mesh with a function of faces and barycentric weights."""
    width, height = SIZE
    _, face, weights = cast(item.vertices, item.faces, *middle_rays(camera(), SIZE))
    seen = (face >= 0) & ~edges(face.reshape(height, width)).reshape(-1)
    assert seen.sum() > 300
    right = light_of(face[seen], weights[seen])
    for backend in ("fragment", "compute"):
        drawn = picture(item, backend).reshape(-1, 3)[seen]
        errors = np.abs(255.0 * (encoded(drawn) - encoded(right)))
        assert errors.max() < 2.0, errors.max()  # of 255: bytes, half floats, and weights of eight bits


def encoded(light: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def colors_of(count: int, kind: str, channels: int, seed: int) -> NDArray[Any]:
    values = np.random.default_rng(seed).random((count, channels))
    return (255.0 * values).astype(np.uint8) if kind == "uint8" else values.astype(kind)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("kind", ["uint8", "float32", "float64"])
@pytest.mark.parametrize("per", ["points", "cells"])
def test_colours_of_a_dataset_are_interpolated_in_linear_light(per: str, kind: str, channels: int) -> None:
    sheet = grid(channels)
    data = sheet.point_data if per == "points" else sheet.cell_data
    values = colors_of(sheet.n_points if per == "points" else sheet.n_cells, kind, channels, 5)
    data["vertex_colors"] = values
    item = as_object(sheet, "sheet")
    assert isinstance(item, MeshObject)
    light = linear(values[:, :3])

    def right(face: NDArray[np.int64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        corners = light[item.faces[face]] if per == "points" else np.repeat(light[face][:, None], 3, axis=1)
        return base_light(weights, corners)

    assert_picture(item, right)


@pytest.mark.parametrize("u_mode", WRAPS)
@pytest.mark.parametrize("v_mode", WRAPS)
def test_textures_are_bilinear_and_wrapped(u_mode: str, v_mode: str) -> None:
    sheet = grid(11)
    image = colors_of(3 * 5, "uint8", 3, 2).reshape(3, 5, 3)
    item = as_object(sheet, "sheet", texture=BaseTexture(image, (u_mode, v_mode)))
    assert isinstance(item, MeshObject)
    places = np.asarray(sheet.active_texture_coordinates, np.float64)

    def right(face: NDArray[np.int64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        corners = places[item.faces[face]]
        whites = np.ones((len(face), 3, 3))
        return base_light(weights, whites, corners, [image] * len(face), (u_mode, v_mode))

    assert_picture(item, right)


def test_faces_have_textures_factors_and_colours_of_their_materials() -> None:
    sheet = grid(3)
    rng = np.random.default_rng(1)
    images = [colors_of(16, "uint8", 3, seed).reshape(4, 4, 3) for seed in (1, 2)]
    factors = rng.random((3, 3))
    material = rng.integers(0, 3, sheet.n_cells).astype(np.int32)
    faces = sheet.regular_faces.astype(np.int32)
    places = np.asarray(sheet.active_texture_coordinates)
    colors = rng.random((sheet.n_points, 3)).astype(np.float32)
    base = BaseColor.of_materials(
        factors, [*map(BaseTexture, images), None], material, faces, coordinates=places, colors=colors
    )
    item = MeshObject("sheet", sheet.points, faces, base)
    pictures = [*images, None]

    def right(face: NDArray[np.int64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        corners = colors[faces[face]] * factors[material[face]][:, None]
        shown = [pictures[material[one]] for one in face]
        return base_light(weights, corners, places[faces[face]].astype(np.float64), shown)

    assert_picture(item, right)
    numbers = rng.integers(0, len(faces), 50)
    weights = rng.dirichlet([1, 1, 1], 50)
    assert np.abs(base.light_at(faces, numbers, weights) - right(numbers, weights)).max() < 1e-6


def test_a_mesh_of_one_colour_is_drawn_as_before() -> None:
    sheet = grid(4)
    plain = MeshObject("sheet", sheet.points, sheet.regular_faces, "tomato")
    sheet["RGB"] = np.tile(np.array([255, 99, 71], np.uint8), (sheet.n_points, 1))
    item = as_object(sheet, "sheet")
    assert isinstance(item, MeshObject)
    assert item.color == pytest.approx(plain.color, abs=1e-6)
    assert np.array_equal(picture(item), picture(plain))


def test_a_posed_mesh_keeps_its_colours() -> None:
    sheet = grid(6)
    sheet.cell_data["rgb"] = colors_of(sheet.n_cells, "uint8", 3, 9)
    item = as_object(sheet, "sheet")
    assert isinstance(item, MeshObject)
    scene = decals.Scene(objects=(item,), camera=camera())
    moved = item.vertices + np.float32(0.05) * item.vertices[:, ::-1]
    posed = decals.pose(scene, {"sheet": moved})
    shown = decals.render(posed, size=SIZE, samples=1, lights=Lighting(()))
    twin = MeshObject("sheet", moved, item.faces, item.color)
    right = decals.render(scene.replace(objects=(twin,)), size=SIZE, samples=1, lights=Lighting(()))
    assert np.array_equal(np.asarray(shown), np.asarray(right))


def ball() -> MeshObject:
    """Return a sphere with colours by corner and two textures."""
    mesh: Any = trimesh.creation.icosphere(2)
    rng = np.random.default_rng(0)
    images = [BaseTexture(colors_of(64, "uint8", 3, seed).reshape(8, 8, 3)) for seed in (1, 2)]
    places = np.asarray(mesh.vertices, np.float32)[:, :2] * np.float32(0.5)
    of_face = (np.arange(len(mesh.faces)) % 2).astype(np.int32)
    base = BaseColor.of_materials(
        rng.random((2, 3)), images, of_face, np.asarray(mesh.faces, np.int32), coordinates=places
    )
    return MeshObject("ball", mesh.vertices, mesh.faces, base)


@pytest.mark.slow_cases("False")
@pytest.mark.parametrize("vertex_colors", [True, False])
def test_a_baked_file_has_the_base_colours(vertex_colors: bool, tmp_path: Path) -> None:
    item = ball()
    decals.bake(item, tmp_path / "ball.glb", size=512, samples=1, vertex_colors=vertex_colors)
    read: Any = next(iter(trimesh.load(tmp_path / "ball.glb").geometry.values()))
    middles = np.asarray(read.triangles).mean(axis=1)
    found, weights = item.surface.locate(middles)
    assert isinstance(item.color, BaseColor)
    right = encoded(item.color.light_at(item.faces, found, weights))
    if vertex_colors:
        corners = np.asarray(read.visual.vertex_attributes["color"])[read.faces][..., :3]  # linear
        found, weights = np.repeat(found, 3), np.tile(np.eye(3), (len(found), 1))
        at = item.vertices[item.faces[found[::3]]]
        order = np.linalg.norm(read.triangles[:, :, None] - at[:, None], axis=3).argmin(axis=2).reshape(-1)
        light = item.color.light_at(item.faces, found, np.eye(3)[order])
        assert np.abs(corners.reshape(-1, 3) - light).max() < 1.5 / 255.0
    else:
        baked = BaseTexture(read.visual.material.baseColorTexture)
        places = np.asarray(read.visual.uv)[read.faces].mean(axis=1)
        assert np.abs(encoded(baked.light_at(places)) - right).max() < 8.0 / 255.0


def test_exports_have_the_colours_at_vertices(tmp_path: Path) -> None:
    item = ball()
    mesh = as_polydata([item])
    write_polydata(tmp_path / "ball.ply", mesh)
    read: Any = pv.read(tmp_path / "ball.ply")
    assert isinstance(item.color, BaseColor)
    faces, _ = item.surface.locate(mesh.points[mesh.regular_faces].mean(axis=1))
    order = np.linalg.norm(
        mesh.points[mesh.regular_faces][:, :, None] - item.vertices[item.faces[faces]][:, None], axis=3
    ).argmin(axis=2)
    right = encoded(item.color.light_at(item.faces, np.repeat(faces, 3), np.eye(3)[order.reshape(-1)]))
    for found in (mesh, read):
        shown = np.asarray(found["RGB"])[found.regular_faces].reshape(-1, 3) / 255.0
        assert np.abs(shown - right).max() < 1.5 / 255.0


def test_relief_carries_the_base_colours() -> None:
    item = ball()
    heights = np.ones((8, 8), np.float32)
    image = decals.DecalMaterial("bump", np.full((8, 8, 4), 255, np.uint8), height=heights, relief=0.2)
    marks = decals.Decals(positions=[[0, 0, 1]], normals=[[0, 0, 1]], tangents=[[1, 0, 0]], radii=[0.4])
    scene = decals.Scene(objects=(item,), camera=camera(), decals=marks, images=(image,))
    moved: Any = displace(scene).objects[0]
    rest = moved.rest
    numbers = np.arange(len(rest.faces))
    weights = np.full((len(numbers), 3), 1.0 / 3.0)
    found, places = item.surface.locate(rest.vertices[rest.faces].astype(np.float64).mean(axis=1))
    assert len(numbers) > len(item.faces)
    assert isinstance(item.color, BaseColor)
    shown = rest.color.light_at(rest.faces, numbers, weights)
    assert np.abs(shown - item.color.light_at(item.faces, found, places)).max() < 1e-3


def test_a_subplot_shows_textures_and_colours() -> None:
    """Lit alike, a texture of one colour looks as that colour does; its halves look as two colours do."""
    red_blue = np.zeros((2, 2, 3), np.uint8)
    red_blue[:, 0], red_blue[:, 1] = (255, 0, 0), (0, 0, 255)

    def shown(**options: Any) -> NDArray[np.int64]:
        plotter = pv.Plotter(off_screen=True, window_size=[80, 60])
        plotter.decals.add_mesh(pv.Plane(i_size=2, j_size=2), **options)
        plotter.view_xy()  # type: ignore[call-arg]
        pixels = np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(np.int64)
        plotter.close()
        return pixels

    left, right = shown(color=(1.0, 0.0, 0.0)), shown(color=(0.0, 0.0, 1.0))
    halves = shown(texture=BaseTexture(red_blue, "clamp"))
    assert np.abs(halves[30, 25] - left[30, 25]).max() <= 1
    assert np.abs(halves[30, 55] - right[30, 55]).max() <= 1
    assert np.abs(left[30, 25] - right[30, 25]).max() > 50
