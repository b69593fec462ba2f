"""Warp kernels of test_radial.py: rims at points, and how the image advances along rays."""

# mypy: ignore-errors

import warp as wp

from decals.field.contact import rim_distance
from decals.field.ownership import NO_OWNER, complement_at, owner_at
from decals.index.lookup import IndexedDecals
from decals.record import RECORD, RIM_RADIUS, Contact, xyz

wp.set_module_options({"enable_backward": False})

STEPS = 6


@wp.kernel
def rims_of_points(
    points: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    rims: wp.array(dtype=wp.float32),
) -> None:
    """Owner and r/r_h of points, all normals upward."""
    i = wp.tid()
    up = wp.vec3(0.0, 0.0, 1.0)
    owner = owner_at(points[i], up, contact, index)
    owners[i] = owner
    if owner != NO_OWNER:
        e = complement_at(points[i], up, owner, contact, index)
        rims[i] = rim_distance(e)


@wp.kernel
def slopes_of_rays(
    owners: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec3),
    index: IndexedDecals,
    least: wp.array(dtype=wp.float32),
    most: wp.array(dtype=wp.float32),
) -> None:
    """Least and most change of r/r_h over x/ρ on the part of each ray from its owner's centre with r < 1."""
    i = wp.tid()
    up = wp.vec3(0.0, 0.0, 1.0)
    ball = index.records[RECORD * owners[i]]
    last = wp.float32(0.0)
    low = wp.float32(1.0e9)
    high = wp.float32(-1.0e9)
    for step in range(1, STEPS + 1):
        x = float(step) / float(STEPS)
        q = xyz(ball) + (x * RIM_RADIUS * ball[3]) * rays[i]
        e = complement_at(q, up, owners[i], int(Contact.RADIAL), index)
        r = rim_distance(e)
        slope = (r - last) * float(STEPS)
        if r < 1.0:
            low = wp.min(low, slope)
            high = wp.max(high, slope)
        else:
            low = wp.min(low, wp.where(r < last, -1.0, low))
            high = wp.max(high, wp.where(last == 0.0, 1.0 / x, high))
        last = r
    least[i] = low
    most[i] = high
