"""Four families of meshes that real models belong to and balls, knots and dragons do not, by seed.

Vessels are open surfaces of revolution with a lid, and with a spout and a handle whose ends cross the body's
wall and which face either way. Figures are closed parts that cross in one mesh: body, thin ears, horns, arms,
eyes half inside and teeth in part. Leaves are thin closed plates that meet in a stem. Patches are bands and
sectors of a vessel, each with vertices of its own, as spline surfaces come: their borders only meet.
"""

from collections.abc import Callable

import numpy as np

from tests.decals.fault_models import Arrays, joined

Random = np.random.Generator


def sheet(points: np.ndarray) -> Arrays:
    """Triangles over a grid of points ``[rows, columns, 3]``; its normals point along rows × columns."""
    rows, columns = points.shape[:2]
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = i * columns + j
    b, c, d = a + 1, a + columns, a + columns + 1
    faces = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], 2).reshape(-1, 3)
    return points.reshape(-1, 3), faces


def ring(points: np.ndarray) -> Arrays:
    """A `sheet` whose last column is its first, as the same vertices."""
    rows, columns = points.shape[:2]
    vertices, faces = sheet(np.concatenate([points, points[:, :1]], axis=1))
    row, column = np.divmod(faces, columns + 1)
    return vertices.reshape(rows, columns + 1, 3)[:, :-1].reshape(-1, 3), row * columns + column % columns


