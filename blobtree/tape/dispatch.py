"""Dispatch by a code on the tape: functions that return, or call, what one row of a table has.

A row's function may declare fewer parameters than its dispatch: it gets the first ones. So operators without
several parameters do not take the tape. `decals/rendering/tracing_shader.py` writes the same dispatch in
GLSL, over the kinds in use alone.

The methods of the kinds' classes import this file. So `core_tables` fills the functions later, when the first
tape is compiled.
"""

import os
from collections.abc import Callable
from threading import RLock
from types import FunctionType
from typing import Any

import warp as wp

from blobtree.declare.registry import load_core, row_of
from blobtree.formulas.falloff import FALLOFFS
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import OPERATORS, SKELETONS, WARPS
from blobtree.texels import Texels
from blobtree.transpile.specialize import RowChoice

wp.set_module_options(KERNEL_OPTIONS)

LOCK = RLock()
"""Held while functions are registered: Warp's registry is not safe for threads."""

if hasattr(os, "register_at_fork"):  # a child forked while another thread holds the lock would wait forever
    os.register_at_fork(before=LOCK.acquire, after_in_parent=LOCK.release, after_in_child=LOCK.release)

_choices: list[tuple[RowChoice, wp.Function]] = []
_core_tables: dict[str, tuple[Any, ...]] = {}


def of_row(table: str, attribute: str = "") -> Callable[[FunctionType], Any]:
    """Return a decorator that gives a function its body: the attribute, of its name, of a row."""

    def open_choice(prototype: FunctionType) -> Any:
        choice = RowChoice(prototype, table, attribute or prototype.__name__)
        function = choice.over((), prototype.__module__)
        _choices.append((choice, function))
        return function

    return open_choice


def core_tables() -> dict[str, tuple[Any, ...]]:
    """Return the tables of core kinds by their names in instruction sets.

    The first call fills the functions of this file. Derive functions that call them after it.
    """
    if not _core_tables:
        load_core()
        with LOCK:
            if not _core_tables:
                tables = {"skeletons": SKELETONS, "operators": OPERATORS, "warps": WARPS, "fields": ()}
                rows = {name: tuple(map(row_of, tags)) for name, tags in tables.items()}
                rows["falloffs"] = FALLOFFS
                for choice, function in _choices:
                    choice.fill(function, rows[choice.table])
                _core_tables.update(rows)
    return _core_tables


