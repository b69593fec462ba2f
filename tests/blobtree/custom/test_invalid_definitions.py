"""What a definition is refused for, before anything is compiled."""

from pathlib import Path as File
from typing import Any

import pytest
import warp as wp

from blobtree import (
    ImplicitDecalsError,
    InvalidDefinition,
    UntranslatableFunction,
    define_operator,
    define_skeleton,
)
from blobtree.custom import definition as registry
from tests.blobtree import custom_kinds

HERE = File(__file__).name


def no_types(q, center):
    return center


def no_return(q: wp.vec3):
    return q


def returns_a_number(q: wp.vec3) -> wp.float32:
    return q[0]


def takes_text(q: wp.vec3, label: str) -> wp.vec3:
    return q


def takes_a_radius(q: wp.vec3, radius: wp.float32) -> wp.vec3:
    return q * 0.0


def takes_a_scale(q: wp.vec3, scale: wp.float32) -> wp.vec3:
    return q * 0.0


def no_place(size: wp.float32) -> wp.vec3:
    return wp.vec3(size, 0.0, 0.0)


def no_arguments() -> wp.vec3:
    return wp.vec3(0.0, 0.0, 0.0)


def makes_a_list(q: wp.vec3) -> wp.vec3:
    parts = [q[0], q[1]]
    return wp.vec3(parts[0], parts[1], 0.0)


def mixes_types(q: wp.vec3) -> wp.vec3:
    x = q[0] * 2
    return wp.vec3(x, 0.0, 0.0)


def calls_python(q: wp.vec3) -> wp.vec3:
    return sorted(q)


@wp.func
def turns_in_circles(q: wp.vec3) -> wp.vec3:
    return turns_in_circles(q)


def spelled_in_greek(q: wp.vec3, λ: wp.float32) -> wp.vec3:
    return q * 0.0


def not_on_it(q: wp.vec3) -> wp.vec3:
    return q * 0.5


def not_the_closest(q: wp.vec3) -> wp.vec3:
    if q[1] > 0.5:
        return wp.vec3(-1.0, 1.0, 0.0)
    return wp.vec3(1.0, 0.0, 0.0)


def nowhere_in_the_middle(q: wp.vec3) -> wp.vec3:
    return q / wp.length(q)


def single_precision_is_not_enough(q: wp.vec3) -> wp.vec3:
    far = wp.vec3(1.0e6, 0.0, 0.0)
    return (q + far) * 0.0 + wp.vec3(((q[0] + 1.0e7) - 1.0e7) - q[0], 0.0, 0.0)


def changes_a_constant(q: wp.vec3) -> wp.vec3:
    x = 0.0
    for _i in range(40):
        x += 0.1
    return wp.vec3(x, 0.0, 0.0)


@wp.func
def changes_one_below(q: wp.vec3) -> wp.vec3:
    x = -1.0
    while x < q[0]:
        x = x + 1.0
    return wp.vec3(x, 0.0, 0.0)


def calls_what_changes_a_constant(q: wp.vec3) -> wp.vec3:
    return changes_one_below(q) * 0.0


def off_at_the_axis(q: wp.vec3, size: wp.float32) -> wp.vec3:
    flat = wp.vec3(q[0], q[1], 0.0)
    return wp.normalize(flat) * size


REFUSED_SKELETONS = [
    (no_types, "parameter 'q' lacks its type"),
    (no_return, "expected it to return wp.vec3"),
    (returns_a_number, "expected it to return wp.vec3"),
    (takes_text, "no type that GLSL knows"),
    (takes_a_radius, "every node has an attribute of that name"),
    (takes_a_scale, "'scale': every node has an attribute of that name"),
    (no_place, "expected the query point `q: wp.vec3`"),
    (no_arguments, "expected the query point `q: wp.vec3`"),
    (makes_a_list, "List expression"),
    (mixes_types, "float and int do not mix"),
    (calls_python, "sorted is not known"),
    (turns_in_circles, "calls itself"),
    (spelled_in_greek, "does not exist in GLSL"),
    (not_on_it, "for that very point"),
    (not_the_closest, "is nearer"),
    (nowhere_in_the_middle, "expected 3 finite numbers"),
    (single_precision_is_not_enough, "single precision"),
    (changes_a_constant, r"x = float\(...\)"),
    (calls_what_changes_a_constant, "a loop changes 'x'"),
    (lambda q: q, "lambda has no types"),
    (print, "write it with `def`"),
    ("a ring", "write it with `def`"),
]


