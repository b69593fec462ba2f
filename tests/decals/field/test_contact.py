"""Contact: the four constraints of the paper's section 3.2, and float32 against float64 where it hurts."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from decals import Contact
from decals.record import NEIGHBOR_REACH
from tests.decals.field.kernels import contact_of_rows, rims_of_sets, uv_of_offsets
from tests.oracles import contact as oracle
from tests.vectors import random_units

ERROR_LIMIT = 2e-5
"""Largest accepted error of r, in rim radii."""

HALF = np.float32(0.5)


def complement_of(e: Any, contact: Contact = Contact.PRODUCT) -> Any:
    """E of rows of complements, through Warp."""
    e = np.atleast_2d(np.asarray(e, np.float32))
    result = wp.zeros(len(e), dtype=wp.float32, device="cpu")
    owner: Any = wp.array(e.argmin(axis=1), dtype=wp.int32, device="cpu")
    wp.launch(contact_of_rows, len(e), [wp.array(e, device="cpu"), owner, int(contact), result], device="cpu")
    return result.numpy()


# -- the four constraints, as properties ------------------------------------------------------------

inside = st.floats(0.0, 0.5, width=32)
anywhere = st.floats(0.0, 1.0, width=32)


PUSHING = st.sampled_from([Contact.PRODUCT, Contact.MIN])


@settings(max_examples=200)
@given(owner=inside, others=st.lists(st.floats(0.5, 1.0, width=32), max_size=6), contact=PUSHING)
def test_where_no_pair_of_fields_exceeds_one_nothing_changes(
    owner: float, others: Any, contact: Contact
) -> None:
    far = [max(np.float32(x), np.float32(1) - np.float32(owner)) for x in others]
    assert complement_of([owner, *far], contact)[0] == np.float32(owner)


@settings(max_examples=200)
@given(others=st.lists(st.floats(2.0**-60, 1.0, width=32), max_size=6), contact=PUSHING)
def test_the_centre_stays_in_place(others: Any, contact: Contact) -> None:
    assert complement_of([0.0, *others], contact)[0] == 0.0


@settings(max_examples=200)
@given(owner=inside, others=st.lists(anywhere, max_size=6), place=st.integers(0, 6), contact=PUSHING)
def test_equal_fields_meet_at_the_rim(owner: float, others: Any, place: Any, contact: Contact) -> None:
    rest = [max(x, owner) for x in others]
    e = [owner, *rest[:place], owner, *rest[place:]]
    assert complement_of(e, contact)[0] == pytest.approx(0.5, abs=1e-6)


@settings(max_examples=300)
@given(
    owner=st.floats(2.0**-20, 0.5, width=32),
    others=st.lists(st.tuples(anywhere, st.floats(-1, 1)), min_size=1, max_size=6),
    size=st.floats(0.0, 1e-3),
    contact=PUSHING,
)
def test_small_changes_of_the_fields_change_little(
    owner: float, others: Any, size: Any, contact: Contact
) -> None:
    """Continuity, with the Lipschitz bound that follows from |∂φ/∂e| ≤ 4/e_k."""
    before = np.array([max(x, owner) for x, _ in others], np.float32)
    steps = np.float32(size) * np.array([x for _, x in others], np.float32)
    after = np.clip(before + steps, owner, 1).astype(np.float32)
    step = np.abs(after - before).sum()
    change = abs(complement_of([owner, *after], contact)[0] - complement_of([owner, *before], contact)[0])
    assert change <= 4 / owner * step + 1e-6


@settings(max_examples=200)
@given(owner=inside, others=st.lists(anywhere, max_size=6))
def test_agrees_with_the_equation_as_written(owner: float, others: Any) -> None:
    e = np.array([owner, *(max(x, owner) for x in others)], np.float32).astype(np.float64)
    if 1e-3 < owner < 0.5 - 1e-3:
        assert 1 - complement_of(e)[0] == pytest.approx(oracle.contact_field(1 - e[None])[0], abs=1e-5)


def test_the_two_forms_of_the_oracle_agree() -> None:
    e = np.random.default_rng(0).random((50_000, 4)) * [0.5, 1, 1, 1]
    owner, complement = oracle.contact_complement(e)
    safe = (owner >= 0) & (e.min(axis=1) > 1e-3) & (e.min(axis=1) < 0.499)
    assert safe.sum() > 40_000
    assert complement[safe] == pytest.approx(1 - oracle.contact_field(1 - e)[safe], abs=1e-9)


# -- a million points where float32 hurts -----------------------------------------------------------


def at_distances(
    rng: np.random.Generator, distance: NDArray[Any], influence: NDArray[Any], scale: float = 1.0
) -> Any:
    """Points, centres [m, k, 3] at the relative distances [m, k] asked for, and sizes."""
    points = rng.normal(size=(len(distance), 3)) * scale
    centres = points[:, None] + random_units(rng, *distance.shape) * (distance * influence)[..., None]
    return points, centres, influence


def unlike_sizes(rng: np.random.Generator, shape: Any, ratio: float = 1e3) -> Any:
    return ratio ** rng.uniform(-0.5, 0.5, shape)


def powers(rng: np.random.Generator, low: Any, high: Any, shape: Any) -> Any:
    return 10.0 ** rng.uniform(low, high, shape)


def random_sets(rng: np.random.Generator, shape: Any) -> Any:
    return at_distances(rng, rng.uniform(0, 1.1, shape), rng.uniform(0.5, 2, shape))


def unlike_sets(rng: np.random.Generator, shape: Any) -> Any:
    return at_distances(rng, rng.uniform(0, 0.7, shape), unlike_sizes(rng, shape))


def ties(rng: np.random.Generator, shape: Any) -> Any:
    nearest = rng.uniform(0, oracle.RIM, (shape[0], 1))
    spread = powers(rng, -8, -1, shape) * (rng.random(shape) < 0.8)
    return at_distances(rng, nearest * (1 + spread), unlike_sizes(rng, shape))


def coincident(rng: np.random.Generator, shape: Any) -> Any:
    points, centres, influence = at_distances(rng, rng.uniform(0, 0.6, shape), rng.uniform(0.5, 2, shape))
    same = rng.random(shape[0]) < 0.5
    return (
        points,
        np.repeat(centres[:, :1], shape[1], axis=1),
        np.where(same[:, None], influence[:, :1], influence),
    )


def near_rims(rng: np.random.Generator, shape: Any) -> Any:
    distance = oracle.RIM * (1 + powers(rng, -8, -1, shape) * rng.choice([-1, 1], shape))
    return at_distances(rng, distance, unlike_sizes(rng, shape))


def near_centres(rng: np.random.Generator, shape: Any) -> Any:
    nearest = powers(rng, -12, -0.5, (shape[0], 1))
    return at_distances(rng, nearest * powers(rng, 0, 1, shape), unlike_sizes(rng, shape), scale=0.0)


def near_centres_with_ties(rng: np.random.Generator, shape: Any) -> Any:
    nearest = powers(rng, -12, -0.5, (shape[0], 1))
    return at_distances(rng, nearest * (1 + powers(rng, -8, 0, shape)), unlike_sizes(rng, shape), scale=0.0)


SETS = [random_sets, unlike_sets, ties, coincident, near_rims, near_centres, near_centres_with_ties]


def rims_through_warp(
    points: NDArray[Any], centres: NDArray[Any], influence: NDArray[Any], contact: Contact
) -> Any:
    count = len(points)
    owners = wp.zeros(count, dtype=wp.int32, device="cpu")
    rims = wp.zeros(count, dtype=wp.float32, device="cpu")
    inputs: list[Any] = [
        wp.array(points, dtype=wp.vec3, device="cpu"),
        wp.array(centres, dtype=wp.vec3, ndim=2, device="cpu"),
        wp.array(influence, dtype=wp.float32, ndim=2, device="cpu"),
    ]
    wp.launch(rims_of_sets, count, [*inputs, int(contact), owners, rims], device="cpu")
    return owners.numpy(), rims.numpy()


def rims_in_float64(
    points: NDArray[Any], centres: NDArray[Any], influence: NDArray[Any], contact: Contact
) -> Any:
    """The oracle, from the very same float32 numbers."""
    w = points[:, None].astype(np.float64) - centres
    owner, complement = oracle.contact_complement(
        oracle.complements((w * w).sum(axis=2) / influence.astype(np.float64) ** 2),
        strongest=contact == Contact.MIN,
    )
    return owner, oracle.rim_distance(complement)


@pytest.mark.parametrize("contact", [Contact.PRODUCT, Contact.MIN])
@pytest.mark.parametrize("make", SETS)
def test_error_on_adversarial_points(make: Any, contact: Contact, record_property: Any) -> None:
    """Seven sets of 150,000 points with up to six decals: 1,050,000 in all, in each mode."""
    rng = np.random.default_rng(SETS.index(make))
    worst, owned = 0.0, 0
    for count in (2, 3, 6):
        points, centres, influence = (a.astype(np.float32) for a in make(rng, (50_000, count)))
        owner, rims = rims_through_warp(points, centres, influence, contact)
        expected_owner, expected = rims_in_float64(points, centres, influence, contact)
        assert np.isfinite(rims).all()
        both = (owner >= 0) & (expected_owner >= 0)
        one = (owner >= 0) != (expected_owner >= 0)
        seen = np.where(owner >= 0, rims, expected)
        assert np.abs(seen[one] - 1).max(initial=0) < ERROR_LIMIT  # they differ on the rim itself only
        worst = max(worst, np.abs(rims - expected)[both].max())
        owned += both.sum()
    record_property("error_over_rim", float(worst))
    print(f"{make.__name__}: {worst:.2e} rim radii over {owned:,} owned points")
    assert owned > 20_000
    assert worst <= ERROR_LIMIT


@pytest.mark.parametrize("contact", [Contact.PRODUCT, Contact.MIN])
def test_concentric_decals_push_alike_at_every_distance(contact: Contact) -> None:
    """Twice the complement is a push of nearly 1/e, down to the smallest squares that float32 holds."""
    e = 10.0 ** np.linspace(-36.5, -1, 200)
    rows = np.column_stack([e, 2 * e]).astype(np.float32)
    found = complement_of(rows, contact)
    want = oracle.contact_complement(rows.astype(np.float64))[1]
    assert np.abs(found - want).max() < 1e-6
    assert found[0] == pytest.approx(0.5 / np.e, abs=1e-6)


def test_what_lies_beyond_reach_hardly_matters() -> None:
    """The promise behind NEIGHBOR_REACH, for one neighbour anywhere beyond it."""
    e_k = np.linspace(1e-6, 0.5, 2001)
    e_i = np.full_like(e_k, oracle.complements(NEIGHBOR_REACH**2))
    pushed = oracle.rim_distance(oracle.contact_complement(np.column_stack([e_k, e_i]))[1])
    assert np.abs(pushed - oracle.rim_distance(e_k)).max() < 7e-5


# -- image coordinates ------------------------------------------------------------------------------


def uv_of(offsets: ArrayLike, rims: ArrayLike) -> Any:
    offsets, rims = np.array(offsets, np.float32), np.array(rims, np.float32)
    uv = wp.zeros(len(offsets), dtype=wp.vec2, device="cpu")
    inputs: list[Any] = [
        wp.array(offsets, dtype=wp.vec2, device="cpu"),
        wp.array(rims, dtype=wp.float32, device="cpu"),
    ]
    wp.launch(uv_of_offsets, len(offsets), [*inputs, uv], device="cpu")
    return uv.numpy()


def test_uv_keeps_the_direction_and_takes_the_length_from_the_field() -> None:
    rng = np.random.default_rng(1)
    angle, rim = rng.uniform(-np.pi, np.pi, 10_000), rng.random(10_000)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    expected = 0.5 + 0.5 * rim[:, None] * direction
    for scale in (1e-30, 1e-3, 1.0, 1e30):
        assert uv_of(direction * scale, rim) == pytest.approx(expected, abs=1e-6)


def test_uv_of_the_centre_is_the_middle_of_the_image() -> None:
    assert uv_of([[0, 0], [0, 0]], [0, 1]).tolist() == [[0.5, 0.5], [0.5, 0.5]]
