"""Kernels of the parity check: where to look, what is found there, how far from the oracle."""

# mypy: disable-error-code="call-overload"

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.contact import rim_distance
from decals.field.ownership import NO_OWNER, contact_at, owner_at, single_layer_at, uv_at
from decals.index.lookup import IndexedDecals
from tests.oracles.parallel import Members, rim_of, wide

wp.set_module_options(KERNEL_OPTIONS)

ZERO = wp.constant(wp.float64(0.0))
ONE = wp.constant(wp.float64(1.0))
TWO = wp.constant(wp.float64(2.0))
BEYOND = wp.constant(wp.float64(1.1))
ANYWHERE = wp.constant(0)
ON_RIM = wp.constant(1)
AT_CENTRE = wp.constant(2)
ON_TIE = wp.constant(3)
ON_PLANE = wp.constant(4)
KINDS = wp.constant(5)

POINTS = wp.constant(0)
OWNED = wp.constant(1)
UNCLEAR = wp.constant(2)
OWNERS_DIFFER = wp.constant(3)
NOT_FINITE = wp.constant(4)
COUNTS = 5

CONTACT_ERROR = wp.constant(0)
CUT_ERROR = wp.constant(1)
UV_ERROR = wp.constant(2)
UNLIKE_ERROR = wp.constant(3)
WORST = 4

TIE = wp.constant(wp.float64(1e-4))
EDGE = wp.constant(wp.float64(1e-6))
MOST_RATIO = wp.constant(wp.float32(20.5))
MOST_STRETCH = wp.constant(wp.float64(20.0))


@wp.func
def chance(state: wp.uint32) -> wp.float64:
    """Random number from 0 to 1, of 24 bits."""
    return wp.float64(wp.randf(state))


@wp.func
def random_direction(state: wp.uint32) -> wp.vec3d:
    height = TWO * wp.float64(wp.randf(state)) - ONE
    angle = wp.float64(6.283185307179586) * wp.float64(wp.randf(state + wp.uint32(7919)))
    ring = wp.sqrt(wp.max(ONE - height * height, ZERO))
    return wp.vec3d(ring * wp.cos(angle), ring * wp.sin(angle), height)


@wp.func
def nearly_one(state: wp.uint32) -> wp.float64:
    """1 ± 10^−8 to 10^−1, or 1 itself."""
    power = wp.pow(wp.float64(10.0), wp.float64(-8.0) + wp.float64(7.0) * wp.float64(wp.randf(state)))
    choice = wp.randf(state + wp.uint32(104729))
    if choice < 0.2:
        return ONE
    if choice < 0.6:
        return ONE + power
    return ONE - power


@wp.func
def tie_distance(ray: wp.vec3d, i: wp.int32, j: wp.int32, these: Members) -> wp.float64:
    """Where on a ray from i the fields of i and j are equal; −1 for nowhere."""
    apart = wide(these.positions[j]) - wide(these.positions[i])
    a = wp.float64(these.radii[i])
    b = wp.float64(these.radii[j])
    along = wp.dot(ray, apart)
    squared = wp.dot(apart, apart)
    root = a * a * along * along + (b * b - a * a) * squared
    if root < ZERO:
        return -ONE
    below = a * along + wp.sqrt(root)
    if below <= ZERO:
        return -ONE
    return a * squared / below


@wp.func
def plane_distance(ray: wp.vec3d, i: wp.int32, j: wp.int32, these: Members) -> wp.float64:
    """Where on a ray from i the powers of i and j are equal; −1 for nowhere."""
    apart = wide(these.positions[j]) - wide(these.positions[i])
    a = wp.float64(these.radii[i])
    b = wp.float64(these.radii[j])
    along = wp.dot(ray, apart)
    if along <= ZERO:
        return -ONE
    return (wp.dot(apart, apart) + a * a - b * b) / (TWO * along)


@wp.kernel
def choose_points(
    seed: wp.int32,
    flat: wp.array(dtype=wp.int32),
    these: Members,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    sets: wp.array(dtype=wp.int32),
) -> None:
    """Adversarial points: near rims, centres, ties and radical planes of decals, and anywhere about them."""
    tid = wp.tid()
    state = wp.rand_init(seed, tid)
    group = wp.randi(state, 0, flat.shape[0])
    if wp.randf(state) < 0.1:
        group = 0  # its first decal lies at the origin, where float32 resolves the smallest offsets
    first = group * these.size
    i = first + wp.randi(state, 0, these.size)
    j = first + wp.randi(state, 0, these.size)
    kind = wp.randi(state, 0, KINDS)
    if kind == AT_CENTRE and wp.randf(state) < 0.5:
        i = first
    ray = random_direction(wp.randu(state))
    if flat[group] != 0:
        ray = wp.normalize(wp.vec3d(ray[0], ray[1], ZERO))
    radius = wp.float64(these.radii[i])
    share = BEYOND * chance(wp.randu(state))
    if kind == ON_RIM:
        share = nearly_one(wp.randu(state))
    if kind == AT_CENTRE:
        share = wp.pow(wp.float64(10.0), wp.float64(-12.0) + wp.float64(11.7) * chance(wp.randu(state)))
    if i != j and kind >= ON_TIE:
        met = wp.float64(-1.0)
        if kind == ON_TIE:
            met = tie_distance(ray, i, j, these) / radius
        else:
            met = plane_distance(ray, i, j, these) / radius
        if met > ZERO and met < BEYOND:
            share = met * nearly_one(wp.randu(state))
    q = wide(these.positions[i]) + share * radius * ray
    points[tid] = wp.vec3(wp.float32(q[0]), wp.float32(q[1]), wp.float32(q[2]))
    tilt = wp.float64(0.6) * chance(wp.randu(state))
    choice = wp.randf(state)
    if choice < 0.15:
        tilt = ZERO
    if choice > 0.85:
        tilt = wp.float64(20.0)
    n = wide(these.normals[i]) + tilt * random_direction(wp.randu(state))
    normals[tid] = wp.vec3(wp.float32(n[0]), wp.float32(n[1]), wp.float32(n[2]))
    sets[tid] = group


