"""The type of tapes in typed functions."""

from typing import Any

import warp as wp

Texels: Any = wp.array(dtype=wp.vec4)
"""A tape on a device: texels of four floats each, which shaders read from a texture."""
