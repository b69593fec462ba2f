"""The screen that a window needs."""

import os
import sys

from vtkmodules.vtkRenderingCore import vtkRenderWindow

from decals.errors import NoGraphics
from decals.rendering.gl_libraries import require_gl

OFF_SCREEN_WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""VTK's windows that no screen shows; on Linux, VTK takes one of them if there is no X server."""


def require_screen() -> None:
    """Raise `NoGraphics` if there is no screen for a window; VTK would silently draw off screen."""
    if not sys.platform.startswith("linux"):
        return
    reason = "DISPLAY is not set"
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        require_gl()
        if vtkRenderWindow().GetClassName() not in OFF_SCREEN_WINDOWS:
            return
        reason = f"no X server answers at DISPLAY={os.environ.get('DISPLAY', '')!r}"
    raise NoGraphics(
        f"expected a screen for the window, got none ({reason}); log in with a desktop, "
        "use `ssh -X`, or draw pictures with `implicit-decals render`"
    )
