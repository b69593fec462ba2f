"""One step of particle repulsion, pair by pair, in float64."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array

Wall: TypeAlias = tuple[Float64Array, Float64Array]
"""A mirror plane: a point, and the unit normal toward the particles."""


def facing_weight(cosine: float, limit: float) -> float:
    """Weight of a pair by the cosine of its normals: 1 above the limit, 0 from 1/4 below it."""
    t = float(np.clip(1.0 + 4.0 * (cosine - limit), 0.0, 1.0))
    return t * t * (3.0 - 2.0 * t)


def pair_energy(x: float, cutoff: float, core: float, stiffness: float) -> float:
    """x^-2, less its tangent at the cutoff, and a spring within the core."""
    spring: float = 0.5 * stiffness * max(core - x, 0.0) ** 2
    if x >= cutoff:
        return spring
    return float(spring + (x**-2 - cutoff**-2 + 2 * cutoff**-3 * (x - cutoff)))


def total_energy(
    positions: ArrayLike,
    normals: ArrayLike,
    sizes: Float64Array,
    *,
    cutoff: float,
    core: float,
    stiffness: float,
    facing_limit: float,
    closest: float,
    guides: ArrayLike | None = None,
) -> float:
    """Energy of all pairs, times the squares of their spacings; `guides` are the normals that weigh them."""
    guides = np.asarray(normals if guides is None else guides, float)
    points = np.asarray(positions, float)
    total = 0.0
    for i in range(len(points)):
        distances = np.linalg.norm(points[i + 1 :] - points[i], axis=1)
        pairs = 0.5 * (sizes[i] + sizes[i + 1 :])
        for j in np.flatnonzero(distances < cutoff * pairs):
            x = distances[j] / pairs[j]
            kept = max(x, closest)
            values = [pair_energy(kept + k * 1e-5 * kept, cutoff, core, stiffness) for k in (-1, 0, 1)]
            slope = (values[2] - values[0]) / (2e-5 * kept)
            energy = values[1] - (kept - x) * slope
            total += facing_weight(guides[i] @ guides[i + 1 + j], facing_limit) * pairs[j] ** 2 * energy
    return total


def rings(
    positions: ArrayLike,
    normals: ArrayLike,
    sizes: Float64Array,
    *,
    farthest: float,
    facing_limit: float,
    wall: Wall | None = None,
) -> tuple[Float64Array, Float64Array]:
    """Mean distance of each particle to its six nearest that face it fully, and the distance of the sixth.

    Images behind the wall count, the own one too. A missing particle counts as if at the farthest distance.
    """
    points, directions = np.asarray(positions, float), np.asarray(normals, float)
    pairs = 0.5 * (sizes[:, None] + sizes)
    facing = directions @ directions.T >= facing_limit
    distances = np.linalg.norm(points[:, None] - points, axis=2) / pairs
    distances[~facing | np.eye(len(points), dtype=bool)] = np.inf
    if wall is not None:
        images = points - 2.0 * ((points - wall[0]) @ wall[1])[:, None] * wall[1]
        image_distances = np.linalg.norm(points[:, None] - images, axis=2) / pairs
        distances = np.hstack([distances, np.where(facing, image_distances, np.inf)])
    padded = np.hstack([distances, np.full((len(points), 6), np.inf)])
    six = np.minimum(np.sort(padded, axis=1)[:, :6], farthest)
    return six.mean(axis=1), six[:, 5]


def ring_energy(
    positions: ArrayLike,
    normals: ArrayLike,
    sizes: Float64Array,
    *,
    ring_weight: float,
    mean: float,
    max_deviation: float,
    **rule: Any,
) -> float:
    """Tukey's biweight of how much each ring differs from the mean one, times the squared spacing."""
    deviations = np.minimum(np.abs(rings(positions, normals, sizes, **rule)[0] - mean) / max_deviation, 1.0)
    costs = max_deviation**2 / 6 * (1 - (1 - deviations**2) ** 3)
    return ring_weight * float((sizes**2 * costs).sum())


