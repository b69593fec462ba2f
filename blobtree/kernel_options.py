"""How every file of kernels is compiled."""

from typing import Any

import warp as wp

wp.config.log_level = wp.LOG_WARNING  # no banner when Warp starts, no line per compiled module

KERNEL_OPTIONS: dict[str, Any] = {"enable_backward": False}
"""For `wp.set_module_options`: no adjoint code."""
