"""Operators as classes: claims, formulas in place of claims, parameters; what is refused."""

import pickle
from typing import Any

import pytest
import warp as wp

from blobtree import Falloff, Node, Operator, Point, Union, formula, from_json, par, to_json
from blobtree.declare.parameters import parameters_of
from blobtree.declare.registry import CUSTOM_KINDS, CustomKind
from blobtree.errors import InvalidDefinition, InvalidNode
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
    with pytest.raises(InvalidDefinition, match="every node of this sort has an attribute"):
        CustomKind("Wrong", (Operator,), {**claims, "operands": par.factor("x"), **_annotated("operands")})
    with pytest.raises(InvalidDefinition, match="'share': expected a type"):
        CustomKind("Wrong", (Operator,), {**claims, "share": par.factor("a factor")})
    with pytest.raises(InvalidDefinition, match="'share': a falloff has no parameters"):
        type("Wrong", (Falloff,), {"__module__": __name__, "share": par.factor("a factor")})
    with pytest.raises(InvalidNode, match="expected a subclass of it"):
        Operator(LEFT, RIGHT)


def _annotated(name: str) -> dict[str, Any]:
    return {"__annotations__": {name: float}}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"low": 2.0, "high": 1.0}, "numbers low ≤ high, got 2.0 and 1.0"),
        ({"low": float("nan")}, "numbers low ≤ high, got nan"),
        ({"high": "x"}, "numbers low ≤ high, got -inf and 'x'"),
        ({"low": 0.0, "high": 1.0, "default": 3.0}, "a share: default: expected 0 to 1, got 3.0"),
        ({"low": 0.0, "natural": -1.0}, "a share: natural: expected a number from 0, got -1.0$"),
        ({"default": "x"}, "default: expected a finite number"),
    ],
)
@pytest.mark.parametrize("specifier", [par.factor, par.angle, par.distance])
def test_impossible_ranges_and_defaults_are_refused(
    specifier: Any, values: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        specifier("a share", **values)
    with pytest.raises(InvalidDefinition, match="expected a description, got 3"):
        specifier(3)


def test_a_subclass_of_a_kind_is_a_kind_with_its_formulas_and_own_claims() -> None:
    class Gentle(Share):
        monotone = False

    node = Gentle(LEFT, RIGHT, share=0.5)
    assert (Gentle.kind, Gentle.operator.monotone, Gentle.operator.like) == ("gentle", False, "blend")
    assert (Share.kind, Share.operator.monotone) == ("share", True)
    assert type(from_json(to_json(node))) is Gentle
    assert node != Share(LEFT, RIGHT, share=0.5)
    larger: Any = CustomKind("Larger", (Union,), {"__module__": __name__})  # one of the core has formulas too
    places = [(0, 0, 0), (0.4, 0.2, 0), (1, 0.5, 0)]
    assert larger(LEFT, RIGHT)(places).tolist() == (LEFT | RIGHT)(places).tolist()
