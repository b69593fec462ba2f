"""Density, masks, and regions of a mesh as masks."""

from typing import Any

import numpy as np
import pytest

from decals import Relaxation
from decals.errors import InvalidScattering
from decals.scattering import region_mask, vertex_density
from decals.scattering.domain import Density, Mask
from decals.surfaces import MeshSurface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.sized_decals import nearest_facing


def test_counts_follow_a_smooth_density() -> None:
    # over a unit sphere the integral of exp(z) between two heights is 2 pi times its difference
    relaxation = Relaxation([sphere(level=5)], count=2000, density=lambda points: np.exp(points[:, 2]))
    relaxation.run()
    edges = np.linspace(-1, 1, 6)
    counts = np.histogram(relaxation.positions[:, 2], bins=[-2, *edges[1:-1], 2])[0]
    expected = 2000 * np.diff(np.exp(edges)) / (np.e - 1 / np.e)
    assert np.abs(counts - expected).max() < 0.02 * 2000
    assert counts == pytest.approx(expected, rel=0.02)
    assert relaxation.statistics().rho > 0.8


def test_vertex_density_of_points() -> None:
    ball = sphere()
    density = vertex_density(ball.vertices, np.where(ball.vertices[:, 2] > 0, 3.0, 1.0))
    assert density(ball.vertices) == pytest.approx(np.where(ball.vertices[:, 2] > 0, 3.0, 1.0))
    middles = ball.vertices[ball.faces].mean(axis=1)
    assert ((density(middles) >= 1.0 - 1e-9) & (density(middles) <= 3.0 + 1e-9)).all()
    relaxation = Relaxation([ball], count=400, density=density, iterations=80)
    relaxation.run()
    assert (relaxation.positions[:, 2] > 0).sum() == pytest.approx(300, abs=12)
    for values in ([1.0], np.zeros(len(ball.vertices)), np.full(len(ball.vertices), np.nan)):
        with pytest.raises(InvalidScattering, match="values: expected"):
            vertex_density(ball.vertices, values)


def test_vertex_density_is_linear_in_faces() -> None:
    ball = sphere()
    density = vertex_density(ball, 2.0 + ball.vertices[:, 0])
    points, _ = ball.sample(300, seed=0)
    assert density(points) == pytest.approx(2.0 + points[:, 0], abs=1e-5)
    with pytest.raises(InvalidScattering, match="values: expected"):
        vertex_density(ball, [1.0])


@pytest.mark.slow_cases("surface0-<lambda>-regions0-0")
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("surface", "density", "regions"),
    [
        (plane(2.0), lambda q: np.where(q[:, 0] > 0, 4.0, 1.0), [(0.8, lambda q: q[:, 0] > 0)]),
        (
            sphere(level=5),
            lambda q: np.where(q[:, 2] > 0.5, 10.0, 1.0),
            [(10 / 13, lambda q: q[:, 2] > 0.5)],  # a cap a quarter as high as the ball
        ),
        (
            plane(2.0),
            lambda q: np.where((q[:, 0] > 0) ^ (q[:, 1] > 0), 3.0, 1.0),
            [
                (1 / 8, lambda q: (q[:, 0] > 0) & (q[:, 1] > 0)),
                (3 / 8, lambda q: (q[:, 0] > 0) & (q[:, 1] < 0)),
                (3 / 8, lambda q: (q[:, 0] < 0) & (q[:, 1] > 0)),
            ],
        ),
    ],
)
def test_counts_follow_a_density_with_steps(
    surface: MeshSurface, density: Density, regions: list[tuple[float, Mask]], seed: int
) -> None:
    relaxation = Relaxation([surface], count=1000, density=density, seed=seed)
    relaxation.run()
    for share, region in regions:
        assert np.sum(region(relaxation.positions)) == pytest.approx(1000 * share, rel=0.02)
    assert relaxation.statistics().rho > 0.85


