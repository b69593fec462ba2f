"""The oracle of `tests/oracles/decals.py` a second time, as a float64 Warp kernel, for 10⁸ points.

It stands on the paper and the design alone and shares no function with the implementation. Decals come in
sets of equal size that do not reach each other; a point is held against the members of its own set, by
brute force. `tests/decals/field/test_parity.py` holds it against the NumPy oracle.

Variables that a loop changes begin as literals: one that begins as a Warp constant would change the constant.
"""

# mypy: disable-error-code="call-arg, call-overload"
# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
import math

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)

RIM = wp.constant(wp.float64(math.sqrt(1 - 0.5 ** (1 / 3))))
ZERO = wp.constant(wp.float64(0.0))
HALF = wp.constant(wp.float64(0.5))
ONE = wp.constant(wp.float64(1.0))
TWO = wp.constant(wp.float64(2.0))
FOUR = wp.constant(wp.float64(4.0))
THIRD = wp.constant(wp.float64(1.0 / 3.0))
FACING_LIMIT = wp.constant(wp.float64(-0.25))
ON_TOP = wp.constant(wp.float64(0.5))
IMAGE_END = wp.constant(wp.float64(2.0 * math.sqrt(0.25001)))
KEPT_LEAST = wp.constant(wp.float64(0.21))
TINY = wp.constant(wp.float64(1e-300))
NEARLY = wp.constant(wp.float64(1e-3))
UNDERFLOW = wp.constant(wp.float64(1e-36))
PUSH = wp.constant(1)
MIN = wp.constant(1)
RADIAL = wp.constant(2)
ELASTIC = wp.constant(3)
STIFFNESS = wp.constant(wp.float64(2.0))
REACH_SQUARED = wp.constant(wp.float64(1.6))


@wp.struct
class Members:
    """Decals: `size` of them a set; rank = 4 layer + interaction, lowest layer 0."""

    size: wp.int32
    positions: wp.array(dtype=wp.vec3)
    normals: wp.array(dtype=wp.vec3)
    tangents: wp.array(dtype=wp.vec3)
    radii: wp.array(dtype=wp.float32)
    spill: wp.array(dtype=wp.int32)
    ranks: wp.array(dtype=wp.int32)


@wp.struct
class Answer:
    """Owner or −1; E = 1 − F; doubt: smallest relative change that changes the owner; edge: that of a cut.

    edge is 0 nearer to a centre than 1e-18 influence radii, where squares leave the range of float32.
    """

    owner: wp.int32
    complement: wp.float64
    doubt: wp.float64
    edge: wp.float64


@wp.func
def wide(v: wp.vec3) -> wp.vec3d:
    return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))


@wp.func
def log_one_plus(x: wp.float64) -> wp.float64:
    """Kahan's log1p."""
    u = ONE + x
    if u == ONE:
        return x
    return wp.log(u) * x / (u - ONE)


@wp.func
def complement(squared: wp.float64) -> wp.float64:
    """e = 1 − (1 − d²)³."""
    t = wp.min(squared, ONE)
    return t * (wp.float64(3.0) - wp.float64(3.0) * t + t * t)


@wp.func
def rim_of(e: wp.float64) -> wp.float64:
    """r / r_h."""
    c = wp.pow(ONE - e, THIRD)
    return wp.sqrt(e / (ONE + c + c * c)) / RIM


@wp.func
def relative(q: wp.vec3d, i: wp.int32, these: Members) -> wp.float64:
    """|q − p|² / s²."""
    w = q - wide(these.positions[i])
    s = wp.float64(these.radii[i]) / RIM
    return wp.dot(w, w) / (s * s)


@wp.func
def facing(n: wp.vec3d, i: wp.int32, these: Members) -> wp.bool:
    return these.spill[i] != 0 or wp.dot(n, wide(these.normals[i])) > FACING_LIMIT


@wp.func
def top_rank(q: wp.vec3d, n: wp.vec3d, first: wp.int32, these: Members) -> wp.int32:
    """Highest rank of which something shows; −1 outside all rims."""
    top = wp.int32(-1)
    for i in range(first, first + these.size):
        if facing(n, i, these) and complement(relative(q, i, these)) <= HALF:
            top = wp.max(top, these.ranks[i])
    return top


