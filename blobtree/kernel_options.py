"""How every file of kernels is compiled."""

import hashlib
import inspect
from typing import Any

import warp as wp

from . import kernels, operators, skeletons, warps

wp.config.log_level = wp.LOG_WARNING  # no banner when Warp starts, no line per compiled module


def _fingerprint() -> str:
    """A digest of the tables' sources.

    Warp keeps compiled kernels and compiles them again when a function that they call has changed; but it
    does not see the functions that a kernel picks out of a table while it is compiled.
    """
    digest = hashlib.sha256()
    for table in (kernels, operators, skeletons, warps):
        digest.update(inspect.getsource(table).encode())
    return digest.hexdigest()


KERNEL_OPTIONS: dict[str, Any] = {"enable_backward": False, "tables": _fingerprint()}
"""For `wp.set_module_options`: no adjoint code, and compiled anew when the tables change."""
