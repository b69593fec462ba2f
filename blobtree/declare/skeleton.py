"""Rows of primitives: what kernels know of a skeleton, and the functions that its formulas make."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

from blobtree.declare.readers import PLACE, PointFormulas, Reader, require_numbers

INFLUENCE_SLOT = 3
"""Place of the influence radius among the parameters on the tape, in floats: beside a first point."""

FARTHEST = 1e4
"""Distance of far queries, over the largest number among the parameters: no skeleton reaches so far."""

RESULTS: dict[str, Any] = {
    "closest": wp.vec3,
    "closest_with_influence": wp.vec4,
    "least_influence": wp.float32,
    "depth": wp.float32,
    "influence_near": wp.float32,
}
"""The formulas of a primitive, and the types of their results."""

_POINT = {"q": wp.vec3}
_LEADING: dict[str, dict[str, Any]] = {"depth": _POINT, "influence_near": {"q": wp.vec3, "c": wp.vec4}}
_SQUARED = """\
    c = {0}(q, tape, at)
    w = q - wp.vec3(c[0], c[1], c[2])
    return wp.dot(w, w) / (c[3] * c[3])
"""


BALL_CELLS, TUBE_CELLS, PLATE_CELLS = 1.5, 1.0, 0.9
"""Cells along the radius with which a mesh shows a thin ball, tube or plate: the less it bends the fewer."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A row: a kind's name, functions and size on the tape."""

    name: str
    closest: wp.Function
    min_influence: wp.Function
    parameters: int
    """Number of texels (vec4) of its parameters on the tape."""
    folds_maps: bool = True
    """True if similarity maps fold into its parameters; otherwise each primitive carries its map."""
    convex: bool = False
    """True for a convex set with one influence radius: distances along a ray are then convex."""
    cells: float = BALL_CELLS
    """Cells along the radius with which a mesh shows a thin primitive of this kind."""
    own_influence_near: wp.Function | None = None
    """Of a set whose influence varies: a function of (tape, at, q, c) that returns its `influence_bound`."""
    depth: wp.Function | float = 0.0
    """Of a solid set: a lower bound on the distance of a point inside from its rim, at most 0 outside."""
    apart: wp.Function | float = 1.0
    """Of a convex set of unknown depth: (|q − closest| / influence)² of a point q; 1 is unknown."""
    digest: str = ""
    """Digest of the sources of a custom kind."""

    @property
    def influence_near(self) -> wp.Function:
        """Function of (tape, at, q, c) that returns `influence_bound`, or the smallest influence."""
        return self.own_influence_near or self.min_influence

    @property
    def stride(self) -> int:
        """Number of texels of a primitive on the tape: its parameters and its colour."""
        return self.parameters + 1


@dataclass(frozen=True)
class SkeletonFormulas(PointFormulas):
    """The formulas and claims of a primitive, whose row they make."""

    sources = ("closest", "closest_with_influence")
    radii: tuple[str, ...]
    """Names of the visible radii, of which a formula with an influence takes the influence radii."""
    folds_maps: bool
    convex: bool
    cells: float
    texels: int = 0
    """Number of texels of a kind whose formulas read the tape."""

    @property
    def size(self) -> int:
        """Number of numbers that it returns."""
        return 3 if "closest" in self.given else 4

    def require(self, declared: Sequence[str] | None) -> None:
        """Raise `InvalidDefinition` for formulas that do not fit, see `require_numbers`."""
        if self.radii[0] != "radius":
            raise self.source.refusal("radius: expected it in front of further radii; declare it there")
        if self.size == 4 and declared is not None:
            declared = [name for name in declared if name not in self.radii] + list(self.radii)
        require_numbers(self.source, self.given, _LEADING, declared)

    def digest(self, parameters: Sequence[Any]) -> str:
        """Return a digest of the formulas, the claims, and the declared parameters."""
        more = [part.digest for part in self.given.values() if part is not self.source]
        return self.source.digest_with(self.kind, tuple(parameters), self.convex, *more)

    def row(self, digest: str = "") -> Skeleton:
        """Return the row of the primitive; one with a digest is a user's."""
        claims: dict[str, Any] = {"folds_maps": self.folds_maps, "convex": self.convex, "cells": self.cells}
        source, given = self.source, self.given
        if self.numbers == PLACE:
            least = given["least_influence"].function
            if "influence_near" in given:
                claims["own_influence_near"] = given["influence_near"].function
            return Skeleton(self.kind, source.function, least, self.texels, **claims)
        named = {self.radii[0]: INFLUENCE_SLOT} if self.size == 4 else {}
        reader = self.reader(digest, named=named, taken=INFLUENCE_SLOT)
        if self.size == 4:
            closest = reader.around("closest", source, _POINT, wp.vec4, "q")
        else:
            lines = f"    c = {reader.call(source, 'q')}\n    return wp.vec4(c[0], c[1], c[2], t0[3])\n"
            closest = reader.written("closest", _POINT, wp.vec4, lines, source.function)
        smallest = self._least(reader)
        if "depth" in given:
            claims["depth"] = reader.around("depth", given["depth"], _POINT, wp.float32, "q")
        if "influence_near" in given:
            call = f"    return {reader.call(given['influence_near'], 'q', 'c')}\n"
            claims["own_influence_near"] = reader.written(
                "influence_near",
                _LEADING["influence_near"],
                wp.float32,
                call,
                given["influence_near"].function,
                tape_first=True,
            )
        if self.convex and digest:
            squared = _SQUARED.format(closest.key)
            claims["apart"] = reader.written("apart", _POINT, wp.float32, squared, closest)
        return Skeleton(self.kind, closest, smallest, reader.texels, digest=digest, **claims)

    def _least(self, reader: Reader) -> wp.Function:
        """Return the function of the least influence radius: by default the least of those of the ends."""
        if "least_influence" in self.given:
            return reader.around("least_influence", self.given["least_influence"], {}, wp.float32)
        readings = dict(zip(reader.numbers, reader.readings, strict=True))
        least = f"t0[{INFLUENCE_SLOT}]"
        for name in self.radii[1:] if self.size == 4 else ():
            least = f"wp.min({least}, {readings[name]})"
        return reader.written("least_influence", {}, wp.float32, f"    return {least}\n")
