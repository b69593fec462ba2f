"""Convolution surfaces: values against quadrature, radii, joints, scale, bounds and refusals."""

from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import (
    ISO,
    ConvolutionArc,
    ConvolutionSegment,
    ConvolutionStroke,
    ConvolutionTriangle,
    Node,
    Sum,
    from_json,
    to_json,
)
from blobtree.errors import InvalidNode
from blobtree.transpile.python import plain_python, vector
from tests.bench.convolution_surfaces import elbow_error, even, joint_bulge, plain, surface_distances
from tests.blobtree.trees import points_around

LIMB = ConvolutionSegment((0.1, 0.2, 0.3), (1.2, -0.3, 0.5), radius=0.4, end_radius=0.15)
HOOK = ConvolutionArc((1, 0, 0), (0.2, 0.9, 0.3), (-0.9, -0.2, 0), radius=0.2)
SAIL = ConvolutionTriangle((0, 0, 0), (1.5, 0.2, 0.1), (0.3, 1.1, -0.4), radius=0.2)
EACH = pytest.mark.parametrize("node", [LIMB, HOOK, SAIL], ids=["segment", "arc", "triangle"])
CONVOLUTION_FIELDS = [type(node).field_kind for node in (LIMB, HOOK, SAIL)]
FRACTIONS = st.floats(0.02, 0.98)


