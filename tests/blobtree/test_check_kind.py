"""What `check_kind` takes: kinds, oracles, samples; ranges of parameters of any place."""

import re
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import Falloff, Operator, Point, Union, check_kind, formula, par
from blobtree.conformance import laws
from blobtree.conformance.samples import drawn_node
from blobtree.declare.registry import CUSTOM_KINDS, CustomKind
from blobtree.errors import InvalidNode


def larger(node: Any, points: Any) -> Any:
    return np.max([operand(points) for operand in node.operands], axis=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3,), "kind: expected a class"),
        ((Point((0, 0, 0), radius=1.0),), "kind: expected a class"),
        ((Falloff,), "kind: expected a class"),
        ((Operator,), "expected a subclass of it"),
        ((Union, 3), "oracle: expected a function"),
        ((type(Point((0, 0, 0), radius=1.0).falloff), lambda _d, _q: 0.0), "oracle: expected a function of"),
    ],
)
def test_wrong_kinds_and_oracles_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        check_kind(*arguments, show=None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 0}, "samples: expected a whole number from 1, got 0"),
        ({"samples": "x"}, "samples: expected"),
        ({"seed": -1}, "seed: expected a whole number from 0, got -1"),
        ({"seed": "x"}, "seed: expected"),
        ({"sample": 3}, "sample: expected a function"),
        ({"sample": lambda _rng: 3}, "sample: expected a function that returns a node, got 3"),
        ({"show": 3}, "show: expected a function"),
    ],
)
def test_wrong_options_are_refused(options: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        check_kind(Union, larger, **{"show": None, **options})


@pytest.mark.parametrize(
    ("oracle", "message"),
    [
        (lambda _node, _points: 1.0, r"oracle: expected values of shape \(100,\), got \(\)"),
        (lambda _node, points: points, r"oracle: expected values of shape \(100,\), got \(100, 3\)"),
        (lambda _node, _points: 1 / 0, "oracle: it fails: ZeroDivisionError: division by zero"),
    ],
)
def test_a_wrong_oracle_fails_the_law_of_the_value_with_a_reason(oracle: Any, message: str) -> None:
    report = check_kind(Union, oracle, samples=1, show=None)
    assert not report.conforms
    law = next(law for law in report.failed if law.name == "value")
    assert re.search(message, law.detail)


@pytest.mark.parametrize("specifier", [par.factor, par.angle, par.length, par.distance])
@pytest.mark.parametrize(
    ("low", "high"), [(60.0, 90.0), (5.0, float("inf")), (7.0, 7.0), (float("-inf"), -60.0)]
)
def test_parameters_of_any_range_are_drawn(specifier: Any, low: float, high: float) -> None:
    if specifier is par.length and low < 0.0:
        return

    def value(a: wp.float32, b: wp.float32, size: wp.float32) -> wp.float32:
        return wp.max(a, b)

    body = {
        "__module__": __name__,
        "__annotations__": {"size": float},
        "lipschitz": 1.0,
        "size": specifier("a size", low=low, high=high),
        "value": formula(value),
    }
    kind: Any = CustomKind("Drawn", (Operator,), body)
    del CUSTOM_KINDS["drawn"]
    nodes: list[Any] = [drawn_node(kind, np.random.default_rng(seed)) for seed in range(4)]
    assert all(low <= node.size <= high for node in nodes)


@pytest.mark.parametrize(
    ("found", "state"),
    [
        ("-", "not checked"),
        ("-h", "holds"),
        ("h-", "holds"),
        ("-f", "fails"),
        ("f-", "fails"),
        ("hf", "fails"),
    ],
)
def test_samples_that_cannot_be_checked_hide_no_failure(found: str, state: str) -> None:
    """Of the samples of a law, "h" holds, "f" fails, and "-" cannot be checked."""

    def law(case: laws.Case) -> Any:
        letter = found[int(case.rng.integers(100))]
        if letter == "-":
            raise laws.NotChecked("no reason")
        if letter == "f":
            yield laws.Contradiction(1.0, "wrong")

    class Place:
        """A generator that returns the number of the sample."""

        def __init__(self, number: int) -> None:
            self.integers = lambda _: number

    ball = Point((0, 0, 0), radius=1.0)
    cases = (laws.Case(ball, None, False, Place(n)) for n in range(len(found)))  # type: ignore[arg-type]
    assert laws._tried("some", law, cases).state == state
