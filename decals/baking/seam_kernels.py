"""Warp kernel of seams: texels along them are changed point by point until both sides agree."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)

MIN_POWER = 1.0e-6
"""Sum of squared slopes of a point from which on its texels can move it."""


@wp.func
def decoded(level: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the linear light of a level from 0 to 1."""
    if not srgb:
        return level
    if level > 0.04045:
        return wp.pow((level + 0.055) / 1.055, 2.4)
    return level / 12.92


@wp.func
def encoded(light: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the level of linear light."""
    if not srgb:
        return light
    if light > 0.0031308:
        return 1.055 * wp.pow(light, 1.0 / 2.4) - 0.055
    return 12.92 * light


@wp.func
def slope(level: wp.float32, srgb: wp.bool) -> wp.float32:
    """Return the derivative of light by the level."""
    if not srgb:
        return wp.float32(1.0)
    if level > 0.04045:
        return 2.4 / 1.055 * wp.pow((level + 0.055) / 1.055, 1.4)
    return wp.float32(1.0 / 12.92)


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

    The change is the smallest one after which they differ by ``aim``, about (the method of Kaczmarz). Points
    whose texels have not changed since the sweep ``seen`` are left out; ``changed`` has the sweep of each
    texel. One thread runs it, since each step needs those before.
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
                mixed = encoded(mixed, srgb)
                other = encoded(other, srgb)
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
                                light[texel] = decoded(level, srgb)
                                changed[texel] = sweep
        if updates == 0:
            break
