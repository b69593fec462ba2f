"""The rule of covering radii: decals without gaps, some of them moved and turned."""

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.scattering.covering import covering_radii
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.gap_filling import EVEN, center_outsized
from decals.scattering.neighbors import NearestFacing
from decals.scattering.sizing import EXPECTED_RADIUS, WithNormals
from decals.scattering.turned_normals import turned_normals

LARGEST_ON_THIN_PARTS = 6.0
"""Largest covering radius over the expected one where parts may be thinner than decals lie apart.

On a hair, a decal has its area in a piece that is far longer than its radius.
"""


def covering_decals(
    domain: Domain,
    centers: OrientedPoints,
    spacings: Float32Array,
    movable: BoolArray,
    samples: OrientedPoints,
    with_normals: WithNormals,
    seed: int,
) -> tuple[OrientedPoints, Float64Array]:
    """Return decals at centres, with their own normals, and the least radii without gaps; see `Rule`.

    At even density, some are moved by `center_outsized` and turned by `turned_normals`.
    """

    def project(trials: OrientedPoints) -> tuple[OrientedPoints, Int64Array]:
        projected, allowed = domain.project(trials)
        rows = np.flatnonzero(allowed)
        return projected[rows], rows

    expected = EXPECTED_RADIUS * spacings.astype(np.float64)
    bent = with_normals(centers, spacings)
    bent_at = centers.positions
    nearest = NearestFacing(samples.positions, samples.normals)

    def aim(centers: OrientedPoints) -> OrientedPoints:
        nonlocal bent, bent_at
        moved = np.flatnonzero((centers.positions != bent_at).any(axis=1))
        normals = bent.normals.copy()
        normals[moved] = with_normals(centers[moved], spacings[moved]).normals
        bent = OrientedPoints(centers.positions, normals, centers.surface_ids)
        bent_at = centers.positions
        normals = turned_normals(bent, centers.normals, samples, nearest, expected)
        return OrientedPoints(centers.positions, normals, centers.surface_ids)

    even = bool(spacings.max() <= EVEN * spacings.min())
    decals = center_outsized(domain, centers, movable, spacings, samples, aim) if even else aim(centers)
    radii = covering_radii(
        decals,
        samples,
        project,
        seed,
        shade=domain.shaded,
        even=even,
        nearest=nearest,
        bounds=LARGEST_ON_THIN_PARTS * expected if domain.has_thin_parts else None,
    )
    return decals, radii
