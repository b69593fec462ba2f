"""One move of particles on their surfaces."""

import numpy as np

from decals.model import FACING_LIMIT
from decals.population import Sites, World
from decals.surface import Floats


def moved(world: World, sites: Sites, moves: Floats, sizes: Floats) -> Sites:
    """Sites after the moves, put back onto their surfaces; who would turn away or be barred stays."""
    lengths = np.sqrt(np.einsum("ni,ni->n", moves, moves))
    wished = Sites(sites.positions + moves, sites.normals, sites.surface_ids)
    # a particle on its surface that moves by some length is no farther than that from the surface
    found, allowed = world.settle(wished, within=np.float32(1.01) * lengths + np.float32(1e-4) * sizes)
    allowed &= np.einsum("ni,ni->n", found.normals, sites.normals) > FACING_LIMIT
    allowed &= lengths > 0.0
    return Sites(
        np.where(allowed[:, None], found.positions, sites.positions),
        np.where(allowed[:, None], found.normals, sites.normals),
        sites.surface_ids,
    )
