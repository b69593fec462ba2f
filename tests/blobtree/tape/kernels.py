"""Typed functions of the tests of this folder: a skeleton of two points in the data region."""

import warp as wp

from blobtree.declare.skeleton import Skeleton

wp.set_module_options({"enable_backward": False})


@wp.func
def closest_of_pair(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """The nearer of two points."""
    first = tape[int(tape[at][0])]
    second = tape[int(tape[at][0]) + 1]
    nearer = first
    if wp.length(q - wp.vec3(second[0], second[1], second[2])) < wp.length(
        q - wp.vec3(first[0], first[1], first[2])
    ):
        nearer = second
    return wp.vec4(nearer[0], nearer[1], nearer[2], tape[at][3])


@wp.func
def min_influence_of_pair(tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """The one influence."""
    return tape[at][3]


PAIR = Skeleton("pair", closest_of_pair, min_influence_of_pair, 1, folds_maps=False, digest="1")
