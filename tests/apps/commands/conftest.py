"""An empty folder to work in, and commands that must fail before any work."""

from collections.abc import Callable
from pathlib import Path

import pytest
import pyvista as pv

from decals.apps.cli import run
from decals.apps.commands import demo as demo_module
from decals.apps.commands import scatter_options

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _no_work(*_arguments: object, **_options: object) -> None:
    pytest.fail("the long work began before the input was checked")


@pytest.fixture
def bad(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> Callable[..., str]:
    """Run a command that must fail before any work, with one line and exit code 2; gives the line."""
    monkeypatch.setattr(scatter_options, "scatter", _no_work)
    monkeypatch.setattr(demo_module, "nest_scene", _no_work)
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
