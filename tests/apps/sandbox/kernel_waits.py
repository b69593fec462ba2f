"""Places at which a thread that answers input would wait for kernels, as it does with an empty cache."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any
from unittest.mock import patch

from blobtree import kernels

LOADERS = "blobtree.kernels", "blobtree.device"
"""Modules that load kernels for all others."""


class KernelWaits:
    """Notes where one thread loads kernels that may have to be compiled.

    Attributes
    ----------
    noting
        True while places are noted, from the first input on.
    places
        Kernels and functions, each once.
    """

    def __init__(self) -> None:
        self._thread, self._is_cached = threading.get_ident(), kernels._is_cached
        self.noting = False
        self.places: list[str] = []

    def is_cached(self, module: Any, device: Any) -> bool:
        """Stand for the look into the cache: where it may be empty, other threads alone use it."""
        if self.noting and threading.get_ident() == self._thread:
            if kernels._refusal.active:
                return False
            place = f"{module.name} by {_caller(sys._getframe())}"
            if place not in self.places:
                self.places.append(place)
        return self._is_cached(module, device)


@contextmanager
def kernel_waits() -> Iterator[KernelWaits]:
    """Within a ``with`` block, this process has loaded no kernels yet, and this thread should load none."""
    waits = KernelWaits()
    with patch.object(kernels, "_is_cached", waits.is_cached), patch.dict(kernels._state.loaded, clear=True):
        yield waits


def _caller(frame: FrameType | None) -> str:
    """Return the functions of our packages that ask for kernels, the innermost first."""
    names: list[str] = []
    while frame is not None and len(names) < 12:
        name = frame.f_globals.get("__name__", "")
        if name.startswith(("blobtree.", "decals.")) and name not in LOADERS:
            names.append(f"{name}.{frame.f_code.co_qualname}")
        frame = frame.f_back
    return " < ".join(names)
