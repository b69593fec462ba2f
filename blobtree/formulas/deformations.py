"""Library warps: taper, shear, stretch, bend and twist with limits (Barr 1984), noise and curve warps.

The rows have the form that `formulas.warps` describes. Warps with limits act along z between two heights:
below the lower one nothing moves, and above the upper one the motion is rigid, or a scale across z for a
taper.

A bend maps neighbours far apart at the axis about which it turns, and at the cut: the half-plane from the
axis in the middle opposite to the arc. The tree must be empty there; `bend_box` raises `InvalidNode` if it is
not.
"""

import math
from itertools import product

import numpy as np
import warp as wp

from blobtree._typing import Box, Float64Array
from blobtree.declare.registry import library_rows
from blobtree.errors import InvalidNode
from blobtree.formulas.warps import UNKNOWN_EXTENT, SpaceWarp
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

PI = math.pi

CLEARANCE = 0.05
"""Smallest distance from the axis and the cut of a bend at which the tree may have a field.

It is a share of the radius of the bend. ‖J‖ is at most its reciprocal there."""

STEEPEST_WENDLAND = 0.25
"""Distance at which the slope of Wendland's function is largest."""

# -- limits ---------------------------------------------------------------------------------------------


@wp.func
def within_limits(z: wp.float32, reach: wp.float32, low: wp.float32, high: wp.float32) -> wp.float32:
    """Return 1 if [z − reach, z + reach] meets the open interval (low, high), else 0."""
    if z + reach > low and z - reach < high:
        return 1.0
    return 0.0


@wp.func
def shear_norm(diagonal: wp.float32, k: wp.float32) -> wp.float32:
    """Return the norm of the matrix (diagonal, k; 0, 1)."""
    a = diagonal * diagonal
    s = a + k * k + 1.0
    return wp.sqrt(0.5 * (s + wp.sqrt(wp.max(s * s - 4.0 * a, 0.0))))


# -- taper ----------------------------------------------------------------------------------------------


@wp.func
def taper_scale(z: wp.float32, p: wp.vec4) -> wp.float32:
    """Return the scale across z at height z: 1 below p₂, then 1 + p₁ (z − p₂) as far as p₃."""
    return 1.0 + p[1] * (wp.clamp(z, p[2], p[3]) - p[2])


@wp.func
def taper_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Divide x and y by the scale."""
    r = taper_scale(q[2], tape[at])
    return wp.vec3(q[0] / r, q[1] / r, q[2])


@wp.func
def taper_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Divide by the scale too, and add its change along z."""
    p = tape[at]
    r = taper_scale(q[2], p)
    change = p[1] * within_limits(q[2], 0.0, p[2], p[3]) / (r * r)
    return wp.vec3(g[0] / r, g[1] / r, g[2] - change * (q[0] * g[0] + q[1] * g[1]))


@wp.func
def taper_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the norm at the smallest scale, and at the largest distance from the axis."""
    p = tape[at]
    r = wp.min(taper_scale(q[2] - reach, p), taper_scale(q[2] + reach, p))
    far = wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach
    k = wp.abs(p[1]) * within_limits(q[2], reach, p[2], p[3])
    return shear_norm(1.0 / r, k * far / (r * r))


def taper_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the box around a box whose cross-sections are scaled."""
    rate, low, high = parameters
    scales = 1.0 + rate * (np.clip([lower[2], upper[2]], low, high) - low)
    corners = np.concatenate([scale * np.array([lower[:2], upper[:2]]) for scale in scales])
    return np.append(corners.min(axis=0), lower[2]), np.append(corners.max(axis=0), upper[2])


# -- shear ----------------------------------------------------------------------------------------------


