"""Gradient-based blends: values, exact gradients, bounds, and the bulges that they avoid."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from blobtree import (
    Box,
    CleanUnion,
    Cone,
    GradientBlend,
    Mesh,
    Node,
    Point,
    Segment,
    Superquadric,
    from_json,
    polygonize,
    to_json,
)
from blobtree.custom import define_operator
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.tape.model import colors_at, gradients_at
from tests.blobtree.trees import points_around
from tests.conformance import broken_laws
from tests.oracles import blobtree as oracle
from tests.soundness import failures_of

CUBE = Box((-1.0, 0.0, 0.0), (1.2, 0.8, 0.8), radius=0.1)
BAR = Segment((-1.0, 0.0, 0.0), (2.0, 0.0, 0.0), radius=0.5)
A, B, C = (Point((x, 0.3 * x, 0.0), radius=0.5, color=(0.5 * x, 0.2, 0.1)) for x in (0.0, 0.8, 1.6))


def blend(a: Node, b: Node, start: float = 15.0, full: float = 75.0) -> GradientBlend:
    return GradientBlend(a, b, start_angle=start, full_angle=full)


CORE = {
    "a cube and a bar": blend(CUBE, BAR.rotate((0, 1, 0), 25)),
    "nested": blend(blend(A, B, 0.0, 90.0), C),
    "sums in a sum": blend(A + B, C, 30.0, 31.0) + Point((0.8, 0.2, 0.6), radius=0.4),
    "scaled and turned": blend(CUBE.scale((0.5, 1.0, 1.4)), B).rotate((1, 2, 3), 40).scale(0.3),
    "a cone in a union": blend(Cone((0, 0, 0), (1, 0, 0.3), radius=0.5, end_radius=0.2), B) | C,
    "a cut": blend(A, B) - Point((0.4, 0.5, 0.1), radius=0.4),
}
LIBRARY = {
    "warped": blend(BAR.translate((0.5, 0, 0)).twist(40.0), Point((0.3, 0.6, 0.2), radius=0.4)).bend(
        8.0, (-0.5, 0.5)
    ),
    "a profile and a field": blend(
        Segment((0, 0, 0), (0.5, 0.2, 0), radius=0.4, falloff="gaussian", width=0.4),
        Superquadric((0.6, 0.1, 0.3), (0.6, 0.5, 0.4), 0.6, 0.8),
    ),
    "a clean union": blend(CleanUnion(A, B), C, 0.0, 180.0),
}


@wp.func
def crossed(
    a: wp.float32, b: wp.float32, gradient_a: wp.vec3, gradient_b: wp.vec3, strength: wp.float32
) -> wp.vec3:
    """The larger field, and more of the smaller one where gradients are perpendicular."""
    lengths = wp.length(gradient_a) * wp.length(gradient_b)
    share = float(0.0)
    if lengths > 0.0:
        c = wp.dot(gradient_a, gradient_b) / lengths
        share = strength * (1.0 - c * c)
    if a >= b:
        return wp.vec3(a + share * b, 1.0, share)
    return wp.vec3(b + share * a, share, 1.0)


@wp.func
def crossed_envelope(a: wp.float32, b: wp.float32, strength: wp.float32) -> wp.vec2:
    return wp.vec2(wp.max(a, b), wp.max(a, b) + strength * wp.min(a, b))


@wp.func
def low_envelope(a: wp.float32, b: wp.float32, strength: wp.float32) -> wp.vec2:
    return wp.vec2(wp.max(a, b), wp.max(a, b))


@wp.func
def falling_envelope(a: wp.float32, b: wp.float32, strength: wp.float32) -> wp.vec2:
    return wp.vec2(0.0, 10.0 - a)


@wp.func
def switched(
    a: wp.float32, b: wp.float32, gradient_a: wp.vec3, gradient_b: wp.vec3, strength: wp.float32
) -> wp.vec3:
    """It jumps where gradients become equal."""
    if wp.length(gradient_a - gradient_b) > 0.0:
        return wp.vec3(wp.max(a, b), wp.where(a >= b, 1.0, 0.0), wp.where(a >= b, 0.0, 1.0))
    return wp.vec3(
        wp.max(a, b) + wp.min(a, b) * strength,
        wp.where(a >= b, 1.0, strength),
        wp.where(a >= b, strength, 1.0),
    )


@pytest.mark.slow
def test_a_custom_operator_reads_gradients() -> None:
    crossing = define_operator(
        crossed, gradients=True, envelope=crossed_envelope, like="blend", limits={"strength": (0.0, 1.0)}
    )
    a = Segment((0, 0, 0), (1, 0, 0), radius=0.4)
    b = Segment((0.5, 0, -1), (0.5, 0.2, 1), radius=0.3)
    tree = crossing(a, b, strength=0.8)
    rng = np.random.default_rng(1)
    points = points_around(rng, tree, 300)

    def expected(q: NDArray[Any]) -> NDArray[np.float64]:
        f, g = (oracle.value(operand, q) for operand in (a, b))
        df, dg = (oracle.gradient(operand, q, step=1e-4) for operand in (a, b))
        lengths = np.linalg.norm(df, axis=1) * np.linalg.norm(dg, axis=1)
        cosine = (df * dg).sum(axis=1) / np.maximum(lengths, 1e-30)
        share = np.where(lengths > 0.0, 0.8 * (1.0 - cosine**2), 0.0)
        return np.asarray(np.maximum(f, g) + share * np.minimum(f, g))

    seen = gradients_at(tree.tape, points)
    np.testing.assert_allclose(seen[:, 0], expected(points), atol=1e-4)
    step = 1e-5
    sides = [(expected(points + e) - expected(points - e)) / (2.0 * step) for e in step * np.eye(3)]
    error = np.linalg.norm(seen[:, 1:] - np.column_stack(sides), axis=1)
    assert np.quantile(error, 0.95) < 1e-3
    assert broken_laws(tree, rng, "interval") == []
    assert tree == from_json(to_json(tree))


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (crossed, {"envelope": low_envelope}, "outside its envelope"),
        (crossed, {"envelope": falling_envelope}, "envelope"),
        (crossed, {"steepest": 1.0}, "expected envelope"),
        (crossed, {"envelope": crossed_envelope, "monotone": True}, "monotone"),
        (switched, {"envelope": crossed_envelope}, "continuous"),
        (crossed_envelope, {"envelope": crossed_envelope}, "return"),
    ],
)
def test_wrong_definitions_are_refused(function: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidDefinition, match=message):
        define_operator(function, gradients=True, limits={"strength": (0.0, 1.0)}, **options)


@wp.func
def mean(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(0.5 * (a + b), 0.5, 0.5)


def test_an_envelope_needs_an_operator_that_reads_gradients() -> None:
    with pytest.raises(InvalidDefinition, match="envelope"):
        define_operator(mean, envelope=crossed_envelope)
    with pytest.raises(InvalidDefinition, match="gradient_a"):
        define_operator(mean, gradients=True, envelope=crossed_envelope)


def problems(tree: Node) -> list[str]:
    rng = np.random.default_rng(4)
    points = points_around(rng, tree, 200)
    field = oracle.signed(tree, points)
    sure = field.value > 1e-3
    np.testing.assert_allclose(colors_at(tree.tape, points)[sure], field.color[sure], atol=2e-2)
    laws = ("value", "gradient", "interval", "Lipschitz bound", "box", "file", "pickle")
    return broken_laws(tree, rng, *laws)


@pytest.mark.slow_cases("a cube and a bar")
@pytest.mark.parametrize("name", CORE)
def test_a_gradient_blend_is_that_of_the_oracle(name: str) -> None:
    assert problems(CORE[name]) == []


def tops(tree: Node) -> NDArray[np.float64]:
    """The heights of the surface above the axis of the bar, between the ends of cube and bar."""
    x = np.linspace(-1.6, 1.2, 57)
    low, high = np.zeros(57), np.full(57, 1.5)
    for _ in range(30):
        z = 0.5 * (low + high)
        inside = tree(np.column_stack([x, np.zeros(57), z])) >= 0.5
        low, high = np.where(inside, z, low), np.where(inside, high, z)
    return low


def test_a_bar_in_a_cube_of_its_own_width_does_not_bulge() -> None:
    union, plain, blended = (tops(tree) for tree in (CUBE | BAR, CUBE + BAR, blend(CUBE, BAR)))
    assert (plain - union).max() > 0.1 * BAR.radius
    assert np.abs(blended - union).max() < 1e-3 * BAR.radius


def test_a_gradient_blend_is_the_union_where_gradients_agree_or_an_operand_ends() -> None:
    tree = blend(CUBE, BAR.rotate((0, 1, 0), 25))
    points = np.random.default_rng(2).uniform(-1.8, 0.6, (2000, 3)).astype(np.float32)
    a, b = (gradients_at(operand.tape, points).astype(np.float64) for operand in tree.operands)
    lengths = np.linalg.norm(a[:, 1:], axis=1) * np.linalg.norm(b[:, 1:], axis=1)
    close = (a[:, 1:] * b[:, 1:]).sum(axis=1) > np.cos(np.radians(14.9)) * lengths
    same = close | (a[:, 0] == 0.0) | (b[:, 0] == 0.0)
    assert (same & (a[:, 0] > 0.0) & (b[:, 0] > 0.0)).sum() > 5
    np.testing.assert_array_equal(tree(points[same]), np.maximum(a[same, 0], b[same, 0]).astype(np.float32))
    assert (tree(points) > np.maximum(a[:, 0], b[:, 0]) + 1e-3).any()


@pytest.mark.slow
def test_derivatives_of_gradient_blends_are_exact() -> None:
    tree = CORE["nested"]
    points = np.array([[0.4, 0.3, 0.3], [1.2, 0.2, 0.35], [0.8, -0.3, 0.1]], np.float32)
    step = 1e-3
    shifts = step * np.eye(3, dtype=np.float32)
    sides = [(tree.gradient(points + e) - tree.gradient(points - e)) / (2.0 * step) for e in shifts]
    np.testing.assert_allclose(tree.hessian(points), np.stack(sides, axis=1), rtol=0.02, atol=0.05)


@pytest.mark.parametrize(("start", "full"), [(75.0, 15.0), (30.0, 30.5), (-1.0, 20.0), (0.0, 181.0)])
def test_wrong_angles_are_refused(start: float, full: float) -> None:
    with pytest.raises(InvalidNode, match="angle"):
        blend(A, B, start, full)


@pytest.mark.slow
@pytest.mark.parametrize("name", LIBRARY)
def test_a_gradient_blend_of_library_kinds_is_that_of_the_oracle(name: str) -> None:
    assert problems(LIBRARY[name]) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", CORE)
def test_meshes_and_rays_of_gradient_blends_are_sound(name: str) -> None:
    assert failures_of(CORE[name], np.random.default_rng(5)) == []
    assert_equal_meshes(*(polygonize(CORE[name], resolution=16, creases=sharp) for sharp in (False, True)))


def assert_equal_meshes(plain: Mesh, sharp: Mesh) -> None:
    np.testing.assert_array_equal(plain.vertices, sharp.vertices)
    assert sharp.sheet_counts is not None
    assert (sharp.sheet_counts == 1).all()
