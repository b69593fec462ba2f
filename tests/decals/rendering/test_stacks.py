"""Decals stacked on one point, of many sizes: every pixel against the oracle, in every mode of contact."""

from typing import Any

import numpy as np
import pytest

from decals import Camera, Contact, Decals, ImageMapping
from decals.errors import TooMuchData
from decals.rendering import Renderer, RenderOptions
from tests.decals.rendering.pictures import WHITE, compare, plain_colors, quarters, wall
from tests.decals.shapes import View, torus
from tests.oracles.decals import colors_at

CENTRE = (0, -1.4, 0)


@pytest.mark.parametrize("contact", list(Contact))
@pytest.mark.parametrize("order", ["falling", "rising", "shuffled"])
@pytest.mark.parametrize("count", [64, pytest.param(200, marks=pytest.mark.slow)])
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
    owned = compare(
        view,
        renderer.buffers(view, RenderOptions(size=(32, 24), contact=contact)),
        ImageMapping.CORRECTED,
        contact,
    )
    assert owned.sum() > 60


@pytest.mark.slow_cases("1000")
@pytest.mark.parametrize("count", [1000, 3000, 6000])
def test_deep_stacks_in_layers_are_whole_or_refused(renderer: Renderer, count: int) -> None:
    """Translucent plain decals over each other: all of them in the colour, or a clear error."""
    rng = np.random.default_rng(count)
    view = wall(quarters(), color=(0, 0, 0))
    arrays: dict[str, Any] = {
        "positions": np.zeros((count, 3)),
        "normals": [[0, 0, 1]] * count,
        "tangents": [[1, 0, 0]] * count,
        "radii": rng.choice([2.0, 4.5], count),
        "interactions": rng.integers(0, 2, count) * 2,
        "layers": rng.integers(-9, 9, count),
        "images": np.full(count, -1),
        "tints": rng.random((count, 3)),
        "opacities": np.full(count, 0.5 / count),
    }
    decals = Decals(**arrays)
    try:
        seen = renderer.render(
            View(view.objects, view.camera, decals), RenderOptions(size=(16, 12), samples=1)
        )
    except TooMuchData:
        assert count > 1500
        return
    points, normals = np.zeros((1, 3)), np.array([[0, 0, 1.0]])
    color = colors_at(decals, points, normals, lambda i, uv: plain_colors(decals, i))[0]
    srgb = 1.055 * color[:3] ** (1 / 2.4) - 0.055
    painted = wall(quarters(), color=tuple(srgb.tolist()))
    plain = renderer.render(View(painted.objects, painted.camera), RenderOptions(size=(16, 12), samples=1))
    np.testing.assert_allclose(seen.astype(int), plain, atol=1)
