"""Rows of direct fields: leaves whose field is a function of position itself, not a falloff of a distance.

A row is two typed functions, which read their parameters from `tape[at:]`; `FieldFormulas` makes them:

* `value_gradient(q, tape, at) -> vec4(f, ∇f)`;
* `bounds(center, radius, tape, at) -> vec3(smallest f, largest f, largest |∇f|)` over a ball, or wider ones.
  Cells are pruned by the range, and rays take steps by the slope.

f is 0 far away, ½ on the surface and larger inside. It is exactly 0 outside a bounded box, which the node
class states, and there its bounds are 0 too as soon as the ball does not reach the box.

A kind with `distance` returns a distance u in place of f, which is RIM on the surface and 1 where the field
ends by default. The field is a falloff of u, which the leaf chooses. The field of a kind with `windowed` has
no end of its own: it is multiplied by the window of a box (`formulas.windows`). Both are done around these
functions, and so is the factor `weight` (`tape.evaluators.direct_value_gradient`).

A distance of this package may have three more functions: of u alone, of its range and rates along a line, and
of its range in a box.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree.declare.readers import PLACE, PointFormulas, Reader, require_numbers
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

RESULTS: dict[str, Any] = {
    "value": wp.float32,
    "value_gradient": wp.vec4,
    "lipschitz": wp.float32,
    "interval": wp.vec2,
    "bounds": wp.vec3,
    "sheet_at": wp.int32,
    "sheet_value_gradient": wp.vec4,
    "part_size": wp.float32,
}
"""The formulas of a direct field, and the types of their results."""

DISTANCES: dict[str, Any] = {
    "distance_at": wp.float32,
    "distance_along": wp.vec4,
    "distance_within": wp.vec2,
}
"""Sharper formulas that a distance of this package may have, all or none, and the types of their results."""

ROUNDING = 4e-6
"""Widening of the range of a field that claims no `bounds`, for the rounding errors of its formula."""

BEHIND_BOX = 7
"""Place of the first number of a field in a box, in floats: behind middle, `fade` and half lengths."""

_CLAIMS = ("lipschitz", "interval", "bounds", "sheet_at", "sheet_value_gradient", "part_size")
_POINT: dict[str, Any] = {"q": wp.vec3}
_SHEET: dict[str, Any] = {"q": wp.vec3, "sheet": wp.int32}
_BALL: dict[str, Any] = {"center": wp.vec3, "radius": wp.float32}
_LEADING: dict[str, dict[str, Any]] = {
    **dict.fromkeys(RESULTS, _BALL),
    "sheet_at": _POINT,
    "sheet_value_gradient": _SHEET,
    "distance_at": _POINT,
    "distance_along": {"q": wp.vec3, "direction": wp.vec3, "reach": wp.float32},
    "distance_within": {"center": wp.vec3, "half": wp.vec3},
}


@wp.func
def no_distance_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return 0 for a kind without a formula of its own; nothing reads it."""
    return 0.0


