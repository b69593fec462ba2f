"""Primitives: the leaves of a tree, each a skeleton with a radius and a colour."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from itertools import chain
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from blobtree.formulas.kernels import RIM
from blobtree.formulas.skeletons import CONE, POINT, SEGMENT, Skeleton
from blobtree.nodes.tree import Node
from blobtree.validation import Vector, color_triple, finite_vector, positive_number, settle

Floats = NDArray[np.float64]

DEFAULT_COLOR: Vector = (0.8, 0.8, 0.8)

SHORTEST_AXIS = 1e-12
"""Squared length of an axis, over squared influence, below which a segment is a point."""


class Primitive(Node):
    """A skeleton with a radius and a colour: a leaf of the tree."""

    skeleton: ClassVar[Skeleton]
    radius: float
    color: Vector

    @property
    def influences(self) -> tuple[float, ...]:
        """Distances from the skeleton at which the field fades to 0, one per radius of the primitive."""
        return (self.radius / RIM,)

    @property
    def control_points(self) -> tuple[Vector, ...]:
        """Points whose convex hull holds the skeleton."""
        raise NotImplementedError  # every kind has its own

    @classmethod
    def hulls(cls, primitives: Sequence["Primitive"]) -> Floats:
        """Points (n, k, 3) whose convex hulls hold the skeletons of n primitives of this kind."""
        count = len(primitives[0].control_points)
        points = chain.from_iterable(primitive.control_points for primitive in primitives)
        size = 3 * count * len(primitives)
        return np.fromiter(chain.from_iterable(points), np.float64, size).reshape(-1, count, 3)

    @classmethod
    def packed(cls, primitives: Sequence["Primitive"], influences: Floats, matrices: Floats | None) -> Floats:
        """Parameters (n, ·, 4) on the tape of n primitives of this kind, under maps (n, 4, 4) if any.

        The maps are those that fold into the parameters; influences (n, ·) are scaled by them already.
        """
        points = cls.hulls(primitives)
        if matrices is not None:
            points = np.einsum("nij,nkj->nki", matrices[:, :3, :3], points) + matrices[:, None, :3, 3]
        return cls.texels(points, influences)

    @staticmethod
    def texels(points: Floats, influences: Floats) -> Floats:
        """Parameters (n, ·, 4) on the tape, as `skeletons` describes them.

        For n primitives with control points (n, k, 3) and influences (n, ·).
        """
        raise NotImplementedError  # every kind has its own


@dataclass(frozen=True, eq=False, repr=False)
class Point(Primitive):
    """A ball of `radius` around `center`."""

    skeleton = POINT

    center: Vector
    _: KW_ONLY
    radius: float
    color: Vector = DEFAULT_COLOR

    def __post_init__(self) -> None:
        settle(
            self,
            center=finite_vector("center", self.center),
            radius=positive_number("radius", self.radius),
            color=color_triple(self.color),
        )

    @property
    def control_points(self) -> tuple[Vector, ...]:
        """The centre."""
        return (self.center,)

    @staticmethod
    def texels(points: Floats, influences: Floats) -> Floats:
        """Centre and influence."""
        return np.concatenate([points, influences[:, :, None]], axis=2)


@dataclass(frozen=True, eq=False, repr=False)
class Segment(Primitive):
    """A capsule of `radius` around the straight line from `start` to `end`; equal ends make a ball."""

    skeleton = SEGMENT

    start: Vector
    end: Vector
    _: KW_ONLY
    radius: float
    color: Vector = DEFAULT_COLOR

    def __post_init__(self) -> None:
        settle(
            self,
            start=finite_vector("start", self.start),
            end=finite_vector("end", self.end),
            radius=positive_number("radius", self.radius),
            color=color_triple(self.color),
        )

    @property
    def control_points(self) -> tuple[Vector, ...]:
        """Start and end."""
        return (self.start, self.end)

    @staticmethod
    def texels(points: Floats, influences: Floats) -> Floats:
        """Start and influence; axis and 1 / length²."""
        axes = points[:, 1] - points[:, 0]
        squares = (axes**2).sum(axis=1)
        short = squares <= SHORTEST_AXIS * influences[:, 0] ** 2
        inverses = np.where(short, 0.0, 1.0 / np.where(short, 1.0, squares))
        return np.stack([_beside(points[:, 0], influences[:, 0]), _beside(axes, inverses)], axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class Cone(Primitive):
    """A round cone: the hull of a ball of `radius` at `start` and one of `end_radius` at `end`.

    Where one ball holds the other, the larger ball alone.
    """

    skeleton = CONE

    start: Vector
    end: Vector
    _: KW_ONLY
    radius: float
    end_radius: float
    color: Vector = DEFAULT_COLOR

    def __post_init__(self) -> None:
        settle(
            self,
            start=finite_vector("start", self.start),
            end=finite_vector("end", self.end),
            radius=positive_number("radius", self.radius),
            end_radius=positive_number("end_radius", self.end_radius),
            color=color_triple(self.color),
        )

    @property
    def influences(self) -> tuple[float, ...]:
        """At the start and at the end."""
        return (self.radius / RIM, self.end_radius / RIM)

    @property
    def control_points(self) -> tuple[Vector, ...]:
        """Start and end."""
        return (self.start, self.end)

    @staticmethod
    def texels(points: Floats, influences: Floats) -> Floats:
        """Start and influence there; axis and influence at the end."""
        axes = points[:, 1] - points[:, 0]
        return np.stack([_beside(points[:, 0], influences[:, 0]), _beside(axes, influences[:, 1])], axis=1)


def _beside(vectors: Floats, numbers: Floats) -> Floats:
    """`vectors` (n, 3) and `numbers` (n,) as texels (n, 4)."""
    return np.column_stack([vectors, numbers])
