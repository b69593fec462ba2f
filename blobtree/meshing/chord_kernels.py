"""Kernels that measure how far triangles lie from the surface."""

from typing import Any

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.visible import Cells, block_at
from blobtree.tapes.evaluate import field_gradient

wp.set_module_options(KERNEL_OPTIONS)

NEWTON_STEPS = 30
"""Many, for beside a kink they go from side to side."""

ON_SURFACE = wp.constant(1e-5)
"""Field error, in units of ISO, of a sample that has arrived."""

_SAMPLES = (
    (1 / 3, 1 / 3, 1 / 3),
    *((1 / 2, 1 / 2, 0.0), (0.0, 1 / 2, 1 / 2), (1 / 2, 0.0, 1 / 2)),
    *((2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6), (1 / 6, 1 / 6, 2 / 3)),
)
"""Barycentric coordinates: the middle, those of the edges, and between the middle and the corners."""

_Samples: Any = wp.types.matrix(shape=(len(_SAMPLES), 3), dtype=wp.float32)
_SAMPLE = _Samples(*(number for sample in _SAMPLES for number in sample))


@wp.func
def gradient_at(p: wp.vec3, cells: Cells) -> wp.vec4:
    """(value, gradient) at p, by the tape of its block or, where there is none, the whole one."""
    block = block_at(p, cells)
    if block < 0:
        return field_gradient(p, cells.whole, wp.vec2i(0, cells.whole.shape[0]))
    return field_gradient(p, cells.tape, cells.spans[block])


@wp.func
def way_to_surface(start: wp.vec3, cells: Cells) -> wp.float32:
    """Length of a way from `start` to the surface; the side of a cell where none was found."""
    p = start
    for _step in range(NEWTON_STEPS):
        f = gradient_at(p, cells)
        gap = ISO - f[0]
        g = wp.vec3(f[1], f[2], f[3])
        steepness = wp.length(g)
        if steepness == 0.0:
            return cells.cell
        if wp.abs(gap) <= ON_SURFACE * ISO:
            return wp.length(p - start) + wp.abs(gap) / steepness
        p += g * (wp.clamp(gap / steepness, -0.5 * cells.cell, 0.5 * cells.cell) / steepness)
    return cells.cell


@wp.kernel
def measure_triangles(
    first: wp.int32,
    cells: Cells,
    vertices: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    errors: wp.array(dtype=wp.float32),
) -> None:
    """The largest distance of a triangle's samples to the surface."""
    i = first + wp.tid()
    a = vertices[faces[i][0]]
    b = vertices[faces[i][1]]
    c = vertices[faces[i][2]]
    largest = float(0.0)
    for k in range(wp.static(len(_SAMPLES))):
        sample = a * _SAMPLE[k, 0] + b * _SAMPLE[k, 1] + c * _SAMPLE[k, 2]
        largest = wp.max(largest, way_to_surface(sample, cells))
    errors[i] = largest
