"""Designs: products, sums, pairs, conditions, and evenly filled boxes."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals.errors import InvalidInput
from decals.experiments import Design, Grid, LatinHypercube, Seeds, Sobol


@given(st.lists(st.integers(), max_size=4), st.lists(st.text(max_size=3), max_size=4))
def test_a_product_has_all_pairs_in_order(numbers: list[int], texts: list[str]) -> None:
    design = Grid(number=numbers) * Grid(text=texts)
    assert [(trial["number"], trial["text"]) for trial in design] == [(n, t) for n in numbers for t in texts]
    assert list(design) == list(Grid(number=numbers, text=texts))


def test_designs_are_added_zipped_and_filtered() -> None:
    first, second = Grid(a=[1, 2]), Grid(b=[3, 4])
    assert list(first + first) == [{"a": 1}, {"a": 2}, {"a": 1}, {"a": 2}]
    assert list(first.zip(second)) == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    assert list((first * second).where(lambda a, b: a + b == 5)) == [{"a": 1, "b": 4}, {"a": 2, "b": 3}]
    assert list(Seeds(2, first=5)) == [{"seed": 5}, {"seed": 6}]
    assert first[0] == {"a": 1}
    assert list(first[1:]) == [{"a": 2}]


def test_a_trial_that_is_changed_leaves_the_design_alone() -> None:
    design = Grid(a=[1])
    design[0]["a"] = 2
    next(iter(design))["a"] = 3
    assert design[0] == {"a": 1}


def test_numbers_of_numpy_become_those_of_python() -> None:
    assert [type(trial["x"]) for trial in Grid(x=np.linspace(0, 1, 3))] == [float] * 3
    assert [type(trial["x"]) for trial in Grid(x=np.arange(2))] == [int] * 2


@pytest.mark.parametrize("kind", [Sobol, LatinHypercube])
def test_a_parameter_of_a_box_may_have_any_name(kind: type[Sobol]) -> None:
    design = kind(4, radius=(0.01, 1.0, "log"), count=(10, 99), self=(0, 1))
    assert {tuple(sorted(trial)) for trial in design} == {("count", "radius", "self")}
    assert list(Grid(self=[1])) == [{"self": 1}]


@pytest.mark.parametrize("kind", [Sobol, LatinHypercube])
@given(count=st.integers(1, 40), seed=st.integers(0, 9))
def test_boxes_are_filled_within_their_ranges(kind: type[Sobol], count: int, seed: int) -> None:
    design = kind(count, seed, x=(-1.5, 2.0), n=(3, 7), r=(1e-3, 10.0, "log"))
    assert len(design) == count
    assert list(design) == list(kind(count, seed, x=(-1.5, 2.0), n=(3, 7), r=(1e-3, 10.0, "log")))
    for trial in design:
        assert -1.5 <= trial["x"] <= 2.0
        assert trial["n"] in range(3, 8)
        assert 1e-3 <= trial["r"] <= 10.0


def test_boxes_are_filled_evenly() -> None:
    for kind in (Sobol, LatinHypercube):
        design = kind(64, x=(0.0, 64.0), n=(0, 3), r=(1.0, 16.0, "log"))
        assert sorted(int(trial["x"]) for trial in design) == list(range(64)), "one trial in each 64th"
        assert np.bincount([trial["n"] for trial in design]).tolist() == [16] * 4
        assert sum(trial["r"] < 4.0 for trial in design) == 32


WRONG: Any = 3


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: Grid(a=WRONG), r"a: expected a list of values, got 3; write a=\[3\]"),
        (lambda: Grid(a="text"), "a: expected a list of values"),
        (lambda: Grid(a=[1]) * Grid(a=[2]), "both designs have the parameter a"),
        (lambda: Grid(a=[1]).zip(Grid(b=[1, 2])), "expected a design of 1 trials, got one of 2"),
        (lambda: Grid(a=[1]) * WRONG, "expected a design"),
        (lambda: Grid(a=[1]).where(lambda b: b), "does not take these parameters"),
        (lambda: Grid(a=[1]).where(WRONG), "expected a function"),
        (lambda: Seeds(-1), "count: expected a whole number"),
        (lambda: Sobol(4, x=(2, 1)), "x: expected"),
        (lambda: Sobol(4, x=(0.0, 1.0, "log")), "above 0 for log"),
        (lambda: Sobol(4, x=(0.0, float("inf"))), "finite"),
        (lambda: Sobol(4, x=WRONG), "x: expected"),
        (lambda: Sobol(4), "at least one parameter"),
        (lambda: Sobol(0, x=(0, 1)), "count: expected"),
        (lambda: Design([WRONG]), "a trial of a design: expected a dict"),
    ],
)
def test_wrong_designs_are_refused(wrong: object, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        wrong()  # type: ignore[operator]
