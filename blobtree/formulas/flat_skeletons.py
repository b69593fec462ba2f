"""Flat skeletons: rectangles and triangles. `formulas.skeletons` states what a skeleton is."""

import warp as wp

from blobtree.declare.registry import library_rows
from blobtree.formulas.skeletons import JOINT_YIELD, PLATE_CELLS, Skeleton, min_influence_of_one
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})


@wp.func
def closest_on_rectangle(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence); tape[at + 1 and + 2] = (unit vector along a side, half its length)."""
    center = tape[at]
    first = tape[at + 1]
    second = tape[at + 2]
    u = wp.vec3(first[0], first[1], first[2])
    v = wp.vec3(second[0], second[1], second[2])
    w = q - wp.vec3(center[0], center[1], center[2])
    c = u * wp.clamp(wp.dot(w, u), -first[3], first[3]) + v * wp.clamp(wp.dot(w, v), -second[3], second[3])
    return wp.vec4(center[0] + c[0], center[1] + c[1], center[2] + c[2], center[3])


@wp.func
def foot_on_edge(w: wp.vec3, edge: wp.vec3) -> wp.vec3:
    """Return the point of the line segment from 0 to `edge` that is closest to w."""
    return edge * wp.clamp(wp.dot(w, edge) / wp.max(wp.dot(edge, edge), 1.0e-37), 0.0, 1.0)


@wp.func
def closer(w: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return a, or b if it is closer to w.

    |w − a|² − |w − b|² is written as a product with b − a: feet near a corner differ little, and float32 does
    not show in the squares which one is closer.
    """
    if wp.dot(b - a, (w - a) + (w - b)) > 0.0:
        return b
    return a


@wp.func
def is_beside(w: wp.vec3, edge: wp.vec3, outward: wp.vec3) -> wp.bool:
    """Return True if w lies outside the line segment from 0 to `edge`, between the normals at its ends."""
    t = wp.dot(w, edge)
    return wp.dot(w, outward) > 0.0 and t > 0.0 and t < wp.dot(edge, edge)


@wp.func
def closest_on_triangle(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (corner a, influence); tape[at + 1] = (b − a, joint ab); tape[at + 2] = (c − a, joint ac).

    tape[at + 3] = (unit normal, joint bc); float32 could not compute the normal of slivers. A joint is 1 if
    another triangle goes on behind the edge, else 0. A point outside has the closest one inside an edge if it
    is beside this edge, which signs tell: distances to that point and to a corner near it differ by less than
    float32 shows.
    """
    corner = tape[at]
    to_b = tape[at + 1]
    to_c = tape[at + 2]
    upright = tape[at + 3]
    w = q - wp.vec3(corner[0], corner[1], corner[2])
    ab = wp.vec3(to_b[0], to_b[1], to_b[2])
    ac = wp.vec3(to_c[0], to_c[1], to_c[2])
    bc = ac - ab
    n = wp.vec3(upright[0], upright[1], upright[2])
    beyond_ab = wp.cross(ab, n)
    beyond_ac = wp.cross(n, ac)
    beyond_bc = wp.cross(bc, n)
    outside = wp.dot(w, beyond_ab) > 0.0 or wp.dot(w, beyond_ac) > 0.0 or wp.dot(w - ab, beyond_bc) > 0.0
    c = w - n * wp.dot(w, n)
    joint = float(0.0)
    if outside:
        if is_beside(w, ab, beyond_ab):
            c = foot_on_edge(w, ab)
            joint = to_b[3]
        elif is_beside(w, ac, beyond_ac):
            c = foot_on_edge(w, ac)
            joint = to_c[3]
        elif is_beside(w - ab, bc, beyond_bc):
            c = ab + foot_on_edge(w - ab, bc)
            joint = upright[3]
        else:
            c = closer(w, foot_on_edge(w, ab), foot_on_edge(w, ac))
            c = closer(w, c, ab + foot_on_edge(w - ab, bc))
            joint = wp.max(wp.max(to_b[3], to_c[3]), upright[3])
    influence = corner[3] * (1.0 - JOINT_YIELD * joint)
    return wp.vec4(corner[0] + c[0], corner[1] + c[1], corner[2] + c[2], influence)


@wp.func
def min_influence_of_triangle(tape: Texels, at: wp.int32) -> wp.float32:
    """Return the influence radius at joints."""
    return tape[at][3] * (1.0 - JOINT_YIELD)


RECTANGLE = Skeleton(
    "rectangle", closest_on_rectangle, min_influence_of_one, parameters=3, convex=True, cells=PLATE_CELLS
)
TRIANGLE = Skeleton(
    "triangle", closest_on_triangle, min_influence_of_triangle, parameters=4, convex=True, cells=PLATE_CELLS
)

library_rows(RECTANGLE, TRIANGLE)
