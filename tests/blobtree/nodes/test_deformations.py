"""Deformations: analytic shapes, oracles in float64, bounds of nested warps, files and invalid parameters."""

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
    polygonize,
)
from blobtree.errors import InvalidNode
from blobtree.nodes.places import _forward
from blobtree.tape.codes import WARP_REGISTERS
from blobtree.tape.model import gradients_at
from tests.blobtree.trees import points_around, random_deformation, random_leaf
from tests.conformance import broken_laws
from tests.soundness import failures_of

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


def problems_of_warps(tree: Node, seed: int) -> list[str]:
    """What a tree of warps violates of the laws of fields, and of meshes and rays."""
    rng = np.random.default_rng(seed)
    laws = ("value", "gradient", "interval", "Lipschitz bound", "box", "file", "pickle")
    return broken_laws(tree, rng, *laws) + failures_of(tree, rng)


@pytest.mark.parametrize("name", STRONG)
def test_strong_deformations_keep_their_bounds(name: str) -> None:
    assert problems_of_warps(STRONG[name], 0) == []


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(n, marks=pytest.mark.slow) for n in range(8, 60))]
)
def test_random_nests_keep_their_bounds(seed: int) -> None:
    assert problems_of_warps(random_nest(seed), seed) == []


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
