"""Sharp solids in GLSL: values and gradients as in Warp, and pictures with their silhouettes."""

import numpy as np
import pytest

from blobtree import Box, Cone, Cylinder, Node, Prism
from blobtree.tape.instruction_set import library
from blobtree.tape.model import gradients_at
from decals.rendering.context import Context
from decals.rendering.tracing_shader import Kinds
from tests.blobtree.trees import points_around
from tests.conformance import AWAY
from tests.decals.glsl.tapes import GRADIENT
from tests.decals.glsl.test_conformance import AGREEMENT
from tests.decals.glsl.test_tapes import read_tape
from tests.oracles import blobtree as oracle

STAR = ((0, 0, 0), (1, 0.4, 0), (2, 0, 0), (1, 1.5, 0))


SOLIDS: list[Node] = [
    Box((0.1, 0.2, 0.3), (2, 1, 1), radius=0),
    Cylinder((0, 0, 0), (1, 2, 0.5), 0.6, radius=0),
    Cone((0, 0, 0), (1, 2, 0.5), radius=0.5, end_radius=0),
    Prism(STAR, 0.7),
]


def test_the_solids_use_every_sharp_field() -> None:
    used = {library().fields[code].name for solid in SOLIDS for code in solid.tape.fields}
    assert used == {field.name for field in library().fields if field.name.startswith("sharp_")}


@pytest.mark.parametrize("solid", SOLIDS)
def test_fields_are_the_same_in_both_languages(context: Context, solid: Node) -> None:
    rng = np.random.default_rng(3)
    points = points_around(rng, solid, 200)
    smooth = oracle.signed(solid, points).margin > AWAY
    seen = read_tape(context, solid, GRADIENT, points, kinds=Kinds.of(solid.tape))
    expected = gradients_at(solid.tape, points)
    assert np.abs(seen[:, 0] - expected[:, 0]).max() <= AGREEMENT
    slopes = np.maximum(1.0, np.linalg.norm(expected[:, 1:], axis=1))
    error = np.linalg.norm(seen[:, 1:] - expected[:, 1:], axis=1) / slopes
    assert error[smooth].max() <= AGREEMENT
