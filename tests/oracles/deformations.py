"""Deformations in plain float64 NumPy: where a point lay before, and how far the next kink of the map is."""

import numpy as np

from blobtree import Bend, CurveWarp, LimitedTwist, Node, NoiseWarp, Shear, Stretch, Taper
from blobtree._typing import Float64Array

ANYWHERE = 1e9
"""Distance to the next kink of a smooth map."""


def unwarped(node: Node, q: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Points (n, 3) that `node` moves to q (n, 3), and distances (n,) from q to the next kink."""
    x, y, z = q.T
    match node:
        case Taper(factor=factor, low=low, high=high):
            scale = np.interp(z, [low, high], [1.0, factor])
            return np.stack([x / scale, y / scale, z], axis=1), _to_limits(z, low, high)
        case Shear(slope_x=along_x, slope_y=along_y, low=low, high=high):
            rise = np.interp(z, [low, high], [0.0, high - low])
            return np.stack([x - along_x * rise, y - along_y * rise, z], axis=1), _to_limits(z, low, high)
        case Stretch(factor=factor, low=low, high=high):
            end = low + factor * (high - low)
            inner = np.where(z < low, z, np.where(z < end, low + (z - low) / factor, z - end + high))
            return np.stack([x, y, inner], axis=1), _to_limits(z, low, end)
        case LimitedTwist(degrees=degrees, low=low, high=high):
            turn = np.radians(degrees) * (np.clip(z, low, high) - low)
            turned = (x + 1j * y) * np.exp(-1j * turn)
            return np.stack([turned.real, turned.imag, z], axis=1), _to_limits(z, low, high)
        case Bend():
            return _unbent(node, q)
        case NoiseWarp():
            waves = np.array(node.warp_parameters[3:]).reshape(-1, 8)
            return q + np.sin(q @ waves[:, :3].T + waves[:, 3]) @ waves[:, 4:7], np.full(len(q), ANYWHERE)
        case CurveWarp(source=source, target=target, reach=reach):
            centers = np.array(target)
            weights = np.linalg.solve(_wendland(centers, centers, reach), np.array(source) - centers)
            return q + _wendland(q, centers, reach) @ weights, np.full(len(q), ANYWHERE)
    raise TypeError(type(node))


def _to_limits(z: Float64Array, low: float, high: float) -> Float64Array:
    return np.asarray(np.minimum(np.abs(z - low), np.abs(z - high)))


def _wendland(points: Float64Array, centers: Float64Array, reach: float) -> Float64Array:
    s = np.minimum(np.linalg.norm(points[:, None] - centers, axis=2) / reach, 1.0)
    return np.asarray((1.0 - s) ** 4 * (4.0 * s + 1.0))


def _unbent(node: Bend, q: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Roll each point back: rigidly from the end that is nearer in angle, along the arc between the ends."""
    if node.degrees == 0.0:
        return q, np.full(len(q), ANYWHERE)
    x, y, z = q.T
    side, radius = np.sign(node.degrees), 1.0 / np.radians(abs(node.degrees))
    full = (node.high - node.low) / radius
    arm = (radius - side * x) + 1j * (z - node.low)
    angle = np.mod(np.angle(arm) + np.pi - full / 2.0, 2.0 * np.pi) - np.pi + full / 2.0
    ending = np.clip(angle, 0.0, full)
    rest = arm * np.exp(-1j * ending)
    arc = (angle > 0.0) & (angle < full)
    inner_x = side * np.where(arc, radius - np.abs(arm), radius - rest.real)
    inner_z = node.low + radius * ending + np.where(arc, 0.0, rest.imag)
    edges = np.abs(arm)[:, None] * np.abs(
        angle[:, None] - [0.0, full, full / 2.0 + np.pi, full / 2.0 - np.pi]
    )
    return np.stack([inner_x, y, inner_z], axis=1), edges.min(axis=1)
