"""Derivatives of the steps of a directed evaluation, for interpreters that are no typed function.

The shaders' loop is a text (``shaders/interpreter.glsl``), so forward mode cannot follow it. Here each of its
steps carries (value, direction), and then the change of both along the way of the point.
"""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.directed import Directed, directed_combine
from blobtree.tape.evaluators import (
    gradient_leaf,
    gradient_pullback_affine,
    gradient_pullback_warp,
    profiled_gradient_leaf,
)
from blobtree.texels import Texels
from blobtree.transpile.derivative import directional_derivative

wp.set_module_options(KERNEL_OPTIONS)

_leaf = directional_derivative(gradient_leaf, ["q", "c"])
_profiled_leaf = directional_derivative(profiled_gradient_leaf, ["q", "c"])
_pullback_warp = directional_derivative(gradient_pullback_warp, ["f", "q"])
_combine = directional_derivative(directed_combine, ["a", "b"])


@wp.func
def now(f: Directed) -> wp.vec4:
    """Return (value, direction)."""
    return wp.vec4(f[0], f[1], f[2], f[3])


@wp.func
def change(f: Directed) -> wp.vec4:
    """Return the change of (value, direction)."""
    return wp.vec4(f[4], f[5], f[6], f[7])


@wp.func
def changing(f: wp.vec4, d: wp.vec4) -> Directed:
    """Return (value, direction) with its change."""
    return Directed(f[0], f[1], f[2], f[3], d[0], d[1], d[2], d[3])


@wp.func
def leaf_along(q: wp.vec3, velocity: wp.vec3, c: wp.vec4, drift: wp.vec4) -> Directed:
    """Return a primitive's field; its closest point and influence c change by `drift`."""
    f, d = _leaf(q, velocity, c, drift, wp.vec4(), wp.vec4(), 0.0)
    return changing(f, d)


@wp.func
def profiled_leaf_along(
    q: wp.vec3, velocity: wp.vec3, c: wp.vec4, drift: wp.vec4, profile: wp.vec4
) -> Directed:
    """Do the same for a primitive with a profile."""
    f, d = _profiled_leaf(q, velocity, c, drift, wp.vec4(), wp.vec4(), 0.0, profile)
    return changing(f, d)


@wp.func
def pullback_affine_along(f: Directed, tape: Texels, at: wp.int32) -> Directed:
    """Return `f` in front of an affine map."""
    return changing(gradient_pullback_affine(now(f), tape, at), gradient_pullback_affine(change(f), tape, at))


@wp.func
def pullback_warp_along(
    kind: wp.int32, f: Directed, q: wp.vec3, velocity: wp.vec3, tape: Texels, at: wp.int32
) -> Directed:
    """Return `f` in front of a warp, where the point is q."""
    g, d = _pullback_warp(kind, now(f), change(f), q, velocity, tape, at)
    return changing(g, d)


@wp.func
def combine_along(
    operator: wp.int32, a: Directed, b: Directed, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> Directed:
    """Return F, its direction, and their change."""
    f, d = _combine(operator, now(a), change(a), now(b), change(b), reach, parameter, tape)
    return changing(f, d)
