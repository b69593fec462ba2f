"""Warp kernels of particle repulsion: neighbour lists, rings, and one Newton step of every particle.

The energy has three terms (the family began with Witkin and Heckbert 1994):

* a soft law x^-2 of the distance x of two neighbours, in spacings, which spreads them evenly;
* a stiff spring ½ k (core − x)² where x < core, which parts pairs that are too close;
* a ring term for each particle: the deviation of its mean distance to the six nearest neighbours from the
  mean of all particles, under Tukey's biweight.

Each thread owns one particle and adds up its neighbours in the order of its list, the nearest first, so the
result does not depend on scheduling.
"""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.scattering.search_kernels import (
    MirrorPlanes,
    NeighborSearch,
    Particles,
    Six,
    any_tangent,
    insert_distance,
    mean_distance,
    mirrored,
    sheet_weight,
)

wp.set_module_options(KERNEL_OPTIONS)

CLOSEST = 0.6
"""Least distance that the energy is evaluated at, in spacings; below it the energy continues linearly."""

COINCIDENT = 1.0e-6
"""Distance of two particles, in spacings, up to which no direction between them is known."""

MIRROR_DEPTH = 0.25
"""Distance from a mirror plane, in spacings, up to which the image of a neighbour counts less."""

MAX_RING_DEVIATION = 0.3
"""Deviation of a ring, in spacings, from which its cost is constant: rings of tips and thin parts."""

ISOTROPY = 0.1
"""Share of the trace that is added to the curvature of the energy, so that it is never singular."""


@wp.struct
class NeighborLists:
    """Neighbours of each particle, at most `capacity`."""

    capacity: wp.int32
    counts: wp.array(dtype=wp.int32)
    """Number of neighbours of each particle."""
    indices: wp.array(dtype=wp.int32)
    """Neighbours of particle i, from index ``i * capacity`` on."""
    weights: wp.array(dtype=wp.float32)
    """Weight of each neighbour by the angle of the normals and by their sheets, above 0 and at most 1."""


@wp.struct
class Rings:
    """Distances to the six nearest neighbours, in spacings."""

    means: wp.array(dtype=wp.float32)
    """Mean distance to the six, of each particle."""
    sixth_distances: wp.array(dtype=wp.float32)
    """Distance of the sixth, of each particle."""
    total: wp.array(dtype=wp.float32)
    """Sum of the means when the epoch began, one number."""


@wp.struct
class EnergyLaw:
    """Parameters of the energy and of a step; lengths are in spacings."""

    cutoff: wp.float32
    """Distance beyond which particles do not repel each other."""
    core: wp.float32
    """Distance below which the spring pushes."""
    stiffness: wp.float32
    """Stiffness k of the spring."""
    ring_weight: wp.float32
    """Weight of the ring term; 0 leaves it out."""
    damping: wp.float32
    """Share of a Newton step that is taken."""
    max_move: wp.float32
    """Longest step."""


@wp.struct
class StepTerms:
    """Move and energies of each particle, as `repel` computes them."""

    moves: wp.array(dtype=wp.vec3)
    """Tangential moves, in model units."""
    energies: wp.array(dtype=wp.float32)
    """Energy of each particle without units: a measure of crowding."""
    pair_energies: wp.array(dtype=wp.float64)
    """Part of the total energy, in square model units: halves of its pairs, and its ring."""


@wp.struct
class Partner:
    """A neighbour, or an image of a particle behind a mirror plane."""

    index: wp.int32
    position: wp.vec3
    weight: wp.float32
    fallback_direction: wp.vec3
    """Unit direction in which two coincident particles part."""
    mirror_factor: wp.float32
    """2 for a particle's own image, which moves away as far as the particle does; else 1."""


@wp.struct
class PairTerms:
    """Energy of a pair at one distance, with its derivatives."""

    value: wp.float32
    slope: wp.float32
    """Negative derivative of the value."""
    curvature: wp.float32
    """Second derivative, without that of the cutoff."""


@wp.struct
class NewtonSystem:
    """Force and curvature in coordinates of the tangent plane, and energies as in `StepTerms`."""

    fx: wp.float32
    fy: wp.float32
    hxx: wp.float32
    hxy: wp.float32
    hyy: wp.float32
    energy: wp.float32
    pair_energy: wp.float64


