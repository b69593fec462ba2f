"""Small plotters without a screen, closed at the end of each test."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import pyvista as pv

import decals.vtk  # noqa: F401  (it registers `plotter.decals`)
from decals.rendering.gl_libraries import install_advice, missing_gl_libraries

Factory = Callable[..., pv.Plotter]


@pytest.fixture
def plotter() -> Iterator[Factory]:
    """Make plotters of 160 × 120 pixels."""
    missing = missing_gl_libraries()
    if missing:
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    made: list[pv.Plotter] = []

    def make(**options: Any) -> pv.Plotter:
        made.append(pv.Plotter(**{"off_screen": True, "window_size": (160, 120), **options}))
        return made[-1]

    yield make
    for one in made:
        one.close()
