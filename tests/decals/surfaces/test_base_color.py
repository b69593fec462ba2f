"""`BaseColor`: its checks, and the colours of pyvista's, trimesh's and our own meshes on their way in."""

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from numpy.typing import NDArray
from PIL import Image

import blobtree
import decals
from decals import MeshObject
from decals.errors import InvalidMesh
from decals.scenes.objects import as_object, displaced
from decals.scenes.script import write_script
from decals.surfaces import BaseColor, BaseTexture, Wrap, linear_colors
from decals.surfaces.base_color import CLAY
from tests.oracles.base_color import base_light, linear

TRIANGLE: dict[str, Any] = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}


def bytes_of(*shape: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8)


def colors_of(color: BaseColor) -> NDArray[np.float32]:
    assert color.colors is not None
    return color.colors


def color_of(model: object, **options: Any) -> BaseColor:
    item = as_object(model, "model", **options)
    assert isinstance(item, MeshObject)
    assert isinstance(item.color, BaseColor)
    return item.color


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "expected colours or texture coordinates, got neither"),
        ({"colors": [[0, 0]]}, r"expected shape \[n, 3\]"),
        ({"colors": [[0, 0, np.nan]]}, "expected finite numbers"),
        ({"colors": [[0, 0, 2]]}, "expected numbers from 0 to 1"),
        ({"colors": [["red"]]}, "expected numbers in rows of 3"),
        ({"colors": [[0, 0, 0]], "coordinates": [[0, 0], [1, 1]]}, "as many colours as coordinates"),
        ({"colors": [[0, 0, 0]], "corners": [[0, 0, 1]]}, "expected indices from 0 to 0, got 1"),
        ({"colors": [[0, 0, 0]], "corners": [0, 0, 0]}, r"expected shape \[m, 3\]"),
        ({"colors": [[0, 0, 0]], "corners": [[0.5, 0, 0]]}, "expected integers"),
        ({"colors": [[0, 0, 0]], "textures": [BaseTexture(bytes_of(2, 2, 3))]}, "texture coordinates"),
        ({"coordinates": [[0, 0]], "texture_of_face": [0]}, "expected indices from -1 to -1, got 0"),
    ],
)
def test_arrays_that_are_no_colours_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidMesh, match=message):
        BaseColor(**options)


@pytest.mark.parametrize("color", [BaseColor([[0, 0, 1]] * 4), BaseColor.of_faces([[0, 0, 1]] * 2)])
def test_colours_of_another_mesh_are_refused(color: BaseColor) -> None:
    with pytest.raises(InvalidMesh, match="expected one for each"):
        MeshObject("a", **TRIANGLE, color=color)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((3, 2), np.uint8), "expected shape"),
        (np.full((3, 3), np.nan), "finite"),
        (np.full((3, 3), 255.0), "from 0 to 1"),
        (np.zeros((3, 3), np.int64), "bytes or floats"),
        (np.zeros((3, 3), np.bool_), "bytes or floats"),
    ],
)
def test_srgb_that_is_none_is_refused(values: NDArray[Any], message: str) -> None:
    with pytest.raises(InvalidMesh, match=message):
        linear_colors(values)


def test_colours_of_a_model_that_cannot_be_used_are_left_out_with_a_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    mesh = pv.Sphere()
    mesh["RGB"] = np.full((mesh.n_points, 3), np.nan)
    with caplog.at_level(logging.WARNING):
        item = as_object(mesh, "ball")
    assert isinstance(item, MeshObject)
    assert item.color == CLAY
    assert "Left out the colours of ball: ball, array 'RGB': expected finite numbers" in caplog.text


def test_arrays_that_are_no_colours_are_none() -> None:
    mesh = pv.Sphere().compute_normals()
    mesh["velocity"] = np.random.default_rng(0).random((mesh.n_points, 3))
    mesh.set_active_scalars("velocity")
    item = as_object(mesh, "ball")
    assert isinstance(item, MeshObject)
    assert item.color == CLAY


@pytest.mark.parametrize("name", ["RGB", "rgba", "VertexColors", "COLOR_0", "my colour", "data_rgba"])
def test_floats_are_colours_by_their_names(name: str) -> None:
    mesh = pv.Sphere()
    mesh["pressure"] = mesh.points[:, 0]  # the active scalars
    values = np.random.default_rng(0).random((mesh.n_points, 4))
    mesh.point_data.set_array(values, name)
    assert np.allclose(colors_of(color_of(mesh)), linear(values[:, :3]), atol=1e-6)


