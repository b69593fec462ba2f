"""Warp kernels of `evaluate_batch`: those of `evaluate` for many sets of decals in one launch.

Row i belongs to the set ``sets[i]``. Its point is ``points[i]``, or the point of this row in its set if all
sets share the points.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.ownership import NO_OWNER, owner_at
from decals.field.sampling_kernels import ImageSums, ImageTexels, image_point, write_sums
from decals.index.lookup import IndexedDecals

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def sample_sets(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    indices: wp.array(dtype=IndexedDecals),
    sets: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
):
    """Do the same as `sample_points`."""
    i = first + wp.tid()
    row = i % points.shape[0]
    index = indices[sets[i]]
    n_q = wp.normalize(normals[row])
    owner = owner_at(points[row], n_q, contact, index)
    owners[i] = owner
    if owner != NO_OWNER:
        place = image_point(points[row], n_q, owner, contact, index)
        uv[i] = wp.vec2(place[0], place[1])
        fields[i] = 1.0 - place[2]


@wp.kernel
def sample_images_of_sets(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    indices: wp.array(dtype=IndexedDecals),
    sets: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    uv: wp.array(dtype=wp.vec2),
    fields: wp.array(dtype=wp.float32),
    images: ImageTexels,
    sums: ImageSums,
):
    """Do the same as `sample_images`."""
    i = first + wp.tid()
    row = i % points.shape[0]
    n_q = wp.normalize(normals[row])
    write_sums(i, points[row], n_q, contact, indices[sets[i]], owners, uv, fields, images, sums)
