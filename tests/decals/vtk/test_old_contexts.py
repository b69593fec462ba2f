"""Windows whose context is older by name than by what it can do, as VTK makes them through NVIDIA's EGL."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.decals.vtk.conftest import Factory
from tests.decals.vtk.scenes import both, shot

SCRIPT = """
import sys
import numpy as np
import pyvista as pv
import decals.vtk
from decals.errors import NoGraphics
from tests.decals.vtk.scenes import TREE, both, shot

pl = pv.Plotter(off_screen=True, window_size=(160, 120))
if sys.argv[2] == "both":
    pl.decals.add_scene(both(), camera=True)
else:
    pl.decals.add_implicit(TREE)
try:
    picture = shot(pl)
    with pl.decals.subplot.current():
        context = pl.decals.subplot.renderer.context
        print(context.gl.version_code, context.backend, context.name)
except NoGraphics as error:
    raise SystemExit(f"refused: {error}")
np.save(sys.argv[1], picture)
"""


def in_a_process(path: Path, scene: str = "both", **environment: str) -> subprocess.CompletedProcess[str]:
    """Draw a scene in a process of its own: Mesa reads its version when it starts."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("MESA_GL")}
    return subprocess.run(
        [sys.executable, "-c", SCRIPT, str(path), scene],
        env={**inherited, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("entry", ["fragment", "compute"])
def test_a_context_of_version_3_2_that_can_do_more(plotter: Factory, tmp_path: Path, entry: str) -> None:
    pl = plotter()
    pl.decals.add_scene(both(), camera=True)
    expected = shot(pl)
    done = in_a_process(tmp_path / "old.npy", MESA_GL_VERSION_OVERRIDE="3.2", IMPLICIT_DECALS_ENTRY=entry)
    assert done.returncode == 0, done.stderr
    if "Mesa" not in done.stdout:
        pytest.skip(f"not Mesa: {done.stdout}")
    assert done.stdout.split()[:2] == ["320", entry]
    apart = np.abs(np.load(tmp_path / "old.npy") - expected).max(axis=2)
    assert (apart > 1).mean() < 0.005  # silhouettes, where compute shaders trace


def test_a_context_that_cannot_take_our_shaders_is_refused(plotter: Factory, tmp_path: Path) -> None:
    plotter()
    done = in_a_process(
        tmp_path / "old.npy", "a tree", MESA_GL_VERSION_OVERRIDE="3.2", MESA_GLSL_VERSION_OVERRIDE="150"
    )
    if done.returncode == 0 and "Mesa" not in done.stdout:
        pytest.skip(f"not Mesa: {done.stdout}")
    assert "takes shaders of version 3.30" in done.stderr, done.stderr
