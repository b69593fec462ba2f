"""The same user in a real window, where there is a virtual X display."""

import ctypes

import pytest

from tests.display import display, run_module

__all__ = ["display"]
SAYS = "the first picture came back"
PROGRAM = "tests.decals.window.on_screen"


def test_without_a_screen() -> None:
    assert SAYS in run_module(PROGRAM, "off")


def test_real_keys_and_buttons_do_what_the_help_says(display: str) -> None:
    try:
        ctypes.CDLL("libXtst.so.6")
    except OSError:
        pytest.skip("libXtst is not installed (on Debian: apt-get install libxtst6)")
    assert "all of it worked" in run_module("tests.decals.window.x_events", DISPLAY=display)


def test_on_a_virtual_display(display: str) -> None:
    assert SAYS in run_module(PROGRAM, DISPLAY=display)
