"""``implicit-decals gallery``."""

import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from decals.apps import gallery
from decals.apps.cli import run
from decals.apps.gallery import sphere
from decals.apps.gallery.helpers import draw
from decals.errors import InvalidInput
from decals.rendering import Renderer
from tests.apps.commands.pictures import picture

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def two_examples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave two quick examples."""
    monkeypatch.setattr(gallery, "EXAMPLES", ("sphere", "touching"))


def test_the_list_has_a_line_for_each_example(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    assert run(["gallery"]) == 0
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()]
    assert [name for name, _ in lines] == list(gallery.EXAMPLES)
    titles = {name: text.strip() for name, text in lines}
    assert titles["sphere"] == "A decal on a plane and on a sphere"
    assert all("downloads" in titles[name] for name in gallery.DOWNLOADED)
    for name in gallery.EXAMPLES:
        docstring = import_module(f"{gallery.__name__}.{name}").__doc__
        assert docstring is not None
        assert titles[name].startswith(docstring.splitlines()[0])


def test_an_example_is_drawn(renderer: Renderer, folder: Path, capsys: Capture) -> None:
    assert run(["gallery", "sphere", "-o", "ball.png", "--side", "40"]) == 0
    assert capsys.readouterr().out.split() == ["ball.png"]
    drawn = picture(folder / "ball.png")
    assert np.array_equal(drawn, draw(renderer, sphere.panels(), side=40))
    assert run(["gallery", "sphere", "--side", "16"]) == 0
    assert picture(folder / "sphere.png").shape == (16, 36, 4)


@pytest.mark.usefixtures("two_examples", "renderer")
def test_all_examples_are_drawn(folder: Path, capsys: Capture) -> None:
    assert run(["gallery", "--all", "-o", "pictures", "--side", "16"]) == 0
    names = ["pictures/sphere.png", "pictures/touching.png"]
    assert capsys.readouterr().out.split() == names
    assert all(picture(folder / name).std() > 20 for name in names)


@pytest.mark.usefixtures("two_examples", "renderer")
def test_the_others_are_drawn_if_a_download_fails(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def fail() -> None:
        raise InvalidInput("no network")

    monkeypatch.setattr(sphere, "panels", fail)
    assert run(["gallery", "--all", "--side", "16"]) == 2
    out, err = capsys.readouterr()
    assert out.split() == ["gallery/touching.png"]
    assert "could not draw sphere: no network" in " ".join(err.split())
    assert [path.name for path in (folder / "gallery").iterdir()] == ["touching.png"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("spheer",), "sphere"),
        (("sphere", "--all"), "leave out 'sphere' or --all"),
        (("sphere", "-o", "sphere.txt"), "sphere.txt"),
        (("sphere", "--side", "0"), "--side"),
        (("-o", "sphere.png"), "--all"),
        (("--all", "-o", "no/folder"), "no/folder"),
    ],
    ids=["name", "both", "suffix", "side", "neither", "folder"],
)
def test_wrong_arguments(bad: Callable[..., str], arguments: tuple[str, ...], message: str) -> None:
    assert message in bad("gallery", *arguments)


def test_the_list_is_printed_by_the_module_too() -> None:
    command_line = [sys.executable, "-m", "decals", "gallery"]
    ran = subprocess.run(command_line, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert len(ran.stdout.splitlines()) == len(gallery.EXAMPLES)


@pytest.mark.usefixtures("two_examples")
def test_an_interrupt_leaves_no_empty_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        assert (folder / "pictures").is_dir()
        raise KeyboardInterrupt

    monkeypatch.setattr(sphere, "panels", interrupted)
    assert run(["gallery", "--all", "-o", "pictures", "--side", "16"]) not in (0, 2)
    assert not list(folder.iterdir())
