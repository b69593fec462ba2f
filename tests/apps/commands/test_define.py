"""``--define``: a user's own kinds of nodes on the command line."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from implicit_decals.apps.cli import run

Capture = pytest.CaptureFixture[str]

DOTS = """\
import warp as wp
from blobtree import define_skeleton, save
{imports}

def far_dot(q: wp.vec3, place: wp.vec3) -> wp.vec3:
    return place


FarDot = define_skeleton(far_dot, convex=True)
if __name__ == "__main__":
    save(FarDot((3.0, 0.0, 0.0), radius=0.5), "dot.json")
"""


def alone(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own: definitions live as long as theirs."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )


CLI = ("-c", "import sys; from implicit_decals.apps.cli import run; sys.exit(run(sys.argv[1:]))")


@pytest.fixture
def dots(folder: Path) -> Path:
    """A folder with a definition, and a tree that uses it."""
    (folder / "dots.py").write_text(DOTS.format(imports=""), encoding="utf-8")
    made = alone(folder, "dots.py")
    assert made.returncode == 0, made.stderr
    return folder


def test_a_file_or_a_module_brings_its_kinds(dots: Path) -> None:
    wish = [*CLI, "polygonize", "dot.json", "--cells", "12", "-o", "dot.ply"]
    lacking = alone(dots, *wish)
    assert lacking.returncode == 2
    assert "own kind 'far_dot' is not defined" in lacking.stderr
    assert "--define" in lacking.stderr
    for module in ("dots.py", "dots", str(dots / "dots.py")):
        done = alone(dots, *wish, "--define", module)
        assert done.returncode == 0, done.stderr
        mesh = pv.read(dots / "dot.ply")
        assert np.allclose(np.linalg.norm(mesh.points - [3, 0, 0], axis=1), 0.5, atol=1e-3)
        (dots / "dot.ply").unlink()


def test_what_is_defined_can_be_seeded_and_files_may_import_their_neighbours(dots: Path) -> None:
    (dots / "parts").mkdir()
    (dots / "parts" / "near.py").write_text("REACH = 1\n", encoding="utf-8")
    (dots / "parts" / "more.py").write_text(DOTS.format(imports="import near"), encoding="utf-8")
    wish = ["seed", "dot.json", "--count", "40", "--define", "parts/more.py", "-o", "seeds.csv"]
    done = alone(dots, *CLI, *wish)
    assert done.returncode == 0, done.stderr
    rows = np.loadtxt(dots / "seeds.csv", delimiter=",", skiprows=1)
    assert np.allclose(np.linalg.norm(rows[:, :3] - [3, 0, 0], axis=1), 0.5, atol=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1 / 0\n", "wrong.py:1: ZeroDivisionError: division by zero"),
        ("def f(:\n", "SyntaxError"),
        ("raise SystemExit(3)\n", "SystemExit: 3"),
        ("import nosuchmodule\n", "No module named 'nosuchmodule'"),
        ("from blobtree import define_skeleton\ndefine_skeleton(5)\n", "wrong.py:2: InvalidDefinition"),
    ],
)
@pytest.mark.parametrize("command", ["polygonize", "seed", "render"])
def test_a_module_that_fails_is_named_with_file_and_line(
    bad, folder: Path, monkeypatch: pytest.MonkeyPatch, command: str, text: str, message: str
) -> None:
    monkeypatch.setattr(sys, "path", sys.path[:])
    (folder / "wrong.py").write_text(text, encoding="utf-8")
    output = {"polygonize": "x.ply", "seed": "x.csv", "render": "x.png"}[command]
    line = bad(command, "spheres", "--define", "wrong.py", "-o", output)
    assert "--define wrong.py: " in line
    assert message in line
    assert "wrong" not in sys.modules


def test_what_is_not_there_is_named(folder: Path, capfd: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", sys.path[:])
    for module, message in (("gone.py", "found no 'gone.py'"), ("gone.away", "No module named 'gone'")):
        assert run(["polygonize", "spheres", "--define", module, "-o", "x.ply"]) == 2
        assert message in capfd.readouterr().err
    assert not list(folder.iterdir())
