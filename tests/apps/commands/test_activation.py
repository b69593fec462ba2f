"""The lines that the demo prints work in a fresh shell as they are printed."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path, PurePath

import pytest

from decals.apps.cli import app, run
from decals.apps.commands import activation
from decals.apps.commands import demo as demo_module
from decals.apps.commands.activation import command_lines, find_shell
from decals.apps.gallery import spanning
from decals.errors import NoGraphics
from decals.rendering import Renderer

Capture = pytest.CaptureFixture[str]

SCRIPTS = Path(sys.executable).parent
PLAIN = "/usr/local/bin:/usr/bin:/bin"
"""A PATH without the environment of the tests."""


def in_fresh_shell(shell: str, lines: Sequence[str], folder: Path) -> str:
    """Type lines in a shell that knows no environment; return what they print."""
    found = shutil.which(shell, path=PLAIN)
    if found is None:
        pytest.skip(f"{shell} is not installed")
    kept = {name: os.environ[name] for name in ("WARP_CACHE_PATH", "PYVISTA_DATA") if name in os.environ}
    environment = {"PATH": PLAIN, "HOME": str(folder), **kept}
    script = "\n".join(["set -e" if shell != "fish" else "", *lines, ""])
    ran = subprocess.run(
        [found], input=script, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.fixture
def plain_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the environment off the PATH."""
    monkeypatch.setenv("PATH", PLAIN)
    monkeypatch.setattr(sys, "argv", ["pytest"])


@pytest.mark.usefixtures("plain_path")
@pytest.mark.parametrize(
    ("shell", "kind"), [("sh", "sh"), ("bash", "sh"), ("zsh", "sh"), ("fish", "fish"), ("tcsh", "csh")]
)
def test_the_lines_run_in_a_fresh_shell(
    folder: Path, monkeypatch: pytest.MonkeyPatch, shell: str, kind: str
) -> None:
    if not (SCRIPTS / "activate").is_file():
        pytest.skip("the tests run outside a virtual environment")
    monkeypatch.setattr(activation, "find_shell", lambda *_, **__: kind)
    lines = command_lines(["--version"])
    assert lines[1] == "implicit-decals --version"
    assert in_fresh_shell(shell, lines, folder).strip() == version("implicit-decals")


@pytest.mark.usefixtures("plain_path")
def test_without_an_activation_script_the_path_of_python_is_typed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "prefix", str(folder))
    (line,) = command_lines(["--version"])
    assert in_fresh_shell("sh", [line], folder).strip() == version("implicit-decals")


def test_nothing_is_activated_if_the_shell_finds_the_program(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", f"{SCRIPTS}{os.pathsep}{PLAIN}")
    assert command_lines(["gallery"]) == ["implicit-decals gallery"]
    other = folder / "implicit-decals"
    other.write_text("#!/bin/sh\n")
    other.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))  # that of another environment
    monkeypatch.setattr(sys, "argv", ["pytest"])
    assert len(command_lines(["gallery"])) == 2 or "-m decals" in command_lines(["gallery"])[0]
    monkeypatch.setattr(sys, "argv", [str(other)])  # the one that was called
    assert command_lines(["gallery"]) == ["implicit-decals gallery"]


