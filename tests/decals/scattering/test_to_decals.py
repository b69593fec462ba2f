"""Images, radii and tangents of the decals of particles."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals import Relaxation, Sizing
from decals.errors import InvalidScattering
from decals.scattering import ImageChoice, Jitter
from decals.scattering.appearance import image_shares, ranked_images
from decals.scattering.orientation import max_curvatures
from tests.decals.meshes import box, plane, sphere
from tests.oracles.sized_decals import covered


@pytest.fixture(scope="module")
def two_balls() -> Relaxation:
    """A ball of radius 1 and one of radius 0.4, of one population."""
    relaxation = Relaxation([sphere(level=4), sphere(0.4, center=(3, 0, 0), level=4)], count=700, seed=2)
    relaxation.run()
    return relaxation


@given(
    weights=st.lists(st.floats(0, 10), min_size=1, max_size=6).filter(lambda values: sum(values) > 0.1),
    values=st.lists(st.floats(-1e6, 1e6), max_size=60),
)
def test_ranked_images(weights: list[float], values: list[float]) -> None:
    shares = image_shares(len(weights), weights)
    images = ranked_images(shares, np.array(values, float))
    order = np.argsort(values, kind="stable")
    assert (np.diff(images[order]) >= 0).all()
    counts = np.bincount(images, minlength=len(weights))
    assert np.abs(counts - len(values) * shares).max() <= 1.0


def test_images_by_size(two_balls: Relaxation) -> None:
    decals = two_balls.to_decals(
        images=3, weights=[1, 2, 1], choice=ImageChoice.SIZE, jitter=Jitter(size=0.3)
    )
    assert np.bincount(decals.images).tolist() == [175, 350, 175]
    largest = [decals.radii[decals.images == image].max() for image in range(3)]
    smallest = [decals.radii[decals.images == image].min() for image in range(3)]
    assert largest[0] <= smallest[1]
    assert largest[1] <= smallest[2]


def test_max_curvatures_of_balls_and_planes(two_balls: Relaxation) -> None:
    curvatures = max_curvatures(two_balls.positions, two_balls.normals)
    assert np.median(curvatures[two_balls.surface_ids == 0]) == pytest.approx(1.0, rel=0.05)
    assert np.median(curvatures[two_balls.surface_ids == 1]) == pytest.approx(2.5, rel=0.05)
    flat = Relaxation([plane()], count=50, iterations=10)
    assert max_curvatures(flat.positions, flat.normals) == pytest.approx(0.0, abs=1e-5)


def test_images_by_curvature(two_balls: Relaxation) -> None:
    small = (two_balls.surface_ids == 1).sum()
    weights = [two_balls.count - small, small]
    decals = two_balls.to_decals(images=2, weights=weights, choice=ImageChoice.CURVATURE)
    assert (decals.images == two_balls.surface_ids).mean() > 0.99


def test_position_jitter_stays_on_the_surface_without_gaps(two_balls: Relaxation) -> None:
    decals = two_balls.to_decals(jitter=Jitter(position=0.2), seed=4)
    moved = np.linalg.norm(decals.positions - two_balls.positions, axis=1) / two_balls.spacing
    # the length of two normal coordinates of deviation 0.2
    assert moved.mean() == pytest.approx(0.2 * np.sqrt(np.pi / 2), rel=0.1)
    for number, surface in enumerate(two_balls.domain.surfaces):
        own = decals.positions[two_balls.surface_ids == number]
        assert np.linalg.norm(surface.project(own)[0] - own, axis=1).max() < 1e-4 * two_balls.spacing
        assert covered(decals, *surface.sample(2000, seed=8)).all()


def test_size_and_angle_jitter(two_balls: Relaxation) -> None:
    options: dict[str, Any] = {"sizing": Sizing.TOUCHING, "direction": (0.0, 0.0, 1.0)}
    plain = two_balls.to_decals(**options)
    sizes = two_balls.to_decals(**options, jitter=Jitter(size=0.1))
    logs = np.log(sizes.radii / plain.radii)
    assert logs.std() == pytest.approx(0.1, rel=0.15)
    assert np.abs(logs).max() <= 0.3001
    assert np.array_equal(sizes.positions, plain.positions)
    assert np.array_equal(sizes.tangents, plain.tangents)
    turned = two_balls.to_decals(**options, jitter=Jitter(angle=20.0))
    cosines = np.einsum("ni,ni->n", turned.tangents, plain.tangents)
    assert cosines.min() >= np.cos(np.radians(20.01))
    assert cosines.min() < np.cos(np.radians(18))
    assert np.abs(np.einsum("ni,ni->n", turned.tangents, turned.normals)).max() < 1e-5


def test_fixed_decals_do_not_jitter() -> None:
    relaxation = Relaxation([box()], count=60, iterations=20, fixed=[(0.1, 0.2, 0.5)])
    relaxation.run()
    decals = relaxation.to_decals(jitter=Jitter(position=0.3))
    is_fixed = relaxation.fixed
    assert np.array_equal(decals.positions[is_fixed], relaxation.positions[is_fixed])
    assert not np.array_equal(decals.positions[~is_fixed], relaxation.positions[~is_fixed])


def test_seed_repeats_the_decals(two_balls: Relaxation) -> None:
    options: dict[str, Any] = {"images": 4, "jitter": Jitter(0.1, 0.1, 10.0)}
    first, again, other = (two_balls.to_decals(seed=seed, **options) for seed in (7, 7, 8))
    for name in ("positions", "tangents", "radii", "images"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()
        assert getattr(first, name).tobytes() != getattr(other, name).tobytes()


def test_invalid_jitter_raises() -> None:
    for options in ({"position": -1.0}, {"size": np.nan}, {"angle": np.inf}):
        with pytest.raises(InvalidScattering, match=f"{next(iter(options))} of a jitter: expected"):
            Jitter(**options)
