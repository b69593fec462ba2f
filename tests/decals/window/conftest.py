"""Windows without a screen, closed at the end of each test."""

from collections.abc import Iterator
from typing import Any

import pytest

from blobtree.graphics import install_advice, missing_gl_libraries
from decals.window import EditWindow
from tests.decals.editing.scenes import scene
from tests.decals.window.driver import Driver


@pytest.fixture
def opened() -> Iterator[Any]:
    """Open windows of 180 × 120 pixels."""
    missing = missing_gl_libraries()
    if missing:
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    made = []

    def open_window(shown: Any = None, **options: Any) -> Any:
        window = EditWindow(shown or scene(), off_screen=True, size=(180, 120), **options)
        made.append(window)
        window.show()
        return Driver(window)

    yield open_window
    for window in made:
        window.close()


@pytest.fixture
def driver(opened: Any) -> Any:
    return opened()
