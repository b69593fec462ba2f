"""Shapes of trees: what is added, removed, copied and joined anew, where paths lead, and what decals do."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from blobtree import ISO, Difference, Intersection, Point, Ricci, Segment, Sum, Union
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import moved, node_at, node_in_world, primitive_paths, with_node
from blobtree.nodes.surgery import (
    SOFTNESS,
    Join,
    dominant_primitive,
    join_of,
    remove_branch,
    world_space_path,
)
from decals.editing import (
    AddPrimitive,
    DuplicatePrimitive,
    EditSession,
    JoinPrimitive,
    RemovePrimitive,
)
from decals.errors import InvalidEdit, InvalidMesh
from tests.decals.editing.scenes import digest
from tests.decals.editing.test_primitive_commands import session_of

A, B = Point((0, 0, 0), radius=1.0), Point((1.4, 0, 0), radius=0.7)
C, D = Segment((0, 1, 0), (0, 2, 0), radius=0.5), Point((0, 0, 1), radius=0.6)


@pytest.mark.parametrize(
    ("tree", "path", "join", "expected", "found"),
    [
        (A, (), Join.BLEND, Sum((A, D)), (1,)),
        (A + B, (0,), Join.BLEND, Sum((A, B, D)), (2,)),
        (A + B, (), Join.BLEND, Sum((A, B, D)), (2,)),
        (A + B, (0,), Join.UNION, Sum((Union((A, D)), B)), (0, 1)),
        (A | B, (1,), Join.UNION, Union((A, B, D)), (2,)),
        (A + B, (), Join.DIFFERENCE, Difference(A + B, D), (1,)),
        (A - B, (1,), Join.DIFFERENCE, Difference(A, Difference(B, D)), (1, 1)),
        (A - B, (1,), Join.BLEND, Difference(A, Sum((B, D))), (1, 1)),
        (A, (), Join.SOFT, Ricci((A, D), exponent=SOFTNESS), (1,)),
        (Ricci((A, B), exponent=SOFTNESS), (0,), Join.SOFT, Ricci((A, B, D), exponent=SOFTNESS), (2,)),
        (Ricci((A, B), exponent=8), (), Join.SOFT, Ricci((Ricci((A, B), exponent=8), D), exponent=3), (1,)),
        (A & B, (0,), Join.INTERSECTION, Intersection((A, B, D)), (2,)),
    ],
)
def test_what_joins_is_an_operand_more_or_a_node_of_its_own(
    tree: Any, path: Any, join: Any, expected: Any, found: Any
) -> None:
    assert AddPrimitive(0, path, D, join).restructure(tree) == (expected, found)
    assert node_at(expected, found) == D


@pytest.mark.parametrize(
    ("tree", "path", "expected"),
    [
        (A + B, (0,), B),
        (A + B + C, (1,), A + C),
        (A - B, (1,), A),
        ((A - B) + C, (0, 0), C),
        ((A - B) | C | D, (0, 0), C | D),
        ((A + B).translate((1, 0, 0)), (0, 1), A.translate((1, 0, 0))),
        (A + B.scale(2).twist(30), (1, 0, 0), A),
        (A - (B + C), (1, 0), A - C),
        (A & B & C, (2,), A & B),
        (Ricci((A, B, C), exponent=4), (0,), Ricci((B, C), exponent=4)),
    ],
)
def test_what_is_removed_takes_along_what_is_nothing_without_it(tree: Any, path: Any, expected: Any) -> None:
    assert remove_branch(tree, path) == expected


@pytest.mark.parametrize(
    ("tree", "path"), [(A, ()), (A.scale(2), (0,)), (A - B, (0,)), (A + B, ()), (Sum((A - B,)), (0, 0))]
)
def test_the_last_that_is_to_be_seen_stays(tree: Any, path: Any) -> None:
    session = session_of(tree, 10)
    before = digest(session.document)
    with pytest.raises(InvalidNode, match="remove the object"):
        session.do(RemovePrimitive(0, path))
    assert digest(session.document) == before


@pytest.mark.parametrize(
    ("tree", "path", "join", "expected", "found"),
    [
        (A + B + C, (1,), Join.UNION, Union((A + C, B)), (1,)),
        (A + B, (0,), Join.DIFFERENCE, B - A, (1,)),
        (A - B, (1,), Join.BLEND, Sum((A, B)), (1,)),
        (A - B, (0,), Join.UNION, Union((B, A)), (1,)),
        (Union((A + C, B)), (1,), Join.BLEND, Sum((A, C, B)), (2,)),
        (A | B.scale(2).rotate((0, 0, 1), 9), (1, 0, 0), Join.SOFT, None, (1, 0, 0)),
        (Sum((A | B, C)), (0, 1), Join.BLEND, Sum((A + B, C)), (0, 1)),
    ],
)
def test_what_joins_in_another_way_leaves_the_rest_joined(
    tree: Any, path: Any, join: Any, expected: Any, found: Any
) -> None:
    after, there = JoinPrimitive(0, path, join).restructure(tree)
    assert there == found
    assert node_at(after, there) == node_at(tree, path)
    assert join_of(after, there) is join
    if expected is not None:
        assert after == expected


def test_what_is_alone_joins_nothing() -> None:
    for tree, path in ((A, ()), (A.scale(2), (0,))):
        with pytest.raises(InvalidNode, match="alone in its tree"):
            session_of(tree, 5).do(JoinPrimitive(0, path, Join.UNION))
        assert join_of(tree, path) is None


leaves = st.builds(
    lambda at, radius: Point(at, radius=radius),
    st.tuples(*[st.floats(-1, 1, width=16)] * 3),
    st.sampled_from((0.4, 0.7, 1.0)),
)
trees = st.recursive(
    leaves,
    lambda child: st.one_of(
        st.lists(child, min_size=2, max_size=3).map(lambda nodes: Sum(tuple(nodes))),
        st.lists(child, min_size=2, max_size=3).map(lambda nodes: Union(tuple(nodes))),
        st.lists(child, min_size=2, max_size=3).map(lambda nodes: Ricci(tuple(nodes), exponent=SOFTNESS)),
        st.builds(Difference, child, child),
        child.map(lambda node: node.rotate((1, 2, 3), 40).translate((0.2, 0, -0.1))),
    ),
    max_leaves=6,
)
POINTS = np.random.default_rng(0).uniform(-2, 2, (400, 3)).astype(np.float32)
quiet = settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])


@quiet
@given(tree=trees, choice=st.integers(0, 99))
def test_without_a_primitive_the_field_is_as_if_that_were_far_away(tree: Any, choice: Any) -> None:
    paths = primitive_paths(tree)
    path = paths[choice % len(paths)]
    far = with_node(tree, path, moved(node_at(tree, path), (1000, 0, 0)))
    try:
        rest = remove_branch(tree, path)
    except InvalidNode:
        assert not far(POINTS).any()
    else:
        np.testing.assert_allclose(rest(POINTS), far(POINTS), atol=2e-6)


@quiet
@given(tree=trees, choice=st.integers(0, 99), other=st.sampled_from(Join))
def test_another_way_and_back_is_the_same_field(tree: Any, choice: Any, other: Any) -> None:
    paths = primitive_paths(tree)
    path = paths[choice % len(paths)]
    join = join_of(tree, path)
    assume(join is not None)
    assert join is not None
    between, there = JoinPrimitive(0, path, other).restructure(tree)
    assert node_at(between, there) == node_at(tree, path)
    after, back = JoinPrimitive(0, there, join).restructure(between)
    assert join_of(after, back) is join
    np.testing.assert_allclose(after(POINTS), tree(POINTS), atol=5e-6)


@quiet
@given(tree=trees, choice=st.integers(0, 99))
def test_a_copy_and_a_new_primitive_lie_at_the_given_place(tree: Any, choice: Any) -> None:
    paths = primitive_paths(tree)
    path = paths[choice % len(paths)]
    after, there = DuplicatePrimitive(0, path, (0.5, 0.25, 0)).restructure(tree)
    one, other = node_in_world(tree, path), node_in_world(after, there)
    offset = np.array([0.5, 0.25, 0], np.float32)
    np.testing.assert_allclose(other(POINTS + offset), one(POINTS), atol=5e-5)
    after, there = AddPrimitive(0, world_space_path(tree, path), D).restructure(tree)
    np.testing.assert_array_equal(node_in_world(after, there)(POINTS), D(POINTS))


def test_the_primitive_that_shows_is_the_tool_in_a_hole() -> None:
    tree = A - Point((0, 0, 1), radius=0.5) - B
    assert dominant_primitive(tree, (0, 0, 0.5)) == (0, 1)
    assert dominant_primitive(tree, (0.7, 0, 0)) == (1,)
    assert dominant_primitive(tree, (-1, 0, 0)) == (0, 0)
    assert dominant_primitive(A + B, (2.1, 0, 0)) == (1,)
    assert dominant_primitive(A | C, (9, 9, 9)) in ((0,), (1,))


def on_surface(session: Any) -> Any:
    decals, tree = session.document.decals.decals, session.document.objects[0].tree
    return np.abs(tree(decals.positions) - ISO)


def test_decals_come_up_to_what_is_added_and_undo_gives_all_back() -> None:
    session = session_of(A, 120)
    first = digest(session.document)
    session.do(AddPrimitive(0, (), Point((0, 0, 1), radius=0.4)))
    assert len(session.document.decals) == 120
    assert on_surface(session).max() < 1e-4
    assert session.document.decals.decals.positions[:, 2].max() > 1.1
    session.undo()
    assert digest(session.document) == first


def test_decals_go_with_what_they_lay_on_and_come_down_where_it_is_near() -> None:
    far = Point((3, 0, 0), radius=0.8)
    session = session_of(A + far, 160)
    first, decals = digest(session.document), session.document.decals.decals
    on_far = decals.positions[:, 0] > 2
    session.do(RemovePrimitive(0, (1,)))
    np.testing.assert_array_equal(session.document.decals.numbers, np.flatnonzero(~on_far))
    np.testing.assert_array_equal(session.document.decals.decals.positions, decals.positions[~on_far])
    session.undo()
    assert digest(session.document) == first


def test_the_decals_of_what_becomes_a_tool_go_and_the_others_stay_on_the_surface() -> None:
    session = session_of(A + B, 200)
    before = session.document.decals.decals.positions
    session.do(JoinPrimitive(0, (1,), Join.DIFFERENCE))
    numbers = session.document.decals.numbers
    assert 50 < len(numbers) < 200
    gone = np.setdiff1d(np.arange(200), numbers)
    assert before[gone, 0].min() > 0.6
    assert on_surface(session).max() < 1e-4


@pytest.fixture(scope="module")
def unchanged() -> EditSession:
    session: EditSession = session_of(A + B, 10)
    return session


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (AddPrimitive(0, (), None), InvalidEdit, "node: expected a Node, got None"),  # type: ignore[arg-type]
        (
            AddPrimitive(0, (), A, "weld"),
            InvalidEdit,
            "join: expected one of 'blend', .*, got 'weld'",
        ),
        (AddPrimitive(0, (7,), A), InvalidNode, "path"),
        (AddPrimitive(0, None, A), InvalidNode, "path"),  # type: ignore[arg-type]
        (AddPrimitive(0, (), Point((0, 0, 0), radius=9), Join.DIFFERENCE), InvalidMesh, "got none"),
        (AddPrimitive(4, (), A), InvalidEdit, "0 to 0, got 4"),
        (RemovePrimitive(0, (3,)), InvalidNode, "path"),
        (RemovePrimitive(0, 5), InvalidNode, "path"),  # type: ignore[arg-type]
        (DuplicatePrimitive(0, (0,), (0, np.nan, 0)), InvalidEdit, "offset"),
        (DuplicatePrimitive(0, "x", (0, 0, 0)), InvalidNode, "path"),  # type: ignore[arg-type]
        (JoinPrimitive(0, (0,), 3), InvalidEdit, "join"),  # type: ignore[arg-type]
        (JoinPrimitive(0, (0, 0), Join.UNION), InvalidNode, "path"),
    ],
)
def test_an_invalid_command_is_refused_and_changes_nothing(
    unchanged: EditSession, command: Any, error: Any, message: Any
) -> None:
    before = digest(unchanged.document)
    with pytest.raises(error, match=message):
        unchanged.do(command)
    assert digest(unchanged.document) == before
