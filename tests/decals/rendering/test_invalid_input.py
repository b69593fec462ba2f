"""Odd images, no decals and absurd sizes are drawn as they should be, or not at all."""

from typing import Any

import numpy as np
import pytest

from decals import Decals
from decals.errors import InvalidScene
from decals.model import MAX_COORDINATE, MIN_RADIUS
from decals.rendering import Renderer, RenderOptions
from tests.decals.rendering.pictures import WHITE, scattered, view_of, wall
from tests.decals.shapes import Picture, View, torus

SIZE = (48, 36)


@pytest.mark.parametrize(
    ("height", "width"), [(1, 1), (3, 5), (7, 2), (1, 999), (8, 16_000), (16_000, 1), (129, 127)]
)
def test_a_flat_image_of_any_size_is_its_colour(renderer: Renderer, height: int, width: int) -> None:
    image = np.zeros((height, width, 4), np.uint8)
    image[:] = 200, 90, 40, 255
    small = np.zeros((4, 4, 4), np.uint8)
    small[:] = 200, 90, 40, 255
    seen, expected = (renderer.render(wall(pixels), RenderOptions(size=SIZE)) for pixels in (image, small))
    np.testing.assert_allclose(seen.astype(int), expected, atol=1)


def test_images_of_many_sizes_side_by_side(renderer: Renderer) -> None:
    """Half red, half blue, whatever the number of pixels: red shows on the left."""
    for height, width in [(2, 2), (3, 8), (100, 6), (2, 4000)]:
        image = np.zeros((height, width, 4), np.uint8)
        image[..., 3], image[:, : width // 2, 0], image[:, width // 2 :, 2] = 255, 255, 255
        seen = renderer.render(wall(image), RenderOptions(size=(64, 64), samples=1)).astype(int)
        assert seen[32, 12, 0] > 3 * seen[32, 12, 2]
        assert seen[32, 52, 2] > 3 * seen[32, 52, 0]


def test_no_decals_are_no_decals(renderer: Renderer) -> None:
    shape = torus()
    view = view_of(Decals.empty(), shape)
    bare = renderer.render(View(view.objects, view.camera), RenderOptions(size=SIZE))
    np.testing.assert_array_equal(renderer.render(view, RenderOptions(size=SIZE)), bare)
    assert (renderer.buffers(view, RenderOptions(size=SIZE)).owner == -1).all()


def test_sizes_at_both_limits_beside_usual_ones(renderer: Renderer) -> None:
    """The largest owns all that is seen; the smallest change nothing."""
    shape = torus()
    usual = scattered(shape, 60, 1, radii=(0.05, 0.4))
    arrays: dict[str, Any] = {
        "positions": [[0, -1.4, 0], [0, -1.4, 0], [0, 0, 0]],
        "normals": [[0, -1, 0]] * 3,
        "tangents": [[1, 0, 0]] * 3,
        "radii": [MIN_RADIUS, 1e-12, MAX_COORDINATE],
        "spill": [True] * 3,
    }
    view = view_of(usual, shape)
    mixed = View(view.objects, view.camera, Decals.concatenate([usual, Decals(**arrays)]), (WHITE,))
    buffers = renderer.buffers(mixed, RenderOptions(size=SIZE, contact="product"))
    seen = buffers.object_id >= 0
    assert (buffers.owner[seen] == 62).all()  # its field is highest wherever no other has its centre
    assert np.isfinite(buffers.uv).all()
    usual_again = renderer.buffers(view, RenderOptions(size=SIZE))
    tiny = View(view.objects, view.camera, Decals.concatenate([usual, Decals(**arrays)[:2]]), (WHITE,))
    np.testing.assert_array_equal(renderer.buffers(tiny, RenderOptions(size=SIZE)).owner, usual_again.owner)


def test_a_picture_after_a_refused_one_is_as_before(renderer: Renderer) -> None:
    shape = torus()
    view = view_of(scattered(shape, 30, 2, radii=(0.1, 0.4)), shape)
    before = renderer.render(view, RenderOptions(size=SIZE))
    bad = View(view.objects, view.camera, view.decals, (Picture(np.zeros((4, 4, 3), np.uint8)),))
    with pytest.raises(ValueError, match="image 0: expected uint8, uint16 or float32 pixels"):
        renderer.render(bad, RenderOptions(size=SIZE))
    np.testing.assert_array_equal(renderer.render(view, RenderOptions(size=SIZE)), before)


@pytest.mark.parametrize("wrong", [{"mapping": 7}, {"mapping": "cord"}, {"contact": None}, {"contact": 4}])
def test_modes_that_are_none_are_refused(renderer: Renderer, wrong: dict[str, Any]) -> None:
    (name,) = wrong
    for draw in (renderer.render, renderer.buffers):
        with pytest.raises(InvalidScene, match=f"{name}: expected one of '(chord|product)', "):
            draw(wall(WHITE.pixels), RenderOptions(size=SIZE, **wrong))
