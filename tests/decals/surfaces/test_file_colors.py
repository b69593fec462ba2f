"""Colours and textures of OBJ and PLY files that a generator writes, against what it knows."""

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from numpy.typing import NDArray
from PIL import Image

from decals import MeshObject
from decals.images.texels import decode_srgb
from decals.scenes.objects import as_object
from decals.surfaces import BaseColor, Wrap
from decals.surfaces.base_color import CLAY
from decals.surfaces.mesh_file import read_mesh_data
from tests.oracles.base_color import base_light, linear

COUNT = 30
"""Points at which each case is compared."""


def polygons(seed: int) -> tuple[NDArray[np.float64], list[list[int]]]:
    """Return a sheet of convex polygons of three to six corners, in a row that shares its vertices."""
    rng = np.random.default_rng(seed)
    points = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    faces = []
    for column in range(1, 7):
        low, high = len(points) - 2, len(points) - 1
        extra = int(rng.integers(0, 3))
        start = len(points)
        points += [[column - 0.5, -0.2 - 0.1 * i, 0.0] for i in range(min(extra, 1))]
        points += [[float(column), 0.0, 0.0], [float(column), 1.0, 0.0]]
        faces.append([low, *range(start, len(points)), high])
    return np.array(points), faces


def bytes_of(*shape: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8)


def read(path: Path) -> MeshObject:
    item = as_object(path, "file")
    assert isinstance(item, MeshObject)
    return item


