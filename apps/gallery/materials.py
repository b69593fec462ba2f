"""Materials
=========

Decals with maps of their surface: gold rivets in grooved steel, lacquered scales, and lamps that glow in
stone. The maps are computed from heights.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import Point, Segment
from decals import DecalMaterial, cover
from decals.apps.gallery.helpers import Panel, disc, main

EDGE = 192
"""Pixels along each side of the maps."""

Heights = NDArray[np.float64]


def panels() -> Sequence[Panel]:
    """Cover three bodies, each with one material."""
    ball = Point((0, 0, 0), radius=1.0)
    bone = Segment((-0.4, -0.2, 0), (0.4, 0.25, 0), radius=0.6)
    pair = Point((-0.35, -0.3, 0), radius=0.8) + Point((0.5, 0.45, 0.1), radius=0.6)
    return (
        Panel(cover(ball, count=70, images=rivets())),
        Panel(cover(bone, count=90, images=lacquer(), direction=(1, 0.5, 0))),
        Panel(cover(pair, count=60, images=lamps())),
    )


def rivets() -> DecalMaterial:
    """Return a domed rivet of gold in steel with fine grooves."""
    _, _, r = disc(EDGE)
    head = r < 0.55
    heights = np.where(head, 0.8 * np.sqrt(np.maximum(0.36 - r**2, 0)), 0.012 * np.cos(40 * r))
    color = np.where(head[..., None], (0.92, 0.72, 0.35), (0.56, 0.58, 0.62))
    return _material("rivets", color, heights, roughness=np.where(head, 0.22, 0.4), metallic=1.0)


def lacquer() -> DecalMaterial:
    """Return a scale with a ridge, red and smooth."""
    x, y, r = disc(EDGE)
    heights = 0.5 * np.sqrt(np.maximum(1.05 - r**2, 0)) + 0.12 * np.exp(-((y / 0.12) ** 2)) * (1 - x)
    shade = (0.55 + 0.45 * np.clip(1 - r, 0, 1))[..., None]
    return _material("lacquer", shade * (0.75, 0.10, 0.08), heights, roughness=0.18, metallic=0.0)


def lamps() -> DecalMaterial:
    """Return rough stone around a lamp that glows."""
    x, y, r = disc(EDGE)
    lamp = r < 0.28
    grain = 0.015 * np.sin(31 * x + 7 * np.sin(19 * y)) * np.sin(27 * y + 5 * np.sin(23 * x))
    heights = np.where(lamp, 0.2, grain + 0.25 * np.exp(-(((r - 0.45) / 0.12) ** 2)))
    color = np.where(lamp[..., None], (0.2, 0.15, 0.1), np.clip(0.45 + 9 * grain, 0, 1)[..., None])
    glow = np.where(lamp[..., None], np.array([1.0, 0.62, 0.2]) * np.clip(1.2 - 2 * r, 0, 1)[..., None], 0.0)
    return _material("lamps", color, heights, roughness=np.where(lamp, 0.3, 0.9), metallic=0.0, emission=glow)


def _material(name: str, color: Heights, heights: Heights, **maps: Any) -> DecalMaterial:
    """Return a material with the normals of its heights, which are in radii."""
    down, right = np.gradient(heights, 2 / EDGE)
    normals = np.stack([-right, down, np.ones_like(heights)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    pixels = np.clip(color, 0, 1) * np.ones((EDGE, EDGE, 3))
    encoded = np.clip(np.rint(127 * normals + 128), 0, 255).astype(np.uint8)
    return DecalMaterial(name, pixels, encoded, height=heights.astype(np.float32), **maps)


if __name__ == "__main__":
    main(panels)
