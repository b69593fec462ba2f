"""Digests of functions change with all code and values that a function depends on, and with nothing else."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from decals.experiments.fingerprint import fingerprint, trial_hash

WAYS = {
    "a value": "def f(x):\n    return x * K",
    "a default": "def f(x, k=K):\n    return x * k",
    "a default by name": "def f(x, *, k=K):\n    return x * k",
    "a function": "def f(x):\n    return helper(x)",
    "a cached function": "@functools.cache\ndef g(x):\n    return helper(x)\n\ndef f(x):\n    return g(x)",
    "a function of Warp": "@wp.func\ndef g(x: float):\n    return x * float(K)\n\ndef f(x):\n    return g(x)",
    "a module": "def f(x):\n    return of_a_user.helper(x)",
    "a module of a package": "import of_users.own\n\ndef f(x):\n    return of_users.own.helper(x)",
    "an import inside": "def f(x):\n    from of_users.inside import helper\n    return helper(x)",
    "an import of a module inside": "def f(x):\n    import of_users.inside as own\n    return own.helper(x)",
    "a decorator": "@times(K)\ndef f(x):\n    return x",
    "what is decorated": "@times(5)\ndef f(x):\n    return helper(x)",
    "an object": "f = Scale(K)",
    "a method": "f = Scale(K).method",
    "a method of a class": "f = Scale.of",
    "a base": "class Derived(Scale):\n    pass\n\nf = Derived(1).method",
    "an object in a closure": "def g():\n    scale = Scale(K)\n    return lambda x: scale(x)\n\nf = g()",
    "an object in a table": "TABLE = {'a': [Scale(K)]}\n\ndef f(x):\n    return TABLE['a'][0](x)",
    "an object of a dataclass": "def f(x):\n    return Pair(1).sum(x)",
    "a property": "def f(x):\n    return Scale(1).own",
    "a member of an enumeration": "def f(x):\n    return x * Kind.ONE.value",
    "a partial": "f = functools.partial(helper, K)",
    "a function in a partial": "f = functools.partial(map, helper)",
    "a lambda": "f = lambda x: helper(x)",
    "a function inside": "def f(x):\n    def g(y):\n        return helper(y)\n    return g(x)",
    "an annotated array": "ARRAY = np.arange(3) * K\n\ndef f(x):\n    return ARRAY + x",
}
"""Ways in which a function `f` depends on the value K, or on a function `helper` that does."""

MODULE = """
import enum, functools, dataclasses, math
import numpy as np, warp as wp
import of_a_user
from of_a_user import helper
K = {k}
def times(k):
    def decorate(function):
        @functools.wraps(function)
        def wrapped(x):
            return function(x) * k
        return wrapped
    return decorate
class Scale:
    def __init__(self, k):
        self.k = k
    def __call__(self, x):
        return self.k * x
    def method(self, x):
        return K * self(x)
    @classmethod
    def of(cls, x):
        return cls(K)(x)
    @property
    def own(self):
        return K
@dataclasses.dataclass
class Pair:
    a: int
    def sum(self, x):
        return helper(x) + self.a
class Kind(enum.Enum):
    ONE = K
"""


def loaded(text: str, k: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The function `f` of a user's file, beside modules and a package of the user."""
    (folder / "of_users").mkdir(parents=True)
    helper = f"def helper(x, y=0):\n    return x + {k}\n"
    for name in ("of_a_user.py", "of_users/__init__.py", "of_users/own.py", "of_users/inside.py"):
        (folder / name).write_text(helper)
    (folder / "of_a_file.py").write_text(MODULE.format(k=k) + text)
    for name in [name for name in sys.modules if name.startswith(("of_a_", "of_users"))]:
        monkeypatch.delitem(sys.modules, name)
    with monkeypatch.context() as patch:
        patch.syspath_prepend(str(folder))
        importlib.invalidate_caches()
        return fingerprint(importlib.import_module("of_a_file").f)


@pytest.mark.parametrize("way", WAYS)
def test_digests_change_with_all_that_a_function_uses(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, again, other = (
        loaded(WAYS[way], k, tmp_path / name, monkeypatch) for name, k in (("a", 1), ("b", 1), ("c", 2))
    )
    assert first == again != other


def test_what_a_function_does_not_use_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "LOG = __import__('logging').getLogger()\n\ndef f(x):\n    LOG.info(x)\n    return math.pi * x"
    digests = {loaded(text, k, tmp_path / str(k), monkeypatch) for k in (1, 2)}
    digests.add(loaded(text.replace("x):\n", "x):  # again\n\n"), 1, tmp_path / "again", monkeypatch))
    assert len(digests) == 1


def test_parameters_may_be_functions_of_all_kinds() -> None:
    import math

    kinds = [math.sin, math.cos, abs, lambda x: x, lambda x: 2 * x, "abs", str.upper, str.lower]
    assert len({trial_hash({"x": kind}) for kind in kinds}) == len(kinds)


@pytest.mark.slow
def test_digests_do_not_depend_on_the_order_of_sets(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from decals.experiments.fingerprint import fingerprint\n"
        "print(fingerprint(lambda x: x in {'a', 'b', 'c', 'd', 'e'} or (1, x in {'f', 'g', 'h'})))\n"
    )
    digests = {
        subprocess.run(
            [sys.executable, script],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(digests) == 1
