"""sRGB in kernels; `decals.images.texels` has the same for arrays of NumPy."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def decoded(level: wp.float32) -> wp.float32:
    """Return the linear light of an sRGB level from 0 to 1."""
    if level > 0.04045:
        return wp.pow((level + 0.055) / 1.055, 2.4)
    return level / 12.92


@wp.func
def encoded(light: wp.float32) -> wp.float32:
    """Return the sRGB level from 0 to 1 of linear light."""
    if light > 0.0031308:
        return 1.055 * wp.pow(light, 1.0 / 2.4) - 0.055
    return 12.92 * light


@wp.func
def decoded_slope(level: wp.float32, light: wp.float32) -> wp.float32:
    """Return the derivative of linear light by the sRGB level; `light` is that of the level."""
    if level > 0.04045:
        return 2.4 * light / (level + 0.055)
    return wp.float32(1.0 / 12.92)


LINEAR_LEVEL, LINEAR_LIGHT = wp.constant(wp.float64(0.04045)), wp.constant(wp.float64(0.0031308))
SLOPE, SCALE, OFFSET = (wp.constant(wp.float64(value)) for value in (12.92, 1.055, 0.055))
POWER = wp.constant(wp.float64(2.4))


@wp.func
def decoded64(level: wp.float64) -> wp.float64:
    """Return what `decoded` returns, in double precision."""
    if level > LINEAR_LEVEL:
        return wp.pow((level + OFFSET) / SCALE, POWER)
    return level / SLOPE


@wp.func
def encoded64(light: wp.float64) -> wp.float64:
    """Return what `encoded` returns, in double precision."""
    if light > LINEAR_LIGHT:
        return SCALE * wp.pow(light, wp.float64(1.0) / POWER) - OFFSET
    return SLOPE * light


@wp.func
def decoded_slope64(level: wp.float64, light: wp.float64) -> wp.float64:
    """Return what `decoded_slope` returns, in double precision."""
    if level > LINEAR_LEVEL:
        return POWER * light / (level + OFFSET)
    return wp.float64(1.0) / SLOPE
