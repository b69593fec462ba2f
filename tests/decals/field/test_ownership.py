"""One walk of the index finds what two find: owner and deformation where all decals are in contact."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from decals import Contact, Decals
from decals.index.index import index_on
from tests.decals.field.kernels import both_ways


def flat(
    rng: np.random.Generator, count: int, side: Any, radii: tuple[float, float], *, copies: int = 1
) -> Any:
    """Decals in the xy plane, each of them several times on its place."""
    positions = np.repeat(np.column_stack([rng.uniform(-side, side, (count, 2)), np.zeros(count)]), copies, 0)
    many = len(positions)
    frame = np.tile([[0, 0, 1.0]], (many, 1)), np.tile([[1.0, 0, 0]], (many, 1))
    return Decals(
        positions, *frame, np.repeat(np.exp(rng.uniform(np.log(radii[0]), np.log(radii[1]), count)), copies)
    )


@pytest.mark.parametrize("contact", [Contact.PRODUCT, Contact.MIN, Contact.ELASTIC])
@pytest.mark.parametrize(
    ("count", "side", "radii", "copies"),
    [
        (1, 1, (1, 1.1), 1),
        (60, 2, (0.3, 0.5), 1),
        (400, 2, (0.05, 0.6), 1),
        (40, 2, (0.3, 0.6), 2),
        (90, 0.2, (0.3, 0.6), 1),
    ],
)
def test_once_is_twice(
    contact: Contact, count: int, side: Any, radii: tuple[float, float], copies: int
) -> None:
    rng = np.random.default_rng(count)
    decals = flat(rng, count, side, radii, copies=copies)
    points = np.column_stack([rng.uniform(-side, side, (20_000, 2)), np.zeros(20_000)]).astype(np.float32)
    points[: len(decals)] = decals.positions[: len(points)]
    inputs = [
        wp.array(points, dtype=wp.vec3, device="cpu"),
        int(contact),
        index_on(decals, "cpu"),
    ]
    once, twice = (wp.zeros(len(points), dtype=wp.vec4, device="cpu") for _ in range(2))
    wp.launch(both_ways, len(points), inputs, [once, twice], device="cpu")
    assert (twice.numpy()[:, 0] >= 0).any()
    np.testing.assert_array_equal(once.numpy()[:, 0], twice.numpy()[:, 0])
    np.testing.assert_allclose(once.numpy()[:, 1], twice.numpy()[:, 1], rtol=2e-6, atol=2e-7)
