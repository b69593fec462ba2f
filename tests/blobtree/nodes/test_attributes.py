"""Attributes and rest coordinates: blended like colours, kept in files, known at the points of meshes."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import blobtree
from blobtree import (
    Bend,
    Node,
    NoiseWarp,
    Point,
    Polygon,
    Polyline,
    Segment,
    Stroke,
    Sum,
    Superquadric,
    Taper,
    Torus,
    Transform,
    Twist,
    Union,
    from_json,
    to_json,
)
from blobtree.errors import InvalidFile, InvalidNode
from blobtree.nodes.deformations import Deformation
from blobtree.nodes.paths import primitive_paths, with_node
from blobtree.nodes.primitives import Leaf
from tests.blobtree.custom_kinds import Ring
from tests.blobtree.trees import FIELDS, SHAPES, SOLIDS, points_around, random_trees
from tests.oracles import blobtree as oracle
from tests.oracles import deformations

Floats = NDArray[np.float64]
A = Point((0, 0, 0), radius=1.0, attributes={"age": 10, "flow": (1, 0, 0), "bone": "arm"})
B = Segment((1, 0, 0), (2, 0, 0), radius=0.5, attributes={"age": 20, "flow": [0, 1, 0], "bone": "hand"})
KINDS = {kind: getattr(blobtree, kind) for kind in blobtree.__all__}


def colored(tree: Node) -> Node:
    """The tree with each leaf's colour as an attribute."""
    for path in primitive_paths(tree):
        leaf: Any = blobtree_leaf(tree, path)
        tree = with_node(tree, path, replace(leaf, attributes={"tint": leaf.color, "red": leaf.color[0]}))
    return tree


def blobtree_leaf(tree: Node, path: tuple[int, ...]) -> Leaf:
    for step in path:
        tree = tree.children[step]
    assert isinstance(tree, Leaf)
    return tree


@pytest.mark.parametrize("more", [SOLIDS, SHAPES, FIELDS], ids=["solids", "shapes", "fields"])
def test_attributes_blend_like_colours(more: Any) -> None:
    rng = np.random.default_rng(0)
    for tree in random_trees(3, 8, more=more):
        copy = colored(tree)
        points = points_around(rng, tree, 100)
        colors = tree.colors(points)
        np.testing.assert_allclose(copy.attribute("tint", points), colors, atol=1e-6)
        np.testing.assert_allclose(copy.attribute("red", points), colors[:, 0], atol=1e-6)


def test_macros_and_custom_nodes_hand_their_attributes_on() -> None:
    own = {"age": 5.0}
    square = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    nodes: list[Node] = [
        Polyline(square, radius=0.2, attributes=own),
        Polygon(square, radius=0.2, attributes=own),
        Stroke(square, (0.2,), attributes=own),
        Superquadric((0, 0, 0), (1, 1, 1), attributes=own),
        Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.2, attributes=own),
        Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2, attributes=own),
    ]
    for node in nodes:
        assert node.attribute("age", [1, 0, 0]) == pytest.approx(5.0)
        assert from_json(to_json(node)) == node == pickle.loads(pickle.dumps(node))
        assert "attributes={'age': 5.0}" in repr(node)


def test_an_attribute_is_averaged_by_weight_and_has_a_default() -> None:
    points = np.array([[0.8, 0.1, 0], [0.9, 0.3, 0.2], [9, 9, 9]])
    a, b = oracle.value(A, points), oracle.value(B, points)
    share = b / np.where(a + b > 0.0, a + b, 1.0)
    np.testing.assert_allclose((A + B).attribute("age", points), [*(10 + 10 * share[:2]), 0.0], rtol=1e-5)
    flow = (A + B).attribute("flow", points)
    np.testing.assert_allclose(flow[:2, 1], share[:2], rtol=1e-4)
    bare = replace(B, attributes={})
    with_default = (A + bare).attribute("age", points, default=30.0)
    np.testing.assert_allclose(with_default, [*(10 + 20 * share[:2]), 30.0], rtol=1e-5)
    assert (A | B).attribute("age", points[:1]) == 10.0 + 10.0 * (b[0] > a[0])
    assert (A - bare).attribute("age", [-0.5, 0, 0]) == 10.0
    assert (A + B).attribute_names == ["age", "bone", "flow"]


