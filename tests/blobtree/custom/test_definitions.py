"""What a definition gives; files and other processes."""

import pickle
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest
import warp as wp

import blobtree
from blobtree import Point, from_json, to_json
from blobtree.custom import (
    CustomCombination,
    CustomPrimitive,
    define_falloff,
    define_operator,
    define_skeleton,
)
from blobtree.declare.registry import CUSTOM_KINDS, CustomKind
from blobtree.errors import InvalidDefinition, InvalidFile, InvalidNode, UnknownKind
from blobtree.transpile.python import plain_python
from tests.blobtree import custom_kinds, kernels
from tests.blobtree.custom_kinds import CUSTOM_TREES, SOFTEST, Carve, Mean, Ring, Soft, Swell, Tent
from tests.blobtree.transpile.warp_functions import python_function
from tests.programs import output_of

PUBLIC = {name: getattr(blobtree, name) for name in blobtree.__all__}

BALL = Point((0, 0, 0), radius=1.0)
RING_DOC = "A circle of radius `size` around `axis`."


@pytest.fixture(autouse=True)
def names_are_ours() -> None:
    """Another test's definitions may have taken the names of these kinds."""
    for kind in vars(custom_kinds).values():
        if isinstance(kind, CustomKind) and "kind" in vars(kind):
            CUSTOM_KINDS[kind.kind] = kind


def test_a_definition_gives_a_node_class() -> None:
    assert issubclass(Ring, CustomPrimitive)
    assert issubclass(Soft, CustomCombination)
    assert (Ring.__name__, Ring.kind) == ("Ring", "ring")
    assert (Ring.__doc__ or "").startswith(RING_DOC)
    ring = Ring((0, 0, 0), axis=(0, 0, 2), size=1, radius=0.5)
    assert repr(ring) == (
        "Ring(center=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0), size=1.0, radius=0.5, color=(0.8, 0.8, 0.8))"
    )
    assert repr(Soft((BALL, ring), 2)) == f"Soft(operands=({BALL!r}, {ring!r}), hardness=2.0)"
    assert ring == Ring((0, 0, 0), (0, 0, 2), 1.0, radius=0.5)
    assert len({ring, Ring((0, 0, 0), (0, 0, 2), 1.0, radius=0.5), ring.offset(0.1)}) == 2
    assert str(Carve((BALL, ring))).splitlines()[0] == "Carve()"


def test_trees_of_own_kinds_are_what_their_repr_says() -> None:
    for tree in CUSTOM_TREES[:40]:
        assert eval(repr(tree), PUBLIC | vars(custom_kinds)) == tree


def test_the_same_definition_twice_is_one_kind_and_another_one_takes_its_name() -> None:
    def spot(q: wp.vec3, place: wp.vec3) -> wp.vec3:
        return place

    first, same = define_skeleton(spot), define_skeleton(spot)
    assert first is same
    other = define_skeleton(spot, limits={"place": (0.0, 5.0)})
    assert other is not first
    assert CUSTOM_KINDS.find("spot") is other
    both = first((0, 0, 0), radius=1.0) + other((1, 0, 0), radius=1.0)
    plain = Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=1.0)
    assert len(both.tape.skeletons) == 2
    assert both([[0.5, 0.2, 0]]) == pytest.approx(plain([[0.5, 0.2, 0]]))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Ring((0, 0, 0), (0, 0, 0), 1.0, radius=0.2),
        lambda: Ring((0, 0, 0), (0, 0, 1), -1.0, radius=0.2),
        lambda: Ring((0, 0, 0), (0, 0, 1), float("nan"), radius=0.2),
        lambda: Ring((0, 0), (0, 0, 1), 1.0, radius=0.2),
        lambda: Ring(0.0, (0, 0, 1), 1.0, radius=0.2),
        lambda: Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.0),
        lambda: Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2, color=(2, 0, 0)),
        lambda: Soft((BALL, BALL), SOFTEST + 1.0),
        lambda: Soft((BALL, BALL), "hard"),  # type: ignore[arg-type]
        lambda: Soft((BALL,), 1.0),
        lambda: Soft((BALL, BALL, BALL), 1.0),
        lambda: Soft(BALL, 1.0),
        lambda: Mean((BALL, 3)),  # type: ignore[arg-type]
        lambda: Swell(()),
    ],
)
def test_nodes_of_wrong_parameters_are_refused(make: Any) -> None:
    with pytest.raises(InvalidNode):
        make()


def test_an_order_free_operator_takes_any_number_of_operands() -> None:
    balls = [Point((x, 0, 0), radius=1.0) for x in (0.0, 0.5, 1.0)]
    value = float(Swell(tuple(balls))([[0.5, 0.3, 0]])[0])
    assert value == pytest.approx(sum(float(ball([[0.5, 0.3, 0]])[0]) ** 2 for ball in balls) ** 0.5)
    assert Swell((balls[0],))([[0.5, 0.3, 0]]) == balls[0]([[0.5, 0.3, 0]])


