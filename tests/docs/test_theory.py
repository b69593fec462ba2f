"""The formulas of docs/theory.md in NumPy, against `decals.evaluate` and `decals.scatter`.

Each function follows the text of one section; nothing is taken from the package but its public API.
"""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Point
from decals import Contact, Decals, ImageMapping, Interaction, Relaxation, Sizing, evaluate, scatter
from decals.surfaces import ImplicitSurface

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

RIM = np.sqrt(1 - 2 ** (-1 / 3))
NEIGHBOUR_REACH = 0.575
FACING_LIMIT = -0.25
TOP_LIMIT = 0.5
LEAST_PART = 0.21
STIFFNESS = 2.0
ABSENT = 2.0
POINTS = 6000


def complement(z: Array) -> Array:
    """Section 1."""
    t = np.minimum(z, 1.0)
    result: Array = t * (3 - t * (3 - t))
    return result


class World:
    """All decals at all points, in float64."""

    def __init__(self, decals: Decals, points: Array, normals: Array, mapping: ImageMapping) -> None:
        self.decals, self.points, self.normals = decals, points, normals
        self.centres = decals.positions.astype(np.float64)
        self.radii = decals.radii.astype(np.float64)
        self.distances = np.linalg.norm(points[:, None] - self.centres[None], axis=2)
        cosines = normals @ decals.normals.astype(np.float64).T
        self.faces = decals.spill[None] | (cosines > FACING_LIMIT)
        self.tops = decals.spill[None] | (cosines > TOP_LIMIT)
        self.reaches = np.ones_like(self.tops)
        if mapping == ImageMapping.CORRECTED:
            each = np.indices(self.tops.shape).reshape(2, -1)
            w = (points[each[0]] - self.centres[each[1]]) / self.radii[each[1], None]
            lengths = unrolled(w, decals.normals[each[1]].astype(np.float64), normals[each[0]])[1]
            self.reaches = (lengths**2 / 4 <= 0.25001).reshape(self.tops.shape)
        influence = self.radii / RIM
        acts = self.faces & (self.distances < NEIGHBOUR_REACH * influence)
        self.e = np.where(acts, complement((self.distances / influence) ** 2), ABSENT)

    def groups(self) -> list[Ints]:
        """Section 3: indices that are drawn together, from the topmost down."""
        ranks = 4 * (self.decals.layers.astype(np.int64) + 2**19) + self.decals.interactions
        groups: list[Ints] = []
        for rank in np.unique(ranks)[::-1]:
            members = np.flatnonzero(ranks == rank)
            push = rank % 4 == Interaction.PUSH
            groups += [members] if push else [members[i : i + 1] for i in range(len(members))[::-1]]
        return groups


def shown_product(world: World, group: Ints, contact: Contact) -> tuple[Ints, Array]:
    """Sections 4 and 5: owner in the group or −1, and E."""
    e = world.e[:, group]
    rows = np.arange(len(e))
    k = e.argmin(axis=1)
    e_k = e[rows, k][:, None]
    owned = e_k[:, 0] <= 0.5
    w = (e - e_k) / np.maximum(1 - 2 * e_k, 1e-7)
    with np.errstate(all="ignore"):
        phi = np.where(w >= 1, 0.0, np.exp(np.log1p(-np.minimum(w, 1)) / np.maximum(e_k, 1e-37)))
    phi[rows, k] = 0.0
    push = phi.max(axis=1) if contact == Contact.MIN else 1 - np.prod(1 - phi, axis=1)
    return np.where(owned, group[k], -1), e_k[:, 0] + (0.5 - e_k[:, 0]) * push