@given(FRACTIONS, st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_parts_of_a_segment_add_up_to_it(t: float, seed: int) -> None:
    middle = tuple((1 - t) * np.array(LIMB.start) + t * np.array(LIMB.end))
    radius = (1 - t) * LIMB.radius + t * LIMB.end_radius
    parts = ConvolutionSegment(
        LIMB.start, middle, radius=LIMB.radius, end_radius=radius
    ) + ConvolutionSegment(middle, LIMB.end, radius=radius, end_radius=LIMB.end_radius)
    points = points_around(np.random.default_rng(seed), LIMB, 100)
    np.testing.assert_allclose(parts(points), LIMB(points), atol=1e-5)


@given(FRACTIONS, st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_parts_of_a_triangle_add_up_to_it(t: float, seed: int) -> None:
    middle = tuple((1 - t) * np.array(SAIL.b) + t * np.array(SAIL.c))
    parts = ConvolutionTriangle(SAIL.a, SAIL.b, middle, radius=SAIL.radius) + ConvolutionTriangle(
        SAIL.a, middle, SAIL.c, radius=SAIL.radius
    )
    points = points_around(np.random.default_rng(seed), SAIL, 100)
    np.testing.assert_allclose(parts(points), SAIL(points), atol=1e-5)


def test_arcs_add_up_to_a_circle_and_join_segments() -> None:
    corners = [(np.cos(a), np.sin(a), 0.0) for a in np.arange(7) * np.pi / 3.0]
    halves = [ConvolutionArc(*corners[i : i + 3], radius=0.2) for i in (0, 2, 4)]
    ring = halves[0] + halves[1] + halves[2]
    angles = np.linspace(0.0, 2.0 * np.pi, 60)
    points = np.column_stack([1.1 * np.cos(angles), 1.1 * np.sin(angles), np.full(60, 0.1)])
    assert np.ptp(ring(points)) < 1e-5
    straight = even((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), 0.2)
    wide = ConvolutionArc((0, 0, 0), (-1, 0.005, 0), (-2, 0.02, 0), radius=0.2)  # radius 100
    joined = (straight + wide)([[0.0, 0.2, 0.0], [0.0, 0.0, 0.2], [0.3, 0.0, 0.2]])
    np.testing.assert_allclose(joined, ISO, atol=2e-3)


@pytest.mark.parametrize("radius", [1e-3, 0.1, 50.0])
def test_long_segments_and_wide_sheets_show_their_radius(radius: float) -> None:
    limb = even((0.0, 0.0, 0.0), (40.0 * radius, 0.0, 0.0), radius)
    sheet = ConvolutionTriangle((0, 0, 0), (90 * radius, 0, 0), (0, 90 * radius, 0), radius=radius)
    base = np.full((1, 3), 20.0 * radius) * (1.0, 0.0, 0.0)
    up = np.array([0.0, 0.0, 1.0])
    assert surface_distances(limb, base, up, 3.0 * radius)[0] == pytest.approx(radius, rel=1e-4)
    base[0, 1] = 20.0 * radius
    assert surface_distances(sheet, base, up, 3.0 * radius)[0] == pytest.approx(radius, rel=1e-4)


@pytest.mark.parametrize("taper", [0.02, 0.1, 0.2, 0.3, 0.4, 0.48])
def test_tapered_segments_show_the_hull_of_their_balls(taper: float) -> None:
    node = ConvolutionSegment((0, 0, 0), (100, 0, 0), radius=1e-3, end_radius=1e-3 + 100 * taper)
    base = np.array([[5.0, 0.0, 0.0], [10.0, 0.0, 0.0], [15.0, 0.0, 0.0]])
    height = surface_distances(node, base, np.array([0.0, 1.0, 0.0]), 50.0)
    hull = (1e-3 + taper * base[:, 0]) / np.sqrt(1.0 - taper**2)
    np.testing.assert_allclose(height, hull, rtol=2e-3 if taper < 0.45 else 2e-2)


def test_collinear_segments_join_without_a_bulge() -> None:
    assert joint_bulge(even) <= 1e-4
    assert joint_bulge(plain) > 0.2


def test_an_elbow_is_as_thick_as_a_straight_segment_away_from_its_joint() -> None:
    assert elbow_error(even) <= 1e-4


@given(st.floats(-4.0, 4.0), st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_shapes_do_not_depend_on_scale(exponent: float, seed: int) -> None:
    scale = 10.0**exponent
    start, end = scale * np.array(LIMB.start), scale * np.array(LIMB.end)
    larger = ConvolutionSegment(start, end, radius=scale * LIMB.radius, end_radius=scale * LIMB.end_radius)
    points = points_around(np.random.default_rng(seed), LIMB, 50).astype(np.float64)
    np.testing.assert_allclose(larger(scale * points), LIMB(points), atol=2e-5)


def random_texels(kind: int, rng: np.random.Generator) -> tuple[list[Any], float, Any]:
    """Texels of a random leaf, its smallest kernel radius, and a point near it."""
    a, b, c = rng.normal(size=(3, 3)) * rng.choice([0.2, 1.0, 4.0])
    start, end = rng.uniform(0.1, 1.0, 2)
    q = a + (b - a) * rng.uniform(-0.2, 1.2) + rng.normal(size=3) * 0.4 * start
    if kind == 0:
        return [vector(*a, 1.0 / start), vector(*b, 1.0 / end)], min(start, end), q
    if kind == 1:
        u = a - b
        across = np.cross(u, c)
        across *= np.linalg.norm(u) / np.linalg.norm(across)
        angle = rng.choice([0.2, 1.0, 2.5, 3.1])
        texels = [vector(*b, 1.0 / start), vector(*u, np.cos(angle)), vector(*across, np.sin(angle))]
        return texels, start, a + rng.normal(size=3) * 0.4 * start
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    rows = [vector(*a, 1.0 / start), *(vector(*row, 0.0) for row in (b - a, c - a, normal))]
    return rows, start, q


@pytest.mark.ordinary_cases("0")
@pytest.mark.parametrize("kind", range(3))
def test_bounds_over_balls_hold_and_are_tight(kind: int) -> None:
    rng = np.random.default_rng(kind)
    row = CONVOLUTION_FIELDS[kind]
    value_gradient, bounds = (plain_python(cast(Any, f.func)) for f in (row.value_gradient, row.bounds))
    looseness = []
    for _ in range(60):
        texels, kernel, q = random_texels(kind, rng)
        radius = kernel * 10.0 ** rng.uniform(-2.0, 0.2)
        lowest, highest, steepest = bounds(vector(*q), radius, texels, 0)
        directions = rng.normal(size=(40, 3))
        shell = radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        samples = np.array([value_gradient(vector(*(q + offset)), texels, 0) for offset in shell])
        slopes = np.linalg.norm(samples[:, 1:], axis=1)
        assert lowest <= samples[:, 0].min()
        assert samples[:, 0].max() <= highest
        assert slopes.max() <= steepest
        if radius < 0.05 * kernel and slopes.max() > 0.1 / kernel:
            looseness.append((highest - lowest) / (2.0 * radius * slopes.max()))
    assert np.median(looseness) < 1.5


def test_strokes_are_sums_of_segments() -> None:
    corners = ((0, 0, 0), (1, 0, 0), (1, 1, 0))
    stroke = ConvolutionStroke(corners, (0.1, 0.2, 0.3), color=(1, 0, 0))
    assert stroke.expanded == Sum(
        (
            ConvolutionSegment((0, 0, 0), (1, 0, 0), radius=0.1, end_radius=0.2, color=(1, 0, 0)),
            ConvolutionSegment((1, 0, 0), (1, 1, 0), radius=0.2, end_radius=0.3, color=(1, 0, 0)),
        )
    )
    assert ConvolutionStroke(corners, (0.1,)).radii == (0.1, 0.1, 0.1)
    assert from_json(to_json(stroke)) == stroke


@EACH
def test_bounds_are_zero_away_from_the_support(node: Node) -> None:
    _, upper = node.support
    corner = upper + 0.01
    assert node.interval(corner, corner + 0.2) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ConvolutionSegment((1, 2, 3), (1, 2, 3), radius=1, end_radius=1), "use a Point"),
        (lambda: ConvolutionSegment((0, 0, 0), (1, 0, 0), radius=0, end_radius=1), "radius"),
        (lambda: ConvolutionSegment((0, 0, np.nan), (1, 0, 0), radius=1, end_radius=1), "start"),
        (lambda: ConvolutionArc((0, 0, 0), (1, 0, 0), (2, 0, 0), radius=1), "lie on a line"),
        (lambda: ConvolutionArc((0, 0, 0), (0, 0, 0), (2, 0, 0), radius=1), "equal"),
        (lambda: ConvolutionTriangle((0, 0, 0), (1, 0, 0), (2, 0, 0), radius=1), "lie on a line"),
        (lambda: ConvolutionTriangle((1, 1, 1), (1, 1, 1), (1, 1, 1), radius=1), "equal"),
        (lambda: ConvolutionStroke(((0, 0, 0),), (0.1,)), "two or more points"),
        (lambda: ConvolutionStroke(((0, 0, 0), (0, 0, 0)), (0.1,)), "two or more points"),
        (lambda: ConvolutionStroke(((0, 0, 0), (1, 0, 0)), (1, 2, 3)), "one for each of 2"),
        (lambda: LIMB.offset(-0.2).support, "leaves nothing"),
    ],
)
def test_degenerate_skeletons_are_refused(make: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()
