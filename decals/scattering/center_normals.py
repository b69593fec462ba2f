"""Normals of surfaces at the centres of decals, and the neighbours that these make.

Decals at edges have mean normals, and decals at lips and behind thin walls are turned. Two decals are
neighbours if the *surfaces* at their centres face the same way. By their own normals, decals on two sides of
a thin plate would be neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals.model import FACING_LIMIT, SHEET_HEIGHT, Decals
from decals.scattering.neighbors import FacingTree, sheet_products
from decals.surfaces.surface import Surface, tangent_axes

NEARNESS = 1e-3
"""Distance from a centre within which an edge counts as its place, in spacings."""

ROUNDING = 1e-6
"""The same at least, as a share of the largest coordinate."""

PROBES = 8
"""Points around a centre from which the faces beside an edge are looked for."""

EXAMINED = 3
"""Ratio of the neighbours that the search examines to those that it returns."""


@dataclass(frozen=True)
class Centers:
    """Centres of decals with the unit normals of their surfaces, ``float32[n, 3]`` each.

    A centre on an edge lies on several faces. `normals` are those nearest to the decals' own. `beside` are,
    of the faces that these and the decal face, those that differ most; elsewhere the same. `heights` are
    those at which the decals end on other sheets, infinity for those that do not, ``float64[n]``.
    """

    positions: Float32Array
    normals: Float32Array
    beside: Float32Array
    heights: Float64Array

    @staticmethod
    def of(decals: Decals, surfaces: Sequence[Surface], spacing: float) -> "Centers":
        """Return the centres of decals with the normals of the surface nearest to each.

        A surface that turns its back to a decal is seen from its other side, and its normal is reversed.

        Parameters
        ----------
        decals
            n decals.
        surfaces
            The surfaces that they lie on.
        spacing
            Distance of neighbours, in model units.
        """
        positions, own = decals.positions, decals.normals.astype(np.float64)
        heights = np.where(decals.single_sheets, SHEET_HEIGHT * decals.radii.astype(np.float64), np.inf)
        if not len(decals):
            return Centers(positions, decals.normals, decals.normals, heights)
        faces = _faces_at(
            decals, surfaces, max(NEARNESS * spacing, ROUNDING * float(np.abs(positions).max()))
        )
        cosines = np.einsum("kni,ni->kn", faces, own)
        normals = np.take_along_axis(faces, cosines.argmax(axis=0)[None, :, None], axis=0)[0]
        apart = np.einsum("kni,ni->kn", faces, normals)
        apart[(apart <= FACING_LIMIT) | (cosines <= 0.0)] = 1.0
        others = np.take_along_axis(faces, apart.argmin(axis=0)[None, :, None], axis=0)[0]
        beside = np.where(apart.min(axis=0)[:, None] < 1.0, others, normals)
        behind = (cosines.max(axis=0) < FACING_LIMIT)[:, None]
        normals, beside = (np.where(behind, -rows, rows) for rows in (normals, beside))
        return Centers(positions, normals, beside, heights)

    def rings(self, count: int = 6) -> tuple[Float64Array, Int64Array]:
        """Return distances and indices of the nearest neighbours of each centre, ``[n, count]`` each.

        Neighbours face each other with all normals that they have, and one that keeps to its sheet has its
        neighbours there. Rows fill up with infinity and -1.
        """
        tree = FacingTree(self.positions, self.normals, self.heights)
        distances, indices = tree.nearest(
            self.positions, self.normals, count=EXAMINED * count, skip_self=True
        )
        facing = indices >= 0
        for mine in (self.normals, self.beside):
            for theirs in (self.normals, self.beside):
                facing &= np.einsum("ni,nki->nk", mine, theirs[indices]) > FACING_LIMIT
        offsets = self.positions[indices].astype(np.float64) - self.positions[:, None]
        products = sheet_products(offsets, self.normals[indices], self.normals)
        facing &= products <= self.heights[:, None] ** 2
        order = np.argsort(~facing, axis=1, kind="stable")[:, :count]
        kept = np.take_along_axis(facing, order, axis=1)
        near, found = (np.take_along_axis(rows, order, axis=1) for rows in (distances, indices))
        return np.where(kept, near, np.inf), np.where(kept, found, -1)


def _faces_at(decals: Decals, surfaces: Sequence[Surface], step: float) -> Float32Array:
    """Return normals of the faces within a step of each centre, ``float32[k, n, 3]``, some several times."""
    positions = decals.positions
    feet = [surface.project(positions)[0] for surface in surfaces]
    distances = np.stack([np.linalg.norm(positions - places, axis=1) for places in feet])
    nearest = distances.argmin(axis=0)
    touched = distances <= distances.min(axis=0) + step
    first, second = tangent_axes(decals.normals.astype(np.float64))
    angles = 2.0 * np.pi * np.arange(PROBES) / PROBES
    ways = [0.0 * first, *(np.cos(angle) * first + np.sin(angle) * second for angle in angles)]
    faces = np.empty((len(surfaces), len(ways), len(decals), 3), np.float32)
    for number, (surface, places) in enumerate(zip(surfaces, feet, strict=True)):
        for row, way in enumerate(ways):
            near = touched[number]
            faces[number, row, near] = surface.project((places + step * way)[near])[1]
    own = faces[nearest, 0, np.arange(len(decals))]
    return np.where(touched[:, None, :, None], faces, own).reshape(-1, len(decals), 3)
