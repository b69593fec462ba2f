"""Exported files, read back by this package, trimesh and VTK: surfaces and colours are those of the scene."""

import json
import re
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

import blobtree
import decals
from blobtree import Point
from decals import MeshObject, Scene
from decals.baking import formats, usd
from decals.errors import ImplicitDecalsError, InvalidScene
from decals.images.texels import decode_srgb, encode_srgb
from decals.surfaces import BaseColor, check_mesh, read_mesh
from decals.surfaces.mesh_file import read_mesh_data
from tests.decals.baking.exported import (
    FORMATS,
    READERS,
    WITHOUT_COLORS,
    ReadBack,
    random_scene,
    read_by_decals,
    read_by_pyvista,
)
from tests.decals.baking.glb import Array, ball_and_cube, need, read_attribute, read_json
from tests.decals.meshes import icosphere
from tests.programs import output_of

RESOLUTION = 20

PAGE = Path(__file__).parents[3] / "docs" / "exporting.md"

MANY_SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 25))]
"""Seeds of random scenes."""


def surfaces(scene: Scene) -> list[tuple[Array, Array, Array, Array]]:
    """Vertices, faces, normals and linear base colours of all objects, without a word of `export`."""
    parts = []
    for item in scene.objects:
        if isinstance(item, MeshObject):
            split = item.surface
            normals = split.smooth_normals(split.vertices)
            assert not isinstance(item.color, BaseColor)
            base = np.tile(decode_srgb(np.array(item.color)), (len(split.vertices), 1))
            parts.append((split.vertices, split.faces, normals, base))
        else:
            mesh = blobtree.polygonize(item.tree, resolution=RESOLUTION)
            parts.append((mesh.vertices, mesh.faces, mesh.normals, decode_srgb(mesh.colors.astype(float))))
    return parts


@cache
def expected(seed: int) -> ReadBack:
    """The corners of all faces of a random scene, and their colours by `evaluate` in the normals above."""
    scene, colors = random_scene(seed), []
    for item, (vertices, _, normals, base) in zip(scene.objects, surfaces(scene), strict=True):
        images = [image.pixels for image in scene.images]
        over = decals.evaluate(scene.decals, vertices, normals, images=images, on=item).color
        assert over is not None
        colors.append(encode_srgb(base * (1 - over[:, 3:]) + over[:, :3]))
    parts = [
        (vertices[faces], color[faces])
        for (vertices, faces, *_), color in zip(surfaces(scene), colors, strict=True)
    ]
    return ReadBack(*map(np.concatenate, zip(*parts, strict=True))).ordered