def test_an_explicit_colour_wins() -> None:
    mesh = pv.Sphere()
    mesh["RGB"] = bytes_of(mesh.n_points, 3)
    item = as_object(mesh, "ball", color=(1.0, 0.0, 0.0))
    assert isinstance(item, MeshObject)
    assert item.color == (1.0, 0.0, 0.0)
    assert MeshObject("b", **TRIANGLE, color=BaseColor([[0, 0, 1]] * 3)).color is not CLAY


def test_polygons_strips_and_volumes_keep_the_colours_of_their_faces() -> None:
    cube: Any = pv.Cube()
    cube.cell_data["colors"] = bytes_of(6, 4)
    light = linear(np.asarray(cube.cell_data["colors"])[:, :3])
    for model in (cube, cube.cast_to_unstructured_grid(), pv.MultiBlock([cube])):
        color = color_of(model)
        assert color.corners is not None
        assert color.colors is not None
        assert np.allclose(color.colors[color.corners[:, 0]], np.repeat(light, 2, axis=0), atol=1e-6)


def test_blocks_without_colours_become_clay() -> None:
    first, second = pv.Cube(), pv.Sphere()
    first["RGBA"] = bytes_of(first.n_points, 4)
    color = color_of(pv.MultiBlock([first, second]))
    assert color.colors is not None
    assert np.allclose(color.colors[-1], linear(np.array(CLAY)), atol=1e-6)
    assert np.allclose(color.colors[: first.n_points], linear(first["RGBA"][:, :3]), atol=1e-6)


def test_a_texture_of_pyvista_keeps_its_wrap_mode_and_needs_coordinates() -> None:
    texture: Any = pv.Texture(bytes_of(4, 4, 3))  # type: ignore[no-untyped-call]
    texture.wrap = pv.Texture.WrapType.MIRRORED_REPEAT
    color = color_of(pv.Plane(), texture=texture)
    assert color.textures[0].wrap == (Wrap.MIRROR, Wrap.MIRROR)
    assert np.array_equal(color.textures[0].pixels, bytes_of(4, 4, 3))
    with pytest.raises(InvalidMesh, match="texture coordinates"):
        as_object((TRIANGLE["vertices"], TRIANGLE["faces"]), "a", texture=texture)


def test_colours_of_trimesh() -> None:
    mesh: Any = trimesh.creation.icosphere(1)
    assert isinstance(as_object(mesh, "a"), MeshObject)
    mesh.visual.vertex_colors = bytes_of(len(mesh.vertices), 4)
    by_vertex = color_of(mesh)
    assert np.allclose(colors_of(by_vertex), linear(bytes_of(len(mesh.vertices), 4)[:, :3]), atol=1e-6)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=bytes_of(len(mesh.faces), 4))
    by_face = color_of(mesh)
    assert by_face.corners is not None
    assert np.allclose(colors_of(by_face), linear(bytes_of(len(mesh.faces), 4)[:, :3]), atol=1e-6)


def test_textures_and_factors_of_trimesh_in_a_scene() -> None:
    rng = np.random.default_rng(3)
    box: Any = trimesh.creation.box()
    image, uv, factor = bytes_of(6, 5, 3), rng.random((8, 2)), np.array([51, 102, 255, 255], np.uint8)
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(image), baseColorFactor=factor
    )
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    plain: Any = trimesh.creation.icosphere(1)
    scene = trimesh.Scene([plain, box])
    item = as_object(scene, "scene")
    assert isinstance(item, MeshObject)
    assert isinstance(item.color, BaseColor)
    faces, weights = rng.integers(0, 12, 40), rng.dirichlet([1, 1, 1], 40)
    corners = np.asarray(box.faces)[faces]
    shades = np.broadcast_to(factor[:3] / 255.0, (40, 3, 3))
    right = base_light(weights, shades, uv[corners], [image] * 40)
    found = item.color.light_at(item.faces, faces + len(plain.faces), weights)
    assert np.abs(found - right).max() < 1e-5
    assert np.allclose(item.color.light_at(item.faces, [0], [[1, 0, 0]]), linear(np.array(CLAY)), atol=1e-6)


def test_a_polygonized_tree_keeps_its_colours() -> None:
    tree = blobtree.Point((0, 0, 0), radius=1, color="red") | blobtree.Point(
        (1, 0, 0), radius=1, color="blue"
    )
    mesh = blobtree.polygonize(tree, resolution=12)
    assert np.allclose(colors_of(color_of(mesh)), linear(mesh.colors), atol=1e-6)


