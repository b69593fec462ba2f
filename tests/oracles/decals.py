"""Every decal against every point, in float64 NumPy, by brute force: owner, field, image place, colours.

Written from the paper (equations 1 to 5) and the design, not from the implementation. Nothing is culled.
"""

from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.oracles.contact import RIM, complements, log_factor, rim_distance

FACING_LIMIT = -0.25
LEAST = 0.21
ON_TOP = 0.5
IMAGE_END = 2 * np.sqrt(0.25001)
STIFFNESS = 2.0
CHUNK = 2_000_000


@dataclass(frozen=True)
class Reference:
    """What the decals show at m points, and how near each point lies to a change of its owner.

    owner int[m], −1: none; field[m]: F after contact, 0: none; uv[m, 2], 0: none; doubt[m]: smallest relative
    change of a distance, or change of a facing cosine, that would change the owner; stretch[m]: |q − p| over
    its length in the tangent plane, so how ill uv is conditioned.
    """

    owner: np.ndarray
    field: np.ndarray
    uv: np.ndarray
    doubt: np.ndarray
    stretch: np.ndarray


def decals_at(
    decals: Any,
    points: NDArray[Any],
    normals: NDArray[Any],
    *,
    corrected: bool = True,
    reach: float = 1.0,
    contact: str = "elastic",
    on: frozenset[str] | None = None,
) -> Any:
    """Return the topmost of `decals` (any object with their arrays) at points with normals, as a `Reference`.

    A decal acts up to `reach` influence radii; 1 is the paper. `on` holds the labels of the object that the
    points lie on.
    """
    return _in_chunks(_topmost, decals, points, normals, corrected, reach, contact, on)


def colors_at(
    decals: Any,
    points: NDArray[Any],
    normals: NDArray[Any],
    color_of: Any,
    *,
    corrected: bool = True,
    contact: str = "elastic",
    on: frozenset[str] | None = None,
) -> Any:
    """Premultiplied colours of all decals over each other, from the lowest up.

    color_of(numbers, uv) gives the premultiplied colours of these decals at these image coordinates, within
    the disc that is an image.
    """

    def composed(decals: Any, points: NDArray[Any], normals: NDArray[Any]) -> Any:
        scene = _Scene(decals, points, normals, 1.0, on, corrected)
        color = np.zeros((len(points), 4))
        for members in reversed(_drawings(decals)):
            owner, complement, _ = scene.shown(members, contact)
            rows = np.flatnonzero(owner >= 0)
            uv, _ = _image_place(
                decals, points[rows], normals[rows], owner[rows], complement[rows], corrected, contact
            )
            inside = np.hypot(*(uv - 0.5).T) <= 0.5 + 1e-5
            front = color_of(owner[rows], uv) * (inside * scene.fades[rows, owner[rows]])[:, None]
            color[rows] = front + (1 - front[:, 3:]) * color[rows]
        return (color,)

    return _in_chunks(lambda *arrays: composed(*arrays[:3]), decals, points, normals)[0]


def reached(decals: Any, points: NDArray[Any], normals: NDArray[Any], least: float) -> Any:
    """True for points beyond which the image of a decal reaches by at least so many of its radii."""

    def reaching(decals: Any, points: NDArray[Any], normals: NDArray[Any]) -> Any:
        scene = _Scene(decals, points, normals, 1.0, None, True)
        inside = scene.facing & (scene.squared <= RIM**2) & (scene.cosine > scene.limit + least)
        return ((inside & (scene.spare(inside, np.arange(len(decals.radii))) > least)).any(axis=1),)

    return _in_chunks(reaching, decals, points, normals)[0]


