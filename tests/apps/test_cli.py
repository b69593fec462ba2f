import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image

import blobtree
from blobtree import Point
from decals.errors import NoGraphics
from decals.scenes.camera import Camera
from decals.scenes.scene import Scene, TreeObject
from decals.scenes.scene_file import save_scene
from decals.window import EditWindow
from implicit_decals.apps.cli import run
from implicit_decals.apps.commands import demo as demo_module
from implicit_decals.apps.commands import render as render_module
from implicit_decals.apps.commands import view as view_module

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _small(*arguments: str) -> list[str]:
    return ["render", *arguments, "--decals", "30", "--size", "64x48", "--samples", "1"]


def _picture(path: Path) -> NDArray[np.uint8]:
    return np.asarray(Image.open(path))


# -- what works ---------------------------------------------------------------------------------------


def test_version(capsys: Capture) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.strip() == version("implicit-decals")


def test_help_names_the_commands_and_their_options(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    listing = capsys.readouterr().out
    assert all(name in listing for name in ("demo", "render", "seed", "polygonize", "doctor"))
    assert run(["render", "--help"]) == 0
    page = capsys.readouterr().out
    options = (
        "--decals",
        "--image",
        "--camera",
        "--size",
        "--seed",
        "--samples",
        "--save",
        "implicit-decals render knot",
    )
    assert all(option in page for option in options)


def test_seeds_as_rows_and_as_arrays(folder: Path) -> None:
    wish = ["seed", "spheres", "--count", "25", "--images", "3", "--seed", "4"]
    assert run([*wish, "-o", "seeds.json"]) == 0
    assert run([*wish, "-o", "seeds.csv"]) == 0
    arrays = json.loads((folder / "seeds.json").read_text())
    assert [len(arrays[name]) for name in ("positions", "normals", "tangents", "radii", "images")] == [25] * 5
    header, *rows = (folder / "seeds.csv").read_text().splitlines()
    assert header == "x,y,z,nx,ny,nz,tx,ty,tz,radius,image"
    table = np.array([row.split(",") for row in rows], float)
    assert np.allclose(table[:, :3], arrays["positions"], rtol=1e-6)
    assert table[:, 10].tolist() == arrays["images"]


def test_seeds_by_spacing_and_rule(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    rules = ["--spacing", "0.2", "--sizing", "touching", "--along", "cross", "--factor", "0.5"]
    assert run(["seed", "ball.ply", *rules, "-o", "seeds.json"]) == 0
    radii = np.array(json.loads((folder / "seeds.json").read_text())["radii"])
    assert len(radii) == pytest.approx(np.pi / (0.2**2 * np.sqrt(0.75)), abs=3)
    assert np.median(radii) == pytest.approx(0.25 * 0.2, rel=0.15)


def test_seeds_follow_a_painted_image(folder: Path) -> None:
    pv.Sphere(radius=0.5).save(folder / "ball.ply")
    Image.fromarray(np.uint8([[0, 255]]).repeat(8, axis=1)).save(folder / "half.png")
    wish = ["--count", "200", "--painted", "half.png", "--painted-along", "y", "--black", "0.25"]
    assert (
        run(["seed", "ball.ply", *wish, "--choice", "curvature", "--regularity", "0.6", "-o", "seeds.json"])
        == 0
    )
    places = np.array(json.loads((folder / "seeds.json").read_text())["positions"])
    assert (places[:, 2] < 0).sum() == pytest.approx(40, abs=4)  # seen from +y, z runs to the right


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        (["--regularity", "2", "-o", "a.json"], "regularity: expected a number from 0 to 1"),
        (["--painted", "none.png", "-o", "a.json"], "found no file"),
        (["--count", "5", "--spacing", "0.1", "-o", "a.json"], "--count or --spacing"),
        (["--count", "-1", "-o", "a.json"], "--count: expected"),
        (["--spacing", "0", "-o", "a.json"], "spacing: expected a length above 0"),
        (["-o", "a.png"], "expected an output file"),
    ],
)
def test_seeds_that_cannot_be(folder: Path, capsys: Capture, wish: list[str], says: str) -> None:
    assert run(["seed", "spheres", *wish]) == 2
    assert says in capsys.readouterr().err


