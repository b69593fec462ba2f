"""Scripts that use the public API import little and write nothing to stderr, also without a CUDA driver."""

import subprocess
import sys

import pytest

from tests.programs import output_of

SCRIPTS = {
    "values": "from blobtree import Point; Point((0, 0, 0), radius=1.0).gradient([[0.0, 0.0, 0.0]])",
    "mesh": "from blobtree import Point, polygonize; polygonize(Point((0, 0, 0), radius=1.0), resolution=8)",
    "index": "import decals; decals.index.DecalIndex.of(decals.Decals.empty())",
    "editor": "import decals; decals.index.DecalEditor(decals.Decals.empty())",
    "mesh surface": """
import numpy as np, decals
vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
decals.scatter(decals.surfaces.MeshSurface(vertices, np.array([[0, 1, 2]], np.int32)), count=5)
""",
}


PROGRAM = """
import logging, os, sys
import blobtree, decals
logging.getLogger("blobtree.progress").setLevel(logging.WARNING)  # on a busy machine it would be shown
for script in sys.argv[1:]:
    child = os.fork() if hasattr(os, "fork") else 0
    if child:
        assert os.waitpid(child, 0)[1] == 0, script
    else:
        exec(script, {})
        if hasattr(os, "fork"):
            break  # it ends as every process does
"""
"""Runs each script in a fork of its own, in which Warp has not been started."""


@pytest.mark.parametrize(
    "names",
    [("mesh", "mesh surface"), pytest.param(("values", "index", "editor"), marks=pytest.mark.slow)],
    ids=" ".join,
)
def test_warp_starts_without_a_warning(names: tuple[str, ...]) -> None:
    scripts = [SCRIPTS[name] for name in names]
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, *scripts], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


def test_imports_leave_slow_packages_and_the_collector_alone() -> None:
    script = """
import atexit, gc, sys
before = gc.get_threshold()
atexit.register(lambda: print(gc.get_freeze_count() == 0, gc.get_threshold() == before))  # runs last
from decals import cover
print(gc.isenabled(), sorted({name.partition(".")[0] for name in sys.modules} & {"scipy", "pyvista", "vtk"}))
gc.disable()
from decals import render
print(gc.isenabled())
"""
    assert output_of(script).splitlines() == ["True []", "False", "True True"]