def _in_chunks(function: Any, decals: Any, points: NDArray[Any], normals: NDArray[Any], *options: Any) -> Any:
    points, normals = np.asarray(points, np.float64), np.asarray(normals, np.float64)
    rows = max(1, CHUNK // max(1, len(decals.radii)))
    parts = [
        function(decals, points[i : i + rows], normals[i : i + rows], *options)
        for i in range(0, max(1, len(points)), rows)
    ]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Reference(*columns) if function is _topmost else columns


def _drawings(decals: Any) -> Any:
    """Who is drawn together, from the top down: every sheet of contact decals, every other decal alone."""
    order = sorted(range(len(decals.radii)), key=lambda i: (decals.layers[i], decals.interactions[i], i))
    together = groupby(
        order,
        lambda i: (decals.layers[i], decals.interactions[i], None if decals.interactions[i] == 1 else i),
    )
    return [np.array(sorted(members)) for _, members in together][::-1]


def _topmost(
    decals: Any,
    points: NDArray[Any],
    normals: NDArray[Any],
    corrected: bool,
    reach: Any,
    contact: Any,
    on: frozenset[str] | None,
) -> Any:
    scene = _Scene(decals, points, normals, reach, on, corrected)
    count = len(points)
    owner, complement, doubt = np.full(count, -1), np.ones(count), np.full(count, 4.0)
    for members in _drawings(decals):
        under, e, unsure = scene.shown(members, contact)
        free = owner < 0
        doubt[free] = np.minimum(doubt, unsure)[free]
        owner, complement = np.where(free, under, owner), np.where(free & (under >= 0), e, complement)
    owned = owner >= 0
    uv, stretch = np.zeros((count, 2)), np.ones(count)
    uv[owned], stretch[owned] = _image_place(
        decals, points[owned], normals[owned], owner[owned], complement[owned], corrected, contact
    )
    return owner, np.where(owned, 1 - complement, 0.0), uv, np.minimum(doubt, scene.facing_doubt()), stretch


class _Scene:
    """All distances between points and decals."""

    def __init__(
        self,
        decals: Any,
        points: NDArray[Any],
        normals: NDArray[Any],
        reach: Any,
        on: frozenset[str] | None,
        corrected: bool,
    ) -> None:
        self.normals, self.facings, self.corrected = normals, decals.normals.astype(np.float64), corrected
        self.points, self.centres = points, decals.positions.astype(np.float64)
        self.radii, self.spill = decals.radii.astype(np.float64), decals.spill
        self.alone = np.asarray(decals.interactions) != 1
        self.cosine = normals @ self.facings.T
        offsets = [points[:, None, a] - self.centres[None, :, a] for a in range(3)]
        self.squared = sum(w**2 for w in offsets) / (self.radii / RIM) ** 2
        count = len(self.radii)
        angles = np.radians(np.asarray(getattr(decals, "fade_angles", np.zeros(count)), np.float64))
        depths = np.asarray(getattr(decals, "fade_depths", np.zeros(count)), np.float64) * self.radii
        texts = getattr(decals, "receivers", [""] * count)
        self.limit = np.where(angles > 0, np.cos(angles), np.where(self.spill, -4, FACING_LIMIT))
        above = np.abs(sum(w * decals.normals[None, :, a] for a, w in enumerate(offsets)))
        away = sum(w * normals[:, a, None] for a, w in enumerate(offsets))
        signed = sum(w * decals.normals[None, :, a] for a, w in enumerate(offsets))
        single = np.asarray(getattr(decals, "single_sheets", np.zeros(count)), bool)
        self.through = np.where(single, signed * away / self.radii**2 - 0.15**2, -4.0)
        taken = [on is None or text == "" or not on.isdisjoint(text.split(", ")) for text in texts]
        self.facing = (self.cosine > self.limit) & ((depths == 0) | (above < depths)) & np.array(taken, bool)
        self.facing &= self.through <= 0
        with np.errstate(all="ignore"):
            turned = (self.cosine - np.cos(angles)) / (np.cos(angles / 2) - np.cos(angles))
            sunk = 2 - 2 * above / depths
        self.fades = np.where(angles > 0, _eased(turned), 1) * np.where(depths > 0, _eased(sunk), 1)
        self.sinking = np.where(depths > 0, np.abs(above - depths) / self.radii, 4.0)
        self.acts = (self.squared < reach**2) & self.facing

    def shown(self, members: Any, contact: Any) -> Any:
        """Who of a sheet, or of one other decal, shows; E = 1 − F; and the doubt about it."""
        squared, acts = self.squared[:, members], self.acts[:, members]
        if contact in ("radial", "elastic") and not self.alone[members[0]]:
            return self.cells(members, elastic=contact == "elastic")
        count = len(squared)
        e = np.column_stack([np.where(acts, complements(squared), 2.0), np.full(count, 2.0)])
        owner = e.argmin(axis=1)
        least = e[np.arange(count), owner]
        owned = least <= 0.5
        pair, other = np.nonzero(owned[:, None] & (e + least[:, None] < 1))
        pair, other = pair[other != owner[pair]], other[other != owner[pair]]
        log_h = log_factor(e[pair, other], least[pair])
        if contact == "min":
            together = np.zeros(count)
            np.minimum.at(together, pair, log_h)
        else:
            together = np.bincount(pair, log_h, minlength=count).astype(np.float64)
        complement = least + (0.5 - least) * -np.expm1(together)
        who = np.append(members, -1)
        return np.where(owned, who[owner], -1), complement, _tie_doubt(squared, acts)

    def spare(self, inside: Any, members: Any) -> Any:
        """How far images reach beyond points inside their rims, in their radii."""
        result = np.full(inside.shape, 4.0)
        if self.corrected:
            rows, columns = np.nonzero(inside)
            decals = np.broadcast_to(members, inside.shape)[rows, columns]
            w = (self.points[rows] - self.centres[decals]) / self.radii[decals][:, None]
            lengths = _unrolled(w, self.facings[decals], self.normals[rows])[1]
            result[rows, columns] = IMAGE_END - lengths
        return result

    def cells(self, members: Any, *, elastic: bool) -> Any:
        """Convex cells between radical planes. Of stacked decals the smallest shows that faces q well.

        Its image must reach q.
        """
        centres, radii = self.centres[members], self.radii[members]
        squared, facing = self.squared[:, members], self.facing[:, members]
        power = (squared / RIM**2 - 1) * radii**2
        inside = facing & (power <= 0)
        near = inside | (np.abs(power) < 1e-3 * radii**2)
        away = np.where(self.spill[members], 4.0, self.cosine[:, members] - ON_TOP)
        # Only the nearest few of each point, in order of their numbers: all the rows that are compared.
        few = np.argsort(~near, axis=1, kind="stable")[:, : max(1, near.sum(axis=1).max(initial=0))]
        power_few, inside_few, near_few, away_few = (
            np.take_along_axis(each, few, axis=1) for each in (power, inside, near, away)
        )
        stacked_few = _stacked(centres[few][:, :, None], centres[few][:, None], radii[few], radii[few])
        # Beyond the plane to j where j has less power, unless i and j are stacked or j faces away.
        less = power_few[:, None, :] < power_few[:, :, None]
        beyond = less & (inside_few[:, None, :] & ~stacked_few)
        lowest = ~(less & inside_few[:, None, :]).any(axis=2)
        spare_few = self.spare(inside_few, members[few])
        shows = inside_few & ~beyond.any(axis=2) & ((away_few > 0) & (spare_few >= 0) | lowest)
        upper = np.argsort(np.argsort(radii, kind="stable"), kind="stable")
        uppermost = np.where(shows, upper[few], len(members)).argmin(axis=1)
        owner, owned = few[np.arange(len(few)), uppermost], shows.any(axis=1)
        apart = centres[None] - centres[owner][:, None]
        distance = np.linalg.norm(apart, axis=2)
        stacked = _stacked(centres[owner][:, None], centres[None], radii[owner], radii)
        w = self.points - centres[owner]
        x = np.linalg.norm(w, axis=1)
        ray = w / np.maximum(x, 1e-300)[:, None]
        ahead = np.einsum("ma,mna->mn", ray, apart)
        blocks = facing & ~stacked & (ahead > 0)
        share = 0.5 * (distance**2 + radii[owner, None] ** 2 - radii[None] ** 2)
        planes = np.where(blocks, share / np.where(ahead > 0, ahead, 1), np.inf)
        if elastic:
            r = _compressed(x / radii[owner], planes / radii[owner, None], distance, radii, owner)
        else:
            r = x / np.minimum(planes.min(axis=1), radii[owner])
        z = (np.minimum(r, 1) * RIM) ** 2
        large = radii[few] ** 2
        pairs = near_few[:, None] & near_few[:, :, None]
        sizes = np.where(pairs, large[:, :, None] + large[:, None], 1e-300)
        gap = np.abs(power_few[:, None] - power_few[:, :, None]) / sizes
        gap[:, np.arange(few.shape[1]), np.arange(few.shape[1])] = 4.0
        doubt = np.minimum((np.abs(power) / radii**2).min(axis=1), gap.min(axis=(1, 2)))
        over = (inside_few[:, None, :] & stacked_few & less).any(axis=2)
        unsure = np.minimum(np.abs(away_few), np.abs(spare_few))
        doubt = np.minimum(doubt, np.where(inside_few & over, unsure, 4.0).min(axis=1))
        if elastic:
            aside = facing & stacked & (squared < 1.6 * RIM**2) & (radii < radii[owner][:, None])
            doubt = np.minimum(doubt, np.where(aside, np.abs(away), 4.0).min(axis=1))
        return np.where(owned, members[owner], -1), complements(z), doubt

    def facing_doubt(self) -> Any:
        """Distance to the facing limit of a decal that reaches the point."""
        doubt = np.minimum(np.abs(self.cosine - self.limit), self.sinking)
        doubt = np.minimum(doubt, np.abs(self.through))
        return np.where(self.squared < 1, doubt, 4.0).min(axis=1, initial=4.0)


def _eased(t: NDArray[Any]) -> NDArray[Any]:
    """0 up to t = 0, 1 from 1 on, and the cubic with flat ends between."""
    t = np.clip(np.nan_to_num(t), 0, 1)
    eased: NDArray[Any] = t * t * (3 - 2 * t)
    return eased


def _stacked(first: Any, second: Any, own: NDArray[Any], other: NDArray[Any]) -> Any:
    """Which decals of the first have no plane to those of the second, or one that is too near a centre."""
    distance, own, other = np.linalg.norm(second - first, axis=-1), own[..., :, None], other[..., None, :]
    with np.errstate(all="ignore"):
        keeps = (distance**2 + own**2 - other**2) / (2 * distance * own)
        kept_by_other = (distance**2 + other**2 - own**2) / (2 * distance * other)
    return ~((keeps > LEAST) & (kept_by_other > LEAST))


def _compressed(
    t: NDArray[Any], planes: NDArray[Any], apart: NDArray[Any], radii: NDArray[Any], owner: Any
) -> Any:
    """r of points at distances t, with planes at these distances on their rays, all in the owners' radii.

    Each plane takes up what its own side of the rim loses, from where the neighbour's reach of √1.6 of its
    radius begins at the latest, on the ray that needs the most; several add up as squares of moved over left.
    """
    own, other = radii[owner, None], radii[None]
    g = apart**2 - other**2 - own**2
    begin = 1 - (np.sqrt(g**2 + 2.4 * own**2 * other**2) - g) / (2 * own**2)
    begin = np.maximum(begin, 0)
    lost = np.maximum(1 - planes, 0)
    way = (t[:, None] / planes - begin) / (1 - begin)
    with np.errstate(all="ignore"):
        moved = np.where((lost > 0) & (way > 0), lost * np.minimum(way, 1) ** (STIFFNESS + 0.1 / lost), 0)
        total = np.sqrt(((moved / (1 - t[:, None] - moved)) ** 2).sum(axis=1))
        r = 1 - (1 - t) / (1 + total)
    return np.where((t >= 1) | (t[:, None] >= planes).any(axis=1), 1.0, np.where(total > 0, r, t))


def _tie_doubt(squared: NDArray[Any], acts: Any) -> Any:
    """Relative distance to a tie of the two nearest, or to the rim."""
    count = len(squared)
    d = np.sqrt(np.column_stack([np.where(acts, squared, 4.0), np.full((count, 2), [RIM**2, 4.0])]))
    d.sort(axis=1)
    return np.where(d[:, 0] < 1e-30, 0.0, (d[:, 1] - d[:, 0]) / np.maximum(d[:, 0], 1e-300))


def _image_place(
    decals: Any,
    points: NDArray[Any],
    normals: NDArray[Any],
    owner: NDArray[Any],
    complement: Any,
    corrected: bool,
    contact: str,
) -> Any:
    """uv, and |q − p| over the length in the tangent plane of what gives uv its direction."""
    p, n, u = (a[owner].astype(np.float64) for a in (decals.positions, decals.normals, decals.tangents))
    w = (points - p) / decals.radii[owner].astype(np.float64)[:, None]
    chord = np.linalg.norm(w, axis=1)
    m, length = _unrolled(w, n, normals) if corrected else (w, chord)
    xy = np.column_stack([(m * u).sum(axis=1), (m * np.cross(n, u)).sum(axis=1)])
    shadow = np.maximum(np.linalg.norm(xy, axis=1), 1e-300)
    drawn = np.minimum(rim_distance(complement), 1)
    if corrected:
        # What neighbours leave of the way to the rim, times what the arc leaves of it; or already beyond it.
        left = (1 - drawn) * (1 - length) / np.where(length < 1, 1 - chord, 1)
        drawn = np.where(length < 1, 1 - left, length)
    xy = (drawn / shadow)[:, None] * xy
    if contact == "elastic":
        left_aside = np.maximum(1 - drawn**2, 0)[:, None]
        moved = _parted(decals, points, normals, owner) * left_aside
        xy = xy + np.column_stack([(moved * u).sum(axis=1), (moved * np.cross(n, u)).sum(axis=1)])
    return 0.5 + 0.5 * xy, chord / shadow


def _parted(decals: Any, points: NDArray[Any], normals: NDArray[Any], owner: NDArray[Any]) -> Any:
    """How far stacked decals above the owner draw its image towards them, in the owner's radii.

    Each has a potential: ½ A (1.2 − d²) b² inside its rim, that joins to one of (1.6 − d²)³ there and ends at
    √1.6 of its radius. The sixth powers of several add up. The step is turned with the normal at q to that
    at p, around the axis perpendicular to both.
    """
    centres, radii = decals.positions.astype(np.float64), decals.radii.astype(np.float64)
    together = (decals.interactions == 1) & (decals.interactions[owner] == 1)[:, None]
    together &= decals.layers == decals.layers[owner][:, None]
    upper = together & (radii < radii[owner][:, None])
    upper &= _stacked(centres[owner][:, None], centres[None], radii[owner], radii)
    upper &= decals.spill | (normals @ decals.normals.astype(np.float64).T > ON_TOP)
    size = radii / radii[owner][:, None]
    away = (points[:, None] - centres) / radii[owner][:, None, None]
    squared = (away**2).sum(axis=2) / size**2
    strength = 0.35 * (1 - size**2) * upper
    rest = np.clip((1.6 - squared) / 0.6, 0, None)
    height = size**2 * strength * np.where(squared < 1, 0.6 - squared / 2, rest**3 / 10)
    slope = strength * np.where(squared < 1, 1, rest**2)
    most = np.maximum(height.max(axis=1, initial=0), 1e-300)[:, None]
    total = ((height / most) ** 6).sum(axis=1)[:, None]
    weight = (height / most) ** 5 / np.maximum(total, 1e-300) ** (5 / 6)
    step = -((weight * slope)[..., None] * away).sum(axis=1)
    n_p = decals.normals[owner].astype(np.float64)
    axis, cosine = np.cross(normals, n_p), (normals * n_p).sum(axis=1)[:, None]
    step -= (step * normals).sum(axis=1)[:, None] * normals
    turned = cosine * step + np.cross(axis, step)
    return turned + axis * (axis * step).sum(axis=1)[:, None] / np.maximum(1 + cosine, 1e-8)


def _unrolled(w: NDArray[Any], n_p: NDArray[Any], n_q: NDArray[Any]) -> Any:
    """Offset and length of the arc that starts along a surface at n_p, and ends at n_q.

    Of an arc of radius R and angle ψ both ends lie R (1 − cos ψ) from the tangent plane at the other. Where
    heights differ, R is that of their harmonic mean (direction), or of their geometric one (length).
    """
    fall, rise = -(w * n_p).sum(axis=1), (w * n_q).sum(axis=1)
    angle = 2 * np.arctan2(np.linalg.norm(n_q - n_p, axis=1), np.linalg.norm(n_q + n_p, axis=1))
    bends = (fall * rise > 0) & (angle > 0)
    fall, rise, angle = (np.where(bends, a, 1.0) for a in (fall, rise, angle))
    versine = 2 * np.sin(angle / 2) ** 2
    radius = 2 * fall * rise / (fall + rise) / versine
    toward = (n_q - np.cos(angle)[:, None] * n_p) / np.maximum(np.sin(angle), 1e-300)[:, None]
    skew = (rise - fall) / (rise + fall)
    squared = fall * rise / versine**2 * (1 + 2 * skew**2) * (angle**2 - 2 * versine)
    longer = np.sqrt((w * w).sum(axis=1) + np.where(bends, squared, 0))
    return w + np.where(bends, radius * (angle - np.sin(angle)), 0)[:, None] * toward, longer
