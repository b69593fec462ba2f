"""Decals on thin parts of BlobTrees: each part gets as many as its share of the area."""

import numpy as np
import pytest

from blobtree import Box, Disc, Node, Point, Segment, Torus
from blobtree._typing import Float32Array, Int64Array
from decals import Relaxation, scatter
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


# -- parts that are joined to others -------------------------------------------------------------------


SAMPLES = 100_000


def crossing_plates(seed: int) -> tuple[Node, ...]:
    """Return a thin and a thick plate that cross each other, for a sum."""
    rng = np.random.default_rng([51, seed])
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    nodes: list[Node] = []
    for axis, extent, radius in zip(axes, (1.1, 0.8), (0.03, 0.09), strict=False):
        x, y, z = (rng.uniform(0.3, 0.6) * axes[2]).tolist()
        nodes.append(Disc((x, y, z), tuple(axis.tolist()), extent, radius=radius * rng.uniform(0.8, 1.2)))
    return tuple(nodes)


def nearest(nodes: tuple[Node, ...], points: Float32Array) -> Int64Array:
    """Return the number of the node whose surface is nearest, for each point."""
    gaps = np.abs(np.stack([node(points) for node in nodes]) - 0.5)
    return np.asarray(gaps.argmin(axis=0), np.int64)


@pytest.mark.ordinary_cases("3")
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_particles_keep_the_shares_of_joined_parts(seed: int) -> None:
    """Without relocation between the parts, 2.5 to 6 of 400 particles drift from one to the other."""
    nodes = crossing_plates(seed)
    surface = ImplicitSurface(nodes[0] + nodes[1])
    assert surface.has_small_parts
    relaxation = Relaxation(surface, count=400, seed=seed)
    relaxation.run()
    found = np.bincount(nearest(nodes, relaxation.positions), minlength=2)
    shares = 400 * np.bincount(nearest(nodes, surface.sample(SAMPLES, 9)[0]), minlength=2) / SAMPLES
    assert np.abs(found - shares).max() <= 2.0
    assert relaxation.statistics().rho > 0.88


@pytest.mark.slow
def test_fixed_particles_stay_and_surfaces_keep_their_numbers() -> None:
    nodes = crossing_plates(3)
    surfaces = [ImplicitSurface(nodes[0] + nodes[1]), ImplicitSurface(Point((5, 0, 0), radius=0.7))]
    points = surfaces[0].sample(400, 1)[0]
    fixed = points[nearest(nodes, points) == 0][:60]

    def begun() -> Relaxation:
        return Relaxation(
            surfaces, count=200, fixed=fixed, density=lambda points: 1.0 + (points[:, 0] > 0.3), seed=2
        )

    relaxation, again = begun(), begun()
    numbers = np.bincount(relaxation.surface_ids)
    start = relaxation.positions[relaxation.fixed]
    relaxation.run()
    assert np.array_equal(relaxation.positions[relaxation.fixed], start)
    assert np.array_equal(np.bincount(relaxation.surface_ids), numbers)
    again.run()
    assert np.array_equal(again.positions, relaxation.positions)
