"""Primitives as classes: several radii, own hulls and quantities, and what a class is refused for."""

from dataclasses import KW_ONLY
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import Cone, Point, Primitive, check_kind, formula, par
from blobtree._typing import Float64Array
from blobtree.custom import define_skeleton
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidDefinition
from blobtree.nodes.primitives import Columns
from blobtree.validation import Vector
from tests.blobtree import kernels


class Spindle(Primitive):
    """A round cone, as `Cone`, with the formula of a newcomer."""

    folds_maps = True
    start: Vector = par.point("thick end")
    end: Vector = par.point("thin end")
    _: KW_ONLY
    radius: float = par.radius("visible radius at the thick end")
    end_radius: float = par.radius("visible radius at the thin end")

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        return np.stack([columns["start"], columns["end"]], axis=1)

    @formula
    def closest_with_influence(
        q: wp.vec3, start: wp.vec3, end: wp.vec3, radius: wp.float32, end_radius: wp.float32
    ) -> wp.vec4:
        way = end - start
        length = wp.length(way)
        t = float(0.0)
        if length > 0.0:
            axis = way / length
            x = wp.dot(axis, q - start)
            beside = q - start - axis * x
            k = (end_radius - radius) / length
            s = radius + k * x
            if s > 0.0:
                t = wp.clamp((x + k * wp.dot(beside, beside) / s) / length, 0.0, 1.0)
            elif k > 0.0:
                t = 1.0
        elif end_radius > radius:
            t = 1.0
        c = start + way * t
        return wp.vec4(c[0], c[1], c[2], radius + t * (end_radius - radius))


SPINDLE = Spindle((0, 0, 0), (2, 0, 0), radius=1.0, end_radius=0.5)
CONE = Cone((0, 0, 0), (2, 0, 0), radius=1.0, end_radius=0.5)


def test_a_class_with_two_radii_is_a_cone() -> None:
    def oracle(node: Any, points: Float64Array) -> Float64Array:
        cone = Cone(node.start, node.end, radius=node.radius, end_radius=node.end_radius)
        return cone(points).astype(np.float64)

    assert check_kind(Spindle, oracle, samples=1, show=None).failed == ()
    assert repr(SPINDLE) == repr(CONE).replace("Cone", "Spindle")
    np.testing.assert_array_equal(SPINDLE.support, CONE.support)


def test_maps_fold_into_a_class_that_claims_it() -> None:
    row = Spindle.skeleton
    assert (row.folds_maps, row.parameters) == (True, Cone.skeleton.parameters)
    turned = SPINDLE.rotate((0, 0, 1), 30).offset(0.1) + Point((0, 0, 1), radius=0.5)
    same = CONE.rotate((0, 0, 1), 30).offset(0.1) + Point((0, 0, 1), radius=0.5)
    assert len(turned.tape.data) == len(same.tape.data)


def test_parameters_of_a_class_have_quantities() -> None:
    found = {name: parameter.quantity for name, parameter in parameters_of(Spindle).items()}
    assert found["start"] is Quantity.POINT
    assert (found["radius"], found["end_radius"]) == (Quantity.RADIUS, Quantity.RADIUS)
    assert SPINDLE.values == {"start": (0.0, 0.0, 0.0), "end": (2.0, 0.0, 0.0), "end_radius": 0.5}


def test_a_class_is_what_its_short_form_makes() -> None:
    class Speck(Primitive):
        convex = True

        @formula
        def closest(q: wp.vec3) -> wp.vec3:
            return wp.vec3(0.0, 0.0, 0.0)

    function = Speck._formulas["closest"].python
    assert define_skeleton(function, name="speck", convex=True) is Speck
    assert define_skeleton(function, name="speck") is not Speck


@wp.func
def dot(q: wp.vec3, place: wp.vec3) -> wp.vec3:
    return place


@wp.func
def influential(q: wp.vec3, radius: wp.float32) -> wp.vec4:
    return wp.vec4(0.0, 0.0, 0.0, radius)


PLACE = {"place": par.point("place"), "__annotations__": {"place": Vector}}
META: Any = type(Primitive)
REFUSED = [
    (
        {"closest": formula(dot), "size": par.radius("size"), "__annotations__": {"size": float}},
        "radius: expected it in front of further radii",
    ),
    ({}, "expected a primitive with the formula `closest`"),
    ({"closest": formula(dot)}, "expected the parameters of the class, none, behind the point; got place"),
    ({"closest": formula(kernels.ring), **PLACE}, "got center, axis, size"),
    ({"closest_with_influence": formula(influential)}, "expected the class method `hull`"),
    ({"closest": formula(dot), "lipschitz": formula(dot), **PLACE}, "formula 'lipschitz': expected one of"),
]


@pytest.mark.parametrize(("given", "message"), REFUSED)
def test_wrong_classes_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        META("Refused", (Primitive,), {"__module__": __name__, **given})