@wp.func
def doubt_of_rims(q: wp.vec3d, n: wp.vec3d, first: wp.int32, these: Members) -> wp.float64:
    """How near q lies to any rim, or to the limit of facing of what reaches it."""
    doubt = wp.float64(4.0)
    for i in range(first, first + these.size):
        squared = relative(q, i, these)
        if facing(n, i, these):
            doubt = wp.min(doubt, wp.abs(wp.sqrt(squared) / RIM - ONE))
        if squared < ONE and these.spill[i] == 0:
            doubt = wp.min(doubt, wp.abs(wp.dot(n, wide(these.normals[i])) - FACING_LIMIT))
    return doubt


@wp.func
def sheet(
    q: wp.vec3d,
    n: wp.vec3d,
    first: wp.int32,
    rank: wp.int32,
    contact: wp.int32,
    reach: wp.float64,
    these: Members,
) -> Answer:
    """Equation 5, repaired, over the decals of one rank; those beyond reach influence radii do not push."""
    owner = wp.int32(-1)
    least = wp.float64(4.0)
    second = wp.float64(4.0)
    edge = wp.float64(4.0)
    for i in range(first, first + these.size):
        if these.ranks[i] == rank and facing(n, i, these):
            squared = relative(q, i, these)
            edge = wp.min(edge, wp.abs(wp.sqrt(squared) / reach - ONE))
            second = wp.min(second, wp.max(least, squared))
            if squared < least:
                owner = i
            least = wp.min(least, squared)
    if least < UNDERFLOW:
        edge = wp.float64(0.0)
    own = complement(least)
    kept = wp.float64(1.0)
    for i in range(first, first + these.size):
        if i != owner and these.ranks[i] == rank and facing(n, i, these):
            squared = relative(q, i, these)
            e = complement(squared)
            if squared < reach * reach and e + own < ONE:
                factor = wp.float64(0.0)
                if e > own:
                    w = (e - own) / (ONE - TWO * own)
                    factor = ONE - wp.exp(log_one_plus(-w) / own)
                kept = wp.min(kept, factor) if contact == MIN else kept * factor
    return Answer(owner, own + (HALF - own) * (ONE - kept), wp.sqrt(second / wp.max(least, TINY)) - ONE, edge)


@wp.func
def power(q: wp.vec3d, i: wp.int32, these: Members) -> wp.float64:
    w = q - wide(these.positions[i])
    r = wp.float64(these.radii[i])
    return wp.dot(w, w) - r * r


@wp.func
def kept_share(i: wp.int32, j: wp.int32, these: Members) -> wp.float64:
    """Share of its radius that i keeps before the radical plane to j; at most 0 where they are concentric."""
    apart = wide(these.positions[j]) - wide(these.positions[i])
    a = wp.float64(these.radii[i])
    b = wp.float64(these.radii[j])
    d = wp.length(apart)
    if d == ZERO:
        return ZERO
    return (d * d + a * a - b * b) / (TWO * d * a)


@wp.func
def lie_over(i: wp.int32, j: wp.int32, these: Members) -> wp.bool:
    return kept_share(i, j, these) <= KEPT_LEAST or kept_share(j, i, these) <= KEPT_LEAST


@wp.func
def doubt_of_pair(own: wp.float64, other: wp.float64, i: wp.int32, j: wp.int32, these: Members) -> wp.float64:
    """How little parts the powers of two decals at hand, and whether they push or lie over each other."""
    a = wp.float64(these.radii[i]) * wp.float64(these.radii[i])
    b = wp.float64(these.radii[j]) * wp.float64(these.radii[j])
    if own > NEARLY * a or other > NEARLY * b:
        return FOUR
    push = wp.min(kept_share(i, j, these), kept_share(j, i, these)) - KEPT_LEAST
    return wp.min(wp.abs(other - own) / (a + b), wp.abs(push))