def lathed(radii: np.ndarray, heights: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Points of a surface of revolution around the y axis, ``[rows, columns, 3]``."""
    across, along = np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))
    return np.stack([across, np.broadcast_to(heights[:, None], across.shape), along], axis=-1)


def turns(sides: int) -> np.ndarray:
    return np.arange(sides) * 2 * np.pi / sides


def tube(rng: Random, x: np.ndarray, y: np.ndarray, radii: np.ndarray | float, sides: int = 24) -> Arrays:
    """An open tube around a path in the plane z = 0, whose normals all point inward or all outward."""
    path = np.stack([x, y, 0 * x], axis=1)
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    axes = np.cross([0.0, 0.0, 1.0], along), np.broadcast_to([0.0, 0.0, 1.0], along.shape)
    angles = turns(sides)[:, None]
    circles = np.cos(angles) * axes[0][:, None] + np.sin(angles) * axes[1][:, None]
    vertices, faces = ring(path[:, None] + np.broadcast_to(radii, x.shape)[:, None, None] * circles)
    return vertices, faces[:, :: rng.spawn(1)[0].choice([1, -1])]


def ellipsoid(center: tuple[float, ...], axes: tuple[float, ...], sides: int = 40) -> Arrays:
    """A closed ellipsoid with poles on the y axis."""
    polar = np.linspace(0, np.pi, sides // 2 + 1)[1:-1]
    vertices, faces = ring(lathed(np.sin(polar), -np.cos(polar), turns(sides)))
    k, last, count = np.arange(sides), len(vertices) - sides, len(vertices)
    caps = [(k, (k + 1) % sides, 0 * k + count), (last + (k + 1) % sides, last + k, 0 * k + count + 1)]
    faces = np.concatenate([faces, *(np.stack(cap, axis=1) for cap in caps)])
    return np.concatenate([vertices, [[0, -1, 0], [0, 1, 0]]]) * axes + center, faces


def spout(rng: Random) -> Arrays:
    s, reach, width = np.linspace(0, 1, 30), rng.uniform(0.6, 1.0), rng.uniform(0.14, 0.24)
    return tube(
        rng, 0.6 + reach * s, 0.45 + rng.uniform(0.4, 0.7) * s**2, width * (1 - rng.uniform(0.3, 0.7) * s)
    )


def vessel(rng: Random) -> Arrays:
    h, bulge, lip = np.linspace(0, 1, 40), rng.uniform(0.2, 0.4), rng.uniform(0.05, 0.15)
    sides = int(rng.integers(48, 80))
    body = ring(lathed(0.55 + bulge * np.sin(np.pi * h) + lip * (h > 0.96), 1.2 * h, turns(sides)))
    slope = np.linspace(0, np.pi / 2, 20)
    rise = rng.uniform(0.1, 0.4)
    lid = ring(lathed(np.linspace(0.55 + lip - 0.02, 0.02, 20), 1.2 + rise * np.sin(slope), turns(sides)))
    t = np.linspace(-2.2, 2.2, 40)
    handle = tube(
        rng,
        -0.6 - bulge / 2 - rng.uniform(0.45, 0.65) * np.cos(t / 1.5),
        0.6 + 0.38 * np.sin(t),
        rng.uniform(0.04, 0.09),
    )
    return joined(body, lid, spout(rng), handle)


def figure(rng: Random) -> Arrays:
    ear, horn, eye = rng.uniform(0.05, 0.12), rng.uniform(0.035, 0.08), rng.uniform(0.1, 0.16)
    tooth, arm = rng.uniform(0.02, 0.035), rng.uniform(0.1, 0.16)
    parts = [ellipsoid((0, 0, 0), (1, 1.2, 0.8), 80), ellipsoid((0, 1.5, 0.1), (0.6, 0.55, 0.55), 60)]
    for x in (-1, 1):
        parts += [
            ellipsoid((0.55 * x, 2.0, 0), (ear, 0.45, 0.25)),
            ellipsoid((0.25 * x, 2.25, 0.1), (horn, 0.5, horn)),
            ellipsoid((0.22 * x, 1.6, 0.55), (eye, eye, eye), 30),
            ellipsoid((1.15 * x, 0.2, 0), (0.7, arm, arm)),
            *(ellipsoid((1.9 * x, 0.2 + arm * k, 0), (0.25, arm / 3, arm / 3), 24) for k in (-1, 0, 1)),
        ]
    teeth = int(rng.integers(2, 5))
    rows = range(-teeth, teeth + 1)
    parts += [ellipsoid((2.4 * tooth * k, 1.3, 0.56), (tooth, 2.4 * tooth, tooth), 16) for k in rows]
    return joined(*parts)


def leaves(rng: Random) -> Arrays:
    stem, thickness = rng.uniform(0.05, 0.1), rng.uniform(0.015, 0.04)
    length, width, count = rng.uniform(0.5, 0.9), rng.uniform(0.2, 0.4), int(rng.integers(4, 9))
    parts = [ellipsoid((0, -0.6, 0), (stem, 0.9, stem), 30)]
    for k in range(count):
        vertices, faces = ellipsoid((length + 0.05, 0, 0), (length, thickness, width), 60)
        a, tilt = 2 * np.pi * k / count, rng.uniform(-0.3, 0.3)
        lift = np.array([[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
        turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
        parts.append((vertices @ (turn @ lift).T + [0, 0.6 * k / count - 0.3, 0], faces))
    return joined(*parts)


def patches(rng: Random) -> Arrays:
    bands, sectors, bulge = int(rng.integers(2, 5)), int(rng.integers(3, 6)), rng.uniform(0.2, 0.4)
    parts = [spout(rng)]
    borders = np.linspace(0, 1, bands + 1)
    for sector in range(sectors):
        for band in range(bands + 1):
            fine = 1 + (band + sector) % 2
            angles = np.linspace(2 * np.pi * sector, 2 * np.pi * (sector + 1), 9 * fine) / sectors
            if band < bands:
                h = np.linspace(borders[band], borders[band + 1], 7 * fine)
                points = lathed(0.55 + bulge * np.sin(np.pi * h), 1.2 * h, angles)
            else:
                slope = np.linspace(np.pi / 2, 0.02, 5 * fine)
                points = lathed(0.6 * np.sin(slope), 1.2 + 0.3 * np.cos(slope), angles)
            parts.append(sheet(points))
    return joined(*parts)


FAMILIES: dict[str, Callable[[Random], Arrays]] = {
    "vessel": vessel,
    "figure": figure,
    "leaves": leaves,
    "patches": patches,
}
"""Generators of models by the name of their family."""


def model_of(name: str, seed: int) -> Arrays:
    """Return the model of a name such as ``"vessel-4"``: a family and a number."""
    family, _, number = name.partition("-")
    return FAMILIES[family](np.random.default_rng([seed, int(number)]))
