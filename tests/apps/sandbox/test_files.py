"""Files of the sandbox without a browser: the start page, opening, uploads, and what is written."""

import base64
import io
import os
import runpy
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import blobtree
import decals
from blobtree import Point, Segment
from decals import MeshObject, load_scene, save_scene
from decals.apps.models.samples import SAMPLES, sample
from decals.apps.models.scenes import empty_scene
from decals.apps.sandbox.folder import MAX_UPLOADS, listed, plain_name, read_upload, thumbnails
from decals.apps.sandbox.outline import PICTURE_SIZE
from decals.apps.sandbox.sandbox import Sandbox
from decals.editing import ScaleDecals
from decals.errors import ImplicitDecalsError
from decals.images.builtin import BUILTIN_IMAGES, generate_image
from decals.scenes.camera import UPRIGHT
from decals.window import EditWindow
from decals.window.host_plotter import pixels_of
from decals.window.view_modes import DisplayOptions
from tests.apps.sandbox.test_sandbox import covered, finish
from tests.decals.editing.scenes import box

BALL = Point((0, 0, 0), radius=1.0)


@pytest.fixture
def window(vtk_display: None, tmp_path: Path) -> Iterator[EditWindow]:
    with EditWindow(covered(), off_screen=True, size=(80, 60), path=tmp_path / "scene.json") as window:
        window.show()
        yield window


@pytest.fixture
def sandbox(window: EditWindow, tmp_path: Path) -> Sandbox:
    return Sandbox(window, folder=tmp_path, start=True)


def picture() -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.full((4, 5, 3), 77, np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()


def test_the_start_page_lists_samples_files_and_recovered_sessions(
    sandbox: Sandbox, window: EditWindow, tmp_path: Path
) -> None:
    blobtree.save(BALL, tmp_path / "ball.json")
    (tmp_path / "lost.recovery.json").write_text("{}")
    window.session.do(ScaleDecals([1], 2.0))
    shown = window.actions.files.recovery.keep()  # of this session, which goes on
    assert shown is not None
    assert shown.exists()
    (tmp_path / ".hidden.json").write_text("{}")
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "stone.stl").write_text("")
    start = sandbox.values()["start"]
    assert start["open"]
    assert set(start["samples"]) == set(SAMPLES) == set(thumbnails())
    sandbox.show_start(True)
    start = sandbox.values()["start"]
    assert {file["name"] for file in start["recent"]} == {"ball.json", "more/stone.stl"}
    assert [file["name"] for file in start["recovered"]] == ["lost.json"]
    sandbox.new_model()
    finish(window)
    values = sandbox.values()
    assert (values["start"]["open"], values["outline"][0]["kind"], values["done"]) == (False, "image", [])
    assert values["title"] == "scene-2.json"  # that of the former scene is for its unsaved changes
    assert listed(tmp_path / "none") == {"recent": [], "recovered": []}


def test_an_opened_model_fits_into_a_narrow_view_which_is_not_sliced(
    sandbox: Sandbox, window: EditWindow, tmp_path: Path
) -> None:
    blobtree.save(Segment((-2, 0, 0), (2, 0, 0), radius=0.3), tmp_path / "bar.json")
    window.plotter.window_size = (60, 120)
    sandbox.set_control("display", "slice", "y")
    sandbox.open_file("bar.json")
    finish(window)
    points, _ = window.document.objects[0].surface.sample(500, seed=1)
    pixels = pixels_of(window.subplot, points)
    assert (pixels > 0).all()
    assert (pixels < (60, 120)).all()
    assert np.ptp(pixels[:, 0]) > 40
    assert sandbox.display.options == DisplayOptions()


