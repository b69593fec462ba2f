"""Fields of sampled distances: a grid of signed distances, interpolated linearly in each cell.

The data region holds a texel for each grid point but those of the last column and row: the samples at (i, j),
(i + 1, j), (i, j + 1) and (i + 1, j + 1) of a layer. So two texels hold the corners of a cell. Samples are in
units of the spacing. Outside the grid the distance is that of the nearest point of the grid, or the distance
from the grid's box if that is larger: the solid ends at the box.

From a distance d, below 0 inside, the field is a falloff of u = RIM + d / s. So it is ½ on the surface, 0
from d = (1 − RIM) s outward, and 1 from −RIM s inward. For a ball of radius RIM · s that is the field of a
`Point`.
"""

import warp as wp

from blobtree.declare.registry import library_rows
from blobtree.formulas.falloff import RIM
from blobtree.formulas.fields import FieldKind
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})


@wp.func
def box_distance(x: wp.vec3, half: wp.vec3) -> wp.vec4:
    """Return (d, ∇d) of a box, seen from its middle (Quilez, Distance functions)."""
    a = wp.abs(x[0]) - half[0]
    b = wp.abs(x[1]) - half[1]
    c = wp.abs(x[2]) - half[2]
    sx = wp.where(x[0] < 0.0, -1.0, 1.0)
    sy = wp.where(x[1] < 0.0, -1.0, 1.0)
    sz = wp.where(x[2] < 0.0, -1.0, 1.0)
    beyond = wp.vec3(wp.max(a, 0.0), wp.max(b, 0.0), wp.max(c, 0.0))
    length = wp.length(beyond)
    if length > 0.0:
        return wp.vec4(length, sx * beyond[0] / length, sy * beyond[1] / length, sz * beyond[2] / length)
    if a >= b and a >= c:
        return wp.vec4(a, sx, 0.0, 0.0)
    if b >= c:
        return wp.vec4(b, 0.0, sy, 0.0)
    return wp.vec4(c, 0.0, 0.0, sz)


@wp.func
def sampled_distance(u: wp.vec3, counts: wp.vec4, tape: Texels, data: wp.int32) -> wp.vec4:
    """Return (d, ∇d) in cells at u, in cells from the first grid point, without the box."""
    x = wp.clamp(u[0], 0.0, counts[0] - 1.0)
    y = wp.clamp(u[1], 0.0, counts[1] - 1.0)
    z = wp.clamp(u[2], 0.0, counts[2] - 1.0)
    i = wp.min(int(x), int(counts[0]) - 2)
    j = wp.min(int(y), int(counts[1]) - 2)
    k = wp.min(int(z), int(counts[2]) - 2)
    layer = (int(counts[0]) - 1) * (int(counts[1]) - 1)
    at = data + (k * (int(counts[1]) - 1) + j) * (int(counts[0]) - 1) + i
    low = tape[at]
    high = tape[at + layer]
    s = x - float(i)
    t = y - float(j)
    r = z - float(k)
    near = low * (1.0 - r) + high * r
    beside = high - low
    front = near[0] + s * (near[1] - near[0])
    back = near[2] + s * (near[3] - near[2])
    along_x = (1.0 - t) * (near[1] - near[0]) + t * (near[3] - near[2])
    along_y = back - front
    along_z = (1.0 - t) * (beside[0] + s * (beside[1] - beside[0]))
    along_z += t * (beside[2] + s * (beside[3] - beside[2]))
    if x != u[0]:
        along_x = 0.0
    if y != u[1]:
        along_y = 0.0
    if z != u[2]:
        along_z = 0.0
    return wp.vec4(front + t * (back - front), along_x, along_y, along_z)


@wp.func
def grid_box_distance(u: wp.vec3, counts: wp.vec4) -> wp.vec4:
    """Return (d, ∇d) in cells of the grid's box at u."""
    half = wp.vec3(counts[0] - 1.0, counts[1] - 1.0, counts[2] - 1.0) * 0.5
    return box_distance(u - half, half)


@wp.func
def volume_distance(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of sampled distances d: u = RIM + d / s.

    tape[at] = (first texel of the samples, first grid point); tape[at + 1] = (1 / spacing, 1 / s, growth in
    cells, largest slope of the samples); tape[at + 2] = (numbers of grid points, spacing).
    """
    first = tape[at]
    shape = tape[at + 1]
    counts = tape[at + 2]
    u = (q - wp.vec3(first[1], first[2], first[3])) * shape[0]
    d = sampled_distance(u, counts, tape, int(first[0]))
    box = grid_box_distance(u, counts)
    if box[0] > d[0]:
        d = box
    return wp.vec4(
        RIM + (d[0] - shape[2]) * counts[3] * shape[1], d[1] * shape[1], d[2] * shape[1], d[3] * shape[1]
    )


@wp.func
def volume_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball by the largest slope of the samples; the box's distance has slope 1."""
    first = tape[at]
    shape = tape[at + 1]
    counts = tape[at + 2]
    u = (center - wp.vec3(first[1], first[2], first[3])) * shape[0]
    reach = radius * shape[0]
    d = sampled_distance(u, counts, tape, int(first[0]))[0]
    box = grid_box_distance(u, counts)[0]
    slope = wp.max(shape[3], 1.0)
    low = wp.max(d - slope * reach, box - reach) - shape[2]
    high = wp.max(d + slope * reach, box + reach) - shape[2]
    rate = counts[3] * shape[1]
    return wp.vec3(RIM + low * rate, RIM + high * rate, slope * shape[1])


VOLUME = FieldKind("volume", volume_distance, volume_bounds, parameters=3, distance=True)

library_rows(
    VOLUME,
)
