"""Texture coordinates beside a colour: kept by objects and files, turned with faces, used by one layout."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import decals
from decals import MeshObject, load_scene, save_scene
from decals.baking.layouts import lay_out
from decals.baking.meshes import BakeMesh, bake_mesh
from decals.errors import InvalidMesh
from decals.images.texels import decode_srgb
from decals.scenes.objects import as_object
from decals.scenes.script import write_script
from decals.surfaces import BaseColor
from tests.decals.baking.glb import Array, need, read_glb
from tests.decals.relief import hills

COLORS = (0.2, 0.6, 0.9)


def silent(*_: Any) -> None:
    """Report nothing."""


def places_on_ball(points: Array) -> Array:
    """The coordinates of a ball, as a function of its points; u along the height, v around the axis."""
    around = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi)
    return np.column_stack([0.5 + 0.45 * points[:, 2], 0.5 + 0.9 * around])


def ball(bad: str = "") -> pv.PolyData:
    """A ball of pyvista, open along a meridian, whose points have coordinates."""
    angle, height = np.meshgrid(np.linspace(-3.1, 3.1, 13), np.linspace(-0.95, 0.95, 6))
    radius = np.sqrt(1 - height**2)
    grid: Any = pv.StructuredGrid(radius * np.cos(angle), radius * np.sin(angle), height)
    surface: Any = grid.extract_surface(algorithm="dataset_surface").triangulate()
    places = places_on_ball(surface.points)
    if bad == "no area":
        places[:] = 0.5
    elif bad == "outside":
        places *= 3.0
    surface.active_texture_coordinates = places.astype(np.float32)
    result: pv.PolyData = surface
    return result


def ball_object() -> MeshObject:
    item = as_object(ball(), "ball")
    assert isinstance(item, MeshObject)
    return item


def obj_file(folder: Path) -> Path:
    """A box of quadrilaterals without a material, each in a cell of its own."""
    points = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    sides = ((5, 7, 3, 1), (2, 4, 8, 6), (1, 2, 6, 5), (7, 8, 4, 3), (3, 4, 2, 1), (5, 6, 8, 7))
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    for number, side in enumerate(sides):
        corner = np.array([number % 3, number // 3]) / 3
        lines += [f"vt {u:.6f} {v:.6f}" for u, v in corner + 0.3 * square]
        lines.append("f " + " ".join(f"{row}/{4 * number + place + 1}" for place, row in enumerate(side)))
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    return folder / "box.obj"


def laid_out(item: object) -> tuple[BakeMesh, Array]:
    """Return the mesh of an object, and its texture coordinates in the own layout."""
    mesh = bake_mesh(item, resolution=None, creases=False, report=silent, own=True)
    (part,) = lay_out([mesh], 64, "own", 1, silent)
    return mesh, np.column_stack([part.places[:, 0], 64 - part.places[:, 1]]) / 64


def scene_of(item: MeshObject) -> decals.Scene:
    return decals.Scene(objects=(item,), camera=decals.Camera((0, 0, 5)))


@pytest.mark.parametrize("orientation", ["keep", "outward", "flip"])
@pytest.mark.parametrize("reversed_faces", ["no", "all", "some"])
def test_a_ball_of_pyvista_keeps_its_coordinates(orientation: str, reversed_faces: str) -> None:
    surface = ball()
    faces = np.array(surface.regular_faces)
    turned = {"no": slice(0), "all": slice(None), "some": slice(None, None, 3)}[reversed_faces]
    faces[turned] = faces[turned, ::-1]
    mesh = pv.PolyData.from_regular_faces(surface.points, faces)
    mesh.active_texture_coordinates = surface.active_texture_coordinates
    item = as_object(mesh, "ball", orientation=orientation)
    assert isinstance(item, MeshObject)
    assert isinstance(item.color, tuple)  # numbers, as before
    assert item.coordinates is not None
    expected = places_on_ball(item.vertices)[item.faces]
    np.testing.assert_allclose(item.coordinates, expected, atol=1e-6)
    baked, places = laid_out(item)
    np.testing.assert_allclose(places, places_on_ball(baked.vertices), atol=1e-5)


def test_an_obj_file_without_material_keeps_its_coordinates(tmp_path: Path) -> None:
    need("trimesh")
    path = obj_file(tmp_path)
    item = as_object(path, "box")
    assert isinstance(item, MeshObject)
    assert item.coordinates is not None
    cells = np.floor(3 * item.coordinates.mean(axis=1)).astype(int)
    assert np.unique(cells @ [1, 3]).tolist() == list(range(6))
    decals.bake(item, tmp_path / "box.glb", size=64, layout="own")
    node = read_glb(tmp_path / "box.glb")["box"]
    assert node.uv is not None
    assert node.texture is not None
    # each corner of a side lies in the cell of that side, at its own place
    found = np.hstack([node.vertices, node.uv])
    given = np.concatenate([item.vertices[item.faces], item.coordinates], axis=2).reshape(-1, 5)
    of_file, of_item = (np.unique(np.rint(1000 * rows).astype(int), axis=0) for rows in (found, given))
    assert np.array_equal(of_file, of_item)
    middle = node.texture[64 - 10, 10, :3]
    np.testing.assert_allclose(middle, 255 * np.array(item.color), atol=0.6)


@pytest.mark.parametrize("colored", ["one colour", "vertices", "faces"])
def test_colours_stay_beside_coordinates(colored: str) -> None:
    item = ball_object()
    rng = np.random.default_rng(1)
    colors: Any = {
        "one colour": COLORS,
        "vertices": BaseColor(rng.uniform(0, 1, (len(item.vertices), 3))),
        "faces": BaseColor.of_faces(rng.uniform(0, 1, (len(item.faces), 3))),
    }[colored]
    given = MeshObject("ball", item.vertices, item.faces, colors, coordinates=item.coordinates)
    mesh, places = laid_out(given)
    np.testing.assert_allclose(places, places_on_ball(mesh.vertices), atol=1e-5)
    assert mesh.base is not None
    numbers, weights = np.arange(len(mesh.faces)), np.full((len(mesh.faces), 3), 1 / 3)
    found = mesh.base.light_at(mesh.faces, numbers, weights)
    expected: Any = decode_srgb(np.array([COLORS]))
    if isinstance(colors, BaseColor):
        expected = colors.light_at(given.faces, numbers, weights)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-6)


def test_other_layouts_and_colours_at_vertices_leave_coordinates_alone(tmp_path: Path) -> None:
    need("trimesh")
    item = ball_object()
    plain = MeshObject("ball", item.vertices, item.faces, item.color)
    for options in ({"layout": "box"}, {"layout": "auto"}, {"vertex_colors": True, "layout": "own"}):
        for one, name in ((item, "a.glb"), (plain, "b.glb")):
            decals.bake(one, tmp_path / name, size=64, **options)
        assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


@pytest.mark.parametrize("from_file", [False, True])
def test_scene_files_and_scripts_keep_coordinates(tmp_path: Path, from_file: bool) -> None:
    item = as_object(obj_file(tmp_path), "box") if from_file else ball_object()
    assert isinstance(item, MeshObject)
    scene = scene_of(item)
    save_scene(scene, tmp_path / "scene.json")
    read = load_scene(tmp_path / "scene.json")
    assert read.content_hash == scene.content_hash
    (again,) = read.objects
    assert isinstance(again, MeshObject)
    assert again.coordinates is not None
    assert np.array_equal(again.coordinates, item.coordinates)  # type: ignore[arg-type]
    write_script(scene, tmp_path / "script.py")
    rebuilt = runpy.run_path(str(tmp_path / "script.py"))["scene"]
    assert rebuilt.objects[0].content_hash == item.content_hash


def test_objects_without_coordinates_have_the_hash_and_the_file_that_they_had(tmp_path: Path) -> None:
    item = MeshObject("corner", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert item.content_hash == "3c23a5f9914114600b8802aa220b6f7f293eebdf"
    save_scene(scene_of(item), tmp_path / "scene.json")
    assert "coordinates" not in (tmp_path / "scene.json").read_text()
    placed = MeshObject("corner", item.vertices, item.faces, coordinates=[[[0, 0], [1, 0], [0, 1]]])
    assert placed.content_hash != item.content_hash


def test_poses_keep_coordinates() -> None:
    item = ball_object()
    scene = decals.cover(item, count=3)
    mesh, places = laid_out(decals.pose(scene, {"ball": 2.0 * item.vertices}).objects[0])
    np.testing.assert_allclose(places, places_on_ball(mesh.vertices / 2), atol=1e-5)


def test_displaced_meshes_have_the_coordinates_of_the_faces_that_they_divide() -> None:
    plane = pv.Plane(i_resolution=2, j_resolution=2).triangulate()
    scene = decals.cover(plane, count=4, images=[hills(1, relief=0.4)])
    mesh, places = laid_out(decals.displace(scene, edge_length=0.1).objects[0])
    assert len(mesh.faces) > 200
    np.testing.assert_allclose(places, mesh.places[:, :2] + 0.5, atol=1e-5)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (
            "no area",
            "120 of 120 faces of object 'ball' have no area in its texture coordinates",
        ),
        (
            "outside",
            "expected texture coordinates from 0 to 1, those of object 'ball' go from",
        ),
    ],
)
def test_coordinates_that_cannot_be_used_are_refused(tmp_path: Path, bad: str, says: str) -> None:
    need("trimesh")
    item = as_object(ball(bad), "ball")
    with pytest.raises(InvalidMesh, match=says):
        decals.bake(item, tmp_path / "a.glb", size=64, layout="own")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("coordinates", "says"),
    [
        (np.zeros((2, 3, 2)), r"object 'a', coordinates: expected shape \[1, 3, 2\], got shape \[2, 3, 2\]"),
        (np.full((1, 3, 2), np.nan), "texture coordinates: expected finite numbers"),
        ([[1, 2], [3]], r"object 'a', coordinates: expected shape \[1, 3, 2\], got \["),
        (7, r"object 'a', coordinates: expected shape \[1, 3, 2\], got 7"),
        (np.full((1, 3, 2), "x"), "texture coordinates: expected numbers in rows of 2"),
    ],
    ids=["faces", "NaN", "ragged", "number", "text"],
)
def test_coordinates_of_another_kind_are_refused(coordinates: Any, says: str) -> None:
    with pytest.raises(InvalidMesh, match=says):
        MeshObject("a", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], coordinates=coordinates)


def test_meshes_of_trimesh_are_as_before_but_keep_coordinates() -> None:
    need("trimesh")
    import trimesh

    item = ball_object()
    visual = trimesh.visual.TextureVisuals(uv=places_on_ball(item.vertices))
    given = trimesh.Trimesh(item.vertices, item.faces, visual=visual, process=False)
    made = as_object(given, "ball")
    assert isinstance(made, MeshObject)
    mesh, places = laid_out(made)
    np.testing.assert_allclose(places, places_on_ball(mesh.vertices), atol=1e-5)
