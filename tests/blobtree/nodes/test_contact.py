"""Contact between solids: shared surfaces, bulges, measures and volumes; edits, files and errors."""

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import (
    ISO,
    Ellipsoid,
    Node,
    Point,
    Press,
    Segment,
    SolidContact,
    Torus,
    from_json,
    polygonize,
    to_json,
)
from blobtree.errors import InvalidNode
from blobtree.meshing.clip import clipped, enclosed_volume, outlines_of
from blobtree.nodes import surgery
from blobtree.nodes.paths import node_at, primitive_paths, with_node
from tests.blobtree.meshing.test_polygonize import assert_closed, assert_valid
from tests.oracles import blobtree as oracle

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
PAIR = (Point((-0.8, 0, 0), radius=1.0, color=RED), Point((0.8, 0, 0), radius=1.0, color=BLUE))
THREE = (
    Point((0.7, 0, 0), radius=0.9, color=RED),
    Segment((-0.4, 0.6, 0), (-0.4, 0.6, 0.8), radius=0.8, color=GREEN),
    Ellipsoid((-0.4, -0.65, 0), (0.9, 0.8, 0.7), color=BLUE),
)
MODELS = {
    "two": SolidContact(PAIR),
    "two of different stiffness": SolidContact(PAIR, stiffness=(1.0, 4.0), height=(0.1, 0.02), width=0.4),
    "three": SolidContact(THREE, height=(0.08,), width=0.35),
    "three of different stiffness": SolidContact(THREE, stiffness=(1.0, 2.0, 5.0)),
    "three by pairs": SolidContact(THREE, stiffness=((1, 1, 2), (1, 1, 3), (1, 1, 1)), height=0.0),
}
EVERY_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def fields(model: SolidContact, points: NDArray[Any]) -> NDArray[np.float64]:
    """The deformed fields (n, count) in float64, by the definition: the strongest other solid presses."""
    plain = [oracle.value(solid, points) for solid in model.operands]
    result = []
    for i, own in enumerate(plain):
        rated = [oracle.rated(f, model.stiffness_ratio(i, j)) for j, f in enumerate(plain) if j != i]
        empty = np.zeros((len(own), 3)), np.full(len(own), np.inf)
        m = oracle.Field(np.max(rated, axis=0), *empty)
        height = oracle.bulge_height(model, i)
        result.append(oracle.pressed_field(oracle.Field(own, *empty), m, 1.0, model.width, height).value)
    return np.array(result)


@EVERY_MODEL
def test_the_deformed_fields_are_those_of_the_definition(model: SolidContact) -> None:
    points = np.random.default_rng(0).uniform(-2.2, 2.2, (4000, 3))
    expected = fields(model, points)
    for solid, values in zip(model.solids(), expected, strict=True):
        np.testing.assert_allclose(solid(points), values, atol=1e-5)
    outside = np.sort([solid(points) for solid in model.operands], axis=0)[-2] < ISO
    np.testing.assert_allclose(model(points)[outside], expected.max(axis=0)[outside], atol=1e-5)
    assert (model(points)[~outside] > ISO).all(), "no surface where solids meet"


def test_stiffer_solids_bulge_less() -> None:
    soft, stiff = SolidContact(PAIR, stiffness=(1, 4), height=0.08, width=0.4).solids()
    assert isinstance(soft, Press)
    assert isinstance(stiff, Press)
    assert (soft.height, stiff.height) == (0.08, 0.02)


@EVERY_MODEL
def test_no_sample_lies_inside_two_solids_and_no_void_opens(model: SolidContact) -> None:
    lower, upper = model.support
    points = np.random.default_rng(1).uniform(lower, upper, (200_000, 3)).astype(np.float32)
    inside = [solid(points) - np.float32(ISO) for solid in model.solids()]
    assert not (np.sort(inside, axis=0)[-2] > 1e-6).any()
    if "pairs" not in str(model.stiffness) and len(model.stiffness) <= len(model.operands):
        covered = np.any([solid(points) > ISO for solid in model.operands], axis=0)
        assert (np.max(inside, axis=0)[covered] > -1e-6).all()