def test_attributes_are_known_where_rays_hit() -> None:
    tree = (A + B).rotate((0, 0, 1), 30)
    assert isinstance(tree, Transform)
    ways = np.random.default_rng(3).normal(size=(60, 3))
    hits = tree.raycast(-5.0 * ways, ways)
    places = hits.positions[hits.hit]
    assert len(places) > 20
    behind = np.linalg.solve(np.array(tree.matrix)[:, :3], places.T).T
    shares = oracle.value(B, behind) / (oracle.value(A, behind) + oracle.value(B, behind))
    np.testing.assert_allclose(tree.attribute("age", places), 10 + 10 * shares, rtol=1e-4)
    np.testing.assert_allclose(tree.attribute("flow", places)[:, 1], shares, atol=1e-4)
    np.testing.assert_array_equal(tree.attribute("bone", places) == "arm", shares < 0.5)
    np.testing.assert_allclose(tree.rest_coordinates(places), behind, atol=1e-5)


def test_the_strongest_label_wins() -> None:
    rng = np.random.default_rng(1)
    balls = [
        Point(tuple(rng.uniform(-1, 1, 3)), radius=0.6, attributes={"bone": f"bone {k % 5}"} if k else {})
        for k in range(8)
    ]
    tree = Sum(tuple(balls))
    points = points_around(rng, tree, 300)
    values = np.array([oracle.value(ball, points) for ball in balls])
    labels = np.array(["none", *(f"bone {k % 5}" for k in range(1, 8))])
    names = sorted(set(labels.tolist()))
    weights = np.array([values[labels == name].sum(axis=0) for name in names])
    expected = np.where(weights.max(axis=0) > 0.0, np.array(names)[weights.argmax(axis=0)], "none")
    clear = np.ptp(np.sort(weights, axis=0)[-2:], axis=0) > 1e-4
    clear |= weights.max(axis=0) == 0.0
    seen = tree.attribute("bone", points, default="none")
    np.testing.assert_array_equal(seen[clear], expected[clear])
    assert len(set(seen.tolist())) > 4
    assert str((A + B).attribute("bone", [0, 0, 0])) == "arm"


def rest(node: Node, q: Floats) -> tuple[Floats, Floats]:
    """Values (n,) and rest coordinates (n, 3) in float64, by recursion."""
    match node:
        case Transform(child=child, matrix=matrix):
            linear, offset = np.array(matrix)[:, :3], np.array(matrix)[:, 3]
            return rest(child, np.linalg.solve(linear, (q - offset).T).T)
        case Twist(child=child, degrees=degrees):
            angle = -np.radians(degrees) * q[:, 2]
            x, y = np.cos(angle) * q[:, 0], np.sin(angle) * q[:, 0]
            turned = np.stack([x - np.sin(angle) * q[:, 1], y + np.cos(angle) * q[:, 1], q[:, 2]], axis=1)
            return rest(child, turned)
        case Deformation(child=child) | NoiseWarp(child=child):
            return rest(child, deformations.unwarped(node, q)[0])
        case Sum(operands=operands) | Union(operands=operands):
            parts = [rest(operand, q) for operand in operands]
            values = np.array([value for value, _ in parts])
            weights = values if isinstance(node, Sum) else (values == values.max(axis=0)).astype(np.float64)
            shares = weights / np.maximum(weights.sum(axis=0), 1e-300)
            mixed = sum(share[:, None] * place for share, (_, place) in zip(shares, parts, strict=True))
            total = values.sum(axis=0) if isinstance(node, Sum) else values.max(axis=0)
            return total, np.asarray(mixed)
    return oracle.value(node, q), q


