"""Own kinds in shaders: the tapes' readings, and pictures of trees, are those of Warp."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Point
from blobtree.tape.model import colors_at, gradients_at
from blobtree.tracing.trace import trace
from decals.rendering.context import Context
from decals.rendering.options import RenderOptions
from decals.rendering.renderer import Renderer
from decals.rendering.tracing_shader import Kinds, tracing_shader
from decals.scenes.camera import Camera
from tests.blobtree.custom_kinds import CUSTOM_TREES, EVERYTHING, Brick, Carve, Path, Ring, Soft
from tests.blobtree.tape.evaluations import bounds_at
from tests.blobtree.trees import points_around
from tests.decals.glsl.functions import run_program
from tests.decals.glsl.tapes import BOUND_AND_VALUE, COLOR, GRADIENT, MAIN, Model, assert_close, padded
from tests.decals.shapes import View
from tests.oracles import blobtree as oracle

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


def read_tape(context: Context, tree: Any, kinds: Kinds, reading: int, points: NDArray[Any]) -> Any:
    shader, _, _ = tracing_shader(kinds).text.partition("void main()")
    textures = {"tape": tree.tape.data, "points": padded(points)}
    uniforms = {"reading": reading, "part": (tree.tape.start, len(tree.tape.data))}
    return run_program(context, shader + MAIN, len(points), textures, uniforms)


def test_whole_tapes_are_the_same_in_both_languages(context: Context) -> None:
    rng = np.random.default_rng(6)
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
    compared = 0
    for tree in [tree for tree in CUSTOM_TREES if tree.tape.instruction_set is instruction_set][:20]:
        points = points_around(rng, tree, 300)
        reach = (10.0 ** rng.uniform(-3.0, 0.5, 300)).astype(np.float32)
        seen = read_tape(context, tree, all_kinds, BOUND_AND_VALUE, np.column_stack([points, reach]))
        assert_close(seen[:, :2], bounds_at(tree.tape, points, reach))
        field = oracle.evaluate(tree, points)
        smooth = field.margin > 1e-3
        seen = read_tape(context, tree, all_kinds, GRADIENT, points)[smooth]
        assert_close(seen, gradients_at(tree.tape, points)[smooth])
        strong = smooth & (field.value > 1e-3)
        seen = read_tape(context, tree, all_kinds, COLOR, points)[:, 1:]
        assert_close(seen[strong], colors_at(tree.tape, points)[strong])
        compared += int(strong.sum())
    assert compared > 1000


@pytest.mark.parametrize("name", PICTURES)
def test_a_traced_picture_is_what_warp_traces(renderer: Renderer, name: str) -> None:
    tree, (width, height) = PICTURES[name], (160, 120)
    camera = Camera.framing(tree.support, direction=(0.3, 0.5, 1.0), aspect=width / height)
    buffers = renderer.buffers(View((Model(tree),), camera), RenderOptions(size=(width, height)))
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    rays = camera.rays(width, height)
    directions = rays.directions(x, y).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distance = trace(tree, np.tile(rays.origin, (len(directions), 1)), directions)
    expected, seen = np.isfinite(distance), buffers.object_id.ravel() == 0
    assert expected.sum() > 500
    assert (seen != expected).sum() <= 1e-3 * expected.size
    both = seen & expected
    depth = np.linalg.norm(buffers.position.reshape(-1, 3)[both] - rays.origin, axis=1)
    size = float(np.linalg.norm(tree.support[1] - tree.support[0]))
    assert (np.abs(depth - distance[both]) > 1e-4 * size).mean() <= 2e-3
