import copy
import json
import pickle
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import blobtree
from blobtree import Node, Point, Segment
from decals import (
    Camera,
    DecalImage,
    DecalMaterial,
    Decals,
    MeshObject,
    Scene,
    TreeObject,
    load_model,
    load_scene,
    pose,
    save_scene,
)
from decals.errors import ImplicitDecalsError, InvalidImage, InvalidMesh, InvalidScene
from decals.images import generate_image
from decals.scenes.files import from_json, is_scene, to_json
from decals.scenes.objects import bounds_of
from decals.scenes.pose import PosedMesh, PosedScene

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32) * np.float32(0.1)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)


def _tree() -> Node:
    blob = Point((0.1, 0.2, 0.3), radius=0.7, color=(0.1, 0.5, 1.0)) + Segment(
        (0, 0, 0), (1, 0, 0), radius=1 / 3
    )
    return (blob | Point((2, 0, 0), radius=0.5)).rotate((0, 1, 0), 33.3).translate((0.1, 0, 0))


def _make(**arrays: Any) -> Decals:
    return Decals(**arrays)


def _decals(count: int = 50) -> Decals:
    rng = np.random.default_rng(5)
    return _make(
        positions=rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-6, 6, (count, 1)),
        normals=rng.normal(size=(count, 3)),
        tangents=rng.normal(size=(count, 3)),
        radii=10.0 ** rng.uniform(-6, 6, count),
        images=rng.integers(0, 2, count),
        spill=rng.random(count) < 0.5,
        interactions=rng.integers(0, 3, count),
        layers=rng.integers(-1, 2, count),
        tints=np.where(rng.random((count, 1)) < 0.5, 1.0, rng.random((count, 3))),
        opacities=np.where(rng.random(count) < 0.5, 1.0, rng.random(count)),
        receivers=[["", "tetra", "blob, round thing"][i] for i in rng.integers(0, 3, count)],
        fade_angles=np.where(rng.random(count) < 0.5, 0.0, rng.uniform(1, 180, count)),
        fade_depths=np.where(rng.random(count) < 0.5, 0.0, rng.random(count)),
        single_sheets=rng.random(count) < 0.5,
    )


def _scene() -> Scene:
    return Scene(
        objects=(
            MeshObject("tetra", CORNERS, FACES, (0.1, 0.2, 0.3), named_only=True),
            TreeObject("blob", _tree(), labels="round thing"),
        ),
        camera=Camera((0.1, 2.0, 3.3), (0.0, 1 / 3, 0.0), (0.0, 1.0, 0.1), 31.4),
        images=(DecalImage.load("scale"), DecalImage.load("tile#b0413e")),
        decals=_decals(),
    )


def _bits(array: NDArray[Any]) -> bytes:
    return repr(array.tolist()).encode() if array.dtype.kind == "T" else array.tobytes()


def test_what_is_saved_is_loaded_bit_for_bit(tmp_path: Path) -> None:
    scene = _scene()
    save_scene(scene, tmp_path / "scene.json")
    again = load_scene(tmp_path / "scene.json")
    for name in [field.name for field in fields(Decals)]:
        assert _bits(getattr(again.decals, name)) == _bits(getattr(scene.decals, name)), name
    assert again.camera == scene.camera
    mesh, blob = again.objects
    assert isinstance(mesh, MeshObject)
    assert isinstance(blob, TreeObject)
    assert blob.tree == _tree()
    assert (mesh.name, mesh.color, mesh.source) == ("tetra", (0.1, 0.2, 0.3), None)
    assert _bits(mesh.vertices) == _bits(CORNERS)
    assert _bits(mesh.faces) == _bits(FACES)
    assert [image.source for image in again.images] == ["scale", "tile#b0413e"]
    assert np.array_equal(again.images[1].pixels, generate_image("tile#b0413e"))