@wp.func
def facing_weight(cosine: wp.float32, facing_limit: wp.float32) -> wp.float32:
    """Return the weight of two neighbours by their normals: 1 above the facing limit, 0 from 1/4 below it."""
    t = wp.clamp(1.0 + 4.0 * (cosine - facing_limit), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


@wp.func
def image_weight(
    q: wp.vec3, is_own: wp.bool, point: wp.vec3, normal: wp.vec3, depth: wp.float32
) -> wp.float32:
    """Return the weight of an image: 1 for a particle's own, else from 0 on the plane to 1 at the depth."""
    if is_own:
        return wp.length_sq(normal)
    return wp.clamp(wp.dot(q - point, normal) / depth, 0.0, 1.0)


@wp.func
def ring_cost_slope(deviation: wp.float32) -> wp.float32:
    """Return the derivative of `ring_cost`."""
    t = wp.max(1.0 - deviation * deviation / (MAX_RING_DEVIATION * MAX_RING_DEVIATION), 0.0)
    return deviation * t * t


@wp.func
def ring_cost(deviation: wp.float32) -> wp.float32:
    """Return Tukey's biweight: half the square for small deviations, constant from the largest one on."""
    t = wp.max(1.0 - deviation * deviation / (MAX_RING_DEVIATION * MAX_RING_DEVIATION), 0.0)
    return MAX_RING_DEVIATION * MAX_RING_DEVIATION / 6.0 * (1.0 - t * t * t)


@wp.func
def pair_terms(distance: wp.float32, law: EnergyLaw) -> PairTerms:
    """Return soft law and spring at a distance, along their tangent below the closest distance."""
    terms = PairTerms()
    x = wp.max(distance, CLOSEST)
    inverse = 1.0 / (x * x)
    end = 1.0 / (law.cutoff * law.cutoff)
    end_slope = 2.0 * end / law.cutoff
    penetration = wp.max(law.core - x, 0.0)
    terms.slope = 2.0 * x * inverse * inverse - end_slope + law.stiffness * penetration
    terms.value = (
        inverse - end + end_slope * (x - law.cutoff) + 0.5 * law.stiffness * penetration * penetration
    )
    terms.value += (x - distance) * terms.slope
    terms.curvature = 6.0 * inverse * inverse
    if penetration > 0.0:
        terms.curvature += law.stiffness
    return terms


@wp.func
def image_of(
    i: wp.int32,
    j: wp.int32,
    w: wp.int32,
    list_weight: wp.float32,
    particles: Particles,
    mirrors: MirrorPlanes,
) -> Partner:
    """Return the image of particle j behind mirror plane w of particle i."""
    partner = Partner()
    normal = mirrors.normals[w]
    q = particles.positions[j]
    partner.index = j
    partner.position = mirrored(q, mirrors.points[w], normal)
    partner.weight = list_weight * image_weight(
        q, j == i, mirrors.points[w], normal, MIRROR_DEPTH * particles.sizes[i]
    )
    partner.fallback_direction = normal
    partner.mirror_factor = 1.0
    if j == i:
        partner.mirror_factor = 2.0
    return partner


@wp.func
def with_ring_terms(
    push_and_bend: wp.vec2,
    i: wp.int32,
    j: wp.int32,
    distance: wp.float32,
    pair_size: wp.float32,
    mean_ring: wp.float32,
    particles: Particles,
    rings: Rings,
    law: EnergyLaw,
) -> wp.vec2:
    """Add the force and curvature that two rings exert along the line from j to i.

    A sixth of the distance of two particles belongs to either ring that contains the other particle.
    """
    push = push_and_bend[0]
    bend = push_and_bend[1]
    size = particles.sizes[i]
    if distance <= rings.sixth_distances[i]:
        push += law.ring_weight / 6.0 * ring_cost_slope(mean_ring - rings.means[i]) * size / pair_size
    if distance <= rings.sixth_distances[j]:
        lever = particles.sizes[j] / pair_size
        push += (
            law.ring_weight
            / 6.0
            * ring_cost_slope(mean_ring - rings.means[j])
            * lever
            * particles.sizes[j]
            / size
        )
        bend += law.ring_weight / 36.0 * lever * lever
    return wp.vec2(push, bend)


@wp.func
def with_partner(
    system: NewtonSystem,
    partner: Partner,
    i: wp.int32,
    u: wp.vec3,
    v: wp.vec3,
    mean_ring: wp.float32,
    particles: Particles,
    rings: Rings,
    law: EnergyLaw,
) -> NewtonSystem:
    """Add the force, curvature and energy of a pair."""
    j = partner.index
    size = particles.sizes[i]
    pair_size = 0.5 * (size + particles.sizes[j])
    offset = particles.positions[i] - partner.position
    square = wp.length_sq(offset)
    if partner.weight > 0.0 and square < law.cutoff * law.cutoff * pair_size * pair_size:
        length = wp.sqrt(square)
        distance = length / pair_size
        direction = offset / length
        if distance < COINCIDENT:
            direction = partner.fallback_direction
            if j < i:
                direction = -direction
        terms = pair_terms(distance, law)

        # force and curvature along the line of the pair
        push = partner.weight * (pair_size / size) * terms.slope
        bend = partner.weight * terms.curvature
        if law.ring_weight > 0.0 and partner.weight >= 1.0:
            both = with_ring_terms(
                wp.vec2(push, bend), i, j, distance, pair_size, mean_ring, particles, rings, law
            )
            push = both[0]
            bend = both[1]
        bend *= partner.mirror_factor
        ax = wp.dot(direction, u)
        ay = wp.dot(direction, v)
        system.fx += push * ax
        system.fy += push * ay
        system.hxx += bend * ax * ax
        system.hxy += bend * ax * ay
        system.hyy += bend * ay * ay

        energy = partner.weight * terms.value
        system.energy += energy
        system.pair_energy += wp.float64(0.5 * pair_size * pair_size * energy)
    return system


@wp.func
def newton_move(system: NewtonSystem, u: wp.vec3, v: wp.vec3, size: wp.float32, law: EnergyLaw) -> wp.vec3:
    """Solve for the damped Newton step in the tangent plane of u and v, at most the longest move."""
    extra = ISOTROPY * (system.hxx + system.hyy)
    hxx = system.hxx + extra
    hyy = system.hyy + extra
    determinant = hxx * hyy - system.hxy * system.hxy
    move = wp.vec3(0.0, 0.0, 0.0)
    if determinant > 0.0:
        dx = (hyy * system.fx - system.hxy * system.fy) / determinant
        dy = (hxx * system.fy - system.hxy * system.fx) / determinant
        move = (dx * u + dy * v) * (law.damping * size)
        length = wp.length(move)
        if length > law.max_move * size:
            move = move * (law.max_move * size / length)
    return move


@wp.kernel
def list_neighbors(
    first: wp.int32, search: NeighborSearch, particles: Particles, lists: NeighborLists
) -> None:
    """List the neighbours of each particle that face the same way, the nearest first, of equals by the grid.

    In this order, processors predict well which neighbours are nearer than some limit.
    """
    i = first + wp.tid()
    p = particles.positions[i]
    n = particles.normals[i]
    size = particles.sizes[i]
    start = i * lists.capacity
    end = int(start)
    j = int(0)
    query = wp.hash_grid_query(search.grid, p, search.reach * search.widening * size)
    while wp.hash_grid_query_next(query, j):
        if j != i and end < start + lists.capacity:
            limit = search.reach * 0.5 * (size + particles.sizes[j])
            square = wp.length_sq(p - particles.positions[j])
            if square < limit * limit:
                weight = facing_weight(wp.dot(n, particles.normals[j]), search.facing_limit)
                weight *= sheet_weight(particles, i, particles, j)
                if weight > 0.0:
                    k = int(end)
                    while k > start and lists.weights[k - 1] > square:  # square distances until all are known
                        lists.indices[k] = lists.indices[k - 1]
                        lists.weights[k] = lists.weights[k - 1]
                        k -= 1
                    lists.indices[k] = j
                    lists.weights[k] = square
                    end += 1
    lists.counts[i] = end - start
    for k in range(start, end):
        j = lists.indices[k]
        weight = facing_weight(wp.dot(n, particles.normals[j]), search.facing_limit)
        lists.weights[k] = weight * sheet_weight(particles, i, particles, j)


@wp.kernel
def measure_rings(
    first: wp.int32,
    particles: Particles,
    lists: NeighborLists,
    farthest: wp.float32,
    mirrors: MirrorPlanes,
    rings: Rings,
) -> None:
    """Measure the mean distance of each particle to its six nearest neighbours, and that of the sixth.

    Neighbours of full weight count, and so do images behind mirror planes. A missing neighbour counts as if
    it lay at the farthest distance.
    """
    i = first + wp.tid()
    p = particles.positions[i]
    six = Six(farthest, farthest, farthest, farthest, farthest, farthest)
    for k in range(lists.counts[i] + 1):
        # after its neighbours the particle itself, for its own images
        j = int(i)
        list_weight = float(1.0)
        if k < lists.counts[i]:
            j = lists.indices[i * lists.capacity + k]
            list_weight = lists.weights[i * lists.capacity + k]
        pair_size = 0.5 * (particles.sizes[i] + particles.sizes[j])
        q = particles.positions[j]
        if j != i and list_weight >= 1.0:
            six = insert_distance(six, wp.length(p - q) / pair_size)
        for w in range(mirrors.per_point * i, mirrors.per_point * (i + 1)):
            weight = image_weight(
                q, j == i, mirrors.points[w], mirrors.normals[w], MIRROR_DEPTH * particles.sizes[i]
            )
            if list_weight * weight >= 1.0:
                image = mirrored(q, mirrors.points[w], mirrors.normals[w])
                six = insert_distance(six, wp.length(p - image) / pair_size)
    rings.means[i] = mean_distance(six)
    rings.sixth_distances[i] = six[5]


@wp.kernel
def repel(
    first: wp.int32,
    particles: Particles,
    lists: NeighborLists,
    rings: Rings,
    law: EnergyLaw,
    mirrors: MirrorPlanes,
    out: StepTerms,
) -> None:
    """Compute one damped Newton step of each particle in its tangent plane, its neighbours at rest.

    The energy of a pair at distance x, in the mean of its two spacings, is

        E(x) = x^-2 − c^-2 + 2 c^-3 (x − c) + ½ k max(core − x, 0)²,    x < c (the cutoff),

    so value and slope of the soft law vanish at the cutoff. Below `CLOSEST` E continues along its tangent.
    The curvature across the line of a pair is negative and left out.

    A pair adds E times its spacing squared to the total energy, so that the pressure is the same where
    spacings differ. ``out.pair_energies`` hold half of it for each of the two particles, and the ring term:
    `ring_weight` times the spacing squared times `ring_cost` of the ring's deviation from the mean one.
    ``out.energies`` are sums of E without factors and rings: they measure how crowded a particle is.

    Behind each mirror plane lie images of the neighbours and of the particle itself. Of the pair of a
    particle and its own image half the energy counts, and a move parts it twice as far.
    """
    i = first + wp.tid()
    u = any_tangent(particles.normals[i])
    v = wp.cross(particles.normals[i], u)
    size = particles.sizes[i]
    mean_ring = rings.total[0] / wp.float32(particles.positions.shape[0])
    start = i * lists.capacity
    end = start + lists.counts[i]
    system = NewtonSystem()
    for k in range(start, end):
        partner = Partner()
        partner.index = lists.indices[k]
        partner.position = particles.positions[partner.index]
        partner.weight = lists.weights[k]
        partner.fallback_direction = u
        partner.mirror_factor = 1.0
        system = with_partner(system, partner, i, u, v, mean_ring, particles, rings, law)
    for w in range(mirrors.per_point * i, mirrors.per_point * (i + 1)):
        own = image_of(i, i, w, 1.0, particles, mirrors)
        system = with_partner(system, own, i, u, v, mean_ring, particles, rings, law)
        for k in range(start, end):
            image = image_of(i, lists.indices[k], w, lists.weights[k], particles, mirrors)
            system = with_partner(system, image, i, u, v, mean_ring, particles, rings, law)
    ring_energy = size * size * law.ring_weight * ring_cost(mean_ring - rings.means[i])
    out.energies[i] = system.energy
    out.pair_energies[i] = system.pair_energy + wp.float64(ring_energy)
    out.moves[i] = newton_move(system, u, v, size, law)