@wp.func
def moved_by(
    t: wp.float64, plane: wp.float64, own: wp.float64, other: wp.float64, d: wp.float64
) -> wp.float64:
    """How far a plane moves the image at t; t and the plane's distance on the ray in the radius `own`."""
    if plane >= ONE:
        return ZERO
    if t >= plane:
        return ONE - t
    # The share 1 - y of the way where the point on the ray with its plane on the rim enters the neighbour's
    # reach: y² own² + y (d² - other² - own²) = (1.6 - 1) other².
    p = HALF * (d * d / (own * own) - other * other / (own * own) - ONE)
    y = wp.sqrt(p * p + (REACH_SQUARED - ONE) * other * other / (own * own)) - p
    way = ONE - (ONE - t / plane) / wp.min(y, ONE)
    if way <= ZERO:
        return ZERO
    lost = ONE - plane
    return lost * wp.exp((STIFFNESS + wp.float64(0.1) / lost) * wp.log(way))


@wp.func
def unrolled(w: wp.vec3d, n_p: wp.vec3d, n_q: wp.vec3d) -> wp.vec4d:
    """Offset by an arc of the ends' harmonic mean height, and length by one of their geometric mean."""
    fall = -wp.dot(w, n_p)
    rise = wp.dot(w, n_q)
    turn = n_q - n_p
    angle = TWO * wp.atan2(wp.length(turn), wp.length(n_q + n_p))
    if fall * rise <= ZERO or angle == ZERO:
        return wp.vec4d(w[0], w[1], w[2], wp.length(w))
    versine = HALF * wp.dot(turn, turn)
    radius = TWO * fall * rise / ((fall + rise) * versine)
    toward = turn + versine * n_p
    m = w + radius * (angle - wp.sin(angle)) / wp.max(wp.sin(angle), TINY) * toward
    skew = (rise - fall) / (rise + fall)
    gain = fall * rise * (ONE + TWO * skew * skew) / (versine * versine)
    length = wp.sqrt(wp.dot(w, w) + gain * (angle * angle - TWO * versine))
    return wp.vec4d(m[0], m[1], m[2], length)


@wp.func
def spare(q: wp.vec3d, n: wp.vec3d, i: wp.int32, corrected: wp.bool, these: Members) -> wp.float64:
    """How far the image of i reaches beyond q, in its radii."""
    if not corrected:
        return FOUR
    w = (q - wide(these.positions[i])) / wp.float64(these.radii[i])
    return IMAGE_END - unrolled(w, wide(these.normals[i]), n)[3]


