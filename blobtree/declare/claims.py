"""Rows of operators: what kernels, programs and bounds know of an operator, and what its claims imply.

An operator is two typed functions:

* `partials(a, b, parameter) -> vec3(F, ∂F/∂a, ∂F/∂b)`;
* `slope(slope_a, slope_b, max_a, max_b, parameter)`: a bound on |∇F| where the operands' gradients are
  bounded by slope_a, slope_b and their values by max_a, max_b. The tracer relies on it, for slopes along a
  ray too.

Two more prune the operands of a cell; a = (smallest, largest) value of the operand over the cell:

* `range(a, b, parameter) -> (smallest, largest)` of F;
* `choice(a, b) -> KEEP_…`: the operands on which F depends there.

An operator with several parameters reads them from the tape, which its functions then take too. One that
reads gradients takes more behind that. `partials` gets the directions ∇a and ∇b, and returns ∂F/∂a and ∂F/∂b
for fixed directions. `slope` gets a bound on the speed at which the angle between the directions changes, in
radians per unit; it is `UNBOUNDED` where none is known.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

import warp as wp

from blobtree.texels import Texels
from blobtree.transpile.specialize import defined, parameter_count, warp_function

wp.set_module_options({"enable_backward": False})

UNBOUNDED = wp.constant(1e12)
"""A slope above all slopes of fields."""


KEEP_BOTH = 0
KEEP_LEFT = 1
KEEP_RIGHT = 2
KEEP_NONE = 3


@wp.func
def blend_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Return the dependence of a blend: on every operand that is not 0 everywhere."""
    if b[1] <= 0.0 and b[0] >= 0.0:
        return KEEP_LEFT
    if a[1] <= 0.0 and a[0] >= 0.0:
        return KEEP_RIGHT
    return KEEP_BOTH


CUSTOM_ROUNDING = 4e-6
"""Relative widening of a custom operator's range, for the rounding errors of the user's formula."""


@wp.func
def intersection_like_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Keep nothing where an operand is absent."""
    if a[1] <= 0.0 or b[1] <= 0.0:
        return KEEP_NONE
    return KEEP_BOTH


@wp.func
def difference_like_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Keep nothing where the first operand is absent, and the first alone where the second is."""
    if a[1] <= 0.0:
        return KEEP_NONE
    if b[1] <= 0.0:
        return KEEP_LEFT
    return KEEP_BOTH


@wp.func
def unclaimed_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Keep nothing where both operands are absent, and both elsewhere."""
    if a[1] <= 0.0 and b[1] <= 0.0:
        return KEEP_NONE
    return KEEP_BOTH


@wp.func
def widened_range(smallest: wp.float32, largest: wp.float32) -> wp.vec2:
    """Return a range widened for rounding, never below 0."""
    return wp.vec2(
        wp.max(smallest - CUSTOM_ROUNDING * (1.0 + smallest), 0.0),
        largest + CUSTOM_ROUNDING * (1.0 + largest),
    )


def monotone_range(partials: wp.Function, like: str | None) -> wp.Function:
    """Return the range of an operator without one, see `OperatorRow`."""
    falls_with_b = like == "difference"
    names = ["a", "b", "parameter", "tape"][: parameter_count(partials)]
    types = {"a": wp.vec2, "b": wp.vec2, "parameter": wp.float32, "tape": Texels}
    low, high = ("a[0], b[1]", "a[1], b[0]") if falls_with_b else ("a[0], b[0]", "a[1], b[1]")
    key, rest = f"{partials.key.removesuffix('_partials')}_range", ", ".join(["", *names[2:]])
    text = (
        f"def {key}({', '.join(names)}):\n"
        f"    return widened_range(partials({low}{rest})[0], partials({high}{rest})[0])\n"
    )
    scope = {"partials": partials, "widened_range": widened_range, "__name__": partials.func.__module__}
    function = defined(key, text, scope)
    function.__doc__ = (
        "F rises with a and falls with b." if falls_with_b else "F is monotone in both operands."
    )
    function.__annotations__ = {name: types[name] for name in names} | {"return": wp.vec2}
    return warp_function(function)


class Support(Enum):
    """Part of space in which F(a, b) may differ from 0."""

    EITHER = "where a or b differs from 0"
    LEFT = "where a differs from 0; b removes from it"
    COMMON = "where both a and b differ from 0"


Like = Literal["blend", "intersection", "difference"]
"""What F is where an operand is absent (0): the other one; 0; a without b, and 0 without a."""

_SUPPORTS = {"intersection": Support.COMMON, "difference": Support.LEFT}
_CHOICES = {
    "blend": blend_choice,
    "intersection": intersection_like_choice,
    "difference": difference_like_choice,
    None: unclaimed_choice,
}


@dataclass(frozen=True, eq=False)
class OperatorRow:
    """An operator's name, functions and claims.

    Pruning and the part of space where F acts follow from `like`; a sharper `choice` takes its place. An
    operator without a `range` never falls as a grows, nor as b does, or, like a difference, nor rises with b.
    """

    name: str
    partials: wp.Function
    slope: wp.Function
    like: Like | None
    """None for other operators; F is 0 where both operands are 0."""
    range: Any = None
    choice: Any = None
    commutes: bool = True
    """True if operands may be exchanged and nested in any way."""
    monotone: bool = False
    """F never falls where its operands rise, and `slope` takes slopes below 0, of operands that fall."""
    paints: bool = True
    """True if the second operand's colour shows where F depends on it; else F has the first one's."""
    signed: bool = False
    """Operands below 0 act as they are; those of other operators are raised to 0."""
    gradients: bool = False
    """`partials` also takes ∇a and ∇b, and `slope` a bound on their turning."""
    digest: str = ""
    """Digest of the sources of a custom operator."""

    def __post_init__(self) -> None:
        if self.choice is None:
            object.__setattr__(self, "choice", _CHOICES[self.like])
        if self.range is None:
            object.__setattr__(self, "range", monotone_range(self.partials, self.like))

    @property
    def starts_from_zero(self) -> bool:
        """True if F(0, b) = b, so that a fold may start from the empty field."""
        return self.like == "blend"

    @property
    def support(self) -> Support:
        """The part of space in which F may differ from 0."""
        return _SUPPORTS.get(self.like, Support.EITHER)
