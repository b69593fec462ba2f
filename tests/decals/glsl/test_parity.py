"""Every typed function that shaders share, in Warp and GLSL, on the same numbers."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from blobtree.tape.dispatch import (
    falloff_numbers,
    falloff_slope,
    falloff_value,
    is_distance,
    is_monotone,
    is_windowed,
    paints,
    partials,
    slope,
    warp_forward,
    warp_pullback,
    warp_stretch,
)
from blobtree.tape.instruction_set import core
from blobtree.transpile.builtins import BUILTINS, HELPERS, Expression
from blobtree.transpile.glsl import translate_library
from decals.rendering import Context
from decals.rendering.tracing_shader import _dispatch
from tests.blobtree.transpile.warp_functions import TypedFunction, call, typed_functions
from tests.decals.glsl.arguments import COUNT, arguments_of
from tests.decals.glsl.functions import AGREEMENT, ALL_KINDS, run_program, through_glsl

MODULES = (
    "blobtree.formulas.falloff",
    "blobtree.formulas.falloffs",
    "blobtree.formulas.skeletons",
    "blobtree.declare.claims",
    "blobtree.nodes.tree",
    "blobtree.nodes.primitives",
    "blobtree.tape.dispatch",
    "blobtree.tape.evaluators",
    "blobtree.tracing.ray_kernels",
    "decals.field.contact",
    "decals.field.mapping",
    "decals.index.lookup",
    "decals.field.radial",
    "decals.field.elastic",
    "decals.record",
    "decals.field.ownership",
)
OF_WARP_ALONE = {
    "direct_within",
    "has_sheets",
    "kind_distance_within",
    "kind_sheet_at",
    "kind_sheet_value_gradient",
    "operator_choice",
    "operator_range",
    "starts_from_zero",
    "unknown_extent",
    "warp_extent",
    "kind_part_size",
}
"""Functions that no shader calls."""

WRITTEN_TWICE = {
    "apart",
    "closest",
    "depth",
    "influence_around",
    "stride",
    "is_convex",
    "is_monotone",
    "paints",
    "falloff_numbers",
    "has_distances",
    "is_distance",
    "is_windowed",
}
"""Switches over the tables, written per backend."""

OF_LIBRARY_KINDS = {
    "direct_value_gradient",
    "direct_bounds",
    "direct_change",
    "direct_value",
    "kind_value_gradient",
    "kind_bounds",
    "kind_distance_along",
    "kind_distance_at",
    "value_direct",
    "bound_direct",
    "gradient_direct",
    "color_direct",
    "directed_partials",
    "directed_slope",
}
"""Functions of direct fields and of operators that read gradients.

