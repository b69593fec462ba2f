"""The field of a decal
====================

Figures 1 and 2 of the paper: a decal with its tangents u and v, and the field function g. Points are orange
where g ≥ ½, which is the image of the decal, and blue where 0 < g < ½.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from blobtree import RIM, Node, Point, Polyline, Union
from decals import NO_IMAGE, DecalImage, Decals, MeshObject, Scene, TreeObject
from decals.apps.gallery.helpers import CLAY, Panel, bumps, camera_above, camera_at, main

ORANGE, BLUE, INK = (0.92, 0.55, 0.16), (0.36, 0.58, 0.78), (0.13, 0.14, 0.17)
INFLUENCE = 1.0
"""Radius of the ball in which the field is not zero."""

_THIN = 0.012


def panels() -> Sequence[Panel]:
    """Draw a decal on a wavy surface, and the graph of g."""
    return Panel(_decal()), Panel(_graph())


def line(
    points: Sequence[ArrayLike], color: tuple[float, float, float] = INK, *, radius: float = _THIN
) -> Node:
    """Return a line through points."""
    rows = np.asarray(points, np.float64).tolist()
    return Polyline(tuple((x, y, z) for x, y, z in rows), radius=radius, color=color)


def _decal() -> Scene:
    """Return a surface with the points in the ball of a decal, and those of its image."""
    vertices, faces = bumps()
    center, up = np.array([0.0, 0.0, float(vertices[:, 2].max())]), np.array([0.0, 0.0, 1.0])
    rings = Decals(
        positions=[center] * 2,
        normals=[up] * 2,
        tangents=[[1, 0, 0]] * 2,
        radii=[INFLUENCE, RIM * INFLUENCE],
        images=[NO_IMAGE, 0],
        tints=[BLUE, (1, 1, 1)],
        layers=[0, 1],
    )
    return Scene(
        objects=(MeshObject("surface", 1.3 * vertices, faces, color=CLAY),),
        camera=camera_at((1.2, -2.9, 4.6), fov=30.0),
        images=(_tangents(),),
        decals=rings,
    )


def _tangents(*, edge: int = 256) -> DecalImage:
    """Draw an orange image with its axes u and v as lines from the centre."""
    i, j = np.indices((edge, edge))
    x, y = 2 * (j + 0.5) / edge - 1, 1 - 2 * (i + 0.5) / edge
    pixels = np.full((edge, edge, 4), 255, np.uint8)
    pixels[..., :3] = np.round(255 * np.array(ORANGE))
    for along, across in ((x, y), (y, x)):
        pixels[(np.abs(across) < 0.04) & (along > -0.04) & (along < 0.8), :3] = np.round(255 * np.array(INK))
    return DecalImage("u and v", pixels)


def _graph() -> Scene:
    """Return the graph of g over the distance, as a fraction of the radius of influence."""
    distance = np.linspace(0.0, 1.2, 97)
    g = Point((0, 0, 0), radius=RIM)(np.outer(distance, [1.0, 0.0, 0.0]))
    curve = np.column_stack([distance, g, np.zeros(len(g))])
    curve[:, :2] = 1.4 * curve[:, :2] - [0.8, 0.65]
    image, half = distance < RIM, np.array([1.4 * RIM - 0.8, 0.05, 0.0])
    parts = [
        line([*curve[image], half], ORANGE, radius=2 * _THIN),
        line([half, *curve[~image]], BLUE, radius=2 * _THIN),
        line([(-0.8, 0.85, 0), (-0.8, -0.65, 0), (0.95, -0.65, 0)]),
        line([(-0.8, 0.05, 0), half, half * [1, 0, 1] - [0, 0.65, 0]], radius=0.5 * _THIN),
    ]
    return Scene(objects=(TreeObject("graph", Union(parts)),), camera=camera_above())


if __name__ == "__main__":
    main(panels)