@pytest.mark.usefixtures("plain_path")
@pytest.mark.parametrize(
    ("kind", "script", "line"),
    [
        ("fish", "bin/activate.fish", "source '{}'"),
        ("csh", "bin/activate.csh", "source '{}'"),
        ("pwsh", "bin/Activate.ps1", "& '{}'"),
        ("powershell", "Scripts/Activate.ps1", '& "{}"'),
        ("cmd", "Scripts/activate.bat", '"{}"'),
        ("sh on Windows", "Scripts/activate", ". '{}'"),
    ],
)
def test_the_line_of_each_shell(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str, script: str, line: str
) -> None:
    monkeypatch.setattr(activation, "find_shell", lambda *_, **__: kind)
    for name in (".venv", "my venv"):
        path = PurePath(name, script)
        (folder / path).parent.mkdir(parents=True)
        (folder / path).touch()
        monkeypatch.setattr(sys, "prefix", str(folder / name))
        expected = line.format(path) if " " in name else line.replace("'", "").replace('"', "").format(path)
        assert command_lines(["gallery"]) == [expected, "implicit-decals gallery"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize(("name", "kind"), [("fish", "fish"), ("tcsh", "csh"), ("bash", "sh"), ("zsh", "sh")])
def test_the_calling_shell_is_that_of_the_nearest_ancestor(folder: Path, name: str, kind: str) -> None:
    """A copy of sh under the shell's name, with a plain sh between it and the program, as in make."""
    shutil.copy("/bin/sh", folder / name)
    script = (
        "import os; from decals.apps.commands.activation import find_shell; "
        "print(find_shell(os.environ, windows=False))"
    )
    command = f"""sh -c '"{sys.executable}" -c "{script}"; true'; true"""
    ran = subprocess.run([folder / name, "-c", command], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == kind


def test_the_login_shell_counts_where_processes_are_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(activation, "_ancestors", list)
    assert find_shell({"SHELL": "/opt/homebrew/bin/fish"}, windows=False) == "fish"
    assert find_shell({}, windows=False) == "sh"


@pytest.mark.parametrize(
    ("environment", "kind"),
    [
        ({"PROMPT": "$P$G"}, "cmd"),
        ({"PSModulePath": r"c:\users\Ann\Documents\PowerShell\Modules;C:\Windows"}, "powershell"),
        ({"PROMPT": "$P$G", "PSModulePath": r"C:\Users\ann\Documents\PowerShell\Modules"}, None),
        ({"PSModulePath": r"C:\Windows\system32"}, None),
        ({"MSYSTEM": "MINGW64"}, "sh on Windows"),
    ],
    ids=["cmd", "powershell", "nested", "neither", "git-bash"],
)
def test_shells_of_windows(environment: dict[str, str], kind: str | None) -> None:
    assert find_shell({"USERPROFILE": r"C:\Users\Ann", **environment}, windows=True) == kind


def printed_lines(err: str) -> list[str]:
    """Return the lines that the demo prints at its end."""
    return re.findall(r"^  (\S.*)$", err.partition("Next, type in this shell:")[2], re.MULTILINE)


@pytest.fixture
def ended_demo(
    folder: Path, monkeypatch: pytest.MonkeyPatch, plain_path: None, renderer: Renderer, capsys: Capture
) -> Callable[[], list[str]]:
    """Run a small demo; gives its last lines."""
    monkeypatch.setattr(demo_module, "COUNT", 60)
    monkeypatch.setattr(demo_module, "nest_scene", lambda progress: spanning.scene(fov=27.0))

    def lines() -> list[str]:
        assert run(["demo", "--size", "40x30", "--samples", "1"]) == 0
        return printed_lines(capsys.readouterr().err)

    return lines


def test_the_demo_ends_with_commands_that_are_valid(
    ended_demo: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo_module, "require_screen", lambda: None)
    commands = [line.partition("implicit-decals ")[2] for line in ended_demo()]
    assert {line.split()[0] for line in commands if line} == {"gallery", "render", "edit"}
    for line in filter(None, commands):
        app.parse_args(line.split(), print_error=False, exit_on_error=False)


@pytest.mark.slow
def test_the_last_lines_of_the_demo_run_in_a_fresh_shell(
    ended_demo: Callable[[], list[str]], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise NoGraphics("no screen")

    monkeypatch.setattr(demo_module, "require_screen", fail)
    lines = ended_demo()
    assert not any(" edit " in line for line in lines)
    out = in_fresh_shell("sh", lines, folder)
    assert "A decal on a plane and on a sphere" in out
    assert (folder / "knot.png").stat().st_size > 10_000
