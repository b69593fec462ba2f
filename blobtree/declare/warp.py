"""Rows of warps: non-affine maps of space around a subtree (Barr 1984).

A warp T maps a point of the outer space to the subtree's space: F(q) = f(T(q)). A row has typed functions,
which read their numbers from tape[at] = (·, p₁, p₂, p₃), tape[at + 1] = (p₄, …) and so on; `WarpFormulas`
makes them:

* `forward(q, tape, at) -> T(q)`;
* `pullback(q, g, tape, at) -> Jᵀ g`, which takes the subtree's gradient to the outer space;
* `lipschitz(q, reach, tape, at)`: a bound on ‖J‖ over the ball of radius `reach` about q;
* `image_box(q, half, tape, at)`, which is optional: half the size of a box about T(q) that holds the image of
  the box q ± half. It is worth its time for warps whose `lipschitz` is far above 1 in one direction alone;
* `texel(q, reach, kept, number, tape, at)`, which is optional: the texel tape[at + number] = kept in a tape
  that is pruned to the ball of radius `reach` about q.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Box, Float64Array
from blobtree.declare.readers import PLACE, PointFormulas, Reader, named_values, require_numbers
from blobtree.errors import InvalidNode
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

RESULTS: dict[str, Any] = {
    "forward": wp.vec3,
    "pullback": wp.vec3,
    "lipschitz": wp.float32,
    "image_box": wp.vec3,
    "texel": wp.vec4,
}
"""The formulas of a warp, and the types of their results."""

LEADING: dict[str, dict[str, Any]] = {
    "forward": {"q": wp.vec3},
    "pullback": {"q": wp.vec3, "g": wp.vec3},
    "lipschitz": {"q": wp.vec3, "reach": wp.float32},
    "image_box": {"q": wp.vec3, "half": wp.vec3},
    "texel": {"q": wp.vec3, "reach": wp.float32, "kept": wp.vec4, "number": wp.int32},
}
"""The parameters in front of the numbers."""

FIRST_NUMBER = 1
"""Place of the first number on the tape, in floats: behind the stretch of the map."""

UNKNOWN_EXTENT = wp.constant(1e18)
"""Size of a box that excludes nothing; its square is a float32."""

OuterBox = Callable[[Float64Array, Float64Array, tuple[float, ...]], Box]
Room = Callable[[Float64Array, Float64Array, tuple[float, ...]], tuple[float, ...]]
Claim = Callable[..., Any]
"""A function of the corners of an inner box, and of the numbers of the formulas by name."""


@wp.func
def unknown_extent(q: wp.vec3, half: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return a large size: the ball that the bound on ‖J‖ gives is all that is known."""
    return wp.vec3(UNKNOWN_EXTENT, UNKNOWN_EXTENT, UNKNOWN_EXTENT)


