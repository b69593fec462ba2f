"""Instruction sets: the skeletons, operators, warps and falloffs that the codes on a tape stand for.

Kernels are written against the tables of core kinds; a tree of core kinds has `core`, whose kernels are
those in the files. For any other set of kinds the same kernels are instantiated (`transpile.specialize`). A
tree with library kinds has `library`: the core rows, then those of the registry. A tree with custom
kinds has a set of its own: the rows of `core` or `library`, then the custom ones.
"""

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType
from typing import Any

import warp as wp

from blobtree.declare.claims import OperatorRow
from blobtree.declare.falloff import Falloff
from blobtree.declare.field import FieldKind
from blobtree.declare.registry import LIBRARY_ROWS, load_libraries
from blobtree.declare.skeleton import Skeleton
from blobtree.declare.warp import SpaceWarp
from blobtree.formulas.falloff import FALLOFFS
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.lazy import Lazy
from blobtree.tape.dispatch import LOCK, core_tables
from blobtree.tape.extras import gradient_evaluations
from blobtree.transpile.derivative import derivative_along, differentiated
from blobtree.transpile.specialize import rebind, referenced_values, row_choice, warp_function

Row = Skeleton | OperatorRow | SpaceWarp | FieldKind | Falloff

_ROW_OF_TABLE: dict[str, type[Row]] = {
    "skeletons": Skeleton,
    "operators": OperatorRow,
    "warps": SpaceWarp,
    "fields": FieldKind,
    "falloffs": Falloff,
}


@dataclass(frozen=True)
class InstructionSet:
    """The rows that codes on a tape stand for; core rows come first, then library rows."""

    skeletons: tuple[Skeleton, ...]
    operators: tuple[OperatorRow, ...]
    warps: tuple[SpaceWarp, ...]
    fields: tuple[FieldKind, ...]
    falloffs: tuple[Falloff, ...] = FALLOFFS
    _kernels: dict[wp.Kernel, wp.Kernel] = field(default_factory=dict, compare=False, repr=False)
    _functions: dict[wp.Function, wp.Function] = field(default_factory=dict, compare=False, repr=False)

    @property
    def rows(self) -> tuple[Row, ...]:
        """All rows."""
        return (*self.skeletons, *self.operators, *self.warps, *self.fields, *self.falloffs)

    def with_rows(self, rows: Iterable[Row]) -> "InstructionSet":
        """Return an instruction set with more rows, behind these in a fixed order."""
        more = sorted(set(rows).difference(self.rows), key=lambda row: (row.name, row.digest))
        tables: dict[str, Any] = {
            name: (*getattr(self, name), *(row for row in more if isinstance(row, kind)))
            for name, kind in _ROW_OF_TABLE.items()
        }
        return InstructionSet(**tables)

    def codes_of(self, rows: Iterable[Row]) -> dict[str, tuple[int, ...]]:
        """Return the codes of rows, in ascending order, by the names of their tables."""
        among = set(rows)
        return {
            name: tuple(code for code, row in enumerate(getattr(self, name)) if row in among)
            for name in _ROW_OF_TABLE
        }

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
        if self is core():
            return kernel
        with LOCK:
            if kernel not in self._kernels:
                self._kernels[kernel] = self._instantiate_kernel(kernel)
            return self._kernels[kernel]

    def function_for(self, function: wp.Function) -> wp.Function:
        """Return a typed function for tapes of this instruction set; itself if it reads no table."""
        with LOCK:
            return self._instantiate(self._exchanged(function))

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
            source_function, directions = primal
            instance = self._instantiate(self._exchanged(source_function))
            self._functions[function] = (
                function if instance is source_function else derivative_along(instance, directions)
            )
        if function not in self._functions and (choice := row_choice(function)):
            rows, module = getattr(self, choice.table), self._module_of(choice.prototype)
            same = rows is core_tables()[choice.table]
            self._functions[function] = function if same else choice.over(rows, module)
        if function not in self._functions:
            source = _python_function(function)
            replaced = self._replaced(source)
            copy = rebind(source, replaced, module=self._module_of(source)) if replaced else None
            self._functions[function] = warp_function(copy) if copy else function
        return self._functions[function]

    def _replaced(self, function: FunctionType) -> dict[str, Any]:
        """Return the values that replace names in `function`."""
        substitutes = {
            name: (value, self._substitute(value)) for name, value in referenced_values(function).items()
        }
        return {name: new for name, (old, new) in substitutes.items() if new is not old}

    def _substitute(self, value: Any) -> Any:
        if isinstance(value, wp.Function) and not value.is_builtin():
            return self._instantiate(self._exchanged(value))
        return value

    def _exchanged(self, function: wp.Function) -> wp.Function:
        """Return the evaluation that knows gradients for one that does not, if an operator reads them."""
        if not self.reads_gradients:
            return function
        exchanged: wp.Function = gradient_evaluations().get(function, function)
        return exchanged

    def _module_of(self, function: FunctionType) -> str:
        name = re.sub(r"\W+", "_", function.__qualname__)
        return f"{function.__module__}.{name}_{self.digest}"


def _python_function(typed: wp.Function | wp.Kernel) -> FunctionType:
    function = typed.func
    assert isinstance(function, FunctionType)
    return function


_created: list[InstructionSet] = []
"""All instruction sets: that of the core, that with the library, then others."""


def core() -> InstructionSet:
    """Return the instruction set of trees of core kinds."""
    if not _created:
        tables: dict[str, Any] = core_tables()
        with LOCK:
            if not _created:
                _created.append(InstructionSet(**tables))
    return _created[0]


@cache
def library() -> InstructionSet:
    """Return the instruction set of trees with library kinds, whose formulas take long to import."""
    load_libraries()
    only = core()
    with LOCK:
        if len(_created) == 1:
            _created.append(only.with_rows(LIBRARY_ROWS))
        return _created[1]


def instruction_set_for(rows: Iterable[Row]) -> InstructionSet:
    """Return an instruction set that has these rows.

    That is the smallest existing one, so that a tree with fewer kinds than an earlier tree compiles nothing.
    If none fits, a new one has the rows of `core` or `library`, and then the custom rows in a fixed order.
    """
    needed = set(rows)
    if needed.issubset(core().rows):
        return core()
    with_library = library()
    reads_gradients = any(isinstance(row, OperatorRow) and row.gradients for row in needed)
    with LOCK:
        fitting = [
            existing
            for existing in _created
            if needed.issubset(existing.rows) and existing.reads_gradients == reads_gradients
        ]
        if fitting:
            return min(fitting, key=lambda existing: len(existing.rows))
        custom = needed.difference(with_library.rows)
        base = core() if needed.issubset({*core().rows, *custom}) else with_library
        created = base.with_rows(needed)
        _created.append(created)
        return created


@cache
def single_skeleton_set(skeleton: Skeleton) -> InstructionSet:
    """Return the instruction set of one skeleton, whose code is 0."""
    return InstructionSet((skeleton,), core().operators, core().warps, ())
