"""What drawing needs of the system: OpenGL's libraries, a process of its own, and a screen for a window.

VTK dies with a segmentation fault where it finds no library of OpenGL, so everything that renders
calls :func:`require_gl` first. Without a screen it draws off screen and returns, so everything that opens
a window calls :func:`require_screen` first.
"""

import ctypes
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

from blobtree.errors import NoGraphics
from blobtree.progress import in_notebook

GL_LIBRARIES: Mapping[str, str] = MappingProxyType({"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1"})
"""Libraries loaded at run time on Linux, each with the Debian package that has it."""

OFF_SCREEN_WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""VTK's windows that no screen shows; on Linux, VTK takes one of them if there is no X server."""

Loader = Callable[[str], object]
"""Loads a shared library by name, or raises `OSError`."""


def missing_gl_libraries(*, load: Loader = ctypes.CDLL, platform: str = sys.platform) -> list[str]:
    """Name the GL libraries that cannot be loaded here.

    Parameters
    ----------
    load
        Loads a library by name.
    platform
        As in `sys.platform`. Other systems than Linux bring their OpenGL with them.

    Returns
    -------
    list of str
        File names such as ``"libEGL.so.1"``; empty where nothing is missing.
    """
    if not platform.startswith("linux"):
        return []
    return [name for name in GL_LIBRARIES if not _loads(name, load)]


def install_advice(missing: list[str]) -> str:
    """Say which command brings the missing libraries.

    Parameters
    ----------
    missing
        What :func:`missing_gl_libraries` returned; not empty.
    """
    packages = " ".join(GL_LIBRARIES[name] for name in missing)
    return (
        f"On Debian or Ubuntu, run as root: apt-get install --no-install-recommends {packages} "
        "(elsewhere, install what your system calls these libraries)"
    )


def require_gl(*, load: Loader = ctypes.CDLL, platform: str = sys.platform) -> None:
    """Return if OpenGL's libraries are here.

    Parameters
    ----------
    load, platform
        As in :func:`missing_gl_libraries`.

    Raises
    ------
    NoGraphics
        With what was expected, what is here, and the command that installs the rest; also in a process
        that was forked after its parent had drawn.
    """
    check_not_forked()
    missing = missing_gl_libraries(load=load, platform=platform)
    if missing:
        raise NoGraphics(
            f"drawing needs the system libraries {' and '.join(GL_LIBRARIES)}; "
            f"{' and '.join(missing)} cannot be loaded here. {install_advice(missing)}."
        )


@contextmanager
def vtk_warnings_hidden() -> Iterator[None]:
    """Within a ``with`` block, VTK makes windows without its warning that no X server answers."""
    from vtkmodules.vtkCommonCore import vtkObject

    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)


def require_screen() -> None:
    """Raise `NoGraphics` if there is no screen for a window; VTK would silently draw off screen."""
    if not sys.platform.startswith("linux"):
        return
    reason = "DISPLAY is not set"
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        require_gl()
        from vtkmodules.vtkRenderingCore import vtkRenderWindow

        with vtk_warnings_hidden():
            if vtkRenderWindow().GetClassName() not in OFF_SCREEN_WINDOWS:
                return
        reason = f"no X server answers at DISPLAY={os.environ.get('DISPLAY', '')!r}"
    raise NoGraphics(
        f"expected a screen for the window, got none ({reason}); log in with a desktop, "
        "use `ssh -X`, or draw pictures with `implicit-decals render`"
    )


STILL = {"screenshot", "return_img", "interactive", "auto_close"}
"""Options of pyvista's ``plot`` and ``show`` for pictures, which need no screen."""


def opens_window(options: Mapping[str, Any]) -> bool:
    """Return True if pyvista's ``plot`` or ``show`` opens a window with these options; check for a screen.

    Parameters
    ----------
    options : mapping
        The arguments by name. Pictures, off-screen plotters and notebooks need no window.

    Raises
    ------
    NoGraphics
        There is no screen for the window, where VTK would silently draw off screen.
    """
    import pyvista as pv

    defaults = {"off_screen": pv.OFF_SCREEN, "notebook": pv.global_theme.notebook}
    chosen = {name: options.get(name) for name in defaults}
    off_screen, notebook = (defaults[name] if value is None else value for name, value in chosen.items())
    if notebook is None:
        notebook = in_notebook()
    if off_screen or notebook or pv.ON_SCREENSHOT or STILL & options.keys():
        return False
    require_screen()
    return True


def _loads(name: str, load: Loader) -> bool:
    try:
        load(name)
    except OSError:
        return False
    return True


class _Process:
    """State of OpenGL in this process."""

    draws = False
    forked = False


def mark_drawing() -> None:
    """Record that this process has an OpenGL context, so that no child made by a fork draws."""
    _Process.draws = True


def is_forked() -> bool:
    """Return True in a child forked after its parent had drawn."""
    return _Process.forked


def check_not_forked() -> None:
    """Raise an error in a child forked after its parent had drawn: the driver's threads are missing there.

    Raises
    ------
    NoGraphics
        A call of the driver would wait forever.
    """
    if _Process.forked:
        raise NoGraphics(
            "expected a process of its own for drawing, got one forked after its parent had drawn, in which "
            'OpenGL does not work; use spawn, as in multiprocessing.get_context("spawn")'
        )


def _after_fork() -> None:
    _Process.forked = _Process.forked or _Process.draws


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_after_fork)

_held: list[Any] = []


def hold_display() -> bool:
    """Keep VTK from ending the display of contexts that are made from now on.

    Nothing happens where VTK's OpenGL was not imported, or does not go through EGL. Contexts made before VTK
    was imported are not saved by it.

    Returns
    -------
    bool
        True if VTK's display is kept.
    """
    vtk: Any = sys.modules.get("vtkmodules.vtkRenderingOpenGL2")
    if _held or not hasattr(vtk, "vtkEGLRenderWindow"):
        return bool(_held)
    window = vtk.vtkEGLRenderWindow()
    window.SetSize(1, 1)
    window.OffScreenRenderingOn()
    window.Render()
    _held.append(window)
    return True
