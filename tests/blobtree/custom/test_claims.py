"""Claims of users' kinds: misspelt ones are refused, for every sort of kinds; bases make no nodes."""

import pickle
from typing import Any

import pytest
import warp as wp

from blobtree import BoxedField, Falloff, FieldPrimitive, Operator, Point, Primitive, Warp, formula, par
from blobtree.errors import InvalidDefinition, InvalidNode, UnknownKind
from blobtree.validation import Vector

CLAIMS: dict[Any, tuple[str, ...]] = {
    Operator: ("like", "monotone", "associative", "lipschitz", "paints"),
    FieldPrimitive: ("lipschitz", "trial_extent"),
    Warp: ("lipschitz", "motion", "trial_extent"),
    Primitive: ("convex", "folds_maps", "cells"),
}
METHODS: dict[Any, str] = {FieldPrimitive: "numbers", Warp: "outer_box", Primitive: "hull"}


def share_of(a: wp.float32, b: wp.float32, share: wp.float32) -> wp.float32:
    return (1.0 - share) * a + share * b  # type: ignore[no-any-return]


def part_of(a: wp.float32, b: wp.float32, part: wp.float32) -> wp.float32:
    return (1.0 - part) * a + part * b  # type: ignore[no-any-return]


def ramp(d: wp.float32) -> wp.float32:
    return 1.0 - d  # type: ignore[no-any-return]


BALL = Point((0, 0, 0), radius=1.0)


def misspelt(name: str) -> set[str]:
    """Names in which two letters are swapped, or one is missing or doubled."""
    places = range(1, len(name) - 1)
    swapped = {name[:i] + name[i + 1] + name[i] + name[i + 2 :] for i in places}
    shorter = {name[:i] + name[i + 1 :] for i in places}
    return (swapped | shorter | {name[:i] + name[i - 1 :] for i in places}) - {name}


def body_with(name: str, value: object) -> dict[str, Any]:
    return {"__module__": __name__, name: value}


@pytest.mark.parametrize("base", CLAIMS)
def test_misspelt_claims_are_refused(base: Any) -> None:
    for claim in CLAIMS[base]:
        for name in misspelt(claim):
            with pytest.raises(InvalidDefinition, match=f"Kind: '{name}' is no claim of .* underscore"):
                type(base)("Kind", (base,), body_with(name, 1.0))
    if base in METHODS:
        for name in misspelt(METHODS[base]):
            with pytest.raises(InvalidDefinition, match=f"'{name}' is no claim of .*did you mean"):
                type(base)("Kind", (base,), body_with(name, classmethod(lambda _cls: 0)))
    with pytest.raises(InvalidDefinition, match="'steep' is no claim of a falloff"):
        type("Kind", (Falloff,), {**body_with("steep", 2.0), "value": formula(ramp)})


def test_a_class_may_have_names_of_its_own() -> None:
    class Speck(Primitive):
        _note = "private"
        COUNT = 3
        place: Vector = par.point("place")

        @property
        def doubled(self) -> float:
            return 2.0 * self.radius

        @classmethod
        def at_origin(cls) -> "Speck":
            return cls((0, 0, 0), radius=1.0)

        @formula
        def closest(q: wp.vec3, place: wp.vec3) -> wp.vec3:
            return place

    assert (Speck.at_origin().doubled, Speck.COUNT) == (2.0, 3)


@pytest.mark.parametrize("base", [*CLAIMS, BoxedField])
def test_a_base_without_formulas_makes_no_node(base: Any) -> None:
    for arguments in ((), (BALL,), (BALL, BALL)):
        with pytest.raises(InvalidNode, match=f"{base.__name__}: expected a subclass of it with the formula"):
            base(*arguments)


def mixture(**body: Any) -> Any:
    """Define an operator of this one name."""
    base: Any = Operator
    return type(base)("Mixture", (Operator,), {"__module__": __name__, "lipschitz": 1.0, **body})


def test_a_pickle_of_a_kind_that_was_defined_anew() -> None:
    def declared(name: str, high: float) -> dict[str, Any]:
        return {name: par.factor("share", low=0.0, high=high), "__annotations__": {name: float}}

    old = mixture(value=formula(share_of), **declared("share", 1.0))
    pickled = pickle.dumps(old(BALL, BALL, share=0.75))
    same = mixture(value=formula(share_of), **declared("share", 0.9))
    assert type(pickle.loads(pickled)) is same
    mixture(value=formula(share_of), **declared("share", 0.5))
    with pytest.raises(InvalidNode, match=r"share: expected 0 to 0\.5"):
        pickle.loads(pickled)
    mixture(value=formula(part_of), **declared("part", 1.0))
    with pytest.raises(UnknownKind, match=r"Mixture: expected .* part, got share, .*another definition"):
        pickle.loads(pickled)
