"""Custom direct fields: values, gradients, bounds, meshes, files, and what a definition is refused for."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import BoxedField, FieldPrimitive, Node, check_kind, formula, from_json, par, to_json
from blobtree._typing import Box, Float32Array, Float64Array
from blobtree.custom import CustomField, define_field
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidDefinition, InvalidFile, InvalidNode, UntranslatableFunction
from blobtree.nodes.primitives import Columns
from blobtree.validation import Vector
from tests.blobtree.custom import field_kernels as kernels
from tests.blobtree.custom_kinds import Lump, Waves
from tests.oracles import direct_fields

LUMP = Lump((0.2, 0.0, 0.1), (3.0, 2.5, 3.0), (0.1, 0.2, 0.0), 0.6, color=(1, 0, 0))
WAVES = Waves((0.2, 0.0, 0.1), (3.0, 2.5, 3.0), 4.0, fade=0.4)
EACH = pytest.mark.parametrize("node", [LUMP, WAVES], ids=["lump", "waves"])


def value(node: Node, points: Float32Array | Float64Array) -> Float64Array:
    """The fields of LUMP and WAVES in float64."""
    assert isinstance(node, CustomField)
    q = points.astype(np.float64) - np.array(node.center)
    if node.kind == "lump":
        field = 1.0 / (
            1.0 + ((q - np.array(node.values["middle"])) ** 2).sum(axis=1) / node.values["breadth"] ** 2
        )
    else:
        rate = node.values["rate"]
        field = 0.5 + 0.25 * (np.sin(rate * q[:, 0]) + np.cos(rate * q[:, 1]))
    result: Float64Array = field * direct_fields.window(node, points.astype(np.float64))
    return result


@EACH
def test_all_laws_hold(node: Node) -> None:
    assert check_kind(type(node), value, sample=lambda _: node, samples=1, show=None).failed == ()


@EACH
def test_files_and_pickles_name_the_kind(node: CustomField) -> None:
    node = replace(node, weight=-0.5, attributes={"age": 3.0})
    assert from_json(to_json(node)) == node == pickle.loads(pickle.dumps(node))
    assert eval(repr(node), {"Lump": Lump, "Waves": Waves}) == node
    with pytest.raises(InvalidFile, match="import the module that defines it"):
        from_json(to_json(node).replace(f'"{node.kind}"'.encode(), b'"nothing"'))


def test_the_same_definition_is_the_same_class() -> None:
    again = define_field(kernels.lump, steepest=kernels.lump_slope, limits={"breadth": (0.1, None)})
    assert again is Lump


def test_parameters_of_a_leaf_are_checked() -> None:
    with pytest.raises(InvalidNode, match=r"breadth: expected a number from 0\.1"):
        Lump((0, 0, 0), (1, 1, 1), (0, 0, 0), 0.0)
    with pytest.raises(InvalidNode, match="offset: expected primitives with a radius, got a Waves"):
        WAVES.offset(0.1).tape  # noqa: B018


@pytest.mark.parametrize(
    ("function", "claims", "message"),
    [
        (kernels.negative, {"steepest": 1.0}, "negative, and a field is not"),
        (kernels.jumping, {"steepest": 1.0}, "claim a larger slope"),
        (kernels.waves, {"steepest": 0.1}, "more than lipschitz = 0.1 allows"),
        (kernels.not_finite, {"steepest": 1.0}, "not_finite: for q = .* it (fails|returns)"),
        (kernels.wrong_gradient, {"steepest": 1.0}, "∂f/∂x at .* by differences, but 1 is returned"),
        (kernels.returns_a_point, {"steepest": 1.0}, "expected it to return wp.float32"),
        (kernels.takes_no_point, {"steepest": 1.0}, "expected the point `q: wp.vec3`"),
        (
            kernels.takes_a_size,
            {"steepest": 1.0},
            "'size': every node of this sort has an attribute of that name",
        ),
        (kernels.imprecise, {"steepest": 2e6}, "in single precision"),
        (kernels.waves, {"steepest": -1.0}, "lipschitz: expected a number from 0"),
        (kernels.waves, {"steepest": float("nan")}, "lipschitz: expected a number from 0"),
        (kernels.waves, {"steepest": "steep"}, "or a typed function, got .steep."),
        (kernels.waves, {"steepest": kernels.of_other_parameters}, "lipschitz: expected a function of"),
        (
            kernels.waves,
            {"steepest": kernels.waves_slope, "interval": kernels.narrow_interval},
            "interval: f.* is not between 0.4 and 0.6",
        ),
        (kernels.waves, {"steepest": 1.0, "interval": kernels.waves_slope}, "expected it to return wp.vec2"),
        ("a wave", {"steepest": 1.0}, "write it with `def`"),
    ],
)
def test_wrong_definitions_are_refused(function: Any, claims: dict[str, Any], message: str) -> None:
    limits = {"rate": (-4.0, 4.0)} if function is kernels.waves else None
    with pytest.raises(InvalidDefinition, match=message):
        define_field(function, **claims, limits=limits, name="refused")


def test_a_function_outside_the_subset_is_refused() -> None:
    with pytest.raises(UntranslatableFunction, match="List expression"):
        define_field(kernels.makes_a_list, steepest=1.0)


def test_a_function_that_raises_is_refused() -> None:
    with pytest.raises(InvalidDefinition, match="divides_by_zero: for q = "):
        define_field(kernels.divides_by_zero, steepest=1.0)


# -- classes -------------------------------------------------------------------------------------------


class Dome(FieldPrimitive):
    """A ball by a parabola, which ends by itself."""

    middle: Vector = par.point("centre")
    reach: float = par.length("distance at which it ends", high=3.0, natural=0.5)

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        return np.concatenate([columns["middle"], 1.0 / columns["reach"]], axis=1)

    @classmethod
    def box(cls, columns: Columns) -> Box:
        return columns["middle"] - columns["reach"], columns["middle"] + columns["reach"]

    @formula
    def value(q: wp.vec3, center: wp.vec3, inverse: wp.float32) -> wp.float32:
        w = (q - center) * inverse
        return wp.max(1.0 - wp.dot(w, w), 0.0)  # type: ignore[no-any-return]

    @formula
    def bounds(ball: wp.vec3, radius: wp.float32, center: wp.vec3, inverse: wp.float32) -> wp.vec3:
        distance = wp.length(ball - center)
        near = wp.max(distance - radius, 0.0) * inverse
        far = (distance + radius) * inverse
        steepest = 2.0 * inverse * wp.min(far, 1.0)
        if near >= 1.0:
            steepest = 0.0
        return wp.vec3(wp.max(1.0 - far * far, 0.0), wp.max(1.0 - near * near, 0.0), steepest)


@pytest.mark.slow
def test_a_field_that_ends_by_itself_keeps_all_laws() -> None:
    def oracle(node: Any, points: Float64Array) -> Float64Array:
        squares = ((points.astype(np.float64) - node.middle) ** 2).sum(axis=1)
        result: Float64Array = np.maximum(1.0 - squares / node.reach**2, 0.0)
        return result

    assert check_kind(Dome, oracle, samples=3, show=None).failed == ()


def test_parameters_of_a_class_have_quantities() -> None:
    declared = parameters_of(Dome)
    assert (declared["middle"].quantity, declared["reach"].quantity) == (Quantity.POINT, Quantity.LENGTH)
    assert [parameter.name for parameter in Dome.parameters] == ["middle", "reach"]
    assert "Distance at which it ends, in model units" in (Dome.__doc__ or "")


def test_a_class_is_what_its_short_form_makes() -> None:
    class Ruffle(BoxedField):
        lipschitz = 1.0

        @formula
        def value_gradient(q: wp.vec3) -> wp.vec4:
            return wp.vec4(0.5 + 0.5 * wp.sin(q[0]), 0.5 * wp.cos(q[0]), 0.0, 0.0)

    function = Ruffle._formulas["value_gradient"].python
    assert define_field(function, steepest=1.0, name="ruffle") is Ruffle
    assert define_field(function, steepest=2.0, name="ruffle") is not Ruffle


def body(function: Any = kernels.lump, **more: Any) -> dict[str, Any]:
    """Return the body of a class with a field."""
    return {"value": formula(function), "__module__": __name__, "lipschitz": 1.0, **more}


REFUSED = [
    (BoxedField, body(), "expected the parameters of the class, none, behind the point; got middle, breadth"),
    (BoxedField, {"__module__": __name__}, "expected a field with the formula `value`"),
    (
        BoxedField,
        {"value": formula(kernels.negative), "__module__": __name__},
        "lipschitz: expected a number",
    ),
    (
        FieldPrimitive,
        {"value": formula(kernels.imprecise), "lipschitz": 2e6, "__module__": __name__},
        "single",
    ),
    (
        BoxedField,
        body(size=par.length("length"), __annotations__={"size": float}),
        "'size': every node of this sort has an attribute of that name",
    ),
    (FieldPrimitive, body(kernels.hill), "expected the class method `box`"),
    (
        FieldPrimitive,
        body(kernels.hill, box=classmethod(lambda _cls, _columns: (np.full((1, 3), -1.0), np.ones((1, 3))))),
        r"box: f\(.*\) = .* outside the box",
    ),
]


@pytest.mark.parametrize(("base", "given", "message"), REFUSED)
def test_wrong_classes_are_refused(base: Any, given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        type(base)("Refused", (base,), given)
