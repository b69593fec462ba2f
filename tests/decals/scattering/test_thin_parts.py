"""Decals on thin parts of BlobTrees: each part gets as many as its share of the area."""

import numpy as np
import pytest

from blobtree import Box, Disc, Node, Point, Segment, Torus
from decals import scatter
from decals.surfaces import ImplicitSurface
from tests.thin_trees import decals_of_parts, has_share, random_tree

BALL = Point((0, 0, 0), radius=1.0)


def test_a_far_ball_gets_half_of_the_decals() -> None:
    layout = scatter(BALL | BALL.translate((1000, 0, 0)), count=50)
    assert abs(int((layout.positions[:, 0] > 500.0).sum()) - 25) <= 1


def test_a_diagonal_rod_has_decals_all_along_and_on_its_surface() -> None:
    rod = Segment((-1, -1, -1), (2, 2.3, 2), radius=0.01)
    start, end = np.array(rod.start), np.array(rod.end)
    centers = scatter(rod, count=200).positions
    assert np.abs(rod(centers) - 0.5).max() < 1e-3
    along = np.sort((centers - start) @ (end - start) / ((end - start) @ (end - start)))
    assert np.diff(along).max() < 0.02
    assert along[0] < 0.02
    assert along[-1] > 0.98


@pytest.mark.slow_cases("0.02", "0.05")
@pytest.mark.parametrize("radius", [0.02, 0.05, 0.1, 0.15])
def test_small_balls_get_their_share(radius: float) -> None:
    count = round(25.0 * (1.0 + 1.0 / radius**2) / 4.0) if radius > 0.05 else 600
    balls: Node = BALL
    number = max(1, round(25.0 / (count * radius**2)))
    for x in range(number):
        balls = balls | Point((3.0 + 0.3 * x, 0, 0), radius=radius)
    share = number * radius**2 / (1.0 + number * radius**2)
    found = int((scatter(balls, count=count).positions[:, 0] > 2.0).sum())
    assert abs(found - count * share) <= 0.05 * count * share + 1.0


def test_sampled_area_is_that_of_the_surface() -> None:
    for node, area in (
        (Torus((0, 0, 0), (1, 2, 3), 1.0, radius=0.02), 4 * np.pi**2 * 0.02),
        (Disc((0, 0, 0), (1, 2, 3), 1.0, radius=0.02), 2 * np.pi + 2 * np.pi**2 * 0.02 + 4 * np.pi * 0.0004),
        (BALL | BALL.translate((50, 0, 0)), 8 * np.pi),
    ):
        assert ImplicitSurface(node).area == pytest.approx(area, rel=0.02)


@pytest.mark.slow_cases("0.02", "0.2", "0.4")
@pytest.mark.parametrize("size", [0.02, 0.05, 0.2, 0.4])
def test_small_boxes_have_the_area_of_their_edges(size: float) -> None:
    box = Box((0, 0, 0), (size, 0.8 * size, 0.6 * size), radius=0.01 * size).rotate((1, 2, 3), 40)
    area = size**2 * (2 * (0.8 + 0.48 + 0.6) + 2 * np.pi * 0.01 * 2.4 + 4 * np.pi * 1e-4)
    surface = ImplicitSurface(BALL.translate((4, 0, 0)) | box)
    points = surface.mesh.sample(100_000, 1)[0]
    share = float((np.linalg.norm(points, axis=1) < 2.0).mean())
    assert share * surface.area == pytest.approx(area, rel=0.05)


@pytest.mark.slow_cases("0")
@pytest.mark.parametrize("seed", range(2))
def test_a_small_case_keeps_its_decals(seed: int) -> None:
    inner, outer = (Box((0, 0, 0), (x, 0.8 * x, 0.7 * x), radius=0.01) for x in (0.46, 0.5))
    tree = BALL.translate((-3, 0, 0)) | (outer - inner).rotate((0, 1, 2), 30)
    areas = [0.5**2, 0.46**2]
    area = 2 * (0.8 + 0.56 + 0.7) * sum(areas) + 2 * np.pi * 0.01 * 2.5 * (0.5 + 0.46)
    layout = scatter(tree, count=400, seed=seed)
    found, expected = (layout.positions[:, 0] > -1.0).sum(), 400 * area / (area + 4 * np.pi)
    assert abs(found - expected) <= 0.05 * expected + 1.0


def test_a_resolution_keeps_its_results() -> None:
    tree = BALL | Segment((1, 0, 0), (3, 0, 0), radius=0.004)
    coarse = ImplicitSurface(tree, resolution=64)
    assert (np.linalg.norm(coarse.sample(500, 1)[0], axis=1) > 1.01).mean() < 0.003


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5, 10, 15, 18, 19, 20, 25])
def test_random_trees_give_each_part_its_share(seed: int) -> None:
    model = random_tree(seed)
    centers = scatter(model.tree, count=800).positions.astype(np.float64)
    found, expected = decals_of_parts(model, centers)
    assert has_share(found, expected)[expected >= 20.0].all()