@wp.func
def shear_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Move by −(p₁, p₂) per unit of height between p₃ and p₄."""
    p = tape[at]
    rise = wp.clamp(q[2], p[3], tape[at + 1][0]) - p[3]
    return wp.vec3(q[0] - p[1] * rise, q[1] - p[2] * rise, q[2])


@wp.func
def shear_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Add the change of the motion along z."""
    p = tape[at]
    inside = within_limits(q[2], 0.0, p[3], tape[at + 1][0])
    return wp.vec3(g[0], g[1], g[2] - inside * (p[1] * g[0] + p[2] * g[1]))


@wp.func
def shear_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the norm of a shear."""
    p = tape[at]
    inside = within_limits(q[2], reach, p[3], tape[at + 1][0])
    return shear_norm(1.0, inside * wp.sqrt(p[1] * p[1] + p[2] * p[2]))


def shear_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the box around a box whose cross-sections move."""
    slope_x, slope_y, low, high = parameters
    rises = np.clip([lower[2], upper[2]], low, high) - low
    moves = rises[:, None] * np.array([slope_x, slope_y])
    return (
        np.append(lower[:2] + moves.min(axis=0), lower[2]),
        np.append(upper[:2] + moves.max(axis=0), upper[2]),
    )


# -- stretch --------------------------------------------------------------------------------------------


@wp.func
def stretch_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Move by −p₁ per unit of height between p₂ and p₃; p₁ is 1 − 1 / factor."""
    p = tape[at]
    return wp.vec3(q[0], q[1], q[2] - p[1] * (wp.clamp(q[2], p[2], p[3]) - p[2]))


@wp.func
def stretch_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Divide the part along z by the factor."""
    p = tape[at]
    return wp.vec3(g[0], g[1], g[2] * (1.0 - p[1] * within_limits(q[2], 0.0, p[2], p[3])))


@wp.func
def stretch_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return 1 / factor, or 1 if that is more."""
    p = tape[at]
    return wp.max(1.0, 1.0 - p[1] * within_limits(q[2], reach, p[2], p[3]))


def stretch_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the longer or shorter box."""
    shrinkage, low, high = parameters
    factor = 1.0 / (1.0 - shrinkage)
    inner_high = low + (high - low) / factor

    def outer(z: float) -> float:
        return z + (factor - 1.0) * (min(max(z, low), inner_high) - low)

    return (
        np.array([lower[0], lower[1], outer(float(lower[2]))]),
        np.array([upper[0], upper[1], outer(float(upper[2]))]),
    )


# -- twist with limits ----------------------------------------------------------------------------------


@wp.func
def limited_twist_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Rotate about z by −p₁ per unit of height between p₂ and p₃."""
    p = tape[at]
    angle = p[1] * (wp.clamp(q[2], p[2], p[3]) - p[2])
    c = wp.cos(angle)
    s = wp.sin(angle)
    return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])


@wp.func
def limited_twist_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Rotate back, and add the change of the rotation along z."""
    p = tape[at]
    angle = p[1] * (wp.clamp(q[2], p[2], p[3]) - p[2])
    c = wp.cos(angle)
    s = wp.sin(angle)
    x = c * q[0] + s * q[1]
    y = c * q[1] - s * q[0]
    rate = p[1] * within_limits(q[2], 0.0, p[2], p[3])
    return wp.vec3(c * g[0] - s * g[1], s * g[0] + c * g[1], g[2] + rate * (y * g[0] - x * g[1]))


@wp.func
def limited_twist_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the norm of the shear by |p₁| · distance from the axis."""
    p = tape[at]
    far = wp.sqrt(q[0] * q[0] + q[1] * q[1]) + reach
    return shear_norm(1.0, wp.abs(p[1]) * far * within_limits(q[2], reach, p[2], p[3]))


def limited_twist_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the box around the cylinder around a box; a box below the limits stays as it is."""
    if upper[2] <= parameters[1]:
        return lower, upper
    radius = float(np.hypot(*np.maximum(np.abs(lower[:2]), np.abs(upper[:2]))))
    return np.array([-radius, -radius, lower[2]]), np.array([radius, radius, upper[2]])


# -- bend -----------------------------------------------------------------------------------------------


