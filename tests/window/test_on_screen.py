"""The same hands in a real window, where there is a virtual X display."""

from tests.display import display, run_module

__all__ = ["display"]
SAYS = "the first picture came back"
PROGRAM = "tests.window.on_screen"


def test_without_a_screen() -> None:
    assert SAYS in run_module(PROGRAM, "off")


def test_on_a_virtual_display(display: str) -> None:
    assert SAYS in run_module(PROGRAM, DISPLAY=display)