REST = {
    "a leaf": A,
    "moved": A.translate((1, 2, 3)) + B.rotate((1, 2, 3), 40),
    "stretched": A.scale((1, 2, 0.5)) + B,
    "scaled twice": ((A.scale(2.0) + B).rotate((0, 1, 0), 30) + A).translate((0.2, 0, 0)),
    "twisted": (A + B.translate((0, 0, 0.5))).twist(70.0),
    "twists": ((A.twist(40.0) + B).rotate((1, 0, 0), 90).twist(-50.0) + A.translate((0, 1, 0))).scale(0.7),
    "bent": Bend((A + B.rotate((0, 1, 0), -60)).translate((0, 0, 1)), 20.0, 0.0, 2.0),
    "tapered and noisy": NoiseWarp(Taper(A + B, 0.5, -1.0, 1.0), 0.05, 1.0),
    "united": A.rotate((0, 0, 1), 30) | B.translate((0, 0.3, 0)),
    "a direct field": Superquadric((0, 0, 0), (1, 1, 1)).rotate((0, 0, 1), 30) + B,
}


@pytest.mark.parametrize("name", REST)
def test_rest_coordinates_are_those_of_float64(name: str) -> None:
    tree = REST[name]
    points = points_around(np.random.default_rng(2), tree, 400)
    value, expected = rest(tree, points.astype(np.float64))
    strong = value > 1e-2
    if name == "united":
        strong &= oracle.evaluate(tree, points).margin > 1e-4
    assert strong.sum() > 100
    np.testing.assert_allclose(tree.rest_coordinates(points)[strong], expected[strong], atol=1e-5)
    assert np.isnan(tree.rest_coordinates(points)[tree(points) == 0.0]).all()


def test_places_on_a_tree_at_rest() -> None:
    """Each leaf of a posed tree takes its surroundings to those of the leaf at rest."""
    arm = Segment((0, 0, 0), (0, 0, 2), radius=0.5)
    points = points_around(np.random.default_rng(5), arm, 200)
    for moved in (
        arm.rotate((1, 2, 3), 40).translate((1, 2, 3)),
        arm.scale((1, 2, 0.5)).rotate((0, 1, 0), 30),
        arm.twist(70.0),
    ):
        expected = rest(moved, points.astype(np.float64))[1]
        inside = moved(points) > 1e-2
        found = moved.rest_coordinates(points[inside], rest=arm)
        np.testing.assert_allclose(found, expected[inside], atol=2e-5)
    lifted = Segment((0, 0, 0), (4, 0, 0), radius=0.25)
    found = lifted.rest_coordinates([[1, 0.25, 0], [3, 0, 0.1]], rest=arm)
    np.testing.assert_allclose(found, [[0, 0.5, 0.5], [-0.2, 0, 1.5]], atol=1e-5)
    pair, swapped = A.translate((0, 0, 3)) + B.rotate((0, 0, 1), 30), A + B.twist(20.0)
    places = np.array([[0.2, 0.1, 0.3]])
    assert np.isfinite(swapped.rest_coordinates(places, rest=pair)).all()
    ball = Superquadric((1, 0, 0), (1, 1, 2))
    grown = Superquadric((0, 0, 0), (2, 2, 2))
    np.testing.assert_allclose(grown.rest_coordinates([1.0, 1.0, 1.0], rest=ball), [1.5, 0.5, 1.0], atol=1e-6)
    for wrong in (arm + arm, A, 3):
        with pytest.raises(InvalidNode, match="rest: expected"):
            arm.rest_coordinates(points, rest=wrong)  # type: ignore[arg-type]


