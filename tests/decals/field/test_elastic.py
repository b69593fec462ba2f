"""Elastic contact: what is exact on a ray, what is smooth between rays, and where an image stays as it is."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from decals import Contact, Decals, evaluate
from decals.record import DEFAULT_STIFFNESS
from tests.decals.field.test_radial import MEMBERS, clusters, pair
from tests.oracles.contact import rim_distance

UP = np.array([0.0, 0.0, 1.0])
STIFFNESSES = [1.0, DEFAULT_STIFFNESS, 6.0, 64.0]


def rims(decals: Decals, points: Any, **options: Any) -> tuple[Any, Any]:
    """Owners and r/r_h of points."""
    points = np.asarray(points)
    samples = evaluate(decals, points, np.tile(UP, (len(points), 1)), contact=Contact.ELASTIC, **options)
    return samples.owner, rim_distance(1.0 - samples.field.astype(np.float64))


@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize(("distance", "other"), [(1.2, 1.0), (1.6, 0.8), (1.2, 0.4), (3.4, 3.0)])
def test_one_neighbour_compresses_the_part_of_the_ray_in_its_reach(
    distance: float, other: float, stiffness: float
) -> None:
    """Along the axis, from the text of the formula: no field, no index."""
    plane = (distance**2 + 1 - other**2) / (2 * distance)
    x = np.linspace(0.01, 0.999 * plane, 200)
    roots = np.roots([1.0, distance**2 - other**2 - 1, -0.6 * other**2])
    way = np.clip(1 - (1 - x / plane) / min(roots.max(), 1.0), 0, 1)
    expected = x + (1 - plane) * way ** (stiffness + 0.1 / (1 - plane))
    owner, r = rims(pair(distance, 1.0, other), x[:, None] * [1, 0, 0], stiffness=stiffness)
    assert (owner == 0).all()
    np.testing.assert_allclose(r, expected, atol=1e-5)
    begins = distance - np.sqrt(1.6) * other
    assert np.abs(r - x)[x < begins].max(initial=0) < 3e-6  # nothing moves out of its reach


def single_sets(count: int, *, ratio: float) -> Iterator[Decals]:
    """Sets of decals in a plane, the first of each at the origin, where float32 resolves small turns."""
    decals = clusters(np.random.default_rng(3), ratio=ratio, flat=True)
    for first in range(0, count * MEMBERS, MEMBERS):
        members = decals[first : first + MEMBERS]
        yield members.replace(positions=members.positions - members.positions[0])


def spokes(angles: Any, t: Any, radius: float) -> Any:
    return (radius * t)[:, None] * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])


def test_the_middle_stays_and_stiffness_narrows_the_rest() -> None:
    rng, t = np.random.default_rng(4), np.linspace(0.01, 1, 200)
    rays, still, narrowed = rng.uniform(0, 2 * np.pi, 200), [], []
    for decals in single_sets(40, ratio=20.0):
        points = spokes(rays, t, float(decals.radii[0]))
        owners, moved = zip(*(rims(decals, points, stiffness=one) for one in STIFFNESSES), strict=True)
        own = owners[0] == 0
        assert all(np.array_equal(owner, owners[0]) for owner in owners)
        for soft, stiff in pairwise(moved):
            assert (stiff - soft)[own].max(initial=0) < 4e-6
        assert (t - moved[-1])[own].max(initial=0) < 4e-6
        still += (np.abs(moved[1] - t)[own] < 4e-6).tolist()
        narrowed += (moved[0] - moved[-1])[own].tolist()
    assert np.mean(still) > 0.4
    assert np.mean(np.array(narrowed) > 0.01) > 0.05


def test_rays_side_by_side_show_nearly_the_same() -> None:
    """The largest change of r between rays 0.01° apart, for sizes to 100:1."""
    rng, worst, owned = np.random.default_rng(6), 0.0, 0
    for decals in single_sets(60, ratio=100.0):
        angle, t = rng.uniform(0, 2 * np.pi, 2000), np.sqrt(rng.uniform(0, 1, 2000))
        turns = np.concatenate([angle, angle + np.radians(0.01)])
        owner, r = rims(decals, spokes(turns, np.tile(t, 2), float(decals.radii[0])))
        same = (owner.reshape(2, -1) == 0).all(axis=0)
        worst = max(worst, np.abs(np.diff(r.reshape(2, -1), axis=0)[0][same]).max(initial=0))
        owned += same.sum()
    assert owned > 50_000
    assert worst < 1e-3


def test_no_kink_where_planes_meet() -> None:
    """On rays to corners of a cell, between two planes or a plane and the rim. Radial contact has kinks."""
    turn, step = 2 * np.pi / 5, 1e-3
    places = np.array([[0, 0, 0], [1.3, 0, 0], [1.3 * np.cos(turn), 1.3 * np.sin(turn), 0]])
    decals = Decals(places, np.tile(UP, (3, 1)), np.tile([1.0, 0, 0], (3, 1)), np.ones(3))
    for direction, t in ((0.5 * turn, 0.7), (-np.arccos(0.65), 0.85)):
        angle = direction + step * np.array([-1.0, 0.0, 1.0])
        points = t * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        owner, r = rims(decals, points)
        assert (owner == 0).all()
        assert abs(r[0] - 2 * r[1] + r[2]) / step < 0.02
        radial = evaluate(decals, points, [UP] * 3, contact="radial").field.astype(np.float64)
        bent = rim_distance(1 - radial)
        assert abs(bent[0] - 2 * bent[1] + bent[2]) / step > 0.3


def nested_pile(rng: np.random.Generator) -> Decals:
    """A decal of radius 1 at the origin, and six smaller ones, most of them deep inside it."""
    radii = np.concatenate([[1.0], 10.0 ** rng.uniform(-1.5, -0.2, 6)])
    away, angles = rng.uniform(0.1, 1.1, 7) * (np.arange(7) > 0), rng.uniform(0, 2 * np.pi, 7)
    places = away[:, None] * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    return Decals(places, np.tile(UP, (7, 1)), np.tile([1.0, 0, 0], (7, 1)), radii)


def test_a_nested_decal_parts_the_image_below() -> None:
    """A third of its radius comes out at its rim; beyond its reach, and on the outer rim, nothing moves."""
    decals = pair(0.4, 1.0, 0.2)
    amount = 0.35 * (1 - 0.2**2)
    for turn in (0.0, 1.0, 2.5):
        way = np.array([np.cos(turn), np.sin(turn), 0.0])
        points = [0.4, 0, 0] + np.array([1.0001, np.sqrt(1.6)])[:, None] * 0.2 * way
        found = 2 * evaluate(decals, points, [UP] * 2).uv - 1
        moved = found - points[:, :2]
        expected = -amount * 0.2 * (1 - (points[0] ** 2).sum()) * way[:2]
        np.testing.assert_allclose(moved, [expected, [0, 0]], atol=2e-4)
    rim = spokes(np.linspace(0, 6, 50), np.array([0.99999]), 1.0)
    shown = evaluate(pair(0.85, 1.0, 0.1), rim, [UP] * 50)
    np.testing.assert_allclose((2 * shown.uv - 1)[shown.owner == 0], rim[shown.owner == 0, :2], atol=1e-4)


def test_no_image_folds_among_nested_decals() -> None:
    rng, step, owned = np.random.default_rng(8), 1e-3, 0
    for _ in range(40):
        decals = nested_pile(rng)
        beside = decals.positions[rng.integers(0, 7, 700)]
        points = beside + rng.normal(0, 0.3, (700, 3)) * [1, 1, 0]
        corners = points[:, None] + step * np.array([[0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]])
        shown = evaluate(decals, corners.reshape(-1, 3), np.tile(UP, (2100, 1)))
        uv = shown.uv.reshape(-1, 3, 2)[(shown.owner.reshape(-1, 3) == 0).all(axis=1)].astype(np.float64)
        x, y = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        area = x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]
        assert (area > 0).all()
        owned += len(uv)
    assert owned > 5000


def test_no_image_folds_around_500_decals_in_one_place() -> None:
    """Their potentials join to one that curves 500^⅙ = 2.8 times as much; the proof ends at 540."""
    radii = np.full(501, 0.1)
    radii[0] = 1.0
    decals = Decals(np.zeros((501, 3)), np.tile(UP, (501, 1)), np.tile([1.0, 0, 0], (501, 1)), radii)
    distances = np.linspace(0.101, 0.13, 30)
    shown = evaluate(decals, distances[:, None] * [1, 0, 0], np.tile(UP, (30, 1)))
    assert (shown.owner == 0).all()
    place = 2 * shown.uv[:, 0].astype(np.float64) - 1
    assert place[0] < 0.01
    assert (np.diff(place) > 0).all()


def test_a_decal_without_overlap_is_not_deformed() -> None:
    points = np.linspace(0, 0.99, 50)[:, None] * [1, 0, 0]
    _, r = rims(pair(2.001, 1.0, 1.0), points)
    np.testing.assert_allclose(r, points[:, 0], atol=3e-6)