def test_the_table_of_the_docs_has_all_formats_and_their_colours() -> None:
    rows = re.findall(r"^\| (`\..+?) \| (.+?) \|", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    listed = {
        suffix: colors.replace("–", "")
        for names, colors in rows
        for suffix in re.findall(r"`(.+?)`", names.partition("(")[0])
    }
    assert listed == {suffix: ", ".join(each.colors) for suffix, each in formats.FORMATS.items()}


@pytest.mark.parametrize(
    ("suffix", "reader"), [(suffix, reader) for suffix, readers in FORMATS.items() for reader in readers]
)
@pytest.mark.parametrize("seed", MANY_SEEDS)
def test_readers_find_surfaces_and_colours_of_a_random_scene(
    tmp_path: Path, seed: int, suffix: str, reader: str
) -> None:
    need("trimesh")
    pytest.importorskip(reader, reason=f"{reader} is not installed")
    scene, path = random_scene(seed), tmp_path / f"Datei ü{suffix}"
    decals.export(scene, path, colors=None if suffix == ".stl" else "vertices", resolution=RESOLUTION)
    want, found = expected(seed), READERS[reader](path).ordered
    np.testing.assert_array_equal(found.triangles, want.triangles)
    if suffix != ".stl" and (reader, suffix) not in WITHOUT_COLORS and found.colors is not None:
        assert want.colors is not None
        assert (np.abs(found.colors - want.colors).max(axis=(1, 2)) > 2 / 255).mean() < 0.02
    else:
        assert suffix == ".stl" or reader != "decals"


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply", ".vtp"])
@pytest.mark.parametrize("seed", [0, pytest.param(7, marks=pytest.mark.slow)])
def test_vertices_have_the_colours_of_the_decals_there(tmp_path: Path, seed: int, suffix: str) -> None:
    need("trimesh")
    vertices, faces = icosphere(4)
    ball = MeshObject("ball", vertices, faces, (0.3, 0.6, 0.9))
    scene = decals.cover(ball, count=20, images=["scale", "eye"], seed=seed)
    path = tmp_path / f"ball{suffix}"
    decals.export(scene, path, colors="vertices")
    found = read_by_decals(path)
    assert found.colors is not None
    points = found.triangles.reshape(-1, 3).astype(np.float32)
    over = decals.evaluate(scene.decals, points, points, images=[i.pixels for i in scene.images]).color
    assert over is not None
    want = encode_srgb(decode_srgb(np.array([0.3, 0.6, 0.9])) * (1 - over[:, 3:]) + over[:, :3])
    off = np.abs(found.colors.reshape(-1, 3) - want).max(axis=1) > 2 / 255
    assert off.mean() < 0.01  # normals of the mesh differ from those of the ball, so rims do
    assert want.std(axis=0).min() > 0.05


def test_textures_of_all_formats_are_alike(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    scene = ball_and_cube(count=20)
    files = [tmp_path / f"scene{suffix}" for suffix in (".glb", ".gltf", ".obj", ".ply")]
    first, *others = [_exported_middles(scene, path) for path in files]
    assert first.std(axis=0).min() > 0.05
    for path, other in zip(files[1:], others, strict=True):
        assert np.abs(other - first).max() < 2 / 255, path


def _exported_middles(scene: Scene, path: Path) -> Array:
    """Colours in the middles of the faces of a file with a texture."""
    decals.export(scene, path, colors="texture", size=128, samples=1)
    return _middles(path)


def _middles(path: Path) -> Array:
    """The same of a file that is there."""
    data = read_mesh_data(path)
    assert data.color is not None
    assert len(data.color.textures) == 1
    weights = np.full((len(data.faces), 3), 1 / 3)
    light = data.color.light_at(data.faces, np.arange(len(data.faces)), weights)
    corners = np.asarray(data.vertices)[data.faces].reshape(-1, 9)
    return np.asarray(encode_srgb(light))[np.lexsort(corners.T)]


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_trimesh_and_vtk_find_texture_and_coordinates(tmp_path: Path, suffix: str) -> None:
    need("trimesh", "xatlas")
    import trimesh

    scene, path = ball_and_cube(count=6), tmp_path / f"a b{suffix}"
    decals.export(scene, path, colors="texture", size=64, samples=1)
    loaded: Any = trimesh.load(path, process=False)
    meshes = list(loaded.geometry.values()) if isinstance(loaded, trimesh.Scene) else [loaded]
    coordinates = np.concatenate([mesh.visual.uv for mesh in meshes])
    image: Any = np.asarray(meshes[0].visual.material.image)
    assert image.shape[:2] == (64, 64)
    assert image[..., :3].std() > 10
    assert coordinates.min() >= 0
    assert coordinates.max() <= 1
    read: Any = pv.read(path)
    places = np.asarray(read.active_texture_coordinates)
    assert {tuple(row) for row in places.round(5)} == {
        tuple(row) for row in coordinates.astype("f4").round(5)
    }


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".ply", ".vtp"])
def test_attributes_are_those_of_evaluate(tmp_path: Path, suffix: str) -> None:
    need("trimesh")
    scene = decals.cover(blobtree.Point((0, 0, 0), radius=1.0), count=30)
    scene = scene.replace(decals=scene.decals[:20])
    path = tmp_path / f"ball{suffix}"
    names = ("owner", "uv", "field", "stretch")
    decals.export(scene, path, colors="vertices", attributes=names, resolution=16)
    found = _attributes(path)
    mesh = blobtree.polygonize(scene.objects[0].tree, resolution=16)  # type: ignore[union-attr]
    samples = decals.evaluate(scene.decals, mesh.vertices, mesh.normals)
    np.testing.assert_array_equal(found["owner"], samples.owner)
    np.testing.assert_array_equal(found["uv"], samples.uv)
    np.testing.assert_array_equal(found["field"], samples.field)
    assert (samples.owner < 0).any()
    assert (found["stretch"][samples.owner < 0] == 0).all()
    owned = found["stretch"][samples.owner >= 0]
    measured = decals.measure(scene)
    assert owned.min() >= 1 - 1e-3
    assert np.median(owned) == pytest.approx(measured.stretch_median, rel=0.1)


