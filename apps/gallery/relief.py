"""Relief
======

Scales, thorns and pebbles: heights of decals move the surface, and follow contact as the images do. After the
pictures of cellular textures by Fleischer et al. (1995).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import Point, Segment
from decals import DecalMaterial, Scene, cover, displace
from decals.apps.gallery.helpers import Panel, camera_at, disc, main

EDGE = 96
"""Pixels along each side of the maps."""

Heights = NDArray[np.float64]


def panels() -> Sequence[Panel]:
    """Move the surfaces of three covered bodies."""
    return tuple(Panel(displace(scene, edge_length=0.025, resolution=32)) for scene in scenes())


def scenes() -> Sequence[Scene]:
    """Cover three bodies, each with one kind of relief, and step back to see all of it."""
    body = Segment((-0.45, -0.2, 0), (0.45, 0.25, 0), radius=0.5)
    ball = Point((0, 0, 0), radius=0.75)
    pair = Point((-0.3, -0.25, 0), radius=0.6) + Point((0.4, 0.35, 0.1), radius=0.45)
    covered = (
        cover(body, count=110, images=scales(), direction=(1.0, 0.5, 0.0)),
        cover(ball, count=60, images=thorns()),
        cover(pair, count=60, images=pebbles()),
    )
    camera = camera_at((1.9, 2.6, 3.6), fov=26.0, up=(0.0, 1.0, 0.0))
    return tuple(scene.replace(camera=camera) for scene in covered)


def scales() -> DecalMaterial:
    """Return a keeled scale whose tip stands up."""
    x, y, r = disc(EDGE)
    slope = np.clip(0.5 + 0.6 * x, 0, 1) * np.clip((1 - r) / 0.25, 0, 1) ** 0.5
    heights = slope + 0.25 * np.exp(-((y / 0.15) ** 2)) * np.clip(1 - r, 0, 1)
    shade = (0.4 + 0.6 * np.clip(heights, 0, 1))[..., None]
    return _material("scales", shade * (0.30, 0.55, 0.20), heights, relief=0.35, roughness=0.35)


def thorns() -> DecalMaterial:
    """Return a thorn in a ring of skin."""
    _, _, r = disc(EDGE)
    thorn = np.clip(1 - r / 0.55, 0, 1) ** 1.6
    ring = 0.08 * np.exp(-(((r - 0.68) / 0.12) ** 2))
    color = np.where((r < 0.55)[..., None], (0.86, 0.80, 0.66), (0.42, 0.24, 0.18))
    return _material("thorns", color, thorn + ring, relief=0.95, roughness=0.5)


def pebbles() -> DecalMaterial:
    """Return a round stone in mortar."""
    x, y, r = disc(EDGE)
    grain = np.sin(9 * x + 3 * np.sin(7 * y)) * np.sin(8 * y + 2 * np.sin(11 * x))
    heights = np.sqrt(np.clip(1 - (r / 0.9) ** 2, 0, 1)) * (1 + 0.04 * grain)
    stone = (0.55 + 0.05 * grain + 0.12 * x)[..., None] * (1.0, 0.96, 0.9)
    color = np.where((r < 0.9)[..., None], stone, (0.24, 0.21, 0.19))
    return _material("pebbles", color, heights, relief=0.5, roughness=0.8)


def _material(
    name: str, color: Heights, heights: Heights, *, relief: float, roughness: float
) -> DecalMaterial:
    """Return a material of a colour, heights from 0 to about 1, and how far they stand out."""
    pixels = np.clip(color, 0, 1) * np.ones((EDGE, EDGE, 3))
    return DecalMaterial(
        name, pixels, height=heights / heights.max(), relief=relief * heights.max(), roughness=roughness
    )


if __name__ == "__main__":
    main(panels)
