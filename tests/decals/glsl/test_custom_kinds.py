"""Own kinds in shaders: the tapes' readings, and pictures of trees, are those of Warp."""

import pytest

from blobtree import Point
from decals.rendering import Context, Renderer
from decals.rendering.tracing_shader import Kinds
from tests.blobtree.custom_kinds import CUSTOM_TREES, EVERYTHING, Brick, Carve, Path, Ring, Soft
from tests.decals.glsl.test_tapes import assert_same_in_both_languages, assert_traced_alike

RING = Ring((0, 0, 0), (0.2, 0, 1), 0.8, radius=0.25, color=(0.9, 0.3, 0.1))
PICTURES = {
    "one ring": RING,
    "a brick, stretched": Brick((0, 0, 0), (1, 1, 0.4), radius=0.2).scale((1, 0.6, 1.5)),
    "a ring in a soft blend, carved by a path": Carve(
        (
            Soft((RING, Point((0.8, 0, 0), radius=0.5)), 2.0),
            Path((-2, -0.8, 0), (0, -0.8, 0), (0, -0.8, 2), radius=0.2),
        )
    ),
}


def test_whole_tapes_are_the_same_in_both_languages(context: Context) -> None:
    instruction_set = EVERYTHING.tape.instruction_set
    all_kinds = Kinds(
        tuple(range(len(instruction_set.skeletons))),
        tuple(range(len(instruction_set.operators))),
        6,
        stretched=True,
        warps=(0,),
        warp_registers=4,
        instruction_set=instruction_set,
    )
    trees = [tree for tree in CUSTOM_TREES if tree.tape.instruction_set is instruction_set]
    assert_same_in_both_languages(context, trees[:20], all_kinds, 6)


@pytest.mark.parametrize("name", PICTURES)
def test_a_traced_picture_is_what_warp_traces(renderer: Renderer, name: str) -> None:
    assert_traced_alike(renderer, PICTURES[name])