def test_spacing_on_both_sides_of_a_density_step() -> None:
    jump = Relaxation([plane(2.0)], count=1000, density=lambda points: np.where(points[:, 0] > 0, 4.0, 1.0))
    jump.run()
    dense = jump.positions[:, 0] > 0
    nearest = nearest_facing(jump.positions, jump.normals)
    assert np.median(nearest[~dense]) == pytest.approx(2 * np.median(nearest[dense]), rel=0.05)


def test_spacings_of_one_to_ten() -> None:
    relaxation = Relaxation([sphere()], count=2000, density=lambda points: 10.0 ** (1.0 + points[:, 2]))
    relaxation.run()
    sizes = relaxation.sizes_at(relaxation.positions)
    assert sizes.max() > 9 * sizes.min()
    assert relaxation.statistics().rho > 0.8


def test_mask() -> None:
    relaxation = Relaxation([sphere()], count=200, mask=lambda points: points[:, 2] > 0.2, iterations=60)
    relaxation.run()
    assert (relaxation.positions[:, 2] > 0.2).all()
    assert relaxation.domain.area == pytest.approx(0.4 * sphere().area, rel=0.02)
    assert relaxation.statistics().rho > 0.6
    with pytest.raises(InvalidScattering, match="visible area"):
        Relaxation([sphere()], count=5, mask=lambda points: points[:, 2] > 9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"density": lambda points: points}, "density: expected shape"),
        (
            {"density": lambda points: points[:, 0] * 0},
            "density: expected finite numbers, and densities above",
        ),
        ({"density": lambda points: points[:, 0] * np.nan}, "density: expected finite"),
        ({"density": lambda points: "much"}, "density: expected numbers"),
        ({"mask": lambda points: True}, "mask: expected shape"),
        ({"mask": lambda points: points[:, 0]}, "mask: expected True or False for each point, got .*compare"),
    ],
)
def test_invalid_density_and_mask_values_raise(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidScattering, match=message):
        Relaxation([plane()], count=5, **options)


# -- regions -------------------------------------------------------------------------------------------


def test_region_masks_of_faces_and_vertices() -> None:
    ball = sphere()
    middles = ball.vertices[ball.faces].mean(axis=1)
    relaxation = Relaxation(ball, count=200, mask=region_mask(ball, middles[:, 2] > 0.2), iterations=30)
    relaxation.run()
    assert (middles[ball.locate(relaxation.positions)[0], 2] > 0.2).all()
    # a zone of the unit ball is 2 pi times its height
    assert relaxation.domain.area == pytest.approx(2 * np.pi * 0.8, rel=0.05)
    mask = region_mask(ball, ball.vertices[:, 2] > 0.0)
    points, _ = ball.sample(4000, seed=1)
    certain = np.abs(points[:, 2]) > 0.1
    assert np.array_equal(mask(points)[certain], points[certain, 2] > 0)


@pytest.mark.parametrize(
    "wrong", [None, "x", [True], np.zeros(5), [[True]], 2.0 * np.ones(12), np.full(12, np.nan)]
)
def test_invalid_flags_raise(wrong: Any) -> None:
    with pytest.raises(InvalidScattering, match="flags: expected"):
        region_mask(box(), wrong)
    with pytest.raises(InvalidScattering, match=r"surface: expected a m(odel|esh)"):
        region_mask(wrong, [True])


def test_small_regions_of_high_density_get_their_share() -> None:
    """Without samples for the peak, it gets none or twice its share, as one sample falls there."""
    ball, radius = sphere(level=5), 0.1
    expected = radius**2 / (radius / 2) ** 2 * np.pi * 2 / np.sqrt(3)
    for seed in range(8):
        relaxation = Relaxation(
            ball,
            spacing=radius / 2,
            seed=seed,
            density=lambda points: np.where(points[:, 2] > 1 - radius**2 / 2, 1.0, 1 / 64),
        )
        count = (relaxation.positions[:, 2] > 1 - radius**2 / 2).sum()
        assert count == pytest.approx(expected, rel=0.45)
