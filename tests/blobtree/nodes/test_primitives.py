"""Primitives beyond points, segments and cones, and what follows from declared parameters."""

import inspect
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import (
    ISO,
    RIM,
    Arc,
    Box,
    Circle,
    CubicBezier,
    Cylinder,
    Disc,
    Ellipsoid,
    HalfSpace,
    Node,
    Point,
    Polygon,
    Polyline,
    Primitive,
    QuadraticBezier,
    Rectangle,
    Stroke,
    TaperedBezier,
    Torus,
    Triangle,
    polygonize,
)
from blobtree.declare.parameters import Quantity, described, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.curves import _JoinedSegment
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.paths import moved, resized
from blobtree.nodes.primitives import PROFILE, Leaf, Profile
from blobtree.tape.instruction_set import library
from tests.blobtree.trees import SOLIDS, points_around
from tests.oracles import blobtree as oracle
from tests.oracles import shapes

TORUS = Torus((0.1, 0.2, 0.3), (1, 2, 2), 1.0, radius=0.25)
DISC = Disc((0.1, 0.2, 0.3), (2, -1, 2), 1.0, radius=0.2)
BOX = Box((0.1, 0.2, 0.3), (1.0, 0.5, 2.0), radius=0.2)
ELLIPSOID = Ellipsoid((0.1, 0.2, 0.3), (0.5, 1.0, 0.8))
SHAPES: list[Node] = [
    Circle((0.1, 0.2, 0.3), (1, 2, 2), 1.0, radius=0.25),
    Arc((1.0, 0.2, 0.3), (0.3, 0.9, -0.2), (-0.7, -0.6, 0.1), radius=0.2),
    QuadraticBezier((-1.0, 0.0, 0.2), (0.2, 1.5, 0.3), (0.7, -0.5, -0.4), radius=0.2),
    CubicBezier((-1.0, 0.1, 0.2), (0.9, 1.4, 0.3), (-0.8, 1.1, -0.9), (1.0, -0.3, 0.1), radius=0.2),
    Rectangle((0.1, 0.2, 0.3), (1, 2, 2), (3, 0, 1), 1.5, 0.7, radius=0.2),
    Triangle((-0.7, 0.2, 0.3), (0.9, 0.5, -0.3), (0.1, -0.8, 0.4), radius=0.2),
    Cylinder((-0.3, 0.2, 0.3), (0.4, 0.5, -0.6), 0.5, radius=0.2),
    TaperedBezier(
        (-1.0, 0.0, 0.2), (0.2, 1.5, 0.3), (0.7, -0.5, -0.4), radius=0.3, control_radius=0.2, end_radius=0.15
    ),
    Polyline(((-1.0, 0.0, 0.2), (0.2, 0.8, 0.3), (0.2, 0.8, 0.3), (0.7, -0.5, -0.4)), radius=0.2),
    Polygon(((-1, -1, 0.2), (1, -1, 0.2), (1, 1, 0.2), (0, -0.2, 0.2), (-1, 1, 0.2)), radius=0.2),
]
WORM = Stroke(((-1, 0, 0), (0.1, 0.8, 0.3), (0.5, 0, -0.4), (1, 0.3, 0)), (0.1, 0.3, 0.2, 0.25))
GROUND = HalfSpace((0.1, 0.2, 0.3), (1, 2, 2), 0.8, radius=0.2)
SQUARE: tuple[tuple[float, float, float], ...] = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
NODES = [TORUS, DISC, BOX, ELLIPSOID, *SHAPES]
EACH = pytest.mark.parametrize("node", NODES, ids=[type(node).__name__.lower() for node in NODES])


def test_gradients_are_exact_beside_centres_of_curvature() -> None:
    a, b, c, d = (
        (0.3028, 0.3788, 0.1614),
        (0.7283, 0.6825, -0.7979),
        (-0.7574, -0.2483, 0.6544),
        (-0.591, -0.0943, 0.1234),
    )
    node, focus = CubicBezier(a, b, c, d, radius=0.65), np.array([-0.57167065, -0.09599333, 0.2077729])
    steps = np.random.default_rng(1).normal(size=(200, 3)) * 1e-3
    points = (focus + steps).astype(np.float32)
    points = points[~shapes.near_focus(node, points.astype(np.float64))]
    assert len(points) > 20
    expected = oracle.gradient(node, points)
    np.testing.assert_allclose(node.gradient(points), expected, atol=1e-4 * max(1.0, np.abs(expected).max()))


