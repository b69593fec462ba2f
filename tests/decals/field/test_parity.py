"""The whole decal function against float64 on adversarial points: a million in every mode, 10⁸ on a GPU.

The float64 kernel that can answer so many is itself held against the NumPy oracle.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from decals import Contact, ImageMapping
from decals.record import NEIGHBOR_REACH
from tests.bench.parity import Chunk, limits_of, make_world, parity, worst_points
from tests.oracles.contact import rim_distance
from tests.oracles.decals import decals_at

DOUBT = 1e-9
"""Relative change up to which two float64 oracles may see different owners."""


@pytest.mark.ordinary_cases("1-False", "2-False", "3-True")
@pytest.mark.parametrize("layered", [False, True])
@pytest.mark.parametrize("contact", Contact)
def test_the_two_oracles_agree(contact: Contact, layered: bool) -> None:
    """On 8,000 points in each mode; with neighbours within reach, and with all."""
    world = make_world(7, layered=layered)
    chunk = Chunk(world, 8_000, 7 + contact, "cpu")
    points, normals = chunk.points.numpy(), chunk.normals.numpy().astype(float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mapping = ImageMapping.CHORD if layered else ImageMapping.CORRECTED
    reach = 1.0 if contact in (Contact.RADIAL, Contact.ELASTIC) else NEIGHBOR_REACH
    owner, complement, place, doubt, edge = (a.numpy() for a in chunk.expected(contact, mapping, reach=reach))
    owned = 0
    for number, rows in by_set(chunk.sets.numpy()):
        first = number * world.members
        want = decals_at(
            world.decals[first : first + world.members],
            points[rows],
            normals[rows],
            corrected=mapping == ImageMapping.CORRECTED,
            reach=reach,
            contact=contact.name.lower(),
        )
        seen = np.where(want.owner >= 0, want.owner + first, -1)
        clear = (doubt[rows] > DOUBT) & (edge[rows] > DOUBT)
        assert np.array_equal(owner[rows][clear], seen[clear])
        both = clear & (seen >= 0)
        rim = rim_distance(complement[rows][both])
        assert np.abs(rim - rim_distance(1 - want.field[both])).max(initial=0) < 1e-7  # 1 − F cancels
        assert np.abs(place[rows, :2] - want.uv)[both & (want.stretch < 100)].max(initial=0) < 1e-7
        owned += both.sum()
    assert owned > 5_000


def by_set(sets: NDArray[np.integer]) -> Iterable[tuple[int, NDArray[np.intp]]]:
    """Rows of each set."""
    order = np.argsort(sets, kind="stable")
    starts = np.flatnonzero(np.diff(sets[order], prepend=-1))
    return zip(sets[order][starts], np.split(order, starts[1:]), strict=True)


def check(contact: Contact, found: Any, samples: int) -> None:
    print(found)
    assert found["points"] == samples
    assert found["owned"] > 0.8 * samples
    assert found["unclear"] < 0.2 * samples
    for name, most in limits_of(contact).items():
        assert found[name] <= most, name


@pytest.mark.ordinary_cases("100000-0-False", "100000-1-True", "100000-2-True", "100000-3-False")
@pytest.mark.parametrize("layered", [False, True])
@pytest.mark.parametrize("contact", Contact)
@pytest.mark.parametrize("samples", [100_000, pytest.param(500_000, marks=pytest.mark.slow)])
def test_many_points_in_a_sheet_and_in_layers(contact: Contact, layered: bool, samples: int) -> None:
    check(contact, parity(contact, layered=layered, samples=samples, device="cpu", chunk=50_000), samples)


@pytest.mark.gpu
@pytest.mark.parametrize("layered", [False, True])
@pytest.mark.parametrize("contact", Contact)
def test_a_hundred_million_points_on_a_cuda_device(contact: Contact, layered: bool) -> None:
    check(contact, parity(contact, layered=layered, samples=100_000_000, device="cuda:0"), 100_000_000)


def test_the_worst_points_are_described() -> None:
    """An owner that differs comes first, then the largest error."""
    world = make_world(3)
    chunk = Chunk(world, 1000, 3, "cpu")
    found = [a.numpy().copy() for a in chunk.computed(Contact.PRODUCT, ImageMapping.CORRECTED, once=True)]
    wanted = [
        a.numpy() for a in chunk.expected(Contact.PRODUCT, ImageMapping.CORRECTED, reach=NEIGHBOR_REACH)
    ]
    clear = np.flatnonzero((found[0] >= 0) & (wanted[3] > 0.01) & (wanted[4] > 0.01))
    found[0][clear[0]], found[1][clear[1]] = -1, found[1][clear[1]] - 0.5
    lines = worst_points(world, chunk.points.numpy(), chunk.sets.numpy(), found, wanted)
    assert lines[0].startswith("  error 2.000e+00")
    assert lines[4].startswith("  error 5.000e-01")
    assert len(lines) == 16