def test_places_on_a_tree_at_rest_that_has_warps() -> None:
    """A point and its place at rest lie at the same point of the leaves, before the warps of either tree."""
    arm = Segment((0, 0, 0), (0, 0, 2), radius=0.5) + Segment((0, 0, 2), (0.8, 0, 3), radius=0.4)
    for at_rest, posed in (
        (arm.twist(60.0), arm),
        (arm.bend(25, (0.3, 1.5)), arm.twist(50.0).bend(-20, (0.2, 1.8))),
        (arm.twist(60.0).translate((1, 2, 3)), arm.twist(60.0)),
    ):
        points = blobtree.polygonize(posed, resolution=16).vertices
        found = posed.rest_coordinates(points, rest=at_rest)
        before, after = (
            rest(tree, at.astype(np.float64))[1] for tree, at in ((posed, points), (at_rest, found))
        )
        if isinstance(at_rest, Transform):
            np.testing.assert_allclose(found, points + np.array([1, 2, 3]), atol=1e-5)
        np.testing.assert_allclose(after, before, atol=1e-5)
    outside = posed.rest_coordinates([50.0, 0.0, 0.0], rest=at_rest)
    assert np.isnan(outside).all()


def test_rest_coordinates_of_a_primitive_with_a_width_are_not_its_color() -> None:
    tree = Point((0, 0, 0), radius=1.0, width=0.5).scale((1, 2, 1)).translate((1, 2, 3))
    np.testing.assert_allclose(tree.rest_coordinates([[1.2, 2.6, 3.1]]), [[0.2, 0.3, 0.1]], atol=1e-6)


def test_meshes_have_attributes_as_point_data() -> None:
    tree = (A + B).twist(20.0)
    surface = tree.to_pyvista(resolution=12, attributes=["age", "flow"], rest_coordinates=True)
    assert surface.point_data["flow"].shape == (surface.n_points, 3)
    np.testing.assert_allclose(surface.point_data["age"], tree.attribute("age", surface.points))
    assert np.isfinite(surface.point_data["rest_coordinates"]).all()
    assert "age" in tree.to_pyvista(resolution=12, attributes="age").point_data
    hits = tree.raycast([[5, 0, 0]], [[-1, 0, 0]])
    assert 10.0 <= tree.attribute("age", hits.positions)[0] <= 20.0


def test_attributes_are_values() -> None:
    again = from_json(to_json(A))
    assert again == A == eval(repr(A), KINDS) == pickle.loads(pickle.dumps(A))
    assert hash(again) == hash(A)
    assert replace(A, attributes={}) != A
    assert A.attributes == {"age": 10.0, "bone": "arm", "flow": (1.0, 0.0, 0.0)}
    assert "attributes" not in repr(Point((0, 0, 0), radius=1.0))
    assert b"attributes" not in to_json(Point((0, 0, 0), radius=1.0))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (5, "attributes: expected a dictionary"),
        ({1: 2.0}, "attributes: expected names as keys"),
        ({"": 2.0}, "attributes: expected names as keys"),
        ({"age": np.nan}, r"attributes\['age'\]: expected a finite number"),
        ({"age": None}, r"attributes\['age'\]: expected a finite number"),
        ({"age": (1, 2, 3, 4)}, r"attributes\['age'\]: expected a number, up to three numbers or a label"),
        ({"age": ()}, r"attributes\['age'\]: expected a number, up to three"),
        ({"age": (1, "x")}, r"attributes\['age'\]: expected a finite number"),
    ],
)
def test_other_attributes_are_refused(value: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        Point((0, 0, 0), radius=1.0, attributes=value)


def test_what_no_tree_can_answer_is_refused() -> None:
    mixed = A + replace(B, attributes={"age": "old"})
    with pytest.raises(InvalidNode, match=r"of a primitive in the tree \(age, bone, flow\)"):
        A.attribute("size", [0, 0, 0])
    with pytest.raises(InvalidNode, match="expected values of one type, got labels and numbers"):
        mixed.attribute("age", [0, 0, 0])
    for name, default in (("age", "x"), ("age", (1, 2)), ("flow", (1, 2)), ("age", np.nan)):
        with pytest.raises(InvalidNode, match="default: expected a number"):
            A.attribute(name, [0, 0, 0], default=default)
    with pytest.raises(InvalidNode, match="default: expected a label"):
        A.attribute("bone", [0, 0, 0], default=3.0)
    with pytest.raises(InvalidFile, match="attributes"):
        from_json(to_json(A).replace(b'"age": 10.0', b'"age": [1, 2, 3, 4]'))
