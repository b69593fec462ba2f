"""Trees that heights move: first hits, feet and silhouettes against short steps in float64."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

import decals
from blobtree import Node, Point
from decals import Camera, Decals, Scene
from decals.index import DecalEditor
from decals.rendering import Buffers, Renderer, RenderOptions
from decals.rendering.gbuffer import GBuffer
from decals.rendering.materials import CONE_LENGTHS, RIM_KNOTS, rim_heights, rim_slopes, slope_bounds
from decals.rendering.offset_tree import Shell
from decals.rendering.pixel_pass import BACKEND_VARIABLE
from decals.rendering.rest_buffer import RestBuffer
from tests.decals.relief import expected_heights
from tests.decals.rendering.test_edited import EditedScene
from tests.decals.rendering.test_relief import waves
from tests.oracles.offset import SumOfBalls

Array = NDArray[Any]

SIZE = (28, 21)
VIEW = Camera(position=(0.6, -4.0, 1.5), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=36.0)
CLOSE = replace(VIEW, target=(-0.5, 0.0, 0.62), fov=3.0)  # an edge, with pixels as small as in large pictures
BALL = (((0.0, 0.0, 0.0), 1.0),)
PAIR = (((-0.5, 0.0, 0.0), 0.7), ((0.6, 0.2, 0.1), 0.5))
HIT_TOLERANCE = 1e-4
"""Greatest error of a first hit, over the size of the model."""


@pytest.fixture(scope="module")
def renderers(vtk_display: None) -> Iterator[dict[str, Renderer]]:
    with pytest.MonkeyPatch.context() as patch, ExitStack() as opened:
        made = {}
        for backend in ("fragment", "compute"):
            patch.setenv(BACKEND_VARIABLE, backend)
            made[backend] = opened.enter_context(Renderer())
            assert made[backend].backend == backend
        yield made


def tree_of(balls: Any) -> Node:
    """The sum of points that `SumOfBalls` models."""
    tree: Node = Point(balls[0][0], radius=balls[0][1])
    for center, radius in balls[1:]:
        tree = tree + Point(center, radius=radius)
    return tree


def raised(oracle: SumOfBalls, tree: Node, count: int, *, relief: float, layers: int = 1) -> Scene:
    """A tree under decals with hills and hollows."""
    rng = np.random.default_rng(count)
    places = oracle.points[rng.integers(0, len(oracle.points), count)]
    rows = Decals(
        places,
        oracle.feet(places)[1],
        rng.normal(size=(count, 3)),
        rng.uniform(0.3, 0.5, count),
        images=rng.integers(0, 2, count),
        layers=rng.integers(0, layers, count),
    )
    images = [waves(1, relief=relief), waves(2, relief=-0.5 * relief)]
    return Scene(objects=[tree], decals=rows, images=images, camera=VIEW)


def rays_of(size: tuple[int, int], view: Camera) -> tuple[Array, Array]:
    """Origins and unit directions of the rays through pixels, the upper row first."""
    width, height = size
    row, column = np.mgrid[0:height, 0:width].reshape(2, -1)
    rays = view.rays(width, height)
    x, y = column + 0.5, height - row - 0.5
    ways = rays.directions(x, y)
    return rays.origins(x, y) + 0 * ways, ways / np.linalg.norm(ways, axis=1, keepdims=True)


def distances_of(buffers: Buffers, origins: Array, ways: Array) -> Array:
    """Distances along rays at which pixels show a surface; inf for the background."""
    along = ((buffers.position.reshape(-1, 3) - origins) * ways).sum(axis=1)
    return np.where(buffers.object_id.reshape(-1) >= 0, along, np.inf)


@pytest.mark.parametrize(
    ("backend", "balls", "count", "view"),
    [
        ("fragment", PAIR, 12, VIEW),
        pytest.param("fragment", PAIR, 12, CLOSE, marks=pytest.mark.slow),
        pytest.param("fragment", BALL, 9, VIEW, marks=pytest.mark.slow),
        pytest.param("compute", PAIR, 30, VIEW, marks=pytest.mark.slow),
        pytest.param("compute", PAIR, 30, CLOSE, marks=pytest.mark.slow),
    ],
)
def test_first_hits_are_those_of_short_steps_in_float64(
    renderers: dict[str, Renderer], backend: str, balls: Any, count: int, view: Camera
) -> None:
    oracle = SumOfBalls(*balls)
    scene = raised(oracle, tree_of(balls), count, relief=0.5)
    buffers = renderers[backend].buffers(scene, RenderOptions(size=SIZE), viewpoint=view)
    origins, ways = rays_of(SIZE, view)
    found = distances_of(buffers, origins, ways)
    some = np.flatnonzero(np.isfinite(found))[::5]
    some = np.concatenate([some, np.flatnonzero(~np.isfinite(found))[::16]])

    def heights(feet: Array, normals: Array) -> Array:
        return expected_heights(scene, feet, normals)

    met = oracle.first_hits(origins[some], ways[some], heights, -0.13, 0.25, step=0.01)
    assert (np.isfinite(met) != np.isfinite(found[some])).sum() <= 1  # a ray that touches a hill
    both = np.isfinite(met) & np.isfinite(found[some])
    assert both.sum() > 20
    size = float(np.linalg.norm(np.ptp(oracle.points, axis=0)))
    errors = np.abs(found[some][both] - met[both]) / size
    assert np.quantile(errors, 0.98) <= HIT_TOLERANCE
    assert errors.max() <= 3 * HIT_TOLERANCE  # where rays touch the surface
    shown = buffers.position.reshape(-1, 3)[some[both]].astype(float)
    feet, normals, _ = oracle.feet(shown)
    expected = decals.evaluate(scene.decals, feet, normals)
    same = expected.owner == buffers.owner.reshape(-1)[some[both]]
    assert same.mean() > 0.97
    assert np.abs(expected.uv - buffers.uv.reshape(-1, 2)[some[both]])[same].max() < 5e-3
    moved = np.abs(oracle.feet(shown)[2])
    assert moved.max() > 0.05


@pytest.mark.slow_cases("compute")
@pytest.mark.parametrize("backend", ["fragment", "compute"])
def test_silhouettes_rise_and_an_edit_moves_them(renderers: dict[str, Renderer], backend: str) -> None:
    renderer, options = renderers[backend], RenderOptions(size=(48, 36))
    oracle = SumOfBalls(*PAIR)
    scene = raised(oracle, tree_of(PAIR), 30, relief=0.5)
    hills = scene.replace(images=[waves(1, relief=0.5)] * 2)
    flat = scene.replace(images=[waves(1, relief=0.0)] * 2)
    covered, before = (renderer.buffers(one, options).object_id >= 0 for one in (hills, flat))
    assert (covered & ~before).sum() > 20
    assert not (before & ~covered).any()
    editor = DecalEditor(hills.decals)
    edited = EditedScene(hills.objects, editor, hills.images, hills.camera)
    renderer.buffers(edited, options)
    editor.delete(list(range(15)))
    shown = renderer.buffers(edited, options)
    assert (shown.object_id >= 0).sum() < covered.sum()
    editor.change(20, radii=[2.0 * editor.decals.radii.max()])
    shown = renderer.buffers(edited, options)
    anew = renderer.buffers(hills.replace(decals=editor.decals), options)
    assert np.array_equal(shown.position, anew.position)
    at = renderer.buffers_at(edited, 24, 18, options)
    assert np.allclose(at.position[0, 0], shown.position[36 - 1 - 18, 24], atol=1e-5)


@pytest.mark.parametrize("backend", ["fragment", "compute"])
def test_clearing_empties_the_rest_pose_of_a_part(renderers: dict[str, Renderer], backend: str) -> None:
    context = renderers[backend].context
    with context.current():
        gbuffer = GBuffer(context, (24, 16))
        rest = RestBuffer(context, gbuffer)
        ones = np.ones((16, 24, 4), np.float32)
        for texture in rest.textures.values():
            texture.write(ones.tobytes())
        rest.clear(20, 10)
        expected = ones.copy()
        expected[:10, :20] = 0.0
        for texture in rest.textures.values():
            found = np.frombuffer(texture.read(), np.float32).reshape(ones.shape)
            assert np.array_equal(found, expected)
        rest.release()
        gbuffer.release()


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(0, 360, 30))
def test_no_view_shows_a_hole(renderers: dict[str, Renderer], turn: int) -> None:
    oracle = SumOfBalls(*PAIR)
    scene = raised(oracle, tree_of(PAIR), 30, relief=0.5)
    hills = scene.replace(images=[waves(1, relief=0.5)] * 2)
    flat = scene.replace(images=[waves(1, relief=0.0)] * 2)
    for step in range(0, 30, 10):
        view = VIEW.turned(turn + step)
        options = RenderOptions(size=(64, 48))
        covered, before = (
            renderers["fragment"].buffers(one, options, viewpoint=view).object_id >= 0
            for one in (hills, flat)
        )
        assert not (before & ~covered).any()


@settings(max_examples=20)
@given(
    arrays(np.float32, st.tuples(st.integers(2, 40), st.integers(2, 40)), elements=st.floats(-1, 1, width=32))
)
def test_cones_contain_all_heights(heights: Array) -> None:
    count = max(min(heights.shape) // 2, 1)
    bounds = slope_bounds(heights, count)
    rng = np.random.default_rng(heights.size)
    places = rng.random((2, 200, 2))
    places[1, :100] = np.clip(places[0, :100] + rng.uniform(-0.1, 0.1, (100, 2)), 0, 0.999)

    def at(points: Array) -> Array:
        texel = np.clip(points * heights.shape - 0.5, 0, np.array(heights.shape) - 1)
        low = np.minimum(texel.astype(int), np.array(heights.shape) - 2)
        part = texel - low
        rows = [
            heights[low[:, 0] + i, low[:, 1] + j].astype(float)
            * np.abs(1 - i - part[:, 0])
            * np.abs(1 - j - part[:, 1])
            for i in (0, 1)
            for j in (0, 1)
        ]
        total: Array = np.sum(rows, axis=0)
        return total

    cells = (places[0] * count).astype(int)
    slopes = bounds[cells[:, 0], cells[:, 1]]
    apart = 2 * np.linalg.norm(places[1] - places[0], axis=1)
    rises = at(places[1]) - at(places[0])
    assert (np.diff(slopes, axis=1) >= 0).all()
    for k, length in enumerate(CONE_LENGTHS):
        near = apart < length
        assert (rises[near] <= slopes[near, k] * apart[near] + 1e-6).all()


def test_short_cones_are_flatter_than_long_ones() -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 64), np.linspace(-1, 1, 64))
    tower = np.clip((0.3 - np.hypot(x, y)) / 0.1, 0, 1)
    at_rim = slope_bounds(tower.astype(np.float32), 24)[12, 1]
    assert (at_rim[:2] == 0).all()
    assert 0.9 / 0.7 < at_rim[3] < 1.3 / 0.7


@pytest.mark.parametrize("sizes", [1.0, 3.0])
def test_cones_contain_the_heights_of_neighbours(sizes: float) -> None:
    rng = np.random.default_rng(5)
    side = 80
    steps = (np.arange(side) + 0.5) / side * 2 - 1
    inner = 1 - np.hypot(steps, steps[:, None])
    hill = (np.clip(inner - 0.05, 0, 1) * (1 + np.sin(9 * inner))).astype(np.float32)
    heights = rim_heights(hill)
    steepest = float(slope_bounds(hill, 24).max())
    slopes = rim_slopes(heights, steepest, sizes)
    rows, columns = rng.integers(0, side, (2, 3000))
    depths = inner[rows, columns]
    rims, radii = rng.uniform(0, 2, 3000) ** 2 / 2, rng.uniform(1, sizes, 3000)
    knots = (RIM_KNOTS * np.sqrt(np.minimum(rims / CONE_LENGTHS[-1], 1))).astype(int)
    apart = rims + radii * np.maximum(depths, 0)
    for k, length in enumerate(CONE_LENGTHS):
        near = (apart < length) & (depths > 0)
        assert near.sum() > 2
        assert (radii * hill[rows, columns] <= slopes[knots, k] * apart + 1e-6)[near].all()
    assert slopes[-1].max() < slopes[0].max()


def interpolated(values: Array, places: Array) -> Array:
    """Values at places between the points of a grid, as textures interpolate them."""
    low = np.minimum(places.astype(int), np.array(values.shape) - 2)
    part = places - low
    total = np.zeros(len(places))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.abs(1 - np.array(corner) - part), axis=1)
        total += weight * values[tuple((low + corner).T)]
    return total


def test_a_shell_knows_points_of_the_surface_and_free_space() -> None:
    oracle = SumOfBalls(*PAIR)
    shell = Shell.of(tree_of(PAIR), 0.2)
    middles = shell.lower + (np.indices(shell.counts).reshape(3, -1).T + 0.5) * shell.cell
    distances = oracle.tree.query(middles)[0]
    assert (shell.texels[:, 3] <= distances).all()
    assert np.abs(oracle.terms(shell.texels[:, :3].astype(float))[0] - 0.5).max() < 1e-3
    rng = np.random.default_rng(3)
    places = rng.uniform(0.5, np.array(shell.counts) - 0.5, (4000, 3))
    near = interpolated(shell.texels[:, 3].reshape(shell.counts).astype(float), places - 0.5) / shell.cell
    free = np.where(near > 1.31, 0.5 * (near + np.sqrt(np.maximum(near**2 - 1.5, 0))), near - 0.87)
    assert (shell.cell * free <= oracle.tree.query(shell.lower + shell.cell * places)[0]).all()
    assert (shell.bounds[0] <= oracle.points.min(0) - 0.2).all()
    assert (shell.bounds[1] >= oracle.points.max(0) + 0.2).all()