@EVERY_MODEL
def test_each_solid_is_one_closed_surface_and_neighbours_share_theirs(model: SolidContact) -> None:
    for number, solid in enumerate(model.solids()):
        mesh = polygonize(solid, resolution=40)
        assert_valid(mesh)
        assert_closed(mesh)
        rated = [
            (model.operands[j](mesh.vertices) - ISO) * model.stiffness_ratio(number, j)
            for j in range(len(model.operands))
            if j != number
        ]
        touching = np.max(rated, axis=0) > 1e-3
        assert touching.any()
        gap = np.abs(model.operands[number](mesh.vertices) - ISO - np.max(rated, axis=0))[touching]
        assert gap.max() <= 1e-5


def test_the_contact_of_two_balls_is_a_disc() -> None:
    (surface,) = SolidContact(PAIR, names=("left", "right")).contacts()
    assert surface.pair == (0, 1)
    assert surface.names == ("left", "right")
    assert surface.area == pytest.approx(math.pi * 0.36, rel=0.005)
    np.testing.assert_allclose(surface.centroid, 0.0, atol=1e-4)
    (outline,) = surface.outlines
    np.testing.assert_array_equal(outline[0], outline[-1])
    np.testing.assert_allclose(np.hypot(outline[:, 1], outline[:, 2]), 0.6, atol=0.004)
    aside = np.abs(surface.vertices[:, 0])
    assert aside.max() < 1e-3, "on the outline"
    assert np.percentile(aside, 75) < 1e-5


def test_three_solids_meet_in_one_line() -> None:
    model = MODELS["three"]
    surfaces = model.contacts()
    assert [surface.pair for surface in surfaces] == [(0, 1), (0, 2), (1, 2)]
    assert all(len(surface.outlines) == 1 for surface in surfaces)
    first, second, third = (solid.to_pyvista(resolution=24).volume for solid in model.solids())
    assert min(first, second, third) > 0.5
    middle = np.array([[-0.1, 0.0, 0.1]])
    assert (fields(model, middle) > 0.2).all()


def test_a_ring_of_contact_has_two_outlines_and_apart_solids_none() -> None:
    ring, ball = Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.3), Point((0, 0, 0.75), radius=1.05)
    (surface,) = SolidContact((ring, ball)).contacts()
    assert len(surface.outlines) == 2
    assert SolidContact((ball, ball.translate((2.2, 0, 0)))).contacts() == []
    assert SolidContact((ball,)).contacts() == []


def test_a_solid_far_from_all_others_stays_as_it_is() -> None:
    far = Point((9, 0, 0), radius=1.0)
    model = SolidContact((*PAIR, far))
    assert model.solids()[2] is far
    assert isinstance(model.solids()[0], Press)
    assert model.solids()[0].children == PAIR


@pytest.mark.parametrize("height", [0.02, 0.06])
def test_normals_are_continuous_where_contact_and_bulge_begin_and_end(height: float) -> None:
    """Points of the surface a little on both sides of m = ½, of the top and of the far edge, along it."""
    model = SolidContact(PAIR, height=height, width=0.3)
    left = model.solids()[0]
    mesh = polygonize(left, resolution=60)
    points = mesh.vertices[np.random.default_rng(0).permutation(len(mesh.vertices))[:4000]]
    step = 1e-4
    for level in (0.5, 0.5 - 2.0 * height, 0.2):
        other = PAIR[1]
        near = points[np.abs(other(points) - level) < 0.05].astype(np.float64)
        for _ in range(30):  # onto both surfaces: the solid's, and the level set of the other's field
            values = np.stack([oracle.value(left, near) - ISO, oracle.value(other, near) - level], axis=1)
            slopes = np.stack([oracle.gradient(left, near), oracle.gradient(other, near)], axis=1)
            near = near - np.einsum("nij,nj->ni", np.linalg.pinv(slopes), values)
        assert len(near) > 50
        normals = left.gradient(near)
        along = np.cross(np.cross(normals, other.gradient(near)), normals)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        sides = [left.gradient(near + sign * step * along).astype(np.float64) for sign in (-1.0, 1.0)]
        cosines = np.einsum("ni,ni->n", *sides) / np.prod([np.linalg.norm(s, axis=1) for s in sides], axis=0)
        assert np.degrees(np.arccos(np.minimum(cosines, 1.0))).max() <= 0.5