@wp.func
def names_text(q: wp.vec3) -> wp.vec3:
    text = "a"
    return q * text


def calls_what_names_text(q: wp.vec3) -> wp.vec3:
    return names_text(q)


def has_a_matrix(q: wp.vec3, size: wp.mat33) -> wp.vec3:
    return size * q


def chains_comparisons(q: wp.vec3) -> wp.vec3:
    if 0.0 < q[0] < 1.0:
        return q * 0.0
    return q


def miscounts(q: wp.vec3) -> wp.vec3:
    return chains_comparisons_of(q, 1)


@wp.func
def chains_comparisons_of(q: wp.vec3, x: wp.float32) -> wp.vec3:
    return q * x


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (calls_what_names_text, "names_text: 'a' is no number"),
        (has_a_matrix, "has_a_matrix: parameter 'size' has no type"),
        (chains_comparisons, "chains_comparisons: 0.0 < q[0] < 1.0 joins comparisons"),
        (miscounts, "miscounts: chains_comparisons_of takes vec3, float, got vec3, int"),
    ],
    ids=["of_a_callee", "of_a_type", "of_an_expression", "of_arguments"],
)
def test_a_refusal_shows_the_names_that_the_user_wrote(function: object, message: str) -> None:
    with pytest.raises(UntranslatableFunction) as refusal:
        define_skeleton(function)
    text = str(refusal.value)
    assert f": {message}" in text
    assert "custom_" not in text
    assert ".py" not in text.replace(HERE, "")  # no file of this package
    assert "'Language of typed functions'" in text


@pytest.mark.parametrize(("function", "message"), REFUSED_SKELETONS)
def test_what_is_no_skeleton_is_refused_before_it_is_compiled(function: object, message: str) -> None:
    with pytest.raises((InvalidDefinition, UntranslatableFunction), match=message) as refusal:
        define_skeleton(function)
    name = getattr(function, "__name__", "")
    if callable(function) and name not in ("print", "turns_in_circles", "takes_text"):
        assert f"{HERE}:" in str(refusal.value)
    assert registry.registered(name) is None


def endless_line(q: wp.vec3, axis: wp.vec3) -> wp.vec3:
    n = wp.normalize(axis)
    return n * wp.dot(q, n)


def everywhere_below(q: wp.vec3) -> wp.vec3:
    return wp.vec3(q[0], q[1], wp.min(q[2], 1.0))


def half_a_line(q: wp.vec3) -> wp.vec3:
    return wp.vec3(0.0, wp.max(q[1], 0.0), 0.0)


@pytest.mark.parametrize(
    ("function", "limits"),
    [(endless_line, {"axis": (0.1, None)}), (everywhere_below, None), (half_a_line, None)],
    ids=["line", "half_space", "half_line"],
)
def test_an_unbounded_skeleton_is_refused_when_it_is_defined(function: object, limits: Any) -> None:
    with pytest.raises(InvalidDefinition, match="seems to be unbounded"):
        define_skeleton(function, limits=limits)


def test_a_circle_must_answer_on_its_axis_too() -> None:
    with pytest.raises(InvalidDefinition, match=r"limits=\{'size'"):
        define_skeleton(off_at_the_axis, limits={"size": (0.5, None)})


@pytest.mark.parametrize("function", [custom_kinds.ring, custom_kinds.path])
def test_what_is_not_convex_does_not_pass_as_convex(function: object) -> None:
    limits = {"axis": (1e-3, None), "size": (0.5, None)} if function is custom_kinds.ring else None
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
        define_skeleton(custom_kinds.ring, limits=limits)


