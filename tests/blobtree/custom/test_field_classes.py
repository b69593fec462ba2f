"""Fields as classes: what the short form cannot state, and what a class is refused for."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import BoxedField, FieldPrimitive, check_kind, formula, par
from blobtree._typing import Box, Float64Array
from blobtree.custom import define_field
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidDefinition
from blobtree.nodes.primitives import Columns
from blobtree.validation import Vector
from tests.blobtree.custom import field_kernels as kernels


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
