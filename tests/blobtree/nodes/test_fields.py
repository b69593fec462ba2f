"""Direct fields: their shapes, maps, offsets, meshes, rays and files."""

from typing import Any

import numpy as np
import pytest

from blobtree import (
    ISO,
    RIM,
    ConvolutionArc,
    ConvolutionSegment,
    ConvolutionTriangle,
    FieldPrimitive,
    Gyroid,
    Noise,
    Point,
    Superquadric,
)
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import moved, primitive_at, primitive_paths, resized
from blobtree.nodes.surgery import dominant_primitive
from blobtree.tape.codes import FIELD, PREFIX
from tests.blobtree.trees import points_around

PILLOW = Superquadric((0.1, 0.2, 0.3), (1.0, 0.5, 0.7), 0.4, 1.5, color=(1, 0, 0))
SPONGE = Gyroid((0.1, 0.2, 0.3), (2.0, 1.5, 1.8), 1.0, 0.2, fade=0.3, color=(1, 0, 0))
ROCK = Noise((0.1, 0.2, 0.3), (2.0, 1.5, 1.8), 0.7, -0.1, 0.4, 17, color=(1, 0, 0))
LIMB = ConvolutionSegment((0.1, 0.2, 0.3), (1.2, -0.3, 0.5), radius=0.4, end_radius=0.2, color=(1, 0, 0))
HOOK = ConvolutionArc((1, 0, 0), (0.2, 0.9, 0.3), (-0.9, -0.2, 0), radius=0.3, color=(1, 0, 0))
SAIL = ConvolutionTriangle((0, 0, 0), (1.5, 0.2, 0.1), (0.3, 1.1, -0.4), radius=0.3, color=(1, 0, 0))
EACH = pytest.mark.parametrize(
    "node",
    [PILLOW, SPONGE, ROCK, LIMB, HOOK, SAIL],
    ids=["superquadric", "gyroid", "noise", "convolution segment", "convolution arc", "convolution triangle"],
)


def test_a_superquadric_of_exponents_one_is_an_ellipsoid() -> None:
    ellipsoid = Point((0, 0, 0), radius=1.0).scale((1.0, 0.5, 0.7)).translate((0.1, 0.2, 0.3))
    points = points_around(np.random.default_rng(4), ellipsoid, 500)
    round_one = Superquadric((0.1, 0.2, 0.3), (1.0, 0.5, 0.7))
    np.testing.assert_allclose(round_one(points), ellipsoid(points), atol=2e-6)
    np.testing.assert_allclose(round_one.gradient(points), ellipsoid.gradient(points), atol=1e-5)


def test_square_exponents_reach_into_the_corners() -> None:
    cube = Superquadric((0, 0, 0), (1, 1, 1), 0.1, 0.1)
    corner = 3.0**-0.05
    np.testing.assert_allclose(cube([[corner] * 3, [1, 0, 0], [0, 0, -1]]), ISO, atol=1e-5)


def test_the_wall_of_a_gyroid_has_its_thickness() -> None:
    sponge = Gyroid((0, 0, 0), (8, 8, 8), 1.0, 0.1, fade=0.01)
    rng = np.random.default_rng(5)
    inside = (sponge(rng.uniform(-2.0, 2.0, (20000, 3))) >= ISO).mean()
    assert inside == pytest.approx(0.1 * 3.0915, rel=0.03)  # area of the gyroid in a unit cube


def test_noise_differs_by_seed_and_repeats_after_289_units() -> None:
    rng = np.random.default_rng(6)
    points = rng.uniform(-3.0, 3.0, (500, 3))
    rocks = [Noise((0, 0, 0), (1000, 1000, 1000), 1.0, seed=seed) for seed in (0, 1)]
    assert np.abs(rocks[0](points) - rocks[1](points)).max() > 0.3
    np.testing.assert_allclose(rocks[0](points + np.array([289.0, 0.0, 0.0])), rocks[0](points), atol=1e-3)


def test_a_field_leaf_is_one_run_behind_its_map() -> None:
    tape = (PILLOW + PILLOW.translate((1, 0, 0)) + Point((0, 0, 0), radius=0.5)).tape
    code = FIELD + tape.fields[0]
    at = int(tape.headers[tape.data[tape.headers, 0] == code][0])
    assert tape.data[at, 2] == 2
    np.testing.assert_array_equal(tape.data[at + 1 : at + 4, :3], np.eye(3))
    np.testing.assert_allclose(tape.data[at + 1 + PREFIX, :3], PILLOW.center)
    assert tape.data[at + 1 + PREFIX + PILLOW.field_kind.parameters].tolist() == [1, 0, 0, 1]
    assert not tape.stretched


@EACH
def test_every_field_has_a_colour_and_is_found_by_paths(node: FieldPrimitive) -> None:
    quantities = [parameter.quantity for parameter in parameters_of(type(node)).values()]
    assert quantities.count(Quantity.COLOR) == 1
    tree = Point((3, 0, 0), radius=1.0) + node.rotate((0, 0, 1), 30)
    assert primitive_paths(tree) == [(0,), (1, 0)]
    assert primitive_at(tree, (1,)) == node
    assert dominant_primitive(tree, node.rotate((0, 0, 1), 30).bounds[0]) == (1, 0)


def test_moves_and_sizes_change_the_declared_lengths() -> None:
    assert moved(PILLOW, (1, 0, 0)) == Superquadric(
        (1.1, 0.2, 0.3), (1.0, 0.5, 0.7), 0.4, 1.5, color=(1, 0, 0)
    )
    twice = resized(PILLOW, 2.0)
    assert isinstance(twice, Superquadric)
    assert twice.semi_axes == (2.0, 1.0, 1.4)


def test_the_support_holds_the_field() -> None:
    lower, upper = PILLOW.support
    np.testing.assert_allclose(upper - lower, 2.0 * np.array(PILLOW.semi_axes) / RIM, rtol=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Superquadric((0, 0, 0), (1, 0, 1)), "semi_axes: expected three numbers above 0"),
        (lambda: Superquadric((0, 0, 0), (1, np.nan, 1)), "semi_axes: expected three"),
        (lambda: Superquadric((0, 0, 0), (1, 1, 1), 0.0), "vertical: expected 0.1 to 2, got 0.0"),
        (lambda: Superquadric((0, 0, 0), (1, 1, 1), 1.0, 2.5), "horizontal: expected 0.1 to 2, got 2.5"),
        (lambda: Gyroid((0, 0, 0), (1, 0, 1), 1.0, 0.1), "size: expected three numbers above 0"),
        (lambda: Gyroid((0, 0, 0), (1, 1, 1), 0.0, 0.1), "period: expected a number above 0"),
        (lambda: Noise((0, 0, 0), (1, 1, 1), 1.0, fade=0.0), "fade: expected 0.001 to 1, got 0.0"),
        (lambda: Noise((0, 0, 0), (1, 1, 1), 1.0, seed=300), "seed: expected a number from 0 to 288"),
        (lambda: Noise((0, 0, 0), (1, 1, 1), 1.0, seed=1.5), "seed: expected a whole number"),  # type: ignore[arg-type]
        (lambda: Noise((0, 0, 0), (1, 1, 1), 1.0, seed=10**9), "seed: expected a number"),
        (lambda: SPONGE.offset(-0.2).tape, "offset: -0.2 leaves nothing of Gyroid"),
        (lambda: PILLOW.offset(-0.5).tape, "offset: -0.5 leaves nothing of Superquadric"),
    ],
)
def test_wrong_parameters_are_refused(make: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()
