"""Scenes of unknown authors: files outside the folder, many or large images, formats of pictures."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import decals
from decals.apps.cli import run
from decals.errors import InvalidImage, InvalidScene
from decals.scenes import files


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a scene, which has a mesh and a picture, as has the folder above it."""
    inner = tmp_path / "scene"
    inner.mkdir()
    for place in (tmp_path, inner):
        pv.Sphere(theta_resolution=6, phi_resolution=6).save(place / "ball.ply")
        Image.new("RGB", (3, 2), (200, 30, 30)).save(place / "red.png")
    return inner


def write_scene(folder: Path, mesh: str = "ball.ply", images: tuple[str, ...] = ("red.png",)) -> Path:
    record: dict[str, Any] = {
        "format": "implicit-decals-scene",
        "version": 1,
        "objects": [{"type": "mesh", "name": "ball", "color": [1, 1, 1], "source": mesh}],
        "images": images,
        "camera": {"position": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 30},
        "decals": [],
    }
    path = folder / "scene.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    return path


def test_files_in_the_folder_are_read(folder: Path) -> None:
    (folder / "deep").mkdir()
    (folder / "red.png").rename(folder / "deep" / "red.png")
    scene = decals.load_scene(write_scene(folder, images=("deep/../deep/red.png", "scale")))
    assert [len(image.pixels) for image in scene.images] == [2, 256]


@pytest.mark.parametrize("trust", ["no", 1, None, np.zeros(2)])
def test_a_word_for_trust_is_none(folder: Path, trust: Any) -> None:
    path = write_scene(folder, "../ball.ply")
    with pytest.raises(InvalidScene, match="trust: expected True or False"):
        decals.load_scene(path, trust=trust)


@pytest.mark.parametrize("kind", ["mesh", "image"])
@pytest.mark.parametrize("place", ["above", "absolute", "link", "NUL"])
def test_files_outside_the_folder_need_trust(folder: Path, kind: str, place: str) -> None:
    name = "ball.ply" if kind == "mesh" else "red.png"
    outside = folder.parent / name
    if place == "link":
        (folder / "link").symlink_to(folder.parent)
    paths = {"above": f"../{name}", "absolute": str(outside), "link": f"link/{name}", "NUL": f"a\0{name}"}
    path = (
        write_scene(folder, mesh=paths[place])
        if kind == "mesh"
        else write_scene(folder, images=(paths[place],))
    )
    for load in (decals.load_scene, decals.load_model):
        with pytest.raises(InvalidScene, match=r"folder of the scene.*trust=True \(--trust"):
            load(path)
    if place != "NUL":
        scene = decals.load_scene(path, trust=True)
        assert len(scene.images) == 1
        loaded = decals.load_model(path, trust=True)
        assert isinstance(loaded, decals.Scene)


def test_the_command_line_has_an_option_for_trust(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = write_scene(folder, mesh="../ball.ply")
    command = ["render", str(path), "--size", "16x12", "--samples", "1", "-o", str(folder / "a.png")]
    assert run(command) == 2
    assert "--trust" in capfd.readouterr().err
    assert run([*command, "--trust"]) == 0
    assert (folder / "a.png").exists()


def test_a_trusted_scene_is_the_one_that_was_saved(folder: Path) -> None:
    """Also one in another folder than its files."""
    Image.new("RGB", (4, 2), (90, 90, 200)).save(folder / "sky.png")
    sky = decals.rendering.Drawing(environment=str(folder / "sky.png"))
    scene = decals.load_scene(write_scene(folder)).replace(drawing=sky)
    other = folder.parent / "other"
    other.mkdir()
    decals.save_scene(scene, other / "again.json")
    with pytest.raises(InvalidScene, match="--trust"):
        decals.load_scene(other / "again.json")
    again = decals.load_scene(other / "again.json", trust=True)
    assert np.array_equal(again.images[0].pixels, scene.images[0].pixels)
    assert again.drawing == sky


def test_number_and_size_of_images_are_limited(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "MAX_IMAGES", 3)
    monkeypatch.setattr(files, "MAX_IMAGE_PIXELS", 12)
    assert len(decals.load_scene(write_scene(folder, images=("red.png",) * 2)).images) == 2
    with pytest.raises(InvalidScene, match=r"at most 12 pixels together.*'red.png'.*--trust"):
        decals.load_scene(write_scene(folder, images=("red.png",) * 3))
    path = write_scene(folder, images=("red.png",) * 4)
    with pytest.raises(InvalidScene, match=r"at most 3, got 4.*--trust"):
        decals.load_scene(path)
    assert len(decals.load_scene(path, trust=True).images) == 4


@pytest.mark.parametrize("suffix", ["png", "jpg", "webp", "tif", "bmp", "gif", "ppm", "tga", "jp2"])
def test_usual_formats_of_pictures_are_read(folder: Path, suffix: str) -> None:
    path = folder / f"grey.{suffix}"
    Image.new("RGB", (3, 2), (128, 128, 128)).save(path)
    assert decals.load_image(os.fspath(path)).shape == (2, 3, 4)


@pytest.mark.parametrize("suffix", ["eps", "png"])
def test_other_formats_are_refused_under_any_name(folder: Path, suffix: str) -> None:
    """EPS is a program that Ghostscript would run."""
    path = folder / "picture.eps"
    Image.new("RGB", (3, 2)).save(path)
    target = folder / f"renamed.{suffix}"
    path.rename(target)
    with pytest.raises(InvalidImage, match="is not a picture"):
        decals.load_image(os.fspath(target))
