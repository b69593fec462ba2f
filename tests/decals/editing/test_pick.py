"""Picks are what pictures show, and outlines run where neighbours begin."""

from typing import Any

import numpy as np
import pytest

from blobtree import Point
from decals import Camera, DecalImage, Interaction, Scene, TreeObject, evaluate
from decals.editing import Document, EditSession, outline, pick
from decals.editing.queries import LIFT, outlines
from decals.rendering import Renderer, RenderOptions
from tests.decals.editing.scenes import one, scene

SIZE = 120, 90


def test_picks_are_the_owners_in_the_picture(renderer: Renderer) -> None:
    session = EditSession(scene())
    document = session.document
    buffers = renderer.buffers(document, RenderOptions(size=SIZE))
    rays = document.camera.rays(*SIZE)
    rng = np.random.default_rng(0)
    seen = wrong = 0
    for x, y in zip(rng.integers(0, SIZE[0], 400), rng.integers(0, SIZE[1], 400), strict=True):
        found = pick(document, rays.origin, rays.directions(x + 0.5, y + 0.5))
        row = SIZE[1] - 1 - y
        expected = buffers.object_id[row, x], buffers.owner[row, x]
        got = (-1, -1) if found is None else (found.object, found.owner)
        wrong += got != expected
        if found is not None and got[0] == expected[0]:
            seen += 1
            np.testing.assert_allclose(found.position, buffers.position[row, x], atol=1e-3)
    assert seen > 100
    assert wrong <= 4  # silhouettes


def flat(*decals: Any) -> Any:
    """A large ball, nearly flat at the top, with decals there."""
    ball = TreeObject("ball", Point((0, 0, -100), radius=100.0))
    together = type(decals[0]).concatenate(decals)
    images = (DecalImage.load("scale"),)
    return Document.from_scene(
        Scene(objects=(ball,), decals=together, images=images, camera=Camera((0, 0, 5)))
    )


def test_a_decal_alone_has_its_rim_as_outline() -> None:
    line = outline(flat(one((0, 0, 0), 0.5)), 0)
    np.testing.assert_array_equal(line[0], line[-1])
    np.testing.assert_allclose(np.linalg.norm(line, axis=1), 0.5, rtol=0.02)
    np.testing.assert_allclose(line[:, 2], LIFT * 0.5, atol=5e-3)


def test_neighbours_cut_the_outline_where_they_begin() -> None:
    document = flat(one((0, 0, 0), 0.5), one((0.6, 0, 0), 0.5))
    line = outline(document, 0)
    assert line[:, 0].max() == pytest.approx(0.3, abs=0.01)
    assert line[:, 0].min() == pytest.approx(-0.5, abs=0.01)
    inner = (line - (0, 0, LIFT * 0.5)) * 0.97
    up = np.broadcast_to([[0, 0, 1]], inner.shape)
    assert (evaluate(document.decals, inner, up).owner == 0).all()


def test_who_does_not_show_has_an_undisturbed_rim() -> None:
    cover = one((0, 0, 0), 1.0, layers=[1], interactions=[Interaction.OVERLAP])
    line = outline(flat(one((0, 0, 0), 0.5), cover), 0)
    np.testing.assert_allclose(np.linalg.norm(line, axis=1), 0.5, rtol=0.02)


def test_neighbours_cut_the_outlines_of_many_too() -> None:
    document = flat(one((0, 0, 0), 0.5), one((0.6, 0, 0), 0.5))
    lines = outlines(document, [1, 0])
    assert lines[1, :, 0].max() == pytest.approx(0.3, abs=0.01)
    assert lines[0, :, 0].min() == pytest.approx(0.3, abs=0.01)
    np.testing.assert_allclose(lines[:, 0], lines[:, -1], atol=1e-6)
