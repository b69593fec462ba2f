"""GLB and glTF files under Khronos' validator, a package of npm; decals as instances of squares."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from decals import Decals
from decals.errors import InvalidScene
from decals.images.texels import decode_srgb
from decals.surfaces import read_mesh
from tests.decals.baking.exported import random_scene
from tests.decals.baking.glb import Array, ball_and_cube, json_bytes, need, read_json

VALIDATOR = "gltf-validator@2.0.0-dev.3.10"

WARNING = 1
"""Severity of the warnings of the validator; errors have 0."""

SCRIPT = Path(__file__).with_name("validate_gltf.js")


@pytest.fixture(scope="session")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the validator."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("npm is not installed, which installs Khronos' glTF validator")
    folder = tmp_path_factory.mktemp("validator")
    ran = subprocess.run([npm, "install", "--silent", "--prefix", folder, VALIDATOR], capture_output=True)
    if ran.returncode:
        pytest.skip(f"npm could not install {VALIDATOR}: {ran.stderr.decode(errors='replace')[:200]}")
    shutil.copy(SCRIPT, folder)
    return folder


def issues(modules: Path, *paths: Path) -> list[Any]:
    """The issues of files, by the validator."""
    command: list[str | Path] = ["node", modules / SCRIPT.name, *paths]
    ran = subprocess.run(command, capture_output=True, text=True, check=True, cwd=modules)
    reports: list[Any] = json.loads(ran.stdout)
    return reports


@pytest.mark.slow
def test_the_validator_finds_no_error_in_random_scenes(modules: Path, tmp_path: Path) -> None:
    need("trimesh", "xatlas")
    paths = []
    for seed in range(10):
        suffix, colors = (".glb", ".gltf")[seed % 2], ("texture", "vertices", "none")[seed % 3]
        paths.append(tmp_path / f"{seed}{suffix}")
        names = ("owner", "uv", "field", "stretch")[: seed % 5]
        options: dict[str, Any] = {"up": "z", "unit": "inch"} if seed % 4 == 3 else {}
        options |= {"size": 32, "samples": 1, "resolution": 12, "instances": seed % 4 == 2}
        decals.export(random_scene(seed), paths[-1], colors=colors, attributes=names, **options)
    for path, report in zip(paths, issues(modules, *paths), strict=True):
        assert report["numErrors"] == 0, (path, report["messages"])
        warnings = {one["code"] for one in report["messages"] if one["severity"] <= WARNING}
        assert warnings <= {"UNSUPPORTED_EXTENSION"}, (path, report["messages"])  # it knows no instancing


@pytest.mark.slow
def test_the_validator_finds_errors(modules: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.gltf").write_text('{"asset": {"version": "2.0"}, "nodes": [{"mesh": 3}]}')
    assert issues(modules, tmp_path / "broken.gltf")[0]["numErrors"] > 0


def instances_of(path: Path) -> dict[str, dict[str, Array]]:
    """The values of all instances of a file by the names of its nodes, read without any library."""
    tree, content = read_json(path), path.read_bytes()
    start = 28 + len(json_bytes(path))
    found: dict[str, dict[str, Array]] = {}
    for node in tree["nodes"]:
        extension = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if extension is None:
            continue
        found[node["name"]] = {}
        for name, number in extension["attributes"].items():
            accessor = tree["accessors"][number]
            view = tree["bufferViews"][accessor["bufferView"]]
            flat = np.frombuffer(content, "<f4", view["byteLength"] // 4, start + view["byteOffset"])
            found[node["name"]][name] = flat.reshape(accessor["count"], -1)
    return found


@cache
def scattered() -> decals.Scene:
    """Decals with two images and none, in tints."""
    return ball_and_cube(count=40)


def test_instances_have_the_places_and_looks_of_the_decals(tmp_path: Path) -> None:
    need("trimesh")
    scene = scattered()
    decals.export(scene, tmp_path / "a.glb", instances=True)
    tree = read_json(tmp_path / "a.glb")
    assert "EXT_mesh_gpu_instancing" in tree["extensionsUsed"]
    groups = instances_of(tmp_path / "a.glb")
    assert len(groups) == 3
    rows = np.concatenate([group["_DECAL"] for group in groups.values()]).astype(int).reshape(-1)
    assert sorted(rows) == list(range(len(scene.decals)))
    for group in groups.values():
        own: Decals = scene.decals[group["_DECAL"].astype(int).reshape(-1)]
        assert len(set(own.images.tolist())) == 1
        x, y, z, w = group["ROTATION"].T.astype(float)
        across = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], axis=1)
        out = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)
        np.testing.assert_allclose(across, own.tangents, atol=1e-5)
        np.testing.assert_allclose(out, own.normals, atol=1e-5)
        np.testing.assert_array_equal(group["TRANSLATION"], own.positions)
        np.testing.assert_array_equal(group["SCALE"], np.repeat(own.radii[:, None], 3, axis=1))
        np.testing.assert_allclose(group["_COLOR_0"], decode_srgb(own.tints.astype(float)), atol=1e-6)
        np.testing.assert_array_equal(group["_OPACITY"].reshape(-1), own.opacities)
        np.testing.assert_array_equal(group["_LAYER"].reshape(-1), own.layers)


def test_squares_show_images_within_their_rims_and_objects_their_own_colour(tmp_path: Path) -> None:
    need("trimesh")
    import trimesh

    scene = scattered()
    decals.export(scene, tmp_path / "a.glb", instances=True)
    loaded: Any = trimesh.load_scene(tmp_path / "a.glb")
    pictures = {name: mesh.visual.material.baseColorTexture for name, mesh in loaded.geometry.items()}
    (name,) = (key for key in pictures if key.startswith("decals 0"))
    texels = np.asarray(pictures[name])
    middle = slice(4, 8)
    np.testing.assert_array_equal(texels[middle, middle], scene.images[0].pixels[middle, middle])
    assert (texels[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all()
    tree = read_json(tmp_path / "a.glb")
    materials = {material["name"]: material for material in tree["materials"]}
    assert materials[name]["alphaMode"] == "BLEND"
    _, faces = read_mesh(tmp_path / "a.glb")
    counts = [len(item.faces) for item in scene.objects if isinstance(item, decals.MeshObject)]
    assert len(faces) == 2 * len(scene.decals) + sum(counts)


def test_names_of_objects_and_of_instances_differ(tmp_path: Path) -> None:
    need("trimesh")
    ball = decals.TreeObject("plain decals", blobtree.Point((0, 0, 0), radius=1.0))
    one = Decals([[0, 0, 1.0]], [[0, 0, 1.0]], [[1.0, 0, 0]], [0.3], images=[-1])
    scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5)), decals=one)
    decals.export(scene, tmp_path / "a.glb", instances=True, resolution=8)
    names = [node["name"] for node in read_json(tmp_path / "a.glb")["nodes"] if "mesh" in node]
    assert names == ["plain decals", "plain decals-"]


def test_only_gltf_has_instances(tmp_path: Path) -> None:
    with pytest.raises(InvalidScene, match=r"instances: expected a .glb or .gltf file, got '.*a.ply'"):
        decals.export(scattered(), tmp_path / "a.ply", instances=True)