def test_render_a_mesh_and_a_blob_together(folder: Path, capsys: Capture) -> None:
    pv.Sphere(radius=0.5, center=(1, 0, 0)).save(folder / "ball.ply")
    blobtree.save(Point((0, 0, 0), radius=0.6), folder / "blob.json")
    assert (
        run([*_small("ball.ply", "blob.json"), "--image", "rock", "--image", "tile", "-o", "both.png"]) == 0
    )
    picture = _picture(folder / "both.png")
    assert picture.shape == (48, 64, 4)
    middle, corner = picture[20:28, 24:40, :3].reshape(-1, 3), picture[0, 0, :3]
    assert np.abs(middle.astype(int) - corner).max(axis=1).mean() > 40
    progress = capsys.readouterr()
    assert "Drawing" in progress.err
    assert progress.out == ""


def test_the_same_seed_gives_the_same_picture_and_another_another(folder: Path) -> None:
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert run([*_small("spheres"), "--seed", seed, "-o", f"{name}.png"]) == 0
    pictures = [_picture(folder / f"{name}.png") for name in "abc"]
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[0], pictures[2])


def test_a_saved_scene_gives_the_same_picture(folder: Path) -> None:
    pv.Sphere().save(folder / "ball.stl")
    Image.new("RGB", (8, 8), (200, 30, 30)).save(folder / "red.png")
    models = ("ball.stl", "knot", "spheres")
    assert (
        run([*_small(*models), "--image", "red.png", "--image", "eye", "--save", "s.json", "-o", "a.png"])
        == 0
    )
    assert run(["render", "s.json", "--size", "64x48", "--samples", "1", "-o", "b.png"]) == 0
    assert np.array_equal(_picture(folder / "a.png"), _picture(folder / "b.png"))
    written = json.loads((folder / "s.json").read_text())
    assert [item.get("source") for item in written["objects"]] == ["ball.stl", "sample:knot", None]
    assert len(written["decals"]) == 30


def test_a_camera_for_a_saved_scene(folder: Path) -> None:
    assert run([*_small("spheres"), "--save", "s.json", "-o", "a.png"]) == 0
    assert run(["render", "s.json", "--size", "64x48", "--camera", "back", "-o", "b.png"]) == 0
    assert not np.array_equal(_picture(folder / "a.png"), _picture(folder / "b.png"))


@pytest.mark.parametrize("camera", ["top", "bottom", "left", "-1,0.5,2", "0,3,0"])
def test_cameras_see_the_model(folder: Path, camera: str) -> None:
    assert run([*_small("knot"), f"--camera={camera}", "-o", "a.png"]) == 0
    picture = _picture(folder / "a.png")[..., :3].astype(int)
    assert (np.abs(picture - picture[:, :1]).max(axis=-1) > 30).mean() > 0.1


def test_no_decals_at_all(folder: Path) -> None:
    assert run(["render", "spheres", "--decals", "0", "--size", "40x30", "-o", "a.jpg"]) == 0
    assert _picture(folder / "a.jpg").shape == (30, 40, 3)


def test_two_of_a_name_are_told_apart(folder: Path) -> None:
    assert run([*_small("knot", "knot"), "--save", "s.json", "-o", "a.png"]) == 0
    assert [item["name"] for item in json.loads((folder / "s.json").read_text())["objects"]] == [
        "knot",
        "knot-2",
    ]


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl", "vtp"])
def test_polygonize(folder: Path, suffix: str) -> None:
    blobtree.save(Point((1, 2, 3), radius=0.5, color=(1.0, 0.5, 0.0)), folder / "ball.json")
    assert run(["polygonize", "ball.json", "--resolution", "40", "-o", f"ball.{suffix}"]) == 0
    mesh = pv.read(folder / f"ball.{suffix}")
    assert np.allclose(np.linalg.norm(mesh.points - [1, 2, 3], axis=1), 0.5, atol=1e-3)
    assert mesh.triangulate().volume == pytest.approx(4 / 3 * np.pi * 0.125, rel=0.02)
    if suffix in ("ply", "vtp"):
        assert np.asarray(mesh["RGB"])[0].tolist() == [255, 128, 0]
    assert sorted(path.name for path in folder.iterdir()) == sorted(["ball.json", f"ball.{suffix}"])


def test_polygonize_by_cell_size(folder: Path) -> None:
    for cell, name in (("0.4", "coarse"), ("0.1", "fine")):
        assert run(["polygonize", "spheres", "--cell-size", cell, "-o", f"{name}.ply"]) == 0
    assert pv.read(folder / "fine.ply").n_cells > 8 * pv.read(folder / "coarse.ply").n_cells