@wp.func
def bend_place(q: wp.vec3, p: wp.vec4, half: wp.vec4) -> wp.vec4:
    """Return (x and z from the axis, distance beyond the arc, distance from the axis) over the bend's radius.

    The middle of the arc is at x = 1, z = 0. The distance beyond the arc is that from the line through the
    axis and the nearer end of the arc; it is below 0 within the arc. `half` is (·, cosine, sine) of half the
    angle of the arc.
    """
    k = wp.abs(p[1])
    w = 1.0 - k * q[0] * wp.sign(p[1])
    v = k * (q[2] - p[2])
    x = w * half[1] + v * half[2]
    z = v * half[1] - w * half[2]
    return wp.vec4(x, z, wp.abs(z) * half[1] - x * half[2], wp.sqrt(w * w + v * v))


@wp.func
def bend_turn(place: wp.vec4, half: wp.vec4) -> wp.vec2:
    """Return (cos, sin) of the angle by which a bend turns the tree at a place."""
    if place[2] < 0.0:
        rho = wp.max(place[3], 1.0e-6)
        x = place[0] / rho
        z = place[1] / rho
        return wp.vec2(x * half[1] - z * half[2], z * half[1] + x * half[2])
    if place[1] < 0.0:
        return wp.vec2(1.0, 0.0)
    return wp.vec2(half[1] * half[1] - half[2] * half[2], 2.0 * half[1] * half[2])


@wp.func
def bend_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Unroll the arc about y through p₁ per unit of height between p₂ and p₃."""
    p = tape[at]
    k = wp.abs(p[1])
    if k == 0.0:
        return q
    half = tape[at + 1]
    place = bend_place(q, p, half)
    side = wp.sign(p[1])
    x = q[0] * side
    v = q[2] - p[2]
    if place[2] < 0.0:
        inner = (2.0 * x - k * (x * x + v * v)) / (1.0 + place[3])
        return wp.vec3(side * inner, q[1], 0.5 * (p[2] + p[3]) + wp.atan2(place[1], place[0]) / k)
    if place[1] < 0.0:
        return q
    turn = bend_turn(place, half)
    inner = 2.0 * half[2] * half[2] / k + x * turn[0] - v * turn[1]
    return wp.vec3(side * inner, q[1], p[3] + v * turn[0] - turn[1] / k + x * turn[1])


@wp.func
def bend_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Turn back; in the arc, heights change faster near the axis."""
    p = tape[at]
    if p[1] == 0.0:
        return g
    half = tape[at + 1]
    place = bend_place(q, p, half)
    turn = bend_turn(place, half)
    along = g[2]
    if place[2] < 0.0:
        along = g[2] / wp.max(place[3], CLEARANCE)
    side = wp.sign(p[1])
    across = side * g[0]
    return wp.vec3(side * (turn[0] * across + turn[1] * along), g[1], turn[0] * along - turn[1] * across)


@wp.func
def bend_to_cut(place: wp.vec4) -> wp.float32:
    """Return the distance from the cut over the radius of the bend."""
    if place[0] < 0.0:
        return wp.abs(place[1])
    return place[3]


