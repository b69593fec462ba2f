"""Sharp solids in GLSL: values and gradients as in Warp, and pictures with their silhouettes."""

import numpy as np
import pytest

from blobtree import Box, Cone, Cylinder, Extrude, Node, Outline, Prism, Revolve
from blobtree.tape.instruction_set import library
from decals.rendering import Context
from tests.decals.glsl.test_conformance import assert_same_in_both_languages

STAR = ((0, 0, 0), (1, 0.4, 0), (2, 0, 0), (1, 1.5, 0))


SOLIDS: list[Node] = [
    Box((0.1, 0.2, 0.3), (2, 1, 1), radius=0),
    Cylinder((0, 0, 0), (1, 2, 0.5), 0.6, radius=0),
    Cone((0, 0, 0), (1, 2, 0.5), radius=0.5, end_radius=0),
    Prism(STAR, 0.7),
    Extrude(Outline.text("B&"), 0.3, top_turn=20.0),
    Revolve("M0 0H1L.5 1H0Z"),
    Revolve("M.5 0H1V1Z", 200.0),
]


def test_the_solids_use_every_sharp_field() -> None:
    used = {library().fields[code].name for solid in SOLIDS for code in solid.tape.fields}
    assert used == {field.name for field in library().fields if field.name.startswith("sharp_")}


@pytest.mark.parametrize("solid", SOLIDS)
def test_fields_are_the_same_in_both_languages(context: Context, solid: Node) -> None:
    assert_same_in_both_languages(context, solid, np.random.default_rng(3))
