"""``implicit-decals edit``, off screen."""

import sys
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import blobtree
from blobtree import Point
from decals import Camera, Contact, Scene, load_scene, save_scene
from decals.apps.cli import run
from decals.apps.commands import edit as edit_module
from decals.editing import recovery_path
from decals.window import EditWindow

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> list[EditWindow]:
    """Return the list of windows that `edit` opens, off screen and closed at once."""
    opened: list[EditWindow] = []

    class Window(EditWindow):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options, off_screen=True)
            opened.append(self)

        @staticmethod
        def require_screen() -> None:
            pass

    monkeypatch.setattr(edit_module, "EditWindow", Window)
    return opened


def test_edit_opens_models_and_scenes(folder: Path, windows: list[EditWindow]) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    arguments = ["edit", "ball.json", "--decals", "20", "--size", "80x60", "--save", "scene.json"]
    assert run(arguments) == 0
    assert len(windows[0].document.decals) == 20
    assert windows[0].actions.files.path == Path("scene.json")
    save_scene(windows[0].document.scene, folder / "scene.json")
    assert run(["edit", "scene.json", "--size", "80x60"]) == 0
    assert len(windows[1].document.decals) == 20
    assert windows[1].actions.files.path == Path("scene.json")


def test_models_are_saved_to_a_new_file(folder: Path, windows: list[EditWindow]) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    for path, taken in (("ball-decals.json", "ball-decals-2.json"), ("ball-decals-3.json", "")):
        assert run(["edit", "ball.json", "--decals", "0", "--size", "80x60"]) == 0
        assert windows[-1].actions.files.path == Path(path)
        for name in filter(None, (path, taken)):
            (folder / name).write_text("another file")


def press_in_windows(
    monkeypatch: pytest.MonkeyPatch, *keys: str, stop: type[BaseException] | None = None
) -> None:
    """Let windows receive some keys, and an exception, in place of a user's."""

    def show(window: EditWindow) -> None:
        for key in keys:
            window.tools.key(key[-1], 0, 0, ctrl=key.startswith("Ctrl+"))
        if stop is not None:
            raise stop

    monkeypatch.setattr(EditWindow, "show", show)


def test_without_a_model_an_empty_scene_opens(
    folder: Path, windows: list[EditWindow], monkeypatch: pytest.MonkeyPatch
) -> None:
    press_in_windows(monkeypatch, "n", "Ctrl+s")
    assert run(["edit", "--image", "eye", "--size", "80x60", "--contact", "radial"]) == 0
    document = windows[0].document
    assert (len(document.objects), len(document.decals)) == (0, 0)  # the ball was still being made
    assert [image.source for image in document.images] == ["eye"]
    assert windows[0].subplot.contact is Contact.RADIAL
    assert load_scene(folder / "scene.json").objects == ()
    assert run(["edit", "--size", "80x60"]) == 0
    assert windows[1].actions.files.path == Path("scene-2.json")


def test_images_are_added_to_a_saved_scene(folder: Path, windows: list[EditWindow]) -> None:
    save_scene(Scene(objects=(), camera=Camera((0, 0, 1))), folder / "scene.json")
    Image.new("RGB", (4, 4)).save(folder / "a.png")
    assert run(["edit", "scene.json", "--images", "a.png", "--image", "eye", "--size", "80x60"]) == 0
    assert [image.source for image in windows[0].document.images] == ["a.png", "eye"]
    assert windows[0].session.labels == ("add an image", "add an image")
    assert recovery_path(folder / "scene.json").exists()


def test_a_scene_that_was_never_saved_is_opened_from_its_recovery_file(
    folder: Path, windows: list[EditWindow], monkeypatch: pytest.MonkeyPatch
) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    arguments = ["edit", "ball.json", "--decals", "5", "--size", "80x60", "--save", "new.json"]
    press_in_windows(monkeypatch, "Ctrl+a", "d", stop=KeyboardInterrupt)
    assert run(arguments) == 130
    press_in_windows(monkeypatch)
    assert run(["edit", "new.json", "--size", "80x60"]) == 0
    assert len(windows[1].document.decals) == 10


def test_discarded_changes_are_reported(
    folder: Path, windows: list[EditWindow], monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    press_in_windows(monkeypatch, "Ctrl+a", "d", "q", "q")
    assert run(["edit", "ball.json", "--decals", "5", "--size", "80x60"]) == 0
    assert len(windows[0].document.decals) == 10
    assert "without saving" in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == ["ball.json"]


def test_unsaved_changes_are_kept_and_opened_by_the_next_edit(
    folder: Path, windows: list[EditWindow], monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    arguments = ["edit", "ball.json", "--decals", "5", "--size", "80x60"]
    press_in_windows(monkeypatch, "Ctrl+a", "d", stop=KeyboardInterrupt)
    assert run(arguments) == 130
    assert (folder / "ball-decals.recovery.json").is_file()
    assert "ball-decals.recovery.json" in capsys.readouterr().err
    press_in_windows(monkeypatch)
    assert run(arguments) == 0
    assert len(windows[1].document.decals) == 10
    assert windows[1].session.labels == ("recover unsaved changes",)
    assert "ball-decals.recovery.json" in windows[1].actions.state.message


def test_invalid_arguments(folder: Path, windows: list[EditWindow], capsys: Capture) -> None:
    save_scene(Scene(objects=(), camera=Camera((0, 0, 1))), folder / "scene.json")
    for wrong, message in (
        (["edit", "scene.json", "--decals", "3"], "has its own decals"),
        (["edit", "--decals", "3"], "name a model"),
        (["edit", "scene.json", "--image", "no.png"], "no.png"),
        (["edit", "nothing.ply"], "nothing.ply"),
        (["edit", "scene.json", "--size", "0x3"], "--size"),
        (["edit", "scene.json", "--save", "scene.png"], "scene.png"),
    ):
        assert run(wrong) == 2
        assert message in capsys.readouterr().err
    assert windows == []


def test_edit_needs_a_screen(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert run(["edit", "knot"]) == 2
    assert "DISPLAY" in capsys.readouterr().err
