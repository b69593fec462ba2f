"""``implicit-decals bake``."""

from pathlib import Path

import numpy as np
import pytest

from decals import save_scene
from decals.apps.cli import run
from tests.decals.baking.glb import ball_and_cube, need, read_glb, read_json

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def saved(folder: Path) -> Path:
    """A scene file in the empty folder; its images are generated ones, as files need a source."""
    need("trimesh", "xatlas")
    scene = ball_and_cube(count=8)
    save_scene(scene.replace(decals=scene.decals.replace(images=[-1] * 8), images=()), folder / "scene.json")
    return folder


def test_a_scene_becomes_a_textured_file(saved: Path) -> None:
    command = ["bake", "scene.json", "--size", "64", "--samples", "1", "--contact", "radial"]
    assert run([*command, "--crease-angle", "180", "-o", "smooth.glb"]) == 0
    smooth = read_glb(saved / "smooth.glb")["cube"]
    (saved / "smooth.glb").unlink()
    assert run([*command, "-o", "model.glb"]) == 0
    nodes = read_glb(saved / "model.glb")
    assert np.abs(nodes["cube"].normals).max(axis=1).min() > 0.999  # those of its faces
    assert np.abs(smooth.normals).max(axis=1).max() < 0.95
    assert set(nodes) == {"ball", "cube"}
    texture = nodes["ball"].texture
    assert texture is not None
    assert texture.shape == (64, 64, 3)
    assert texture.std() > 10
    assert sorted(path.name for path in saved.iterdir()) == ["model.glb", "scene.json"]


def test_vertex_colours_replace_the_texture(saved: Path, capsys: Capture) -> None:
    assert run(["bake", "scene.json", "--vertex-colors", "-o", "model.glb"]) == 0
    assert capsys.readouterr().out == "model.glb\n"
    tree = read_json(saved / "model.glb")
    assert "textures" not in tree
    assert all("COLOR_0" in mesh["primitives"][0]["attributes"] for mesh in tree["meshes"])


def test_a_missing_package_is_one_line(saved: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    monkeypatch.setitem(__import__("sys").modules, "xatlas", None)
    assert run(["bake", "scene.json", "--layout", "xatlas", "-o", "model.glb"]) == 2
    lines = capfd.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "pip install 'implicit-decals[bake]'" in lines[0]
    assert not (saved / "model.glb").exists()
