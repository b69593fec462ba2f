"""Every class of nodes in Warp and GLSL: generated from the declarations, as `tests.conformance`."""

import numpy as np
import pytest

from blobtree.nodes.kinds import NODE_KINDS
from blobtree.tape.model import gradients_at
from decals.rendering.context import Context
from decals.rendering.tree import Kinds
from tests.blobtree.trees import points_around
from tests.conformance import AWAY, sample
from tests.decals.glsl.tapes import GRADIENT, TAPE_AGREEMENT
from tests.decals.glsl.test_tapes import read_tape
from tests.oracles import blobtree as oracle


@pytest.mark.slow
@pytest.mark.parametrize("tag", NODE_KINDS)
def test_a_class_of_nodes_is_the_same_in_both_languages(context: Context, tag: str) -> None:
    rng = np.random.default_rng(3)
    node = sample(NODE_KINDS[tag], rng)
    points = points_around(rng, node, 200)
    smooth = oracle.signed(node, points).margin > AWAY
    seen = read_tape(context, node, GRADIENT, points, kinds=Kinds.of(node.tape))
    expected = gradients_at(node.tape, points)
    assert np.abs(seen[:, 0] - expected[:, 0]).max() <= TAPE_AGREEMENT
    error = np.abs(seen - expected)[smooth] / np.maximum(1.0, np.abs(expected[smooth]))
    assert error.max(initial=0.0) <= 5.0 * TAPE_AGREEMENT
