"""Plotters in which scenes are edited: a window of our own, or one that somebody lends."""

import os
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import pyvista as pv

from decals.checks import shown, whole
from decals.errors import InvalidScene, NoGraphics

SIZE = (1200, 800)
BACKGROUND = ((0.80, 0.82, 0.85), (0.96, 0.96, 0.95))
"""Colours at the bottom and at the top."""
LARGEST = 16384
"""Pixels that a window may have along each side, as many as VTK draws."""


def require_screen() -> None:
    """Raise `NoGraphics` where a window has no screen: VTK would do without one silently."""
    here = sys.platform.startswith("linux")
    if here and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise NoGraphics(
            "expected a screen for the window, got none (DISPLAY is not set); log in with a desktop, "
            "use `ssh -X`, or draw pictures with `implicit-decals render`"
        )


def checked_size(size: object) -> tuple[int, int]:
    """Give width and height of a window, or `InvalidScene`."""
    if not isinstance(size, Sequence) or len(size) != 2:
        raise InvalidScene(f"size: expected width and height in pixels, got {shown(size)}")
    width, height = (whole("size", side, 1, LARGEST, InvalidScene) for side in size)
    return width, height


def new_plotter(off_screen: bool, size: tuple[int, int]) -> Any:
    """Make an empty window; its methods are wrapped in ways that type checkers do not follow.

    It does without VTK's multisampling: what we draw is smoothed by ourselves, and without a graphics card
    half of the time of a frame would go there.
    """
    if not off_screen:
        require_screen()
    plotter: Any = pv.Plotter(off_screen=off_screen, window_size=list(size), title="Implicit Decals")
    plotter.disable_anti_aliasing()
    plotter.set_background(BACKGROUND[0], top=BACKGROUND[1])
    return plotter


def lent_plotter(plotter: Any) -> Any:
    """Check that a plotter of somebody's is open, and hears hands."""
    if not isinstance(plotter, pv.BasePlotter):
        raise InvalidScene(f"expected a pyvista plotter to edit in, got {type(plotter).__name__}")
    if getattr(plotter, "render_window", None) is None:
        raise InvalidScene("expected an open plotter to edit in, but this one was closed; make another")
    if getattr(plotter, "iren", None) is None:
        raise InvalidScene("expected a plotter with an interactor; make pyvistaqt's with off_screen=False")
    return plotter


def before_screenshots(plotter: Any, call: Callable[[], None]) -> Callable[[], None]:
    """Let a plotter call something before each screenshot; what comes back ends it."""
    method, before = plotter.screenshot, vars(plotter).get("screenshot")

    @wraps(method)
    def screenshot(*arguments: Any, **options: Any) -> Any:
        call()
        return method(*arguments, **options)

    def end() -> None:
        if vars(plotter).get("screenshot") is screenshot:  # otherwise somebody wrapped it again
            del vars(plotter)["screenshot"]
            if before is not None:
                vars(plotter)["screenshot"] = before

    vars(plotter)["screenshot"] = screenshot  # around pyvista's guard against new attributes
    return end
