"""Kernel of the sizes of parts: how thin the primitives are that act in a block of cells."""

import warp as wp

from blobtree.cells.block_kernels import LevelBlocks, block_center
from blobtree.formulas.falloff import RIM
from blobtree.formulas.skeletons import HALF_DIAGONAL
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import FIELD, PREFIX, STRETCHED, UNWARP, WARP, WARP_REGISTERS
from blobtree.tape.dispatch import (
    closest,
    direct_stride,
    kind_part_size,
    stride,
    warp_forward,
    warp_stretch,
)
from blobtree.tape.evaluators import to_local
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

UNLIMITED = wp.constant(1e30)
"""Size of a part where no primitive acts."""

_Points = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)
_Numbers = wp.types.vector(length=WARP_REGISTERS, dtype=wp.float32)


@wp.func
def smallest_part(
    center: wp.vec3, half: wp.float32, tape: Texels, span: wp.vec2i, least: wp.float32
) -> wp.float32:
    """Return half the least thickness, from `least` on, of the primitives on a tape near a cube.

    The last number of a primitive's colour is what its skeleton adds to its radius (`parts.sized_tape`). Maps
    and warps that stretch the space of a primitive make it thinner. Primitives that are too thin everywhere
    in the cube are left out: their size at its centre decides, where the bound over the cube may be loose.
    """
    result = float(UNLIMITED)
    point = center
    ball = half * HALF_DIAGONAL
    stretch = float(1.0)
    stretch_there = float(1.0)
    points = _Points()
    balls = _Numbers()
    stretches = _Numbers()
    stretches_there = _Numbers()
    at = span[0]
    while at < span[1]:
        header = tape[at]
        code = int(header[0])
        count = int(header[2])
        at += 1
        if code >= 0:
            for _i in range(count):
                size = float(0.0)
                size_there = float(0.0)
                if code >= FIELD:
                    last = at + PREFIX + direct_stride(code - FIELD) - 1
                    scale = tape[at + 3][0]
                    size = tape[last][3]
                    size_there = size
                    q = to_local(point, tape, at)
                    own = kind_part_size(code - FIELD, q, ball * scale, tape, at + PREFIX)
                    if own > 0.0:
                        size = own
                        size_there = kind_part_size(code - FIELD, q, 0.0, tape, at + PREFIX)
                    size = size / scale
                    size_there = size_there / scale
                    at = last + 1
                else:
                    if code >= STRETCHED:
                        kind = code - STRETCHED
                        last = at + PREFIX + stride(kind) - 1
                        c = closest(kind, to_local(point, tape, at), tape, at + PREFIX)
                        size = (RIM * c[3] + tape[last][3]) / tape[at + 3][0]
                    else:
                        last = at + stride(code) - 1
                        c = closest(code, point, tape, at)
                        size = RIM * c[3] + tape[last][3]
                    size_there = size
                    at = last + 1
                if size_there / stretch_there >= least:
                    result = wp.min(result, wp.max(size / stretch, least))
        elif code == WARP:
            points[count] = point
            balls[count] = ball
            stretches[count] = stretch
            stretches_there[count] = stretch_there
            warp = int(header[1])
            local = to_local(point, tape, at)
            reach = ball * tape[at + 3][0]
            factor = warp_stretch(warp, local, reach, tape, at + 3)
            stretch_there *= tape[at + 3][0] * warp_stretch(warp, local, 0.0, tape, at + 3)
            point = warp_forward(warp, local, tape, at + 3)
            ball = reach * factor
            stretch *= tape[at + 3][0] * factor
            at += PREFIX + int(header[3])
        elif code == UNWARP:
            point = points[count]
            ball = balls[count]
            stretch = stretches[count]
            stretch_there = stretches_there[count]
            at += PREFIX + int(header[3])
    return result


@wp.kernel
def measure_parts(
    first: wp.int32,
    begin: wp.int32,
    level: LevelBlocks,
    base: wp.vec3i,
    corner: wp.vec3,
    size: wp.float32,
    least: wp.float32,
    sizes: wp.array(dtype=wp.float32),
) -> None:
    """Write `smallest_part` for blocks of one level, of side `size`, from number `begin` on."""
    i = first + wp.tid()
    block = begin + i
    center = block_center(base + level.blocks[block], corner, size)
    sizes[i] = smallest_part(center, 0.5 * size, level.tape, level.spans[block], least)
