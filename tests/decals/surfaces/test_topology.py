"""Winding, copies and parts of triangle meshes, and what they do to surfaces and scattering."""

import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import decals
from decals.scattering.domain import Domain
from decals.surfaces import MeshSurface
from decals.surfaces.topology import components, welded
from tests.decals.fault_models import FAULT_MODELS, Arrays, joined
from tests.decals.meshes import box, icosphere


def mobius(sides: int = 24) -> Arrays:
    """A Möbius strip, whose faces cannot wind alike."""
    angles = np.arange(sides) * 2 * np.pi / sides
    rows = [
        [np.cos(a) * (1 + s * np.cos(a / 2)), np.sin(a) * (1 + s * np.cos(a / 2)), s * np.sin(a / 2)]
        for a in angles
        for s in (-0.3, 0.3)
    ]
    faces = []
    for i in range(sides):
        a, b, c, d = 2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3
        if i == sides - 1:
            c, d = 1, 0
        faces += [[a, c, b], [b, c, d]]
    return np.array(rows), np.array(faces)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.45), soup=st.booleans())
def test_mixed_winding_is_turned_back(seed: int, share: float, soup: bool) -> None:
    rng = np.random.default_rng(seed)
    vertices, faces = icosphere(2)
    mixed = faces.copy()
    flipped = rng.choice(len(faces), int(share * len(faces)), replace=False)
    mixed[flipped] = mixed[flipped][:, ::-1]
    if soup:
        vertices, mixed = vertices[mixed].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    surface = MeshSurface(vertices, mixed)
    assert surface.closed
    outward = np.einsum("ni,ni->n", *surface.sample(500, seed=1))
    assert (outward > 0.9).all()


def test_turned_faces_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    vertices, faces = icosphere(1)
    faces[3] = faces[3, ::-1]
    with caplog.at_level(logging.WARNING):
        MeshSurface(vertices, faces)
    assert caplog.messages == ["Turned 1 of 80 faces that wound differently from their neighbours"]


def test_one_sided_surfaces_stay_and_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    vertices, faces = mobius()
    with caplog.at_level(logging.WARNING):
        surface = MeshSurface(vertices, faces)
    np.testing.assert_array_equal(surface.faces, faces)
    assert "has one side only" in caplog.text


def test_decals_cross_the_seam_of_a_one_sided_surface() -> None:
    """The winding turns over at the seam, but a decal covers both of its sides."""
    vertices, faces = mobius()
    ball = icosphere(1)
    layout = decals.scatter(joined((vertices, faces), (ball[0] + 5.0, ball[1])), count=80, seed=1)
    np.testing.assert_array_equal(layout.spill, layout.positions.max(axis=1) < 3.0)
    along = np.linspace(-0.25, 0.25, 50)[:, None]
    seam = vertices[:2].mean(axis=0) + along * (vertices[1] - vertices[0]) / 0.6
    corners = vertices[faces[[0, -1]]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals[0] @ normals[1] < 0
    one, other = (decals.evaluate(layout, seam, np.tile(normal, (50, 1))) for normal in normals)
    assert (one.owner >= 0).all()
    np.testing.assert_array_equal(one.owner, other.owner)


def test_sound_meshes_are_kept_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    two_sides = joined(icosphere(0), (icosphere(0)[0], icosphere(0)[1][:, ::-1]))
    for vertices, faces in (icosphere(2), two_sides, FAULT_MODELS["bowl"]()):
        with caplog.at_level(logging.WARNING):
            surface = MeshSurface(vertices, faces)
        np.testing.assert_array_equal(surface.faces, faces)
        assert len(surface.sound) == len(faces)
    assert not caplog.messages


@pytest.mark.parametrize("name", ["knob", "bowl"])
def test_copies_count_once(name: str) -> None:
    mesh = FAULT_MODELS[name]()
    once, thrice = MeshSurface(*mesh), MeshSurface(*joined(mesh, mesh, mesh))
    assert thrice.area == once.area
    assert len(thrice.faces) == 3 * len(once.faces)
    np.testing.assert_array_equal(thrice.sample(50, seed=3)[0], once.sample(50, seed=3)[0])


def test_vertices_at_one_position_are_one() -> None:
    points = np.array([[0, 0, 0], [1, 2, 3], [-0.0, 0, 0], [1, 2, 3.0000002]], np.float32)
    assert welded(points).tolist() == [0, 1, 0, 3]


@pytest.mark.parametrize("links", [0, 7, 120, 300])
def test_components_are_those_of_scipy(links: int) -> None:
    rng, count = np.random.default_rng(links), 150
    order = rng.permutation(count)
    pairs = rng.integers(0, count, (links, 2)) if links < 300 else np.stack([order[:-1], order[1:]], axis=1)
    graph = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    expected = connected_components(graph, directed=False)[1]
    np.testing.assert_array_equal(components(pairs, count), expected)


def test_no_seeds_on_inner_shells() -> None:
    relaxation = decals.Relaxation(MeshSurface(*FAULT_MODELS["shells"]()), count=100, seed=1)
    relaxation.run()
    assert np.linalg.norm(relaxation.positions, axis=1).min() > 0.97
    assert relaxation.statistics().rho > 0.85


def test_parts_that_intersect_hide_what_lies_inside() -> None:
    boxes = [box((1, 1, 1)), box((0.4, 0.4, 2))]
    mesh = joined(*((part.vertices, part.faces) for part in boxes))
    for faces in (mesh[1], mesh[1][:, ::-1]):
        domain = Domain(MeshSurface(mesh[0], faces), seed=2)
        assert domain.area == pytest.approx(7.6, rel=0.02)
        points = domain.sample(np.array([500]), stream=1).positions
        assert not (np.abs(points) < [0.21, 0.21, 0.49]).all(axis=1).any()
        assert not ((np.abs(points) < [0.19, 0.19, 0.51]).all(axis=1)).any()
