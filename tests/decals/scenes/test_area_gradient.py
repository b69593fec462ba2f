"""Gradients of areas against central differences of exact areas in float64."""

import math
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point
from decals.errors import InvalidScene
from tests.decals.scenes.test_evenness import flat, scene_of, square

DIFFERENCE = 1e-5
TOLERANCE = 3e-4


def differences(areas: Any, weights: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Central differences of weighted areas by all parameters."""
    steps = DIFFERENCE * np.eye(len(parameters))
    return np.array(
        [weights @ (areas(parameters + h) - areas(parameters - h)) / (2 * DIFFERENCE) for h in steps]
    )


def cell_areas(parameters: np.ndarray) -> np.ndarray:
    """Areas of the power cells of discs, each in sectors around its centre between arcs and sides."""
    count = len(parameters) // 3
    centers, radii = parameters[: 2 * count].reshape(count, 2), parameters[2 * count :]
    areas = np.zeros(count)
    for number, (center, r) in enumerate(zip(centers, radii, strict=True)):
        ways = np.delete(centers, number, axis=0) - center
        apart = np.linalg.norm(ways, axis=1)
        offsets = (apart**2 + r**2 - np.delete(radii, number) ** 2) / (2 * apart)
        assert (offsets > 0).all()
        near = offsets < r
        angles, offsets = np.arctan2(*ways.T[::-1])[near], offsets[near]
        halves = np.arccos(offsets / r)
        cuts = [-np.pi, np.pi, *(angles - halves), *(angles + halves)]
        for j, k in combinations(range(len(angles)), 2):
            rows = np.stack([np.cos(angles[[j, k]]), np.sin(angles[[j, k]])], axis=1)
            x, y = np.linalg.solve(rows, offsets[[j, k]])
            cuts.append(math.atan2(y, x))
        ends = np.sort((np.array(cuts) + np.pi) % (2 * np.pi) - np.pi)
        for low, high in pairwise([*ends, np.pi]):
            cosines = np.cos(0.5 * (low + high) - angles)
            reach = np.where(cosines > 0, offsets / np.maximum(cosines, 1e-12), np.inf)
            side = int(reach.argmin()) if len(reach) else 0
            if len(reach) and reach[side] < r:
                wedge = math.tan(high - angles[side]) - math.tan(low - angles[side])
                areas[number] += 0.5 * offsets[side] ** 2 * wedge
            else:
                areas[number] += 0.5 * r**2 * (high - low)
    return areas


@pytest.mark.ordinary_cases("True-0", "True-7")
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("weighted", [False, True])
def test_gradients_of_cells_are_differences(weighted: bool, seed: int) -> None:
    """In case 7, two discs meet in a thin wedge of bare surface."""
    rng = np.random.default_rng(seed)
    angles = np.arange(5) * 2 * np.pi / 5 + rng.uniform(-0.2, 0.2, 5)
    centers = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.45, 0.7, (5, 1))
    radii = rng.uniform(0.45, 0.6, 5)
    weights = rng.normal(size=5) if weighted else np.ones(5)
    layout = flat(np.column_stack([centers, np.zeros(5)]), radii)
    found = decals.area_gradient(scene_of(square(4.0), layout), weights, contact="radial")
    expected = differences(cell_areas, weights, np.concatenate([centers.ravel(), radii]))
    np.testing.assert_allclose(found.positions[:, :2].ravel(), expected[:10], atol=TOLERANCE)
    np.testing.assert_allclose(found.radii, expected[10:], atol=TOLERANCE)
    np.testing.assert_allclose(found.positions[:, 2], 0, atol=1e-5)


def ball_areas(parameters: np.ndarray) -> np.ndarray:
    """Areas on the unit sphere of two caps that a plane of equal powers divides, by sectors around each."""
    centers, radii = parameters[:6].reshape(2, 3), parameters[6:]
    nodes, shares = np.polynomial.legendre.leggauss(60)
    areas = []
    for own, other in ((0, 1), (1, 0)):
        (p, q), (r, s) = centers[[own, other]], radii[[own, other]]
        axis = p / np.linalg.norm(p)
        cap = math.acos((1 + p @ p - r**2) / (2 * np.linalg.norm(p)))
        normal, bound = 2 * (q - p), q @ q - s**2 - p @ p + r**2  # normal · x ≤ bound
        across = normal - (normal @ axis) * axis
        width, along = np.linalg.norm(across), normal @ axis
        cut = math.acos((bound - along * math.cos(cap)) / (width * math.sin(cap)))
        sector = cut * nodes  # where the plane cuts the cap
        side = width * np.cos(sector)
        size, turn = np.hypot(along, side), np.arctan2(side, along)
        angles = turn - np.arccos(bound / size)
        areas.append((2 * np.pi - 2 * cut) * (1 - math.cos(cap)) + cut * shares @ (1 - np.cos(angles)))
    return np.array(areas)


@pytest.mark.parametrize("weights", [(1.0, 1.0), (1.0, -0.5)])
def test_two_discs_on_a_ball(weights: tuple[float, float]) -> None:
    centers = np.array([[0.0, 0.0, 1.0], [math.sin(0.7), 0.0, math.cos(0.7)]])
    radii = np.array([0.5, 0.4])
    layout = decals.Decals(centers, centers, [[0, 1, 0]] * 2, radii)
    ball = decals.TreeObject("ball", Point((0, 0, 0), radius=1.0))
    scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5)), decals=layout, images=["eye"])
    found = decals.area_gradient(scene, weights, contact="radial")
    exact = layout.positions.astype(float), layout.radii.astype(float)
    expected = differences(ball_areas, np.array(weights), np.concatenate([exact[0].ravel(), exact[1]]))
    np.testing.assert_allclose(found.positions.ravel(), expected[:6], atol=2 * TOLERANCE)
    np.testing.assert_allclose(found.radii, expected[6:], atol=2 * TOLERANCE)


@pytest.mark.parametrize("contact", ["product", "min", "radial", "elastic"])
def test_two_discs(contact: str) -> None:
    """Covered area: closed form of the lens. One of two equal discs: half of the lens moves with each."""
    apart, r = 1.0, 0.7

    def union(d: float, a: float, b: float) -> float:
        x = (d * d + a * a - b * b) / (2 * d)
        parts = [q * q * math.acos(t / q) - t * math.sqrt(q * q - t * t) for q, t in ((a, x), (b, d - x))]
        return math.pi * (a * a + b * b) - sum(parts)

    h = 1e-5
    by_distance = (union(apart + h, r, r) - union(apart - h, r, r)) / (2 * h)
    by_radius = (union(apart, r + h, r) - union(apart, r - h, r)) / (2 * h)
    scene = scene_of(square(4.0), flat([[-apart / 2, 0, 0], [apart / 2, 0, 0]], r))
    found = decals.area_gradient(scene, contact=contact)
    np.testing.assert_allclose(found.positions[:, 0], [-by_distance, by_distance], rtol=4e-4)
    np.testing.assert_allclose(found.radii, by_radius, rtol=4e-4)
    one = decals.area_gradient(scene, [1, 0], contact=contact)
    other = decals.area_gradient(scene, [0, 1], contact=contact)
    np.testing.assert_allclose(one.radii + other.radii, found.radii, rtol=1e-9)
    assert one.radii[0] > found.radii[0]
    assert one.radii[1] < 0
    np.testing.assert_allclose(one.positions.sum(axis=0), 0, atol=4e-4)  # both moved alike change nothing


def test_a_cap_of_a_ball() -> None:
    """A rim at the chord r around a pole bounds the area πr², whose derivative is 2πr."""
    ball = decals.TreeObject("ball", Point((0, 0, 0), radius=1.0))
    disk = decals.Decals([[0, 0, 1]], [[0, 0, 1]], [[1, 0, 0]], 0.8)
    scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    found = decals.area_gradient(scene)
    assert found.radii[0] == pytest.approx(1.6 * math.pi, rel=4e-4)
    np.testing.assert_allclose(found.positions[0, :2], 0, atol=1e-4)


def test_a_small_disc_over_a_large_one() -> None:
    layout = flat([[0, 0, 0], [0.1, 0, 0]], [1.0, 0.4], layers=[0, 1])
    found = decals.area_gradient(scene_of(square(4.0), layout), [1, 0])
    np.testing.assert_allclose(found.radii, [2 * math.pi, -0.8 * math.pi], rtol=4e-4)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"scene": 5}, "scene: expected a Scene, got 5"),
        ({"weights": [1, 2]}, "weights: expected 1 finite numbers"),
        ({"weights": [float("nan")]}, "weights: expected"),
        ({"weights": "x"}, "weights: expected"),
        ({"contact": "round"}, "contact: expected one of"),
    ],
)
def test_refuses(wrong: dict[str, Any], says: str) -> None:
    arguments: dict[str, Any] = {"scene": scene_of(square(4.0), flat([[0, 0, 0]], 1.0))} | wrong
    with pytest.raises(InvalidScene, match=says):
        decals.area_gradient(**arguments)
