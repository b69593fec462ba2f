"""Own kinds for tests, of every shape that a definition can take.

They share one instruction set, so that their kernels compile once for all tests.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from blobtree import Node, Point
from blobtree._typing import Float64Array
from blobtree.custom import define_falloff, define_field, define_operator, define_skeleton, define_warp
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.nodes.primitives import Columns
from blobtree.validation import Vector
from tests.blobtree.custom.field_kernels import lump, lump_slope, waves, waves_interval, waves_slope
from tests.blobtree.custom.warp_kernels import Swirl, sway, sway_pullback, sway_stretch
from tests.blobtree.kernels import (
    bar,
    brick,
    carve,
    carve_steepest,
    mean,
    path,
    ring,
    shared,
    soft,
    staircase,
    staircase_slope,
    stew,
    stew_steepest,
    swell,
    tent,
    tent_slope,
)
from tests.blobtree.tape.kernels import PAIR
from tests.blobtree.trees import MoreKinds, RandomTrees, triple

SOFTEST = 4.0
STEW_PARAMETERS = ("left", "right", "both", "less_left", "less_right")

Ring = define_skeleton(ring, limits={"axis": (1e-3, None), "size": (0.0, None)})
Brick = define_skeleton(brick, convex=True)
RoughBrick = define_skeleton(brick, name="rough_brick")
Path = define_skeleton(path)
Soft = define_operator(soft, steepest=1.0, like="blend", monotone=True, limits={"hardness": (0.0, SOFTEST)})
Carve = define_operator(carve, steepest=carve_steepest, like="difference", monotone=True)
Shared = define_operator(shared, steepest=2.0, like="intersection", monotone=True)
Mean = define_operator(mean, steepest=0.5)
Swell = define_operator(swell, steepest=1.0, like="blend", monotone=True, order_free=True)
Stew = define_operator(
    stew, steepest=stew_steepest, monotone=True, limits=dict.fromkeys(STEW_PARAMETERS, (0.0, 1.0))
)

KINDS = (Ring, Brick, Path, Soft, Carve, Shared, Mean, Swell, Stew)
"""Kinds in `CUSTOM_TREES`."""

Bar = define_skeleton(bar, convex=True)
Lump = define_field(lump, steepest=lump_slope, limits={"breadth": (0.1, None)})
Waves = define_field(waves, steepest=waves_slope, interval=waves_interval)
Staircase = define_falloff(staircase, staircase_slope)
Tent = define_falloff(tent, tent_slope)


SWAY_LIMITS = {"width": (-0.5, 0.5), "rate": (0.0, 3.0)}
Sway = define_warp(sway, stretch=sway_stretch, box=0.5, limits=SWAY_LIMITS)
GivenSway = define_warp(
    sway, stretch=sway_stretch, box=0.5, pullback=sway_pullback, limits=SWAY_LIMITS, name="given_sway"
)


@dataclass(frozen=True, eq=False, repr=False)
class Pair(Point):
    """Two balls, whose centres are in the data region."""

    skeleton = PAIR

    other: Annotated[Vector, Parameter(Quantity.POINT, "centre of the second ball")] = (0.0, 0.0, 0.0)

    @property
    def data(self) -> NDArray[Any]:
        return np.array([(*self.center, 0.0), (*self.other, 0.0)])

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        texels = np.zeros((len(influences), 1, 4))
        texels[:, 0, 3] = influences[:, 0]
        return texels


def random_custom_leaf(rng: np.random.Generator) -> Node:
    radius, color = float(rng.uniform(0.15, 0.5)), triple(rng.uniform(0.0, 1.0, 3))
    place, way, more = rng.uniform(-1.0, 1.0, (3, 3))
    kind = rng.integers(0, 3)
    if kind == 0:
        return Ring(triple(place), triple(way), float(rng.uniform(0.2, 0.9)), radius=radius, color=color)
    if kind == 1:
        return Brick(triple(place), triple(0.8 * way), radius=radius, color=color)
    return Path(
        triple(place), triple(place + 0.7 * way), triple(place + 0.7 * more), radius=radius, color=color
    )


def random_custom_combination(rng: np.random.Generator, operands: list[Node]) -> Node:
    kind = int(rng.integers(0, 6))
    if kind == 5:
        return Stew(tuple(operands[:2]), *rng.uniform(0.0, 1.0, 5).tolist())
    if kind == 0:
        return Soft(tuple(operands[:2]), float(rng.choice([0.5, 2.0, SOFTEST])))
    if kind == 1:
        return Swell(tuple(operands))
    return (Carve, Shared, Mean)[kind - 2](tuple(operands[:2]))


CUSTOM = MoreKinds(random_custom_leaf, random_custom_combination)


def everything() -> Node:
    """A tree of all kinds: once its tape is made, trees of fewer kinds share its kernels."""
    first, second = Ring((0, 0, 0), (0, 0, 1), 0.7, radius=0.2), Brick((1, 0, 0), (1, 1, 1), radius=0.2)
    third = Path((0, 0, 0), (0, 1, 0), (0, 1, 1), radius=0.2)
    stewed = Stew((first, third), 0.9, 0.8, 0.7, 0.6, 0.5)
    bars = Swirl(Sway(GivenSway(Bar(0.5, radius=0.2), 0.4, 2.0), 0.4, 2.0), (0.1, 0, 0.5), 3)
    rough = RoughBrick((0, 1, 0), (1, 1, 1), radius=0.2)
    fields = Lump((0, 0, 0), (1, 1, 1), (0, 0, 0), 0.5) + Waves((0, 0, 0), (1, 1, 1), 4.0)
    balls = Point((0, 0, 0), radius=0.2, falloff=Staircase) + Point((0, 0, 0), radius=0.2, falloff=Tent)
    balls += Pair((0, 0, 0), radius=0.2, other=(0.5, 0, 0))
    return Swell(
        (
            stewed,
            Mean((Soft((first, second), 1.0), third)),
            Carve((second, Shared((first, second)))),
            bars + rough + fields + balls,
        )
    )


EVERYTHING = everything()
EVERYTHING.tape  # noqa: B018  (making it is what matters)

CUSTOM_TREES = RandomTrees(seed=4, count=120, more=CUSTOM)
