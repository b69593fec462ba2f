"""Surfaces whose log maps are known, by formula or by integrated geodesics, and what decals draw on them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals import Decals, ImageMapping, evaluate
from tests.vectors import random_units, unit

DECAL = 0.5
"""Radius of a large decal on the torus (1, 0.4) and on the ellipsoid."""
AXES = np.array([1.0, 0.7, 0.45])


def dots(a: Any, b: Any) -> Any:
    return (a * b).sum(axis=1, keepdims=True)


def tangents(rng: np.random.Generator, normals: NDArray[Any]) -> Any:
    return unit(np.cross(normals, rng.normal(size=normals.shape)))


def offsets(rng: np.random.Generator, count: int, radius: float) -> Any:
    """Log maps in a disc, evenly spread in angle and length."""
    angle = rng.uniform(0, 2 * np.pi, count)
    return radius * rng.random((count, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])


# -- by formula: chords and normals of these log maps around one point, whose frame is that of the world --


def plane(log: Any) -> Any:
    return log @ np.eye(3)[:2], np.tile([0, 0, 1.0], (len(log), 1))


def sphere(log: Any) -> Any:
    angle = np.linalg.norm(log, axis=1, keepdims=True)
    n_q = np.hstack([np.sin(angle) * log / np.maximum(angle, 1e-300), np.cos(angle)])
    return n_q - [0, 0, 1], n_q


def cylinder(log: Any) -> Any:
    n_q = np.column_stack([np.sin(log[:, 0]), np.zeros(len(log)), np.cos(log[:, 0])])
    return np.column_stack([n_q[:, 0], log[:, 1], n_q[:, 2] - 1]), n_q


# -- by geodesics ----------------------------------------------------------------------------------------


def torus_gradient(x: Any) -> Any:
    ring = np.hypot(x[:, 0], x[:, 1])[:, None]
    return np.column_stack([x[:, :2] * (1 - 1 / ring), x[:, 2]])


def torus_points(rng: np.random.Generator, n: int) -> Any:
    a, b = rng.uniform(0, 2 * np.pi, (2, n))
    ring = 1 + 0.4 * np.cos(b)
    return np.column_stack([ring * np.cos(a), ring * np.sin(a), 0.4 * np.sin(b)])


def ellipsoid_gradient(x: Any) -> Any:
    return x / AXES**2


def ellipsoid_points(rng: np.random.Generator, n: int) -> Any:
    d = random_units(rng, n)
    return d / np.linalg.norm(d / AXES, axis=1, keepdims=True)


def walk(gradient: Any, start: Any, direction: Any, length: Any, steps: int = 100) -> Any:
    """End points of geodesics of the implicit surface with this gradient: Runge-Kutta of order four."""
    h = length / steps

    def acceleration(x: Any, v: NDArray[Any]) -> Any:
        g = gradient(x)
        bend = (gradient(x + 1e-5 * v) - gradient(x - 1e-5 * v)) / 2e-5
        return -dots(v, bend) / dots(g, g) * g

    x, v = start, direction
    for _ in range(steps):
        a1 = acceleration(x, v)
        v2 = v + h / 2 * a1
        a2 = acceleration(x + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = acceleration(x + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4)
        x, v = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x


# -- discs around a point --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Disc:
    """Points q f64[n, 3] of a surface around a decal's centre, with normals, and their log maps f64[n, 2]."""

    centre: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    log: np.ndarray

    def drawn(self, radius: float, mapping: ImageMapping = ImageMapping.CORRECTED) -> Any:
        """Where a decal of this radius draws the points: f64[n, 2], in units of length."""
        one = Decals([self.centre], [self.normal], [self.tangent], [radius])
        uv = evaluate(one, self.points, self.normals, mapping=mapping, device="cpu").uv
        return 2 * radius * (uv.astype(np.float64) - 0.5)


MakeDisc = Callable[[np.random.Generator, int, float], Disc]


def disc_by_formula(surface: Any) -> MakeDisc:
    """Discs of a surface of `plane`, `sphere` and `cylinder`, turned in space."""

    def make(rng: np.random.Generator, count: int, radius: float) -> Any:
        log = offsets(rng, count, radius)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        u, v, _ = turn = turn * np.sign(np.linalg.det(turn))
        w, n_q = surface(log)
        return Disc(np.zeros(3), np.cross(u, v), u, w @ turn, n_q @ turn, log)

    return make


def disc_by_geodesics(points: Any, gradient: Any) -> MakeDisc:
    """Discs around random points of a surface."""

    def make(rng: np.random.Generator, count: int, radius: float) -> Any:
        log = offsets(rng, count, radius)
        start = np.repeat(points(rng, 1), count, axis=0)
        normal = unit(gradient(start))
        u = tangents(rng, normal[:1])
        away = log @ np.concatenate([u, np.cross(normal[:1], u)])
        length = np.linalg.norm(log, axis=1, keepdims=True)
        q = walk(gradient, start, away / length, length, steps=40)
        return Disc(start[0], normal[0], u[0], q, unit(gradient(q)), log)

    return make


DISCS: dict[str, MakeDisc] = {
    "torus": disc_by_geodesics(torus_points, torus_gradient),
    "ellipsoid": disc_by_geodesics(ellipsoid_points, ellipsoid_gradient),
    "sphere": disc_by_formula(sphere),
    "cylinder": disc_by_formula(cylinder),
    "plane": disc_by_formula(plane),
}


def drawn_error(
    name: str,
    radius: float = DECAL,
    mapping: ImageMapping = ImageMapping.CORRECTED,
    *,
    discs: int = 80,
    points: int = 50,
) -> Any:
    """RMS error over the radius of what decals draw, against log maps up to the radius."""
    rng, errors = np.random.default_rng(3), []
    for _ in range(discs):
        disc = DISCS[name](rng, points, radius)
        errors.append(disc.drawn(radius, mapping) - disc.log)
    return float(np.sqrt((np.concatenate(errors) ** 2).sum(axis=1).mean()) / radius)