@wp.func
def convex(
    q: wp.vec3d,
    n: wp.vec3d,
    first: wp.int32,
    rank: wp.int32,
    contact: wp.int32,
    corrected: wp.bool,
    these: Members,
) -> Answer:
    """Radial and elastic contact: the uppermost cell that holds q, and where q lies on the ray to its end.

    The image of an upper decal reaches q.
    """
    owner = wp.int32(-1)
    doubt = wp.float64(4.0)
    smallest = wp.float64(1e300)
    for i in range(first, first + these.size):
        if these.ranks[i] == rank and facing(n, i, these):
            own = power(q, i, these)
            r = wp.float64(these.radii[i])
            inside = bool(own <= ZERO)
            away = wp.dot(n, wide(these.normals[i])) - ON_TOP
            left = wp.float64(4.0)
            if inside:
                left = spare(q, n, i, corrected, these)
            shows = bool((these.spill[i] != 0 or away > ZERO) and left >= ZERO)
            lowest = bool(True)
            for j in range(first, first + these.size):
                if j != i and these.ranks[j] == rank and facing(n, j, these):
                    doubt = wp.min(doubt, doubt_of_pair(own, power(q, j, these), i, j, these))
                    if power(q, j, these) < own:
                        lowest = False
                        if not lie_over(i, j, these):
                            inside = False
                        elif own <= ZERO:
                            doubt = wp.min(doubt, wp.abs(left))
                            if these.spill[i] == 0:
                                doubt = wp.min(doubt, wp.abs(away))
            if inside and (shows or lowest) and r < smallest:  # of equal ones the first stays
                smallest = r
                owner = i
    if owner < 0:
        return Answer(owner, ONE, doubt, FOUR)
    w = q - wide(these.positions[owner])
    x = wp.length(w)
    end = wp.float64(these.radii[owner])
    t = wp.min(x / end, ONE)
    squares = wp.float64(0.0)
    for j in range(first, first + these.size):
        if j != owner and these.ranks[j] == rank and facing(n, j, these):
            apart = wide(these.positions[j]) - wide(these.positions[owner])
            ahead = wp.dot(w, apart) / wp.max(x, TINY)
            if ahead > ZERO:
                if not lie_over(owner, j, these):
                    r = wp.float64(these.radii[owner])
                    plane = kept_share(owner, j, these) * r * wp.length(apart) / ahead
                    end = wp.min(end, plane)
                    moved = moved_by(t, plane / r, r, wp.float64(these.radii[j]), wp.length(apart))
                    ratio = moved / wp.max(ONE - t - moved, TINY)
                    if ratio < wp.float64(1e100):
                        squares += ratio * ratio
    share = wp.min(x / end, ONE) * RIM
    if contact == ELASTIC and share < RIM:
        total = wp.sqrt(squares)
        share = (t + (ONE - t) * total / (ONE + total)) * RIM
    edge = wp.float64(4.0)
    for j in range(first, first + these.size):
        if contact == ELASTIC and these.ranks[j] == rank and these.radii[j] < these.radii[owner]:
            if relative(q, j, these) < wp.float64(1.7) * RIM * RIM:
                push = wp.min(kept_share(owner, j, these), kept_share(j, owner, these)) - KEPT_LEAST
                edge = wp.min(edge, wp.float64(0.01) * wp.abs(push))
                if these.spill[j] == 0 and push <= ZERO:
                    away = wp.dot(n, wide(these.normals[j])) - ON_TOP
                    edge = wp.min(edge, wp.float64(0.1) * wp.abs(away))
    return Answer(owner, complement(share * share), doubt, edge)


@wp.func
def sixth_power(x: wp.float64) -> wp.float64:
    squared = x * x
    return squared * squared * squared


@wp.func
def parted(q: wp.vec3d, n: wp.vec3d, i: wp.int32, these: Members) -> wp.vec3d:
    """Step towards smaller decals that lie over i: the slope of the 6-norm of their potentials."""
    first = i - i % these.size
    own = wp.float64(these.radii[i])
    highest = wp.float64(0.0)
    for turn in range(2):
        total = wp.float64(0.0)
        step = wp.vec3d(ZERO, ZERO, ZERO)
        for j in range(first, first + these.size):
            over = bool(these.spill[j] != 0 or wp.dot(n, wide(these.normals[j])) > ON_TOP)
            if over and these.ranks[j] == these.ranks[i] and these.radii[j] < these.radii[i]:
                if lie_over(i, j, these):
                    size = wp.float64(these.radii[j]) / own
                    away = (q - wide(these.positions[j])) / own
                    d = wp.dot(away, away) / (size * size)
                    left = wp.max((REACH_SQUARED - d) / wp.float64(0.6), ZERO)
                    height = wp.float64(0.1) * left * left * left
                    slope = left * left
                    if d < ONE:
                        height = wp.float64(0.1) + HALF * (ONE - d)
                        slope = wp.float64(1.0)
                    amount = wp.float64(0.35) * (ONE - size * size)
                    height = height * amount * size * size
                    if turn == 0:
                        highest = wp.max(highest, height)
                    elif height > ZERO:
                        total += sixth_power(height / highest)
                        step -= sixth_power(height / highest) * highest / height * slope * amount * away
        if turn == 1 and total > ZERO:
            return step / wp.pow(total, wp.float64(5.0) / wp.float64(6.0))
    return wp.vec3d(ZERO, ZERO, ZERO)


@wp.func
def turned(step: wp.vec3d, n_p: wp.vec3d, n_q: wp.vec3d) -> wp.vec3d:
    """The tangential part of a step at n_q, turned with n_q to n_p on the shortest way."""
    flat = step - wp.dot(step, n_q) * n_q
    middle = n_p + n_q
    return flat - TWO * wp.dot(flat, middle) / wp.max(wp.dot(middle, middle), TINY) * middle


