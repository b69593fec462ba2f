"""Which image, how large, which way: what decals get on top of their particles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals.coat.choosing import ImageChoice, by_rank, odds
from decals.coat.fields import bends
from decals.coat.jitter import Jitter
from decals.coat.laying import lay
from decals.coat.sizing import Sizing
from decals.errors import InvalidSeeding
from decals.seeds.relaxation import Relaxation
from tests.decals.meshes import box, plane, sphere
from tests.oracles.coats import covered


@pytest.fixture(scope="module")
def capsule():
    """A ball of radius 1 and one of radius 0.4, of one population."""
    relaxation = Relaxation([sphere(level=4), sphere(0.4, center=(3, 0, 0), level=4)], count=700, seed=2)
    relaxation.run()
    return relaxation


@given(
    weights=st.lists(st.floats(0, 10), min_size=1, max_size=6).filter(lambda given: sum(given) > 0.1),
    values=st.lists(st.floats(-1e6, 1e6), max_size=60),
)
def test_images_by_rank_are_in_order_and_as_many_as_their_share(weights, values):
    shares = odds(len(weights), weights)
    chosen = by_rank(shares, np.array(values, float))
    order = np.argsort(values, kind="stable")
    assert (np.diff(chosen[order]) >= 0).all()
    counts = np.bincount(chosen, minlength=len(weights))
    assert np.abs(counts - len(values) * shares).max() <= 1.0


def test_images_by_size(capsule):
    decals = lay(capsule, images=3, weights=[1, 2, 1], choice=ImageChoice.SIZE, jitter=Jitter(size=0.3))
    assert np.bincount(decals.images).tolist() == [175, 350, 175]
    largest = [decals.radii[decals.images == image].max() for image in range(3)]
    smallest = [decals.radii[decals.images == image].min() for image in range(3)]
    assert largest[0] <= smallest[1]
    assert largest[1] <= smallest[2]


def test_bends_are_those_of_balls_and_planes(capsule):
    found = bends(capsule.positions, capsule.normals)
    assert np.median(found[capsule.surface_ids == 0]) == pytest.approx(1.0, rel=0.05)
    assert np.median(found[capsule.surface_ids == 1]) == pytest.approx(2.5, rel=0.05)
    flat = Relaxation([plane()], count=50, iterations=10)
    assert bends(flat.positions, flat.normals) == pytest.approx(0.0, abs=1e-5)


def test_images_by_curvature(capsule):
    small = (capsule.surface_ids == 1).sum()
    weights = [capsule.count - small, small]
    decals = lay(capsule, images=2, weights=weights, choice=ImageChoice.CURVATURE)
    assert (decals.images == capsule.surface_ids).mean() > 0.99


def test_jitter_keeps_to_the_surface_and_leaves_no_gap(capsule):
    decals = lay(capsule, jitter=Jitter(position=0.2), seed=4)
    moved = np.linalg.norm(decals.positions - capsule.positions, axis=1) / capsule.spacing
    # the length of two normal coordinates of deviation 0.2
    assert moved.mean() == pytest.approx(0.2 * np.sqrt(np.pi / 2), rel=0.1)
    for number, surface in enumerate(capsule.world.surfaces):
        own = decals.positions[capsule.surface_ids == number]
        assert np.linalg.norm(surface.project(own)[0] - own, axis=1).max() < 1e-4 * capsule.spacing
        assert covered(decals, *surface.sample(2000, seed=8)).all()


def test_jitter_of_sizes_and_angles(capsule):
    wish = {"sizing": Sizing.TOUCHING, "direction": (0.0, 0.0, 1.0)}
    plain = lay(capsule, **wish)
    sizes = lay(capsule, **wish, jitter=Jitter(size=0.1))
    logs = np.log(sizes.radii / plain.radii)
    assert logs.std() == pytest.approx(0.1, rel=0.15)
    assert np.abs(logs).max() <= 0.3001
    assert np.array_equal(sizes.positions, plain.positions)
    assert np.array_equal(sizes.tangents, plain.tangents)
    turned = lay(capsule, **wish, jitter=Jitter(angle=20.0))
    cosines = np.einsum("ni,ni->n", turned.tangents, plain.tangents)
    assert cosines.min() >= np.cos(np.radians(20.01))
    assert cosines.min() < np.cos(np.radians(18))
    assert np.abs(np.einsum("ni,ni->n", turned.tangents, turned.normals)).max() < 1e-5


def test_fixed_decals_do_not_jitter():
    relaxation = Relaxation([box()], count=60, iterations=20, fixed=[(0.1, 0.2, 0.5)])
    relaxation.run()
    decals = lay(relaxation, jitter=Jitter(position=0.3))
    held = relaxation.fixed
    assert np.array_equal(decals.positions[held], relaxation.positions[held])
    assert not np.array_equal(decals.positions[~held], relaxation.positions[~held])


def test_one_number_makes_it_all_again(capsule):
    wish = {"images": 4, "jitter": Jitter(0.1, 0.1, 10.0)}
    first, again, other = (lay(capsule, seed=seed, **wish) for seed in (7, 7, 8))
    for name in ("positions", "tangents", "radii", "images"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()
        assert getattr(first, name).tobytes() != getattr(other, name).tobytes()


def test_impossible_disorder_is_refused():
    for wish in ({"position": -1.0}, {"size": np.nan}, {"angle": np.inf}):
        with pytest.raises(InvalidSeeding, match=f"{next(iter(wish))} of a jitter: expected"):
            Jitter(**wish)
