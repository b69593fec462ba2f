"""Environments
============

Bodies of metal, lacquer and plain clay in two environments: a low sun in a clear sky, from two sides, and
a dark room with windows. Both panoramas are computed.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import Point
from decals import Camera, Decals, Scene, TreeObject, cover
from decals.apps.gallery.helpers import Panel, main
from decals.apps.gallery.materials import lacquer, rivets
from decals.rendering import Environment

ROWS = 256
"""Rows of the panoramas."""

Light = NDArray[np.float64]


def panels() -> Sequence[Panel]:
    """Light the same scene in three ways."""
    scene = bodies()
    sky = Environment(evening(), rotation=-75.0, strength=1.3, visible=True)
    behind = Environment(sky.picture, rotation=60.0, strength=1.3, visible=True)
    return (
        Panel(scene, environment=sky),
        Panel(scene, environment=behind),
        Panel(scene, environment=Environment(room())),
    )


def bodies() -> Scene:
    """Cover two balls; a third one behind them has no decals."""
    balls = {
        "metal": Point((-0.95, 0, 0), radius=0.8),
        "red": Point((0.85, -0.1, 0.3), radius=0.7),
        "clay": Point((0.1, 0.95, -0.9), radius=0.6, color=(0.8, 0.78, 0.74)),
    }
    metal = cover(balls["metal"], count=40, images=rivets())
    red = cover(balls["red"], count=60, images=lacquer(), direction=(1, 0.5, 0))
    second = red.decals.replace(images=np.ones(len(red.decals), np.int32))
    return Scene(
        objects=tuple(TreeObject(name, tree) for name, tree in balls.items()),
        camera=Camera((0.3, 1.0, 6.9), target=(-0.05, 0.2, 0.0), fov=30.0),
        decals=Decals.concatenate([metal.decals, second]),
        images=(*metal.images, *red.images),
    )


def evening() -> Light:
    """Return a clear sky with a low sun over dark ground, in linear light."""
    direction = _directions()
    height = direction[..., 1:2]
    haze = np.exp(-6.0 * np.maximum(height, 0.0))
    air = (1.0 - haze) * (0.16, 0.30, 0.62) + haze * (0.95, 0.62, 0.42)
    ground = np.exp(5.0 * np.minimum(height, 0.0)) * (0.30, 0.24, 0.18) + (0.06, 0.05, 0.04)
    sun = np.array([0.0, 0.35, -1.0]) / np.hypot(0.35, 1.0)
    glow = np.exp(900.0 * (direction @ sun - 1.0))[..., None] * (900.0, 640.0, 380.0)
    return np.asarray(np.where(height > 0.0, air + glow, ground))


def room() -> Light:
    """Return a dark room with a row of bright windows, and a warm lamp above."""
    x, y, z = np.moveaxis(_directions(), -1, 0)
    turn = np.arctan2(x, -z) % (np.pi / 4)
    window = (np.abs(y - 0.25) < 0.22) & (turn > 0.12) & (turn < 0.66) & (x < 0.3)
    bars = (np.abs(turn - 0.39) < 0.02) | (np.abs(y - 0.25) < 0.012)
    light = np.where((window & ~bars)[..., None], (5.0, 5.6, 6.6), (0.10, 0.09, 0.085))
    return np.asarray(light + np.exp(60.0 * (y - 1.0))[..., None] * (7.0, 5.0, 3.0))


def _directions() -> Light:
    """Return the directions of the pixels of a panorama: right, up and toward the front."""
    down, turn = (
        (np.arange(ROWS)[:, None] + 0.5) * np.pi / ROWS,
        (np.arange(2 * ROWS) + 0.5) * np.pi / ROWS - np.pi,
    )
    across = np.sin(down)
    return np.stack([across * np.sin(turn), np.cos(down) + 0.0 * turn, -across * np.cos(turn)], axis=-1)


if __name__ == "__main__":
    main(panels)