def _attributes(path: Path) -> dict[str, Array]:
    """Attributes of a file by their names in `export`."""
    if path.suffix == ".vtp":
        data: Any = pv.read(path)
        return {name: np.asarray(data.point_data[name]) for name in ("owner", "uv", "field", "stretch")}
    if path.suffix == ".ply":
        import trimesh

        raw = trimesh.load(path, process=False).metadata["_ply_raw"]["vertex"]["data"]
        uv = np.column_stack([raw["uv_0"], raw["uv_1"]])
        return {
            "uv": uv,
            **{name: np.asarray(raw[name]).reshape(-1) for name in ("owner", "field", "stretch")},
        }
    if path.suffix == ".gltf":
        import trimesh

        (mesh,) = trimesh.load_scene(path, process=False).geometry.values()
        return {name[1:].lower(): np.squeeze(values) for name, values in mesh.vertex_attributes.items()}
    tree = read_json(path)
    kept = {}
    for name in ("_OWNER", "_UV", "_FIELD", "_STRETCH"):
        assert name in tree["meshes"][0]["primitives"][0]["attributes"]
        kept[name[1:].lower()] = np.squeeze(read_attribute(path, 0, name))
    return kept


def test_unit_and_upward_axis_place_the_nodes_of_gltf(tmp_path: Path) -> None:
    need("trimesh")
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 2]], np.float32)
    sheet = MeshObject("sheet", vertices, [[0, 1, 2]])
    decals.export(sheet, tmp_path / "a.glb", colors="none", unit="centimeter", up="z")
    points, _ = read_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(points, np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.02, 0]]), atol=1e-9)
    decals.export(sheet, tmp_path / "b.glb", colors="none", unit="meter", up="y")
    np.testing.assert_array_equal(read_mesh(tmp_path / "b.glb")[0], vertices)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".vtp", ".glb"])
def test_models_far_from_zero_keep_their_place(tmp_path: Path, suffix: str) -> None:
    need("trimesh")
    vertices, faces = icosphere(1)
    wide = vertices.astype(np.float64) + np.array([5e6, -3e6, 1e6])
    decals.export(MeshObject("ball", wide, faces), tmp_path / f"far{suffix}", colors="none")
    found = read_by_pyvista(tmp_path / f"far{suffix}").triangles if suffix == ".vtp" else None
    if found is None:
        points, corners = read_mesh(tmp_path / f"far{suffix}")
        found = np.asarray(points, np.float64)[corners]
    np.testing.assert_allclose(found.reshape(-1, 3).mean(axis=0), [5e6, -3e6, 1e6], atol=0.1)
    np.testing.assert_allclose(np.ptp(found.reshape(-1, 3), axis=0), np.ptp(wide, axis=0), atol=1e-6 * 5e6)


def test_the_recipe_is_in_the_extras(tmp_path: Path) -> None:
    need("trimesh")
    scene = decals.cover(blobtree.Point((0, 0, 0), radius=1.0), count=5, seed=3)
    decals.export(scene, tmp_path / "a.glb", colors="vertices", resolution=8)
    assert scene.recipe is not None
    extras = read_json(tmp_path / "a.glb")["asset"]["extras"]
    assert extras["recipe"] == json.loads(json.dumps(scene.recipe.record))


def test_hidden_objects_are_left_out(tmp_path: Path) -> None:
    ball, cube = ball_and_cube(count=4).objects
    assert isinstance(cube, MeshObject)
    hidden = MeshObject("cube", cube.vertices, cube.faces, hidden=((),))
    scene = Scene(objects=[ball, hidden], camera=decals.Camera((0, 0, 5)))
    checks = decals.export(scene, tmp_path / "a.stl")
    assert [check.name for check in checks] == ["ball"]
    assert len(read_mesh(tmp_path / "a.stl")[1]) == len(ball.faces)  # type: ignore[union-attr]


