"""Pictures of sharp CSG show the surface wherever rays in float64 are inside."""

import numpy as np
import pytest

from blobtree import Box, Node
from blobtree.custom import CustomPrimitive
from decals import Camera
from decals.rendering import Renderer
from tests.bench.trust_csg import holes_of, scene
from tests.blobtree.csg_trees import PRIMITIVES, csg_primitive
from tests.blobtree.custom_kinds import Brick, RoughBrick

SIZE = (48, 36)
DIRECTION = (0.3, 0.5, 1.0)


def carved(kind: str, radius: float, operation: str) -> Node:
    """A box that a primitive of a kind cuts, limits or joins."""
    body, shape = (
        Box((0, 0, 0), (1.2, 1, 0.8), radius=radius),
        csg_primitive(np.random.default_rng(5), kind, radius),
    )
    return {"difference": body - shape, "intersection": body & shape, "union": body | shape}[operation]


CASES = [
    (kind, radius, operation)
    for kind in PRIMITIVES
    for radius in (0.1, 1e-3, 1e-5)
    for operation in ("difference", "intersection", "union")
]
ORDINARY = {("box", 1e-3, "difference"), ("cylinder", 1e-5, "difference"), ("polygon", 1e-3, "intersection")}


@pytest.mark.parametrize(
    ("kind", "radius", "operation"),
    [pytest.param(*case, marks=() if case in ORDINARY else pytest.mark.slow) for case in CASES],
)
def test_no_pixel_of_sharp_csg_misses(fragment: Renderer, kind: str, radius: float, operation: str) -> None:
    tree = carved(kind, radius, operation)
    holes = holes_of(tree, Camera.framing(tree.support, direction=DIRECTION), fragment, SIZE)
    assert holes.of_picture == holes.of_rays == 0
    assert operation == "intersection" or holes.pixels > 50


@pytest.mark.ordinary_cases("brick-0.001")
@pytest.mark.parametrize("radius", [0.1, 1e-3, 1e-5])
@pytest.mark.parametrize("kind", [Brick, RoughBrick], ids=["brick", "rough brick"])
def test_own_solids_cut_as_sharply_as_boxes(
    fragment: Renderer, kind: type[CustomPrimitive], radius: float
) -> None:
    """Nothing is known of the depth inside an own solid, whether it is known to be convex or not."""
    body, place, size = Box((0, 0, 0), (1.2, 1, 0.8), radius=radius), (0.3, 0.2, 0.4), (0.8, 0.6, 0.8)
    tree, twin = body - kind(place, size, radius=radius), body - Box(place, size, radius=radius)
    holes = holes_of(tree, Camera.framing(tree.support, direction=DIRECTION), fragment, SIZE, twin=twin)
    assert holes.of_picture == holes.of_rays == 0
    assert holes.pixels > 200


@pytest.mark.slow
@pytest.mark.parametrize("case", range(24))
def test_no_pixel_of_random_csg_misses(fragment: Renderer, case: int) -> None:
    holes = holes_of(*scene(7, case), fragment, SIZE)
    assert holes.of_picture == holes.of_rays == 0