def test_polygonize_by_chord_error_with_creases(folder: Path) -> None:
    cut = Point((0, 0, 0), radius=1.0) - Point((0.8, 0, 0), radius=0.9)
    blobtree.save(cut, folder / "cut.json")
    wish = ["polygonize", "cut.json", "--chord-error", "0.01"]
    assert run([*wish, "--creases", "-o", "closed.vtp"]) == 0
    assert run([*wish, "--split-normals", "-o", "split.vtp"]) == 0
    assert run(["polygonize", "cut.json", "--cells", "30", "--creases", "-o", "cells.stl"]) == 0
    closed, split = pv.read(folder / "closed.vtp"), pv.read(folder / "split.vtp")
    assert closed.is_manifold
    assert (closed["meetings"] == 2).sum() > 20
    assert split.n_points > closed.n_points
    assert split.n_cells == closed.n_cells
    assert pv.read(folder / "cells.stl").n_cells > 100


@pytest.mark.parametrize("stage", ["placing vertices", "writing"])
def test_an_interrupted_polygonize_leaves_no_file(
    folder: Path, stage: str, monkeypatch: pytest.MonkeyPatch, capfd: Capture
) -> None:
    """Control-C while it computes, or while the file is half written."""

    def report(_self: object, _task: object, **_state: object) -> None:
        raise KeyboardInterrupt

    def save(_self: object, path: Path, **_options: object) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    if stage == "writing":
        monkeypatch.setattr(pv.PolyData, "save", save)
    else:
        monkeypatch.setattr("rich.progress.Progress.update", report)
    before = sorted(folder.iterdir())
    assert run(["polygonize", "spheres", "-o", "half.ply"]) == 130
    assert sorted(folder.iterdir()) == before
    assert capfd.readouterr().err.split() == ["interrupted"]


def test_demo_draws_three_pictures(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr("implicit_decals.apps.models.hatching.COUNT", 120)
    assert run(["demo", "--size", "80x60", "--samples", "1"]) == 0
    names = capsys.readouterr().out.split()
    assert names == ["out/hero.png", "out/contact.png", "out/span.png"]
    for name in names:
        assert _picture(folder / name).shape == (60, 80, 4)


# -- what people get wrong ----------------------------------------------------------------------------


def _no_work(*_arguments: object, **_options: object) -> None:
    pytest.fail("the long work began before the input was checked")


@pytest.fixture
def bad(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> Callable[..., str]:
    """Run a command that must fail before any work, with one line and exit code 2; gives the line."""
    monkeypatch.setattr(render_module, "seed_decals", _no_work)
    monkeypatch.setattr(demo_module, "hatching", _no_work)
    pv.Sphere().save(folder / "ball.ply")

    def check(*arguments: str) -> str:
        assert run(arguments) == 2
        out, err = capfd.readouterr()
        assert out == ""
        assert "Traceback" not in err
        lines = err.strip().splitlines()
        assert len(lines) == 1
        assert lines[0].startswith("error: ")
        return lines[0]

    return check


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "nowhere.ply", "-o", "a.png"], "nowhere.ply"),
        (["render", "nowhere", "-o", "a.png"], "creature, dragon, horse, knot, spheres"),
        (["render", ".", "-o", "a.png"], "found no file"),
        (["render", "ball.ply"], "--output"),
        (["render", "-o", "a.png"], "MODEL"),
        (["render", "ball.ply", "-o", "nowhere/a.png"], "'nowhere' does not exist"),
        (["render", "ball.ply", "-o", "a.gif"], ".png"),
        (["render", "ball.ply", "-o", "a"], ".png"),
        (["render", "ball.ply", "-o", "."], "folder"),
        (["render", "ball.ply", "-o", "a.png", "--save", "nowhere/s.json"], "does not exist"),
        (["render", "ball.ply", "-o", "a.png", "--save", "s.txt"], ".json"),
        (["render", "ball.ply", "-o", "a.png", "--decals", "-1"], "--decals"),
        (["render", "ball.ply", "-o", "a.png", "--decals", "many"], "--decals"),
        (["render", "ball.ply", "-o", "a.png", "--decals", "99999999999"], "--decals"),
        (["render", "ball.ply", "-o", "a.png", "--seed", "-1"], "--seed"),
        (["render", "ball.ply", "-o", "a.png", "--samples", "0"], "--samples"),
        (["render", "ball.ply", "-o", "a.png", "--size", "0x10"], "--size"),
        (["render", "ball.ply", "-o", "a.png", "--size", "10"], "WIDTHxHEIGHT"),
        (["render", "ball.ply", "-o", "a.png", "--size", "99999x99999"], "16384"),
        (["render", "ball.ply", "-o", "a.png", "--camera", "up"], "three-quarter"),
        (["render", "ball.ply", "-o", "a.png", "--camera", "0,0,0"], "0,0,0"),
        (["render", "ball.ply", "-o", "a.png", "--camera", "1,nan,0"], "finite"),
        (["render", "ball.ply", "-o", "a.png", "--image", "nowhere.png"], "nowhere.png"),
        (["render", "ball.ply", "-o", "a.png", "--image", "ball.ply"], "ball.ply"),
        (["render", "ball.ply", "-o", "a.png", "--frobnicate"], "frobnicate"),
        (["polygonize", "ball.ply", "-o", "b.ply"], "BlobTree"),
        (["polygonize", "spheres", "-o", "b.txt"], ".ply"),
        (["polygonize", "spheres", "-o", "nowhere/b.ply"], "does not exist"),
        (["polygonize", "spheres", "-o", "b.ply", "--resolution", "0"], "resolution"),
        (["polygonize", "spheres", "-o", "b.ply", "--cell-size", "-1"], "cell_size"),
        (["polygonize", "spheres", "-o", "b.ply", "--cell-size", "1", "--resolution", "9"], "drop one"),
        (["polygonize", "spheres", "-o", "b.ply", "--chord-error", "1", "--cells", "9"], "drop the others"),
        (["polygonize", "spheres", "-o", "b.ply", "--chord-error", "-1"], "chord_error"),
        (["demo", "--size", "big"], "--size"),
        (["demo", "-o", "nowhere/deep"], "nowhere"),
        (["demo", "-o", "ball.ply"], "ball.ply"),
        (["frobnicate"], "frobnicate"),
    ],
)
def test_bad_arguments(bad: Callable[..., str], arguments: list[str], message: str) -> None:
    assert message in bad(*arguments)