def test_derivatives_that_are_not_given_are_derived() -> None:
    claims: dict[str, Any] = {"like": "blend", "monotone": True, "limits": {"hardness": (0.0, SOFTEST)}}
    alone = define_operator(kernels.soft_alone, steepest=1.0, **claims)
    given, made = (plain_python(python_function(kind.operator.partials)) for kind in (Soft, alone))
    rng = np.random.default_rng(4)
    absent = [(0.0, 0.7, 1.0), (0.7, 0.0, 1.0), (0.0, 0.0, 1.0)]
    for a, b, hardness in [*rng.uniform(0.0, 1.0, (200, 3)), *absent]:
        np.testing.assert_allclose(made(a, b, hardness), given(a, b, hardness), atol=1e-14)
    tent = define_falloff(kernels.tent, name="tent_alone")
    assert (tent.rim, tent.steepest_slope) == (Tent.rim, Tent.steepest_slope)
    slope = plain_python(python_function(tent.slope))
    assert {slope(d) for d in np.linspace(0.0, 1.0, 9)} == {-1.0}


def test_wrong_functions_without_derivatives_are_refused() -> None:
    limits = {"hardness": (0.1, 1.0)}
    with pytest.raises(InvalidDefinition, match=r"more than lipschitz = 0\.1"):
        define_operator(kernels.soft_alone, steepest=0.1, like="blend", limits=limits)
    with pytest.raises(InvalidDefinition, match="but like='intersection' says 0"):
        define_operator(kernels.soft_alone, steepest=1.0, like="intersection", limits=limits)


def test_a_skeleton_that_the_checks_took_for_bounded_is_refused_with_its_box() -> None:
    def high_plane(q: wp.vec3, height: wp.float32) -> wp.vec3:
        if height > 50.0:
            return wp.vec3(q[0], q[1], height)
        return wp.vec3(0.0, 0.0, height)

    plane = define_skeleton(high_plane)(60.0, radius=0.1)
    with pytest.raises(InvalidNode, match="a skeleton must be bounded"):
        plane.support  # noqa: B018


def test_files_and_pickles_give_the_tree_back() -> None:
    for tree in CUSTOM_TREES[:30]:
        assert from_json(to_json(tree)) == tree
        assert pickle.loads(pickle.dumps(tree)) == tree


def test_a_file_of_an_unknown_kind_says_which_and_what_to_do() -> None:
    text = to_json(Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)).replace(b'"ring"', b'"wreath"')
    with pytest.raises(InvalidFile, match=r"nodes\[0\].*'wreath' is not defined.*import the module"):
        from_json(text)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (b'"size": 1.0', b'"length": 1.0', r"has the parameters \['axis', 'center', 'size'\]"),
        (b'"size": 1.0', b'"size": -1.0', "size: expected a number from 0"),
        (b'"size": 1.0', b'"size": "wide"', "not a BlobTree"),
        (b'"size": 1.0', b'"size": [1, 2, 3]', "size: expected a finite number"),
        (b'"kind": "ring"', b'"kind": "soft"', "is defined as Operator, not Primitive"),
    ],
)
def test_a_file_that_does_not_fit_the_definition_is_refused(
    before: bytes, after: bytes, message: str
) -> None:
    text = to_json(Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2))
    assert before in text
    with pytest.raises(InvalidFile, match=message):
        from_json(text.replace(before, after))


MODULE = """\
import warp as wp
from blobtree.custom import define_skeleton


def dot(q: wp.vec3, place: wp.vec3) -> wp.vec3:
    return place


Dot = define_skeleton(dot)
"""
READ = """\
import pickle, sys
try:
    print(pickle.loads(bytes.fromhex(sys.argv[1])))
except Exception as error:
    print(type(error).__name__, error)
"""


def test_another_process_imports_the_definition_or_says_that_it_cannot(
    tmp_path: File, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "dots.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    import dots  # type: ignore[import-not-found]

    tree = dots.Dot((1, 2, 3), radius=0.5) + BALL
    pickled = pickle.dumps(tree).hex()
    there = output_of(READ, pickled, cwd=tmp_path)
    assert there.splitlines()[1].strip() == "Dot(place=(1.0, 2.0, 3.0), radius=0.5, color=(0.8, 0.8, 0.8))"
    (tmp_path / "dots.py").unlink()
    gone = output_of(READ, pickled, cwd=tmp_path)
    assert gone.startswith("UnknownKind")
    assert "'dot': its module 'dots' cannot be imported" in gone


def test_a_kind_that_nobody_defined() -> None:
    with pytest.raises(UnknownKind, match="'hexagon' is not defined in this process"):
        CUSTOM_KINDS.find("hexagon")
