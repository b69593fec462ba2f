"""The OpenGL context that is current on a thread: kept for the program that calls us.

moderngl leaves no context current after a block. Here the context of the caller becomes current again if it
is one of EGL, as are ours on Linux. Other contexts the caller must make current.
"""

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

EGL_DRAW, EGL_READ = 0x3059, 0x305A
"""Names of the two surfaces of a context in EGL."""

Restore = Callable[[], object]


@contextmanager
def kept_current() -> Iterator[None]:
    """Make the context that is current before the ``with`` block current again after it."""
    restore = _egl_context()
    try:
        yield
    finally:
        if restore is not None:
            restore()


def is_current() -> bool:
    """Return False if this thread has no current context of EGL, as after the end of its display."""
    return not system_library("libEGL.so.1") or _egl_context() is not None


def is_egl() -> bool:
    """Return True if this thread's current context is one of EGL, as those of windows without a screen."""
    return system_library("libEGL.so.1") is not None and _egl_context() is not None


@cache
def system_library(name: str) -> Any:
    """Return a system library whose functions take and return pointers; None for a missing library."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        return ctypes.CDLL(name)
    except OSError:
        return None


def _call(library: Any, function: str, *arguments: int | None) -> int | None:
    """Call a function of pointers, which are whole numbers here."""
    entry = getattr(library, function)
    entry.restype = ctypes.c_void_p
    result: int | None = entry(*(ctypes.c_void_p(argument) for argument in arguments))
    return result


def _egl_context() -> Restore | None:
    """Return a function that makes the current context of EGL current; None if there is no such context."""
    egl = system_library("libEGL.so.1")
    context = egl and _call(egl, "eglGetCurrentContext")
    if not context:
        return None
    display = _call(egl, "eglGetCurrentDisplay")
    surfaces = [_call(egl, "eglGetCurrentSurface", name) for name in (EGL_DRAW, EGL_READ)]
    return lambda: _call(egl, "eglMakeCurrent", display, *surfaces, context)