def test_a_stroke_passes_through_its_points_with_its_radii() -> None:
    np.testing.assert_array_equal(WORM(np.array(WORM.points)), 1.0)
    assert len(WORM.expanded.children) == 6
    assert Stroke(SQUARE, 0.1) == Stroke(SQUARE, (0.1,) * 4)  # type: ignore[arg-type]
    steep = Stroke(((0, 0, 0), (1, 0, 0), (2, 0, 0)), (1e-3, 1.0, 1e-3))
    assert min(min(c.radius, c.control_radius, c.end_radius) for c in pieces(steep)) > 0.0


def pieces(stroke: Stroke) -> list[TaperedBezier]:
    return [piece for piece in stroke.expanded.children if isinstance(piece, TaperedBezier)]


@given(st.lists(st.tuples(st.floats(0.1, 1.0), st.floats(0.3, 1.0)), min_size=3, max_size=30))
@settings(max_examples=50)
def test_ears_fill_a_polygon(steps: list[tuple[float, float]]) -> None:
    turns = np.cumsum([turn for turn, _ in steps])
    angles = turns * 2.0 * np.pi / (turns[-1] + 0.1)
    lengths = np.array([length for _, length in steps])
    if np.diff(angles, append=angles[0] + 2.0 * np.pi).max() > 3.0:
        return  # not a star about its centre
    x, y = lengths * np.cos(angles), lengths * np.sin(angles)
    star = Polygon(tuple(zip(x.tolist(), y.tolist(), (0.3 * x).tolist(), strict=True)), radius=0.1)
    area = abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
    ears = [np.array([ear.a, ear.b, ear.c]) for ear in star.expanded.children if isinstance(ear, Triangle)]
    covered = [abs(np.cross(ear[1] - ear[0], ear[2] - ear[0])[2]) for ear in ears]
    assert sum(covered) == pytest.approx(area, rel=1e-5)


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_shapes_are_the_same_at_any_size(size: float) -> None:
    for node in (*SHAPES, WORM, GROUND):
        points = points_around(np.random.default_rng(4), node, 100)
        np.testing.assert_allclose(node.scale(size)(points * size), node(points), atol=2e-5)


def test_known_points_of_each_surface() -> None:
    on_torus = [[1.25, 0, 0], [0, 0.75, 0], [1, 0, 0.25]]
    np.testing.assert_allclose(Torus((0, 0, 0), (0, 0, 9), 1.0, radius=0.25)(on_torus), ISO, atol=1e-6)
    on_disc = [[0, 0, 0.2], [1.2, 0, 0], [0.3, 0.4, -0.2]]
    np.testing.assert_allclose(Disc((0, 0, 0), (0, 0, 1e-300), 1.0, radius=0.2)(on_disc), ISO, atol=1e-6)
    on_box = [[1.1, 0, 0], [0, 0.6, 0], [0, 0, -2.1], [1 + 0.06, 0.5 + 0.08, 0]]
    np.testing.assert_allclose(Box((0, 0, 0), (2, 1, 4), radius=0.1)(on_box), ISO, atol=1e-6)
    assert Box((0, 0, 0), (2, 1, 4), radius=0.1)([[0.9, 0.4, 1.9]]).tolist() == [1.0]


def test_the_handle_of_a_torus_is_in_its_mesh() -> None:
    mesh = polygonize(TORUS, resolution=60)
    assert len(mesh.vertices) == len(mesh.faces) // 2  # V − E + F = 0


def test_gradients_are_exact_where_the_closest_point_leaves_a_corner_or_a_joint() -> None:
    """Two candidates differ little there, and have the same squared distance in float32."""
    rng = np.random.default_rng(3)
    triangle = Triangle((0.58, -0.76, 0.35), (-0.55, -0.62, -0.7), (-0.36, -0.4, 0.4), radius=0.4)
    corners = np.array([triangle.a, triangle.b, triangle.c])
    curved = replace(WORM, points=((0, 0, 0), (0.5, 0.3, 0), (0.6, 1, 0.4), (1, 1, 1)))
    pieces: Any = curved.expanded.children
    ends: list[tuple[Node, Any, Any]] = [
        (triangle, corners[i], corners[i - k] - corners[i]) for i in range(3) for k in (1, 2)
    ]
    ends += [(curved, np.array(p.start), np.subtract(p.control, p.start)) for p in pieces[1:]]
    pipe = Polyline(curved.points, radius=0.4)
    bends = np.array(pipe.points)
    ends += [(pipe, bends[i], bends[i + 1] - bends[i]) for i in (1, 2)]
    dart = Polygon(((0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0)), radius=0.4)
    ears: Any = dart.expanded.children
    ends += [(dart, 0.4 * np.array(e.a) + 0.6 * np.array(e.b), np.subtract(e.c, e.a)) for e in ears]
    ends += [(dart, 0.4 * np.array(e.a) + 0.6 * np.array(e.c), np.subtract(e.b, e.a)) for e in ears]
    for node, end, direction in ends:
        tangent = direction / np.linalg.norm(direction)
        away = np.cross(tangent, rng.normal(size=(200, 3)))
        along = 10.0 ** rng.uniform(-5.0, -2.5, (200, 1)) * rng.choice([-1.0, 1.0], (200, 1)) * tangent
        points = (end + 0.2 * away / np.linalg.norm(away, axis=1)[:, None] + along).astype(np.float32)
        smooth = oracle.gradient(node, points, 1e-7) - oracle.gradient(node, points, 1e-6)
        points = points[np.abs(smooth).max(axis=1) < 1e-5]
        assert len(points) > 50
        expected = oracle.gradient(node, points, 1e-7)
        np.testing.assert_allclose(node.gradient(points), expected, atol=2e-5)


