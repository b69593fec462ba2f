"""Every decal against every point, in float64 NumPy: owner, field and image coordinates by brute force.

Written from the paper (equations 1 to 5) and the design, not from the implementation. Nothing is culled.
"""

from dataclasses import dataclass

import numpy as np

from tests.oracles.contact import RIM, complements, log_factor, rim_distance

FACING_LIMIT = -0.25
CHUNK = 2_000_000


@dataclass(frozen=True)
class Reference:
    """What the decals show at m points, and how near each point lies to a change of its owner.

    owner int[m], −1: none; e[m]: the owner's complement 1 − f before contact; field[m]: F after contact,
    0: none; uv[m, 2], 0: none; doubt[m]: smallest relative change of a distance, or change of a facing
    cosine, that would change the owner; stretch[m]: |q − p| over its length in the tangent plane, so how
    ill uv is conditioned.
    """

    owner: np.ndarray
    e: np.ndarray
    field: np.ndarray
    uv: np.ndarray
    doubt: np.ndarray
    stretch: np.ndarray


def decals_at(decals, points, normals, *, corrected=True, reach=1.0):
    """Evaluate `decals` (anything with their arrays) at points with unit normals.

    reach 1 is the paper; less leaves out whatever is farther than that many influence radii.
    """
    points, normals = np.asarray(points, np.float64), np.asarray(normals, np.float64)
    rows = max(1, CHUNK // max(1, len(decals.radii)))
    parts = [
        _chunk(decals, points[i : i + rows], normals[i : i + rows], corrected, reach)
        for i in range(0, max(1, len(points)), rows)
    ]
    return Reference(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _chunk(decals, points, normals, corrected, reach):
    count = len(points)
    centres, frames = decals.positions.astype(np.float64), decals.normals.astype(np.float64)
    influence = decals.radii.astype(np.float64) / RIM
    squared = sum((points[:, None, a] - centres[None, :, a]) ** 2 for a in range(3)) / influence**2
    cosine = normals @ frames.T
    acts = (squared < reach**2) & (decals.spill | (cosine > FACING_LIMIT))
    e = np.where(acts, complements(squared), 2.0)
    e = np.column_stack([e, np.full(count, 2.0)])  # a decal that never acts, so that there is one
    owner = e.argmin(axis=1)
    least = e[np.arange(count), owner]
    owned = least <= 0.5

    pair, other = np.nonzero(owned[:, None] & (e + least[:, None] < 1))
    pair, other = pair[other != owner[pair]], other[other != owner[pair]]
    log_h = np.bincount(pair, log_factor(e[pair, other], least[pair]), minlength=count)
    complement = least + (0.5 - least) * -np.expm1(log_h)

    uv, stretch = np.zeros((count, 2)), np.ones(count)
    k = owner[owned]
    xy, w = _tangent_offsets(decals, points[owned], normals[owned], k, corrected)
    length = np.hypot(xy[:, 0], xy[:, 1])
    stretch[owned] = np.linalg.norm(w, axis=1) / np.maximum(length, 1e-300)
    direction = xy / np.maximum(length, 1e-300)[:, None]
    uv[owned] = 0.5 + 0.5 * rim_distance(complement[owned])[:, None] * direction
    return (
        np.where(owned, owner, -1),
        least,
        np.where(owned, 1 - complement, 0.0),
        uv,
        _doubt(squared, cosine, decals.spill, acts),
        stretch,
    )


def _doubt(squared, cosine, spill, acts):
    """Distance to a tie, to the rim, or to the facing limit of a decal whose rim holds the point."""
    count = len(squared)
    d = np.sqrt(np.column_stack([np.where(acts, squared, 4.0), np.full((count, 2), [RIM**2, 4.0])]))
    d.sort(axis=1)
    tie = np.where(d[:, 0] < 1e-30, 0.0, (d[:, 1] - d[:, 0]) / np.maximum(d[:, 0], 1e-300))
    near = (squared < 1) & ~spill
    facing = np.where(near, np.abs(cosine - FACING_LIMIT), 4.0).min(axis=1, initial=4.0)
    return np.minimum(tie, facing)


def _tangent_offsets(decals, points, normals, k, corrected):
    """Offsets in the owners' frames, and chords."""
    n, u = decals.normals[k].astype(np.float64), decals.tangents[k].astype(np.float64)
    w = points - decals.positions[k]
    m = _bent(w, n, normals) if corrected else w
    return np.column_stack([(m * u).sum(axis=1), (m * np.cross(n, u)).sum(axis=1)]), w


def _bent(w, n_p, n_q):
    """Unroll the arc from n_p to n_q; then scale the chord's shadow for the change of curvature along it."""
    heights = [(w * n).sum(axis=1, keepdims=True) for n in (n_p, n_q)]
    shadow = w - heights[0] * n_p
    toward = n_q - (n_p * n_q).sum(axis=1, keepdims=True) * n_p
    sine = np.linalg.norm(toward, axis=1, keepdims=True)
    toward = np.where(sine > 1e-4, toward / np.maximum(sine, 1e-300), 0.0)
    half = np.arctan2(sine, (n_p * n_q).sum(axis=1, keepdims=True)) / 2
    half = np.maximum(half, 1e-12)
    radius = (heights[1] - heights[0]) / (4 * np.sin(half) ** 2)
    unrolled = radius * (2 * half - np.sin(2 * half)) * toward
    squared = np.maximum((shadow * shadow).sum(axis=1, keepdims=True), 1e-300)
    sideways = (shadow * toward).sum(axis=1, keepdims=True) / squared
    tighter = -(heights[0] + heights[1]) * half**2 / np.sin(half) / 2 * sideways
    return shadow * (1 + np.clip(tighter, -0.5, 0.5)) + unrolled
