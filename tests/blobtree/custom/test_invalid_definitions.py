"""What a definition is refused for, before anything is compiled."""

from pathlib import Path as File
from typing import Any

import pytest
import warp as wp

from blobtree import ImplicitDecalsError
from blobtree.custom import define_operator, define_skeleton
from blobtree.declare.registry import CUSTOM_KINDS
from blobtree.errors import InvalidDefinition, UntranslatableFunction
from tests.blobtree import kernels as valid
from tests.blobtree.custom import kernels

REFUSED_SKELETONS = [
    (kernels.no_types, "parameter 'q' lacks its type"),
    (kernels.no_return, "expected it to return wp.vec3, got no annotation"),
    (kernels.returns_a_number, "expected it to return wp.vec3, got wp.float32; annotate it `-> wp.vec3`"),
    (kernels.takes_text, "no type that GLSL knows"),
    (kernels.takes_a_radius, "every node of this sort has an attribute of that name"),
    (kernels.takes_a_scale, "'scale': every node of this sort has an attribute of that name"),
    (kernels.no_place, "expected the point `q: wp.vec3`"),
    (kernels.no_arguments, "expected the point `q: wp.vec3`"),
    (kernels.makes_a_list, "List expression"),
    (kernels.mixes_types, "float and int do not mix"),
    (kernels.calls_python, "sorted is not known"),
    (kernels.turns_in_circles, "calls itself"),
    (kernels.spelled_in_greek, "does not exist in GLSL"),
    (kernels.not_on_it, "for that very point"),
    (kernels.not_the_closest, "is nearer"),
    (kernels.nowhere_in_the_middle, "expected 3 finite numbers"),
    (kernels.single_precision_is_not_enough, "single precision"),
    (kernels.changes_a_constant, r"x = float\(...\)"),
    (kernels.calls_what_changes_a_constant, "a loop changes 'x'"),
    (lambda q: q, "lambda has no types"),
    (print, "write it with `def`"),
    ("a ring", "write it with `def`"),
]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (kernels.calls_what_names_text, "names_text: 'a' is no number"),
        (kernels.has_a_matrix, "has_a_matrix: parameter 'size' has no type"),
        (kernels.chains_comparisons, "chains_comparisons: 0.0 < q[0] < 1.0 joins comparisons"),
        (kernels.miscounts, "miscounts: chains_comparisons_of takes vec3, float, got vec3, int"),
    ],
    ids=["of_a_callee", "of_a_type", "of_an_expression", "of_arguments"],
)
def test_a_refusal_shows_the_names_that_the_user_wrote(function: Any, message: str) -> None:
    with pytest.raises(UntranslatableFunction) as refusal:
        define_skeleton(function)
    text = str(refusal.value)
    assert f": {message}" in text
    assert "custom_" not in text
    assert ".py" not in text.replace("kernels.py", "")  # no file of this package
    assert "'Language of typed functions'" in text


@pytest.mark.parametrize(("function", "message"), REFUSED_SKELETONS)
def test_what_is_no_skeleton_is_refused_before_it_is_compiled(function: Any, message: str) -> None:
    with pytest.raises((InvalidDefinition, UntranslatableFunction), match=message) as refusal:
        define_skeleton(function)
    name = getattr(function, "__name__", "")
    if callable(function) and name not in ("print", "turns_in_circles", "takes_text"):
        assert f"{File(function.__code__.co_filename).name}:" in str(refusal.value)
    assert name not in CUSTOM_KINDS


@pytest.mark.parametrize(
    ("function", "limits"),
    [
        (kernels.endless_line, {"axis": (0.1, None)}),
        (kernels.everywhere_below, None),
        (kernels.half_a_line, None),
    ],
    ids=["line", "half_space", "half_line"],
)
def test_an_unbounded_skeleton_is_refused_when_it_is_defined(function: object, limits: Any) -> None:
    with pytest.raises(InvalidDefinition, match="seems to be unbounded"):
        define_skeleton(function, limits=limits)


def test_a_circle_must_answer_on_its_axis_too() -> None:
    with pytest.raises(InvalidDefinition, match=r"limits=\{'size'"):
        define_skeleton(kernels.off_at_the_axis, limits={"size": (0.5, None)})