def test_checks_of_written_meshes(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    vertices, faces = icosphere(1)
    copied = MeshObject("odd", vertices, np.concatenate([faces, faces[:1, ::-1]]), orientation="keep")
    (check,) = decals.export(copied, tmp_path / "a.stl")
    assert not check.sound
    assert "object 'odd'" in caplog.text
    again = check_mesh(*read_mesh(tmp_path / "a.stl"))
    assert (again.copies, again.branching, again.closed) == (check.copies, check.branching, check.closed)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"path": "a.stl", "colors": "vertices"}, r"colors: expected none for 'a.stl', got 'vertices'"),
        ({"path": "a.vtp", "colors": "texture"}, r"expected vertices or none .* formats .glb, .gltf, .obj"),
        ({"path": "a.obj", "attributes": "owner"}, r"attributes: expected none for 'a.obj', got owner"),
        ({"attributes": ["color"]}, "attributes: expected one of"),
        ({"attributes": 7}, "attributes: expected names, got 7"),
        ({"attributes": np.array("owner")}, "attributes: expected names"),
        ({"unit": "mile"}, "unit: expected one of"),
        ({"up": "x"}, "up: expected one of"),
        ({"colors": "both"}, "colors: expected one of"),
        ({"path": "a.fbx"}, "expected a file that ends in .glb or .gltf"),
        ({"path": "a"}, "expected a file that ends in"),
        ({"path": "nowhere/a.ply"}, "'nowhere' does not exist"),
        ({"scene": Scene(objects=(), camera=decals.Camera((0, 0, 5)))}, "at least one object"),
        ({"resolution": -1}, "resolution"),
    ],
    ids=str,
)
def test_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any], says: str) -> None:
    monkeypatch.chdir(tmp_path)
    arguments: dict[str, Any] = {"scene": blobtree.Point((0, 0, 0), radius=1.0), "path": "a.ply"} | options
    with pytest.raises(ImplicitDecalsError, match=says):
        decals.export(arguments.pop("scene"), arguments.pop("path"), **arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("blocked", ["scene.mtl", "scene_color.png"])
def test_no_file_is_written_if_one_of_them_cannot_be(tmp_path: Path, blocked: str) -> None:
    need("trimesh", "xatlas")
    (tmp_path / blocked).mkdir()
    (tmp_path / "scene.obj").write_bytes(b"old")
    with pytest.raises(ImplicitDecalsError, match=blocked):
        decals.export(ball_and_cube(count=2), tmp_path / "scene.obj", size=32, samples=1)
    assert (tmp_path / "scene.obj").read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["scene.obj", blocked])


def test_vtp_files_name_the_object_of_each_face(tmp_path: Path) -> None:
    scene = random_scene(1)
    decals.export(scene, tmp_path / "a.vtp", colors="none", resolution=RESOLUTION)
    data: Any = pv.read(tmp_path / "a.vtp")
    names = data.GetFieldData().GetAbstractArray("object_names")
    found = [names.GetValue(number) for number in range(names.GetNumberOfValues())]
    assert found == [item.name for item in scene.objects]
    assert len(found) > 1
    counts = np.bincount(data.cell_data["object"])
    assert counts.tolist() == [len(faces) for _, faces, *_ in surfaces(scene)]