@wp.func
def no_distance_along(
    q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Do the same for a range and rates."""
    return wp.vec4(0.0, 0.0, 0.0, 0.0)


@wp.func
def no_distance_within(center: wp.vec3, half: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec2:
    """Do the same for a range."""
    return wp.vec2(0.0, 0.0)


@dataclass(frozen=True, eq=False)
class FieldKind:
    """The name, functions and size on the tape of a direct field."""

    name: str
    value_gradient: wp.Function
    bounds: wp.Function
    parameters: int
    """Number of texels (vec4) of its parameters on the tape."""
    distance: bool = False
    """The functions return a distance, of which the field is a falloff."""
    windowed: bool = False
    """The field ends at a box with tape[at] = (middle, fade) and tape[at + 1] = (half lengths, ·)."""
    digest: str = ""
    """Digest of the sources of a custom kind."""
    sheet_at: wp.Function | int = 0
    """The function (q, tape, at) of the smooth piece of the surface at a point, from 1 on; 0 for none."""
    own_sheet: wp.Function | None = None
    """The function (q, sheet, tape, at) of the value and the gradient of a piece, beyond its edges too."""
    part_size: wp.Function | float = 0.0
    """The function (center, radius, tape, at) of half the least thickness in a ball; 0 for one number, the
    `inradii` of the kind."""

    distance_at: wp.Function = no_distance_at
    """The function (q, tape, at) of u alone, the same number as that of `value_gradient`."""
    distance_along: wp.Function = no_distance_along
    """The function (q, direction, reach, tape, at) of (smallest u, largest u, least du/dt, greatest du/dt) at
    q + t · direction for t from 0 to `reach`."""
    distance_within: wp.Function = no_distance_within
    """The function (center, half, tape, at) of (smallest u, largest u) in the box center ± half."""

    @property
    def has_distances(self) -> bool:
        """True for a kind with these three functions."""
        return self.distance_at is not no_distance_at

    @property
    def has_sheets(self) -> bool:
        """True if the surface has edges where smooth pieces meet."""
        return self.own_sheet is not None

    @property
    def sheet_value_gradient(self) -> wp.Function | tuple[float, ...]:
        """The function of a piece; a kind without pieces has zeros, which nothing reads."""
        return self.own_sheet or (0.0, 0.0, 0.0, 0.0)

    @property
    def stride(self) -> int:
        """Number of texels on the tape behind the map: the parameters and the colour."""
        return self.parameters + 1


@dataclass(frozen=True)
class FieldFormulas(PointFormulas):
    """The formulas and claims of a direct field, whose row they make."""

    sources = ("value_gradient", "value")
    lipschitz: Any
    extent: float
    distance: bool
    windowed: bool
    texels: int = 0
    """Number of texels of a kind whose formulas read the tape."""

    @property
    def size(self) -> int:
        """Number of numbers that it returns."""
        return 1 if "value" in self.given else 4

    def require(self, declared: Sequence[str] | None) -> None:
        """Raise `InvalidDefinition` for formulas or claims that do not fit, see `require_numbers`."""
        source = self.source
        require_numbers(source, self.given, _LEADING, declared)
        if len(self.given.keys() & {"sheet_at", "sheet_value_gradient"}) == 1:
            raise source.refusal("expected both formulas `sheet_at` and `sheet_value_gradient`, or none")
        if len(self.given.keys() & {"value", "value_gradient"}) == 2:
            raise source.refusal("expected one of the formulas `value` and `value_gradient`, got both")
        bound = self.lipschitz
        number = isinstance(bound, int | float | np.number) and not isinstance(bound, bool)
        if not self.given.keys() & {"lipschitz", "bounds"} and not (number and 0.0 <= bound < np.inf):
            raise source.refusal(f"lipschitz: expected a number from 0 or a typed function, got {bound!r}")

    def digest(self, parameters: Sequence[Any]) -> str:
        """Return a digest of the formulas, the claims, and the declared parameters."""
        claims = [self.given[name].digest if name in self.given else None for name in _CLAIMS]
        slope = claims[0] or float(self.lipschitz or 0.0)
        more = [claim for claim in claims[2:] if claim] + ["free"] * (not self.windowed)
        return self.source.digest_with(self.kind, tuple(parameters), (slope, claims[1]), *more)

    def row(self, digest: str = "") -> FieldKind:
        """Return the row of the field; one with a digest is a user's."""
        flags: dict[str, Any] = {"distance": self.distance, "windowed": self.windowed, "digest": digest}
        if self.numbers == PLACE:
            given = {name: part.function for name, part in self.given.items()}
            flags |= {"sheet_at": given.get("sheet_at", 0), "own_sheet": given.get("sheet_value_gradient")}
            flags["part_size"] = given.get("part_size", 0.0)
            flags |= {name: given[name] for name in DISTANCES if name in given}
            return FieldKind(self.kind, given["value_gradient"], given["bounds"], self.texels, **flags)
        reader = self.reader(digest, BEHIND_BOX if self.windowed else 0)
        x = "{} - wp.vec3(t0[0], t0[1], t0[2])" if self.windowed else "{}"
        value = self._value(reader, x.format("q"))
        bounds = self._bounds(reader, x.format("center"))
        if "sheet_at" in self.given:
            sheet_at, sheet = self.given["sheet_at"], self.given["sheet_value_gradient"]
            flags["sheet_at"] = reader.around("sheet_at", sheet_at, _POINT, wp.int32, x.format("q"))
            flags["own_sheet"] = reader.around(
                "sheet_value_gradient", sheet, _SHEET, wp.vec4, x.format("q"), "sheet"
            )
        if "part_size" in self.given:
            size = self.given["part_size"]
            flags["part_size"] = reader.around(
                "part_size", size, _BALL, wp.float32, x.format("center"), "radius"
            )
        return FieldKind(self.kind, value, bounds, reader.texels, **flags)

    def _value(self, reader: Reader, x: str) -> wp.Function:
        """Return the function of the field and its gradient, which is derived from `value`."""
        at_point, source = _POINT, self.source
        if "value" not in self.given:
            return reader.around("value_gradient", source, at_point, wp.vec4, x)
        call, partials = reader.derivative(source, x)
        lines = (
            f"    f, along_x, along_y, along_z = {call}\n    return wp.vec4(f, along_x, along_y, along_z)\n"
        )
        return reader.written("value_gradient", at_point, wp.vec4, lines, partials)

    def _bounds(self, reader: Reader, x: str) -> wp.Function:
        """Return the function of the smallest and the largest value and slope in a ball."""
        if "bounds" in self.given:
            return reader.around("bounds", self.given["bounds"], _BALL, wp.vec3, x, "radius")
        called, slope = [], repr(float(self.lipschitz or 0.0))
        if "lipschitz" in self.given:
            claim = self.given["lipschitz"]
            called.append(claim.function)
            ball = ["x", "radius"] if len(claim.parameters) > len(self.numbers) else []
            slope = f"{claim.function.key}({', '.join([*ball, *reader.readings])})"
        between = self.given.get("interval", self.source)
        called.append(between.function)
        if between is self.source:
            value = reader.call(between, "x") + ("" if "value" in self.given else "[0]")
            interval = f"    f = {value}\n    r = wp.vec2(f - slope * radius, f + slope * radius)\n"
        else:
            interval = f"    r = {reader.call(between, 'x', 'radius')}\n"
        lines = f"    x = {x}\n    slope = {slope}\n{interval}{_WIDENED}"
        return reader.written("bounds", _BALL, wp.vec3, lines, *called)


_WIDENED = f"""\
    low = wp.max(r[0] - {ROUNDING} * (1.0 + wp.abs(r[0])), 0.0)
    high = wp.max(r[1] + {ROUNDING} * (1.0 + wp.abs(r[1])), 0.0)
    return wp.vec3(low, high, slope)
"""