@wp.func
def same_texel(
    q: wp.vec3, reach: wp.float32, kept: wp.vec4, number: wp.int32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Return the texel as it is."""
    return kept


@dataclass(frozen=True, eq=False)
class SpaceWarp:
    """A warp's name and functions."""

    name: str
    forward: wp.Function
    pullback: wp.Function
    lipschitz: wp.Function
    box: OuterBox
    """Return the outer space's box around what the inner box holds, from the numbers of the warp."""
    room: Room | None = None
    """Return further numbers, those that depend on the inner box outside of which the subtree is 0."""
    image_box: Any = unknown_extent
    texel: Any = same_texel
    digest: str = ""
    """Digest of the sources of a custom warp."""


@dataclass(frozen=True)
class WarpFormulas(PointFormulas):
    """The formulas and claims of a warp, whose row they make."""

    sources = ("forward",)
    lipschitz: Any
    motion: Any
    """The largest distance by which points move, where there is no `outer_box`."""
    outer_box: Claim | None
    room: Claim | None
    extent: float

    def require(self, declared: Sequence[str] | None) -> None:
        """Raise `InvalidDefinition` for formulas or claims that do not fit each other.

        `declared` are the names of the parameters that formulas take, None for other numbers.
        """
        require_numbers(self.source, self.given, LEADING, declared)
        bound, motion = self.lipschitz, self.motion
        if "lipschitz" not in self.given and not (_is_number(bound) and 0.0 < bound < np.inf):
            raise self.source.refusal(
                f"lipschitz: expected a number above 0 or a typed function, got {bound!r}"
            )
        if self.outer_box is None and not (_is_number(motion) and 0.0 <= motion < np.inf):
            raise self.source.refusal(
                f"motion: expected a distance from 0, or the class method outer_box, got {motion!r}"
            )

    def digest(self, parameters: Sequence[Any]) -> str:
        """Return a digest of the formulas, the claims, and the declared parameters."""
        more = {name: part.digest for name, part in self.given.items() if part is not self.source}
        return self.source.digest_with(self.kind, tuple(parameters), more, self.lipschitz, self.motion)

    def row(self, digest: str = "") -> SpaceWarp:
        """Return the row of the warp; one with a digest is a user's."""
        if self.numbers == PLACE:
            made = {name: part.function for name, part in self.given.items()}
        else:
            made = self._functions(self.reader(digest, FIRST_NUMBER))
        room = self._room if self.room else None
        return SpaceWarp(self.kind, **made, box=self._box, room=room, digest=digest)

    def box(self, lower: Float64Array, upper: Float64Array, values: Mapping[str, Any]) -> Box:
        """Return the outer box around an inner one, for the numbers of the formulas by name.

        Raises
        ------
        InvalidNode
            The claim `outer_box` fails, or returns no box.
        """
        if self.outer_box is None:
            return lower - self.motion, upper + self.motion
        try:
            low, high = self.outer_box(lower.copy(), upper.copy(), **values)
            corners = np.asarray(low, np.float64), np.asarray(high, np.float64)
        except InvalidNode:
            raise
        except Exception as error:  # the function may be a user's
            raise InvalidNode(f"{self.kind}: its outer box fails: {type(error).__name__}: {error}") from error
        if not all(corner.shape == (3,) and np.isfinite(corner).all() for corner in corners):
            raise InvalidNode(
                f"{self.kind}: expected its outer box to be two corners (3,), got {low!r}, {high!r}"
            )
        return corners

    def values(self, numbers: tuple[float, ...]) -> dict[str, Any]:
        """Return numbers as what formulas take, by name."""
        return {"numbers": numbers} if self.numbers == PLACE else named_values(self.numbers, numbers)

    def _box(self, lower: Float64Array, upper: Float64Array, numbers: tuple[float, ...]) -> Box:
        return self.box(lower, upper, self.values(numbers))

    def _room(
        self, lower: Float64Array, upper: Float64Array, numbers: tuple[float, ...]
    ) -> tuple[float, ...]:
        assert self.room is not None
        more: tuple[float, ...] = self.room(lower, upper, **self.values(numbers))
        return more

    def _functions(self, reader: Reader) -> dict[str, wp.Function]:
        """Return functions around the formulas and claims; the pullback is derived if need be."""
        lines = {"lipschitz": f"    return {self.lipschitz!r}\n"}
        called = {}
        if "pullback" not in self.given:
            call, partials = reader.derivative(self.source, "q")
            lines["pullback"], called["pullback"] = _DERIVED.format(call=call), [partials]
        for name, part in self.given.items():
            leading = LEADING[name] if len(part.parameters) > len(self.numbers) else ()
            lines[name], called[name] = f"    return {reader.call(part, *leading)}\n", [part.function]
        return {
            name: reader.written(name, LEADING[name], RESULTS[name], text, *called.get(name, ()))
            for name, text in lines.items()
        }


_DERIVED = """\
    moved, along_x, along_y, along_z = {call}
    return wp.vec3(wp.dot(along_x, g), wp.dot(along_y, g), wp.dot(along_z, g))
"""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)
