"""How much volume two balls keep that are pressed into each other, and how large their contact is.

Two balls of radius 1 are pressed into each other; see `blobtree.SolidContact`. The contact area of two rigid
balls, whose overlap is cut by a plane, is known: it is that of the circle in which they meet.
"""

import numpy as np

from blobtree import ISO, Point, SolidContact
from decals.experiments import Grid

POINTS = 200_000
"""Random points that measure the overlap."""


def pressed_solids(
    depth: float, stiffness: float, height: float = 0.08, compensated: bool = False, resolution: int = 64
) -> dict[str, float]:
    """Press a soft ball and a stiffer one into each other.

    Parameters
    ----------
    depth
        Depth by which the balls enter each other, in radii.
    stiffness
        Stiffness of the second ball over that of the first.
    height
        Height of the bulge, a value of the field.
    compensated
        True if the solids grow until they keep their volumes.
    resolution
        Cells along the longest side of a mesh.

    Returns
    -------
    dict
        ``kept_soft`` and ``kept_stiff``, volumes over those of the free balls; ``contact_area`` over that of
        the circle in which two rigid balls meet; ``overlap`` of both solids over the overlap of the rigid
        balls; ``reach``, the largest distance of the soft solid from the centre of its ball, in radii.
    """
    centers = [(0.0, 0.0, 0.0), (2.0 - depth, 0.0, 0.0)]
    balls = [Point(center, radius=1.0) for center in centers]
    free = [ball.to_pyvista(resolution=resolution).volume for ball in balls]
    model = SolidContact(balls, stiffness=(1.0, stiffness), width=0.4, height=height)
    if compensated:
        model = model.compensated()
    solids = model.solids()
    meshes = [solid.to_pyvista(resolution=resolution) for solid in solids]
    circle = np.pi * (1.0 - (1.0 - 0.5 * depth) ** 2)
    lens = np.pi * depth**2 * (3.0 - 0.5 * depth) / 6.0
    box = np.array([depth, 2.0, 2.0])
    points = np.array([1.0 - depth, -1.0, -1.0]) + box * np.random.default_rng(0).random((POINTS, 3))
    inside = np.logical_and(*(np.asarray(solid(points)) > ISO for solid in solids))
    return {
        "kept_soft": float(meshes[0].volume / free[0]),
        "kept_stiff": float(meshes[1].volume / free[1]),
        "contact_area": float(sum(surface.area for surface in model.contacts()) / circle),
        "overlap": float(inside.mean() * box.prod() / lens),
        "reach": float(np.linalg.norm(meshes[0].points, axis=1).max()),
    }


experiment = pressed_solids
design = Grid(depth=[0.1, 0.2, 0.4, 0.6], stiffness=[1, 8], compensated=[False, True])
full = Grid(
    depth=[0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8],
    stiffness=[1, 2, 4, 8, 32],
    height=[0.0, 0.04, 0.08, 0.1],
    compensated=[False, True],
    resolution=[128],
)
