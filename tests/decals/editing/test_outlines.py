"""Outlines on strongly curved surface run where the picture shows the image to end."""

from typing import Any

import numpy as np
import pytest
import pyvista as pv

from blobtree import Point, Segment
from decals import (
    Camera,
    Contact,
    DecalImage,
    Decals,
    ImageMapping,
    Interaction,
    MeshObject,
    Scene,
    TreeObject,
)
from decals.editing import Document, outline
from decals.editing.queries import ANGLES, LIFT, outlines
from decals.errors import InvalidEdit
from decals.rendering import Renderer, RenderOptions
from tests.decals.editing.scenes import one

SIZE = 300, 300
EYE = Camera((0, 0, 9), fov=16)


def on_ball(*decals: Any, camera: Any = EYE) -> Any:
    """A ball of radius 1 around the origin, and decals there."""
    ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    images = (DecalImage.load("scale"),)
    return Document.from_scene(
        Scene(objects=(ball,), decals=Decals.concatenate(decals), images=images, camera=camera)
    )


def at_angle(degrees: Any, radius: Any) -> Any:
    """A decal of the ball, so far from its highest point."""
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    return Decals([[s, 0, c]], [[s, 0, c]], [[c, 0, -s]], [radius])


def pixels_of(document: Any, points: Any) -> Any:
    """Where points are in the picture, ``float64[n, 2]``, from its upper left corner."""
    matrix = document.camera.clip_matrix(SIZE, document.objects[0].bounds)
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    x, y = ((clip[:, :2] / clip[:, 3:] + 1) / 2 * SIZE).T
    return np.column_stack([x, SIZE[1] - y])


def edge_of(shown: Any) -> Any:
    """Middles of the pixels of a region that have a neighbour outside of it, ``float64[n, 2]``."""
    inner = shown[1:-1, 1:-1] & shown[2:, 1:-1] & shown[:-2, 1:-1] & shown[1:-1, 2:] & shown[1:-1, :-2]
    edge = shown.copy()
    edge[1:-1, 1:-1] &= ~inner
    rows, columns = np.nonzero(edge)
    return np.column_stack([columns, rows]) + 0.5


def gaps(points: Any, line: Any) -> Any:
    """Distance of each point from a closed line."""
    steps = np.diff(line, axis=0)
    squared = np.maximum((steps**2).sum(axis=1), 1e-30)
    along = np.einsum("nki,ki->nk", points[:, None] - line[None, :-1], steps) / squared
    feet = line[None, :-1] + np.clip(along, 0, 1)[:, :, None] * steps
    return np.linalg.norm(points[:, None] - feet, axis=2).min(axis=1)


@pytest.mark.ordinary_cases("0-0", "1-1", "2-2", "3-0")
@pytest.mark.parametrize("mapping", ImageMapping)
@pytest.mark.parametrize("contact", Contact)
def test_an_outline_is_the_edge_of_what_the_picture_shows(
    renderer: Renderer, contact: Any, mapping: Any
) -> None:
    decals = at_angle(0, 0.9), at_angle(75, 0.7), at_angle(-80, 0.5)
    document = on_ball(*decals)
    found = renderer.buffers(document, RenderOptions(size=SIZE, contact=contact, mapping=mapping))
    image = np.hypot(found.uv[..., 0] - 0.5, found.uv[..., 1] - 0.5) <= 0.5
    edge = edge_of((found.owner == 0) & image)
    lifted = outline(document, 0, contact=contact, mapping=mapping)
    line = pixels_of(document, lifted / np.linalg.norm(lifted, axis=1, keepdims=True))  # on the ball again
    there, back = gaps(edge, line), np.linalg.norm(line[:, None] - edge[None], axis=2).min(axis=1)
    assert len(edge) > 300
    assert np.median(there) < 0.7
    assert there.max() < 3.5  # at corners, between two of the line's directions
    assert np.median(back) < 0.9
    assert back.max() < 3.5