@wp.kernel
def look_at_points(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    once: wp.bool,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    rims: wp.array(dtype=wp.float32),
    uv: wp.array(dtype=wp.vec2),
) -> None:
    """Owner, r/r_h and uv as the decal pass finds them; `once`: in one walk of the index, as shaders do."""
    i = wp.tid()
    q = points[i]
    n = wp.normalize(normals[i])
    owner = wp.int32(NO_OWNER)
    pushed = wp.vec3(0.0, 0.0, 0.0)
    if once:
        found = single_layer_at(q, n, contact, index)
        owner = int(found[0])
        pushed = wp.vec3(found[1], found[2], found[3])
    else:
        owner = owner_at(q, n, contact, index)
        if owner != NO_OWNER:
            pushed = contact_at(q, n, owner, contact, index)
    owners[i] = owner
    rims[i] = 0.0
    uv[i] = wp.vec2(0.0, 0.0)
    if owner != NO_OWNER:
        rims[i] = rim_distance(pushed[0])
        uv[i] = uv_at(q, n, owner, pushed, index)


@wp.func
def raise_to(worst: wp.array(dtype=wp.float64), which: wp.int32, value: wp.float64) -> wp.float64:
    """Keep the larger value; looking first spares most of the atomic operations."""
    if value > worst[which]:
        wp.atomic_max(worst, which, value)
    return value


@wp.func
def largest_ratio(owner: wp.int32, these: Members) -> wp.float32:
    """Radius of the largest decal of a set over that of one of them."""
    first = owner - owner % these.size
    largest = wp.float32(0.0)
    for i in range(first, first + these.size):
        largest = wp.max(largest, these.radii[i])
    return largest / these.radii[owner]


@wp.kernel
def compare_points(
    these: Members,
    owners: wp.array(dtype=wp.int32),
    rims: wp.array(dtype=wp.float32),
    uv: wp.array(dtype=wp.vec2),
    want_owners: wp.array(dtype=wp.int32),
    complements: wp.array(dtype=wp.float64),
    places: wp.array(dtype=wp.vec3d),
    doubts: wp.array(dtype=wp.float64),
    edges: wp.array(dtype=wp.float64),
    uncut: wp.array(dtype=wp.float64),
    counts: wp.array(dtype=wp.int32),
    worst: wp.array(dtype=wp.float64),
) -> None:
    """Count, and keep the worst errors: against neighbours within reach, and against all (`uncut`)."""
    i = wp.tid()
    wp.atomic_add(counts, POINTS, 1)
    if not (wp.isfinite(rims[i]) and wp.isfinite(uv[i][0]) and wp.isfinite(uv[i][1])):
        wp.atomic_add(counts, NOT_FINITE, 1)
        return
    if doubts[i] <= TIE:
        wp.atomic_add(counts, UNCLEAR, 1)
    elif owners[i] != want_owners[i]:
        wp.atomic_add(counts, OWNERS_DIFFER, 1)
    if owners[i] == want_owners[i] and owners[i] >= 0:
        wp.atomic_add(counts, OWNED, 1)
        rim = wp.float64(rims[i])
        raise_to(worst, CUT_ERROR, wp.abs(rim - wp.min(rim_of(uncut[i]), ONE)))
        if edges[i] > EDGE:
            error = wp.abs(rim - wp.min(rim_of(complements[i]), ONE))
            if largest_ratio(owners[i], these) <= MOST_RATIO:
                raise_to(worst, CONTACT_ERROR, error)
            else:
                raise_to(worst, UNLIKE_ERROR, error)
            stretch = places[i][2]
            if stretch < MOST_STRETCH:
                x = wp.abs(wp.float64(uv[i][0]) - places[i][0])
                y = wp.abs(wp.float64(uv[i][1]) - places[i][1])
                raise_to(worst, UV_ERROR, wp.max(x, y) / wp.max(stretch, ONE))