@wp.func
def bend_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return radius of the bend / distance from its axis, bounded because the tree is empty near it.

    A ball around the axis, or across the cut, holds points whose images lie far apart. The bound is then so
    large that the ball of that many times the reach holds them all.
    """
    p = tape[at]
    k = wp.abs(p[1])
    if k == 0.0:
        return 1.0
    half = tape[at + 1]
    empty = half[0]
    place = bend_place(q, p, half)
    rho = place[3]
    e = k * reach
    near = wp.max(rho - e, 0.7 * empty)  # lines between points with a field pass the axis no nearer
    bound = wp.max(1.0, 1.0 / near)
    if rho + e <= empty:
        return bound
    if e > rho or e > bend_to_cut(place) + CLEARANCE:
        bound = wp.max(bound, (2.0 * rho + e + k * (p[3] - p[2])) / e)
    return bound


@wp.func
def bend_extent(q: wp.vec3, half_size: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound the image of a box within the arc, or beyond one of its ends, and of no other box.

    At q, a is the extent of the box away from the axis and b across, over the radius of the bend.
    """
    p = tape[at]
    k = wp.abs(p[1])
    if k == 0.0:
        return half_size
    half = tape[at + 1]
    place = bend_place(q, p, half)
    turn = bend_turn(place, half)
    c = wp.abs(turn[0])
    s = wp.abs(turn[1])
    rho = place[3]
    a = k * (c * half_size[0] + s * half_size[2])
    b = k * (s * half_size[0] + c * half_size[2])
    e = wp.sqrt(a * a + b * b)
    if rho > e and place[2] < -e:
        farthest = wp.sqrt((rho + a) * (rho + a) + b * b) - rho
        return wp.vec3(wp.max(a, farthest) / k, half_size[1], wp.atan2(b, rho - a) / k)
    if place[2] > e and bend_to_cut(place) > e:
        return wp.vec3(a / k, half_size[1], b / k)
    return wp.vec3(UNKNOWN_EXTENT, UNKNOWN_EXTENT, UNKNOWN_EXTENT)


def bend_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the box around a bent box.

    Raises
    ------
    InvalidNode
        The inner box reaches the axis of the bend, or what lies beyond one limit meets the other end.
    """
    rate, low, high = parameters
    if rate == 0.0:
        return lower, upper
    k = abs(rate)
    x_range = sorted([float(lower[0]) * math.copysign(1.0, rate), float(upper[0]) * math.copysign(1.0, rate)])
    _require_room(x_range[1], lower[2], upper[2], k, low, high)
    parts = []
    if lower[2] < low:
        parts += list(product(x_range, (float(lower[2]), min(float(upper[2]), low))))
    if upper[2] > low and lower[2] < high:
        first, last = k * (max(lower[2], low) - low), k * (min(upper[2], high) - low)
        quarters = [0.5 * math.pi * number for number in range(5)]
        angles = [first, last, *(angle for angle in quarters if first < angle < last)]
        parts += [_on_arc(x, angle, k, low) for x, angle in product(x_range, angles)]
    if upper[2] > high:
        full = k * (high - low)
        c, s = math.cos(full), math.sin(full)
        for x, beyond in product(x_range, (max(lower[2] - high, 0.0), upper[2] - high)):
            foot = _on_arc(x, full, k, low)
            parts.append((foot[0] + s * beyond, foot[1] + c * beyond))
    corners = np.array(parts)
    corners[:, 0] *= math.copysign(1.0, rate)
    (x_low, z_low), (x_high, z_high) = corners.min(axis=0), corners.max(axis=0)
    return np.array([x_low, lower[1], z_low]), np.array([x_high, upper[1], z_high])


def bend_room(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> tuple[float, ...]:
    """Return the distance from the axis at which the inner box begins, over the radius of the bend.

    Then follow the cosine and the sine of half the angle of the arc.
    """
    rate, low, high = parameters
    toward = float(upper[0]) if rate >= 0.0 else -float(lower[0])
    empty = 1.0
    if rate != 0.0 and toward > 0.0:
        empty = max(0.999 * (1.0 - abs(rate) * toward), CLEARANCE)
    half = 0.5 * abs(rate) * (high - low)
    return empty, math.cos(half), math.sin(half)


def _on_arc(x: float, angle: float, k: float, low: float) -> tuple[float, float]:
    """Return (x, z) of a bent point at `angle`, from its x toward the axis."""
    half = math.sin(0.5 * angle)
    return 2.0 * half * half / k + x * math.cos(angle), low + (1.0 / k - x) * math.sin(angle)


def _require_room(nearest: float, bottom: float, top: float, k: float, low: float, high: float) -> None:
    if nearest > (1.0 - CLEARANCE) / k:
        raise InvalidNode(
            f"bend: its axis is {1.0 / k:.4g} from the z axis, and the field of its child reaches "
            f"{nearest:.4g} toward it, at most {(1.0 - CLEARANCE) / k:.4g} may; bend by fewer degrees per "
            "unit, or move the child away from the axis"
        )
    rest = math.pi - 0.5 * k * (high - low)
    for beyond in (low - bottom, top - high):
        to_cut = (1.0 - k * nearest) * math.sin(rest) - k * max(beyond, 0.0) * math.cos(rest)
        if rest < 0.5 * math.pi and to_cut < CLEARANCE:
            raise InvalidNode(
                f"bend: the field of its child reaches {max(beyond, 0.0):.4g} beyond the limits, so that its "
                "ends would meet; bend by fewer degrees, or move the limits apart"
            )


# -- noise ----------------------------------------------------------------------------------------------


@wp.func
def noise_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Add p₁ plane waves d sin(ω · q + phase); each is two texels, (ω, phase) and (d, |d| |ω|)."""
    moved = q
    for i in range(int(tape[at][1])):
        wave = tape[at + 1 + 2 * i]
        d = tape[at + 2 + 2 * i]
        angle = wp.dot(wp.vec3(wave[0], wave[1], wave[2]), q) + wave[3]
        moved += wp.vec3(d[0], d[1], d[2]) * wp.sin(angle)
    return moved