def test_saving_again_gives_the_same_bytes(tmp_path: Path) -> None:
    save_scene(_scene(), tmp_path / "a.json")
    save_scene(load_scene(tmp_path / "a.json"), tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def _through_protocol(protocol: int) -> Callable[[Any], Any]:
    return lambda value: pickle.loads(pickle.dumps(value, protocol))


@pytest.mark.parametrize(
    "twin_of",
    [_through_protocol(2), _through_protocol(4), _through_protocol(5), copy.deepcopy],
    ids=["protocol 2", "protocol 4", "protocol 5", "deep copy"],
)
def test_scenes_in_use_are_pickled_and_copied(tmp_path: Path, twin_of: Callable[[Any], Any]) -> None:
    steel = DecalMaterial("steel", generate_image("rivet"), roughness=0.3)
    scene = _scene().replace(images=(DecalImage.load("scale"), steel))
    parts = scene, pose(scene, {"tetra": 2.0 * CORNERS})
    points = np.array([[0.3, 0.2, 0.1], [0.05, 0.02, 0.03]], np.float32)
    before = [(item.surface.project(points), item.surface.contains(points)) for item in scene.objects]
    again, posed = twin_of(parts)
    assert isinstance(again, Scene)
    assert isinstance(posed, PosedScene)
    for name in [field.name for field in fields(Decals)]:
        array = getattr(again.decals, name)
        assert _bits(array) == _bits(getattr(scene.decals, name)), name
        assert not array.flags.writeable, name
    assert (again.camera, again.drawing) == (scene.camera, scene.drawing)
    for item, ((positions, normals), inside) in zip(again.objects, before, strict=True):
        found = item.surface.project(points)
        assert _bits(found[0]) == _bits(positions)
        assert _bits(found[1]) == _bits(normals)
        assert np.array_equal(item.surface.contains(points), inside)
        assert not any(corner.flags.writeable for corner in item.bounds)
    mesh, blob = again.objects
    assert isinstance(blob, TreeObject)
    assert blob.tree == _tree()
    assert isinstance(mesh, MeshObject)
    assert mesh.vertices is mesh.surface.vertices
    assert not mesh.vertices.flags.writeable
    assert isinstance(again.images[1], DecalMaterial)
    for name in ("pixels", "normal", "roughness", "metallic", "occlusion", "emission"):
        assert np.array_equal(getattr(again.images[1], name), getattr(steel, name)), name
    assert isinstance(posed.objects[0], PosedMesh)
    assert posed.objects[0].rest is mesh
    assert posed.decals is again.decals
    assert _bits(posed.objects[0].vertices) == _bits(2.0 * CORNERS)
    for number, one in enumerate((scene, again)):
        (tmp_path / str(number)).mkdir()
        save_scene(one, tmp_path / str(number) / "scene.json")
    folders = [sorted((tmp_path / str(number)).rglob("*")) for number in range(2)]
    for old, new in zip(*folders, strict=True):
        assert old.is_dir() or old.read_bytes() == new.read_bytes()


def test_numbers_are_the_shortest_that_round_to_the_same_float32(tmp_path: Path) -> None:
    third = _make(
        positions=np.array([[1 / 3, 0.1, 2e-8]], np.float32),
        normals=[[0, 0, 1]],
        tangents=[[1, 0, 0]],
        radii=[0.7],
    )
    scene = _scene().replace(decals=third)
    record = json.loads(to_json(scene, folder=tmp_path))["decals"][0]
    assert record["position"] == [0.33333334, 0.1, 2e-8]
    assert record["radius"] == 0.7


def test_decals_of_older_files_have_the_defaults(tmp_path: Path) -> None:
    """Before there were interactions, layers, tints and opacities; and without them the file is the same."""
    scene = _scene()
    given = (
        "interactions",
        "layers",
        "tints",
        "opacities",
        "receivers",
        "fade_angles",
        "fade_depths",
        "single_sheets",
    )
    plain = scene.decals.replace(**dict.fromkeys(given))
    text = to_json(scene.replace(decals=plain), folder=tmp_path)
    assert not any(
        word in text for word in (b"interaction", b"layer", b"tint", b"opacity", b"receivers", b"fade")
    )
    again = from_json(text, folder=tmp_path).decals
    for field in fields(Decals):
        assert _bits(getattr(again, field.name)) == _bits(getattr(plain, field.name))


def test_one_decal_a_line_for_people_and_diffs(tmp_path: Path) -> None:
    lines = to_json(_scene(), folder=tmp_path).decode().splitlines()
    assert sum('"tangent"' in line for line in lines) == 50
    assert max(line.count('"tangent"') for line in lines) == 1


def test_meshes_and_images_from_files_are_relative_to_the_scene(tmp_path: Path) -> None:
    from PIL import Image

    (tmp_path / "parts").mkdir()
    mesh_path, image_path = tmp_path / "parts" / "tetra.obj", tmp_path / "parts" / "dot.png"
    rows = [f"v {x} {y} {z}" for x, y, z in CORNERS.tolist()] + [
        f"f {a} {b} {c}" for a, b, c in (FACES + 1).tolist()
    ]
    mesh_path.write_text("\n".join(rows) + "\n")
    Image.new("RGB", (3, 2), (9, 8, 7)).save(image_path)
    scene = Scene(
        objects=(MeshObject("tetra", CORNERS, FACES, source=str(mesh_path)),),
        camera=Camera((1, 2, 3)),
        images=(DecalImage.load(str(image_path)),),
    )
    save_scene(scene, tmp_path / "scene.json")
    written = json.loads((tmp_path / "scene.json").read_text())
    assert written["objects"][0]["source"] == "parts/tetra.obj"
    assert "data" not in written["objects"][0]
    assert written["images"] == ["parts/dot.png"]
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for name in ("parts", "scene.json"):
        (tmp_path / name).rename(moved / name)
    again = load_scene(moved / "scene.json")
    assert isinstance(again.objects[0], MeshObject)
    assert np.allclose(again.objects[0].vertices, CORNERS)
    assert again.images[0].pixels.shape == (2, 3, 4)


def test_samples_are_named_and_fetched_again(tmp_path: Path) -> None:
    tetra = MeshObject("t", CORNERS, FACES, source="sample:tetra")
    scene = Scene(objects=(tetra,), camera=Camera((1, 2, 3)))
    save_scene(scene, tmp_path / "scene.json")
    again = load_scene(tmp_path / "scene.json", samples={"tetra": (CORNERS, FACES)}.__getitem__)
    assert isinstance(again.objects[0], MeshObject)
    assert again.objects[0].source == "sample:tetra"
    with pytest.raises(InvalidScene, match="sample:tetra"):
        load_scene(tmp_path / "scene.json")


def test_saving_into_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene, match="make it first"):
        save_scene(_scene(), tmp_path / "nowhere" / "scene.json")