def shown_in_cells(world: World, group: Ints, contact: Contact) -> tuple[Ints, Array]:
    """Section 6: owner in the group or −1, and E."""
    centres, radii = world.centres[group], world.radii[group]
    offsets = centres[None] - centres[:, None]
    distance = np.linalg.norm(offsets, axis=2)
    with np.errstate(all="ignore"):
        kept = (distance**2 + radii[:, None] ** 2 - radii[None] ** 2) / (2 * distance * radii[:, None])
    stacked = (kept <= LEAST_PART) | (kept.T <= LEAST_PART) | (distance == 0)
    power = world.distances[:, group] ** 2 - radii**2
    inside = world.e[:, group] <= 0.5
    upper_first = np.lexsort((group, radii))
    owner = np.full(len(power), -1)
    for i in upper_first[::-1]:
        less = inside & (power < power[:, i : i + 1])
        shows = world.tops[:, group[i]] & world.reaches[:, group[i]]
        on_top = shows | ~less.any(axis=1)
        owner[inside[:, i] & ~(less & ~stacked[i]).any(axis=1) & on_top] = i
    ray = world.points - centres[owner]
    x = np.linalg.norm(ray, axis=1)
    ray /= np.maximum(x, 1e-300)[:, None]
    ahead = np.einsum("ma,mja->mj", ray, offsets[owner])
    counts = world.faces[:, group] & ~stacked[owner] & (ahead > 0)
    plane = 0.5 * (distance**2 + radii[:, None] ** 2 - radii[None] ** 2)[owner]
    leaves = np.where(counts, plane / np.where(counts, ahead, 1.0), np.inf)
    own = radii[owner]
    if contact == Contact.ELASTIC:
        t = np.minimum(x / own, 1)
        drawn = compressed(t, leaves / own[:, None], own, radii, distance[owner])
    else:
        drawn = np.minimum(x / np.minimum(own, leaves.min(axis=1)), 1)
    return np.where(owner >= 0, group[owner], -1), complement((drawn * RIM) ** 2)


def compressed(t: Array, planes: Array, radius: Array, radii: Array, distance: Array) -> Array:
    """Section 6, mode ELASTIC: λ of points at t, with the planes of all competitors at R_j."""
    g = distance**2 - radii**2 - radius[:, None] ** 2
    root = np.sqrt(g**2 + 2.4 * (radius[:, None] * radii) ** 2)
    y = np.minimum(1.2 * radii**2 / (g + root), 1)
    x = np.clip(1 - (1 - t[:, None] / planes) / y, 0, 1)
    left = np.maximum(1 - planes, 1e-300)
    delta = np.where(planes < 1, left * x ** (STIFFNESS + 0.1 / left), 0)
    z = np.sqrt(((delta / np.maximum(1 - t[:, None] - delta, 1e-12)) ** 2).sum(axis=1))
    result: Array = t + (1 - t) * z / (1 + z)
    return result


def displacements(world: World, owner: Ints) -> Array:
    """Section 6, parting: the step of the image at points that have an owner, in its tangent plane."""
    ranks = list(zip(world.decals.layers.tolist(), world.decals.interactions.tolist(), strict=True))
    result = np.zeros((len(owner), 3))
    for row, k in enumerate(owner.tolist()):
        if ranks[k][1] != Interaction.PUSH:
            continue
        heights, steps = [], []
        for i in range(len(ranks)):
            b = world.radii[i] / world.radii[k]
            gap = float(np.linalg.norm(world.centres[i] - world.centres[k])) / world.radii[k]
            part = min(gap**2 + 1 - b * b, (gap**2 + b * b - 1) / b) if b < 1 else 1.0
            if ranks[i] == ranks[k] and b < 1 and part <= LEAST_PART * 2 * gap and world.tops[row, i]:
                d2 = (world.distances[row, i] / world.radii[i]) ** 2
                a, u = 0.35 * (1 - b * b), max((1.6 - d2) / 0.6, 0.0)
                heights.append(a * b * b * (0.1 * u**3 if d2 >= 1 else 0.6 - d2 / 2))
                away = (world.points[row] - world.centres[i]) / world.radii[k]
                steps.append(-a * (u * u if d2 >= 1 else 1.0) * away)
        if max(heights, default=0.0) > 0:
            s = np.array(heights) / max(heights)
            result[row] = (s**7 / (s**8).sum() ** (7 / 8)) @ np.array(steps)
    n, n_q = world.decals.normals[owner].astype(np.float64), world.normals
    flat = result - (result * n_q).sum(axis=1)[:, None] * n_q
    share = (flat * n).sum(axis=1) / np.maximum(1 + (n * n_q).sum(axis=1), 1e-8)
    turned: Array = flat - share[:, None] * n_q
    return turned


