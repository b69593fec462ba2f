"""Formulas of lessons: their values are those of Python, and they can only name measures."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.formulas import MAX_LENGTH, Measure, parse

MEASURES = {
    "two": Measure(lambda scope: 2.0, ()),
    "double": Measure(lambda scope, a: 2.0 * a, ("number",)),
    "later": Measure(lambda scope, formula: formula({"x": 10.0}), ("formula",)),
}

numbers = st.floats(-1e3, 1e3, allow_nan=False).map(lambda value: f"({value!r})")
arithmetic = st.recursive(
    numbers,
    lambda inner: st.tuples(inner, st.sampled_from(["+", "-", "*", "<", "<=", ">", "!="]), inner).map(
        lambda parts: f"({parts[0]} {parts[1]} {parts[2]})"
    ),
    max_leaves=6,
)


@settings(max_examples=40)
@given(arithmetic)
def test_arithmetic_is_that_of_python(text: str) -> None:
    if len(text) <= MAX_LENGTH:
        assert float(parse(text, {}, set()).evaluate({})) == float(eval(text))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("two + double(3)", 8.0),
        ("-x ** 2", -25.0),
        ("later(x) - x", 5.0),
        ("1 < x <= 5 and not x < 2", True),
        ("1 < x < 3 or x == 5", True),
        ("x / 0 > 1e300", True),
    ],
)
def test_measures_and_variables_have_values(text: str, value: Any) -> None:
    assert parse(text, MEASURES, {"x"}).evaluate({"x": 5.0}) == value


@pytest.mark.parametrize(
    "text",
    [
        "",
        "  ",
        None,
        "1 +",
        "1; 2",
        "x = 1",
        "__import__('os')",
        "two.real",
        "(lambda: 1)()",
        "[1, 2]",
        "'text'",
        "double(1)[0]",
        "double(a=1)",
        "double(*x)",
        "double(1, 2)",
        "double",
        "unknown(1)",
        "1 if x else 2",
        "x in x",
        "1 << 9",
        "1 + " * 100 + "1",
        "f'{x}'",
        "1j",
        "\0",
    ],
)
def test_other_texts_are_refused(text: Any) -> None:
    with pytest.raises(InvalidLesson):
        parse(text, MEASURES, {"x"})
