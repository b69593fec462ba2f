"""One step of particle repulsion, pair by pair, in float64."""

import numpy as np


def facing_weight(cosine, limit):
    t = np.clip(1.0 + 4.0 * (cosine - limit), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def pair_energy(x, exponent, cutoff, core, stiffness):
    """x^-p, less its tangent at the cutoff, and a spring within the core."""
    spring = 0.5 * stiffness * max(core - x, 0.0) ** 2
    return spring + np.where(
        x < cutoff,
        x**-exponent - cutoff**-exponent + exponent * cutoff ** (-exponent - 1) * (x - cutoff),
        0.0,
    )


def total_energy(
    positions, normals, sizes, *, cutoff, exponent, core, stiffness, facing_limit, closest, guides=None
):
    """Energy of all pairs, times the squares of their spacings; `guides` are the normals that weigh them."""
    guides = np.asarray(normals if guides is None else guides, float)
    places = np.asarray(positions, float)
    total = 0.0
    for i in range(len(places)):
        distances = np.linalg.norm(places[i + 1 :] - places[i], axis=1)
        pairs = 0.5 * (sizes[i] + sizes[i + 1 :])
        for j in np.flatnonzero(distances < cutoff * pairs):
            x = distances[j] / pairs[j]
            kept = max(x, closest)
            values = [
                pair_energy(kept + k * 1e-5 * kept, exponent, cutoff, core, stiffness) for k in (-1, 0, 1)
            ]
            slope = (values[2] - values[0]) / (2e-5 * kept)
            energy = values[1] - (kept - x) * slope
            total += facing_weight(guides[i] @ guides[i + 1 + j], facing_limit) * pairs[j] ** 2 * energy
    return total


def rings(positions, normals, sizes, *, farthest, facing_limit, wall=None):
    """Mean distance of each particle to its six nearest that face it fully, and the distance of the sixth.

    Images beyond the wall count, the own one too; who is missing counts as if at the farthest distance.
    """
    places, ways = np.asarray(positions, float), np.asarray(normals, float)
    pairs = 0.5 * (sizes[:, None] + sizes)
    facing = ways @ ways.T >= facing_limit
    distances = np.linalg.norm(places[:, None] - places, axis=2) / pairs
    distances[~facing | np.eye(len(places), dtype=bool)] = np.inf
    if wall is not None:
        images = places - 2.0 * ((places - wall[0]) @ wall[1])[:, None] * wall[1]
        beyond = np.linalg.norm(places[:, None] - images, axis=2) / pairs
        distances = np.hstack([distances, np.where(facing, beyond, np.inf)])
    padded = np.hstack([distances, np.full((len(places), 6), np.inf)])
    six = np.minimum(np.sort(padded, axis=1)[:, :6], farthest)
    return six.mean(axis=1), six[:, 5]


def ring_energy(positions, normals, sizes, *, evening, mean, odd, **rule):
    """Tukey's biweight of how much each ring differs from the mean one, times the squared spacing."""
    lacks = np.minimum(np.abs(rings(positions, normals, sizes, **rule)[0] - mean) / odd, 1.0)
    costs = odd**2 / 6 * (1 - (1 - lacks**2) ** 3)
    return evening * float((sizes**2 * costs).sum())


def ring_moves(positions, normals, sizes, *, evening, mean, odd, **rule):
    """What rings add to the force on each particle, ``[n, 3]``, and to its curvature, ``[n, 3, 3]``.

    The force is a central difference of `ring_energy`.
    """
    places, ways = np.asarray(positions, float), np.asarray(normals, float)
    forces, curvatures = np.zeros((len(places), 3)), np.zeros((len(places), 3, 3))
    for i in range(len(places)):
        for axis in np.linalg.svd(np.eye(3) - np.outer(ways[i], ways[i]))[0].T[:2]:
            step = 1e-6 * sizes[i]
            ends = []
            for sign in (-1, 1):
                moved = places.copy()
                moved[i] += sign * step * axis
                ends.append(ring_energy(moved, ways, sizes, evening=evening, mean=mean, odd=odd, **rule))
            forces[i] -= (ends[1] - ends[0]) / (2 * step * sizes[i]) * axis
    images = [(places, ~np.eye(len(places), dtype=bool), np.ones((len(places), len(places))))]
    if rule.get("wall") is not None:
        point, normal = rule["wall"]
        beyond = places - 2.0 * ((places - point) @ normal)[:, None] * normal
        images.append((beyond, np.ones((len(places), len(places)), bool), 1.0 + np.eye(len(places))))
    rims = rings(places, ways, sizes, **rule)[1]
    for others, counted, bends in images:
        for i, j in zip(*np.nonzero(counted & (ways @ ways.T >= rule["facing_limit"])), strict=True):
            pair = 0.5 * (sizes[i] + sizes[j])
            offset = places[i] - others[j]
            distance = np.linalg.norm(offset) / pair
            if distance <= min(rims[j], rule["farthest"] * (1 - 1e-9)):
                away = offset / np.linalg.norm(offset)
                away -= (away @ ways[i]) * ways[i]
                bend = bends[i, j] * evening / 36 * (sizes[j] / pair) ** 2
                curvatures[i] += bend * np.outer(away, away)
    return forces, curvatures


def moves(
    positions,
    normals,
    sizes,
    *,
    cutoff,
    exponent,
    core,
    stiffness,
    facing_limit,
    damping,
    longest,
    isotropy,
    closest,
    wall=None,
    evening=0.0,
    mean=0.0,
    odd=1.0,
):
    """Damped Newton move and energy of every particle, its neighbours at rest.

    Beyond a wall, a plane given as (point, unit normal), lie the images of all particles; a particle's own
    retreats as far as it does.

    The slope is a central difference of `pair_energy`: only the energy is shared with the kernel.
    """
    positions, normals = np.asarray(positions, float), np.asarray(normals, float)
    result, energies = np.zeros_like(positions), np.zeros(len(positions))
    forces, curvatures = np.zeros((len(positions), 3)), np.zeros((len(positions), 3, 3))
    if evening:
        around = {"farthest": cutoff, "facing_limit": facing_limit, "wall": wall}
        wish = {"evening": evening, "mean": mean, "odd": odd}
        forces, curvatures = ring_moves(positions, normals, sizes, **wish, **around)
    for i, (p, n) in enumerate(zip(positions, normals, strict=True)):
        force, curvature = forces[i].copy(), curvatures[i].copy()
        others = [(j, q, 1.0) for j, q in enumerate(positions) if j != i]
        if wall is not None:
            others += [
                (j, q - 2.0 * ((q - wall[0]) @ wall[1]) * wall[1], 1.0 + (j == i))
                for j, q in enumerate(positions)
            ]
        for j, q, bends in others:
            pair = 0.5 * (sizes[i] + sizes[j])
            if np.linalg.norm(p - q) >= cutoff * pair:
                continue
            weight = facing_weight(n @ normals[j], facing_limit)
            x = max(np.linalg.norm(p - q) / pair, closest)
            step = 1e-5 * x
            values = [pair_energy(x + k * step, exponent, cutoff, core, stiffness) for k in (-1, 0, 1)]
            slope = (values[2] - values[0]) / (2 * step)
            bend = exponent * (exponent + 1) * x ** (-exponent - 2) + stiffness * (x < core)
            away = (p - q) / np.linalg.norm(p - q)
            away -= (away @ n) * n
            scale = pair / sizes[i]
            force -= weight * scale * slope * away
            curvature += bends * weight * bend * np.outer(away, away)
            nearer = max(x - np.linalg.norm(p - q) / pair, 0.0)
            energies[i] += weight * (values[1] - nearer * slope)
        tangent = np.eye(3) - np.outer(n, n)
        curvature += isotropy * np.trace(curvature) * tangent
        if curvature.any():
            move = damping * sizes[i] * np.linalg.pinv(curvature, rcond=1e-6, hermitian=True) @ force
            size = np.linalg.norm(move)
            result[i] = move * min(1.0, longest * sizes[i] / size) if size > 0 else move
    return result, energies