@pytest.mark.parametrize("name", ["two of different stiffness", "three"])
def test_compensated_solids_keep_their_volumes(name: str) -> None:
    model = MODELS[name].compensated()
    for solid, free in zip(model.solids(), model.operands, strict=True):
        volumes = [
            enclosed_volume(m.vertices, m.faces)
            for m in (polygonize(x, cell_size=0.04) for x in (solid, free))
        ]
        assert volumes[0] == pytest.approx(volumes[1], rel=0.01)
    assert model.compensated() is model


def test_volumes_that_cannot_be_kept_are_refused() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    with pytest.raises(InvalidNode, match="keep their volumes"):
        SolidContact((ball, ball, Point((0, 0, 0), radius=0.9))).compensated(resolution=24)


# -- the model in pictures, edits and files -------------------------------------------------------------


def test_solids_keep_their_colors() -> None:
    model = MODELS["two"]
    mesh = polygonize(model, resolution=32)
    expected = np.where(mesh.vertices[:, :1] < 0.0, RED, BLUE)
    away = np.abs(mesh.vertices[:, 0]) > 0.1
    np.testing.assert_allclose(mesh.colors[away], expected[away], atol=1e-6)


def test_rays_hit_the_outside_alone() -> None:
    model = MODELS["two"]
    hits = model.raycast([[-5, 0, 0], [0, 5, 0]], [[1, 0, 0], [0, -1, 0]])
    np.testing.assert_allclose(hits.distances[0], 3.2, atol=1e-4)
    outside = polygonize(model, resolution=48)
    assert_closed(outside)
    assert np.abs(outside.vertices[:, 0]).min() < 0.05
    assert np.hypot(*outside.vertices[np.abs(outside.vertices[:, 0]) < 0.02, 1:].T).min() > 0.55


def test_files_pickles_and_text() -> None:
    for model in (*MODELS.values(), replace(MODELS["two"], growth=(0.1, -0.05), names=("a", "b"))):
        _ = model.tape
        assert from_json(to_json(model)) == model == pickle.loads(pickle.dumps(model))
        for solid in model.solids():
            assert from_json(to_json(solid)) == solid
    scope = {kind.__name__: kind for kind in (SolidContact, Point)}
    assert eval(repr(MODELS["two"]), scope) == MODELS["two"]