def test_bounds_are_tight() -> None:
    reach = 0.2 / RIM
    for node, half in (
        (Torus((1, 0, 0), (0, 0, 1), 1.0, radius=0.2), (1.09, 1.09, 0)),
        (Disc((1, 0, 0), (0, 0, 1), 1.0, radius=0.2), (1.09, 1.09, 0)),
        (Box((1, 0, 0), (2, 4, 6), radius=0.2), (1, 2, 3)),
    ):
        np.testing.assert_allclose(node.support[1], np.add((1, 0, 0), half) + reach, atol=0.01)


def test_one_kind_is_one_run_and_maps_fold_into_tori_and_discs() -> None:
    rng = np.random.default_rng(1)
    for kind, stretched in ((Torus, False), (Disc, False), (Box, True)):
        nodes = [node for node in (SOLIDS.leaf(rng) for _ in range(60)) if isinstance(node, kind)]
        tree = sum((node.rotate((1, 2, 3), 30) for node in nodes[1:]), nodes[0].rotate((0, 0, 1), 10))
        assert isinstance(tree, Node)
        assert tree.tape.stretched is stretched
        assert len(tree.tape.headers) == 1


@EACH
def test_a_move_and_a_resize_keep_the_kind(node: Leaf) -> None:
    shifted = moved(node, (1, 2, 3))
    assert type(shifted) is type(node)
    points = points_around(np.random.default_rng(3), node, 100)
    np.testing.assert_allclose(shifted(points + np.array([1, 2, 3])), node(points), atol=2e-5)
    thick = resized(node, 2.0)
    larger: Any = {"semi_axes": (1.0, 2.0, 1.6)}
    if node is not ELLIPSOID:
        names = [name for name, p in parameters_of(type(node)).items() if p.quantity is Quantity.RADIUS]
        larger = {name: 2.0 * getattr(node, name) for name in names}
    assert thick == replace(node, **larger)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Torus((0, 0, 0), (0, 0, 0), 1.0, radius=0.2), "axis: expected a direction"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 0.0, radius=0.2), "ring_radius: expected a number above 0"),
        (lambda: Disc((0, 0, 0), (0, 0, 1), -1.0, radius=0.2), "disc_radius: expected a number above 0"),
        (lambda: Disc((0, 0, 0), "z", 1.0, radius=0.2), "axis: expected three finite numbers"),  # type: ignore[arg-type]
        (lambda: Box((0, 0, 0), (1, -1, 1), radius=0.2), "size: expected three numbers from 0"),
        (lambda: Ellipsoid((0, 0, 0), (1, 0, 1)), "semi_axes: expected three numbers above 0"),
        (lambda: Ellipsoid((0, 0, 0), (1, 1)), "semi_axes: expected three finite numbers"),  # type: ignore[arg-type]
        (lambda: Ellipsoid((0, 0, 0), (1, 1, 1e-9)), "semi_axes: expected lengths whose ratio is at most"),
        (lambda: Box((0, 0, 0), (1, 1, 1), radius=-0.1), "radius: expected a number from 0, got -0.1"),
        (lambda: Disc((0, 0, 0), (0, 0, 1), 1.0, radius=0.0), "radius: expected a number above 0"),
        (lambda: Circle((0, 0, 0), (0, 0, 1), np.nan, radius=0.2), "circle_radius: expected a finite number"),
        (
            lambda: Arc((0, 0, 0), (1, 1, 1), (2, 2, 2), radius=0.2),
            "lie on a line or are equal; use a Segment",
        ),
        (lambda: Arc((0, 0, 0), (1, 0, 0), (0, 0, 0), radius=0.2), "or a Circle if start and end are equal"),
        (lambda: Arc((0, 0, 0), (0, 0, 0), (1, 0, 0), radius=0.2), "expected three points on a circle"),
        (
            lambda: Rectangle((0, 0, 0), (0, 0, 1), (0, 0, 2), 1, 1, radius=0.2),
            "side: expected a direction in",
        ),
        (
            lambda: Rectangle((0, 0, 0), (0, 0, 1), (1, 0, 2), 1, 0, radius=0.2),
            "height: expected a number above",
        ),
        (lambda: Triangle((0, 0, 0), (1, 1, 1), (2, 2, 2), radius=0.2), "expected three corners that span a"),
        (lambda: Triangle((0, 0, 0), (1, 1, 1), (1, 1, 1), radius=0.2), "expected three corners that span a"),
        (lambda: Triangle((1, 1, 1), (1, 1, 1), (1, 1, 1), radius=0.2), "expected three corners that span a"),
        (lambda: Cylinder((0, 0, 1), (0, 0, 1), 1.0, radius=0.2), "end: expected another point"),
        (lambda: Polyline(((0, 0, 1),), radius=0.2), "points: expected at least two different points"),
        (lambda: Polyline(((0, 0, 1),) * 3, radius=0.2), "points: expected at least two different points"),
        (lambda: Polyline(5, radius=0.2), "points: expected points"),  # type: ignore[arg-type]
        (lambda: Polyline(((0, 0, 1), (0, np.nan, 1)), radius=0.2), r"points\[1\]: expected three finite"),
        (lambda: Stroke(((0, 0, 1), (0, 0, 1)), (0.2,)), "points: expected two or more points, each other"),
        (lambda: Stroke(((0, 0, 1), (0, 0, 2)), (0.2,) * 3), "radii: expected one for each of 2 points"),
        (lambda: Stroke(((0, 0, 1), (0, 0, 2)), (0.2, 0)), r"radii\[1\]: expected a number above 0"),
        (lambda: Polygon(SQUARE[:2], radius=0.2), "points: expected at least three corners"),
        (lambda: Polygon((*SQUARE[:3], (0, 1, 0.1)), radius=0.2), "points: expected corners in one plane"),
        (lambda: Polygon(tuple(SQUARE[k] for k in (0, 2, 1, 3)), radius=0.2), "expected a simple polygon"),
        (lambda: Polygon(tuple(SQUARE[k] for k in (0, 1, 1, 3)), radius=0.2), "expected a simple polygon"),
        (lambda: Polygon((*SQUARE, (0.5, 0, 0)), radius=0.2), "expected a simple polygon"),
        (lambda: HalfSpace((0, 0, 0), (0, 0, 0), 1.0, radius=0.2), "normal: expected a direction"),
    ],
)
def test_wrong_parameters_are_refused(make: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()


# -- declarations ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", NODE_KINDS.values(), ids=NODE_KINDS)
def test_every_parameter_is_declared_documented_and_in_files(kind: type[Node]) -> None:
    parameters = parameters_of(kind)
    document = inspect.getdoc(kind) or ""
    for name, parameter in parameters.items():
        assert parameter.name == name
        assert f"{name} : " in document
        assert described(parameter) in document
    operands = {field.name for field in fields(kind)} - set(parameters)  # type: ignore[arg-type]
    known = "operands", "child", "solid", "tool", "obstacle", "first", "second", "inside", "outside", "region"
    assert operands <= set(known)
    assert ">>> " in document


def test_every_skeleton_has_a_primitive_with_a_radius_and_a_color() -> None:
    kinds = [kind for kind in NODE_KINDS.values() if issubclass(kind, Primitive)]
    pieces = {_JoinedSegment.skeleton}  # of polylines, which files hold as a whole
    assert {kind.skeleton for kind in kinds} | pieces == {*library().skeletons}
    for kind in kinds:
        quantities = [parameter.quantity for parameter in parameters_of(kind).values()]
        assert quantities.count(Quantity.COLOR) == 1
        assert Quantity.RADIUS in quantities
        assert Quantity.POINT in quantities


def test_a_point_keeps_its_place_on_the_tape() -> None:
    assert Point((1, 2, 3), radius=RIM).tape.data.tolist()[1] == [1.0, 2.0, 3.0, 1.0]


def test_the_guide_lists_every_primitive_with_its_parameters() -> None:
    guide = (Path(__file__).parents[3] / "docs" / "modelling.md").read_text()
    for kind in NODE_KINDS.values():
        if issubclass(kind, Leaf):
            shared = {"color", "attributes", *(PROFILE if issubclass(kind, Profile) else PROFILE[::2])}
            passed = [p for name, p in inspect.signature(kind).parameters.items() if name not in shared]
            arguments = [p.name + "=…" * (p.kind is p.KEYWORD_ONLY) for p in passed]
            assert f"`{kind.__name__}({', '.join(arguments)})`" in guide
