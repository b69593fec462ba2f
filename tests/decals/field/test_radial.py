"""Contact in convex cells: never folds, squeezes within limits, leaves no gap, and is what float64 says."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from decals import Contact, Decals, ImageMapping, evaluate
from decals.index.index import index_on
from tests.decals.field.kernels import rims_of_points, slopes_of_rays
from tests.oracles.contact import RIM
from tests.vectors import random_units, unit

LEAST = 0.21
CELLS = [Contact.RADIAL, Contact.ELASTIC]
ERROR_LIMIT = 2e-5
"""Largest accepted error of r, in rim radii."""
SETS = 2000
MEMBERS = 9


def clusters(rng: np.random.Generator, *, ratio: float = 20.0, flat: bool = False) -> Any:
    """SETS sets of a decal and 1 to 8 neighbours anywhere in its reach, sizes to 20:1; far from each other.

    Places that a set leaves empty hold tiny decals far away.
    """
    radii = np.exp(rng.uniform(-0.5, 0.5, (SETS, MEMBERS)) * np.log(ratio))
    distance = (radii + radii[:, :1]) * rng.uniform(0, 1, (SETS, MEMBERS))
    positions = unit(rng.normal(size=(SETS, MEMBERS, 3)) * [1, 1, 0 if flat else 1]) * distance[..., None]
    positions[:, 0] = 0
    unused = np.arange(MEMBERS) > rng.integers(1, MEMBERS, (SETS, 1))
    positions[unused] = [0, 0, 30]
    radii[unused] = 0.01
    place = np.stack(np.unravel_index(np.arange(SETS), (13, 13, 13)), -1) * 100.0
    positions = (positions + place[:, None]).reshape(-1, 3)
    count = len(positions)
    frame = np.tile([[0, 0, 1.0]], (count, 1)), np.tile([[1.0, 0, 0]], (count, 1))
    return Decals(positions, *frame, radii.reshape(-1))


def launch(kernel: Any, count: int, decals: Decals, before: Any, after: Any) -> Any:
    inputs = [
        index_on(decals, "cpu"),
    ]
    wp.launch(kernel, count, [*before, *inputs], after, device="cpu")
    return [array.numpy() for array in after]


@pytest.mark.slow_cases("False-2", "True-2")
@pytest.mark.parametrize("contact", CELLS)
@pytest.mark.parametrize("flat", [False, True])
def test_nothing_folds_on_many_rays(flat: bool, contact: Contact) -> None:
    """Half of them in space and half in a plane: from every decal's own centre, past all its neighbours."""
    rng = np.random.default_rng(1 + flat)
    decals, count = clusters(rng, flat=flat), 500_000 if contact is Contact.RADIAL else 100_000
    owners = rng.integers(0, len(decals), count)
    owners = np.where(decals.radii[owners] > 0.05, owners, owners // MEMBERS * MEMBERS)
    rays = unit(rng.normal(size=(count, 3)) * [1, 1, 0 if flat else 1])
    before: list[Any] = [
        wp.array(owners, dtype=wp.int32, device="cpu"),
        wp.array(rays, dtype=wp.vec3, device="cpu"),
        int(contact),
    ]
    after = [wp.zeros(count, dtype=wp.float32, device="cpu") for _ in range(2)]
    least, most = launch(slopes_of_rays, count, decals, before, after)
    print(f"slopes from {least.min():.3f} to {most.max():.3f}; {(most > 1.001).mean():.0%} of rays pushed")
    assert least.min() > 0.5
    assert most.max() < (5 if contact is Contact.RADIAL else 10)
    assert (most > 1.2).mean() > 0.05


def rims_in_float64(decals: Decals, points: NDArray[Any]) -> Any:
    """Owners, rims and doubts by brute force over each point's own set, from the same float32 numbers."""
    p = decals.positions.astype(float).reshape(SETS, MEMBERS, 3)
    rho = decals.radii.astype(float).reshape(SETS, MEMBERS)
    d = np.linalg.norm(p[:, :, None] - p[:, None], axis=3)
    with np.errstate(all="ignore"):
        plane = (d**2 + rho[:, :, None] ** 2 - rho[:, None] ** 2) / (2 * d)
    pushes = (plane > LEAST * rho[:, :, None]) & (plane.swapaxes(1, 2) > LEAST * rho[:, None])
    own = np.repeat(np.arange(SETS), len(points) // SETS)
    p, rho, d, plane, pushes = (array[own] for array in (p, rho, d, plane, pushes))
    w = points[:, None] - p
    power = (w * w).sum(axis=2) - rho**2
    cut = pushes & (power[:, None] < power[:, :, None])
    shows = (power <= 0) & ~cut.any(axis=2)
    owner = np.where(shows, rho + 1e-9 * np.arange(MEMBERS), np.inf).argmin(axis=1)
    rows = np.arange(len(points))
    x = np.linalg.norm(w[rows, owner], axis=1)
    ray = w[rows, owner] / np.maximum(x, 1e-300)[:, None]
    along = ((p - p[rows, owner][:, None]) * ray[:, None]).sum(axis=2)
    with np.errstate(all="ignore"):
        end = plane[rows, owner] * d[rows, owner] / along
    end = np.where(pushes[rows, owner] & (along > 0), end, np.inf).min(axis=1)
    rim = np.minimum(x / np.minimum(end, rho[rows, owner]), 1)
    ordered = np.sort(np.where(power < rho**2, power, 1e9 * np.arange(1, MEMBERS + 1)), axis=1)
    gaps = np.diff(ordered).min(axis=1) / rho.max(axis=1) ** 2
    doubt = np.minimum(np.abs(power / rho**2).min(axis=1), gaps)
    return np.where(shows.any(axis=1), own * MEMBERS + owner, -1), rim, doubt


@pytest.mark.parametrize("rounds", [1, pytest.param(9, marks=pytest.mark.slow)])
def test_a_hundred_thousand_points_against_float64(rounds: int) -> None:
    rng = np.random.default_rng(2 + rounds)
    decals, worst, owned, sure = clusters(rng), 0.0, 0, 0
    for _ in range(rounds):
        which = np.repeat(np.arange(SETS) * MEMBERS, 50) + rng.integers(0, MEMBERS, SETS * 50)
        which = np.where(decals.radii[which] > 0.05, which, which // MEMBERS * MEMBERS)
        count = len(which)
        far = np.where(rng.random(count) < 0.2, 10.0 ** rng.uniform(-6, 0, count), rng.uniform(0, 1.1, count))
        points = decals.positions[which] + random_units(rng, count) * (far * decals.radii[which])[:, None]
        points = points.astype(np.float32)
        before = [wp.array(points, dtype=wp.vec3, device="cpu"), int(Contact.RADIAL)]
        after = [
            wp.zeros(count, dtype=wp.int32, device="cpu"),
            wp.zeros(count, dtype=wp.float32, device="cpu"),
        ]
        owner, rim = launch(rims_of_points, count, decals, before, after)
        want_owner, want_rim, doubt = rims_in_float64(decals, points.astype(float))
        assert np.isfinite(rim).all()
        clear = doubt > 1e-4
        assert np.array_equal(owner[clear], want_owner[clear])
        both = (owner == want_owner) & (owner >= 0)
        worst = max(worst, np.abs(rim - want_rim)[both].max())
        owned, sure = owned + both.sum(), sure + clear.sum()
    print(f"{worst:.2e} rim radii over {owned:,} owned points, {sure:,} clear")
    assert owned > 80_000 * rounds
    assert sure > 90_000 * rounds
    assert worst <= ERROR_LIMIT


@pytest.mark.parametrize("mapping", [ImageMapping.CHORD, ImageMapping.CORRECTED])
@pytest.mark.parametrize("contact", CELLS)
@pytest.mark.parametrize("above", [1, 2, 9])
def test_a_larger_decal_shows_between_end_and_rim_of_one_above(
    above: int, contact: Contact, mapping: ImageMapping
) -> None:
    """On the unit ball, an image of radius r ends at the angle r, and its rim lies at 2 asin(r/2)."""
    radius, turn = 0.5, 0.3 + 2e-7 * np.arange(above)  # more than 8 on one point are traversed again
    pole = np.array([np.sin(turn), 0 * turn, np.cos(turn)]).T
    centres = np.vstack([[[0, 0, 1.0]], pole])
    decals = Decals(centres, centres, [[0, 1, 0]] * (1 + above), [1.2, *[radius] * above])
    ends = {ImageMapping.CHORD: 2 * np.arcsin(radius / 2), ImageMapping.CORRECTED: radius}
    angle, around = np.meshgrid(np.linspace(0.485, 0.52, 351), np.linspace(0, 6, 13))
    around_pole = np.stack([np.cos(around), np.sin(around), 0 * around]) * np.sin(angle)
    x, y, z = around_pole[0], around_pole[1], np.cos(angle)
    points = np.stack([np.cos(0.3) * x + np.sin(0.3) * z, y, np.cos(0.3) * z - np.sin(0.3) * x], -1)
    seen = evaluate(decals, *[points.reshape(-1, 3)] * 2, mapping=mapping, contact=contact, device="cpu")
    owner = seen.owner.reshape(angle.shape)
    clear = np.abs(angle - ends[mapping]) > 5e-5
    assert np.array_equal((owner > 0)[clear], (angle < ends[mapping])[clear])
    assert (np.hypot(*(seen.uv - 0.5).T) <= 0.5 + 1e-5).all()
    assert (owner == 0).any()
    assert (owner > 0).any()


def pair(distance: float, radius: float, other: Any) -> Any:
    return Decals([[0.0, 0, 0], [distance, 0, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [radius, other])


@pytest.mark.parametrize("contact", CELLS)
@pytest.mark.parametrize("seed", range(20))
def test_two_decals_meet_on_their_rims_and_keep_their_centres(seed: int, contact: Contact) -> None:
    rng = np.random.default_rng(seed)
    radius = np.exp(rng.uniform(-2, 2))
    kept, kept_by_other = rng.uniform(0.22, 0.97, 2)  # shares of the radii up to the plane
    chord = radius * np.sqrt(1 - kept**2)
    other = chord / np.sqrt(1 - kept_by_other**2)
    plane, distance = kept * radius, kept * radius + kept_by_other * other
    height = chord * np.linspace(-0.95, 0.95, 9)
    for side in (-1e-6, 1e-6):
        points = np.column_stack([np.full(9, plane + side * distance), height, np.zeros(9)])
        samples = evaluate(
            pair(distance, radius, other), points, np.tile([0, 0, 1.0], (9, 1)), contact=contact
        )
        assert samples.owner.tolist() == [int(side > 0)] * 9
        assert samples.field == pytest.approx(0.5, abs=1e-4)
    centres = evaluate(
        pair(distance, radius, other),
        [[0, 0, 0], [distance, 0, 0]],
        [[0, 0, 1]] * 2,
        contact=contact,
    )
    assert centres.owner.tolist() == [0, 1]
    assert centres.field.tolist() == [1, 1]


@pytest.mark.parametrize("contact", CELLS)
def test_a_small_decal_deep_in_a_large_one_lies_over_it_whole(contact: Contact) -> None:
    decals = pair(0.5, 1.0, 0.1)
    up = [[0, 0, 1]] * 3
    samples = evaluate(decals, [[0.5, 0.09, 0], [0.5, 0.11, 0], [0.7, 0, 0]], up, contact=contact)
    assert samples.owner.tolist() == [1, 0, 0]
    d = np.array([0.9, np.hypot(0.5, 0.11), 0.7]) * RIM
    assert samples.field == pytest.approx((1 - d**2) ** 3, abs=1e-6)


@pytest.mark.parametrize("contact", CELLS)
def test_equal_decals_on_one_point_show_the_first(contact: Contact) -> None:
    samples = evaluate(pair(0.0, 1.0, 1.0), [[0.5, 0, 0]], [[0, 0, 1]], contact=contact)
    assert samples.owner.tolist() == [0]


def test_the_image_changes_little_between_neighbouring_points() -> None:
    """No jump anywhere inside a region of one owner: behind smaller neighbours above all."""
    rng = np.random.default_rng(9)
    decals = clusters(rng, flat=True)[: MEMBERS * 400]
    which = np.arange(400) * MEMBERS
    step = 1e-3
    points = decals.positions[which].repeat(200, axis=0).astype(float)
    radius = decals.radii[which].repeat(200)[:, None]
    points += unit(rng.normal(size=points.shape) * [1, 1, 0]) * rng.uniform(0.3, 1, (len(points), 1)) * radius
    moved = points + unit(rng.normal(size=points.shape) * [1, 1, 0]) * step * radius
    up = np.tile([[0, 0, 1.0]], (len(points), 1))
    one, other = (evaluate(decals, p, up, contact=Contact.RADIAL) for p in (points, moved))
    same = (one.owner == other.owner) & (one.owner == which.repeat(200))
    change = np.linalg.norm(one.uv - other.uv, axis=1)[same] / step
    print(f"{same.sum():,} pairs, largest change {change.max():.1f}")
    assert same.sum() > 10_000
    assert change.max() < 30
