"""Decals that keep to their sheet: those that would reach through to a parallel or crossing one."""

from dataclasses import replace

import numpy as np

from blobtree._typing import Float64Array
from decals.model import SHEET_HEIGHT
from decals.scattering.domain import LEAST_SHEET, Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree, sheet_products
from decals.scattering.sizing import EXPECTED_RADIUS

CANDIDATES = 12
"""Nearest decals of a point that may reach it."""

REACH = 1.5
"""Largest radius of a decal, in expected ones."""

OTHER_SHEET = 0.3
"""Height, as `SHEET_HEIGHT`, from which a point surely lies on another sheet and on no bump of the same."""

COVERED = 1.5
"""Distance from a decal of its own sheet, in expected radii, up to which a point needs no other decal."""


def on_single_sheets(
    domain: Domain, decals: OrientedPoints, samples: OrientedPoints, radii: Float64Array
) -> OrientedPoints:
    """Return decals of which some keep to their sheets: `Decals.single_sheets`.

    They reach points of other sheets, and all these points have decals of their own sheet.

    Parameters
    ----------
    domain
        The surfaces.
    decals
        Centres and normals of the decals.
    samples
        Points spread evenly over the surfaces.
    radii
        Expected radius of each decal, ``float64[n]``.
    """
    least_area = LEAST_SHEET * float(np.median(radii) / EXPECTED_RADIUS) ** 2
    sheets, of_decals = (domain.sheets(points, least_area) for points in (samples, decals))
    if sheets is None or of_decals is None:
        return decals
    tree = FacingTree(decals.positions, decals.normals)
    reach = max(REACH, COVERED) * float(radii.max())
    distances, rows = tree.nearest(samples.positions, samples.normals, count=CANDIDATES, reach=reach)
    offsets = samples.positions[:, None].astype(np.float64) - decals.positions[rows]
    heights = sheet_products(offsets, decals.normals[rows], samples.normals) / radii[rows] ** 2
    reached = distances <= REACH * radii[rows]
    beyond = reached & (heights > SHEET_HEIGHT**2)
    covered = (~beyond & (distances <= COVERED * radii[rows])).any(axis=1)
    keeps = np.zeros(len(decals), np.bool_)
    other = (of_decals[rows] != sheets[:, None]) & (of_decals[rows] >= 0) & (sheets[:, None] >= 0)
    keeps[rows[reached & other & (heights > OTHER_SHEET**2)]] = True
    bare = np.flatnonzero(beyond.any(axis=1) & ~covered)
    keeps[rows[bare, beyond[bare].argmax(axis=1)]] = False  # the nearest that reaches a point covers it
    if not keeps.any():
        return decals
    return replace(decals, heights=np.where(keeps, SHEET_HEIGHT * radii, np.inf))
