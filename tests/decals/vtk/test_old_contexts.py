"""Windows whose context is older by name than by what it can do, as VTK makes them through NVIDIA's EGL."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import shot

SCRIPT = """
import os
import sys
import numpy as np
import pyvista as pv
import decals.vtk
from decals.errors import NoGraphics
from tests.decals.vtk.scenes import TREE, both, shot

folder, *entries = sys.argv[1:]
for entry in entries:
    os.environ["IMPLICIT_DECALS_ENTRY"] = entry
    pl = pv.Plotter(off_screen=True, window_size=(160, 120))
    pl.decals.add_scene(both(), camera=True)
    picture = shot(pl)
    with pl.decals.subplot.current():
        context = pl.decals.subplot.renderer.context
        print(context.gl.version_code, context.backend, context.name)
    np.save(f"{folder}/{entry}.npy", picture)
    pl.close()
if not entries:
    pl = pv.Plotter(off_screen=True, window_size=(160, 120))
    pl.decals.add_implicit(TREE)
    try:
        shot(pl)
    except NoGraphics as error:
        raise SystemExit(f"refused: {error}")
    print(pl.render_window.ReportCapabilities())
"""


def in_a_process(folder: Path, *entries: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Draw in a process of its own: Mesa reads its version when it starts."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("MESA_GL")}
    return subprocess.run(
        [sys.executable, "-c", SCRIPT, str(folder), *entries],
        env={**inherited, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_a_context_of_version_3_2_that_can_do_more(pl: Plotter, tmp_path: Path) -> None:
    expected = shot(pl)
    entries = ("fragment", "compute")
    done = in_a_process(tmp_path, *entries, MESA_GL_VERSION_OVERRIDE="3.2")
    assert done.returncode == 0, done.stderr
    if "Mesa" not in done.stdout:
        pytest.skip(f"not Mesa: {done.stdout}")
    for entry, line in zip(entries, done.stdout.splitlines(), strict=True):
        assert line.split()[:2] == ["320", entry]
        apart = np.abs(np.load(tmp_path / f"{entry}.npy") - expected).max(axis=2)
        assert (apart > 1).mean() < 0.005  # silhouettes, where compute shaders trace


def test_a_context_that_cannot_take_our_shaders_is_refused(plotter: Factory, tmp_path: Path) -> None:
    plotter()
    done = in_a_process(tmp_path, MESA_GL_VERSION_OVERRIDE="3.2", MESA_GLSL_VERSION_OVERRIDE="150")
    if done.returncode == 0 and "Mesa" not in done.stdout:
        pytest.skip(f"not Mesa: {done.stdout}")
    assert "takes shaders of version 3.30" in done.stderr, done.stderr