def unrolled(w: Array, n: Array, n_q: Array) -> tuple[Array, Array]:
    """Section 7, CORRECTED: m and L."""
    a, b = -(w * n).sum(axis=1), (w * n_q).sum(axis=1)
    bend = a * b
    x = np.maximum(0.25 * ((n_q - n) ** 2).sum(axis=1), 1e-20)
    cosine = np.maximum(0.5 * np.linalg.norm(n_q + n, axis=1), 1e-4)
    half = np.arctan2(np.sqrt(x), cosine)
    stretch = half / np.sin(half)
    arc = bend > 1e-37
    total = np.where(arc, a + b, 1.0)
    factor = np.where(arc, bend / total * (stretch - cosine) / (x * cosine), 0.0)
    m = w + factor[:, None] * (n_q - n + 2 * x[:, None] * n)
    y = (b - a) / total
    longer = np.where(arc, bend * (1 + 2 * y * y) * (stretch**2 - 1) / x, 0.0)
    length: Array = np.sqrt((w**2).sum(axis=1) + longer)
    return m, length


def image_coordinates(world: World, owner: Ints, e: Array, mapping: ImageMapping, contact: Contact) -> Array:
    """Section 7, for points that have an owner."""
    c = np.cbrt(1 - e)
    rim = np.minimum(np.sqrt(e / (1 + c + c * c)) / RIM, 1)
    n, u = (a[owner].astype(np.float64) for a in (world.decals.normals, world.decals.tangents))
    n_q = world.normals
    w = (world.points - world.centres[owner]) / world.radii[owner][:, None]
    chord = np.linalg.norm(w, axis=1)
    m, drawn = w, rim
    if mapping == ImageMapping.CORRECTED:
        m, length = unrolled(w, n, n_q)
        t = np.clip((length - chord) / np.maximum(1 - chord, 1e-7), 0, 1)
        drawn = np.maximum(rim + (1 - rim) * t, length)
    xy = np.column_stack([(m * u).sum(axis=1), (m * np.cross(n, u)).sum(axis=1)])
    uv: Array = 0.5 + 0.5 * (drawn / np.maximum(np.linalg.norm(xy, axis=1), 1e-300))[:, None] * xy
    if contact == Contact.ELASTIC:
        moved = 0.5 * np.maximum(1 - drawn**2, 0)[:, None] * displacements(world, owner)
        uv += np.column_stack([(moved * u).sum(axis=1), (moved * np.cross(n, u)).sum(axis=1)])
    return uv


def reference(
    decals: Decals, points: Array, normals: Array, contact: Contact, mapping: ImageMapping
) -> tuple[Ints, Array, Array]:
    """Owner, field and image coordinates from the formulas of the page."""
    world = World(decals, points, normals, mapping)
    owner, e = np.full(len(points), -1), np.ones(len(points))
    for group in world.groups():
        if decals.interactions[group[0]] != Interaction.PUSH:
            complements = world.e[:, group[0]]
            shown = np.where(complements <= 0.5, group[0], -1)
        elif contact in (Contact.RADIAL, Contact.ELASTIC):
            shown, complements = shown_in_cells(world, group, contact)
        else:
            shown, complements = shown_product(world, group, contact)
        free = (owner < 0) & (shown >= 0)
        owner[free], e[free] = shown[free], complements[free]
    uv = np.zeros((len(points), 2))
    owned = owner >= 0
    inside = World(decals, points[owned], normals[owned], mapping)
    uv[owned] = image_coordinates(inside, owner[owned], e[owned], mapping, contact)
    return owner, np.where(owned, 1 - e, 0.0), uv


def decals_of(**columns: Any) -> Decals:
    """Decals from columns of any array-like type."""
    return Decals(**columns)


def on_a_sphere(rng: np.random.Generator, count: int) -> Array:
    """Unit vectors."""
    vectors = rng.normal(size=(count, 3))
    units: Array = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return units


def some_decals(rng: np.random.Generator, *, layered: bool) -> Decals:
    """Overlapping decals of very different sizes on the unit sphere, some of them stacked."""
    count = 60
    centres = on_a_sphere(rng, count)
    options: dict[str, Any] = {}
    if layered:
        options = {"interactions": rng.integers(0, 3, count), "layers": rng.integers(-1, 2, count)}
    return decals_of(
        positions=centres,
        normals=centres,
        tangents=rng.normal(size=(count, 3)),
        radii=0.06 * 6.0 ** rng.random(count),
        spill=rng.random(count) < 0.2,
        **options,
    )