def _obj(rows: str) -> bytes:
    return rows.replace("; ", "\n").encode() + b"\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("junk.stl", b"hello world\n" * 9, "junk.stl"),
        ("cut.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n", "cut.ply"),
        ("empty.obj", b"", "no faces"),
        ("cloud.obj", _obj("v 0 0 0; v 1 0 0; v 0 1 0"), "no faces"),
        ("nan.obj", _obj("v 0 0 0; v nan 0 0; v 0 1 0; f 1 2 3"), "nan.obj"),
        ("flat.obj", _obj("v 0 0 0; v 1 1 1; v 2 2 2; f 1 2 3"), "area"),
        ("out.obj", _obj("v 0 0 0; v 1 0 0; v 0 1 0; f 1 2 9"), "out.obj"),
        ("empty.json", b"", "empty.json"),
        ("list.json", b"[1, 2]", "list.json"),
        ("cut.json", b'{"format": "blobtree", "version": 1, "nodes": [{"type": "po', "cut.json"),
        (
            "cycle.json",
            b'{"format": "blobtree", "version": 1, "nodes": [{"type": "sum", "operands": [0]}]}',
            "cycle.json",
        ),
        (
            "radius.json",
            b'{"format": "blobtree", "version": 1, "nodes": '
            b'[{"type": "point", "center": [0, 0, 0], "radius": -1, "color": [1, 1, 1]}]}',
            "radius",
        ),
        ("scene.json", b'{"format": "implicit-decals-scene", "version": 1, "objects": 3}', "$.objects"),
        ("newer.json", b'{"format": "implicit-decals-scene", "version": 9}', "version 9"),
    ],
)
def test_bad_models(bad: Callable[..., str], name: str, content: bytes, message: str) -> None:
    Path(name).write_bytes(content)
    assert message in bad("render", name, "-o", "a.png")


def test_a_tree_without_a_surface_is_no_mesh(folder: Path, capfd: Capture) -> None:
    apart = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    blobtree.save(apart, folder / "nothing.json")
    assert run(["polygonize", "nothing.json", "-o", "a.ply"]) == 2
    assert capfd.readouterr().err.startswith("error: 'nothing.json' shows no surface")
    assert not (folder / "a.ply").exists()


def test_a_scene_brings_its_own_decals(bad: Callable[..., str], folder: Path) -> None:
    blob = TreeObject("blob", Point((0, 0, 0), radius=1))
    save_scene(Scene(objects=(blob,), camera=Camera((0, 0, 5))), folder / "s.json")
    assert "own decals" in bad("render", "s.json", "-o", "a.png", "--decals", "5")
    assert "render it alone" in bad("render", "s.json", "ball.ply", "-o", "a.png")
    assert "BlobTree" in bad("polygonize", "s.json", "-o", "a.ply")


