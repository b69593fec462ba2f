"""Warp kernel of `evaluate_batch`: the fields of all decals of many sets, in a file that compiles by itself.

Rows are those of `decals.field.batch_kernels`.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.neighbor_kernels import write_neighbors
from decals.index.lookup import IndexedDecals

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def list_neighbors_of_sets(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    indices: wp.array(dtype=IndexedDecals),
    sets: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    offsets: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    decals: wp.array(dtype=wp.int32),
    fields: wp.array(dtype=wp.float32),
    pushes: wp.array(dtype=wp.float32),
    shows: wp.array(dtype=wp.int32),
):
    """Do the same as `list_neighbors`."""
    i = first + wp.tid()
    row = i % points.shape[0]
    offset = wp.int32(-1)
    if offsets.shape[0] > 0:
        offset = offsets[i]
    index = indices[sets[i]]
    n_q = wp.normalize(normals[row])
    counts[i] = write_neighbors(
        points[row], n_q, contact, index, owners[i], offset, decals, fields, pushes, shows
    )