def test_an_outline_follows_a_walked_image_over_edges(renderer: Renderer) -> None:
    """Of a decal near the corner of a cube, beside another one."""
    box = pv.Cube().triangulate()
    scene = Scene(
        objects=(MeshObject("cube", box.points, box.regular_faces),),
        decals=Decals([[0.3, 0.25, 0.5], [-0.2, 0.0, 0.5]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [0.45, 0.4]),
        images=(DecalImage.load("scale"),),
        camera=Camera((4.5, 3.5, 5), fov=16),
    )
    document = Document.from_scene(scene)
    found = renderer.buffers(document, RenderOptions(size=SIZE, mapping=ImageMapping.WALKED))
    image = np.hypot(found.uv[..., 0] - 0.5, found.uv[..., 1] - 0.5) <= 0.5
    edge = edge_of((found.owner == 0) & image)
    line = pixels_of(document, outline(document, 0, mapping=ImageMapping.WALKED))
    there = gaps(edge, line)
    assert len(edge) > 300
    assert np.median(there) < 1.0
    assert there.max() < 5.0


@pytest.mark.parametrize("radius", [0.2, 0.9, 1.4])
def test_alone_on_a_ball_it_ends_at_its_radius_along_the_surface(radius: Any) -> None:
    document = on_ball(at_angle(30, radius), one((0, 0, -1), 0.01))
    middle = document.decals[0].normals[0]
    for line in (outline(document, 0), *outlines(document, [0], angles=24)):
        angles = np.arccos(line @ middle / np.linalg.norm(line, axis=1))
        np.testing.assert_allclose(angles, radius, rtol=5e-3)
        np.testing.assert_allclose(np.linalg.norm(line, axis=1), 1 + LIFT * radius, atol=1e-3)
    chords = outline(document, 0, mapping=ImageMapping.CHORD)
    np.testing.assert_allclose(np.linalg.norm(chords - middle, axis=1), radius, rtol=2e-2)


@pytest.mark.parametrize("contact", Contact)
def test_outlines_of_many_are_those_of_each(contact: Contact) -> None:
    """Of neighbours that push each other, of a tiny one among them, and of one that another hides."""
    hidden = at_angle(60, 0.1)
    above = at_angle(60, 0.4).replace(layers=[1], interactions=[Interaction.OVERLAP])
    document = on_ball(at_angle(0, 0.8), at_angle(10, 0.01), at_angle(-40, 0.3), hidden, above)
    numbers = [2, 0, 3, 1, 4]
    lines = outlines(document, numbers, contact=contact)
    assert lines.shape == (5, ANGLES + 1, 3)
    for line, number in zip(lines, numbers, strict=True):
        np.testing.assert_allclose(line, outline(document, number, contact=contact), atol=1e-6)
    coarse = outlines(document, numbers, contact=contact, angles=ANGLES // 2)
    np.testing.assert_allclose(coarse, lines[:, ::2], atol=1e-6)
    assert outlines(document, []).shape == (0, ANGLES + 1, 3)


def test_on_a_thin_rod_it_goes_round_as_far_as_the_image() -> None:
    """On a cylinder places in the image are arc length and height."""
    rod = TreeObject("rod", Segment((0, 0, -3), (0, 0, 3), radius=0.5))
    scene = Scene(
        objects=(rod,),
        decals=Decals([[0.5, 0, 0]], [[1, 0, 0]], [[0, 1, 0]], [0.7]),
        images=(DecalImage.load("scale"),),
        camera=EYE,
    )
    for line in (
        outline(Document.from_scene(scene), 0),
        *outlines(Document.from_scene(scene), [0], angles=24),
    ):
        around = 0.5 * np.arctan2(line[:, 1], line[:, 0])
        np.testing.assert_allclose(np.hypot(around, line[:, 2]), 0.7, rtol=1e-2)


def test_modes_by_name() -> None:
    document = on_ball(one((0, 0, 1), radius=0.5), one((0.5, 0, 0.8), radius=0.4))
    line = outline(document, 1, contact="radial", mapping="chord")
    np.testing.assert_array_equal(
        line, outline(document, 1, contact=Contact.RADIAL, mapping=ImageMapping.CHORD)
    )
    with pytest.raises(
        InvalidEdit, match="mapping: expected one of 'chord', 'corrected', 'walked', got 'flat'"
    ):
        outline(document, 1, mapping="flat")