@pytest.mark.parametrize("name", ["saved", "lost"])
def test_a_scene_of_a_sample_is_opened_and_recovered(
    name: str, sandbox: Sandbox, window: EditWindow, tmp_path: Path
) -> None:
    scene = decals.cover(sample("knot"), count=3, images=["scale"])
    save_scene(scene, tmp_path / {"saved": "saved.json", "lost": "lost.recovery.json"}[name])
    sandbox.open_file(f"{name}.json")
    finish(window)
    assert [item.name for item in window.document.objects] == ["knot"], sandbox.status
    assert len(window.document.decals) == 3
    content = (tmp_path / "saved.json").read_bytes() if name == "saved" else b""
    sandbox.upload({"name": "again.json", "content": content})
    finish(window)
    assert window.session.title_of(window.actions.files.path) == ("again.json" if content else "*lost.json")


def test_a_sample_stands_upright(
    sandbox: Sandbox, window: EditWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    low = MeshObject("horse", *box((-1, -1, -1), (1, 1, 1)))
    monkeypatch.setattr("decals.apps.sandbox.files.sample", lambda _: low)
    monkeypatch.setattr("decals.apps.sandbox.files.cover", partial(decals.cover, count=3))
    sandbox.open_sample("horse")
    finish(window)
    assert window.document.camera.up == (0.0, 0.0, 1.0)
    assert window.actions.view.axes == UPRIGHT["z"]


def test_a_new_model_takes_the_file_that_was_named_for_it(vtk_display: None, tmp_path: Path) -> None:
    named = tmp_path / "mine.json"
    with EditWindow(empty_scene(["scale"], UPRIGHT["y"]), off_screen=True, path=named) as window:
        sandbox = Sandbox(window, folder=tmp_path, start=True)
        sandbox.new_model()
        finish(window)
        assert window.actions.files.path == named
        sandbox.add("Point")
        finish(window)
        sandbox.new_model()  # the file belongs to the edited scene
        finish(window)
        assert window.actions.files.path == tmp_path / "scene.json"


def test_a_model_is_opened_changed_saved_and_opened_again(
    sandbox: Sandbox, window: EditWindow, tmp_path: Path
) -> None:
    blobtree.save(BALL, tmp_path / "ball.json")
    sandbox.open_file("ball.json")
    finish(window)
    assert window.document.objects[0].tree == BALL  # type: ignore[union-attr]
    assert window.actions.files.path == tmp_path / "ball-decals.json"
    sandbox.add("Torus")
    finish(window)
    sandbox.write_file("mine.json")
    finish(window)
    tree = window.document.objects[0].tree  # type: ignore[union-attr]
    sandbox.new_model()
    finish(window)
    sandbox.open_file("mine.json")
    finish(window)
    assert window.document.objects[0].tree == tree  # type: ignore[union-attr]
    assert (sandbox.values()["title"], sandbox.values()["done"]) == ("mine.json", [])
    for name, ending in (("ball.png", b"\x89PNG"), ("ball.stl", None), ("ball.py", b'"""A scene')):
        sandbox.write_file(name)
        finish(window)
        written = (tmp_path / name).read_bytes()
        assert ending is None or written.startswith(ending), sandbox.status
        sandbox.write_file(name)
        assert "exists" in sandbox.status
    sandbox.select("0")
    sandbox.add("Point")
    finish(window)
    sandbox.write_file("large.png", size="64 x 48")
    finish(window)
    sandbox.write_file("steps.gif", size="32 x 24", video="session")
    finish(window)
    with Image.open(tmp_path / "large.png") as large, Image.open(tmp_path / "steps.gif") as steps:
        assert (large.size, steps.size, getattr(steps, "n_frames", 0)) == ((64, 48), (32, 24), 2)
    for size, video in (("0 x 5", "session"), ("9 x 9", "film"), ("9 x 9", "")):
        sandbox.write_file("wrong.gif", size=size, video=video)
        finish(window)
        assert "expected" in sandbox.status
    sandbox.perform("undo")
    assert runpy.run_path(str(tmp_path / "ball.py"))["scene"].objects[0].tree == tree


def test_a_recovered_session_is_opened(sandbox: Sandbox, window: EditWindow, tmp_path: Path) -> None:
    lost = decals.cover(BALL, count=3, images=["eye"])
    save_scene(lost, tmp_path / "lost.recovery.json")
    sandbox.open_file("lost.json")
    finish(window)
    assert len(window.document.decals) == 3
    assert sandbox.values()["done"] == ["recover unsaved changes"]
    window.session.do(ScaleDecals([window.document.decals.numbers[0]], 2.0))
    sandbox.perform("save")
    finish(window)
    assert load_scene(tmp_path / "lost.json").decals.radii[0] == 2 * lost.decals.radii[0]
    assert not (tmp_path / "lost.recovery.json").exists()


def test_dropped_files_are_added(sandbox: Sandbox, window: EditWindow, tmp_path: Path) -> None:
    blobtree.polygonize(BALL).save(tmp_path / "x.ply")
    blobtree.save(BALL, tmp_path / "ball.json")
    save_scene(decals.cover(BALL, count=3, images=["eye"]), tmp_path / "all.json")
    files = [
        {"name": "moss.png", "content": picture()},
        {"name": "../../x.ply", "content": (tmp_path / "x.ply").read_bytes()},
        {"name": "ball.json", "content": (tmp_path / "ball.json").read_bytes()},
    ]
    for file in files:
        sandbox.upload([file])
        finish(window)
    assert [item.name for item in window.document.objects][1:] == ["x", "ball"]
    assert window.document.images[-1].source == "moss"
    sandbox.upload([{"name": "all.json", "content": [(tmp_path / "all.json").read_bytes()]}])
    finish(window)
    assert len(window.document.decals) == 3
    assert sandbox.values()["title"] == "all-2.json"


def test_pictures_of_built_in_images_are_what_is_generated() -> None:
    pictures = thumbnails(".png")
    assert list(pictures) == list(BUILTIN_IMAGES)
    for name, url in pictures.items():
        start, _, data = url.partition(",")
        assert start == "data:image/png;base64"
        shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))).astype(int)
        assert np.abs(shown - generate_image(name, PICTURE_SIZE)).max() <= 1


