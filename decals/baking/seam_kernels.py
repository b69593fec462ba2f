"""Warp kernel of seams: texels along them are changed point by point until both sides agree."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.baking.srgb import decoded, decoded_slope, encoded

wp.set_module_options(KERNEL_OPTIONS)

MIN_POWER = 1.0e-6
"""Sum of squared slopes of a point from which on its texels can move it."""


@wp.func
def light_of(level: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the linear light of a level from 0 to 1."""
    if srgb:
        return decoded(level)
    return level


@wp.func
def level_of(light: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the level of linear light."""
    if srgb:
        return encoded(light)
    return light


@wp.func
def slope(level: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the derivative of light by the level."""
    if srgb:
        return decoded_slope(level)
    return wp.float32(1.0)


@wp.kernel
def settle(
    first: wp.int32,
    index: wp.array2d(dtype=wp.int32),
    weights: wp.array2d(dtype=wp.float32),
    srgb: wp.bool,
    sweeps: wp.int32,
    aim: wp.float32,
    limit: wp.float32,
    levels: wp.array(dtype=wp.float32),
    light: wp.array(dtype=wp.float32),
    changed: wp.array(dtype=wp.int32),
    seen: wp.array(dtype=wp.int32),
):
    """Change texels at each point in turn, forth and back, where both sides differ by more than ``limit``.

    The change is about the smallest after which both sides differ by ``aim`` (the method of Kaczmarz). Points
    whose texels have not changed since the sweep ``seen`` are left out; ``changed`` has the sweep of each
    texel. One thread runs the kernel, since each step needs the steps before.
    """
    count = index.shape[0]
    for sweep in range(sweeps):
        updates = wp.int32(0)
        for at in range(count):
            i = at
            if sweep % 2 == 1:
                i = count - 1 - at
            newest = wp.int32(-1)
            for k in range(8):
                newest = wp.max(newest, changed[index[i, k]])
            if newest >= seen[i]:
                seen[i] = sweep
                mixed = wp.float32(0.0)
                other = wp.float32(0.0)
                for k in range(4):
                    mixed += weights[i, k] * light[index[i, k]]
                    other += weights[i, k + 4] * light[index[i, k + 4]]
                mixed = level_of(mixed, srgb)
                other = level_of(other, srgb)
                gap = mixed - other
                if wp.abs(gap) > limit:
                    slopes = wp.vector(length=8, dtype=wp.float32)
                    power = wp.float32(0.0)
                    for k in range(8):
                        level = levels[index[i, k]]
                        slopes[k] = weights[i, k] * slope(level, srgb)
                        if k < 4:
                            slopes[k] = slopes[k] / slope(mixed, srgb)
                        else:
                            slopes[k] = -slopes[k] / slope(other, srgb)
                        down = slopes[k] * gap > 0.0
                        if (down and level > 0.0) or (not down and level < 1.0):
                            power += slopes[k] * slopes[k]
                    if power > MIN_POWER:
                        updates += 1
                        step = (gap - wp.clamp(gap, -aim, aim)) / power
                        for k in range(8):
                            texel = index[i, k]
                            level = wp.clamp(levels[texel] - step * slopes[k], 0.0, 1.0)
                            if level != levels[texel]:
                                levels[texel] = level
                                light[texel] = light_of(level, srgb)
                                changed[texel] = sweep
        if updates == 0:
            break