def test_paths_and_surgery() -> None:
    model: Node = (
        SolidContact(THREE, stiffness=(1, 2, 3), height=(0.01, 0.02, 0.03), names=("a", "b", "c")) | PAIR[0]
    )
    assert primitive_paths(model) == [(0, 0), (0, 1), (0, 2), (1,)]
    smaller = with_node(model, (0, 0), Point((0.7, 0, 0), radius=0.5))
    assert node_at(smaller, (0, 0)) == Point((0.7, 0, 0), radius=0.5)
    rest = node_at(surgery.remove_branch(model, (0, 1)), (0,))
    assert isinstance(rest, SolidContact)
    assert (rest.stiffness, rest.height, rest.names) == ((1, 3), (0.01, 0.03), ("a", "c"))
    table = SolidContact(THREE, stiffness=tuple(range(1, 10)))
    assert table.without(1).stiffness == (1, 3, 7, 9)
    pressed = Press(*PAIR)
    assert surgery.remove_branch(pressed, (1,)) is PAIR[0]
    with pytest.raises(InvalidNode):
        surgery.remove_branch(pressed, (0,))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stiffness": (1, 0)}, "stiffness: expected numbers above 0"),
        ({"stiffness": (1, 1e3)}, "whose ratio is at most 100"),
        ({"stiffness": (1, 2, 3)}, "stiffness: expected 0 or 2 or 4 values"),
        ({"stiffness": (1, math.nan)}, "stiffness: expected finite numbers"),
        ({"stiffness": "soft"}, "stiffness: expected finite numbers"),
        ({"width": 0.0}, "width: expected 0.01 to 0.5"),
        ({"width": 0.1, "height": 0.05}, "height: expected at most 0.25 of the width"),
        ({"height": -0.1}, "height: expected 0 to 0.125"),
        ({"height": 0.2}, "height: expected 0 to 0.125"),
        ({"height": (0.01,) * 3}, "height: expected 1 or 2 values"),
        ({"growth": (0.1,)}, "growth: expected 0 or 2 values"),
        ({"names": ("a", "a")}, "names: expected a different name"),
        ({"names": "ab"}, "names: expected texts"),
        ({"names": ("a", "")}, "names: expected texts"),
        ({"names": ("a", 1)}, "names: expected texts"),
    ],
)
def test_wrong_parameters_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        SolidContact(PAIR, **options)


@pytest.mark.parametrize("operands", [(), (1,), (PAIR[0], None)])
def test_wrong_solids_are_refused(operands: Any) -> None:
    with pytest.raises(InvalidNode, match="operands: expected"):
        SolidContact(operands)


def test_wrong_presses_are_refused() -> None:
    wrong: tuple[dict[str, Any], ...] = (
        {"stiffness_ratio": 0.0},
        {"stiffness_ratio": 1e9},
        {"width": 0.04, "height": 0.02},
    )
    for options in wrong:
        with pytest.raises(InvalidNode):
            Press(*PAIR, **options)


# -- clipped meshes --------------------------------------------------------------------------------------


def test_half_of_a_ball_is_clipped_from_its_mesh() -> None:
    mesh = polygonize(Point((1, 2, 3), radius=1.0), resolution=40)
    volume = enclosed_volume(mesh.vertices, mesh.faces)
    assert volume == pytest.approx(4.0 / 3.0 * math.pi, rel=0.01)
    height = mesh.vertices[:, 2].astype(np.float64) - 3.05
    vertices, faces = clipped(mesh.vertices, mesh.faces, height)
    assert vertices[:, 2].min() == pytest.approx(3.05, abs=1e-6)
    corners = vertices[faces]
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert area.sum() == pytest.approx(2.0 * math.pi * 0.95, rel=0.01)
    (outline,) = outlines_of(vertices, faces)
    np.testing.assert_array_equal(outline[0], outline[-1])
    assert np.linalg.norm(np.diff(outline, axis=0), axis=1).sum() == pytest.approx(
        2.0 * math.pi * math.sqrt(1.0 - 0.05**2), rel=0.01
    )
    for sign, count in ((1.0, len(mesh.faces)), (-1.0, 0)):
        assert len(clipped(mesh.vertices, mesh.faces, np.full(len(mesh.vertices), sign))[1]) == count


def test_operands_come_one_by_one_or_as_one_iterable() -> None:
    options: dict[str, Any] = {"stiffness": (1, 2), "names": ("a", "b")}
    assert (
        SolidContact(*PAIR, **options) == SolidContact(PAIR, **options) == SolidContact(iter(PAIR), **options)
    )
    with pytest.raises(TypeError, match="stifness unknown"):
        SolidContact(*PAIR, stifness=(1, 2))
    with pytest.raises(TypeError, match="expected operands"):
        SolidContact()
