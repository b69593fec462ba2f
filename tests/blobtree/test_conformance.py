"""Every class of nodes conforms: generated from the declarations, so that new classes are taken up."""

import pytest
import warp as wp

from blobtree import Node
from blobtree.nodes.kinds import NODE_KINDS
from tests.conformance import field_problems, problems_of


@pytest.mark.parametrize("tag", NODE_KINDS)
def test_a_class_of_nodes_conforms(tag: str) -> None:
    kind: type[Node] = NODE_KINDS[tag]
    assert problems_of(kind, seed=1, samples=1) == []


@pytest.mark.slow
@pytest.mark.parametrize("tag", NODE_KINDS)
def test_many_nodes_of_a_class_conform(tag: str) -> None:
    assert problems_of(NODE_KINDS[tag], seed=2, samples=12) == []


@pytest.mark.gpu
@pytest.mark.parametrize("tag", NODE_KINDS)
def test_a_class_of_nodes_conforms_on_a_graphics_card(tag: str) -> None:
    with wp.ScopedDevice("cuda:0"):
        assert field_problems(NODE_KINDS[tag], seed=3, samples=4) == []
