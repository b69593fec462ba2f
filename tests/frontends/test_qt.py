"""Decals in pyvistaqt's windows, on a virtual X display; each check is a program of its own."""

from importlib.util import find_spec

import pytest

from tests.display import display
from tests.programs import run_module

__all__ = ["display"]
CHECKS = ("pixels", "docked", "background", "user", "again", "page")


@pytest.mark.skipif(
    find_spec("pyvistaqt") is None or find_spec("PySide6") is None,
    reason="pyvistaqt and PySide6 are not installed: pip install 'implicit-decals[qt]'",
)
@pytest.mark.parametrize("check", CHECKS)
def test_a_qt_window(display: str, check: str) -> None:
    assert "done" in run_module("tests.frontends.qt_windows", check, DISPLAY=display, QT_QPA_PLATFORM="xcb")
