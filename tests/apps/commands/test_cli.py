"""The command as a whole: version, help, interrupts."""

import gc
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest

from decals.apps import cli
from decals.apps.cli import run
from decals.apps.commands import scatter_options
from tests.apps.commands.pictures import small
from tests.programs import run_python

Capture = pytest.CaptureFixture[str]


def test_version(capsys: Capture) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.strip() == version("implicit-decals")


def test_the_package_runs_as_the_command() -> None:
    programs = ("-m", "decals"), ("-m", "decals.apps.cli"), ("-c", "from decals.apps.cli import main; main()")
    ran = [run_python(*program, "--help") for program in programs]
    assert "Usage: implicit-decals" in ran[0]
    assert ran[0] == ran[1] == ran[2]


def test_help_version_and_gallery_import_nothing_heavy() -> None:
    script = """
import sys
import warnings
from decals.apps import cli
from decals.apps.cli import run
run(sys.argv[1:])
print({"numpy", "warp", "vtkmodules", "pyvista", "moderngl"} & set(sys.modules), file=sys.stderr)
"""
    for word in ("--help", "--version", "gallery"):
        command = [sys.executable, "-c", script, word]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stderr == "set()\n"


def test_bash_completes_commands_options_and_values(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    monkeypatch.setenv("HOME", str(folder))
    assert run(["--install-completion", "--shell", "bash"]) == 0
    assert str(folder / ".bashrc") in capsys.readouterr().out

    def complete(*words: str) -> set[str]:
        typed = " ".join(f"'{word}'" for word in words)
        script = f"""
. ~/.bashrc
COMP_WORDS=({typed}) COMP_CWORD={len(words) - 1}
$(complete -p implicit-decals | sed 's/.*-F \\([^ ]*\\).*/\\1/')
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
        done = subprocess.run([bash, "-c", script], capture_output=True, text=True, check=True)
        return set(done.stdout.split())

    assert complete("implicit-decals", "re") == {"render", "report", "reproduce"}
    assert complete("implicit-decals", "render", "--ca") == {"--camera"}
    assert complete("implicit-decals", "render", "--contact", "") == {"product", "min", "radial", "elastic"}
    assert complete("implicit-decals", "gallery", "sp") == {"sphere", "spanning"}


def test_help_names_the_commands_and_their_options(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    listing = capsys.readouterr().out
    assert all(
        name in listing
        for name in ("demo", "render", "scatter", "polygonize", "gallery", "doctor", "--install-completion")
    )
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

    monkeypatch.setattr(scatter_options, "scatter", interrupt)
    assert run([*small("knot"), "-o", "a.png"]) == 130
    err = capfd.readouterr().err
    assert "interrupted" in err
    assert "Traceback" not in err
    assert list(folder.iterdir()) == []


def test_square_brackets_in_names_survive(bad: Callable[..., str]) -> None:
    assert "[bold]x[/].ply" in bad("render", "[bold]x[/].ply", "-o", "a.png")


def test_warnings_are_one_line(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(cli, "run", lambda: warnings.warn("plain samples\nare [drawn]", stacklevel=2))
    for name in ("freeze", "set_threshold"):
        monkeypatch.setattr(gc, name, lambda *_: None)
    with warnings.catch_warnings(action="always"), pytest.raises(SystemExit):
        cli.main()
    assert capsys.readouterr().err == "warning: plain samples are [drawn]\n"
