"""Scripts that use the public API write nothing to stderr, also where there is no CUDA driver."""

import subprocess
import sys

import pytest

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


@pytest.mark.parametrize("name", SCRIPTS)
def test_warp_starts_without_a_warning(name: str) -> None:
    run = subprocess.run([sys.executable, "-c", SCRIPTS[name]], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
