"""Derivatives of Warp's operators and built-in functions: one rule each.

A rule is one text per argument: the derivative of the result where that argument alone moves along its
tangent. The texts are linear in the tangent, so the derivative of a call is the sum of those of the arguments
that move. In a text `{0}`, `{1}` and `{2}` are the arguments, `{d}` is the tangent of the argument and `{r}`
the result. Where a function has a kink or an infinite slope, one side's derivative or 0 is taken, so that no
derivative is infinite.
"""

from typing import NamedTuple

import warp as wp


class Rule(NamedTuple):
    """The derivatives of a built-in function, by its arguments."""

    partials: tuple[str, ...]
    scalar: bool = False
    """The result is a float; otherwise it has the type of the first argument that is no bool."""
    componentwise: bool = False
    """A function of vectors that works on each component, so that a rule of floats serves it."""


def _function(*partials: str) -> Rule:
    return Rule(partials)


def _measure(*partials: str) -> Rule:
    return Rule(partials, scalar=True)


def _by_component(*partials: str) -> Rule:
    return Rule(partials, componentwise=True)


RULES: dict[str, Rule] = {
    "abs": _by_component("wp.where({0} < 0.0, -{d}, {d})"),
    "min": _by_component("wp.where({0} <= {1}, {d}, 0.0)", "wp.where({0} <= {1}, 0.0, {d})"),
    "max": _by_component("wp.where({0} >= {1}, {d}, 0.0)", "wp.where({0} >= {1}, 0.0, {d})"),
    "clamp": _by_component(
        "wp.where({0} >= {1} and {0} <= {2}, {d}, 0.0)",
        "wp.where({0} < {1} and {1} <= {2}, {d}, 0.0)",
        "wp.where({0} > {2} or {1} > {2}, {d}, 0.0)",
    ),
    "sqrt": _function("wp.where({r} > 0.0, 0.5 * {d} / {r}, 0.0)"),
    "exp": _function("{r} * {d}"),
    "log": _function("{d} / {0}"),
    "pow": _function(
        "wp.where({0} == 0.0, wp.where({1} == 1.0, {d}, 0.0), {1} * wp.pow({0}, {1} - 1.0) * {d})",
        "wp.where({0} > 0.0, {r} * wp.log({0}) * {d}, 0.0)",
    ),
    "log2": _function("{d} / ({0} * 0.6931471806)"),
    "log10": _function("{d} / ({0} * 2.302585093)"),
    "cbrt": _function("wp.where({r} != 0.0, {d} / (3.0 * {r} * {r}), 0.0)"),
    "frac": _function("{d}"),
    "degrees": _function("wp.degrees({d})"),
    "radians": _function("wp.radians({d})"),
    "sinh": _function("wp.cosh({0}) * {d}"),
    "cosh": _function("wp.sinh({0}) * {d}"),
    "tanh": _function("(1.0 - {r} * {r}) * {d}"),
    "sin": _function("wp.cos({0}) * {d}"),
    "cos": _function("-(wp.sin({0}) * {d})"),
    "tan": _function("(1.0 + {r} * {r}) * {d}"),
    "asin": _function("wp.where(wp.abs({0}) < 1.0, {d} / wp.sqrt(1.0 - {0} * {0}), 0.0)"),
    "acos": _function("wp.where(wp.abs({0}) < 1.0, -{d} / wp.sqrt(1.0 - {0} * {0}), 0.0)"),
    "atan": _function("{d} / (1.0 + {0} * {0})"),
    "atan2": _function(
        "wp.where({0} * {0} + {1} * {1} > 0.0, {1} * {d} / ({0} * {0} + {1} * {1}), 0.0)",
        "wp.where({0} * {0} + {1} * {1} > 0.0, -({0} * {d}) / ({0} * {0} + {1} * {1}), 0.0)",
    ),
    "lerp": _function("{d} * (1.0 - {2})", "{d} * {2}", "({1} - {0}) * {d}"),
    "where": _function("", "wp.where({0}, {d}, {zero})", "wp.where({0}, {zero}, {d})"),
    "dot": _measure("wp.dot({d}, {1})", "wp.dot({0}, {d})"),
    "length": _measure("wp.where({r} > 0.0, wp.dot({0}, {d}) / {r}, 0.0)"),
    "length_sq": _measure("2.0 * wp.dot({0}, {d})"),
    "cross": _function("wp.cross({d}, {1})", "wp.cross({0}, {d})"),
    "normalize": _function(
        "wp.where(wp.length({0}) > 0.0, ({d} - {r} * wp.dot({r}, {d})) / wp.length({0}), {zero})"
    ),
    "cw_mul": _function("wp.cw_mul({d}, {1})", "wp.cw_mul({0}, {d})"),
    "cw_div": _function("wp.cw_div({d}, {1})", "-wp.cw_div(wp.cw_mul({r}, {d}), {1})"),
    "+": _function("{d}", "{d}"),
    "-": _function("{d}", "-{d}"),
    "*": _function("{d} * {1}", "{0} * {d}"),
    "/": _function("{d} / {1}", "-({r} * {d}) / {1}"),
    "%": _function("{d}", "-(wp.trunc({0} / {1}) * {d})"),
    "negative": _function("-{d}"),
}
"""Rules by the names of Warp's functions, and by the signs of operators."""

STEPS = frozenset({"ceil", "floor", "rint", "round", "sign", "step", "trunc"})
"""Functions whose derivative is 0 wherever they have one; their results have the type of their argument."""

CASTS: dict[str, type] = {"float32": wp.float32, "int32": wp.int32, "uint32": wp.uint32}
"""Casts that are functions of Warp, with the types of their results."""
