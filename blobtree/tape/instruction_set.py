"""Instruction sets: the skeletons, operators, warps and falloffs that the codes on a tape stand for.

Kernels are written against the tables of core kinds; a tree of core kinds has BUILT_IN, whose kernels are
those in the files. For any other set of kinds the same kernels are instantiated (`transpile.specialize`). A
tree with library kinds has `library`: the core rows, then those of `formulas.library`. A tree with custom
kinds has a set of its own: the rows of BUILT_IN or `library`, then the custom ones.
"""

import hashlib
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from threading import RLock
from types import FunctionType
from typing import Any, TypeVar

import warp as wp

from blobtree.formulas.falloff import FALLOFFS, Falloff
from blobtree.formulas.fields import FIELDS, FieldKind
from blobtree.formulas.operators import OPERATORS, Operator
from blobtree.formulas.skeletons import SKELETONS, Skeleton
from blobtree.formulas.warps import WARPS, SpaceWarp
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.lazy import Lazy
from blobtree.transpile.derivative import differentiated, directional_derivative
from blobtree.transpile.specialize import (
    original_function,
    rebind,
    referenced_values,
    unrolled,
    warp_function,
)

_TABLES = {
    "SKELETONS": SKELETONS,
    "OPERATORS": OPERATORS,
    "WARPS": WARPS,
    "FIELDS": FIELDS,
    "FALLOFFS": FALLOFFS,
}
"""The core tables by the names under which functions read them: all empty tables are the same object."""

Row = Skeleton | Operator | SpaceWarp | FieldKind | Falloff
AnyRow = TypeVar("AnyRow", bound=Row)

_LOCK = RLock()
"""Held while functions are registered: Warp's registry is not safe for threads."""

if hasattr(os, "register_at_fork"):  # a child forked while another thread holds the lock would wait forever
    os.register_at_fork(before=_LOCK.acquire, after_in_parent=_LOCK.release, after_in_child=_LOCK.release)


@dataclass(frozen=True)
class InstructionSet:
    """The rows that codes on a tape stand for; core rows come first, then library rows."""

    skeletons: tuple[Skeleton, ...]
    operators: tuple[Operator, ...]
    warps: tuple[SpaceWarp, ...]
    fields: tuple[FieldKind, ...]
    falloffs: tuple[Falloff, ...] = FALLOFFS
    _kernels: dict[wp.Kernel, wp.Kernel] = field(default_factory=dict, compare=False, repr=False)
    _functions: dict[wp.Function, wp.Function] = field(default_factory=dict, compare=False, repr=False)

    @property
    def rows(self) -> tuple[Row, ...]:
        """All rows."""
        return (*self.skeletons, *self.operators, *self.warps, *self.fields, *self.falloffs)

    @Lazy
    def reads_gradients(self) -> bool:
        """Return True if an operator reads the gradients of its operands; evaluation is then another."""
        return any(operator.gradients for operator in self.operators)

    @Lazy
    def digest(self) -> str:
        """Return a digest of all rows, the same in every process."""
        names = [f"{row.name}:{row.digest}" for row in self.rows]
        return hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]

    def kernel_for(self, kernel: wp.Kernel) -> wp.Kernel:
        """Return `kernel` compiled for tapes of this instruction set; itself if it reads no table."""
        if self is BUILT_IN:
            return kernel
        with _LOCK:
            if kernel not in self._kernels:
                self._kernels[kernel] = self._instantiate_kernel(kernel)
            return self._kernels[kernel]

    def _instantiate_kernel(self, kernel: wp.Kernel) -> wp.Kernel:
        """Return the kernel in a Warp module of its own, so that adding a kernel compiles no other again."""
        source = _python_function(kernel)
        replaced = self._replaced(source)
        if not replaced:
            return kernel
        module = self._module_of(source)
        wp.get_module(module).options.update(KERNEL_OPTIONS)
        instance: wp.Kernel = wp.kernel(rebind(source, replaced, module=module))
        return instance

    def _instantiate(self, function: wp.Function) -> wp.Function:
        """Return `function` for this instruction set; itself if it reads no table."""
        if function not in self._functions and (primal := differentiated(function)):
            source_function, varying = primal
            instance = self._instantiate(self._exchanged(source_function))
            self._functions[function] = (
                function if instance is source_function else directional_derivative(instance, varying)
            )
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
            name: (value, self._substitute(name, value))
            for name, value in referenced_values(function).items()
        }
        return {name: new for name, (old, new) in substitutes.items() if new is not old}

    def _substitute(self, name: str, value: Any) -> Any:
        if name in _TABLES and value is _TABLES[name]:
            return getattr(self, name.lower())
        if isinstance(value, wp.Function) and not value.is_builtin():
            return self._instantiate(self._exchanged(value))
        return value

    def _exchanged(self, function: wp.Function) -> wp.Function:
        """Return the evaluation that knows gradients for one that does not, if an operator reads them."""
        if not self.reads_gradients:
            return function
        from blobtree.tape.directed import DIRECTED_EVALUATIONS  # its derivatives are made at the first use

        exchanged: wp.Function = DIRECTED_EVALUATIONS.get(function, function)
        return exchanged

    def _module_of(self, function: FunctionType) -> str:
        name = re.sub(r"\W+", "_", function.__qualname__)
        return f"{function.__module__}.{name}_{self.digest}"


