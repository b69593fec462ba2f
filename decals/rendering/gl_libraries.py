"""The system libraries that OpenGL needs: a check before anything draws.

VTK dies with a segmentation fault where it finds none of them, so everything that renders
calls :func:`require_gl` first.
"""

import ctypes
import os
import sys
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from decals.errors import NoGraphics

GL_LIBRARIES: Mapping[str, str] = MappingProxyType({"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1"})
"""Libraries loaded at run time on Linux, each with the Debian package that has it."""

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
    decals.errors.NoGraphics
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
    decals.errors.NoGraphics
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


def hold_display() -> None:
    """Keep VTK from ending the display of contexts that are made from now on.

    Nothing happens where VTK's OpenGL was not imported, or does not go through EGL. Contexts made before VTK
    was imported are not saved by it.
    """
    vtk: Any = sys.modules.get("vtkmodules.vtkRenderingOpenGL2")
    if _held or not hasattr(vtk, "vtkEGLRenderWindow"):
        return
    window = vtk.vtkEGLRenderWindow()
    window.SetSize(1, 1)
    window.OffScreenRenderingOn()
    window.Render()
    _held.append(window)
