"""Owner, field and image coordinates against brute force in float64, on kind and hostile sets."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decals import Decals, ImageMapping, evaluate
from decals.errors import InvalidDecals, InvalidDevice, InvalidImage, InvalidPoints, InvalidScene
from decals.index import DecalIndex
from decals.record import NEIGHBOR_REACH
from tests.oracles.decals import decals_at
from tests.vectors import random_units, unit

TIE = 1e-4
"""Relative distance to a tie within which float32 may choose the other owner."""

CUT_ERROR = 1e-4
"""Of uv and field: what neighbours beyond NEIGHBOR_REACH would have added."""

ROUNDING_ERROR = 1e-5
"""Of uv and field against the same equations without those neighbours."""


def dress(
    rng: np.random.Generator, positions: NDArray[Any], normals: NDArray[Any], radii: NDArray[Any], **more: Any
) -> Any:
    return Decals(positions, normals, rng.normal(size=np.shape(positions)), radii, **more)


def on_sphere(rng: np.random.Generator, count: int) -> Any:
    n = random_units(rng, count)
    return n, n


def even_sphere(rng: np.random.Generator) -> Any:
    positions, normals = on_sphere(rng, 400)
    return dress(rng, positions, normals, np.full(400, 0.12)), *on_sphere(rng, 4000)


def unlike_sizes(rng: np.random.Generator) -> Any:
    positions, normals = on_sphere(rng, 2000)
    radii = np.sort(10.0 ** rng.uniform(-3, -0.3, 2000))
    points, directions = on_sphere(rng, 2000)
    close = unit(positions + radii[:, None] * rng.normal(size=(2000, 3)) * 0.5)
    return (
        dress(rng, positions, normals, radii),
        np.concatenate([points, close]),
        np.concatenate([directions, close]),
    )


def thin_plate(rng: np.random.Generator) -> Any:
    side = rng.choice([-1.0, 1.0], (300, 1))
    up = np.array([[0, 0, 1.0]])
    positions = rng.random((300, 3)) * [1, 1, 0] + 1e-3 * side * up
    decals = dress(rng, positions, side * up, np.full(300, 0.06), spill=rng.random(300) < 0.3)
    side = rng.choice([-1.0, 1.0], (3000, 1))
    return decals, rng.random((3000, 3)) * [1, 1, 0] + 1e-3 * side * up, side * np.repeat(up, 3000, axis=0)


def far_away(rng: np.random.Generator) -> Any:
    decals, points, normals = even_sphere(rng)
    shift = np.array([4096.0, -8192.0, 16384.0])
    return decals.replace(positions=decals.positions + shift), points + shift, normals


def nested(rng: np.random.Generator) -> Any:
    """Five hundred on one point, of many sizes, and a hundred equal ones on another."""
    n = np.repeat([[0, 0, 1.0]], 600, axis=0)
    positions = np.repeat([[0, 0, 0], [0.5, 0, 0]], [500, 100], axis=0)
    radii = np.concatenate([rng.uniform(0.1, 0.4, 500), np.full(100, 0.3)])
    points = rng.uniform(-0.5, 1, (1500, 3)) * [1, 1, 0]
    return dress(rng, positions, n, radii), points, n[:1].repeat(1500, axis=0)


def scattered_in_space(rng: np.random.Generator) -> Any:
    decals = dress(rng, rng.random((300, 3)), rng.normal(size=(300, 3)), rng.uniform(0.05, 0.3, 300))
    return decals, rng.random((3000, 3)), random_units(rng, 3000)


def small_model(rng: np.random.Generator) -> Any:
    decals, points, normals = even_sphere(rng)
    return (
        decals.replace(positions=decals.positions * 1e-6, radii=decals.radii * 1e-6),
        points * 1e-6,
        normals,
    )


SETS = [even_sphere, unlike_sizes, thin_plate, far_away, nested, scattered_in_space, small_model]


def worst(got: Any, want: Any, rows: Any) -> Any:
    """Larger of the errors of uv, relative to its conditioning, and of the field."""
    uv = np.abs(got.uv - want.uv).max(axis=1) / want.stretch
    return np.maximum(uv, np.abs(got.field - want.field))[rows]


@pytest.mark.slow_cases("even_sphere-0", "far_away-0", "small_model-0", "unlike_sizes-0", "unlike_sizes-1")
@pytest.mark.parametrize("mapping", [ImageMapping.CHORD, ImageMapping.CORRECTED])
@pytest.mark.parametrize("make", SETS)
def test_against_brute_force(make: Any, mapping: ImageMapping) -> None:
    decals, points, normals = make(np.random.default_rng(SETS.index(make)))
    points, normals = np.array(points, np.float32), np.array(normals, np.float32)
    got = evaluate(decals, points, normals, mapping=mapping, contact="product")
    facing, corrected = unit(normals.astype(float)), mapping == ImageMapping.CORRECTED
    seen = partial(decals_at, decals, points, facing, corrected=corrected, contact="product")
    want = seen()
    clear = want.doubt > TIE
    assert clear.mean() > 0.5
    assert np.array_equal(got.owner[clear], want.owner[clear])
    same = clear & (want.owner >= 0)
    assert same.sum() > 100
    cut = worst(got, want, same).max()
    assert cut <= CUT_ERROR
    errors = worst(got, seen(reach=NEIGHBOR_REACH), same)
    print(f"{make.__name__}, {mapping.name}: cut {cut:.1e}, rounding {errors.max():.1e}")
    assert np.quantile(errors, 0.999) <= ROUNDING_ERROR  # a neighbour may lie on the very limit
    bare = got.owner < 0
    assert not got.uv[bare].any()
    assert not got.field[bare].any()


def test_a_lone_decal_shows_its_image_undistorted() -> None:
    decals = Decals([[1, 2, 3]], [[0, 0, 1]], [[0, 1, 0]], [2.0])
    points = np.array([[1, 2, 3], [1, 4, 3], [-1, 2, 3], [1, 1, 3], [1, 4.01, 3]])
    samples = evaluate(decals, points, np.tile([0, 0, 1], (5, 1)))
    assert samples.owner.tolist() == [0, 0, 0, 0, -1]
    assert samples.uv[:4] == pytest.approx(np.array([[0.5, 0.5], [1, 0.5], [0.5, 1], [0.25, 0.5]]), abs=1e-6)
    assert samples.field[:3] == pytest.approx(np.array([1, 0.5, 0.5]), abs=1e-6)


def test_ties_go_to_the_lowest_number_and_show_the_rim() -> None:
    flat = {"normals": [[0, 0, 1]] * 3, "tangents": [[1, 0, 0]] * 3}
    decals = Decals([[1, 0, 0], [-1, 0, 0], [1, 0, 0]], radii=[2, 2, 2], **flat)
    samples = evaluate(decals, [[0, 0.5, 0], [0.5, 0, 0]], [[0, 0, 1]] * 2, contact="product")
    assert samples.owner.tolist() == [0, 0]
    assert samples.field == pytest.approx(0.5)


@pytest.mark.parametrize("radii", [(0.1, 2.0), (2.0, 0.1)])
def test_ties_between_unlike_sizes_go_to_the_lowest_number_too(radii: NDArray[Any]) -> None:
    decals = Decals([[0, 0, 0]] * 2, [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, radii)
    assert evaluate(decals, [[0, 0, 0]], [[0, 0, 1]], contact="product").owner.tolist() == [0]


def test_index_and_brute_force_agree_to_the_bit() -> None:
    """One cell that holds everything gives what the index gives: culling changes nothing."""
    rng = np.random.default_rng(11)
    positions, normals = on_sphere(rng, 300)
    decals = dress(rng, positions, normals, np.full(300, 0.15))
    everything = DecalIndex.build(np.zeros((300, 3)), np.full(300, 100.0))
    points, directions = on_sphere(rng, 3000)
    culled = evaluate(decals, points, directions)
    brute = evaluate(decals, points, directions, index=everything)
    for name in ("owner", "uv", "field"):
        assert np.array_equal(getattr(culled, name), getattr(brute, name))


def test_the_far_side_is_coloured_only_by_decals_that_spill() -> None:
    decal = Decals([[0, 0, 0]], normals=[[0, 0, 1]], tangents=[[1, 0, 0]], radii=[1.0])
    behind = [[0.1, 0, -0.01]], [[0, 0, -1]]
    assert evaluate(decal, *behind).owner.tolist() == [-1]
    assert evaluate(decal.replace(spill=[True]), *behind).owner.tolist() == [0]
    below, above = np.deg2rad([100, 109])
    for angle, owner in ((below, 0), (above, -1)):
        tilted = [[np.sin(angle), 0, np.cos(angle)]]
        assert evaluate(decal, [[0.1, 0, 0]], tilted).owner.tolist() == [owner]


def test_normals_of_any_length() -> None:
    rng = np.random.default_rng(12)
    decals, points, normals = even_sphere(rng)
    one = evaluate(decals, points, normals)
    other = evaluate(decals, points, normals * 7)
    assert np.array_equal(one.owner, other.owner)
    assert one.uv == pytest.approx(other.uv, abs=1e-5)


def test_nothing_and_nonsense() -> None:
    decals = Decals.empty()
    assert evaluate(decals, np.zeros((3, 3)), np.zeros((3, 3))).owner.tolist() == [-1] * 3
    assert evaluate(decals, np.zeros((0, 3)), np.zeros((0, 3))).uv.shape == (0, 2)
    one = Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1.0])
    nowhere = evaluate(one, [], [], jacobian=True, normal_derivatives=[])
    assert (nowhere.owner.shape, nowhere.uv.shape) == ((0,), (0, 2))
    assert nowhere.jacobian is not None
    assert nowhere.jacobian.shape == (0, 2, 3)
    strange = [[np.nan, 0, 0], [np.inf, 0, 0], [3e38, -3e38, 0]]
    samples = evaluate(one, strange, np.tile([0, 0, 1], (3, 1)))
    assert samples.owner.tolist() == [-1] * 3
    assert np.isfinite(evaluate(one, [[0.1, 0.2, 0]], [[0, 0, 0]]).uv).all()


@pytest.mark.parametrize(
    ("points", "normals", "says"),
    [
        (np.zeros((2, 2)), np.zeros((2, 3)), "points: expected shape"),
        (np.zeros((2, 3)), np.zeros(3), "normals: expected shape"),
        (np.zeros((2, 3)), np.zeros((1, 3)), "one for each of 2 points, got 1"),
        ([["a", "b", "c"]], np.zeros((1, 3)), "points: expected numbers"),
        (np.zeros((2, 3)), [[0, 0], [1]], "normals: expected numbers"),
    ],
)
def test_refuses(points: NDArray[Any], normals: NDArray[Any], says: str) -> None:
    with pytest.raises(InvalidPoints, match=says):
        evaluate(Decals.empty(), points, normals)


@pytest.mark.parametrize(
    ("wrong", "error", "says"),
    [
        (
            {"mapping": 5},
            InvalidScene,
            "mapping: expected one of 'chord', 'corrected', 'walked', got 5",
        ),
        ({"stiffness": 0.5}, InvalidScene, "stiffness: expected a number from 1 to 64, got 0.5"),
        ({"stiffness": "hard"}, InvalidScene, "stiffness: expected a number from 1 to 64, got 'hard'"),
        ({"contact": "round"}, InvalidScene, "contact: expected one of .*, 'elastic', got 'round'"),
        ({"device": "cuda:99"}, InvalidDevice, "got 'cuda:99'"),
        ({"images": ["skale.png"]}, InvalidImage, "expected an image, found no file 'skale.png'"),
        ({"decals": "scale"}, InvalidDecals, "expected Decals or a DecalEditor, got 'scale'"),
        ({"index": "scale"}, InvalidDecals, "index: expected the index of these 1 decals, got 'scale'"),
    ],
)
def test_refuses_what_is_none(wrong: Any, error: Any, says: str) -> None:
    one = Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1.0])
    with pytest.raises(error, match=says):
        evaluate(**{"decals": one, "points": np.zeros((1, 3)), "normals": np.eye(3)[2:]} | wrong)


def test_the_index_of_other_decals_is_refused() -> None:
    other = DecalIndex.build(np.zeros((9, 3)), np.ones(9))
    with pytest.raises(InvalidDecals, match="index: expected the index of these 1 decals, got one of 9"):
        evaluate(
            Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1.0]), np.zeros((1, 3)), np.eye(3)[2:], index=other
        )


def test_a_normal_without_length_faces_every_decal() -> None:
    one = Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [1.0])
    seen = evaluate(one, [[0.25, 0, 0]], [[0, 0, 0]])
    assert (seen.owner[0], seen.uv[0].tolist()) == (0, [0.625, 0.5])


component = st.floats(-2, 2, width=32)
triple = st.tuples(component, component, component)
direction = triple.filter(lambda v: np.linalg.norm(v) > 0.01)


@settings(max_examples=150)
@given(
    centres=st.lists(triple, min_size=1, max_size=6),
    normal=direction,
    radius=st.floats(2.0**-6, 3, width=32),
    points=st.lists(triple, min_size=1, max_size=6),
    look=direction,
)
def test_any_small_set(
    centres: NDArray[Any], normal: Any, radius: float, points: NDArray[Any], look: Any
) -> None:
    tangent = np.cross(normal, [0.6, 0.8, 0] if abs(normal[2]) > 1e-3 else [0, 0, 1])
    count = len(centres)
    decals = Decals(centres, [normal] * count, [tangent] * count, [radius] * count)
    normals = np.array([look] * len(points), np.float32)
    got = evaluate(decals, points, normals)
    want = decals_at(decals, np.array(points, np.float32), unit(normals.astype(float)))
    assert np.isfinite(got.uv).all()
    clear = (want.doubt > TIE) & (want.stretch < 10)
    assert np.array_equal(got.owner[clear], want.owner[clear])
    assert np.abs(got.uv - want.uv)[clear].max(initial=0) <= 1e-3
