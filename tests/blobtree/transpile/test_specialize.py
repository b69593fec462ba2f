"""Loops over tables written out: what they compute, and that compiled kernels are found again."""

import inspect
import subprocess
import sys
from types import FunctionType

import numpy as np
import warp as wp

from blobtree.formulas import operators
from blobtree.tape import dispatch
from blobtree.transpile.specialize import original_function, rebind, referenced_values, unrolled
from tests.blobtree.transpile.kernels import TABLE, choose, chosen


def test_a_loop_over_a_table_is_a_copy_of_its_body_per_row() -> None:
    text = inspect.getsource(chosen.func)
    assert text.count("if code == ") == len(TABLE)
    assert "wp.static" not in text
    assert "for _other in range(2)" in text
    original = original_function(chosen)
    assert original is not None
    assert original.__code__.co_firstlineno > 10
    out = wp.zeros(3, dtype=wp.float32, device="cpu")
    wp.launch(choose, dim=3, outputs=[out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), [2.0 * 7.0 + 2.0, 5.0 * 4.0 + 2.0, 2.0])


def test_another_table_makes_another_function() -> None:
    table = (*TABLE, (1.0, operators.intersection_partials))
    original = original_function(chosen)
    assert original is not None
    longer = unrolled(rebind(original, {"TABLE": table}, module=__name__))
    assert inspect.getsource(longer.func).count("if code == ") == 3
    assert inspect.getsource(chosen.func).count("if code == ") == 2


def test_references_are_globals_and_closures_and_no_attributes() -> None:
    factor = 3.0

    def scaled(code: int, slope: float) -> float:
        return factor * slope * len(str(operators.SUM.partials)) * sys._getframe().f_lineno

    assert isinstance(scaled, FunctionType)
    found = referenced_values(scaled)
    assert found["factor"] == 3.0
    assert found["operators"] is operators
    assert not {"partials", "slope", "f_lineno", "SUM"} & set(found)
    assert rebind(scaled, {"factor": 0.0}, module=__name__)(1, 2.0) == 0.0


def test_the_dispatchers_name_every_function_of_their_tables() -> None:
    for operator in operators.OPERATORS:
        assert f"{operator.partials.key}_" in inspect.getsource(dispatch.partials.func)
        assert f"{operator.slope.key}_" in inspect.getsource(dispatch.slope.func)


KEY = """\
import sys
from types import FunctionType
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


def test_the_key_of_a_kernel_does_not_depend_on_earlier_compilations() -> None:
    def keys(*loaded: str) -> str:
        command = [sys.executable, "-c", KEY, *loaded]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1]

    evaluation = "blobtree.tape.evaluate_kernels"
    assert keys() == keys(evaluation) == keys("blobtree.cells.refine_kernels", evaluation)
