"""Typed functions as plain Python: what they return is what Warp computes."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree.transpile.builtins import BUILTINS
from blobtree.transpile.python import plain_python, vector
from blobtree.transpile.specialize import row_choice
from tests.blobtree import kernels as custom_functions
from tests.blobtree.transpile import kernels
from tests.blobtree.transpile.kernels import real_numbers, reciprocal
from tests.blobtree.transpile.warp_functions import call, python_function, typed_functions

COUNT = 200


FUNCTIONS = [
    *(f for f in typed_functions(kernels) if row_choice(f.function) is None),
    *(
        f
        for name in ("formulas.falloff", "nodes.tree")
        for f in typed_functions(import_module(f"blobtree.{name}"))
        if "tape" not in f.parameters
    ),
    *(f for f in typed_functions(custom_functions)),
]
INTERVALS = ("range", "choice")


@pytest.mark.parametrize("typed", FUNCTIONS, ids=lambda typed: typed.name)
def test_a_function_is_the_same_in_plain_python(typed: Any) -> None:
    rng = np.random.default_rng(3)
    spread = 0.0 if typed.function.func.__module__.startswith("blobtree") else -1.5
    arguments = {}
    for name, hint in typed.parameters.items():
        size = getattr(hint, "_length_", 1)
        numbers = rng.uniform(spread, 1.5, (COUNT, size)) + (
            1.0 if name in ("exponent", "parameter") else 0.0
        )
        numbers = np.sort(numbers, axis=1) if typed.name.endswith(INTERVALS) else numbers
        arguments[name] = numbers.astype(np.float32) if size > 1 else numbers[:, 0].astype(np.float32)
    expected = call(typed.function, **arguments).reshape(COUNT, -1)
    for precision, tolerance in ((np.float64, 2e-5), (np.float32, 1e-4)):
        plain = plain_python(python_function(typed.function), precision)
        for row in range(COUNT):
            values = [
                vector(*value[row], precision=precision) if value.ndim == 2 else precision(value[row])
                for value in arguments.values()
            ]
            with np.errstate(all="ignore"):
                seen = np.ravel(np.asarray(plain(*values), np.float64))
            np.testing.assert_allclose(seen, expected[row], rtol=tolerance, atol=tolerance)


def test_every_word_that_shaders_share_is_known() -> None:
    stand_in = plain_python(python_function(real_numbers)).__globals__["wp"]
    for name in BUILTINS:
        assert getattr(stand_in, name) is not getattr(wp, name), name


def test_dividing_by_nothing_is_no_exception() -> None:
    with np.errstate(all="ignore"):
        assert plain_python(python_function(reciprocal))(np.float64(0.0)) == np.inf
