"""Points that an image reaches show a decal, however unevenly the decals lie."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from decals import Contact, ImageMapping
from decals.index.index import index_on
from tests.decals.distortion import random_points
from tests.decals.field.kernels import both_ways
from tests.decals.placed_by_hand import FAMILIES, MODELS, pinholes, placed


@pytest.mark.parametrize("contact", [mode.name.lower() for mode in Contact])
@pytest.mark.parametrize("family", FAMILIES)
def test_decals_placed_by_hand_leave_no_pinhole(family: str, contact: str) -> None:
    """Without another try beyond images that end, these sets have up to 4e-3 of them."""
    for model in MODELS.values():
        mesh = model()
        assert pinholes(placed(mesh, 3, **FAMILIES[family]), mesh, 20_000, contact) == 0.0


@pytest.mark.parametrize("contact", [Contact.PRODUCT, Contact.ELASTIC])
def test_shaders_try_as_evaluate_does(contact: Contact) -> None:
    mesh = MODELS["gear"]()
    index = index_on(placed(mesh, 3, **FAMILIES["tilted"]), "cpu")
    index.mapping = int(ImageMapping.CORRECTED)
    inputs: list[Any] = [
        wp.array(rows, dtype=wp.vec3, device="cpu") for rows in random_points(mesh, 50_000, 7)
    ]
    once, twice = (wp.zeros(50_000, dtype=wp.vec4, device="cpu") for _ in range(2))
    wp.launch(both_ways, 50_000, [*inputs, int(contact), index], [once, twice], device="cpu")
    np.testing.assert_array_equal(once.numpy()[:, 0], twice.numpy()[:, 0])
    np.testing.assert_allclose(once.numpy()[:, 1:], twice.numpy()[:, 1:], atol=2e-5)