@wp.func
def place(
    q: wp.vec3d,
    n: wp.vec3d,
    i: wp.int32,
    e: wp.float64,
    corrected: wp.bool,
    contact: wp.int32,
    these: Members,
) -> wp.vec3d:
    """Image coordinates of q in decal i, and |q − p| over the offset's length in the tangent plane."""
    normal = wide(these.normals[i])
    tangent = wide(these.tangents[i])
    w = (q - wide(these.positions[i])) / wp.float64(these.radii[i])
    chord = wp.length(w)
    m = w
    drawn = wp.min(rim_of(e), ONE)
    if corrected:
        bent = unrolled(w, normal, n)
        m = wp.vec3d(bent[0], bent[1], bent[2])
        left = (ONE - drawn) * (ONE - bent[3]) / (ONE - chord)
        drawn = ONE - left if bent[3] < ONE else bent[3]
    x = wp.dot(m, tangent)
    y = wp.dot(m, wp.cross(normal, tangent))
    shadow = wp.max(wp.sqrt(x * x + y * y), TINY)
    r = HALF * drawn / shadow
    aside = wp.vec3d(ZERO, ZERO, ZERO)
    if contact == ELASTIC and (these.ranks[i] & 3) == PUSH:
        aside = HALF * wp.max(ONE - drawn * drawn, ZERO) * turned(parted(q, n, i, these), normal, n)
    u = HALF + r * x + wp.dot(aside, tangent)
    v = HALF + r * y + wp.dot(aside, wp.cross(normal, tangent))
    return wp.vec3d(u, v, chord / shadow)


@wp.func
def doubted(answer: Answer, doubt: wp.float64) -> Answer:
    return Answer(answer.owner, answer.complement, wp.min(answer.doubt, doubt), answer.edge)


@wp.func
def topmost(
    q: wp.vec3d,
    n: wp.vec3d,
    group: wp.int32,
    contact: wp.int32,
    corrected: wp.bool,
    reach: wp.float64,
    these: Members,
) -> Answer:
    """What the topmost decal of a set shows at q, with unit normal n."""
    first = group * these.size
    rank = top_rank(q, n, first, these)
    if rank < 0:
        return Answer(-1, ONE, doubt_of_rims(q, n, first, these), FOUR)
    if (rank & 3) == PUSH:
        if contact >= RADIAL:
            return doubted(
                convex(q, n, first, rank, contact, corrected, these), doubt_of_rims(q, n, first, these)
            )
        return doubted(sheet(q, n, first, rank, contact, reach, these), doubt_of_rims(q, n, first, these))
    owner = wp.int32(-1)
    e = wp.float64(1.0)
    for i in range(first, first + these.size):
        if these.ranks[i] == rank and facing(n, i, these):
            if complement(relative(q, i, these)) <= HALF:
                owner = i
                e = complement(relative(q, i, these))
    return Answer(owner, e, doubt_of_rims(q, n, first, these), FOUR)


@wp.kernel
def answer_points(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    sets: wp.array(dtype=wp.int32),
    contact: wp.int32,
    corrected: wp.bool,
    reach: wp.float64,
    these: Members,
    owners: wp.array(dtype=wp.int32),
    complements: wp.array(dtype=wp.float64),
    places: wp.array(dtype=wp.vec3d),
    doubts: wp.array(dtype=wp.float64),
    edges: wp.array(dtype=wp.float64),
) -> None:
    """Owner, E, (uv, stretch), doubt and edge (a neighbour's distance from reach) of points in sets."""
    i = wp.tid()
    q = wide(points[i])
    n = wp.normalize(wide(normals[i]))
    found = topmost(q, n, sets[i], contact, corrected, reach, these)
    owners[i] = found.owner
    complements[i] = found.complement
    doubts[i] = found.doubt
    edges[i] = found.edge
    places[i] = wp.vec3d(ZERO, ZERO, ONE)
    if found.owner >= 0:
        places[i] = place(q, n, found.owner, found.complement, corrected, contact, these)