def _broken(change: str, value: object) -> bytes:
    """Give the JSON of a good scene with one field exchanged, which ``a.b.0.c`` names."""
    document = json.loads(to_json(_scene(), folder=Path()))
    *path, last = change.split(".")
    place = document
    for step in path:
        place = place[int(step)] if step.isdigit() else place[step]
    if value is KeyError:
        del place[last]
    else:
        place[int(last) if last.isdigit() else last] = value
    return json.dumps(document).encode()


@pytest.mark.parametrize(
    ("change", "value", "message"),
    [
        ("format", "something", "implicit-decals-scene"),
        ("version", 2, "version 1"),
        ("camera", KeyError, "camera"),
        ("camera.fov", "wide", r"camera\.fov: "),
        ("camera.fov", 200.0, "fov"),
        ("camera.position", [0.0, 0.0], r"camera\.position: "),
        ("decals.3.radius", "big", r"decals\[3\]\.radius: "),
        ("decals.3.radius", -1.0, "radii"),
        ("decals.3.radius", None, r"decals\[3\]\.radius: "),
        ("decals.3.normal", [0.0, 0.0, 0.0], "normals"),
        ("decals.3.image", -2, r"decals\[3\]\.image: "),
        ("decals.3.image", 2**31, r"decals\[3\]\.image: "),
        ("decals.3.image", 2**64, r"decals\[3\]\.image: "),
        ("decals.3.layer", 2**64, r"decals\[3\]\.layer: "),
        ("decals.3.position", [1e39, 0.0, 0.0], "positions"),
        ("decals.3.radius", 1e308, "radii"),
        ("decals.3.interaction", "stick", r"decals\[3\]\.interaction: "),
        ("decals.3.layer", 1.5, r"decals\[3\]\.layer: "),
        ("decals.3.layer", 10**9, "layers"),
        ("decals.3.tint", [1, 2, 3], "tints"),
        ("decals.3.opacity", -1, "opacities"),
        ("decals.3.image", 2, "shows image 2"),
        ("decals.3.colour", "red", "colour"),
        ("objects.0.type", "cube", r"objects\[0\]\.type: unknown value"),
        ("objects.0.data", KeyError, "either 'source' or 'data'"),
        ("objects.0.data.vertices", "not base64!", r"objects\[0\]\.data\.vertices: "),
        ("objects.0.data.faces", "AAAA", "tetra"),
        ("objects.0.color", [2.0, 0.0, 0.0], "colour"),
        ("objects.0.name", "blob", "'blob' twice"),
        ("objects.0.name", " ", "empty"),
        ("objects.1.tree.nodes.0.radius", -1.0, "radius"),
        ("objects.1.tree.nodes.2.operands", [0, 2], "nodes"),
        ("images.0", "nowhere.png", "nowhere"),
    ],
)
def test_each_wrong_field_is_named(change: str, value: object, message: str) -> None:
    with pytest.raises(ImplicitDecalsError, match=message):
        from_json(_broken(change, value), folder=Path())


