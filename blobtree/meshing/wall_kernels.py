"""Kernels of walls: how thick the solid is at points of its surface, along the inward normal."""

import warp as wp

from blobtree.formulas.falloff import ISO
from blobtree.formulas.skeletons import TINY
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.adaptive_cell_kernels import base_block
from blobtree.meshing.adaptive_kernels import BlockTreeArrays, deepest_block, finest_cell, gradient_in_block
from blobtree.meshing.part_kernels import UNLIMITED
from blobtree.tape.evaluate_kernels import STALLED, project_to_surface
from blobtree.tape.interpreter import field_gradient, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

PLACE_HALVINGS = 12
"""Bisection steps between the corners of a cell."""

HALVINGS = 10
"""Bisection steps for the far side of a wall, whose distance is known to a factor of two: beyond a sharp
side, only points very near it have a gradient."""

NEWTON_STEPS = 4
"""Steps from an operand's surface to that of the tree, which lies there unless the operator is smooth."""


@wp.kernel
def place_samples(
    first: wp.int32,
    starts: wp.array(dtype=wp.vec3),
    ends: wp.array(dtype=wp.vec3),
    longest_step: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    places: wp.array(dtype=wp.vec3),
) -> None:
    """Write a point of an operand's surface between each start and end, or else near their middle.

    Bisection comes before Newton's method, because fields with sharp edges are flat at most points.
    """
    i = first + wp.tid()
    a = starts[i]
    b = ends[i]
    p = 0.5 * (a + b)
    inner = field_value(a, tape, span) >= ISO
    if inner != (field_value(b, tape, span) >= ISO):
        for _halving in range(PLACE_HALVINGS):
            if (field_value(p, tape, span) >= ISO) == inner:
                a = p
            else:
                b = p
            p = 0.5 * (a + b)
    q, _f = project_to_surface(p, longest_step, tape, span)
    places[i] = q


@wp.kernel
def climb(
    first: wp.int32,
    starts: wp.array(dtype=wp.vec3),
    reach: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    tree: BlockTreeArrays,
    places: wp.array(dtype=wp.vec3),
) -> None:
    """Move points of an operand's surface, where the tree is outside, along that surface toward the solid.

    Twice the step of Newton's method leads from near a lens to its middle, as the gap between two surfaces
    grows with the square of the distance from there.
    """
    i = first + wp.tid()
    p = starts[i]
    near = base_block(finest_cell(p, tree), tree.depth, tree.keys)
    block = deepest_block(finest_cell(p, tree), near, tree)
    if block >= 0:
        f = gradient_in_block(p, block, tree)
        if f[0] < ISO * (1.0 - STALLED):
            own = field_gradient(p, tape, span)
            n = wp.vec3(own[1], own[2], own[3])
            g = wp.vec3(f[1], f[2], f[3])
            along = g - n * (wp.dot(g, n) / wp.max(wp.dot(n, n), TINY))
            slope = wp.length(along)
            if slope > 0.0:
                p += along * (wp.min(2.0 * (ISO - f[0]) / slope, reach) / slope)
                p, own = project_to_surface(p, reach, tape, span)
    places[i] = p


@wp.kernel
def measure_walls(
    first: wp.int32,
    starts: wp.array(dtype=wp.vec3),
    size: wp.float32,
    thickest: wp.float32,
    thinnest: wp.float32,
    flattest: wp.float32,
    rim: wp.float32,
    opposed: wp.float32,
    tree: BlockTreeArrays,
    places: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    thicknesses: wp.array(dtype=wp.float32),
    angles: wp.array(dtype=wp.float32),
) -> None:
    """Write the thickness of the wall at each point, and the angle between its sides.

    The thickness is UNLIMITED for walls above `thickest`, and for points without a wall.

    Start from the tree's surface within `size`, and look along the inward normal for the other side, with
    steps that double from `thinnest` on. The solid begins nearer than `flattest`, as points are only nearly
    on the surface: two sides that touch have none between them. The two sides of a wall face away from each
    other: the cosine between the inward normal on one side and the outward normal on the other side is
    `opposed` at least. A wedge is as thick as at the distance `rim` from its edge at least, and its thickness
    is negative nearer to the edge.
    """
    i = first + wp.tid()
    thicknesses[i] = UNLIMITED
    p = starts[i]
    places[i] = p
    near = base_block(finest_cell(p, tree), tree.depth, tree.keys)
    f = wp.vec4()
    inward = wp.vec3()
    t = float(0.0)
    step = float(0.0)
    far = float(0.0)
    solid = bool(False)
    stage = int(0)  # to the surface, then to the far side, then back and forth around it
    halvings = int(0)
    for turn in range(64):  # one call of the field for all stages: each copy of it compiles as long again
        q = p + inward * t
        block = deepest_block(finest_cell(q, tree), near, tree)
        if stage == 0 and turn == 0 and block < 0:
            break
        f = gradient_in_block(q, block, tree)
        g = wp.vec3(f[1], f[2], f[3])
        steepness = wp.length(g)
        if stage == 0:
            gap = ISO - f[0]
            if steepness == 0.0 or turn > NEWTON_STEPS or wp.length(p - starts[i]) > size:
                break
            if wp.abs(gap) <= STALLED * ISO:
                stage = 1
                inward = g / steepness
                step = thinnest
                t = thinnest
                places[i] = p
                normals[i] = inward
            else:
                p += g * (wp.clamp(gap / steepness, -size, size) / steepness)
        elif stage == 1:
            solid = solid or f[0] >= ISO
            if f[0] < ISO and solid:
                stage = 2
                far = t
                step = 0.25 * t
                t -= step
            elif t >= thickest or (t >= flattest and not solid):
                break
            else:
                t = wp.min(2.0 * t, thickest)
        else:
            halvings += 1
            if f[0] < ISO:
                far = wp.min(far, t)
            if halvings > HALVINGS:
                cosine = float(1.0)
                if steepness > 0.0:
                    cosine = wp.dot(inward, g) / steepness
                angle = wp.acos(wp.clamp(-cosine, -1.0, 1.0))
                if cosine <= -opposed:
                    angles[i] = angle
                    thicknesses[i] = far
                    if far < rim * angle:
                        thicknesses[i] = -rim * angle
                break
            step *= 0.5
            if halvings == HALVINGS:
                t = far
            elif f[0] < ISO:
                t -= step
            else:
                t += step