def test_built_in_images_are_added(sandbox: Sandbox, window: EditWindow) -> None:
    for name in sandbox.catalog()["images"]:
        sandbox.add_built_in(name)
        assert window.document.images[-1].source == name
    before = window.document.images
    sandbox.add_built_in("../eye")
    assert "expected one of eye" in sandbox.status
    assert window.document.images is before


def test_a_picture_of_all_directions_lights_the_scene(
    sandbox: Sandbox, window: EditWindow, tmp_path: Path
) -> None:
    def panorama(level: int, size: tuple[int, int] = (8, 4)) -> bytes:
        buffer = io.BytesIO()
        Image.new("RGB", size, (level, 0, 0)).save(buffer, "PNG")
        return buffer.getvalue()

    def names() -> set[str]:
        shown = (control["name"] for control in sandbox.values()["drawing"])
        return {name for name in shown if name.startswith("environment.")}

    before = window.document.drawing
    sandbox.upload([{"name": "square.png", "content": panorama(9, (4, 4))}], "light")
    assert "twice as wide as high" in sandbox.status
    blobtree.save(BALL, tmp_path / "ball.json")
    sandbox.upload([{"name": "ball.json", "content": (tmp_path / "ball.json").read_bytes()}], "light")
    assert "environment: expected" in sandbox.status
    assert (window.document.drawing, names(), list(tmp_path.glob("*.png"))) == (before, set(), [])
    sandbox.set_control("display", "up", "z")
    sandbox.upload([{"name": "../sky.png", "content": panorama(255)}], "light")
    light = window.document.drawing.environment
    assert light is not None
    assert (light.picture.light[..., 0].min(), light.up) == (1.0, (0.0, 0.0, 1.0))
    assert names() == {"environment.rotation", "environment.strength", "environment.visible"}
    sandbox.set_control("drawing", "environment.rotation", 90)
    sandbox.upload([{"name": "sky.png", "content": panorama(255)}], "light")  # the file is there already
    assert window.document.drawing.environment == decals.rendering.Environment(
        light.picture, rotation=90.0, up=light.up
    )
    assert [path.name for path in tmp_path.glob("*.png")] == ["sky.png"]
    sandbox.write_file("lit.json")
    finish(window)
    assert '"picture":"sky.png"' in (tmp_path / "lit.json").read_text().replace(" ", "")
    loaded = load_scene(tmp_path / "lit.json").drawing.environment
    assert loaded == window.document.drawing.environment
    flat = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n" + bytes((128, 0, 0, 131)) * 2
    for name, content in (("Sky.HDR", flat), ("sky.png", panorama(0))):
        sandbox.upload([{"name": name, "content": content}], "" if content == flat else "light")
        assert window.document.drawing.environment != loaded
    assert len(window.document.images) == 1
    assert {path.name for path in tmp_path.glob("[sS]ky*")} == {"sky.png", "Sky.hdr", "sky 2.png"}
    sandbox.remove_light()
    assert not names()
    assert sandbox.values()["done"][-1] == "remove environment"
    sandbox.go_to(0)
    assert window.document.drawing == before