def points_on(item: MeshObject, seed: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    return rng.integers(0, len(item.faces), COUNT), rng.dirichlet([1, 1, 1], COUNT)


def polygon_of(item: MeshObject, faces: list[list[int]], face: int) -> int:
    """Return the polygon that has all corners of a triangle."""
    return next(i for i, one in enumerate(faces) if set(item.faces[face].tolist()) <= set(one))


def light_of(item: MeshObject, numbers: Any, weights: Any) -> NDArray[np.float64]:
    assert isinstance(item.color, BaseColor)
    return item.color.light_at(item.faces, numbers, weights)


def write_obj(path: Path, seed: int) -> dict[str, Any]:
    """Write an OBJ file with materials, and return what its generator knows."""
    rng = np.random.default_rng(seed)
    points, faces = polygons(seed)
    images = [bytes_of(4, 5, 3, seed=seed), bytes_of(3, 3, 3, seed=seed + 1)]
    for number, image in enumerate(images):
        Image.fromarray(image).save(path.with_name(f"map {number}.png"))
    shades = rng.random((3, 3)).round(3)
    path.with_name("some materials.mtl").write_text(
        "# materials\n"
        f"newmtl plain\nKd {' '.join(map(str, shades[0]))}\n"
        f"newmtl mapped\nKd {' '.join(map(str, shades[1]))}\nmap_Kd -s 1 1 1 -bm 0.5 map 0.png\n"
        "newmtl clamped\nKd 0 0 0\n\tmap_Kd  -clamp on map 1.png\n"
    )
    places = rng.uniform(-0.5, 1.5, (9, 2)).round(3)
    lines = ["mtllib some materials.mtl", *(f"v {x} {y} {z}" for x, y, z in points)]
    lines += [f"vt {u} {v}" for u, v in places]
    known: dict[str, Any] = {"faces": faces, "images": images, "places": [], "materials": []}
    known["shades"] = {"plain": shades[0], "mapped": shades[1], "clamped": np.ones(3), None: np.array(CLAY)}
    for number, face in enumerate(faces):
        name = None if number == 0 else ["plain", "mapped", "clamped"][int(rng.integers(0, 3))]
        corners = rng.integers(0, len(places), len(face))
        has_places = rng.random() < 0.8
        lines += [f"usemtl {name}"] * (name is not None)
        lines.append(
            "f "
            + " ".join(
                f"{v + 1}/{c + 1}" if has_places else f"{v + 1}" for v, c in zip(face, corners, strict=True)
            )
        )
        known["materials"].append(name)
        known["places"].append(dict(zip(face, places[corners], strict=True)) if has_places else None)
    path.write_text("\n".join(lines) + "\n")
    return known


@pytest.mark.parametrize("seed", range(8))
def test_an_obj_file_has_the_colours_of_its_materials(seed: int, tmp_path: Path) -> None:
    known = write_obj(tmp_path / "sheet.obj", seed)
    item = read(tmp_path / "sheet.obj")
    numbers, weights = points_on(item, seed)
    found = light_of(item, numbers, weights)
    for row, (face, weight) in enumerate(zip(numbers.tolist(), weights, strict=True)):
        polygon = polygon_of(item, known["faces"], face)
        material, places = known["materials"][polygon], known["places"][polygon]
        shade = np.tile(linear(known["shades"][material]), (1, 3, 1))
        image = {"mapped": known["images"][0], "clamped": known["images"][1]}.get(material)
        if places is None or image is None:
            right = base_light(weight[None], shade)
        else:
            corners = np.array([[places[vertex] for vertex in item.faces[face].tolist()]])
            mode = "clamp" if material == "clamped" else "repeat"
            right = base_light(weight[None], shade, corners, [image], (mode, mode))
        assert np.abs(found[row] - right[0]).max() < 1e-5, (material, places)


def test_an_obj_file_has_colours_behind_its_coordinates(tmp_path: Path) -> None:
    points, faces = polygons(1)
    colors = np.random.default_rng(0).random((len(points), 3))
    text = [f"v {' '.join(map(str, [*point, *color]))}" for point, color in zip(points, colors, strict=True)]
    text += ["f " + " ".join(str(vertex + 1) for vertex in face) for face in faces]
    (tmp_path / "a.obj").write_text("\n".join(text))
    item = read(tmp_path / "a.obj")
    numbers, weights = points_on(item, 0)
    right = base_light(weights, linear(colors)[item.faces[numbers]])
    assert np.abs(light_of(item, numbers, weights) - right).max() < 1e-5


def test_vertices_of_obj_without_a_colour_cost_the_others_none(tmp_path: Path) -> None:
    text = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 1 1 0\nv 2 1 0\nv 1 2 0\nf 1 2 3\nf 4 5 6\n"
    (tmp_path / "a.obj").write_text(text)
    light = light_of(read(tmp_path / "a.obj"), [0, 1], np.full((2, 3), 1 / 3))
    right = np.stack([np.array([1.0, 0.0, 0.0]), linear(np.array(CLAY))])
    assert light == pytest.approx(right, abs=1e-6)


def test_names_of_materials_and_their_files_may_have_a_hash(tmp_path: Path) -> None:
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    uses = "usemtl Material #25\nf 1 2 3\nusemtl Material #26\nf 1 2 3\nusemtl plain # a comment\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text("mtllib a#1.mtl\nmtllib b.mtl # a comment\n" + triangle + uses)
    (tmp_path / "a#1.mtl").write_text("newmtl Material #25\nKd 1 0 0\nnewmtl Material #26\nKd 0 0 1\n")
    (tmp_path / "b.mtl").write_text("newmtl plain\nKd 0 1 0\n")
    light = light_of(read(tmp_path / "a.obj"), [0, 1, 2], np.full((3, 3), 1 / 3))
    np.testing.assert_allclose(light, [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=1e-6)


def test_a_list_of_material_files_goes_on_behind_a_backslash(tmp_path: Path) -> None:
    text = "mtllib a.mtl \\\nb.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(text)
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "b.mtl").write_text("newmtl b\nKd 0 0 1\n")
    light = light_of(read(tmp_path / "a.obj"), [0, 1], np.full((2, 3), 1 / 3))
    np.testing.assert_allclose(light, [[1, 0, 0], [0, 0, 1]], atol=1e-6)


def test_a_ply_colour_that_its_type_has_not_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    points, faces = polygons(2)
    rows = np.hstack([points.astype(object), np.full((len(points), 3), 300, object)])
    columns = ["uchar red", "uchar green", "uchar blue"]
    (tmp_path / "a.ply").write_text(ply(rows, columns, [" ".join(map(str, [len(f), *f])) for f in faces], []))
    with caplog.at_level(logging.WARNING):
        assert read_mesh_data(tmp_path / "a.ply").color is None
    assert "300" in caplog.text


def test_a_name_that_no_file_can_have_costs_no_face(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "a.obj").write_text(f"mtllib {'x' * 300}.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    with caplog.at_level(logging.WARNING):
        assert len(read(tmp_path / "a.obj").faces) == 1
    assert "is missing" in caplog.text


@pytest.mark.parametrize(
    ("texture", "message"),
    [("none.png", "is missing"), ("../sheet.png", "outside"), ("sheet.obj", "textures are left out")],
)
def test_a_texture_or_material_that_cannot_be_read_costs_no_face(
    texture: str, message: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = "mtllib a.mtl none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
    (tmp_path / "sheet.obj").write_text(text)
    (tmp_path / "a.mtl").write_text(f"newmtl a\nKd 1 0 0\nKd one\nmap_Kd {texture}\n")
    with caplog.at_level(logging.WARNING):
        item = read(tmp_path / "sheet.obj")
    assert item.color == (1.0, 0.0, 0.0)
    assert message in caplog.text
    assert "'none.mtl'" in caplog.text
    assert "line 3 of a.mtl" in caplog.text


def ply(
    points: NDArray[Any], columns: list[str], faces: list[str], face_columns: list[str], head: str = ""
) -> str:
    properties = "".join(f"property {name}\n" for name in columns)
    of_faces = "".join(f"property {name}\n" for name in face_columns)
    return (
        f"ply\nformat ascii 1.0\n{head}element vertex {len(points)}\nproperty float x\nproperty float y\n"
        f"property float z\n{properties}element face {len(faces)}\n"
        f"property list uchar int vertex_indices\n{of_faces}end_header\n"
        + "\n".join(" ".join(map(str, row)) for row in points.tolist())
        + "\n"
        + "\n".join(faces)
        + "\n"
    )


@pytest.mark.parametrize("kind", ["uchar", "ushort", "float"])
@pytest.mark.parametrize("of", ["vertices", "faces"])
def test_a_ply_file_has_colours_of_vertices_or_faces(of: str, kind: str, tmp_path: Path) -> None:
    points, faces = polygons(2)
    rng, top = np.random.default_rng(0), {"uchar": 255, "ushort": 65535, "float": 1.0}[kind]
    columns = [f"{kind} {channel}" for channel in ("red", "green", "blue", "alpha")]
    count = len(points) if of == "vertices" else len(faces)
    values = rng.random((count, 4)) if kind == "float" else rng.integers(0, int(top) + 1, (count, 4))
    lists = [" ".join(map(str, [len(face), *face])) for face in faces]
    if of == "vertices":
        rows = np.hstack([points.astype(object), values.astype(object)])
        text = ply(rows, columns, lists, [])
    else:
        lists = [f"{one} {' '.join(map(str, row.tolist()))}" for one, row in zip(lists, values, strict=True)]
        text = ply(points, [], lists, columns)
    (tmp_path / "a.ply").write_text(text)
    item = read(tmp_path / "a.ply")
    numbers, weights = points_on(item, 0)
    light = linear(np.asarray(values[:, :3] / top, np.float64))
    owners = [polygon_of(item, faces, face) for face in numbers.tolist()]
    corners = light[item.faces[numbers]] if of == "vertices" else np.repeat(light[owners][:, None], 3, axis=1)
    assert np.abs(light_of(item, numbers, weights) - base_light(weights, corners)).max() < 1e-5


@pytest.mark.parametrize("of", ["vertices", "corners"])
def test_coordinates_without_a_texture_leave_the_colours_of_ply_faces(of: str, tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    places, columns = "", ["uchar red", "uchar green", "uchar blue"]
    of_points: list[str] = []
    if of == "corners":
        places, columns = " 6 0 0 1 0 1 1", ["list uchar float texcoord", *columns]
    else:
        points, of_points = np.hstack([points, points[:, :2]]), ["float s", "float t"]
    faces = [f"3 0 1 2{places} 255 0 0", f"3 0 2 3{places} 0 0 255"]
    (tmp_path / "a.ply").write_text(ply(points, of_points, faces, columns))
    light = light_of(read(tmp_path / "a.ply"), [0, 1], np.full((2, 3), 1 / 3))
    np.testing.assert_allclose(light, [[1, 0, 0], [0, 0, 1]], atol=1e-6)


def test_a_ply_file_has_textures_at_the_corners_of_its_faces(tmp_path: Path) -> None:
    points, faces = polygons(3)
    rng = np.random.default_rng(0)
    images = [bytes_of(4, 4, 3, seed=1), bytes_of(5, 3, 3, seed=2)]
    for number, image in enumerate(images):
        Image.fromarray(image).save(tmp_path / f"image {number}.png")
    places = [rng.random((len(face), 2)).round(4) for face in faces]
    numbers_of = [int(rng.integers(-1, 2)) for _ in faces]
    lists = [
        " ".join(map(str, [len(face), *face, 2 * len(face), *of_face.reshape(-1).tolist(), number]))
        for face, of_face, number in zip(faces, places, numbers_of, strict=True)
    ]
    head = "comment TextureFile image 0.png\ncomment TextureFile image 1.png\n"
    text = ply(points, [], lists, ["list uchar float texcoord", "int texnumber"], head)
    (tmp_path / "a.ply").write_text(text)
    item = read(tmp_path / "a.ply")
    numbers, weights = points_on(item, 0)
    found = light_of(item, numbers, weights)
    for row, (face, weight) in enumerate(zip(numbers.tolist(), weights, strict=True)):
        polygon = polygon_of(item, faces, face)
        of_corner = dict(zip(faces[polygon], places[polygon], strict=True))
        corners = np.array([[of_corner[vertex] for vertex in item.faces[face].tolist()]])
        shown = None if numbers_of[polygon] < 0 else images[numbers_of[polygon]]
        right = base_light(weight[None], np.ones((1, 3, 3)), corners, [shown])
        assert np.abs(found[row] - right[0]).max() < 1e-5


def test_faces_of_a_list_without_colours_are_clay_beside_others(tmp_path: Path) -> None:
    columns = ["uchar red", "uchar green", "uchar blue"]
    text = ply(np.eye(3), [], ["3 0 1 2 255 0 0"], columns)
    second = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(text.replace("end_header\n", second) + "3 0 2 1\n")
    item = read(tmp_path / "a.ply")
    assert len(item.faces) == 2
    assert isinstance(item.color, BaseColor)
    light = item.color.light_at(item.faces, [0, 1], np.full((2, 3), 1 / 3))
    assert light == pytest.approx(np.array([[1, 0, 0], decode_srgb(np.array(CLAY))]), abs=1e-6)


def test_colours_of_a_ply_file_out_of_range_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = np.array([[0, 0, 0, 7, 0, 0], [1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0]], np.float64)
    columns = ["float red", "float green", "float blue"]
    (tmp_path / "a.ply").write_text(ply(rows, columns, ["3 0 1 2"], []))
    with caplog.at_level(logging.WARNING):
        assert read(tmp_path / "a.ply").color == CLAY
    assert "expected numbers from 0 to 1" in caplog.text


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_files_of_trimesh_have_the_colours_of_its_mesh(suffix: str, tmp_path: Path) -> None:
    box: Any = trimesh.creation.box()
    image = Image.fromarray(bytes_of(6, 5, 3))
    uv = np.random.default_rng(1).random((8, 2))
    material = trimesh.visual.material.SimpleMaterial(image=image, diffuse=(255, 255, 255, 255))
    box.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    if suffix == ".ply":
        box.visual = trimesh.visual.ColorVisuals(box, vertex_colors=bytes_of(8, 4))
    box.export(tmp_path / f"box{suffix}")
    item, right = read(tmp_path / f"box{suffix}"), as_object(box, "box")
    assert isinstance(right, MeshObject)
    assert isinstance(item.color, BaseColor)
    assert all(texture.wrap == (Wrap.REPEAT, Wrap.REPEAT) for texture in item.color.textures)
    numbers, weights = points_on(right, 2)
    places = np.einsum("nc,nci->ni", weights, right.vertices[right.faces[numbers]].astype(np.float64))
    found, own = item.surface.locate(places)
    assert np.abs(light_of(item, found, own) - light_of(right, numbers, weights)).max() < 1e-3


@pytest.mark.parametrize("kind", ["obj", "vertices of ply", "corners of ply", "pyvista", "trimesh"])
def test_coordinates_beyond_float32_cost_no_face(
    kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Left out with a word in the log, without a warning of NumPy."""
    suffix = kind.rpartition(" ")[2]
    path, huge = tmp_path / f"a.{suffix}", [[0.0, 1e300], [1.0, 0.0], [0.0, 1.0]]
    model: Any = path
    if kind == "obj":
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1e300\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    elif kind == "vertices of ply":
        path.write_text(ply(np.hstack([np.eye(3), huge]), ["double s", "double t"], ["3 0 1 2"], []))
    elif kind == "corners of ply":
        path.write_text(ply(np.eye(3), [], ["3 0 1 2 6 0 1e300 1 0 0 1"], ["list uchar double texcoord"]))
    elif kind == "trimesh":
        model = trimesh.Trimesh(
            np.eye(3), [[0, 1, 2]], process=False, visual=trimesh.visual.TextureVisuals(uv=huge)
        )
    else:
        model = pv.PolyData(np.eye(3), faces=[3, 0, 1, 2])
        model.active_texture_coordinates = np.array(huge)
    with caplog.at_level(logging.WARNING):
        item = as_object(model, "file")
    assert isinstance(item, MeshObject)
    assert len(item.faces) == 1
    assert "texture coordinates: expected finite numbers" in caplog.text
