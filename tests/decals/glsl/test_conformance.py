"""Every class of nodes in Warp and GLSL, as `tests.conformance`, and every field of sharp solids."""

import numpy as np
import pytest

from blobtree import Box, Cone, Cylinder, Extrude, Node, Outline, Prism, Revolve, Sweep
from blobtree.conformance.samples import Rng
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.tape.instruction_set import library
from blobtree.tape.model import gradients_at
from decals.rendering import Context
from decals.rendering.tracing_shader import Kinds
from tests.blobtree.trees import points_around
from tests.conformance import AWAY, sample
from tests.decals.glsl.tapes import GRADIENT
from tests.decals.glsl.test_tapes import read_tape
from tests.oracles import blobtree as oracle

AGREEMENT = 1e-5
"""Largest relative difference of values and gradients, absolute below 1."""


def assert_same_in_both_languages(context: Context, node: Node, rng: Rng) -> None:
    points = points_around(rng, node, 200)
    smooth = oracle.signed(node, points).margin > AWAY
    seen = read_tape(context, node, GRADIENT, points, kinds=Kinds.of(node.tape))
    expected = gradients_at(node.tape, points)
    assert np.abs(seen[:, 0] - expected[:, 0]).max() <= AGREEMENT
    slopes = np.maximum(1.0, np.linalg.norm(expected[:, 1:], axis=1))
    error = np.linalg.norm(seen[:, 1:] - expected[:, 1:], axis=1) / slopes
    assert error[smooth].max(initial=0.0) <= AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("tag", NODE_KINDS)
def test_a_class_of_nodes_is_the_same_in_both_languages(context: Context, tag: str) -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        assert_same_in_both_languages(context, sample(NODE_KINDS[tag], rng), rng)


# -- sharp solids --------------------------------------------------------------------------------------


STAR = ((0, 0, 0), (1, 0.4, 0), (2, 0, 0), (1, 1.5, 0))


SOLIDS: list[Node] = [
    Box((0.1, 0.2, 0.3), (2, 1, 1), radius=0),
    Cylinder((0, 0, 0), (1, 2, 0.5), 0.6, radius=0),
    Cone((0, 0, 0), (1, 2, 0.5), radius=0.5, end_radius=0),
    Prism(STAR, 0.7),
    Extrude(Outline.text("B&"), 0.3, top_turn=20.0),
    Revolve("M0 0H1L.5 1H0Z"),
    Revolve("M.5 0H1V1Z", 200.0),
    Extrude("M0 0H1V1Z", 0.3),
    Sweep("M-.2-.1H.2V.1Z", ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))),
    Sweep("M-.2-.1H.2V.1Z", ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)), corners="smooth", end_turn=90.0),
    Sweep("M-.2-.1H.2V.1Z", ((1, 0, 0), (0, 1, 0), (-1, 0, 0)), corners="smooth", ends="closed"),
]


def test_the_solids_use_every_sharp_field() -> None:
    used = {library().fields[code].name for solid in SOLIDS for code in solid.tape.fields}
    assert used == {field.name for field in library().fields if field.name.startswith("sharp_")}


@pytest.mark.parametrize("solid", SOLIDS)
def test_fields_are_the_same_in_both_languages(context: Context, solid: Node) -> None:
    assert_same_in_both_languages(context, solid, np.random.default_rng(3))