def test_lib3mf_finds_the_texture_of_a_3mf_file(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    lib3mf = pytest.importorskip("lib3mf", reason="lib3mf is not installed")
    scene = ball_and_cube(count=10)
    for path in (tmp_path / "a.3mf", tmp_path / "a.glb"):
        decals.export(scene, path, colors="texture", size=64, samples=1)
    first, second = (_middles(tmp_path / name) for name in ("a.glb", "a.3mf"))
    assert np.abs(first - second).max() < 2 / 255
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromBuffer((tmp_path / "a.3mf").read_bytes())
    assert reader.GetWarningCount() == 0
    assert model.GetTexture2Ds().Count() == 1
    objects = model.GetMeshObjects()
    names = []
    while objects.MoveNext():
        mesh = objects.GetCurrentMeshObject()
        names.append(mesh.GetName())
        assert mesh.IsManifoldAndOriented()
    assert names == ["ball", "cube"]


def test_unit_and_axis_of_a_3mf_file(tmp_path: Path) -> None:
    sheet = MeshObject("sheet", [[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]])
    decals.export(sheet, tmp_path / "a.3mf", unit="inch", up="y")
    points, _ = read_mesh(tmp_path / "a.3mf")
    np.testing.assert_allclose(points, [[0, 0, 0], [1, 0, 0], [0, 0, 2]], atol=1e-9)
    model = zipfile.ZipFile(tmp_path / "a.3mf").read("3D/3dmodel.model").decode()
    assert 'unit="inch"' in model
    assert 'type="surface"' in model  # an open mesh is no solid


def test_openusd_finds_materials_attributes_names_and_units(tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    pytest.importorskip("pxr", reason="usd-core is not installed; it is in the extra `usd`")
    from importlib import import_module

    usd, geometry = import_module("pxr.Usd"), import_module("pxr.UsdGeom")
    glow = np.full((8, 8, 3), 0.3)
    steel = decals.DecalMaterial("steel", np.full((8, 8, 3), 0.5), roughness=0.2, metallic=1.0, emission=glow)
    scene = decals.cover(MeshObject("Kürbis 🎃", *icosphere(2)), count=12, images=steel)
    path = tmp_path / "ü.usdz"
    names = ["owner", "uv", "field", "stretch"]
    decals.export(scene, path, size=32, samples=1, unit="millimeter", up="z", attributes=names)
    stage = usd.Stage.Open(str(path))
    assert geometry.GetStageUpAxis(stage) == "Z"
    assert geometry.GetStageMetersPerUnit(stage) == pytest.approx(1e-3)
    assert json.loads(stage.GetRootLayer().customLayerData["recipe"])["function"] == "decals.cover"
    (mesh,) = (prim for prim in stage.Traverse() if prim.IsA(geometry.Mesh))
    assert mesh.GetDisplayName() == "Kürbis 🎃"
    shader = stage.GetPrimAtPath("/scene/baked/surface")
    connected = {
        name for name in shader.GetPropertyNames() if shader.GetAttribute(name).HasAuthoredConnections()
    }
    assert connected >= {
        f"inputs:{name}" for name in ("diffuseColor", "roughness", "metallic", "occlusion", "emissiveColor")
    }
    values = geometry.PrimvarsAPI(mesh)
    owners = np.array(values.GetPrimvar("owner").Get())
    points = np.array(mesh.GetAttribute("points").Get())
    samples = decals.evaluate(scene.decals, points, np.array(mesh.GetAttribute("normals").Get()))
    assert (owners == samples.owner).mean() > 0.98
    texture = next(prim for prim in stage.Traverse() if prim.GetName() == "color")
    asset = texture.GetAttribute("inputs:file").Get()
    assert asset.resolvedPath.endswith("ü.usdz[color.png]")


def test_a_usdz_archive_is_as_its_specification_says(tmp_path: Path) -> None:
    """Files are stored as they are, each from a multiple of 64 bytes on, the layer first."""
    need("trimesh", "xatlas")
    pytest.importorskip("pxr", reason="usd-core is not installed; it is in the extra `usd`")
    path = tmp_path / "a.usdz"
    decals.export(ball_and_cube(count=4), path, size=32, samples=1)
    content = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        entries = archive.infolist()
        assert entries[0].filename.endswith(".usdc")
        assert {entry.filename for entry in entries[1:]} >= {"color.png"}
        for entry in entries:
            assert entry.compress_type == zipfile.ZIP_STORED
            header = content[entry.header_offset : entry.header_offset + 30]
            name, extra = (int.from_bytes(header[at : at + 2], "little") for at in (26, 28))
            start = entry.header_offset + 30 + name + extra
            assert start % 64 == 0
            assert content[start : start + entry.file_size] == archive.read(entry)
        assert archive.read(entries[0])[:8] == b"PXR-USDC"


ALONE = """
import sys
import decals
from blobtree import Point

scene = decals.cover(Point((0, 0, 0), radius=1), count=3)
decals.export(scene, sys.argv[1], colors="none", resolution=8)
print([name for name in sys.modules if name.startswith("pxr.")])
"""


@pytest.mark.slow
def test_openusd_is_imported_in_a_process_of_its_own(tmp_path: Path) -> None:
    """Its loading can wait for a thread that waits for it, so that neither ends."""
    pytest.importorskip("pxr", reason="usd-core is not installed; it is in the extra `usd`")
    assert output_of(ALONE, str(tmp_path / "a.usdz")) == "[]\n"


def test_a_fault_of_openusd_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pxr", reason="usd-core is not installed; it is in the extra `usd`")
    monkeypatch.setattr(usd, "MODULE", "decals.nothing")
    with pytest.raises(
        InvalidScene, match=r"OpenUSD could not write the scene \(.*nothing\); write a .glb file"
    ):
        decals.export(Point((0, 0, 0), radius=1), tmp_path / "a.usdz", colors="none", resolution=8)
    assert list(tmp_path.iterdir()) == []
