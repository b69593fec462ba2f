"""Pixels whose loops the software rasteriser ends are drawn to their end, and leave nothing behind."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from blobtree import Box, Node, Point, Union
from decals import Camera
from decals.rendering import Renderer, RenderOptions
from decals.rendering.loop_guard import GuardedProgram, LoopGuard
from decals.rendering.pixel_pass import Program
from decals.rendering.tree import TreeDrawable
from tests.bench.trust_csg import holes_of, scene
from tests.blobtree.csg_trees import csg_primitive
from tests.blobtree.custom_kinds import Brick
from tests.decals.glsl.tapes import Model
from tests.decals.shapes import View
from tests.oracles.pixels import middle_rays

SIZE = (48, 36)


def bored() -> Node:
    """A block with bores that taper to nothing: some rays take thousands of roots of polynomials."""
    bores = (csg_primitive(np.random.default_rng([3, number]), "tapered", 1e-5) for number in range(6))
    return Box((0, 0, 0), (1.6, 1.6, 1.2), radius=1e-5) - Union(tuple(bores))


def camera_of(tree: Node) -> Camera:
    return Camera.framing(tree.support, direction=(0.3, 0.5, 1.0))


def missing(tree: Node, renderer: Renderer) -> int:
    """Return the number of pixels that show no surface where a ray through them hits."""
    camera = camera_of(tree)
    origin, directions = middle_rays(camera, SIZE)
    hits = tree.raycast(np.broadcast_to(origin, directions.shape), directions).hit
    buffers = renderer.buffers(View((Model(tree),), camera), RenderOptions(size=SIZE))
    return int((hits & (buffers.object_id.ravel() < 0)).sum())


@pytest.fixture
def drawings(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of drawings of each tree."""
    numbers: list[int] = []
    plain = LoopGuard.drawings

    def counted(guard: LoopGuard, programs: GuardedProgram) -> Iterator[Program]:
        numbers.append(0)
        for program in plain(guard, programs):
            numbers[-1] += 1
            yield program

    monkeypatch.setattr(LoopGuard, "drawings", counted)
    return numbers


def skip_without_limit(renderer: Renderer) -> None:
    if renderer.context.max_loop_iterations is None:
        pytest.skip("this driver has no limit of turns")


@pytest.mark.parametrize("backend", ["fragment", "compute"])
def test_rays_go_on_where_loops_were_ended(
    request: pytest.FixtureRequest, drawings: list[int], backend: str
) -> None:
    renderer: Renderer = request.getfixturevalue(backend)
    skip_without_limit(renderer)
    tree = bored()
    model, options = Model(tree), RenderOptions(size=SIZE)
    assert missing(tree, renderer) == 0
    assert drawings[-1] > 2
    for direction in ((0.3, 0.5, 1.1), (0.3, 0.5, 1.2)):  # the second picture knows that loops will be ended
        camera = Camera.framing(tree.support, direction=direction)
        renderer.buffers(View((model,), camera), options)
    assert 1 < drawings[-1] < drawings[-2]
    renderer.buffers(View((Model(Point((0, 0, 0), radius=1.0)),), camera_of(tree)), RenderOptions(size=SIZE))
    assert drawings[-1] == 1


@pytest.mark.slow
def test_rays_that_go_on_pass_no_surface(fragment: Renderer) -> None:
    """Where loops were ended, variables behind them had values of other pixels, beyond the surface."""
    skip_without_limit(fragment)
    holes = holes_of(*scene(2, 34), fragment, (160, 120))
    assert holes.of_picture == 0


def test_rays_cross_an_own_convex_solid_without_many_steps(fragment: Renderer, drawings: list[int]) -> None:
    """Steps of its tiny influence would end the loops of nearly all pixels."""
    skip_without_limit(fragment)
    tree = Box((0, 0, 0), (1.2, 1, 0.8), radius=1e-5) - Brick((0.3, 0.2, 0.4), (0.8, 0.6, 0.8), radius=1e-5)
    assert missing(tree, fragment) == 0
    assert drawings == [1]


def test_without_the_guard_pixels_miss(fragment: Renderer) -> None:
    skip_without_limit(fragment)
    tree = bored()
    with Renderer() as unguarded:
        unguarded.context.max_loop_iterations = None
        assert missing(tree, unguarded) > 0


def test_a_drawing_that_was_given_up_hides_no_pixel(
    fragment: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    skip_without_limit(fragment)
    tree, left = bored(), 2
    view, options = View((Model(tree),), camera_of(tree)), RenderOptions(size=SIZE)
    plain = TreeDrawable._trace

    def given_up(*arguments: Any) -> None:
        nonlocal left
        left -= 1
        if not left:
            raise InterruptedError
        plain(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(TreeDrawable, "_trace", given_up)
        with pytest.raises(InterruptedError):
            fragment.buffers(view, options)
    ball = Point((0, 0, 0), radius=1.0)
    seen = fragment.buffers(View((Model(ball),), view.camera), options)
    with Renderer() as other:
        expected = other.buffers(View((Model(ball),), view.camera), options)
    np.testing.assert_array_equal(seen.object_id, expected.object_id)
    assert missing(tree, fragment) == 0