def ring_moves(
    positions: ArrayLike,
    normals: ArrayLike,
    sizes: Float64Array,
    *,
    ring_weight: float,
    mean: float,
    max_deviation: float,
    **rule: Any,
) -> tuple[Float64Array, Float64Array]:
    """What rings add to the force on each particle, ``[n, 3]``, and to its curvature, ``[n, 3, 3]``.

    The force is a central difference of `ring_energy`.
    """
    points, directions = np.asarray(positions, float), np.asarray(normals, float)
    forces, curvatures = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    for i in range(len(points)):
        for axis in np.linalg.svd(np.eye(3) - np.outer(directions[i], directions[i]))[0].T[:2]:
            step = 1e-6 * sizes[i]
            ends = []
            for sign in (-1, 1):
                moved = points.copy()
                moved[i] += sign * step * axis
                ends.append(
                    ring_energy(
                        moved,
                        directions,
                        sizes,
                        ring_weight=ring_weight,
                        mean=mean,
                        max_deviation=max_deviation,
                        **rule,
                    )
                )
            forces[i] -= (ends[1] - ends[0]) / (2 * step * sizes[i]) * axis
    images = [(points, ~np.eye(len(points), dtype=bool), np.ones((len(points), len(points))))]
    if rule.get("wall") is not None:
        point, normal = rule["wall"]
        images_behind = points - 2.0 * ((points - point) @ normal)[:, None] * normal
        images.append((images_behind, np.ones((len(points), len(points)), bool), 1.0 + np.eye(len(points))))
    sixth_distances = rings(points, directions, sizes, **rule)[1]
    for others, counted, mirror_factors in images:
        for i, j in zip(
            *np.nonzero(counted & (directions @ directions.T >= rule["facing_limit"])), strict=True
        ):
            pair = 0.5 * (sizes[i] + sizes[j])
            offset = points[i] - others[j]
            distance = np.linalg.norm(offset) / pair
            if distance <= min(sixth_distances[j], rule["farthest"] * (1 - 1e-9)):
                away = offset / np.linalg.norm(offset)
                away -= (away @ directions[i]) * directions[i]
                curvature_factor = mirror_factors[i, j] * ring_weight / 36 * (sizes[j] / pair) ** 2
                curvatures[i] += curvature_factor * np.outer(away, away)
    return forces, curvatures


def moves(
    positions: ArrayLike,
    normals: ArrayLike,
    sizes: Float64Array,
    *,
    cutoff: float,
    core: float,
    stiffness: float,
    facing_limit: float,
    damping: float,
    longest: float,
    isotropy: float,
    closest: float,
    wall: Wall | None = None,
    ring_weight: float = 0.0,
    mean: float = 0.0,
    max_deviation: float = 1.0,
) -> tuple[Float64Array, Float64Array]:
    """Damped Newton move and energy of every particle, its neighbours at rest.

    Behind a wall, a plane given as (point, unit normal), lie the images of all particles; a particle's own
    retreats as far as it does.

    The slope is a central difference of `pair_energy`: only the energy is shared with the kernel.
    """
    positions, normals = np.asarray(positions, float), np.asarray(normals, float)
    result, energies = np.zeros_like(positions), np.zeros(len(positions))
    forces, curvatures = np.zeros((len(positions), 3)), np.zeros((len(positions), 3, 3))
    if ring_weight:
        around: dict[str, Any] = {"farthest": cutoff, "facing_limit": facing_limit, "wall": wall}
        wish: dict[str, Any] = {"ring_weight": ring_weight, "mean": mean, "max_deviation": max_deviation}
        forces, curvatures = ring_moves(positions, normals, sizes, **wish, **around)
    for i, (p, n) in enumerate(zip(positions, normals, strict=True)):
        force, curvature = forces[i].copy(), curvatures[i].copy()
        others = [(j, q, 1.0) for j, q in enumerate(positions) if j != i]
        if wall is not None:
            others += [
                (j, q - 2.0 * ((q - wall[0]) @ wall[1]) * wall[1], 1.0 + (j == i))
                for j, q in enumerate(positions)
            ]
        for j, q, mirror_factors in others:
            pair = 0.5 * (sizes[i] + sizes[j])
            if np.linalg.norm(p - q) >= cutoff * pair:
                continue
            weight = facing_weight(n @ normals[j], facing_limit)
            x = max(np.linalg.norm(p - q) / pair, closest)
            step = 1e-5 * x
            values = [pair_energy(x + k * step, cutoff, core, stiffness) for k in (-1, 0, 1)]
            slope = (values[2] - values[0]) / (2 * step)
            curvature_factor = 6 * x**-4 + stiffness * (x < core)
            away = (p - q) / np.linalg.norm(p - q)
            away -= (away @ n) * n
            scale = pair / sizes[i]
            force -= weight * scale * slope * away
            curvature += mirror_factors * weight * curvature_factor * np.outer(away, away)
            penetration = max(x - np.linalg.norm(p - q) / pair, 0.0)
            energies[i] += weight * (values[1] - penetration * slope)
        tangent = np.eye(3) - np.outer(n, n)
        curvature += isotropy * np.trace(curvature) * tangent
        if curvature.any():
            move = damping * sizes[i] * np.linalg.pinv(curvature, rcond=1e-6, hermitian=True) @ force
            size = np.linalg.norm(move)
            result[i] = move * min(1.0, longest * sizes[i] / size) if size > 0 else move
    return result, energies