@pytest.mark.parametrize(
    "file",
    [
        None,
        3,
        {},
        {"name": "a.ply"},
        {"name": 3, "content": b""},
        {"name": "a.exe", "content": b"MZ"},
        {"name": "a.png", "content": b"no picture"},
        {"name": "a.json", "content": b"{"},
        {"name": "a.ply", "content": b"ply\nbroken"},
        {"name": ".json", "content": b"{}"},
    ],
)
def test_wrong_uploads_say_why(file: Any) -> None:
    with pytest.raises(ImplicitDecalsError) as error:
        read_upload(file)
    assert tempfile.gettempdir() not in str(error.value)


def test_too_many_files_at_once_are_refused(sandbox: Sandbox, window: EditWindow) -> None:
    sandbox.upload([{"name": "a.png", "content": b"x"}] * (MAX_UPLOADS + 1))
    assert "expected at most 32 files at once, got 33; drop fewer" in sandbox.status
    assert len(window.document.images) == 1


def test_names_of_uploads_become_plain_names() -> None:
    for name, plain in (
        ("../../sky.png", "sky"),
        ("..\\..\\sky.hdr", "sky"),
        ("con.png", "con-"),
        ("NUL.hdr", "NUL-"),
        ("com1.png", "com1-"),
        ("a\nb\x1b[31m.png", "a-b--31m"),
        ("\u202egnp.png", "-gnp"),
        (" ...png", "--"),
    ):
        assert plain_name(name) == plain, name
    assert len(plain_name("🦎a" * 500).encode()) <= 120
    assert len(plain_name("字" * 500).encode()) <= 120


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="links need rights of their own on Windows")
def test_a_link_that_comes_between_check_and_reading_is_not_followed(
    sandbox: Sandbox, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret = tmp_path.parent / f"{tmp_path.name} secret.ply"
    secret.write_bytes(b"secret")
    (tmp_path / "a.ply").write_bytes(b"plain")
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "b.ply").write_bytes(b"inner")
    assert (sandbox.read_file("a.ply", 0), sandbox.read_file("inner/b.ply", 0)) == (b"plain", b"inner")
    kept = sandbox._files._files.inside

    def swapped(name: Any) -> Path:
        path = kept(name)
        (tmp_path / "a.ply").unlink()
        (tmp_path / "a.ply").symlink_to(secret)
        return path

    monkeypatch.setattr(sandbox._files._files, "inside", swapped)
    assert sandbox.read_file("a.ply", 0) == b""
    assert "could not read a.ply" in sandbox.status


