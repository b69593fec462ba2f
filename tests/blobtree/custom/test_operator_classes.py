"""Operators as classes: claims, formulas in place of claims, parameters; what is refused."""

import pickle
from typing import Any

import pytest
import warp as wp

from blobtree import InvalidDefinition, InvalidNode, Node, Operator, Point, formula, from_json, par, to_json
from blobtree.declare.parameters import parameters_of
from blobtree.declare.registry import CUSTOM_KINDS, CustomKind
from decals.editing.new_nodes import new_node


class Share(Operator):
    """The larger field and a part of the smaller one."""

    like = "blend"
    monotone = True
    share: float = par.factor("part of the smaller field", low=0.0, high=1.0, natural=0.25)
    turn: float = par.angle("an angle", low=0.0, high=90.0, default=90.0)

    @formula
    def value(a: wp.float32, b: wp.float32, share: wp.float32, turn: wp.float32) -> wp.float32:
        return wp.max(a, b) + share * wp.sin(wp.radians(turn)) * wp.min(a, b)

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, share: wp.float32, turn: wp.float32) -> wp.float32:
        return 2.0 * (wp.max(rise[0], 0.0) + wp.max(rise[1], 0.0))

    @formula
    def interval(a: wp.vec2, b: wp.vec2, share: wp.float32, turn: wp.float32) -> wp.vec2:
        return wp.vec2(wp.max(a[0], b[0]), 1.0001 * (a[1] + b[1]))

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, share: wp.float32, turn: wp.float32) -> wp.int32:
        if b[1] <= 0.0:
            return 1
        if a[1] <= 0.0:
            return 2
        return 0


LEFT, RIGHT = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)


@pytest.fixture(autouse=True)
def the_name_is_ours() -> None:
    CUSTOM_KINDS["share"] = Share  # another test may have cleared the registry


def test_parameters_are_typed_and_documented() -> None:
    declared = parameters_of(Share)
    assert [(p.low, p.high, p.natural) for p in declared.values()] == [(0.0, 1.0, 0.25), (0.0, 90.0, 90.0)]
    assert "share : float\n    Part of the smaller field, from 0 to 1." in (Share.__doc__ or "")
    node = Share(LEFT, RIGHT, share=0.5)
    assert (node.share, node.turn) == (0.5, 90.0)
    assert new_node("Share", (LEFT, RIGHT)) == Share(LEFT, RIGHT, share=0.25)
    with pytest.raises(InvalidNode, match="share: expected 0 to 1"):
        Share(LEFT, RIGHT, share=2.0)


def test_files_and_pickles_name_the_kind() -> None:
    node: Node = Share(LEFT, RIGHT, share=0.5, turn=30.0)
    assert from_json(to_json(node)) == node
    assert pickle.loads(pickle.dumps(node)) == node
    assert pickle.loads(pickle.dumps(Share)) is Share


def test_formulas_stand_in_the_row_and_not_on_the_node() -> None:
    node = Share(LEFT, RIGHT, share=0.5)
    low, high = node.interval([0.0] * 3, [1.0] * 3)
    assert low <= high
    assert Share.operator.choice is not None
    assert (Share.operator.monotone, Share.operator.commutes) == (True, False)


def _with(name: str, function: Any, **body: Any) -> Any:
    """Define `Share` again with another formula, and other claims."""

    def value(a: wp.float32, b: wp.float32) -> wp.float32:
        return wp.max(a, b)

    formulas = {"value": formula(value), name: formula(function)}
    return CustomKind("Wrong", (Operator,), {"__module__": __name__, "like": "blend", **formulas, **body})


def low_slope(rise: wp.vec2, most: wp.vec2) -> wp.float32:
    return 0.5 * wp.max(rise[0], rise[1])


def low_interval(a: wp.vec2, b: wp.vec2) -> wp.vec2:
    return wp.vec2(0.0, 0.9 * wp.max(a[1], b[1]))


def left_alone(a: wp.vec2, b: wp.vec2) -> wp.int32:
    return 1


def out_of_range(a: wp.vec2, b: wp.vec2) -> wp.int32:
    return 4


def of_numbers(a: wp.float32, b: wp.float32) -> wp.vec2:
    return wp.vec2(a, b)


@pytest.mark.parametrize(
    ("name", "function", "body", "message"),
    [
        ("slope", low_slope, {}, "more than lipschitz"),
        ("slope", low_slope, {"lipschitz": 1.0}, "more than slope"),
        ("interval", low_interval, {"lipschitz": 1.0}, "outside"),
        ("keeps", left_alone, {"lipschitz": 1.0}, "keeps 1, which says"),
        ("keeps", out_of_range, {"lipschitz": 1.0}, "expected 0, 1, 2 or 3"),
        ("interval", of_numbers, {"lipschitz": 1.0}, "interval: expected"),
        ("slope", low_slope, {"lipschitz": -1.0}, "above 0"),
        ("envelope", of_numbers, {"lipschitz": 1.0}, "for operators that read gradients"),
        ("value", of_numbers, {}, "expected it to return wp.float32"),
        ("middle", of_numbers, {}, "expected one of value"),
    ],
)
def test_formulas_that_contradict_the_field_are_refused(
    name: str, function: Any, body: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        _with(name, function, **body)
    assert "wrong" not in CUSTOM_KINDS


def test_fields_need_a_specifier_and_a_free_name() -> None:
    claims = {"__module__": __name__, "lipschitz": 1.0}

    def value(a: wp.float32, b: wp.float32, scale: wp.float32) -> wp.float32:
        return wp.max(a, b)

    for hints, body, message in (
        ({"scale": float}, {"scale": par.factor("a factor")}, "every node of this sort has an attribute"),
        ({"share": float}, {}, "expected a specifier"),
        ({"share": float}, {"share": par.factor("a factor")}, "expected the parameters of the class, share"),
    ):
        body = {**claims, "__annotations__": hints, "value": formula(value), **body}
        with pytest.raises(InvalidDefinition, match=message):
            CustomKind("Wrong", (Operator,), body)
    with pytest.raises(InvalidDefinition, match="the formula `value`"):
        CustomKind("Wrong", (Operator,), claims)
