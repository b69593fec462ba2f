"""How every file of kernels is compiled."""

from typing import Any

import warp as wp

wp.config.log_level = wp.LOG_WARNING  # no banner when Warp starts, no line per compiled module

KERNEL_OPTIONS: dict[str, Any] = {"enable_backward": False, "max_unroll": 4}
"""For `wp.set_module_options`: no adjoint code, and no long loops written out before the compiler sees them:
kernels that call whole formulas in loops took four times as long to compile, and ran no faster."""