def test_faces_that_are_turned_keep_their_colours() -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    faces = np.array([[0, 1, 2], [0, 3, 2]])  # the second winds differently
    colors = np.random.default_rng(0).random((6, 3))
    item = MeshObject("a", vertices, faces, BaseColor(colors, corners=np.arange(6).reshape(2, 3)))
    assert isinstance(item.color, BaseColor)
    assert not np.array_equal(item.faces, faces)
    for face in range(2):
        for vertex in faces[face]:
            weights = (item.faces[face] == vertex).astype(float)
            right = colors.astype(np.float32)[3 * face + list(faces[face]).index(vertex)]
            assert np.allclose(item.color.light_at(item.faces, [face], [weights])[0], right)


def same(first: BaseColor, second: BaseColor) -> bool:
    names = ("colors", "coordinates", "texture_of_face", "corners")
    pairs = [(getattr(first, name), getattr(second, name)) for name in names]
    pairs += [(a.pixels, b.pixels) for a, b in zip(first.textures, second.textures, strict=True)]
    return [texture.wrap for texture in first.textures] == [
        texture.wrap for texture in second.textures
    ] and all((a is None and b is None) or np.array_equal(a, b) for a, b in pairs)


def textured() -> MeshObject:
    sheet = pv.Plane(i_resolution=2, j_resolution=2).triangulate()
    textures = [BaseTexture(bytes_of(3, 4, 3)), BaseTexture(bytes_of(2, 2, 3), ("mirror", "clamp"))]
    base = BaseColor.of_materials(
        np.random.default_rng(0).random((2, 3)),
        textures,
        np.arange(sheet.n_cells, dtype=np.int32) % 2,
        sheet.regular_faces.astype(np.int32),
        coordinates=np.asarray(sheet.active_texture_coordinates),
    )
    return MeshObject("sheet", sheet.points, sheet.regular_faces, base)


def test_scene_files_and_scripts_keep_colours_and_textures(tmp_path: Path) -> None:
    import runpy

    item = textured()
    assert isinstance(item.color, BaseColor)
    scene = decals.Scene(objects=(item,), camera=decals.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 30))
    decals.save_scene(scene, tmp_path / "scene.json")
    write_script(scene, tmp_path / "scene.py")
    loaded = decals.load_scene(tmp_path / "scene.json")
    rebuilt = runpy.run_path(str(tmp_path / "scene.py"))["scene"]
    for other in (loaded.objects[0], rebuilt.objects[0], displaced(item, (1, 0, 0), "moved")):
        assert isinstance(other, MeshObject)
        assert isinstance(other.color, BaseColor)
        assert same(other.color, item.color)


def test_a_scene_file_names_the_source_of_colours(tmp_path: Path) -> None:
    mesh = pv.Sphere(theta_resolution=8, phi_resolution=8)
    mesh["RGB"] = bytes_of(mesh.n_points, 3)
    mesh.save(tmp_path / "ball.vtp")
    item = as_object(tmp_path / "ball.vtp", "ball")
    assert isinstance(item, MeshObject)
    assert isinstance(item.color, BaseColor)
    assert np.allclose(colors_of(item.color), linear(bytes_of(mesh.n_points, 3)), atol=1e-6)
    scene = decals.Scene(objects=(item,), camera=decals.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 30))
    decals.save_scene(scene, tmp_path / "scene.json")
    text = (tmp_path / "scene.json").read_text()
    assert '"color":"source"' in text
    loaded = decals.load_scene(tmp_path / "scene.json").objects[0]
    assert isinstance(loaded, MeshObject)
    assert isinstance(loaded.color, BaseColor)
    assert same(loaded.color, item.color)


def test_a_scene_file_reads_no_other_file_as_a_texture(tmp_path: Path) -> None:
    item = textured()
    scene = decals.Scene(objects=(item,), camera=decals.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 30))
    decals.save_scene(scene, tmp_path / "scene.json")
    text = (tmp_path / "scene.json").read_text()
    start = text.index('"pixels":"') + len('"pixels":"')
    end = text.index('"', start)
    (tmp_path / "other.json").write_text(text[:start] + "/etc/hostname" + text[end:])
    with pytest.raises(decals.errors.InvalidScene, match="expected embedded pictures"):
        decals.load_scene(tmp_path / "other.json")


def test_textures_of_a_scene_file_have_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = decals.Scene(objects=(textured(),), camera=decals.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 30))
    decals.save_scene(scene, tmp_path / "scene.json")
    monkeypatch.setattr("decals.scenes.records.MAX_TEXELS", 13)
    with pytest.raises(decals.errors.InvalidScene, match="textures of 13 pixels at most"):
        decals.load_scene(tmp_path / "scene.json")
