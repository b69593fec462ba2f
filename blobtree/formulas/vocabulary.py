"""Vocabularies: which kinds of skeletons, operators and warps the codes on a tape stand for.

Kernels are written against the tables of built-in kinds. A tree that uses kinds of its user's speaks a
vocabulary of its own, the built-in rows followed by those of the user; the same kernels are instantiated for
it (`instantiate`), once per set of kinds, and compiled when they are first launched. A tree without own kinds
speaks BUILT_IN, whose kernels are those that the files define.
"""

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from threading import RLock
from types import FunctionType
from typing import Any

import warp as wp

from blobtree.formulas.operators import OPERATORS, Operator
from blobtree.formulas.skeletons import SKELETONS, Skeleton
from blobtree.formulas.warps import WARPS, SpaceWarp
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.lazy import Lazy
from blobtree.typed.instantiate import rebound, references, typed
from blobtree.typed.unroll import original, unrolled

_TABLES = (SKELETONS, OPERATORS, WARPS)

_LOCK = RLock()
"""Warp's registry of functions is no place for two threads at once."""


@dataclass(frozen=True)
class Vocabulary:
    """The rows that codes on a tape stand for; those of built-in kinds come first."""

    skeletons: tuple[Skeleton, ...]
    operators: tuple[Operator, ...]
    warps: tuple[SpaceWarp, ...]
    _kernels: dict[wp.Kernel, wp.Kernel] = field(default_factory=dict, compare=False, repr=False)
    _functions: dict[wp.Function, wp.Function] = field(default_factory=dict, compare=False, repr=False)

    @Lazy
    def digest(self) -> str:
        """A digest of the rows beyond the built-in ones, the same in every process."""
        rows: tuple[Skeleton | Operator, ...] = (*self.skeletons, *self.operators)
        names = [f"{row.name}:{row.digest}" for row in rows]
        return hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]

    def kernel(self, kernel: wp.Kernel) -> wp.Kernel:
        """`kernel`, reading tapes of this vocabulary."""
        if self is BUILT_IN:
            return kernel
        with _LOCK:
            if kernel not in self._kernels:
                self._kernels[kernel] = self._instantiate_kernel(kernel)
            return self._kernels[kernel]

    def _instantiate_kernel(self, kernel: wp.Kernel) -> wp.Kernel:
        """`kernel` in a Warp module of its own, so that no other kernel's coming compiles it again."""
        source = _python_function(kernel)
        module = self._module_of(source)
        wp.get_module(module).options.update(KERNEL_OPTIONS)
        instance: wp.Kernel = wp.kernel(rebound(source, self._replaced(source), module=module))
        return instance

    def _instantiate(self, function: wp.Function) -> wp.Function:
        """`function` for this vocabulary; itself where no table is read below it."""
        if function not in self._functions:
            loops_over_table = original(function)
            source = loops_over_table or _python_function(function)
            make = unrolled if loops_over_table else typed
            replaced = self._replaced(source)
            module = self._module_of(source)
            self._functions[function] = (
                make(rebound(source, replaced, module=module)) if replaced else function
            )
        return self._functions[function]

    def _replaced(self, function: FunctionType) -> dict[str, Any]:
        """What `function` must see in place of what it names."""
        seen = {name: (value, self._substitute(value)) for name, value in references(function).items()}
        return {name: new for name, (old, new) in seen.items() if new is not old}

    def _substitute(self, value: Any) -> Any:
        for table, rows in zip(_TABLES, (self.skeletons, self.operators, self.warps), strict=True):
            if value is table:
                return rows
        if isinstance(value, wp.Function) and not value.is_builtin():
            return self._instantiate(value)
        return value

    def _module_of(self, function: FunctionType) -> str:
        name = re.sub(r"\W+", "_", function.__qualname__)
        return f"{function.__module__}.{name}_{self.digest}"


def _python_function(typed: wp.Function | wp.Kernel) -> FunctionType:
    function = typed.func
    assert isinstance(function, FunctionType)
    return function


BUILT_IN = Vocabulary(*_TABLES)
"""What trees without own kinds speak."""


_MADE: list[Vocabulary] = [BUILT_IN]


def vocabulary_of(skeletons: Iterable[Skeleton], operators: Iterable[Operator]) -> Vocabulary:
    """A vocabulary that has these rows.

    The smallest one that was made before, so that a tree which uses less than another one compiles nothing;
    a new one, of the built-in rows and then the others in a fixed order, where there is none.
    """
    own_skeletons = {row for row in skeletons if row not in SKELETONS}
    own_operators = {row for row in operators if row not in OPERATORS}
    with _LOCK:
        fitting = [
            vocabulary
            for vocabulary in _MADE
            if own_skeletons.issubset(vocabulary.skeletons) and own_operators.issubset(vocabulary.operators)
        ]
        if fitting:
            return min(fitting, key=lambda made: len(made.skeletons) + len(made.operators))
        made = Vocabulary(
            (*SKELETONS, *sorted(own_skeletons, key=_order)),
            (*OPERATORS, *sorted(own_operators, key=_order)),
            WARPS,
        )
        _MADE.append(made)
        return made


def _order(row: Skeleton | Operator) -> tuple[str, str]:
    return row.name, row.digest


@cache
def only(skeleton: Skeleton) -> Vocabulary:
    """A vocabulary of one skeleton, whose code is 0."""
    return Vocabulary((skeleton,), OPERATORS, WARPS)