@pytest.mark.parametrize("text", [b"", b"{", b"null", b"[]", b"\xff\xfe", b'{"format": 3}', b"{}"])
def test_no_scene_at_all(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "scene.json"
    path.write_bytes(text)
    with pytest.raises(InvalidScene, match=r"scene\.json"):
        load_scene(path)
    assert not is_scene(text)


@pytest.mark.parametrize("share", [0.1, 0.51, 0.99], ids=["early", "middle", "late"])
def test_a_truncated_scene_is_reported_as_a_scene(tmp_path: Path, share: float) -> None:
    text = to_json(_scene(), folder=tmp_path)
    path = tmp_path / "cut.json"
    path.write_bytes(text[: int(share * len(text))])
    with pytest.raises(InvalidScene, match=r"cut\.json': not a scene of version 1: the file ends too early$"):
        load_model(path)


def test_a_truncated_tree_is_reported_as_a_tree(tmp_path: Path) -> None:
    path = tmp_path / "cut.json"
    blobtree.save(blobtree.Point((0, 0, 0), radius=1.0), path)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(blobtree.errors.InvalidFile, match="BlobTree"):
        load_model(path)


def test_truncated_at_every_place(tmp_path: Path) -> None:
    text = to_json(_scene(), folder=tmp_path)
    for end in range(0, len(text) - 2, 997):
        with pytest.raises(InvalidScene):
            from_json(text[:end], folder=tmp_path)


def test_missing_scene(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene, match="check the path"):
        load_scene(tmp_path / "nowhere.json")


@pytest.mark.parametrize(
    ("count", "objects"), [(0, "[]"), (1, "['model 1']"), (5, "['model 1', 'model 2', 'model 3', … 2 more]")]
)
def test_the_text_of_a_scene_is_short(count: int, objects: str) -> None:
    scene = Scene(objects=count * [Point((0, 0, 0), radius=1)], camera=Camera((0, 0, 5)))
    assert repr(scene) == f"Scene(objects={objects}, decals=Decals(0), images=0)"


def test_scene_refuses_decals_without_their_image() -> None:
    with pytest.raises(InvalidScene, match="has 1 images"):
        _scene().replace(images=[DecalImage.load("scale")])


def test_objects_are_checked() -> None:
    with pytest.raises(InvalidMesh, match="finite"):
        MeshObject("m", CORNERS * np.float32(np.nan), FACES)
    with pytest.raises(InvalidMesh, match="rescale"):
        MeshObject("m", CORNERS * np.float32(1e20), FACES)
    with pytest.raises(InvalidMesh, match="finite"):
        MeshObject("m", CORNERS.astype(np.float64) * 1e300, FACES)
    with pytest.raises(InvalidMesh, match="area"):
        MeshObject("m", CORNERS * 0, FACES)
    for objects in ("model.ply", {"a": 1}, 3.5, np.array("x")):
        with pytest.raises(InvalidScene, match="a list of models"):
            Scene(objects=objects, camera=Camera((0, 0, 1)))  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="BlobTree"):
        TreeObject("t", "no tree")  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="uint8"):
        DecalImage("x", np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(InvalidImage):
        DecalImage.load("nowhere")


def test_bounds_are_those_of_the_surfaces() -> None:
    ball = TreeObject("ball", Point((0, 0, 0), radius=0.5))
    low, high = bounds_of([ball, MeshObject("m", CORNERS + np.array([2, 0, 0], np.float32), FACES)])
    assert np.allclose(low, -0.5, atol=0.02)
    assert np.allclose(high, [2.1, 0.5, 0.5], atol=0.02)
    with pytest.raises(InvalidScene, match="at least one"):
        bounds_of([])


def test_receivers_are_objects_of_the_scene() -> None:
    scene = _scene()
    with pytest.raises(InvalidScene, match="one of blob, round thing, tetra; got 'lid'"):
        scene.replace(decals=scene.decals.replace(receivers="blob, lid"))
    assert scene.objects[0].named_only
    for labels in (7, ["a,b"], [3]):
        with pytest.raises(InvalidScene, match="expected labels"):
            TreeObject("blob", _tree(), labels=labels)  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="named_only"):
        TreeObject("blob", _tree(), named_only=1)  # type: ignore[arg-type]
