"""``implicit-decals sandbox`` without a browser: what it opens, and what it says."""

import sys
from pathlib import Path
from typing import Any

import pytest

import blobtree
from blobtree import Point
from decals.apps.cli import run
from decals.apps.commands import sandbox as sandbox_module
from decals.editing import recovery_path
from decals.editing.commands import AddImage
from decals.scenes.scene import DecalImage
from decals.window import EditWindow

Capture = pytest.CaptureFixture[str]


class Server:
    """Stands for trame's server: it ends at once."""

    port = 8123

    def __init__(self) -> None:
        self.controller = self
        self.on_server_ready = self
        self.ready: list[Any] = []
        self.options: dict[str, Any] = {}

    def add(self, call: Any) -> None:
        self.ready.append(call)

    def start(self, **options: Any) -> None:
        self.options = options
        for call in self.ready:
            call()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Server, EditWindow]]:
    """Return the list of servers and windows that `sandbox` opens."""
    pages: list[tuple[Server, EditWindow]] = []
    toolkit = (lambda *_, **__: Server()), lambda server, window, **_: pages.append((server, window))
    monkeypatch.setattr(sandbox_module, "_toolkit", lambda: toolkit)
    return pages


def test_the_sandbox_opens_models_and_serves_this_machine_only(
    folder: Path, opened: list[tuple[Server, EditWindow]], capsys: Capture
) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    assert run(["sandbox", "ball.json", "--decals", "20", "--port", "0", "--no-browser"]) == 0
    server, window = opened[0]
    assert len(window.document.decals) == 20
    assert window.actions.files.path == Path("ball-decals.json")
    assert (server.options["host"], server.options["port"]) == ("127.0.0.1", 0)
    assert server.options["open_browser"] is False
    assert "http://127.0.0.1:8123/" in capsys.readouterr().err


def test_unsaved_changes_are_kept(
    folder: Path, monkeypatch: pytest.MonkeyPatch, opened: list[tuple[Server, EditWindow]], capsys: Capture
) -> None:
    def edit(_server: Server, **_options: Any) -> None:
        opened[-1][1].session.do(AddImage(DecalImage.load("eye")))

    monkeypatch.setattr(Server, "start", edit)
    assert run(["sandbox"]) == 0
    assert recovery_path(folder / "scene.json").exists()
    assert "implicit-decals sandbox scene.json" in capsys.readouterr().err


def test_without_trame_a_line_says_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, "trame.app", None)
    assert run(["sandbox"]) == 2
    assert "pip install 'implicit-decals[browser]'" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--port", "70000"], ["--decals", "-1"], ["nothing.json"]])
def test_wrong_arguments_are_refused(
    arguments: list[str], folder: Path, opened: list[tuple[Server, EditWindow]], capsys: Capture
) -> None:
    assert run(["sandbox", *arguments]) == 2
    assert "error:" in capsys.readouterr().err
    assert opened == []