@of_row("skeletons")
def closest(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the closest point of a skeleton, and its influence there."""


@of_row("skeletons", "influence_near")
def influence_around(kind: wp.int32, tape: Texels, at: wp.int32, q: wp.vec3, c: wp.vec4) -> wp.float32:
    """Return `influence_bound` of a skeleton, c being its closest point to q."""


@of_row("skeletons")
def depth(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return `Skeleton.depth`."""


@of_row("skeletons")
def apart(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return `Skeleton.apart`."""


@of_row("skeletons")
def stride(kind: wp.int32) -> wp.int32:
    """Return the number of texels of a primitive: its parameters and its colour."""


@of_row("skeletons", "convex")
def is_convex(kind: wp.int32) -> wp.bool:
    """Return `Skeleton.convex`."""


@of_row("fields", "value_gradient")
def kind_value_gradient(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return `FieldKind.value_gradient`."""


@of_row("fields", "bounds")
def kind_bounds(kind: wp.int32, center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return `FieldKind.bounds`."""


@of_row("fields", "has_distances")
def has_distances(kind: wp.int32) -> wp.bool:
    """Return `FieldKind.has_distances`."""


@of_row("fields", "distance_at")
def kind_distance_at(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return `FieldKind.distance_at`."""


@of_row("fields", "distance_along")
def kind_distance_along(
    kind: wp.int32, q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Return `FieldKind.distance_along`."""


@of_row("fields", "distance_within")
def kind_distance_within(
    kind: wp.int32, center: wp.vec3, half: wp.vec3, tape: Texels, at: wp.int32
) -> wp.vec2:
    """Return `FieldKind.distance_within`."""


@of_row("fields", "distance")
def is_distance(kind: wp.int32) -> wp.bool:
    """Return `FieldKind.distance`."""


@of_row("fields", "windowed")
def is_windowed(kind: wp.int32) -> wp.bool:
    """Return `FieldKind.windowed`."""


@of_row("fields", "stride")
def direct_stride(kind: wp.int32) -> wp.int32:
    """Return the number of texels of a direct field behind its map: its parameters and its colour."""


@of_row("fields", "has_sheets")
def has_sheets(kind: wp.int32) -> wp.bool:
    """Return `FieldKind.has_sheets`."""


@of_row("fields", "sheet_at")
def kind_sheet_at(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.int32:
    """Return `FieldKind.sheet_at`."""


@of_row("fields", "sheet_value_gradient")
def kind_sheet_value_gradient(
    kind: wp.int32, q: wp.vec3, sheet: wp.int32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Return `FieldKind.sheet_value_gradient`."""


@of_row("fields", "part_size")
def kind_part_size(
    kind: wp.int32, center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32
) -> wp.float32:
    """Return `FieldKind.part_size`."""


@of_row("operators", "monotone")
def is_monotone(operator: wp.int32) -> wp.bool:
    """Return `Operator.monotone`."""


@of_row("operators")
def paints(operator: wp.int32) -> wp.bool:
    """Return `Operator.paints`."""


@of_row("operators")
def partials(
    operator: wp.int32, a: wp.float32, b: wp.float32, parameter: wp.float32, tape: Texels
) -> wp.vec3:
    """Return the value and the partial derivatives of an operator."""


@of_row("operators")
def slope(
    operator: wp.int32,
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
) -> wp.float32:
    """Return the slope bound of an operator."""


@of_row("operators", "range")
def operator_range(
    operator: wp.int32, a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels
) -> wp.vec2:
    """Return the range of an operator's result."""


@of_row("operators", "choice")
def operator_choice(
    operator: wp.int32, a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels
) -> wp.int32:
    """Return the operands on which an operator's result depends, as KEEP_…."""


@of_row("operators")
def starts_from_zero(operator: wp.int32) -> wp.bool:
    """Return `Operator.starts_from_zero`."""


@of_row("operators", "gradients")
def reads_gradients(operator: wp.int32) -> wp.bool:
    """Return `Operator.gradients`."""


@of_row("operators", "partials")
def directed_partials(
    operator: wp.int32,
    a: wp.float32,
    b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
    direction_a: wp.vec3,
    direction_b: wp.vec3,
) -> wp.vec3:
    """Do the same as `partials`, also for operators that read gradients."""


@of_row("operators", "slope")
def directed_slope(
    operator: wp.int32,
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
    turn: wp.float32,
) -> wp.float32:
    """Do the same as `slope`, also for operators that read gradients."""


@of_row("warps", "forward")
def warp_forward(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return T(q) of a warp, whose parameters begin at tape[at]."""


@of_row("warps", "pullback")
def warp_pullback(kind: wp.int32, q: wp.vec3, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return Jᵀ g of a warp."""


@of_row("warps", "lipschitz")
def warp_stretch(kind: wp.int32, q: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return a bound on ‖J‖ of a warp over a ball."""


@of_row("warps", "image_box")
def warp_extent(kind: wp.int32, q: wp.vec3, half: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return half the size of a box about T(q) that holds the image of the box q ± half."""


@of_row("warps", "texel")
def warp_texel(
    kind: wp.int32,
    q: wp.vec3,
    reach: wp.float32,
    kept: wp.vec4,
    number: wp.int32,
    tape: Texels,
    at: wp.int32,
) -> wp.vec4:
    """Return the texel tape[at + number] = kept of a warp in a tape that is pruned to a ball about q."""


@of_row("falloffs", "value")
def falloff_value(kind: wp.int32, distance: wp.float32) -> wp.float32:
    """Return g(d) of a falloff, 0 ≤ d ≤ 1."""


@of_row("falloffs", "slope")
def falloff_slope(kind: wp.int32, distance: wp.float32) -> wp.float32:
    """Return g'(d) of a falloff, 0 ≤ d ≤ 1."""


@of_row("falloffs", "numbers")
def falloff_numbers(kind: wp.int32) -> wp.vec3:
    """Return `Falloff.numbers`."""
