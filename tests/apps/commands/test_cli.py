"""The command as a whole: version, help, interrupts."""

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest

from decals.apps.cli import run
from decals.apps.commands import options
from tests.apps.commands.pictures import small

Capture = pytest.CaptureFixture[str]


def test_version(capsys: Capture) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.strip() == version("implicit-decals")


def test_help_names_the_commands_and_their_options(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    listing = capsys.readouterr().out
    assert all(name in listing for name in ("demo", "render", "scatter", "polygonize", "doctor"))
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


def test_interrupt(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    def interrupt(*_arguments: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(options, "scatter", interrupt)
    assert run([*small("knot"), "-o", "a.png"]) == 130
    err = capfd.readouterr().err
    assert "interrupted" in err
    assert "Traceback" not in err
    assert list(folder.iterdir()) == []


def test_square_brackets_in_names_survive(bad: Callable[..., str]) -> None:
    assert "[bold]x[/].ply" in bad("render", "[bold]x[/].ply", "-o", "a.png")
