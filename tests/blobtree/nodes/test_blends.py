"""Blends and their macros as nodes: operands, files, text, and what they refuse."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from blobtree import (
    BlendGraph,
    CleanUnion,
    ControllableBlend,
    Intersection,
    LocalBlend,
    Mirror,
    Node,
    Noise,
    Point,
    RDifference,
    Ricci,
    RIntersection,
    RoundUnion,
    RUnion,
    Segment,
    Shell,
    SmoothDifference,
    SmoothIntersection,
    Sum,
    SuperellipticBlend,
    SymmetricDifference,
    Transition,
    Union,
)
from blobtree.errors import InvalidNode
from tests.blobtree.custom_kinds import Soft, Stew, Swell
from tests.blobtree.tracing.test_trace import checked_hits, rays_through

A, B, C, D = (Point((0.8 * x, 0.1 * x, 0.0), radius=0.7) for x in range(4))
PAIRS = (("a", "b"), ("b", "c"))


@pytest.mark.parametrize("kind", [Sum, Union, Intersection, Swell])
def test_operands_come_one_by_one_or_as_an_iterable(kind: Any) -> None:
    expected = kind((A, B, C))
    for same in (kind(A, B, C), kind([A, B, C]), kind(iter([A, B, C])), kind(operands=(A, B, C))):
        assert same == expected
        assert same.operands == (A, B, C)
    assert kind(A).operands == (A,)


def test_parameters_follow_the_operands() -> None:
    assert Ricci(A, B, exponent=2.0) == Ricci((A, B), exponent=2.0)
    assert Soft(A, B, 0.5) == Soft((A, B), 0.5) == Soft((A, B), hardness=0.5)
    assert Stew(A, B, 0.1, 0.2, 0.3, 0.4, less_right=0.5).operator_parameters == (0.1, 0.2, 0.3, 0.4, 0.5)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: Sum(), TypeError),
        (lambda: Ricci(A, B), TypeError),
        (lambda: Sum(A, B, exponent=2.0), TypeError),
        (lambda: Sum([A], [B]), TypeError),
        (lambda: Sum(A, operands=(B,)), TypeError),
        (lambda: Soft((A, B), 0.5, 0.6), TypeError),
        (lambda: Sum([]), InvalidNode),
        (lambda: Sum(5), InvalidNode),
        (lambda: Sum([A, 5]), InvalidNode),  # type: ignore[list-item]
    ],
)
def test_wrong_arguments_are_refused(make: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="operands"):
        make()


def test_messages_name_what_is_missing_or_unknown() -> None:
    with pytest.raises(TypeError, match=r"^Ricci: expected operands and exponent=…; exponent missing$"):
        Ricci(A, B)
    with pytest.raises(TypeError, match=r"^Sum: expected operands and nothing else; exponent unknown$"):
        Sum(A, B, exponent=2.0)


@pytest.mark.parametrize("kind", [CleanUnion, RUnion, RIntersection, RDifference, SymmetricDifference])
def test_operators_with_an_order_take_two_operands(kind: Any) -> None:
    with pytest.raises((InvalidNode, TypeError)):
        kind(A, B, C)
    with pytest.raises((InvalidNode, TypeError)):
        kind(A)


@pytest.mark.parametrize(
    "make",
    [
        lambda: SuperellipticBlend(A, B, width=0.0, exponent=2.0),
        lambda: SuperellipticBlend(A, B, width=0.6, exponent=2.0),
        lambda: SuperellipticBlend(A, B, width=0.2, exponent=0.5),
        lambda: SmoothIntersection(A, B, width=float("nan")),
        lambda: SmoothDifference(A, B, width=-1.0),
        lambda: ControllableBlend(A, B, left_angle=45.0, right_angle=0.0),
        lambda: ControllableBlend(A, B, left_angle=0.0, right_angle=-1.0),
        lambda: Shell(A, 0.0),
        lambda: Shell(A, 1.0).tape,
    ],
)
def test_parameters_out_of_range_are_refused(make: Any) -> None:
    with pytest.raises(InvalidNode):
        make()


@pytest.mark.parametrize(
    ("names", "pairs", "reason"),
    [
        (("a", "b"), (), "one for each of 3"),
        (("a", "b", "a"), (), "different name"),
        (("a", "b", "c"), (("a", "x"),), "no operand is named 'x'; the names are 'a', 'b', 'c'"),
        (("a", "b", "c"), (("a", "a"),), "two different names"),
        (("a", "b", "c"), (("a", "b", "c"),), "two different names"),
        (("a", "b", "c"), "ab", "two different names"),
        (("a", "b", "c"), 5, "two different names"),
        ("abc", (), "names"),
        ((1, 2, 3), (), "names"),
    ],
)
def test_blend_graphs_refuse_wrong_names(names: Any, pairs: Any, reason: str) -> None:
    with pytest.raises(InvalidNode, match=reason):
        BlendGraph((A, B, C), names=names, pairs=pairs)


def test_operands_of_a_graph_blend_where_an_edge_joins_them() -> None:
    names = ("a", "b", "c", "d")
    points = np.random.default_rng(0).uniform((-1, -1, -1), (3.5, 1, 1), (2000, 3))
    every = tuple(combinations(names, 2))
    graph = BlendGraph((A, B, C, D), names=names, pairs=every)
    np.testing.assert_allclose(graph(points), Sum(A, B, C, D)(points), atol=1e-6)
    none = BlendGraph((A, B, C, D), names=names, pairs=())
    np.testing.assert_allclose(none(points), Union(A, B, C, D)(points), atol=1e-6)
    chain = BlendGraph((A, B, C, D), names=names, pairs=(*PAIRS, ("c", "d")))
    np.testing.assert_allclose(chain(points), Union(A + B, B + C, C + D)(points), atol=1e-6)


def test_a_graph_with_too_many_groups_is_refused() -> None:
    """Moon and Moser (1965): pairs of all but one of three at a time give 3^(n/3) groups."""
    names = tuple(map(str, range(24)))
    pairs = [pair for pair in combinations(names, 2) if int(pair[0]) // 3 != int(pair[1]) // 3]
    with pytest.raises(InvalidNode, match="groups"):
        _ = BlendGraph([A] * 24, names=names, pairs=pairs).tape


def test_a_local_blend_is_a_sum_inside_its_region_and_a_union_where_that_ends() -> None:
    region = Point((0.4, 0.0, 0.8), radius=0.4)
    local = LocalBlend(A, B, region)
    points = np.random.default_rng(1).uniform(-1, 2, (4000, 3))
    inside, outside = region(points) >= 0.5, region(points) == 0.0
    assert inside.sum() > 20
    np.testing.assert_allclose(local(points[inside]), (A + B)(points[inside]), atol=1e-6)
    np.testing.assert_allclose(local(points[outside]), (A | B)(points[outside]), atol=1e-6)


def test_a_transition_is_each_node_where_its_part_of_the_region_is() -> None:
    region = Point((0.4, 0.0, 0.8), radius=0.4)
    narrow, wide = RoundUnion(A, B, width=0.02), RoundUnion(A, B, width=0.6)
    model = Transition(narrow, wide, region)
    points = np.random.default_rng(1).uniform(-1, 2, (4000, 3))
    share = region(points)
    for node, part in ((wide, share >= 0.5), (narrow, share == 0.0)):
        assert part.sum() > 20
        np.testing.assert_allclose(model(points[part]), node(points[part]), atol=1e-6)
    t = np.minimum(2.0 * share.astype(np.float64), 1.0)
    mixed = narrow(points) + (3.0 * t**2 - 2.0 * t**3) * (wide(points) - narrow(points))
    np.testing.assert_allclose(model(points), mixed, atol=2e-6)


@pytest.mark.parametrize(
    "region", [Point((0.2, 0, 0), radius=0.6), Noise((0, 0, 0), (3, 3, 3), wavelength=1.0)]
)
def test_rays_lose_no_surface_of_a_transition(region: Node) -> None:
    limb = Segment((-1, 0.3, 0), (1, 0, 0.4), radius=0.4)
    model = Transition(A + B, limb - A, region)
    assert checked_hits(model, *rays_through(np.random.default_rng(0), model, 40)) > 3


def test_a_mirror_adds_the_image_and_a_node_below_it_changes_both() -> None:
    limb = Segment((0.2, 0.4, 0), (1, 1, 0.5), radius=0.3)
    points = np.random.default_rng(8).uniform(-2, 2, (200, 3)).astype(np.float32)
    for axis, name in enumerate("xyz"):
        image = points * (1 - 2 * np.eye(3, dtype=np.float32)[axis])
        np.testing.assert_allclose(Mirror(limb, name)(points), limb(points) + limb(image), atol=1e-6)
    with pytest.raises(InvalidNode, match="axis"):
        Mirror(limb, "w")


def test_a_shell_is_hollow() -> None:
    shell = Shell(Point((0, 0, 0), radius=1.0), 0.2)
    radii = np.array([0.0, 0.5, 0.79, 0.81, 0.99, 1.01])
    inside = shell(radii[:, None] * [[0.6, 0.0, 0.8]]) >= 0.5
    assert inside.tolist() == [False, False, False, True, True, False]
