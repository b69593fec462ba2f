"""The page about devices names every public function, and its statements hold on this machine."""

import inspect
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import blobtree
from decals.apps.experiments.devices import (
    CASES,
    DRAWN,
    EXPLAINED,
    STATEMENTS,
    Answers,
    compared,
    devices,
    statements_table,
)

PAGE = Path(__file__).parents[2] / "docs" / "devices.md"


def public_functions(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return the names of the public functions of all packages."""
    monkeypatch.syspath_prepend(PAGE.parent)
    seen: dict[int, str] = {}
    for package in (*import_module("api_pages").PACKAGES, "decals.experiments"):
        module = import_module(package)
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if inspect.isroutine(value):
                seen.setdefault(id(value), f"{package}.{name}")
    return set(seen.values())


def test_every_public_function_has_a_statement(monkeypatch: pytest.MonkeyPatch) -> None:
    methods = {name for name in STATEMENTS if name.startswith("blobtree.Node.")}
    assert public_functions(monkeypatch) == set(STATEMENTS) - methods
    assert all(hasattr(blobtree.Node, name.rpartition(".")[2]) for name in methods)
    assert set(STATEMENTS.values()) == set(EXPLAINED)


def test_the_page_has_the_statements() -> None:
    text = PAGE.read_text(encoding="utf-8")
    table = text.partition("<!-- statements -->\n")[2].partition("\n<!-- end -->")[0]
    assert table == statements_table()


@pytest.mark.ordinary_cases("decals.evaluate, elastic", "blobtree.Node.gradient", "decals.evaluate_batch")
@pytest.mark.parametrize("case", CASES)
def test_the_processor_repeats_all_bits(case: str) -> None:
    assert devices(case, "cpu") == {"bits": 1.0, "unlike": 0.0, "p99": 0.0, "largest": 0.0}


@pytest.mark.gpu
@pytest.mark.parametrize("case", [case for case in CASES if case != "decals.scatter"])
def test_a_card_is_equal_to_rounding(case: str) -> None:
    found = devices(case, "cuda")
    assert found["unlike"] < 0.01
    assert found["p99"] < 1e-3


@pytest.mark.ordinary_cases("decals.render of a mesh, beside evaluate-fragment")
@pytest.mark.parametrize("backend", ["fragment", "compute"])
@pytest.mark.parametrize("case", DRAWN)
def test_pictures_are_equal_to_rounding(case: str, backend: str) -> None:
    found = devices(case, backend)
    assert found["unlike"] < 0.01
    assert found["p99"] < 1e-5


def test_comparisons_tell_owners_bits_and_sizes_apart() -> None:
    first = Answers(np.array([0, 1, 2, 3]), np.array([[1.0], [2.0], [3.0], [4.0]]), 2.0)
    other = Answers(np.array([0, 1, 2, 4]), np.array([[1.0], [2.0], [3.5], [9.0]]))
    assert compared(first, other) == {
        "bits": 0.5,
        "unlike": 0.25,
        "p99": 0.25,
        "largest": 0.25,
    }
    fewer = compared(first, Answers(np.array([0, 0]), np.array([[1.0], [2.5]])))
    assert fewer["unlike"] == 0.5
    assert fewer["largest"] == 0.75
    zeros = compared(Answers(np.zeros(1), np.array([[0.0]])), Answers(np.zeros(1), np.array([[-0.0]])))
    assert zeros["bits"] == 0.0
    assert zeros["largest"] == 0.0
    nothing = Answers(np.zeros(0), np.zeros((0, 1)))
    assert compared(nothing, first)["largest"] == np.inf
