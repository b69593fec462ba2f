"""Measures of lessons against analytic values and the oracle of equation 5."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blobtree import Extrude, Point, Revolve, SolidContact, Union
from decals import Camera, Contact, Decals, MeshObject, TreeObject
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.experiment import Experiment, Points, Relaxed, Scope
from decals.apps.lab.formulas import parse
from decals.apps.lab.measures import MEASURES
from decals.editing.slicing import SlicePlane
from decals.field.rules import PictureRules
from tests.oracles.contact import RIM, contact_field, falloff

CORNERS = np.array([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]], np.float32)
PLATE = MeshObject("plate", CORNERS, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
TWO = Decals([[0.0, 0.0, 0.0], [0.7, 0.1, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [0.6, 0.5])
CAMERA = Camera((0, 0, 8))
BALLS = SolidContact((Point((-0.8, 0, 0), radius=1.0), Point((0.8, 0, 0), radius=1.0)), height=0)


def experiment(**changes: Any) -> Experiment:
    before = Experiment(
        objects=(PLATE,),
        decals=TWO,
        rules=PictureRules(contact=Contact.PRODUCT),
        probe=(0.3, 0.05, 0.0),
        camera=CAMERA,
        size=4.0,
    )
    return replace(before, **changes)


def value(text: str, state: Experiment, points: Points | None = None) -> Any:
    scope = Scope.at_probe(state)
    return parse(text, MEASURES, set()).evaluate(scope if points is None else scope.at(points))


def fields(points: Any, decals: Decals = TWO) -> Any:
    distances = np.linalg.norm(points[:, None] - decals.positions[None], axis=2)
    return falloff(distances / (decals.radii / RIM))


def test_fields_before_and_after_contact_are_those_of_the_paper() -> None:
    state = experiment()
    points = state.map_points()
    expected = fields(points.positions)
    for i in (0, 1):
        np.testing.assert_allclose(value(f"f({i})", state, points), expected[:, i], atol=2e-6)
    after = contact_field(expected)
    inside = np.isfinite(after)
    np.testing.assert_allclose(value("F", state, points)[inside], after[inside], atol=3e-4)
    np.testing.assert_allclose(value("F", state, points)[~inside], expected.max(axis=1)[~inside], atol=2e-6)
    owned = inside & (expected[:, 0] > expected[:, 1] + 1e-3) & (expected[:, 0] > 0.51)
    h = (after - 0.5)[owned] / (expected[owned, 0] - 0.5)
    np.testing.assert_allclose(value("h(1, 0)", state, points)[owned], h, atol=2e-5)
    assert (value("owner", state, points)[owned] == 0).all()


@pytest.mark.parametrize("normal", [(1, 0, 0), (0, 1, 0), (1, 1, 2)])
def test_a_slice_has_the_fields_of_the_paper_off_the_surface(normal: Any) -> None:
    plane = SlicePlane.across((0.35, 0.05, 0.1), normal)
    state = experiment(plane=plane, probe=plane.nearest((0.3, 0.1, 0.2)))
    points = state.map_points()
    np.testing.assert_allclose(points.positions @ plane.normal, plane.position, atol=1e-6)
    expected = fields(points.positions)
    after = contact_field(expected)
    inside = np.isfinite(after)
    np.testing.assert_allclose(value("F", state, points)[inside], after[inside], atol=3e-4)
    (own,), here = np.argmax(fields(np.array([state.probe])), axis=1), fields(np.array([state.probe]))[0]
    assert value(f"f({own})", state) == pytest.approx(here[own], abs=2e-6)
    assert value("F", state) == pytest.approx(contact_field(here[None])[0], abs=3e-4)
    assert np.isnan(value("stretch", state)).all()
    x, y = state.on_map(points.positions[0])
    assert (x, y) == pytest.approx((-2.0 + 2.0 / 120, 2.0 - 2.0 / 120), abs=1e-6)


def test_the_surface_of_figure_7_is_equation_5() -> None:
    own, other = (grid.ravel() for grid in np.meshgrid(np.linspace(0.51, 0.999, 40), np.linspace(0, 1, 41)))
    points = Points.in_space(np.zeros((len(own), 3)), x=own, y=other)
    scope = Scope.at_probe(experiment()).at(points)
    got = parse("pushed(x, y)", MEASURES, {"x", "y"}).evaluate(scope)
    expected = np.where(other > own, np.nan, contact_field(np.column_stack([own, other])))
    np.testing.assert_allclose(got, expected, atol=1e-9)


@pytest.mark.parametrize("apart", [0.3, 0.9, 1.6])
def test_overlap_and_area_lost_are_those_of_discs(apart: float) -> None:
    r, other, edge = 0.9, 0.7, 1.8
    tray = MeshObject("tray", CORNERS * np.float32(edge / 3), PLATE.faces)
    pair = Decals([[-apart / 2, 0, 0], [apart / 2, 0, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [r, other])
    first = np.arccos(np.clip((apart**2 + r**2 - other**2) / (2 * apart * r), -1, 1))
    second = np.arccos(np.clip((apart**2 + other**2 - r**2) / (2 * apart * other), -1, 1))
    lens = r**2 * (first - np.sin(2 * first) / 2) + other**2 * (second - np.sin(2 * second) / 2)
    total = np.pi * (r**2 + other**2)
    state = experiment(objects=(tray,), decals=pair)
    assert value("overlapped", state) == pytest.approx(lens / total, abs=0.004)
    assert value("lost", state) == pytest.approx(lens / total, abs=0.004)
    kept = value("kept(0)", state) * r**2 + value("kept(1)", state) * other**2
    assert 1 - np.pi * kept / total == pytest.approx(value("lost", state))
    over = experiment(objects=(tray,), decals=Decals([[edge, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], [r]))
    assert value("overlapped", over) == 0.0
    assert value("lost", over) == pytest.approx(0.5, abs=0.01)  # a half hangs over the edge


def test_the_four_constraints_hold() -> None:
    state = experiment()
    assert value("most(where(f(0) + f(1) <= 1, abs(F - top), 0))", state) < 1e-5
    assert value("at(0, F)", state) == pytest.approx(1.0)
    assert value("between(0, 1, F)", state) == pytest.approx(0.5, abs=2e-3)
    assert value("between(0, 1, f(0) - f(1))", state) == pytest.approx(0.0, abs=1e-5)
    assert value("jump(F)", state) < 0.1
    assert value("jump(where(f(0) > 0.8, 1, 0))", state) == 1.0


def test_numbers_of_the_scene() -> None:
    state = experiment(rules=PictureRules(stiffness=3.0))
    assert value("distance(0, 1)", state) == pytest.approx(np.hypot(0.7, 0.1))
    assert value("influence(1) * 0.454202 / radius(1)", state) == pytest.approx(1.0, rel=1e-5)
    assert value("count", state) == 2
    assert value("contact == elastic and stiffness == 3", state)
    assert value("interaction(0) == push and layer(0) == 0", state)
    assert value("g(0) - g(0.5) - g(1)", state) == pytest.approx(1 - 0.75**3, abs=1e-6)
    assert value("share(f(0) >= 0.5)", state) == pytest.approx(np.pi * 0.36 / 16, rel=0.02)


def test_a_decal_alone_is_neither_stretched_nor_folded() -> None:
    state = experiment(decals=TWO[:1])
    assert value("most(stretch)", state) == pytest.approx(1.0, abs=0.02)
    assert value("share(folded)", state) == 0


@pytest.mark.parametrize("angle", [0.2, 0.5, 0.8])
def test_a_curved_surface_stretches_the_image_of_the_corrected_mapping(angle: float) -> None:
    """On a ball, circles of the arc's length are drawn on circles of radius sin(angle)."""
    ball = TreeObject("ball", Point((0, 0, 0), radius=2.0))
    decals = Decals([[0.0, 0.0, 2.0]], [[0, 0, 1]], [[1, 0, 0]], [2.2])
    state = experiment(objects=(ball,), decals=decals, rules=PictureRules(mapping="corrected"))
    near = state.points_near([[2 * np.sin(angle), 0.0, 2 * np.cos(angle)]])
    assert float(value("stretch", state, near)[0]) == pytest.approx(angle / np.sin(angle), rel=2e-3)


