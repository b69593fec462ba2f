"""Fixtures for all tests."""

import gc

import pytest

import blobtree.kernels as kernels
from blobtree.custom import definition
from decals.rendering.gl_libraries import missing_gl_libraries


def pytest_collection_finish() -> None:
    """Each worker collects all tests, so modules of tests must not compute when they are imported."""
    if kernels._state.loaded:
        names = ", ".join(sorted(name for name, _ in kernels._state.loaded))
        raise pytest.UsageError(f"the import of a module of tests has launched kernels of {names}")
    gc.freeze()  # Python then looks for garbage among what tests make, not among all tests


@pytest.fixture(autouse=True)
def own_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each test its own registry: pages and examples define kinds under names of other tests."""
    monkeypatch.setattr(definition, "_KINDS", dict(definition._KINDS))


@pytest.fixture(scope="session")
def vtk_display() -> None:
    """Let VTK draw once: its first window would end the standalone OpenGL contexts made before."""
    if missing_gl_libraries():
        return
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[16, 16])
    plotter.show(auto_close=True)