def _python_function(typed: wp.Function | wp.Kernel) -> FunctionType:
    function = typed.func
    assert isinstance(function, FunctionType)
    return function


BUILT_IN = InstructionSet(SKELETONS, OPERATORS, WARPS, FIELDS)
"""The instruction set of trees of core kinds."""

_created: list[InstructionSet] = []
"""The other instruction sets."""


@cache
def library() -> InstructionSet:
    """Return the instruction set of trees with library kinds, whose formulas take long to import."""
    from blobtree.formulas.library import (
        LIBRARY_FALLOFFS,
        LIBRARY_FIELDS,
        LIBRARY_OPERATORS,
        LIBRARY_SKELETONS,
        LIBRARY_WARPS,
    )

    with _LOCK:
        if not _created:
            first = InstructionSet(
                (*SKELETONS, *LIBRARY_SKELETONS),
                (*OPERATORS, *LIBRARY_OPERATORS),
                (*WARPS, *LIBRARY_WARPS),
                (*FIELDS, *LIBRARY_FIELDS),
                (*FALLOFFS, *LIBRARY_FALLOFFS),
            )
            _created.append(first)
        return _created[0]


def instruction_set_for(
    skeletons: Iterable[Skeleton],
    operators: Iterable[Operator],
    warps: Iterable[SpaceWarp],
    fields: Iterable[FieldKind],
    falloffs: Iterable[Falloff] = (),
) -> InstructionSet:
    """Return an instruction set that has these rows.

    That is the smallest existing one, so that a tree with fewer kinds than an earlier tree compiles nothing.
    If none fits, a new one has the rows of BUILT_IN or `library`, and then the custom rows in a fixed order.
    """
    needed = InstructionSet(tuple(skeletons), tuple(operators), tuple(warps), tuple(fields), tuple(falloffs))
    rows = set(needed.rows)
    if rows.issubset(BUILT_IN.rows):
        return BUILT_IN
    with_library = library()
    with _LOCK:
        fitting = [
            existing
            for existing in _created
            if rows.issubset(existing.rows) and existing.reads_gradients == needed.reads_gradients
        ]
        if fitting:
            return min(fitting, key=lambda existing: len(existing.rows))
        custom = rows.difference(with_library.rows)
        base = BUILT_IN if rows.issubset({*BUILT_IN.rows, *custom}) else with_library
        created = InstructionSet(
            _extended(base.skeletons, needed.skeletons),
            _extended(base.operators, needed.operators),
            _extended(base.warps, needed.warps),
            _extended(base.fields, needed.fields),
            _extended(base.falloffs, needed.falloffs),
        )
        _created.append(created)
        return created


def _extended(table: tuple[AnyRow, ...], needed: tuple[AnyRow, ...]) -> tuple[AnyRow, ...]:
    """Return the rows of a table, then the other needed rows in a fixed order."""
    return (*table, *sorted(set(needed).difference(table), key=lambda row: (row.name, row.digest)))


@cache
def single_skeleton_set(skeleton: Skeleton) -> InstructionSet:
    """Return the instruction set of one skeleton, whose code is 0."""
    return InstructionSet((skeleton,), OPERATORS, WARPS, FIELDS)
