"""Gradients of areas against central differences in float64: exact chords of cells on scan lines."""

import math
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point
from decals.errors import InvalidScene
from tests.decals.scenes.test_evenness import flat, scene_of, square

ROWS = (np.arange(40_000) + 0.5) / 10_000 - 2
DIFFERENCE = 1e-4


def cell_areas(centers: Any, radii: Any) -> np.ndarray:
    """Areas of the power cells of discs: each cuts a scan line in one interval."""
    areas = []
    for (x, y), r in zip(centers, radii, strict=True):
        half = np.sqrt(np.maximum(r**2 - (ROWS - y) ** 2, 0))
        low, high = x - half, x + half
        for (u, v), s in zip(centers, radii, strict=True):
            if (u, v) != (x, y):  # 2 (u − x) q ≤ …
                bound = u**2 + v**2 - x**2 - y**2 + r**2 - s**2 - 2 * (v - y) * ROWS
                side = bound / (2 * (u - x))
                low, high = (low, np.minimum(high, side)) if u > x else (np.maximum(low, side), high)
        areas.append(np.maximum(high - low, 0).sum() / 10_000)
    return np.array(areas)


@pytest.mark.ordinary_cases("True-0")
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("weighted", [False, True])
def test_gradients_of_cells_are_differences(weighted: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.arange(5) * 2 * np.pi / 5 + rng.uniform(-0.2, 0.2, 5)
    centers = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.45, 0.7, (5, 1))
    radii = rng.uniform(0.45, 0.6, 5)
    weights = rng.normal(size=5) if weighted else np.ones(5)
    layout = flat(np.column_stack([centers, np.zeros(5)]), radii)
    found = decals.area_gradient(scene_of(square(4.0), layout), weights, contact="radial", step=0.02)
    parameters = np.concatenate([centers.ravel(), radii])

    def total(values: np.ndarray) -> float:
        return float(weights @ cell_areas([tuple(row) for row in values[:10].reshape(5, 2)], values[10:]))

    steps = DIFFERENCE * np.eye(15)
    expected = [(total(parameters + h) - total(parameters - h)) / (2 * DIFFERENCE) for h in steps]
    np.testing.assert_allclose(found.positions[:, :2].ravel(), expected[:10], atol=1e-2)
    np.testing.assert_allclose(found.radii, expected[10:], atol=1e-2)
    np.testing.assert_allclose(found.positions[:, 2], 0, atol=1e-5)


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
    np.testing.assert_allclose(found.positions[:, 0], [-by_distance, by_distance], rtol=2e-3)
    np.testing.assert_allclose(found.radii, by_radius, rtol=2e-3)
    one = decals.area_gradient(scene, [1, 0], contact=contact)
    other = decals.area_gradient(scene, [0, 1], contact=contact)
    np.testing.assert_allclose(one.radii + other.radii, found.radii, rtol=1e-9)
    assert one.radii[0] > found.radii[0]
    assert one.radii[1] < 0
    np.testing.assert_allclose(one.positions.sum(axis=0), 0, atol=2e-3)  # both moved alike change nothing


def test_a_cap_of_a_ball() -> None:
    """A rim at the chord r around a pole bounds the area πr², whose derivative is 2πr."""
    ball = decals.TreeObject("ball", Point((0, 0, 0), radius=1.0))
    disk = decals.Decals([[0, 0, 1]], [[0, 0, 1]], [[1, 0, 0]], 0.8)
    scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5)), decals=disk, images=["eye"])
    found = decals.area_gradient(scene)
    assert found.radii[0] == pytest.approx(1.6 * math.pi, rel=2e-3)
    np.testing.assert_allclose(found.positions[0, :2], 0, atol=1e-2)


def test_a_small_disc_over_a_large_one() -> None:
    layout = flat([[0, 0, 0], [0.1, 0, 0]], [1.0, 0.4], layers=[0, 1])
    found = decals.area_gradient(scene_of(square(4.0), layout), [1, 0])
    np.testing.assert_allclose(found.radii, [2 * math.pi, -0.8 * math.pi], rtol=2e-3)


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
