"""Decals stacked on one point, of many sizes: every pixel against the oracle, in every mode of contact."""

from typing import Any

import numpy as np
import pytest

from decals.camera import Camera
from decals.contact import Contact
from decals.mapping import Mapping
from decals.model import Decals
from decals.render.renderer import Renderer
from tests.decals.shapes import View, torus
from tests.decals.test_render_decals import WHITE, compare

CENTRE = (0, -1.4, 0)


@pytest.mark.parametrize("contact", list(Contact))
@pytest.mark.parametrize("order", ["falling", "rising", "shuffled"])
@pytest.mark.parametrize("count", [64, 500])
def test_stacks(renderer: Renderer, count: int, order: str, contact: Contact) -> None:
    """Radial contact shows the smallest over the others; the other modes one of highest field."""
    rng = np.random.default_rng(count)
    radii = np.geomspace(0.6, 0.06, count)
    radii = {"falling": radii, "rising": radii[::-1], "shuffled": rng.permutation(radii)}[order]
    arrays: dict[str, Any] = {
        "positions": np.tile(CENTRE, (count, 1)),
        "normals": np.tile([0, -1, 0], (count, 1)),
        "tangents": rng.normal(size=(count, 3)),
        "radii": radii,
    }
    shape = torus()
    camera = Camera.fitting(shape.vertices, direction=(0, -1, 0.2), up=(0, 0, 1))
    view = View((shape,), camera, Decals(**arrays), (WHITE,))
    owned = compare(view, renderer.buffers(view, size=(32, 24), contact=contact), Mapping.CORRECTED, contact)
    assert owned.sum() > 60
