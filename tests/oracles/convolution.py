"""Fields of convolution surfaces by plain quadrature in float64: sums over many nodes along a skeleton.

    f(q) = N ∫ (1 − |q − S|²/τ²)₊³ dS / τ^dimension

N makes the field of an infinite line, or plane, 1 on itself; τ is the visible radius over RIM, where that
field is ½. The integrals are one-dimensional, or over strips of a triangle.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import ConvolutionArc, ConvolutionSegment, ConvolutionTriangle, Node

Floats = NDArray[np.float64]

LINE_RIM = np.sqrt(1.0 - 0.5 ** (2.0 / 7.0))
SHEET_RIM = np.sqrt(1.0 - 0.5**0.25)

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def _composite(panels: int) -> tuple[Floats, Floats]:
    """Nodes and weights on [0, 1] of Gauss's rule in equal panels."""
    starts = np.arange(panels)[:, None]
    return ((starts + 0.5 + 0.5 * _NODES) / panels).ravel(), np.tile(0.5 * _WEIGHTS / panels, panels)


def _along(kernels: float) -> tuple[Floats, Floats]:
    """Nodes and weights on [0, 1] of a line that is so many kernel radii long."""
    return _composite(int(np.clip(PANELS_PER_KERNEL * kernels, 10, 400)))


PANELS_PER_KERNEL = 10
STRIPS = _composite(5)
CHORD_NODES, CHORD_WEIGHTS = np.polynomial.legendre.leggauss(4)
"""Gauss's rule for polynomials of degree 7: exact over the part of a strip that lies in the kernel."""


def evaluate(node: Node, points: ArrayLike) -> Floats:
    """Value and gradient (n, 4) of a convolution surface at points (n, 3)."""
    match node:
        case ConvolutionSegment(start=start, end=end, radius=radius, end_radius=end_radius):
            length = float(np.linalg.norm(np.subtract(end, start)))
            return segment(points, start, end, tapered_kernels(length, radius, end_radius))
        case ConvolutionArc(start=start, through=through, end=end, radius=radius):
            return arc(points, [start, through, end], radius / LINE_RIM)
        case ConvolutionTriangle(a=a, b=b, c=c, radius=radius):
            return triangle(points, [a, b, c], radius / SHEET_RIM)
    raise TypeError(type(node))


def tapered_kernels(length: float, radius: float, end_radius: float) -> tuple[float, float]:
    """Kernel radii at the ends of a segment: smaller, the faster the radius changes, as fitted once."""
    square = min(abs(end_radius - radius) / length, 0.5) ** 2
    factor = (1.0 - 0.65794805 * square + 0.46114516 * square**2 - 0.76805927 * square**3) / LINE_RIM
    return radius * factor, end_radius * factor


def segment(points: ArrayLike, start: ArrayLike, end: ArrayLike, kernels: tuple[float, float]) -> Floats:
    """Value and gradient (n, 4) of a segment with these kernel radii at its ends."""
    a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
    length = float(np.linalg.norm(b - a))
    x, w = _along(length / min(kernels))
    tau = kernels[0] + (kernels[1] - kernels[0]) * x
    return _line(points, a + (b - a) * x[:, None], tau, w * length)


def arc(points: ArrayLike, through: ArrayLike, kernel: float) -> Floats:
    """Value and gradient (n, 4) of the arc through three points (3, 3)."""
    a, b, c = np.asarray(through, np.float64)
    # The centre is equally far from all three points, in their plane.
    normal = np.cross(b - a, c - a)
    rows = np.array([b - a, c - a, normal])
    center = np.linalg.solve(rows, [rows[0] @ (a + b) / 2.0, rows[1] @ (a + c) / 2.0, normal @ a])
    radius = float(np.linalg.norm(a - center))
    e = (a - center) / radius
    side = np.cross(normal / np.linalg.norm(normal), e)
    angle = np.arctan2((c - center) @ side, (c - center) @ e) % (2.0 * np.pi)
    x, w = _along(angle * radius / kernel)
    theta = angle * x[:, None]
    curve = center + radius * (np.cos(theta) * e + np.sin(theta) * side)
    return _line(points, curve, np.full(len(x), kernel), w * angle * radius)


def triangle(points: ArrayLike, corners: ArrayLike, kernel: float) -> Floats:
    """Value and gradient (n, 4) of a triangle with corners (3, 3)."""
    q = np.asarray(points, np.float64)
    a, b, c = np.asarray(corners, np.float64)
    turns = [(a, b, c), (b, c, a), (c, a, b)]
    a, b, c = max(turns, key=lambda turn: float(np.linalg.norm(turn[2] - turn[0])))  # b's foot lies on ac
    x_axis = (c - a) / np.linalg.norm(c - a)
    normal = np.cross(c - a, b - a) / np.linalg.norm(np.cross(c - a, b - a))
    y_axis = np.cross(normal, x_axis)
    length, foot, height = float((c - a) @ x_axis), float((b - a) @ x_axis), float((b - a) @ y_axis)
    offsets = q - a
    at_x, y, z = ((offsets @ axis)[:, None] for axis in (x_axis, y_axis, normal))
    swing = np.sqrt(np.maximum(kernel**2 - z**2, 0.0))
    result = np.zeros((len(q), 4))
    for start, end, corner in ((0.0, foot, 0.0), (foot, length, length)):
        first = np.clip(at_x - swing, start, end)
        nodes, weights = STRIPS
        x = first + (np.clip(at_x + swing, start, end) - first) * nodes
        w = (np.clip(at_x + swing, start, end) - first) * weights
        top = height * np.abs(x - corner) / (end - start)
        dx = at_x - x
        reach = np.sqrt(np.maximum(kernel**2 - dx**2 - z**2, 0.0))
        low = np.clip(y - reach, 0.0, top)
        half = 0.5 * (np.clip(y + reach, 0.0, top) - low)
        dy = y[:, :, None] - (low[:, :, None] + half[:, :, None] * (1.0 + CHORD_NODES))
        k = np.maximum(1.0 - (dx[:, :, None] ** 2 + dy**2 + z[:, :, None] ** 2) / kernel**2, 0.0)
        area = (w * half)[:, :, None] * CHORD_WEIGHTS * (4.0 / np.pi / kernel**2)
        slope = -6.0 * area * k**2 / kernel**2
        along = (slope * dx[:, :, None]).sum(axis=(1, 2))[:, None] * x_axis
        across = (slope * dy).sum(axis=(1, 2))[:, None] * y_axis
        rise = slope.sum(axis=(1, 2))[:, None] * z * normal
        result += np.column_stack([(area * k**3).sum(axis=(1, 2)), along + across + rise])
    return result


def _line(points: ArrayLike, curve: Floats, tau: Floats, lengths: Floats) -> Floats:
    """Value and gradient (n, 4) of a line sampled at points (m, 3) with kernel radii and lengths (m,)."""
    q = np.asarray(points, np.float64)
    result = np.zeros((len(q), 4))
    widest = float(tau.max())
    near = ((q > curve.min(axis=0) - widest) & (q < curve.max(axis=0) + widest)).all(axis=1)
    offset = q[near, None] - curve
    k = np.maximum(1.0 - (offset**2).sum(axis=2) / tau**2, 0.0)
    weights = 35.0 / 32.0 * lengths / tau
    slopes = -6.0 * weights * k**2 / tau**2
    result[near] = np.column_stack([k**3 @ weights, np.einsum("nm,nmi->ni", slopes, offset)])
    return result