@wp.func
def noise_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Add ω (d · g) cos(ω · q + phase) of each wave."""
    pulled = g
    for i in range(int(tape[at][1])):
        wave = tape[at + 1 + 2 * i]
        d = tape[at + 2 + 2 * i]
        omega = wp.vec3(wave[0], wave[1], wave[2])
        angle = wp.dot(omega, q) + wave[3]
        pulled += omega * (wp.dot(wp.vec3(d[0], d[1], d[2]), g) * wp.cos(angle))
    return pulled


@wp.func
def noise_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return 1 + Σ |d| |ω| · the largest |cos|, which changes by at most |ω| per unit."""
    bound = float(1.0)
    for i in range(int(tape[at][1])):
        wave = tape[at + 1 + 2 * i]
        d = tape[at + 2 + 2 * i]
        omega = wp.vec3(wave[0], wave[1], wave[2])
        angle = wp.dot(omega, q) + wave[3]
        bound += d[3] * wp.min(wp.abs(wp.cos(angle)) + wp.length(omega) * reach, 1.0)
    return bound


def noise_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the box widened by the sum of the waves' amplitudes."""
    waves = np.array(parameters[3:]).reshape(-1, 2, 4)
    margin = np.abs(waves[:, 1, :3]).sum(axis=0)
    return lower - margin, upper + margin


# -- curve warp -----------------------------------------------------------------------------------------


@wp.func
def wendland(distance: wp.float32) -> wp.float32:
    """Wendland's C² function (1 − s)⁴ (4 s + 1), 0 from s = 1 on."""
    s = wp.min(distance, 1.0)
    t = (1.0 - s) * (1.0 - s)
    return t * t * (4.0 * s + 1.0)


@wp.func
def wendland_steepness(distance: wp.float32) -> wp.float32:
    """|φ'| / s = 20 (1 − s)³, 0 from s = 1 on."""
    t = 1.0 - wp.min(distance, 1.0)
    return 20.0 * t * t * t