The core tables have none of these, and `test_tapes` compares the library's.
"""


def shared(module: str) -> list[TypedFunction]:
    """What both backends have from one source, save what reads a whole tape: see `test_glsl_tapes`."""
    functions = typed_functions(import_module(module))
    left_out, whole_tapes = OF_WARP_ALONE | WRITTEN_TWICE | OF_LIBRARY_KINDS, {"span", "cells"}
    return [f for f in functions if f.name not in left_out and not whole_tapes & set(f.parameters)]


FUNCTIONS = {f"{module}.{typed.name}": typed for module in MODULES for typed in shared(module)}
CHOOSERS: list[Any] = [
    partials,
    is_distance,
    is_monotone,
    is_windowed,
    paints,
    slope,
    warp_forward,
    warp_pullback,
    warp_stretch,
    falloff_value,
    falloff_slope,
    falloff_numbers,
]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_the_same_in_both_languages(context: Context, name: str) -> None:
    typed = FUNCTIONS[name]
    arguments = arguments_of(typed)
    library = _dispatch(ALL_KINDS)
    rows_of_operators = [f for operator in core().operators for f in (operator.partials, operator.slope)]
    rows_of_warps = [f for warp in core().warps for f in (warp.forward, warp.pullback, warp.lipschitz)]
    rows_of_falloffs = [f for row in core().falloffs for f in (row.value, row.slope)]
    chosen = [*rows_of_operators, *rows_of_warps, *rows_of_falloffs]
    if typed.function in CHOOSERS:
        library = translate_library(chosen) + library
    else:
        library = translate_library([typed.function, *chosen], provided=CHOOSERS) + library
    count = COUNT if typed.parameters else 1
    seen = through_glsl(context, typed, library, arguments, count)
    expected = call(typed.function, **arguments).reshape(count, -1)
    seen = seen[:, : expected.shape[1]]
    if expected.dtype.kind in "iub":
        np.testing.assert_array_equal(seen.astype(expected.dtype), expected)
        return
    assert np.isfinite(expected).all()
    error = np.abs(seen - expected) / np.maximum(1.0, np.abs(expected))
    worst = np.unravel_index(error.argmax(), error.shape)[0]
    at_worst = {key: value[worst] for key, value in arguments.items() if np.shape(value)[:1] == (count,)}
    assert error.max() <= AGREEMENT, f"{error.max()}: {seen[worst]} and {expected[worst]} at {at_worst}"
    assert not typed.parameters or typed.returned is None or np.ptp(expected) > 0.0, "they never change"


ANGLES = """#version 330 core
uniform sampler2D points;
out vec4 result;
void main() {
    vec2 p = texelFetch(points, ivec2(gl_FragCoord.xy), 0).xy;
    float share = clamp(p.x, -1.0, 1.0);
    result = vec4(%s);
}
"""


def test_angles_are_as_exact_as_float32(context: Context) -> None:
    """Functions of drivers have errors of 1e-6 and more, which bends and convolution surfaces magnify."""
    rng = np.random.default_rng(0)
    points = np.zeros((4000, 4), np.float32)
    points[:, :2] = rng.normal(size=(4000, 2)) * 10.0 ** rng.uniform(-3.0, 3.0, (4000, 2))
    points[:8, :2] = [(0, 1), (1, 0), (0, -1), (-1, 0), (0, 0), (1, 1), (-1, 1), (1e-30, 1e-30)]
    arguments = {"atan2": ("p.y", "p.x"), "atan": ("p.y",), "asin": ("share",), "acos": ("share",)}
    calls = [
        BUILTINS[name](*(Expression(argument, "float") for argument in used)).code
        for name, used in arguments.items()
    ]
    source = ANGLES.replace("uniform", HELPERS + "uniform", 1) % ", ".join(calls)
    seen = run_program(context, source, len(points), {"points": points}, {})
    x, y = points[:, :2].astype(np.float64).T
    share = np.clip(x, -1.0, 1.0)
    exact = np.stack([np.arctan2(y, x), np.arctan(y), np.arcsin(share), np.arccos(share)], axis=1)
    np.testing.assert_allclose(seen, exact, rtol=5e-7, atol=5e-7)


NUMBERS = """#version 330 core
uniform sampler2D points;
out vec4 result;
void main() {
    float x = texelFetch(points, ivec2(gl_FragCoord.xy), 0).x;
    result = vec4(%s);
}
"""
MORE_MATHS: dict[str, Callable[[Any], Any]] = {
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "cbrt": np.cbrt,
    "round": lambda x: np.trunc(x + np.copysign(0.5, x)),
    "rint": np.rint,
    "frac": lambda x: x - np.trunc(x),
    "step": lambda x: np.where(x < 0.0, 1.0, 0.0),
    "degrees": np.degrees,
    "radians": np.radians,
    "log2": lambda x: np.log2(np.abs(x)),
    "log10": lambda x: np.log10(np.abs(x)),
}


def test_more_maths_is_as_exact_as_float32(context: Context) -> None:
    """Beside 0, where exponentials cancel; at halves, where numbers are rounded; and where float32 ends."""
    rng = np.random.default_rng(1)
    points = np.zeros((4000, 4), np.float32)
    points[:, 0] = rng.normal(size=4000) * 10.0 ** rng.uniform(-6.0, 1.3, 4000)
    points[:10, 0] = (-2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 0.49999997, -0.49999997, 88.0, -88.0)
    x = points[:, 0].astype(np.float64)
    for names in np.array_split(np.array(list(MORE_MATHS)), 3):
        calls = [
            BUILTINS[name](Expression("abs(x)" if name.startswith("log") else "x", "float")).code
            for name in names
        ]
        source = NUMBERS.replace("uniform", HELPERS + "uniform", 1) % ", ".join(calls)
        seen = run_program(context, source, len(points), {"points": points}, {})
        exact = np.stack([MORE_MATHS[name](x) for name in names], axis=1)
        for column, name in enumerate(names):
            wrong = ~np.isclose(seen[:, column], exact[:, column], rtol=3e-6, atol=2e-7)
            assert not wrong.any(), (name, x[wrong][:3], seen[wrong, column][:3], exact[wrong, column][:3])
