"""Convolution surfaces: thickness away from a joint, bulges at joints, errors, invariance to scale.

Thickness is measured as the distance of the surface from the skeleton. The plain sum of two distance fields
stands beside each bulge.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from blobtree import ISO, ConvolutionArc, ConvolutionSegment, ConvolutionTriangle, Node, Segment
from tests.oracles import convolution

Floats = NDArray[np.float64]
Limb = Callable[[tuple[float, float, float], tuple[float, float, float], float], Node]

RADIUS = 0.25
SMALLEST_VALUE = 0.01
"""Errors are relative to the value, or to this much where the value is less."""


def even(start: tuple[float, float, float], end: tuple[float, float, float], radius: float) -> Node:
    """A convolution segment of one radius."""
    return ConvolutionSegment(start, end, radius=radius, end_radius=radius)


def plain(start: tuple[float, float, float], end: tuple[float, float, float], radius: float) -> Node:
    """The same segment as a distance field."""
    return Segment(start, end, radius=radius)


def surface_distances(tree: Node, bases: Floats, direction: Floats, farthest: float) -> Floats:
    """Distances (n,) of the surface from points (n, 3) inside it along a direction, by bisection."""
    low, high = np.zeros(len(bases)), np.full(len(bases), farthest)
    for _ in range(40):
        middle = 0.5 * (low + high)
        inside = tree(bases + middle[:, None] * direction) >= ISO
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    distances: Floats = 0.5 * (low + high)
    return distances


def joint_bulge(limb: Limb, radius: float = RADIUS) -> float:
    """Largest excess of thickness near the joint of two collinear segments, relative to the radius."""
    tree = limb((-3.0, 0.0, 0.0), (0.0, 0.0, 0.0), radius) + limb((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), radius)
    bases = np.zeros((101, 3))
    bases[:, 0] = np.linspace(-1.0, 1.0, 101)
    distances = surface_distances(tree, bases, np.array([0.0, 1.0, 0.0]), 4.0 * radius)
    return float(np.abs(distances / radius - 1.0).max())


def elbow_error(limb: Limb, radius: float = RADIUS) -> float:
    """Largest deviation of an L's thickness from that of one straight segment, away from its joint.

    Measured from a kernel radius behind the joint on, on four sides, relative to the straight thickness.
    """
    arms = limb((4.0, 0.0, 0.0), (0.0, 0.0, 0.0), radius) + limb((0.0, 0.0, 0.0), (0.0, 4.0, 0.0), radius)
    straight = limb((4.0, 0.0, 0.0), (-4.0, 0.0, 0.0), radius)
    bases = np.zeros((41, 3))
    bases[:, 0] = np.linspace(1.2 * radius / convolution.LINE_RIM, 3.0, 41)
    worst = 0.0
    for direction in np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64):
        bent = surface_distances(arms, bases, direction, 4.0 * radius)
        reference = surface_distances(straight, bases, direction, 4.0 * radius)
        worst = max(worst, float(np.abs(bent / reference - 1.0).max()))
    return worst


def oracle_errors(count: int = 12, points: int = 60) -> tuple[float, float]:
    """Largest relative errors of value and gradient over random segments, arcs and triangles."""
    rng = np.random.default_rng(14)
    worst = [0.0, 0.0]
    for number in range(count):
        a, b, c = rng.normal(size=(3, 3))
        radius, end_radius = rng.uniform(0.05, 0.4, 2).tolist()
        node: Node
        if number % 3 == 0:
            node = ConvolutionSegment(a, b, radius=radius, end_radius=end_radius)
        elif number % 3 == 1:
            node = ConvolutionArc(a, c, b, radius=radius)
        else:
            node = ConvolutionTriangle(a, b, c, radius=radius)
        q = a + (b - a) * rng.random((points, 1)) + rng.normal(size=(points, 3)) * radius
        exact = convolution.evaluate(node, q)
        scale = np.maximum(exact[:, 0], SMALLEST_VALUE)
        worst[0] = max(worst[0], float((np.abs(node(q) - exact[:, 0]) / scale).max()))
        steepness = np.linalg.norm(exact[:, 1:], axis=1)
        off = np.linalg.norm(node.gradient(q) - exact[:, 1:], axis=1)
        worst[1] = max(
            worst[1], float((off / np.maximum(steepness, SMALLEST_VALUE / min(radius, end_radius))).max())
        )
    return worst[0], worst[1]


def scale_error() -> float:
    """Largest change of values when a tapered segment and its points are scaled by 1e-4 to 1e4."""
    rng = np.random.default_rng(15)
    q = rng.uniform(-1.0, 2.0, (500, 3)) * (1.0, 0.3, 0.3)
    worst = 0.0
    for scale in 10.0 ** np.arange(-4.0, 5.0):
        node = ConvolutionSegment((0, 0, 0), (scale, 0, 0), radius=0.1 * scale, end_radius=0.3 * scale)
        reference = ConvolutionSegment((0, 0, 0), (1, 0, 0), radius=0.1, end_radius=0.3)
        worst = max(worst, float(np.abs(node(q * scale) - reference(q)).max()))
    return worst


def figures() -> dict[str, float]:
    """All figures, as fractions of 1."""
    value_error, gradient_error = oracle_errors()
    return {
        "convolution_joint_bulge": joint_bulge(even),
        "plain_sum_joint_bulge": joint_bulge(plain),
        "convolution_elbow_error": elbow_error(even),
        "convolution_value_error": value_error,
        "convolution_gradient_error": gradient_error,
        "convolution_scale_error": scale_error(),
    }


if __name__ == "__main__":
    for name, figure in figures().items():
        print(f"{name:32} {figure:.3g}")
