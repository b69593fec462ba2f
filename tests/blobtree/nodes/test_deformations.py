"""Deformations: analytic shapes, oracles in float64, bounds of nested warps, files and invalid parameters."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from blobtree import (
    Bend,
    Box,
    CurveWarp,
    LimitedTwist,
    Node,
    NoiseWarp,
    Point,
    Segment,
    Shear,
    Stretch,
    Taper,
    Twist,
    from_json,
    polygonize,
    to_json,
)
from blobtree._typing import Float64Array
from blobtree.errors import InvalidNode
from blobtree.nodes.places import _forward
from blobtree.tape.codes import WARP_REGISTERS
from blobtree.tape.model import gradients_at
from blobtree.tape.program import postorder
from blobtree.tracing.trace import trace
from blobtree.tracing.tree_cells import trace_tolerance
from tests.blobtree.tape.evaluations import bounds_along
from tests.blobtree.trees import points_around, random_deformation, random_leaf
from tests.oracles import blobtree as oracle

ROD = Segment((0, 0, 0), (0, 0, 4), radius=0.2)
KNOBBED = ROD + Point((0.2, 0.1, 2), radius=0.3)
SOURCE = [(0, 0, z) for z in range(5)]
TARGET = [(0, 0, 0), (0.5, 0, 1), (-0.2, 0.5, 2), (0.3, 0, 3.2), (0, 0, 4.2)]
STRONG: dict[str, Node] = {
    "taper": KNOBBED.taper(0.05, (0, 4)),
    "shear": KNOBBED.shear(1.5, -0.5, (1, 3)),
    "stretch": KNOBBED.stretch(3, (1, 2)),
    "twist": Box((0, 0, 2), (1, 0.3, 3), radius=0.2).twist(200, limits=(1, 3)),
    "half a turn": KNOBBED.bend(60, (0.5, 3.5)),
    "backward": KNOBBED.bend(-45, (1, 3)),
    "more than half a turn": ROD.bend(65, (0, 4)),
    "noise": KNOBBED.noise_warp(0.4, 1.0, seed=2),
    "curve": KNOBBED.curve_warp(SOURCE, TARGET, 2.0),
    "nested": Box((0, 0, 2), (0.5, 0.3, 3), radius=0.2)
    .twist(60, limits=(1, 3))
    .taper(0.4, (0, 4))
    .bend(20, (1, 3))
    .noise_warp(0.1, 1.0)
    .rotate((1, 0, 0), 90)
    .shear(0.3, 0.3, (-1, 1)),
}


def random_nest(seed: int) -> Node:
    """A blend under a few random warps, turned in between."""
    rng = np.random.default_rng(seed)
    node = random_leaf(rng) + random_leaf(rng)
    for _ in range(rng.integers(2, 5)):
        node = random_deformation(rng, node.rotate(rng.normal(size=3), float(rng.uniform(-90, 90))))
    return node


def marched(tree: Node, origins: Float64Array, directions: Float64Array, steps: int = 1200) -> Float64Array:
    """Distances (n,) of the first samples inside along rays, in float64; inf if none is."""
    reach = 2.0 * float(np.linalg.norm(tree.support[1] - tree.support[0]))
    places = np.linspace(0.0, reach, steps)
    samples = origins[:, None] + places[:, None] * directions[:, None]
    inside = oracle.value(tree, samples.reshape(-1, 3)).reshape(len(origins), steps) > 0.5 + 1e-5
    return np.where(inside.any(axis=1), places[inside.argmax(axis=1)], np.inf)


def check_rays(tree: Node, count: int) -> int:
    """No ray passes a sample inside, and each hit is on the surface; return the number of hits."""
    rng = np.random.default_rng(0)
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    size, surface = float(np.linalg.norm(upper - lower)), rng.normal(size=(count, 3))
    surface /= np.linalg.norm(surface, axis=1, keepdims=True)
    origins = (0.5 * (lower + upper) + size * surface).astype(np.float32).astype(np.float64)
    inside = points_around(rng, tree, count).astype(np.float64)
    directions = (inside - origins) / np.linalg.norm(inside - origins, axis=1, keepdims=True)
    seen, tolerance = trace(tree, origins, directions), trace_tolerance(tree.support)
    assert (seen <= marched(tree, origins, directions) + 2.0 * tolerance).all()
    hit = np.isfinite(seen)
    points = origins[hit] + seen[hit, None] * directions[hit]
    steepest = 1.0 + np.linalg.norm(oracle.gradient(tree, points), axis=1)
    assert (np.abs(oracle.value(tree, points) - 0.5) <= 4.0 * tolerance * steepest + 2e-5).all()
    return int(hit.sum())


def check_bounds(tree: Node, seed: int) -> None:
    """Values and gradients match the oracle; bounds along rays, intervals and the box hold."""
    rng = np.random.default_rng(seed)
    points = points_around(rng, tree, 100)
    field = oracle.evaluate(tree, points)
    np.testing.assert_allclose(tree(points), field.value, atol=3e-5)
    smooth = field.margin > 1e-3
    expected = oracle.gradient(tree, points[smooth])
    error = np.linalg.norm(tree.gradient(points[smooth]) - expected, axis=1)
    assert (error <= 3e-4 * np.maximum(1.0, np.linalg.norm(expected, axis=1))).all()
    reach = (10.0 ** rng.uniform(-3.0, 0.5, 100)).astype(np.float32)
    headings = rng.normal(size=(100, 3))
    headings = (headings / np.linalg.norm(headings, axis=1, keepdims=True)).astype(np.float32)
    _, rise, fall = bounds_along(tree.tape, points, headings, reach).astype(np.float64).T
    distance = reach * np.linspace(0.05, 1.0, 20)[:, None]
    places = points.astype(np.float64) + headings.astype(np.float64) * distance[..., None]
    change = oracle.value(tree, places.reshape(-1, 3)).reshape(20, 100) - field.value
    assert (change - rise * distance).max() <= 3e-5
    assert (-change - fall * distance).max() <= 3e-5
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    for _ in range(8):
        a, b = np.sort(rng.uniform(lower, upper, (2, 3)), axis=0)
        b = a + (b - a) * rng.uniform(0.02, 1.0)
        smallest, largest = tree.interval(a, b)
        values = oracle.value(tree, rng.uniform(a, b, (200, 3)))
        assert smallest - 1e-5 <= values.min()
        assert values.max() <= largest + 1e-5
    outside = rng.uniform(lower - 0.5, upper + 0.5, (2000, 3))
    outside = outside[((outside < lower) | (outside > upper)).any(axis=1)]
    assert oracle.value(tree, outside).max() <= 1e-9


@pytest.mark.parametrize("name", STRONG)
def test_strong_deformations_keep_their_bounds(name: str) -> None:
    check_bounds(STRONG[name], 0)
    assert check_rays(STRONG[name], 100) > 20


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(n, marks=pytest.mark.slow) for n in range(8, 60))]
)
def test_random_nests_keep_their_bounds(seed: int) -> None:
    tree = random_nest(seed)
    check_bounds(tree, seed)
    check_rays(tree, 40)


@pytest.mark.parametrize("name", STRONG)
def test_meshes_of_deformed_models_are_closed_and_on_the_surface(name: str) -> None:
    mesh = polygonize(STRONG[name], resolution=32)
    assert np.abs(oracle.value(STRONG[name], mesh.vertices) - 0.5).max() < 1e-4
    edges = np.sort(
        np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1
    )
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert len(mesh.faces) > 200
    assert (uses == 2).all()


def test_warps_nest_as_deep_as_there_are_registers() -> None:
    node: Node = ROD
    for _ in range(WARP_REGISTERS):
        node = node.taper(0.9, (0, 4))
    scale = 0.9**WARP_REGISTERS
    np.testing.assert_allclose(node([[0.2 * scale, 0, 4]]), 0.5, atol=1e-5)
    with pytest.raises(InvalidNode, match="warps nest 9 deep"):
        node.taper(0.9, (0, 4))([[0, 0, 0]])


# -- shapes ---------------------------------------------------------------------------------------------


def test_a_bent_rod_is_an_arc_with_straight_ends() -> None:
    radius = 180.0 / np.pi / 60.0
    bent = ROD.bend(60, (0.5, 3.5))
    turn = np.linspace(0.0, np.pi, 7)
    arc = np.stack([radius - radius * np.cos(turn), 0 * turn, 0.5 + radius * np.sin(turn)], axis=1)
    np.testing.assert_allclose(bent(arc), 1.0, atol=1e-5)
    np.testing.assert_allclose(bent(arc + np.array([0, 0.2, 0])), 0.5, atol=1e-5)
    np.testing.assert_allclose(bent([[2 * radius, 0.2, 0.2], [0.2, 0, 0.3]]), 0.5, atol=1e-5)


@pytest.mark.parametrize("degrees", [0.0, 1e-6, -1e-6, 1e-12])
def test_a_bend_by_almost_nothing_moves_almost_nothing(degrees: float) -> None:
    points = points_around(np.random.default_rng(0), KNOBBED, 200)
    np.testing.assert_allclose(KNOBBED.bend(degrees, (0, 4))(points), KNOBBED(points), atol=2e-5)
    np.testing.assert_allclose(
        gradients_at(KNOBBED.bend(degrees, (0, 4)).tape, points),
        gradients_at(KNOBBED.tape, points),
        atol=2e-4,
    )


def test_below_the_limits_nothing_moves() -> None:
    points = points_around(np.random.default_rng(1), KNOBBED, 300)
    below = points[points[:, 2] < 1.0]
    for node in (
        KNOBBED.taper(0.5, (1, 3)),
        KNOBBED.shear(1, 2, (1, 3)),
        KNOBBED.stretch(2, (1, 3)),
        KNOBBED.twist(90, (1, 3)),
        KNOBBED.bend(40, (1, 3)),
    ):
        np.testing.assert_array_equal(node(below), KNOBBED(below))


def test_a_twist_with_wide_limits_is_a_twist() -> None:
    points = points_around(np.random.default_rng(2), KNOBBED, 300)
    shifted = KNOBBED.twist(50, limits=(-90, 90)).rotate((0, 0, 1), -90 * 50)
    np.testing.assert_allclose(shifted(points), KNOBBED.twist(50)(points), atol=5e-4)
    assert isinstance(KNOBBED.twist(50), Twist)


def test_a_curve_warp_takes_each_point_to_its_target() -> None:
    node = KNOBBED.curve_warp(SOURCE, TARGET, 2.0)
    assert isinstance(node, CurveWarp)
    to_child = _forward(CurveWarp.warp, node.warp_parameters)
    np.testing.assert_allclose([to_child(np.array(point)) for point in TARGET], SOURCE, atol=1e-9)
    lower, upper = CurveWarp.warp.box(np.full(3, 50.0), np.full(3, 51.0), node.warp_parameters)
    assert lower.tolist() == [50.0] * 3
    assert upper.tolist() == [51.0] * 3


def test_noise_depends_on_its_seed_alone_and_is_bounded() -> None:
    rough = [Point((0, 0, 0), radius=1.0).noise_warp(0.2, 1.0, seed=seed) for seed in (1, 1, 2)]
    points = points_around(np.random.default_rng(3), rough[0], 200)
    np.testing.assert_array_equal(rough[0](points), rough[1](points))
    assert np.abs(rough[0](points) - rough[2](points)).max() > 0.02
    vertices = polygonize(rough[0], resolution=24).vertices
    assert np.abs(np.linalg.norm(vertices, axis=1) - 1.0).max() < 0.2


# -- files and errors -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", STRONG)
def test_deformations_survive_files_pickles_and_text(name: str) -> None:
    node = STRONG[name]
    kinds = {type(part).__name__: type(part) for part in postorder(node)}
    for copy in (from_json(to_json(node)), pickle.loads(pickle.dumps(node)), eval(repr(node), kinds)):
        assert copy == node
        assert hash(copy) == hash(node)


INVALID: dict[str, tuple[Callable[[], Node], str]] = {
    "no limits": (lambda: ROD.taper(2, 5), "limits: expected two heights"),  # type: ignore[arg-type]
    "three limits": (lambda: ROD.taper(2, (1, 2, 3)), "limits: expected two heights"),  # type: ignore[arg-type]
    "equal limits": (lambda: ROD.shear(1, 0, (2, 2)), "high: expected a height above low = 2, got 2"),
    "descending limits": (lambda: Bend(ROD, 10, 2, 1), "high: expected a height above low"),
    "NaN": (lambda: LimitedTwist(ROD, float("nan"), 0, 1), "degrees: expected a finite number"),
    "infinite limit": (lambda: Shear(ROD, 1, 0, 0, float("inf")), "high: expected a finite number"),
    "flat taper": (lambda: Taper(ROD, 0.0, 0, 1), "factor: expected 0.001 to 1000"),
    "mirrored stretch": (lambda: Stretch(ROD, -1.0, 0, 1), "factor: expected 0.001 to 1000"),
    "a full turn": (lambda: ROD.bend(90, (0, 4)), "degrees: expected less than 360 between the limits"),
    "no amplitude": (lambda: NoiseWarp(ROD, 0.0, 1.0), "amplitude: expected a number above 0"),
    "folding noise": (lambda: NoiseWarp(ROD, 1.1, 1.0), "amplitude: expected at most the wavelength"),
    "half a seed": (lambda: NoiseWarp(ROD, 0.1, 1.0, 0.5), "seed: expected a whole number"),  # type: ignore[arg-type]
    "no points": (lambda: ROD.curve_warp([], [], 1.0), "source: expected 1 to 256 points"),
    "a number": (lambda: ROD.curve_warp(3.0, [(0, 0, 0)], 1.0), "source: expected points"),
    "flat points": (lambda: ROD.curve_warp([(0, 0)], [(0, 0)], 1.0), r"source\[0\]: expected three"),
    "uneven curves": (lambda: ROD.curve_warp(SOURCE, TARGET[:2], 1.0), "expected one point per point"),
    "double points": (lambda: ROD.curve_warp(SOURCE[:2], [TARGET[0]] * 2, 1.0), "expected distinct points"),
    "folding curve": (lambda: ROD.curve_warp(SOURCE[:1], [(9, 0, 0)], 1.0), "the motion folds space"),
    "no child": (lambda: Bend(3, 10, 0, 1), "expected BlobTree nodes"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", INVALID)
def test_invalid_deformations_are_refused(name: str) -> None:
    make, message = INVALID[name]
    with pytest.raises(InvalidNode, match=message):
        make()


@pytest.mark.parametrize(
    ("node", "message"),
    [
        (KNOBBED.bend(90, (1, 3)), "bend: its axis is 0.6366 from the z axis, and the field .* reaches 0.86"),
        (ROD.bend(80, (0, 4)), "bend: the field of its child reaches 0.44.* its ends would meet"),
    ],
)
def test_bends_without_room_are_refused(node: Node, message: str) -> None:
    uses: list[Callable[[], Any]] = [lambda: node.support, lambda: polygonize(node), lambda: node.bounds]
    for use in uses:
        with pytest.raises(InvalidNode, match=message):
            use()
