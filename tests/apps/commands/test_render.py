"""``implicit-decals render``."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import blobtree
from blobtree import Point
from decals import Camera, Contact, ImageMapping, MeshObject, Scene, TreeObject, load_scene, save_scene
from decals.apps.cli import run
from decals.apps.commands.scatter_options import ScatterOptions
from decals.rendering import Drawing, Environment, Renderer, RenderOptions
from tests.apps.commands.pictures import picture, small

Capture = pytest.CaptureFixture[str]


def test_render_a_mesh_and_a_blob_together(folder: Path, capsys: Capture) -> None:
    pv.Sphere(radius=0.5, center=(1, 0, 0)).save(folder / "ball.ply")
    blobtree.save(Point((0, 0, 0), radius=0.6), folder / "blob.json")
    assert run([*small("ball.ply", "blob.json"), "--image", "rock", "--image", "tile", "-o", "both.png"]) == 0
    drawn = picture(folder / "both.png")
    assert drawn.shape == (48, 64, 4)
    middle, corner = drawn[20:28, 24:40, :3].reshape(-1, 3), drawn[0, 0, :3]
    assert np.abs(middle.astype(int) - corner).max(axis=1).mean() > 40
    assert capsys.readouterr().out == "both.png\n"


def test_pictures_depend_on_the_seed_only(folder: Path) -> None:
    pv.Sphere().save(folder / "ball.ply")
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert run([*small("ball.ply"), "--seed", seed, "-o", f"{name}.png"]) == 0
    pictures = [picture(folder / f"{name}.png") for name in "abc"]
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[0], pictures[2])


@pytest.mark.slow
def test_a_saved_scene_gives_the_same_picture(folder: Path) -> None:
    pv.Sphere().save(folder / "ball.stl")
    Image.new("RGB", (8, 8), (200, 30, 30)).save(folder / "red.png")
    models, saved = ("ball.stl", "knot", "spheres"), ("--save", "s.json", "-o", "a.png")
    assert run([*small(*models), "--image", "red.png", "--image", "eye", "--contact", "radial", *saved]) == 0
    assert run(["render", "s.json", "--size", "64x48", "-o", "b.png"]) == 0
    assert np.array_equal(picture(folder / "a.png"), picture(folder / "b.png"))
    written = json.loads((folder / "s.json").read_text())
    assert [item.get("source") for item in written["objects"]] == ["ball.stl", "sample:knot", None]
    assert len(written["decals"]) == 30
    assert (written["drawing"]["contact"], written["drawing"]["samples"]) == ("radial", 1)
    assert (written["recipe"]["function"], written["recipe"]["parameters"]["count"]) == ("decals.scatter", 30)


def test_contact_and_mapping_are_passed_to_the_renderer(folder: Path) -> None:
    pv.Sphere().save(folder / "ball.ply")
    assert run([*small("ball.ply"), "--save", "s.json", "-o", "default.png"]) == 0
    scene = load_scene(folder / "s.json")
    with Renderer() as renderer:
        for contact in Contact:
            for mapping in (ImageMapping.CHORD, ImageMapping.CORRECTED):
                modes = ["--contact", contact.name.lower(), "--mapping", mapping.name.lower()]
                command = ["render", "s.json", "--size", "64x48", "--samples", "1"]
                assert run([*command, *modes, "-o", "out.png"]) == 0
                drawn = renderer.render(
                    scene, RenderOptions(size=(64, 48), samples=1, contact=contact, mapping=mapping)
                )
                assert np.array_equal(picture(folder / "out.png"), drawn)
                default = (contact, mapping) == (Contact.ELASTIC, ImageMapping.CORRECTED)
                assert default == np.array_equal(drawn, picture(folder / "default.png"))


@pytest.mark.slow
def test_an_environment_is_kept_and_changed(
    folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    pv.Sphere().save(folder / "ball.ply")
    Image.new("RGB", (16, 8), (200, 30, 30)).save(folder / "sky.png")
    lit = ["--environment", "sky.png", "--environment-rotation", "-30", "--environment-visible"]
    assert run([*small("ball.ply"), "--up", "z", *lit, "--save", "s.json", "-o", "lit.png"]) == 0
    wanted = Environment("sky.png", rotation=-30, visible=True, up=(0, 0, 1))
    assert load_scene(folder / "s.json").drawing.environment == wanted
    assert (picture(folder / "lit.png")[0, 0, :3] == picture(folder / "lit.png")[-1, -1, :3]).all()
    load_scene(folder / "s.json").replace(drawing=Drawing()).save(folder / "plain.json")
    dim = ["--environment-strength", "0.5", "--save", "d.json"]
    assert run(["render", "s.json", "--size", "32x24", *dim, "-o", "dim.png"]) == 0
    assert load_scene(folder / "d.json").drawing.environment == replace(wanted, strength=0.5)
    assert picture(folder / "dim.png").mean() < picture(folder / "lit.png").mean() - 5
    monkeypatch.setattr(ScatterOptions, "scene", None)  # refused before decals are scattered
    for change in (["--environment-strength", "2"], ["--environment-visible"]):
        for model in (small("ball.ply"), ["render", "plain.json"]):
            assert run([*model, *change, "-o", "no.png"]) == 2
            assert "give --environment" in capsys.readouterr().err


def test_the_crease_angle_of_meshes(folder: Path, capsys: Capture) -> None:
    pv.Cube().triangulate().clean().save(folder / "cube.ply")
    draw = ["--size", "64x48", "--samples", "1"]
    for name, angle in (("smooth", ["--crease-angle", "120"]), ("sharp", [])):
        assert run(["scatter", "cube.ply", "--count", "9", *angle, "-o", f"{name}.json"]) == 0
        assert run(["render", f"{name}.json", *draw, "-o", f"{name}.png"]) == 0
    (cube,) = load_scene(folder / "smooth.json").objects
    assert isinstance(cube, MeshObject)
    assert cube.crease_angle == 120.0
    assert run(["render", "sharp.json", *draw, "--crease-angle", "120", "-o", "same.png"]) == 0
    assert np.array_equal(picture(folder / "same.png"), picture(folder / "smooth.png"))
    assert not np.array_equal(picture(folder / "sharp.png"), picture(folder / "smooth.png"))
    assert run(["render", "sharp.json", *draw, "--crease-angle", "200", "-o", "same.png"]) == 2
    assert "crease_angle: expected degrees from 0 to 180" in capsys.readouterr().err


def test_a_camera_for_a_saved_scene(folder: Path) -> None:
    pv.Sphere(center=(0, 0, 3)).merge(pv.Cube()).extract_surface(algorithm="geometry").triangulate().save(
        folder / "parts.ply"
    )
    assert run([*small("parts.ply"), "--save", "s.json", "-o", "a.png"]) == 0
    assert run(["render", "s.json", "--size", "64x48", "--camera", "back", "-o", "b.png"]) == 0
    assert not np.array_equal(picture(folder / "a.png"), picture(folder / "b.png"))


@pytest.mark.ordinary_cases("0,3,0")
@pytest.mark.parametrize("camera", ["top", "bottom", "left", "-1,0.5,2", "0,3,0"])
def test_cameras_see_the_model(folder: Path, camera: str) -> None:
    assert run([*small("knot"), f"--camera={camera}", "-o", "a.png"]) == 0
    drawn = picture(folder / "a.png")[..., :3].astype(int)
    assert (np.abs(drawn - drawn[:, :1]).max(axis=-1) > 30).mean() > 0.1


def test_a_picture_without_decals(folder: Path) -> None:
    assert run(["render", "spheres", "--decals", "0", "--size", "40x30", "-o", "a.jpg"]) == 0
    assert picture(folder / "a.jpg").shape == (30, 40, 3)


def test_objects_of_equal_names_are_renamed(folder: Path) -> None:
    pv.Sphere().save(folder / "knot.ply")
    assert run(["scatter", "knot.ply", "knot.ply", "--count", "2", "-o", "s.json"]) == 0
    assert [item["name"] for item in json.loads((folder / "s.json").read_text())["objects"]] == [
        "knot",
        "knot-2",
    ]


def test_a_scene_has_its_own_decals(bad: Callable[..., str], folder: Path) -> None:
    blob = TreeObject("blob", Point((0, 0, 0), radius=1))
    save_scene(Scene(objects=(blob,), camera=Camera((0, 0, 5))), folder / "s.json")
    assert "own decals" in bad("render", "s.json", "-o", "a.png", "--decals", "5")
    assert "give it alone" in bad("render", "s.json", "ball.ply", "-o", "a.png")


def test_a_sample_that_cannot_be_downloaded(bad: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    def offline() -> None:
        raise ConnectionError("no network")

    monkeypatch.setattr("pyvista.examples.download_dragon", offline)
    line = bad("render", "dragon", "-o", "a.png")
    assert "PYVISTA_DATA" in line
    assert "internet" in line


@pytest.mark.parametrize("number", ["1.9", "1e-3", "many", ""])
def test_a_fraction_is_refused_as_a_count(bad: Callable[..., str], number: str) -> None:
    assert "whole number" in bad("render", "knot", "-o", "a.png", f"--decals={number}")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder that root cannot write to")
def test_a_folder_that_cannot_be_written(bad: Callable[..., str]) -> None:
    assert "cannot be written" in bad("render", "ball.ply", "-o", "/proc/a.png")
