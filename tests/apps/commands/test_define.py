"""``--define``: custom nodes on the command line."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray

from decals.apps.cli import run

Capture = pytest.CaptureFixture[str]

DOTS = """\
import warp as wp
from blobtree import save
from blobtree.custom import define_skeleton
{imports}

def far_dot(q: wp.vec3, center: wp.vec3) -> wp.vec3:
    return center


FarDot = define_skeleton(far_dot, convex=True)
if __name__ == "__main__":
    save(FarDot((3.0, 0.0, 0.0), radius=0.5), "dot.json")
"""


def alone(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python in another process, as definitions last as long as their process."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )


CLI = ("-c", "import sys; from decals.apps.cli import run; sys.exit(run(sys.argv[1:]))")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a definition, and a tree that uses it."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "dots.py").write_text(DOTS.format(imports=""), encoding="utf-8")
    process = alone(folder, "dots.py")
    assert process.returncode == 0, process.stderr
    return folder


@pytest.fixture
def dots(made: Path, folder: Path) -> Path:
    """Return a copy of that folder, in which the test works."""
    shutil.copytree(made, folder, dirs_exist_ok=True)
    return folder


def test_a_missing_definition_is_named(dots: Path, capfd: Capture) -> None:
    assert run(["polygonize", "dot.json", "-o", "dot.ply"]) == 2
    error = capfd.readouterr().err
    assert "'far_dot' is not defined" in error
    assert "--define" in error


def with_definitions(folder: Path, module: str, *command: str) -> None:
    """Run a command on the tree with a definition."""
    process = alone(folder, *CLI, command[0], "dot.json", "--define", module, *command[1:])
    assert process.returncode == 0, process.stderr


def assert_on_the_dot(points: NDArray[np.float64]) -> None:
    assert np.allclose(np.linalg.norm(points - [3, 0, 0], axis=1), 0.5, atol=1e-3)


@pytest.mark.slow
def test_a_module_defines_kinds(dots: Path) -> None:
    with_definitions(dots, "dots", "scatter", "--count", "40", "-o", "decals.csv")
    assert_on_the_dot(np.loadtxt(dots / "decals.csv", delimiter=",", skiprows=1)[:, :3])


@pytest.fixture
def parts(dots: Path) -> str:
    """Return the path of a definition that imports its neighbour."""
    (dots / "parts").mkdir()
    (dots / "parts" / "near.py").write_text("REACH = 1\n", encoding="utf-8")
    (dots / "parts" / "more.py").write_text(DOTS.format(imports="import near"), encoding="utf-8")
    return str(dots / "parts" / "more.py")


def test_a_file_defines_kinds_for_the_models_of_a_command(
    parts: str, capfd: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.setattr(sys, "modules", sys.modules.copy())
    assert run(["measure", "dot.json", "--define", parts]) == 2
    assert "expected a saved scene in JSON, got the model 'dot.json'" in capfd.readouterr().err


@pytest.mark.slow
def test_a_file_defines_kinds_and_imports_its_neighbours(dots: Path, parts: str) -> None:
    with_definitions(dots, parts, "polygonize", "--resolution", "12", "-o", "dot.ply")
    assert_on_the_dot(np.asarray(pv.read(dots / "dot.ply").points, np.float64))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1 / 0\n", "wrong.py:1: ZeroDivisionError: division by zero"),
        ("def f(:\n", "SyntaxError"),
        ("raise SystemExit(3)\n", "SystemExit: 3"),
        ("import nosuchmodule\n", "No module named 'nosuchmodule'"),
        (
            "from blobtree.custom import define_skeleton\ndefine_skeleton(5)\n",
            "wrong.py:2: InvalidDefinition",
        ),
    ],
)
@pytest.mark.parametrize("command", ["polygonize", "scatter", "render"])
def test_a_failing_module_is_named_with_file_and_line(
    bad: Callable[..., str],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    text: str,
    message: str,
) -> None:
    monkeypatch.setattr(sys, "path", sys.path[:])
    (folder / "wrong.py").write_text(text, encoding="utf-8")
    output = {"polygonize": "x.ply", "scatter": "x.csv", "render": "x.png"}[command]
    line = bad(command, "spheres", "--define", "wrong.py", "-o", output)
    assert "--define wrong.py: " in line
    assert message in line
    assert "wrong" not in sys.modules


def test_missing_modules_are_named(folder: Path, capfd: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", sys.path[:])
    wanted = "expected a Python file (.py) or the name of a module, got 'gone.away' (No module named 'gone')"
    for module, message in (("gone.py", "found no file 'gone.py'"), ("gone.away", wanted)):
        assert run(["polygonize", "spheres", "--define", module, "-o", "x.ply"]) == 2
        assert message in capfd.readouterr().err
    assert not list(folder.iterdir())