def test_no_graphics(bad: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_options: object) -> None:
        raise NoGraphics("drawing needs libEGL.so.1; run: apt-get install libegl1")

    monkeypatch.setattr(render_module, "Renderer", fail)
    monkeypatch.setattr(demo_module, "Renderer", fail)
    assert "apt-get install" in bad("render", "ball.ply", "-o", "a.png")
    assert "apt-get install" in bad("demo")


def test_a_sample_that_cannot_be_downloaded(bad: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    def offline() -> None:
        raise ConnectionError("no network")

    monkeypatch.setattr("pyvista.examples.download_dragon", offline)
    line = bad("render", "dragon", "-o", "a.png")
    assert "PYVISTA_DATA" in line
    assert "internet" in line


@pytest.mark.parametrize("number", ["1.9", "1e3", "many", ""])
def test_a_fraction_is_no_count(bad: Callable[..., str], number: str) -> None:
    assert "whole number" in bad("render", "knot", "-o", "a.png", f"--decals={number}")


def test_a_path_that_no_file_can_have(bad: Callable[..., str]) -> None:
    assert "found no file" in bad("render", "a" * 5000 + ".ply", "-o", "a.png")


def test_a_wrong_data_folder_is_not_spoken_of_where_no_sample_is_fetched(tmp_path: Path) -> None:
    program = "from implicit_decals.apps.models.samples import sample; sample('knot')"
    environment = {**os.environ, "PYVISTA_DATA": str(tmp_path / "missing")}
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "PYVISTA_DATA" not in result.stderr


def test_interrupt(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    def interrupt(*_arguments: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(render_module, "seed_decals", interrupt)
    assert run([*_small("knot"), "-o", "a.png"]) == 130
    err = capfd.readouterr().err
    assert "interrupted" in err
    assert "Traceback" not in err
    assert list(folder.iterdir()) == []


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="wants a folder that not even root can write to")
def test_a_folder_that_cannot_be_written(bad: Callable[..., str]) -> None:
    assert "cannot be written" in bad("render", "ball.ply", "-o", "/proc/a.png")


def test_square_brackets_in_names_survive(bad: Callable[..., str]) -> None:
    assert "[bold]x[/].ply" in bad("render", "[bold]x[/].ply", "-o", "a.png")


def test_files_are_replaced_not_left_half(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "a.png").write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    assert run([*_small("knot"), "-o", "a.png"]) == 2
    assert (folder / "a.png").read_bytes() == b"old"
    assert [path.name for path in folder.iterdir()] == ["a.png"]


# -- the window ---------------------------------------------------------------------------------------


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> list[EditWindow]:
    """Windows that `view` opens, without a screen and closed at once."""
    opened: list[EditWindow] = []

    class Window(EditWindow):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, **options, off_screen=True)
            opened.append(self)

        @staticmethod
        def require_screen() -> None:
            pass

    monkeypatch.setattr(view_module, "EditWindow", Window)
    return opened


def test_view_opens_models_and_scenes(folder: Path, windows: list[EditWindow]) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    arguments = ["view", "ball.json", "--decals", "20", "--size", "80x60", "--save", "scene.json"]
    assert run(arguments) == 0
    assert len(windows[0].document.decals) == 20
    assert windows[0].actions.path == Path("scene.json")
    save_scene(windows[0].document.scene, folder / "scene.json")
    assert run(["view", "scene.json", "--size", "80x60"]) == 0
    assert len(windows[1].document.decals) == 20
    assert windows[1].actions.path == Path("scene.json")


def test_view_says_what_was_not_saved(
    folder: Path, windows: list[EditWindow], monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")

    def show(window: EditWindow) -> None:
        window.tools.key("a", 0, 0, ctrl=True)
        window.tools.key("d", 0, 0)

    monkeypatch.setattr(EditWindow, "show", show)
    assert run(["view", "ball.json", "--decals", "5", "--size", "80x60"]) == 0
    assert len(windows[0].document.decals) == 10
    assert "without saving" in capsys.readouterr().err


def test_view_says_what_is_wrong(folder: Path, windows: list[EditWindow], capsys: Capture) -> None:
    save_scene(Scene(objects=(), camera=Camera((0, 0, 1))), folder / "scene.json")
    for wrong, message in (
        (["view", "scene.json", "--decals", "3"], "brings its own decals"),
        (["view", "nothing.ply"], "nothing.ply"),
        (["view", "scene.json", "--size", "0x3"], "--size"),
        (["view", "scene.json", "--save", "scene.png"], "scene.png"),
    ):
        assert run(wrong) == 2
        assert message in capsys.readouterr().err
    assert windows == []


def test_view_wants_a_screen(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert run(["view", "knot"]) == 2
    assert "DISPLAY" in capsys.readouterr().err