@pytest.mark.slow_cases("ELASTIC-chord-one layer")
@pytest.mark.parametrize("layered", [False, True], ids=["one layer", "layers"])
@pytest.mark.parametrize("mapping", [ImageMapping.CHORD, ImageMapping.CORRECTED], ids=["chord", "corrected"])
@pytest.mark.parametrize("contact", list(Contact), ids=lambda contact: contact.name)
def test_formulas_of_the_page_give_what_evaluate_gives(
    contact: Contact, mapping: ImageMapping, layered: bool
) -> None:
    rng = np.random.default_rng(7)
    decals = some_decals(rng, layered=layered)
    points: Array = on_a_sphere(rng, POINTS).astype(np.float32).astype(np.float64)
    normals = points / np.linalg.norm(points, axis=1)[:, None]
    samples = evaluate(decals, points, normals, contact=contact, mapping=mapping)
    owner, field, uv = reference(decals, points, normals, contact, mapping)
    same = samples.owner == owner
    owned = same & (owner >= 0)
    assert (owner >= 0).mean() > 0.3
    assert same.mean() > 0.999
    # Beyond 0.575 s a neighbour would act a little; float32 does the rest where images are stretched.
    assert np.quantile(np.abs(samples.field - field)[owned], 0.999) < 1e-3
    assert np.quantile(np.abs(samples.uv - uv)[owned], 0.99) < 1e-3
    assert np.median(np.abs(samples.uv - uv)[owned]) < 1e-6


def test_concentric_equal_decals_show_their_rim_alone() -> None:
    decals = decals_of(
        positions=np.zeros((2, 3)), normals=[[0, 0, 1]] * 2, tangents=[[1, 0, 0]] * 2, radii=[1.0, 1.0]
    )
    point, normal = [[0.3, 0.2, 0.0]], [[0.0, 0.0, 1.0]]
    pushed = evaluate(decals, point, normal, contact=Contact.PRODUCT)
    assert pushed.owner[0] == 0
    assert pushed.field[0] == pytest.approx(0.5)
    stacked = evaluate(decals, point, normal, contact=Contact.RADIAL)
    assert stacked.owner[0] == 0
    assert stacked.field[0] > 0.9


def test_a_decal_of_opacity_0_owns_its_points() -> None:
    decals = decals_of(
        positions=np.zeros((1, 3)), normals=[[0, 0, 1]], tangents=[[1, 0, 0]], radii=[1.0], opacities=[0.0]
    )
    image = np.full((4, 4, 4), 255, np.uint8)
    samples = evaluate(decals, [[0.3, 0.2, 0.0]], [[0.0, 0.0, 1.0]], images=[image])
    assert samples.owner[0] == 0
    assert samples.color is not None
    assert not samples.color.any()


def test_the_pair_energy_of_the_page_is_that_of_a_relaxation() -> None:
    """Section 10, at the first step: no spring and no rings yet."""
    ball = ImplicitSurface(Point((0, 0, 0), radius=1.0))
    relaxation = Relaxation(ball, count=300, seed=3, iterations=150)
    assert relaxation.spacing == pytest.approx(np.sqrt(2 * ball.area / (np.sqrt(3) * 300)))
    relaxation.step()
    positions = relaxation.positions.astype(np.float64)
    i, j = np.triu_indices(len(positions), 1)
    x = np.linalg.norm(positions[i] - positions[j], axis=1) / relaxation.spacing
    cutoff, closest = 2.0, 0.6
    clamped = np.maximum(x, closest)
    values = clamped**-2 - cutoff**-2 + 2 * cutoff**-3 * (clamped - cutoff)
    values += (clamped - x) * 2 * (clamped**-3 - cutoff**-3)
    assert relaxation.energy == pytest.approx(values[x < cutoff].sum(), rel=1e-5)


def test_touching_radii_are_half_the_distance_to_the_nearest() -> None:
    """Section 11."""
    ball = ImplicitSurface(Point((0, 0, 0), radius=1.0))
    decals = scatter(ball, count=100, sizing=Sizing.TOUCHING)
    distances = np.linalg.norm(decals.positions[:, None] - decals.positions[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    np.testing.assert_allclose(decals.radii, 0.5 * distances.min(axis=1), rtol=1e-5)
