"""The system libraries that OpenGL needs: a check before anything draws.

VTK dies with a segmentation fault where it finds none of them, so everything that renders
calls :func:`require_gl` first.
"""

import ctypes
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
        With what was expected, what is here, and the command that installs the rest.
    """
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