@wp.func
def curve_forward(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Add Σ w φ(|q − c| p₂) over p₁ centres c; each is two texels, (c, 0) and (w, |w|)."""
    p = tape[at]
    moved = q
    for i in range(int(p[1])):
        center = tape[at + 1 + 2 * i]
        w = tape[at + 2 + 2 * i]
        s = wp.length(q - wp.vec3(center[0], center[1], center[2])) * p[2]
        moved += wp.vec3(w[0], w[1], w[2]) * wendland(s)
    return moved


@wp.func
def curve_pullback(q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Add ∇φ (w · g) of each centre."""
    p = tape[at]
    pulled = g
    for i in range(int(p[1])):
        center = tape[at + 1 + 2 * i]
        w = tape[at + 2 + 2 * i]
        away = (q - wp.vec3(center[0], center[1], center[2])) * p[2]
        steepness = wendland_steepness(wp.length(away)) * p[2]
        pulled -= away * (steepness * wp.dot(wp.vec3(w[0], w[1], w[2]), g))
    return pulled


@wp.func
def curve_stretch(q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return 1 + Σ |w| · the largest slope of φ within reach; the slope is largest at STEEPEST_WENDLAND."""
    p = tape[at]
    bound = float(1.0)
    for i in range(int(p[1])):
        center = tape[at + 1 + 2 * i]
        s = wp.length(q - wp.vec3(center[0], center[1], center[2])) * p[2]
        nearest = wp.max(s - reach * p[2], 0.0)
        steepest = wp.clamp(STEEPEST_WENDLAND, nearest, s + reach * p[2])
        bound += tape[at + 2 + 2 * i][3] * p[2] * steepest * wendland_steepness(steepest)
    return bound


def curve_box(lower: Float64Array, upper: Float64Array, parameters: tuple[float, ...]) -> Box:
    """Return the box, and around the centres the box widened by the largest motion there."""
    texels = np.array(parameters[3:]).reshape(-1, 2, 4)
    centers, weights, radius = texels[:, 0, :3], texels[:, 1, :3], 1.0 / parameters[1]
    first, last = centers.min(axis=0) - radius, centers.max(axis=0) + radius
    margin = largest_motion(centers, weights, radius)
    near = np.maximum(lower - margin, first), np.minimum(upper + margin, last)
    if np.any(near[0] > near[1]):
        return lower, upper
    return np.minimum(lower, near[0]), np.maximum(upper, near[1])


def largest_motion(centers: Float64Array, weights: Float64Array, radius: float) -> Float64Array:
    """Return a bound (3,) on |Σ w φ| along each axis, from samples and the slopes around them."""
    first, last = centers.min(axis=0) - radius, centers.max(axis=0) + radius
    steps = [np.linspace(a, b, MOTION_SAMPLES) for a, b in zip(first, last, strict=True)]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    half_cell = 0.5 * float(np.linalg.norm((last - first) / (MOTION_SAMPLES - 1))) / radius
    s = np.linalg.norm(points - centers, axis=2) / radius
    values = np.maximum(1.0 - s, 0.0) ** 4 * (4.0 * s + 1.0)
    steepest = np.clip(STEEPEST_WENDLAND, np.maximum(s - half_cell, 0.0), s + half_cell)
    slopes = 20.0 * steepest * np.maximum(1.0 - steepest, 0.0) ** 3
    bounds: Float64Array = np.abs(values @ weights) + slopes @ np.abs(weights) * half_cell
    return bounds.max(axis=0)


MOTION_SAMPLES = 24
"""Samples of a curve warp's motion along each axis."""

TAPER = SpaceWarp("taper", taper_forward, taper_pullback, taper_stretch, taper_box)
SHEAR = SpaceWarp("shear", shear_forward, shear_pullback, shear_stretch, shear_box)
STRETCH = SpaceWarp("stretch", stretch_forward, stretch_pullback, stretch_stretch, stretch_box)
LIMITED_TWIST = SpaceWarp(
    "limited_twist",
    limited_twist_forward,
    limited_twist_pullback,
    limited_twist_stretch,
    limited_twist_box,
)
BEND = SpaceWarp("bend", bend_forward, bend_pullback, bend_stretch, bend_box, bend_room, bend_extent)
NOISE = SpaceWarp("noise", noise_forward, noise_pullback, noise_stretch, noise_box)
CURVE = SpaceWarp("curve", curve_forward, curve_pullback, curve_stretch, curve_box)

library_rows(TAPER, SHEAR, STRETCH, LIMITED_TWIST, BEND, NOISE, CURVE)