def test_radial_contact_stretches_by_the_distance_of_the_plane() -> None:
    """At the line of centres the ray is scaled by 1/R towards the plane, R in visible radii."""
    decals = Decals([[0.0, 0.0, 0.0], [0.8, 0, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [0.5, 0.5])
    state = experiment(decals=decals, rules=PictureRules(contact="radial"))
    assert value("at(0, 1)", state) == 1
    near = state.points_near([[0.2, 1e-4, 0.0]])
    assert float(value("stretch", state, near)[0]) == pytest.approx(1.0, abs=0.01)  # both ways by 0.5/0.4
    assert value("share(folded)", state) == 0


def test_a_small_decal_in_a_large_one_folds_it_in_the_mode_of_the_paper_only() -> None:
    decals = Decals([[0.0, 0.0, 0.0], [0.5, 0.3, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, [1.1, 0.35])
    assert value("share(folded)", experiment(decals=decals)) > 1e-3
    assert value("share(folded)", experiment(decals=decals, rules=PictureRules())) == 0


@pytest.mark.parametrize(
    ("text", "expected", "tolerance"),
    [
        ("area(0, 1)", np.pi * 0.36, 0.03),
        ("area(1, 0)", np.pi * 0.36, 0.03),
        ("penetration(0, 1)", 0.4, 0.005),
        ("free_volume(0)", 4 / 3 * np.pi, 0.02),
        ("volume(0)", 4 / 3 * np.pi - np.pi * 0.04 * (3 - 0.2) / 3, 0.02),
        ("bulge(0, 1)", 0.0, 1e-9),
    ],
)
def test_two_balls_in_contact(text: str, expected: float, tolerance: float) -> None:
    state = experiment(objects=(TreeObject("balls", BALLS),), decals=Decals.empty(), in_space=True)
    assert value(text, state) == pytest.approx(expected, abs=tolerance)


def test_operands_of_any_tree_have_volumes_and_fields() -> None:
    """A turn of the top keeps all sections; a ring is its section times the way of its middle."""
    square = "M-.5 -.5H.5V.5H-.5Z"
    tree = Union([Extrude(square, 2.7, top_turn=90.0, origin=(-3, 0, 0)), Revolve("M.5 0H1.5V1H.5Z", 90.0)])
    state = experiment(objects=(TreeObject("solids", tree),), in_space=True, probe=(1.0, 1.0, 1.0))
    for text, expected in (("volume(0)", 2.7), ("free_volume(0)", 2.7), ("volume(1)", np.pi / 2)):
        assert value(text, state) == pytest.approx(expected, rel=3e-3), text
    assert value("body(1)", state) == value("solid(1)", state) == pytest.approx(0.5, abs=1e-5)


def test_a_bulge_has_a_width() -> None:
    model = SolidContact(BALLS.operands, height=0.08)
    state = experiment(objects=(TreeObject("balls", model),), in_space=True)
    assert 0.2 < value("bulge(0, 1)", state) < 1.0
    assert value("bulge(0, 1)", state) == pytest.approx(value("bulge(1, 0)", state), abs=0.05)


def test_steps_that_were_not_taken_have_no_measures() -> None:
    state = experiment(relaxed=Relaxed(1, (np.nan, 5.0), (0.1, 0.6), (0.5, 0.2)))
    assert value("step", state) == 1
    assert value("rho(step)", state) == 0.6
    assert np.isnan([value("rho(2)", state), value("energy(0)", state), value("variation(-1)", state)]).all()
    assert np.isnan(value("rho(0)", experiment()))


GONE = "f(2)", "radius(-1)", "distance(0, 1.5)", "layer(0 / 0)", "radius(1 / 0)", "area(0, 1)", "solid(0)"


@pytest.mark.parametrize("text", GONE)
def test_a_measure_of_a_part_that_is_gone_says_what_to_do(text: str) -> None:
    with pytest.raises(InvalidLesson, match="undo, or start the lesson again"):
        value(text, experiment())


@pytest.mark.parametrize("text", ["area(0, 2)", "area(0 / 0, 1)", "bulge(0, 0.5)", "volume(-1)"])
def test_a_measure_of_a_solid_that_is_gone_says_so(text: str) -> None:
    with pytest.raises(InvalidLesson, match="the scene has no solid"):
        value(text, experiment(objects=(TreeObject("balls", BALLS),), in_space=True))


def test_maps_show_what_the_camera_sees() -> None:
    state = experiment(camera=Camera((0, 0, -8)), size=8.0)
    points = state.map_points()
    assert points.exists.mean() == pytest.approx(36 / 64, rel=0.02)
    first = points.positions[points.exists][0]
    assert first[0] > 0 > -first[1]  # from below, the x axis points to the left
    assert state.on_map((1.0, 2.0, 0.0)) == pytest.approx((-1.0, 2.0))