def test_pictures_too_large_for_the_memory_are_refused(
    sandbox: Sandbox, window: EditWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a.png", "a.jpg", "a.gif", "a.mp4"):
        for size in ("999999 x 999999", "671088 x 101", "16384 x 16384", "8192 x 8193"):
            sandbox.write_file(name, True, size)
            assert "size: expected at most 67,108,864 pixels, got " in sandbox.status
    monkeypatch.setattr("decals.editing.formats.MAX_GIF_PIXELS", 120 * 64 * 48 - 1)
    sandbox.write_file("a.gif", True, "64 x 48")
    finish(window)
    assert "pixels in all frames of a GIF file, got 120 x 64 x 48" in sandbox.status
    assert not [*tmp_path.iterdir()]


def test_written_files_are_read_in_parts(
    sandbox: Sandbox, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.apps.sandbox.files.PART_BYTES", 1000)
    content = bytes(range(256)) * 10
    for name in ("a.ply", "a.txt"):
        (tmp_path / name).write_bytes(content)
    parts = [sandbox.read_file(" a.ply", begin) for begin in (0, 1000, 2000, 2560)]
    assert [len(part) for part in parts] == [1000, 1000, 560, 0]
    assert b"".join(parts) == content
    refused: list[Any] = [
        ("a.ply", -1),
        ("a.ply", 2561),
        ("a.ply", "x"),
        ("b.ply", 0),
        ("a.txt", 0),
        (None, 0),
    ]
    for name, begin in refused:
        assert sandbox.read_file(name, begin) == b""
        assert "expected a" in sandbox.status, name


def test_files_outside_the_folder_are_neither_read_nor_written(
    sandbox: Sandbox, window: EditWindow, tmp_path: Path
) -> None:
    for name in ("../a.json", "/etc/passwd.json", "none.json", None, 3, "a.txt", ""):
        sandbox.open_file(name)  # type: ignore[arg-type]
        assert "expected a" in sandbox.status
    for name in ("../a.py", "/tmp/a.png", "no/such/a.png", None, "a.exe"):
        sandbox.write_file(name)  # type: ignore[arg-type]
        assert "expected a" in sandbox.status
    outside = tmp_path / "outside"
    folder = outside / "folder"
    folder.mkdir(parents=True)
    sandbox = Sandbox(window, folder=folder)
    blobtree.save(BALL, outside / "ball.json")
    save_scene(decals.cover(BALL, count=3, images=["eye"]), outside / "lost.recovery.json")
    (folder / "link").symlink_to(outside)
    (folder / "ball.json").symlink_to(outside / "ball.json")
    (folder / "lost.recovery.json").symlink_to(outside / "lost.recovery.json")
    before = (outside / "ball.json").read_bytes()
    for name in ("ball.json", "link/ball.json", "link/../ball.json", "lost.json", str(outside / "ball.json")):
        sandbox.open_file(name)
        finish(window)
        assert "inside" in sandbox.status, name
    for name in (
        "ball.json",
        "link/ball.ply",
        "link/a.png",
        f"{outside}/a.py",
        "a.json/../../a.json",
        "a\0.png",
    ):
        sandbox.write_file(name, True)
        finish(window)
        assert "inside" in sandbox.status, name
        assert (sandbox.read_file(name, 0), "inside" in sandbox.status) == (b"", True), name
    assert (outside / "ball.json").read_bytes() == before
    assert {path.name for path in outside.iterdir()} == {"ball.json", "folder", "lost.recovery.json"}
    assert {path.name for path in folder.iterdir()} == {"ball.json", "link", "lost.recovery.json"}
    assert listed(folder) == {"recent": [], "recovered": []}
    sandbox.open_sample("../knot")
    assert "expected one of" in sandbox.status
    assert len(window.document.decals) == 20
    assert [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")] == ["outside"]
