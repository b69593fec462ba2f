"""Kernels that take the vertices of thickened plates and walls back to the surface."""

import warp as wp

from blobtree.formulas.falloff import ISO, RIM
from blobtree.formulas.skeletons import TINY
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.vertex_kernels import VertexArrays, write_vertex
from blobtree.tape.evaluate_kernels import CONVERGED
from blobtree.tape.interpreter import field_color, field_gradient, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

FOOT_STEPS = 4
"""Steps of Newton's method to a skeleton; the first one is exact for planes in similarity maps."""

SURFACE_STEPS = 8
"""Steps of Newton's method to the surface."""

HALVINGS = 26
"""Bisection steps between a vertex and its foot, down to what float32 can tell."""

SURFACE = wp.constant(RIM)
"""Distance of the surface over the influence."""

AT_FOOT = wp.constant(3e-4)
"""Distance over influence, below which a point lies on a skeleton."""

LEAST_FIELD, MOST_FIELD = wp.constant(1e-7), wp.constant(1.0 - 1e-7)
"""Fields between which a distance belongs to a field."""

RAY_GROWTH = 1.4
"""Ratio of successive distances at which a ray looks for the other side."""

RAY_HALVINGS = 8
"""Bisection steps for that side."""

NO_SIDE = wp.constant(1e30)
"""Distance of a side that a ray did not find."""


@wp.func
def distance_step(f: wp.vec4, distance: wp.float32) -> wp.vec3:
    """Return the step along the gradient to a distance over the influence, exact for a primitive alone."""
    g = wp.vec3(f[1], f[2], f[3])
    squared = wp.dot(g, g)
    value = wp.clamp(f[0], LEAST_FIELD, MOST_FIELD)
    rest = wp.pow(value, 1.0 / 3.0)
    u = wp.sqrt(1.0 - rest)
    slope = 6.0 * u * rest * rest
    return g * ((u - distance) * slope / wp.max(squared, TINY))


@wp.func
def shortened(step: wp.vec3, longest: wp.float32) -> wp.vec3:
    """Return a step no longer than `longest`."""
    return step * wp.min(1.0, longest / wp.max(wp.length(step), TINY))


@wp.func
def foot_of(
    start: wp.vec3, aim: wp.float32, reach: wp.float32, tape: Texels, span: wp.vec2i
) -> tuple[wp.vec3, wp.float32]:
    """Return the point at the distance `aim`, over the influence, and the field of the leaf at `start`."""
    q = start
    value = float(0.0)
    for step in range(FOOT_STEPS + 1):
        f = field_gradient(q, tape, span)
        if step == 0:
            value = f[0]
        if f[0] == 0.0 or (aim == 0.0 and f[0] > 1.0 - 3.0 * AT_FOOT * AT_FOOT):
            break
        q += shortened(distance_step(f, aim), reach)
    return q, value


@wp.kernel
def find_feet(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    listed: wp.array(dtype=wp.int32),
    leaf: wp.int32,
    aim: wp.float32,
    reach: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    nearness: wp.array(dtype=wp.float32),
    owners: wp.array(dtype=wp.int32),
    feet: wp.array(dtype=wp.vec3),
) -> None:
    """Write the feet of points on a leaf's surface: the points at the distance `aim`, over the influence.

    `nearness` is the least difference to ISO that the field of a leaf has had at a point, and `owners` is
    that leaf. A leaf without a field there has ISO itself.
    """
    i = listed[first + wp.tid()]
    foot, value = foot_of(points[i], aim, reach, tape, span)
    if wp.abs(value - ISO) < nearness[i]:
        nearness[i] = wp.abs(value - ISO)
        owners[i] = leaf
        feet[i] = foot


@wp.kernel
def improve_feet(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    leaf: wp.int32,
    reach: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    owners: wp.array(dtype=wp.int32),
    feet: wp.array(dtype=wp.vec3),
) -> None:
    """Move the feet of a leaf's points to its skeleton, by a smaller field than before, which is as exact."""
    i = listed[first + wp.tid()]
    if owners[i] == leaf:
        foot, _value = foot_of(feet[i], 0.0, reach, tape, span)
        feet[i] = foot


@wp.kernel
def return_to_surface(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    owners: wp.array(dtype=wp.int32),
    feet: wp.array(dtype=wp.vec3),
    reach: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    vertices: VertexArrays,
    errors: wp.array(dtype=wp.float32),
) -> None:
    """Move points to the surface: by Newton's method, or between a point and its foot, whichever is nearer.

    Points without a foot (no owner) have Newton's method alone. Where both fail, it starts at the foot.
    Errors are those of the field.
    """
    i = first + wp.tid()
    start = points[i]
    q = start
    best = start
    f_best = wp.vec4()
    moved = float(NO_SIDE)
    outside = bool(True)
    a = start
    b = start
    stage = int(0)  # Newton's method from the point, the foot, bisection, Newton's method from the foot
    step = int(0)
    for _turn in range(2 * SURFACE_STEPS + HALVINGS + 4):  # one call of the field for all stages
        f = field_gradient(q, tape, span)
        gap = wp.abs(ISO - f[0])
        if step == 0 and stage == 0:
            outside = f[0] < ISO
            f_best = f
        next_stage = int(stage)
        if stage == 0 or stage == 3:
            if gap <= 10.0 * CONVERGED * ISO or (step >= SURFACE_STEPS and gap < 1e-3 * ISO):
                best = q
                f_best = f
                moved = wp.length(q - start)
                next_stage = 1
            elif step >= SURFACE_STEPS:
                next_stage = 1
            else:
                q += shortened(distance_step(f, SURFACE), 0.5 * reach)
            if next_stage == 1 and (stage == 3 or owners[i] < 0 or (step == 0 and moved == 0.0)):
                break
            if next_stage == 1:
                q = feet[i]
        elif stage == 1:
            if (f[0] < ISO) != outside:
                next_stage = 2
                b = q
                q = 0.5 * (a + b)
            elif moved < 2.0 * reach:
                break
            else:
                next_stage = 3
        elif stage == 2:
            if (f[0] < ISO) == outside:
                a = q
            else:
                b = q
            if step >= HALVINGS:
                if wp.length(q - start) < moved:
                    best = q
                    f_best = f
                break
            q = 0.5 * (a + b)
        step += 1
        if next_stage != stage:
            stage = next_stage
            step = 0
    write_vertex(vertices, i, best, f_best, field_color(best, tape, span))
    errors[i] = wp.abs(f_best[0] - ISO)


@wp.kernel
def find_other_sides(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    nearest: wp.float32,
    farthest: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    distances: wp.array(dtype=wp.float32),
) -> None:
    """Write the distance along each ray to the other side of the surface, or NO_SIDE for a ray without it."""
    i = first + wp.tid()
    p = points[i]
    ray = directions[i]
    near = float(nearest)
    far = float(nearest)
    inner = bool(False)
    distances[i] = NO_SIDE
    t = float(nearest)
    halvings = int(-1)
    for _turn in range(64):  # one call of the field for all stages
        inside = field_value(p + ray * t, tape, span) >= ISO
        if t == nearest and halvings < 0:
            inner = inside
        if halvings < 0:
            if inside != inner:
                far = t
                halvings = 0
            elif t >= farthest:
                break
            else:
                near = t
                t = wp.min(RAY_GROWTH * t, farthest)
        elif inside != inner:
            far = t
        else:
            near = t
        if halvings >= 0:
            if halvings == RAY_HALVINGS:
                distances[i] = far
                break
            t = 0.5 * (near + far)
            halvings += 1