@pytest.mark.parametrize("name", ["", "two words", "ümlaut", "a__b", "1st", "_x", 5, ["x"]])
def test_senseless_names_are_refused(name: object) -> None:
    with pytest.raises(InvalidDefinition, match="name: expected"):
        define_skeleton(custom_kinds.brick, name=name)


def never_ends(q: wp.vec3) -> wp.vec3:
    while True:
        q = q * 0.5
    return q


def counts_too_far(q: wp.vec3) -> wp.vec3:
    for _i in range(2000000000):
        q = q * 1.0
    return q


@pytest.mark.parametrize("function", [never_ends, counts_too_far])
def test_loops_without_end_are_refused_and_not_waited_for(function: object) -> None:
    with pytest.raises(
        InvalidDefinition, match=r"the loop in line \d+ takes more than 65,535 turns"
    ) as refusal:
        define_skeleton(function)
    line = function.__code__.co_firstlineno + 1
    assert f"the loop in line {line} " in str(refusal.value)


def negative(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a - b, 1.0, -1.0)


def never_empty(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a + b + 0.1, 1.0, 1.0)


def wrong_partials(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a + b, 1.0, 0.5)


def jumps(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(0.25 * wp.floor(4.0 * (a + b)), 0.0, 0.0)


def vanishes_in_single_precision(a: wp.float32, b: wp.float32) -> wp.vec3:
    f = wp.sqrt(a * a + b * b)
    return wp.vec3(f, a / f, b / f)


def takes_two_parameters(a: wp.float32, b: wp.float32, c: wp.float32, d: wp.float32) -> wp.vec3:
    return wp.vec3(a + b, 1.0, 1.0)


def takes_a_vector(a: wp.float32, b: wp.vec2) -> wp.vec3:
    return wp.vec3(a, 1.0, 0.0)


def plus(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a + b, 1.0, 1.0)


def one_number(a: wp.float32, b: wp.float32) -> wp.float32:
    return 1.0


def another_bound(a: wp.float32) -> wp.vec2:
    return wp.vec2(1.0, 1.0)


REFUSED_OPERATORS = [
    (negative, {}, "is negative"),
    (never_empty, {}, "where both operands are absent"),
    (wrong_partials, {}, "by differences"),
    (jumps, {}, "farther apart than steepest"),
    (vanishes_in_single_precision, {"like": "blend"}, "finite numbers"),
    (takes_two_parameters, {}, "at most one wp.float32 more"),
    (takes_a_vector, {}, "at most one wp.float32 more"),
    (plus, {"steepest": 0.9}, "more than steepest"),
    (plus, {"steepest": 0.0}, "expected a number above 0"),
    (plus, {"steepest": "much"}, "expected a finite number"),
    (plus, {"steepest": one_number}, "expected it to return wp.vec2"),
    (plus, {"steepest": another_bound}, "of the same types as plus"),
    (plus, {"like": "intersection"}, "like='intersection' says 0"),
    (plus, {"like": "difference"}, "like='difference' says 0"),
    (plus, {"like": "sum"}, "like: expected one of 'blend'"),
    (plus, {"like": "difference", "order_free": True}, "depends on the order"),
    (custom_kinds.mean, {"order_free": True}, "order_free: with a, b, c"),
    (custom_kinds.carve, {"steepest": custom_kinds.carve_steepest, "order_free": True}, "order_free: F"),
    (custom_kinds.carve, {"steepest": custom_kinds.carve_steepest, "monotone": True}, "monotone: F"),
    (custom_kinds.carve, {"steepest": 1.0}, "more than steepest"),
    (custom_kinds.soft, {}, "finite numbers"),
]


@pytest.mark.parametrize(("function", "claims", "message"), REFUSED_OPERATORS)
def test_an_operator_that_is_not_what_it_claims_is_refused(
    function: object, claims: dict[str, object], message: str
) -> None:
    with pytest.raises(ImplicitDecalsError, match=message):
        define_operator(function, name="refused", **{"steepest": 1.0, **claims})
    assert registry.registered("refused") is None
