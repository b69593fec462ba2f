"""Warp kernels of the tests of this folder."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.contact import contact_complement, contact_push, contact_uv, rim_distance
from decals.field.mapping import tangent_coordinates, unroll
from decals.index.lookup import IndexedDecals, cell_hash, cell_range
from decals.record import field_complement

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def contacts(x: wp.array(dtype=wp.vec4), result: wp.array(dtype=wp.vec4)) -> None:
    i = wp.tid()
    e_k = field_complement(x[i][0])
    complement = contact_complement(e_k, contact_push(field_complement(x[i][1]), e_k))
    uv = contact_uv(wp.vec2(x[i][2], x[i][3]), rim_distance(complement))
    result[i] = wp.vec4(complement, rim_distance(complement), uv[0], uv[1])


@wp.kernel
def offsets(
    x: wp.array(dtype=wp.vec4),
    y: wp.array(dtype=wp.vec4),
    z: wp.array(dtype=wp.vec4),
    result: wp.array(dtype=wp.vec4),
) -> None:
    i = wp.tid()
    n = wp.vec3(y[i][0], y[i][1], y[i][2])
    w = wp.vec3(x[i][0], x[i][1], x[i][2])
    m = unroll(w, n, wp.vec3(z[i][0], z[i][1], z[i][2]))
    xy = tangent_coordinates(wp.vec3(m[0], m[1], m[2]), n, w)
    result[i] = wp.vec4(xy[0], xy[1], m[2], m[3])


@wp.kernel
def lookups(
    x: wp.array(dtype=wp.vec4),
    cells: wp.array(dtype=wp.vec3i),
    index: IndexedDecals,
    result: wp.array(dtype=wp.vec3),
) -> None:
    i = wp.tid()
    span = cell_range(wp.vec3(x[i][0], x[i][1], x[i][2]), int(x[i][3]), index)
    h = cell_hash(cells[i][0], cells[i][1], cells[i][2]) & wp.uint32(65535)
    result[i] = wp.vec3(float(span[0]), float(span[1]), float(h))
