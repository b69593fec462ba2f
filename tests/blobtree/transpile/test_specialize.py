"""Choices by a code: what they compute, and that compiled kernels are found again."""

import inspect
import sys
from types import FunctionType
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree.formulas.falloff import WYVILL
from blobtree.nodes import tree
from blobtree.tape import dispatch
from blobtree.tape.dispatch import core_tables
from blobtree.transpile.specialize import rebind, referenced_values, row_choice
from tests.blobtree.transpile.kernels import choose, chosen
from tests.programs import output_of


@pytest.mark.slow
def test_a_choice_by_a_code_calls_the_function_of_the_row() -> None:
    text = inspect.getsource(chosen.func)
    assert text.count("if code == ") == 2
    assert "union_partials_1(a, b)\n" in text  # as many arguments as it declares
    out = wp.zeros(3, dtype=wp.float32, device="cpu")
    wp.launch(choose, dim=3, outputs=[out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), [7.0, 4.0, 0.0])


def test_another_table_makes_another_function() -> None:
    choice = row_choice(chosen)
    assert choice is not None
    longer: Any = choice.over(core_tables()["operators"], __name__)
    assert inspect.getsource(longer.func).count("if code == ") == len(core_tables()["operators"])
    assert inspect.getsource(chosen.func).count("if code == ") == 2


def test_a_choice_returns_numbers_of_any_type() -> None:
    codes = [dispatch.stride, dispatch.is_convex, dispatch.falloff_numbers]
    texts = [inspect.getsource(function.func) for function in codes]
    assert "result = 2\n" in texts[0]
    assert "result = bool(True)\n" in texts[1]
    assert f"result = wp.vec3{WYVILL.numbers}\n" in texts[2]


def test_references_are_globals_and_closures_and_no_attributes() -> None:
    factor = 3.0

    def scaled(code: int, slope: float) -> float:
        return factor * slope * len(str(tree.Sum.operator)) * sys._getframe().f_lineno

    assert isinstance(scaled, FunctionType)
    found = referenced_values(scaled)
    assert found["factor"] == 3.0
    assert found["tree"] is tree
    assert not {"operator", "slope", "f_lineno", "Sum"} & set(found)
    assert rebind(scaled, {"factor": 0.0}, module=__name__)(1, 2.0) == 0.0


def test_the_dispatchers_name_every_function_of_their_tables() -> None:
    for operator in core_tables()["operators"]:
        assert f"{operator.partials.key}_" in inspect.getsource(dispatch.partials.func)
        assert f"{operator.slope.key}_" in inspect.getsource(dispatch.slope.func)


KEY = """\
import sys
from types import FunctionType
from typing import Any
from importlib import import_module
import warp as wp
import blobtree
measured = ["blobtree.meshing.dual_kernels", "blobtree.cells.refine_kernels"]
for name in [*sys.argv[1:], *measured]:
    import_module(name)
for name in sys.argv[1:]:
    wp.load_module(name, device="cpu")
print([wp.get_module(name).hash_module().hex() for name in measured])
"""


@pytest.mark.slow
def test_the_key_of_a_kernel_does_not_depend_on_earlier_compilations() -> None:
    def keys(*loaded: str) -> str:
        return output_of(KEY, *loaded).splitlines()[-1]

    evaluation = "blobtree.tape.evaluate_kernels"
    assert keys() == keys(evaluation) == keys("blobtree.cells.refine_kernels", evaluation)