@pytest.mark.parametrize("function", [valid.ring, valid.path])
def test_what_is_not_convex_does_not_pass_as_convex(function: Any) -> None:
    limits = {"axis": (1e-3, None), "size": (0.5, None)} if function is valid.ring else None
    with pytest.raises(InvalidDefinition, match=r"convex: .* the middle between"):
        define_skeleton(function, name="bent", convex=True, limits=limits)


def test_a_function_without_source_is_refused() -> None:
    scope: dict[str, object] = {"wp": wp}
    exec("def hidden(q: wp.vec3) -> wp.vec3:\n    return q * 0.0\n", scope)
    with pytest.raises(InvalidDefinition, match="its source cannot be read"):
        define_skeleton(scope["hidden"])


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"size": (2.0, 1.0)}, "expected .smallest or None"),
        ({"size": 3.0}, "expected .smallest or None"),
        ({"size": (float("nan"), None)}, "expected .smallest or None"),
        ({"length": (0.0, 1.0)}, "it has no parameter 'length'"),
        ([1], "limits: expected .parameter"),
        ("x", "limits: expected .parameter"),
    ],
)
def test_senseless_limits_are_refused(limits: dict[str, tuple[float, float]], message: str) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        define_skeleton(valid.ring, limits=limits)


@pytest.mark.parametrize("name", ["", "two words", "ümlaut", "a__b", "1st", "_x", 5, ["x"]])
def test_senseless_names_are_refused(name: Any) -> None:
    with pytest.raises(InvalidDefinition, match="name: expected"):
        define_skeleton(valid.brick, name=name)


@pytest.mark.parametrize("function", [kernels.never_ends, kernels.counts_too_far])
def test_loops_without_end_are_refused_and_not_waited_for(function: Any) -> None:
    with pytest.raises(
        InvalidDefinition, match=r"the loop in line \d+ takes more than 65,535 turns"
    ) as refusal:
        define_skeleton(function)
    line = function.__code__.co_firstlineno + 1
    assert f"the loop in line {line} " in str(refusal.value)


REFUSED_OPERATORS = [
    (kernels.negative, {}, "is negative"),
    (kernels.never_empty, {}, "where both operands are absent"),
    (kernels.wrong_partials, {}, "by differences"),
    (kernels.jumps, {}, "farther apart than lipschitz"),
    (kernels.vanishes_in_single_precision, {"like": "blend"}, "finite numbers"),
    (kernels.takes_a_vector, {}, "parameters of type wp.float32"),
    (kernels.plus, {"steepest": 0.9}, "more than lipschitz"),
    (kernels.plus, {"steepest": 0.0}, "expected a number above 0"),
    (kernels.plus, {"steepest": "much"}, "expected a finite number"),
    (kernels.plus, {"steepest": kernels.one_number}, "expected it to return wp.vec2"),
    (kernels.plus, {"steepest": kernels.another_bound}, "of the same types as plus"),
    (kernels.plus, {"like": "intersection"}, "like='intersection' says 0"),
    (kernels.plus, {"like": "difference"}, "like='difference' says 0"),
    (kernels.plus, {"like": "sum"}, "like: expected one of 'blend'"),
    (kernels.plus, {"like": "difference", "order_free": True}, "depends on the order"),
    (valid.mean, {"order_free": True}, "associative: with a, b, c"),
    (valid.carve, {"steepest": valid.carve_steepest, "order_free": True}, "associative: F"),
    (valid.carve, {"steepest": valid.carve_steepest, "monotone": True}, "monotone: F"),
    (valid.carve, {"steepest": 1.0}, "more than lipschitz"),
    (valid.soft, {}, "finite numbers"),
]


@pytest.mark.parametrize(("function", "claims", "message"), REFUSED_OPERATORS)
def test_an_operator_that_is_not_what_it_claims_is_refused(
    function: Any, claims: dict[str, Any], message: str
) -> None:
    with pytest.raises(ImplicitDecalsError, match=message):
        define_operator(function, name="refused", **{"steepest": 1.0, **claims})
    assert "refused" not in CUSTOM_KINDS
