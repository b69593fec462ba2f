"""Benchmark of the paper's octree beside the decal index: ``python -m tests.bench.decals --only octree``.

Section 3.4 of the paper keeps the decals in an octree. A voxel with more than eight decals is divided; a leaf
holds at most eight. Voxels are divided at most ten times, as often as the paper's shader descends, and not
beyond `MAX_VOXELS`: a region in which more than eight decals meet is divided without an end. Leaves with more
decals keep those nearest to the voxel's centre. The paper does not say which ones it keeps.

Both structures hold the decals whose ball of the same reach touches a cell, and both are read at the same
points. A point is wrong if its owner, or its field by more than `FIELD_ERROR`, differs from that of all
decals. The octree is built in NumPy, level by level, so its time to build is no measure of the paper's.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals import Decals
from decals.apps.models.figure_14 import even_decals
from decals.apps.models.samples import sample
from decals.errors import InvalidInput
from decals.index import DecalIndex
from decals.record import NEIGHBOR_REACH
from decals.scattering.orientation import tangents
from tests.oracles.contact import RIM, complements, contact_complement
from tests.oracles.decals import FACING_LIMIT

LEAF_DECALS = 8
MAX_DEPTH = 10
MAX_VOXELS = 1_000_000
POINTS = 100_000
FIELD_ERROR = 1e-3
CROWD = 6.0
"""Sum of the areas of the crowded decals, over the area of the surface."""

CHUNK = 20_000
Figures = dict[str, float]
Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.int64]
Touches = Callable[[IndexArray, Float64Array, float], NDArray[np.bool_]]
"""Test of bodies int64[n] against voxels with lowest corners float64[n, 3] and a side."""


@dataclass(frozen=True)
class Octree:
    """The paper's octree (section 3.4) over a cube.

    Attributes
    ----------
    low : float64[3]
        Lowest corner of the cube.
    size : float
        Side of the cube.
    children : int64[v]
        Number of the first of the eight children of each voxel; −1 for a leaf.
    decals : int64[v, 8]
        Decals of each leaf; −1 where it has fewer.
    dropped : int
        Decals left out of leaves, summed over all leaves.
    depth : int
        Divisions from the cube to the smallest voxel.
    """

    low: Float64Array
    size: float
    children: IndexArray
    decals: IndexArray
    dropped: int
    depth: int

    @classmethod
    def build(
        cls,
        centres: Float64Array,
        reach: Float64Array,
        *,
        depth: int = MAX_DEPTH,
        touches: Touches | None = None,
        last: bool = False,
    ) -> "Octree":
        """Divide the bounding cube of balls, until each leaf touches at most eight of them.

        `touches` tests bodies inside the balls, in place of the balls.
        With `last`, full leaves keep their last bodies, not the nearest ones.
        """
        low = (centres - reach[:, None]).min(axis=0)
        size = float(((centres + reach[:, None]).max(axis=0) - low).max())
        corners, level = np.zeros((1, 3), np.int64), 0
        voxel, decal = np.zeros(len(reach), np.int64), np.arange(len(reach), dtype=np.int64)
        children, kept, dropped = [], [], 0
        total = 1
        while True:
            width = size / 2**level
            counts = np.bincount(voxel, minlength=len(corners))
            divided = (counts > LEAF_DECALS) & (level < depth)
            divided &= total + 8 * divided.sum() <= MAX_VOXELS
            rank = np.cumsum(divided) - 1
            children.append(np.where(divided, total + 8 * rank, -1))
            in_leaf = ~divided[voxel]
            leaf, leaf_decal = voxel[in_leaf], decal[in_leaf]
            middle = low + (corners[leaf] + 0.5) * width
            distance = np.linalg.norm(centres[leaf_decal] - middle, axis=1) / reach[leaf_decal]
            order = np.lexsort([-leaf_decal if last else distance, leaf])
            leaf, leaf_decal = leaf[order], leaf_decal[order]
            place = np.arange(len(leaf)) - np.searchsorted(leaf, leaf)
            fits = place < LEAF_DECALS
            slots = np.full((len(corners), LEAF_DECALS), -1, np.int64)
            slots[leaf[fits], place[fits]] = leaf_decal[fits]
            kept.append(slots)
            dropped += int((~fits).sum())
            if not divided.any():
                return cls(low, size, np.concatenate(children), np.concatenate(kept), dropped, level)
            octants = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1).reshape(8, 3)
            corners = (2 * corners[divided, None] + octants).reshape(-1, 3)
            total += len(corners)
            level += 1
            voxel = (8 * rank[voxel[~in_leaf], None] + np.arange(8)).reshape(-1)
            decal = np.repeat(decal[~in_leaf], 8)
            width = size / 2**level
            corner = low + corners[voxel] * width
            if touches is not None:
                touched = touches(decal, corner, width)
            else:
                nearest = np.clip(centres[decal], corner, corner + width)
                touched = np.linalg.norm(nearest - centres[decal], axis=1) < reach[decal]
            voxel, decal = voxel[touched], decal[touched]

    def find(self, points: Float64Array) -> tuple[IndexArray, IndexArray]:
        """Return the decals int64[m, 8] of the leaves of points, and the voxels read for each, int64[m]."""
        relative = np.clip((points - self.low) / self.size, 0.0, 1.0 - 1e-12)
        voxel, steps = np.zeros(len(points), np.int64), np.ones(len(points), np.int64)
        while (inner := self.children[voxel] >= 0).any():
            relative = relative * 2.0
            octant = relative.astype(np.int64) @ np.array([4, 2, 1])
            relative -= np.floor(relative)
            voxel = np.where(inner, self.children[voxel] + octant, voxel)
            steps += inner
        return self.decals[voxel], steps

    @property
    def bytes(self) -> int:
        """Memory of the voxels: eight references of four bytes each, to children or decals."""
        return len(self.children) * LEAF_DECALS * 4


def shown(
    decals: Decals, listed: IndexArray, points: Float64Array, normals: Float64Array
) -> tuple[IndexArray, Float64Array]:
    """Return owner (−1: none) and complement 1 − F of points, from decals int64[m, k], −1 where empty."""
    w = points[:, None] - decals.positions.astype(np.float64)[listed]
    s = decals.radii.astype(np.float64)[listed] / RIM
    faces = (decals.normals.astype(np.float64)[listed] * normals[:, None]).sum(axis=2) > FACING_LIMIT
    e = np.where((listed >= 0) & faces, complements((w**2).sum(axis=2) / s**2), 2.0)
    place, complement = contact_complement(np.column_stack([e, np.full(len(e), 2.0)]))
    owner = np.where(place < 0, -1, np.take_along_axis(listed, np.clip(place, 0, None)[:, None], 1)[:, 0])
    return owner, complement


def padded(offsets: IndexArray, numbers: IndexArray) -> IndexArray:
    """Return lists of unlike lengths as rows int64[m, k], filled up with −1."""
    counts = np.diff(offsets)
    rows = np.full((len(counts), max(1, int(counts.max(initial=0)))), -1, np.int64)
    row = np.repeat(np.arange(len(counts)), counts)
    rows[row, np.arange(len(numbers)) - offsets[row]] = numbers
    return rows


def compare(decals: Decals, points: Float64Array, normals: Float64Array) -> Figures:
    """Measure both structures of some decals at points with unit normals."""
    centres = decals.positions.astype(np.float64)
    reach = NEIGHBOR_REACH * decals.radii.astype(np.float64) / RIM
    begin = time.perf_counter()
    octree = Octree.build(centres, reach)
    octree_s = time.perf_counter() - begin
    DecalIndex.of(decals)
    begin = time.perf_counter()
    index = DecalIndex.of(decals)
    index_s = time.perf_counter() - begin
    listed, steps = octree.find(points)
    offsets, numbers = index.candidates(points)
    wrong_owner = wrong_field = 0
    for first in range(0, len(points), CHUNK):
        rows = slice(first, first + CHUNK)
        some = offsets[first : first + len(points[rows]) + 1]
        exact = padded(some - some[0], numbers[some[0] : some[-1]].astype(np.int64))
        owner, complement = shown(decals, exact, points[rows], normals[rows])
        other, drawn = shown(decals, listed[rows], points[rows], normals[rows])
        wrong_owner += int((owner != other).sum())
        off = (owner == other) & (owner >= 0) & (np.abs(drawn - complement) > FIELD_ERROR)
        wrong_field += int(off.sum())
    return {
        "voxels": len(octree.children),
        "octree_build_s": octree_s,
        "octree_bytes": octree.bytes,
        "octree_reads": float(steps.mean()),
        "octree_candidates": float((listed >= 0).sum(axis=1).mean()),
        "octree_depth": octree.depth,
        "octree_dropped": octree.dropped,
        "octree_wrong_owner": wrong_owner / len(points),
        "octree_wrong_field": wrong_field / len(points),
        "cells": int((index.table[:, 0] >= 0).sum()),
        "index_build_s": index_s,
        "index_bytes": index.levels.nbytes + index.table.nbytes + index.ids.nbytes,
        "index_reads": float(len(index.levels)),
        "index_candidates": len(numbers) / len(points),
    }


def crowded_decals(surface: Any, count: int, rng: np.random.Generator) -> Decals:
    """Return decals with random places and sizes, whose areas add up to `CROWD` times the surface."""
    spread = np.exp(rng.normal(0.0, 0.5, count))
    radii = spread * np.sqrt(CROWD * surface.area / (np.pi * (spread**2).sum()))
    places, facings = surface.sample(count, 1)
    return Decals(
        positions=places,
        normals=facings,
        tangents=tangents(places, facings, None, 0),
        radii=radii.astype(np.float32),
    )


def measure(*, quick: bool) -> Figures:
    """Compare both structures on the dragon, or a knot, with even and with crowded decals."""
    try:
        surface = sample("dragon").surface
    except InvalidInput:
        surface = sample("knot").surface
    rng = np.random.default_rng(0)
    points, normals = (
        array.astype(np.float64) for array in surface.sample(POINTS // (10 if quick else 1), 0)
    )
    figures: Figures = {}
    for count in (100, 1_000) if quick else (100, 1_000, 10_000):
        even = even_decals(surface, count=count)
        crowded = crowded_decals(surface, count, rng)
        for name, decals in (("even", even), ("crowded", crowded)):
            for key, value in compare(decals, points, normals).items():
                figures[f"{name}_{count}_{key}"] = value
    return figures
