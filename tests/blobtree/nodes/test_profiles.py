"""Falloff, width and weight of primitives: values, visible radii, supports, meshes, files and bad input."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import (
    FALLOFF_NAMES,
    ISO,
    Box,
    Cone,
    ConvolutionSegment,
    Difference,
    Disc,
    Ellipsoid,
    Falloff,
    HalfSpace,
    Node,
    Noise,
    NumericParameter,
    Point,
    Polygon,
    Polyline,
    Primitive,
    Segment,
    Stroke,
    Sum,
    Superquadric,
    Torus,
    Union,
    formula,
    from_json,
    from_sdf,
    numeric_parameters,
    numeric_values,
    polygonize,
    to_json,
    with_numeric_values,
)
from blobtree.custom import define_falloff
from blobtree.declare.parameters import parameters_of
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.formulas.skeletons import JOINT_YIELD
from blobtree.nodes.paths import moved, resized
from blobtree.nodes.primitives import PROFILE
from blobtree.tape.instruction_set import core
from blobtree.transpile.python import plain_python
from tests.blobtree.custom_kinds import Ring, Staircase, Tent
from tests.blobtree.kernels import rising, short, staircase_slope, tent, tent_slope, vector
from tests.blobtree.meshing.test_polygonize import assert_closed, assert_valid
from tests.blobtree.transpile.warp_functions import call, python_function
from tests.blobtree.trees import BUILT_IN_FALLOFFS, points_around
from tests.oracles import blobtree as oracle
from tests.oracles import falloffs as exact

EACH_FALLOFF = pytest.mark.parametrize("name", BUILT_IN_FALLOFFS)

LINE = ((0, 0, 0), (0.5, 0, 0), (1, 0, 0))
SQUARE = ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))
PRIMITIVES: dict[str, tuple[Any, tuple[float, float, float]]] = {
    "point": (lambda **p: Point((0, 0, 0), radius=0.4, **p), (0.4, 0, 0)),
    "segment": (lambda **p: Segment((0, 0, 0), (1, 0, 0), radius=0.4, **p), (0.5, 0.4, 0)),
    "cone": (lambda **p: Cone((0, 0, 0), (1, 0, 0), radius=0.4, end_radius=0.2, **p), (-0.4, 0, 0)),
    "torus": (lambda **p: Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.4, **p), (1.4, 0, 0)),
    "disc": (lambda **p: Disc((0, 0, 0), (0, 0, 1), 1.0, radius=0.4, **p), (1.4, 0, 0)),
    "box": (lambda **p: Box((0, 0, 0), (1, 1, 1), radius=0.4, **p), (0.9, 0, 0)),
    "polyline": (lambda **p: Polyline(LINE, radius=0.4, **p), (0.5, 0.4, 0)),
    "stroke": (lambda **p: Stroke(LINE, (0.4,), **p), (1.4, 0, 0)),
    "b-spline": (lambda **p: Stroke(LINE, (0.4,), spline="b_spline", **p), (1.4, 0, 0)),
    "polygon": (
        lambda **p: Polygon(SQUARE, radius=0.4, **p),
        (1.4, 0, 0),
    ),
    "half space": (lambda **p: HalfSpace((0, 0, 0), (1, 0, 0), 2.0, radius=0.4, **p), (0, 0, 0)),
    "ellipsoid": (lambda **p: Ellipsoid((0, 0, 0), (0.4, 0.4, 0.4), **p), (0.4, 0, 0)),
    "superquadric": (lambda **p: Superquadric((0, 0, 0), (0.4, 0.4, 0.4), **p), (0.4, 0, 0)),
    "ring": (lambda **p: Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.4, **p), (1.4, 0, 0)),
}
"""Makers of primitives, and a point on the surface of each, of which x is the direction outwards."""

SHARED = PRIMITIVES["ring"][0](falloff="soft_object") + PRIMITIVES["stroke"][0](falloff="staircase")
SHARED.tape  # noqa: B018  (trees of library and custom kinds then share its kernels)


@EACH_FALLOFF
def test_a_falloff_is_that_of_its_source(name: str) -> None:
    row = FALLOFF_NAMES[name]
    d = np.linspace(0.0, 1.0, 2001)
    np.testing.assert_allclose(call(row.value, distance=d), exact.value(name, d), atol=5e-7)
    step = 1e-6
    inner = d[1:-1]
    slopes = (exact.value(name, inner + step) - exact.value(name, inner - step)) / (2.0 * step)
    np.testing.assert_allclose(call(row.slope, distance=inner), slopes, atol=2e-5)
    assert row.rim == pytest.approx(exact.rim(name), abs=1e-12)
    dense = np.linspace(0.0, 1.0, 400_001)
    steepness = -np.gradient(exact.value(name, dense), dense)
    assert row.steepest_slope == pytest.approx(steepness.max(), rel=1e-4)
    assert row.steepest_distance == pytest.approx(dense[steepness.argmax()], abs=1e-4)
    assert call(row.value, distance=[0.0, 1.0]) == pytest.approx([1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("kind", PRIMITIVES)
@pytest.mark.parametrize("name", [*BUILT_IN_FALLOFFS, "staircase"])
def test_an_isolated_primitive_shows_its_radius_and_ends_at_its_width(kind: str, name: str) -> None:
    make, surface = PRIMITIVES[kind]
    sign = -1.0 if kind == "cone" else float(kind not in ("segment", "polyline"))
    outward = np.array([sign, 0.0 if sign else 1.0, 0.0])
    for width in (None, 0.1, 1.0):
        node = make(falloff=name, width=width)
        error = 10 * JOINT_YIELD if kind in ("polygon", "polyline") else 2e-6
        assert float(node(surface)) == pytest.approx(ISO, abs=error)
        end = 0.4 * (1.0 / exact.rim(name) - 1.0) if width is None else width
        inside, outside = np.array(surface) + np.multiply.outer([0.98 * end, 1.001 * end], outward)
        assert float(node(inside)) > 0.0
        assert float(node(outside)) == 0.0
        reach = float(np.abs(surface) @ np.abs(outward)) + end
        corner = node.support[0] if sign < 0 else node.support[1]
        assert reach <= abs(float(corner @ outward)) <= 1.1 * reach


@pytest.mark.slow_cases("'staircase'")
@pytest.mark.parametrize("falloff", [Staircase, Tent], ids=repr)
def test_a_custom_falloff_is_evaluated_and_bounded(falloff: Any) -> None:
    tree = Point((0, 0, 0), radius=1.0, falloff=falloff) + Point((1, 0, 0), radius=0.5, width=0.7)
    points = points_around(np.random.default_rng(1), tree, 400)
    np.testing.assert_allclose(tree(points), oracle.value(tree, points), atol=1e-5)
    mesh = polygonize(tree, resolution=24)
    assert_closed(mesh)
    hits = tree.raycast(np.tile([3.0, 0, 0], (50, 1)), np.random.default_rng(2).normal(-1, 0.2, (50, 3)))
    np.testing.assert_allclose(tree(hits.positions[hits.hit]), ISO, atol=1e-3)
    assert pickle.loads(pickle.dumps(tree)) == tree == from_json(to_json(tree))
    assert (falloff.steepest_distance >= 0.0) is (falloff is Tent)


def test_a_falloff_outside_the_core_uses_the_library_and_a_width_does_not() -> None:
    ball: dict[str, Any] = {"center": (0, 0, 0), "radius": 1.0}
    assert Point(**ball, width=0.5, weight=2.0).tape.instruction_set is core()
    assert Point(**ball, falloff="gaussian").tape.instruction_set is not core()
    assert Point(**ball, falloff="gaussian").tape.falloffs != ()
    assert Point(**ball).tape.falloffs == ()


# -- weights --------------------------------------------------------------------------------------------


def test_a_negative_weight_carves_in_a_sum_and_does_nothing_elsewhere() -> None:
    solid, carver = Point((0, 0, 0), radius=1.0), Point((0.8, 0, 0), radius=0.6, weight=-1.0)
    tool = Point((0.8, 0, 0), radius=0.6)
    points = points_around(np.random.default_rng(3), solid, 500)
    np.testing.assert_allclose((solid + carver)(points), solid(points) - tool(points), atol=1e-6)
    assert (solid + carver)(points).min() < -0.1
    np.testing.assert_array_equal((solid | carver)(points), solid(points))
    np.testing.assert_array_equal((solid & carver)(points), np.zeros(500))
    np.testing.assert_array_equal((solid - carver)(points), solid(points))
    np.testing.assert_array_equal((carver - solid)(points), np.zeros(500))
    np.testing.assert_array_equal(((solid + carver) | (carver + carver))(points),
                                  np.maximum((solid + carver)(points), 0.0))  # fmt: skip


def test_a_carved_solid_has_a_closed_mesh_without_what_is_carved() -> None:
    tree = Sum((Point((0, 0, 0), radius=1.0), Point((0.9, 0, 0), radius=0.5, weight=-2.0)))
    carved = polygonize(Union((tree, Point((-1.2, 0, 0), radius=0.3))), resolution=48)
    assert_closed(carved)
    assert_valid(carved)
    assert carved.vertices[:, 0].max() < 0.8
    np.testing.assert_allclose(oracle.value(tree, carved.vertices[carved.vertices[:, 0] > 0]), ISO, atol=1e-4)


def test_pieces_carve_as_one_shape_and_not_as_a_sum() -> None:
    """At a corner of a polyline two segments overlap, and the field is that of the nearer one."""
    corner: dict[str, Any] = {
        "points": [(-1, 0, 0), (0, 0, 0), (0, 1, 0)],
        "radius": 0.4,
        "falloff": "cauchy",
    }
    ball, line = Point((0, 0, 0), radius=1.2), Polyline(**corner)
    q = points_around(np.random.default_rng(9), ball, 500)
    carved = ball + Polyline(**corner, weight=-0.8)
    np.testing.assert_allclose(carved(q), ball(q) - 0.8 * line(q), atol=1e-6)
    np.testing.assert_allclose(carved.twist(20)(q), oracle.value(carved.twist(20), q), atol=2e-6)
    np.testing.assert_array_equal((ball | Polyline(**corner, weight=-0.8))(q), ball(q))
    assert_closed(polygonize(carved, resolution=32))


def test_the_width_of_a_stroke_is_in_proportion_to_its_radius() -> None:
    """So its field is one function of the distance over the radius, also where its parabolas meet."""
    node = Stroke(((0, 0, 0), (1, 0, 0), (2, 0, 0)), (0.2, 0.2, 0.4), width=0.1)
    for grown, radius in ((node, 0.2), (node.offset(0.1), 0.3)):
        ratio = 1.0 + 0.9 * 0.1 / radius
        start, end = np.array([[0.0, radius * ratio, 0], [2.0 + (radius + 0.2) * ratio, 0, 0]])
        assert float(grown(start)) == pytest.approx(float(grown(end)), abs=1e-6)
        assert 0.0 < float(grown(start)) < 0.01


def test_a_falloff_of_what_has_no_distance_is_refused() -> None:
    limb: dict[str, Any] = {"start": (0, 0, 0), "end": (2, 0, 0), "radius": 0.3, "end_radius": 0.3}
    with pytest.raises(InvalidNode, match="falloff: expected none, a ConvolutionSegment is no function of a"):
        ConvolutionSegment(**limb, falloff="gaussian")  # type: ignore[call-arg]
    with pytest.raises(InvalidNode, match="width: expected none, a Noise"):
        Noise((0, 0, 0), (4, 4, 4), wavelength=1.0, width=0.2)  # type: ignore[call-arg]
    with pytest.raises(InvalidNode, match=r"width: expected at least 0\.0001 of the radius 0.5"):
        Superquadric((0, 0, 0), (0.5, 0.5, 0.5), width=1e-6).tape  # noqa: B018


def test_volumes_take_the_keywords_of_leaves() -> None:
    def distance(points: Any) -> Any:
        return np.linalg.norm(points, axis=1) - 1.0

    same: dict[str, Any] = {"spacing": 0.25, "width": 0.5, "falloff": "gaussian", "weight": 2.0}
    ball = from_sdf(distance, (-2, -2, -2), (2, 2, 2), **same, attributes={"age": 3.0})
    assert float(ball((1, 0, 0))) == pytest.approx(2.0 * ISO, abs=1e-5)
    assert float(ball((1.5, 0, 0))) == 0.0 < float(ball((1.4, 0, 0)))
    assert ball.attributes == {"age": 3.0}


def test_an_offset_shrinks_what_carves() -> None:
    tree = Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=0.5, weight=-1.0)
    grown = Point((0, 0, 0), radius=1.1) + Point((1, 0, 0), radius=0.4, weight=-1.0)
    points = points_around(np.random.default_rng(4), grown, 200)
    np.testing.assert_allclose(tree.offset(0.1)(points), grown(points), atol=2e-6)
    with pytest.raises(InvalidNode, match=r"offset: 0\.6 leaves nothing"):
        tree.offset(0.6).tape  # noqa: B018


def test_colours_of_a_carved_sum_stay_in_range() -> None:
    rng = np.random.default_rng(5)
    parts = [
        Point(tuple(rng.uniform(-1, 1, 3)), radius=0.7, weight=float(w), color=tuple(rng.uniform(0, 1, 3)))
        for w in (1, 1, -1, 2, -0.5, 1)
    ]
    colors = Sum(tuple(parts)).colors(rng.uniform(-2, 2, (2000, 3)))
    assert 0.0 <= colors.min() <= colors.max() <= 1.0


# -- declarations ---------------------------------------------------------------------------------------


def test_texts_and_files_leave_out_defaults() -> None:
    plain, other = Point((0, 0, 0), radius=1.0), Point((0, 0, 0), radius=1.0, falloff="metaball", weight=2)
    for text in (repr(plain), str(plain), to_json(plain).decode()):
        assert "falloff" not in text
        assert "w" not in text.replace("blobtree", "")
    assert repr(other).endswith("weight=2.0, falloff='metaball')")
    assert '"falloff": "metaball"' in to_json(other).decode()
    assert "width" not in to_json(other).decode()
    for node in (plain, other, Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.4, width=0.3)):
        assert from_json(to_json(node)) == node == pickle.loads(pickle.dumps(node))
    assert eval(repr(other), {"Point": Point}) == other
    assert hash(plain) != hash(other)


def test_edits_keep_the_profile() -> None:
    node: Primitive = Segment((0, 0, 0), (1, 0, 0), radius=0.5, falloff="cauchy", width=0.3, weight=2.0)
    assert moved(node, (1, 0, 0)) == Segment((1, 0, 0), (2, 0, 0), radius=0.5, falloff="cauchy", width=0.3,
                                             weight=2.0)  # fmt: skip
    assert resized(node, 2.0) == Segment((0, 0, 0), (1, 0, 0), radius=1.0, falloff="cauchy", width=0.3,
                                         weight=2.0)  # fmt: skip


def test_fields_are_differentiated_by_width_and_weight() -> None:
    ball = Point((0, 0, 0), radius=1.0, width=0.7, falloff="gaussian")
    tree = ball + Point((1, 0, 0), radius=0.8, weight=-0.5) + Point((0, 1, 0), radius=0.5)
    points = points_around(np.random.default_rng(8), tree, 60)
    named = [str(parameter) for parameter in numeric_parameters(tree) if parameter.name in PROFILE]
    assert named == ["0: width", "1: weight"]
    (default,) = [NumericParameter((2,), "weight", (), parameters_of(Point)["weight"])]
    parameters = [*(p for p in numeric_parameters(tree) if p.name in PROFILE), default]
    seen = tree.parameter_gradient(points, parameters).values
    for parameter, column in zip(parameters, seen.T, strict=True):
        (value,) = numeric_values(tree, [parameter])
        ends = [with_numeric_values(tree, [parameter], [value + d]) for d in (1e-5, -1e-5)]
        change = oracle.value(ends[0], points) - oracle.value(ends[1], points)
        np.testing.assert_allclose(column, change / 2e-5, atol=1e-3)


@pytest.mark.parametrize(
    ("profile", "message"),
    [
        ({"falloff": "gauss"}, "falloff: expected a falloff or one of wyvill, soft_object, .*, got 'gauss'"),
        ({"falloff": None}, "falloff: expected a falloff or one of"),
        ({"width": 0.0}, "width: expected a number above 0"),
        ({"width": -1.0}, "width: expected a number above 0"),
        ({"width": float("nan")}, "width: expected a finite number"),
        ({"weight": float("inf")}, "weight: expected a finite number"),
        ({"weight": 1e4}, "weight: expected -1000 to 1000"),
        ({"weight": "2 kg"}, "weight: expected a finite number"),
    ],
)
def test_wrong_profiles_are_refused(profile: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        Point((0, 0, 0), radius=1.0, **profile)


def test_a_width_that_no_float_resolves_is_refused() -> None:
    with pytest.raises(InvalidNode, match=r"width: expected at least 0\.0001 of the radius 1, got 1e-05"):
        Point((0, 0, 0), radius=1.0, width=1e-5).tape  # noqa: B018


def test_a_kind_cannot_declare_what_every_primitive_has() -> None:
    with pytest.raises(TypeError, match="Plank: every primitive has a parameter 'width' already"):
        type("Plank", (Primitive,), {"__annotations__": {"width": float}})


@pytest.mark.parametrize(
    ("value", "slope", "message"),
    [
        (rising, tent_slope, "g rises from"),
        (short, tent_slope, r"g\(1\) = 0.5, expected 0"),
        (vector, tent_slope, "expected the distance `d: wp.float32` as its only parameter"),
        (tent, staircase_slope, r"g'\(.*\) is -1 by differences, but"),
        (abs, tent_slope, "expected a typed function"),
    ],
)
def test_wrong_falloffs_are_refused(value: Any, slope: Any, message: str) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        define_falloff(value, slope, name="wrong")
    with pytest.raises(InvalidDefinition, match="'wyvill' is a built-in falloff"):
        define_falloff(tent, tent_slope, name="wyvill")


def test_a_falloff_is_a_class_with_one_formula() -> None:
    def declared() -> type[Falloff]:
        class SoftEdge(Falloff):
            @formula
            def value(d: wp.float32) -> wp.float32:
                return (1.0 - d * d) * (1.0 - d)  # type: ignore[no-any-return]

        return SoftEdge

    kind = declared()
    (edge,) = {kind(), declared()(), FALLOFF_NAMES["soft_edge"]}
    node = Point((0, 0, 0), radius=1.0, falloff=kind)
    assert isinstance(node.falloff, kind)
    assert node == from_json(to_json(node)) == replace(node, falloff="soft_edge")
    assert define_falloff(kind._formulas["value"].python, name="soft_edge") is edge
    assert (1.0 - edge.rim**2) * (1.0 - edge.rim) == pytest.approx(ISO)
    slope = plain_python(python_function(edge.slope))
    for d in np.linspace(0.0, 1.0, 9):
        assert slope(d) == pytest.approx(3.0 * d**2 - 2.0 * d - 1.0)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({}, "expected a falloff with the formula `value`"),
        ({"value": tent}, "expected a falloff with the formula `value`"),
        ({"value": formula(tent), "rim": formula(tent)}, "formula 'rim': expected one of value, slope"),
        ({"value": formula(tent), "tag": "a b"}, "tag: expected letters, digits and single underscores"),
        ({"value": formula(tent), "tag": "cauchy"}, "'cauchy' is a built-in falloff"),
        ({"value": formula(tent), "numbers": (0.5, 0.0, 1.0)}, "numbers: expected none"),
    ],
)
def test_wrong_classes_of_falloffs_are_refused(body: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        type("Wrong", (Falloff,), {"__module__": __name__, **body})
    assert "wrong" not in FALLOFF_NAMES
    with pytest.raises(TypeError, match="expected a subclass of Falloff"):
        Falloff()


def test_a_negative_sum_below_any_operator_is_raised_to_zero() -> None:
    deep: Node = Point((0, 0, 0), radius=1.0, weight=-1.0) + Point((0.5, 0, 0), radius=0.5, weight=-1.0)
    other = Point((0, 0.5, 0), radius=0.8)
    for tree in (deep | other, other | deep, Difference(other, deep), Difference(deep, other),
                 (deep.twist(30) & other), (deep.scale((1, 2, 1)) | other) + deep):  # fmt: skip
        points = points_around(np.random.default_rng(6), other, 200)
        np.testing.assert_allclose(tree(points), oracle.value(tree, points), atol=2e-6)
