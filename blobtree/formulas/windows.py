"""Windows: how direct fields without a bounded support of their own end at a box.

A window is 1 in the middle of a box and falls to 0 at its faces, over a share `fade` of the half lengths:
w = s(x) s(y) s(z) with s = t²(3 − 2t), t = (1 − |x| / half) / fade, between 0 and 1. A field is multiplied by
the window, so it ends smoothly: its surface closes inside the box, where f · w = ½.
"""

import warp as wp

from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})


@wp.func
def smooth_step(t: wp.float32) -> wp.float32:
    """Return t²(3 − 2t), 0 below 0 and 1 above 1."""
    x = wp.clamp(t, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@wp.func
def smooth_step_slope(t: wp.float32) -> wp.float32:
    """Return the derivative of `smooth_step`, largest at t = ½."""
    x = wp.clamp(t, 0.0, 1.0)
    return 6.0 * x * (1.0 - x)


@wp.func
def steepest_smooth_step(low: wp.float32, high: wp.float32) -> wp.float32:
    """Return the largest derivative of `smooth_step` over [low, high]."""
    return smooth_step_slope(wp.clamp(0.5, low, high))


@wp.func
def window_side(x: wp.float32, half: wp.float32, fade: wp.float32) -> wp.vec2:
    """Return the factor of one axis and its derivative."""
    t = (1.0 - wp.abs(x) / half) / fade
    rate = smooth_step_slope(t) / (fade * half)
    if x > 0.0:
        rate = -rate
    return wp.vec2(smooth_step(t), rate)


@wp.func
def window(x: wp.vec3, half: wp.vec3, fade: wp.float32) -> wp.vec4:
    """Return (w, ∇w) at x, seen from the middle of the box."""
    a = window_side(x[0], half[0], fade)
    b = window_side(x[1], half[1], fade)
    c = window_side(x[2], half[2], fade)
    return wp.vec4(a[0] * b[0] * c[0], a[1] * b[0] * c[0], a[0] * b[1] * c[0], a[0] * b[0] * c[1])


@wp.func
def window_side_bounds(x: wp.float32, radius: wp.float32, half: wp.float32, fade: wp.float32) -> wp.vec3:
    """Return (smallest, largest, steepest) of the factor of one axis over [x − radius, x + radius]."""
    low = (1.0 - (wp.abs(x) + radius) / half) / fade
    high = (1.0 - wp.max(wp.abs(x) - radius, 0.0) / half) / fade
    return wp.vec3(smooth_step(low), smooth_step(high), steepest_smooth_step(low, high) / (fade * half))


@wp.func
def window_bounds(x: wp.vec3, radius: wp.float32, half: wp.vec3, fade: wp.float32) -> wp.vec3:
    """Return (smallest w, largest w, largest |∇w|) over a ball around x."""
    a = window_side_bounds(x[0], radius, half[0], fade)
    b = window_side_bounds(x[1], radius, half[1], fade)
    c = window_side_bounds(x[2], radius, half[2], fade)
    slope = wp.vec3(a[2] * b[1] * c[1], a[1] * b[2] * c[1], a[1] * b[1] * c[2])
    return wp.vec3(a[0] * b[0] * c[0], a[1] * b[1] * c[1], wp.length(slope))


@wp.func
def box_window(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (w, ∇w) at q of a box with tape[at] = (middle, fade) and tape[at + 1] = (half lengths, ·)."""
    middle = tape[at]
    half = tape[at + 1]
    x = q - wp.vec3(middle[0], middle[1], middle[2])
    return window(x, wp.vec3(half[0], half[1], half[2]), middle[3])


@wp.func
def box_window_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return `window_bounds` over a ball for such a box."""
    middle = tape[at]
    half = tape[at + 1]
    x = center - wp.vec3(middle[0], middle[1], middle[2])
    return window_bounds(x, radius, wp.vec3(half[0], half[1], half[2]), middle[3])


@wp.func
def windowed(f: wp.vec4, w: wp.vec4) -> wp.vec4:
    """Return (value, gradient) of a field under a window."""
    g = f * w[0] + w * f[0]
    return wp.vec4(f[0] * w[0], g[1], g[2], g[3])


@wp.func
def windowed_bounds(f: wp.vec3, w: wp.vec3) -> wp.vec3:
    """Return (smallest, largest, steepest) of a field under a window, from those of both."""
    return wp.vec3(f[0] * w[0], f[1] * w[1], f[2] * w[1] + f[1] * w[2])
