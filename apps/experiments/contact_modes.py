"""How contact modes fold, stretch and cover images, against overlap and size ratio.

A decal of radius 1 in a plane, and smaller ones around it. Random points are measured by `decals.measure`.
"""

from typing import Any

import numpy as np

from decals import Contact, Decals, MeshObject, Scene, measure, render
from decals.apps.gallery.helpers import camera_above, checker_image
from decals.experiments import Grid, Seeds

SAMPLES = 40_000
"""Points of the plane that are measured."""

NEIGHBORS = 5


def contact_modes(
    contact: str, overlap: float, ratio: float, seed: int = 0, picture: bool = False
) -> dict[str, Any]:
    """Press smaller decals into one of radius 1.

    Parameters
    ----------
    contact
        Contact mode.
    overlap
        Depth of the smaller decals in the large one, over their diameter: 0 touches, 1 lies inside.
    ratio
        Radius of the large decal over that of the others.
    seed
        Seed of their directions.
    picture
        True if the decals are drawn too.

    Returns
    -------
    dict
        ``folded``, the share of the shown area that is mirrored; ``stretch``, which 95 % of it stay
        below; ``kept_large`` and ``kept_small``, the shares of the images that contact keeps.
    """
    rng = np.random.default_rng(seed)
    angles = 2.0 * np.pi * (np.arange(NEIGHBORS) + 0.4 * rng.random(NEIGHBORS)) / NEIGHBORS
    radius = 1.0 / ratio
    distance = 1.0 + radius - 2.0 * radius * overlap
    around = distance * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    count = NEIGHBORS + 1
    decals = Decals(
        positions=np.concatenate([np.zeros((1, 3)), around]).astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (count, 1)),
        tangents=np.tile(np.array([1, 0, 0], np.float32), (count, 1)),
        radii=np.array([1.0] + NEIGHBORS * [radius], np.float32),
    )
    half = 1.0 + max(0.0, distance + radius - 1.0)
    corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    plane = MeshObject("plane", corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    scene = Scene(objects=(plane,), camera=camera_above(6.0), images=(checker_image(6),), decals=decals)
    found = measure(scene, contact=contact, samples=SAMPLES)
    kept = found.decals.kept
    drawn = {"picture": render(scene, size=(240, 240), samples=2, contact=contact)} if picture else {}
    return {
        "folded": found.folded,
        "stretch": found.stretch_p95,
        "kept_large": float(kept[0]),
        "kept_small": float(kept[1:].mean()),
        **drawn,
    }


MODES = [mode.name.lower() for mode in Contact]

experiment = contact_modes
design = Grid(contact=MODES, overlap=[0.25, 0.5, 0.75, 0.9], ratio=[1, 2, 4]) * Seeds(2)
full = Grid(
    contact=MODES, overlap=np.linspace(0.05, 0.95, 19).round(2), ratio=[1, 1.5, 2, 3, 5, 8, 12, 20]
) * Seeds(30) + Grid(contact=MODES, overlap=[0.25, 0.5, 0.9], ratio=[1, 2, 4], seed=[0], picture=[True])
