"""Instruction sets: the skeletons, operators and warps that the codes on a tape stand for.

Kernels are written against the tables of built-in kinds. A tree with custom kinds has an instruction set of
its own: the built-in rows, then the custom ones. The same kernels are instantiated for it, once per set of
kinds (`transpile.specialize`), and compiled at their first launch. A tree without custom kinds has BUILT_IN,
whose kernels are those in the files.
"""

import hashlib
import os
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
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.lazy import Lazy
from blobtree.transpile.specialize import (
    original_function,
    rebind,
    referenced_values,
    unrolled,
    warp_function,
)

_TABLES = (SKELETONS, OPERATORS, WARPS)

_LOCK = RLock()
"""Held while functions are registered: Warp's registry is not safe for threads."""

if hasattr(os, "register_at_fork"):  # a child forked while another thread holds the lock would wait forever
    os.register_at_fork(before=_LOCK.acquire, after_in_parent=_LOCK.release, after_in_child=_LOCK.release)


@dataclass(frozen=True)
class InstructionSet:
    """The rows that codes on a tape stand for; built-in rows come first."""

    skeletons: tuple[Skeleton, ...]
    operators: tuple[Operator, ...]
    warps: tuple[SpaceWarp, ...]
    _kernels: dict[wp.Kernel, wp.Kernel] = field(default_factory=dict, compare=False, repr=False)
    _functions: dict[wp.Function, wp.Function] = field(default_factory=dict, compare=False, repr=False)

    @Lazy
    def digest(self) -> str:
        """Return a digest of all rows, the same in every process."""
        rows: tuple[Skeleton | Operator, ...] = (*self.skeletons, *self.operators)
        names = [f"{row.name}:{row.digest}" for row in rows]
        return hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]

    def kernel_for(self, kernel: wp.Kernel) -> wp.Kernel:
        """Return `kernel` compiled for tapes of this instruction set."""
        if self is BUILT_IN:
            return kernel
        with _LOCK:
            if kernel not in self._kernels:
                self._kernels[kernel] = self._instantiate_kernel(kernel)
            return self._kernels[kernel]

    def _instantiate_kernel(self, kernel: wp.Kernel) -> wp.Kernel:
        """Return the kernel in a Warp module of its own, so that adding a kernel compiles no other again."""
        source = _python_function(kernel)
        module = self._module_of(source)
        wp.get_module(module).options.update(KERNEL_OPTIONS)
        instance: wp.Kernel = wp.kernel(rebind(source, self._replaced(source), module=module))
        return instance

    def _instantiate(self, function: wp.Function) -> wp.Function:
        """Return `function` for this instruction set; itself if it reads no table."""
        if function not in self._functions:
            loops_over_table = original_function(function)
            source = loops_over_table or _python_function(function)
            make = unrolled if loops_over_table else warp_function
            replaced = self._replaced(source)
            module = self._module_of(source)
            self._functions[function] = (
                make(rebind(source, replaced, module=module)) if replaced else function
            )
        return self._functions[function]

    def _replaced(self, function: FunctionType) -> dict[str, Any]:
        """Return the values that replace names in `function`."""
        substitutes = {
            name: (value, self._substitute(value)) for name, value in referenced_values(function).items()
        }
        return {name: new for name, (old, new) in substitutes.items() if new is not old}

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


BUILT_IN = InstructionSet(*_TABLES)
"""The instruction set of trees without custom kinds."""


_INSTRUCTION_SETS: list[InstructionSet] = [BUILT_IN]


def instruction_set_for(skeletons: Iterable[Skeleton], operators: Iterable[Operator]) -> InstructionSet:
    """Return an instruction set that has these rows.

    That is the smallest existing one, so that a tree with fewer kinds than an earlier tree compiles nothing.
    If none fits, a new one has the built-in rows and then the custom rows in a fixed order.
    """
    custom_skeletons = {row for row in skeletons if row not in SKELETONS}
    custom_operators = {row for row in operators if row not in OPERATORS}
    with _LOCK:
        fitting = [
            existing
            for existing in _INSTRUCTION_SETS
            if custom_skeletons.issubset(existing.skeletons) and custom_operators.issubset(existing.operators)
        ]
        if fitting:
            return min(fitting, key=lambda existing: len(existing.skeletons) + len(existing.operators))
        created = InstructionSet(
            (*SKELETONS, *sorted(custom_skeletons, key=_order)),
            (*OPERATORS, *sorted(custom_operators, key=_order)),
            WARPS,
        )
        _INSTRUCTION_SETS.append(created)
        return created


def _order(row: Skeleton | Operator) -> tuple[str, str]:
    return row.name, row.digest


@cache
def single_skeleton_set(skeleton: Skeleton) -> InstructionSet:
    """Return the instruction set of one skeleton, whose code is 0."""
    return InstructionSet((skeleton,), OPERATORS, WARPS)
