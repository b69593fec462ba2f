"""Materials with relief to test with, and their heights by brute force."""

from typing import Any

import numpy as np

from decals import DecalMaterial, Scene
from tests.decals.baking.glb import Array, bilinear, gradient
from tests.oracles.decals import colors_at


def hills(seed: int, *, relief: float) -> DecalMaterial:
    """A material with smooth random heights from 0 to 1."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:12, 0:12] / 11
    heights = 0.5 + 0.5 * np.sin(3 * rng.normal() * x + 4 * rng.normal() * y + rng.normal())
    return DecalMaterial(f"hills {seed}", gradient(seed), height=heights.astype(np.float32), relief=relief)


def expected_heights(scene: Scene, points: Array, normals: Array) -> Array:
    """Heights by brute force in float64: those of all decals over each other, by their alpha."""
    rows = scene.decals

    def texels(material: Any) -> Array:
        """Height times alpha, and alpha; heights end smoothly at the rim."""
        side = len(material.pixels)
        steps = (np.arange(side) + 0.5) / side * 2 - 1
        x, y = np.meshgrid(steps, steps)
        depth = np.clip((1 - np.hypot(x, y) - 2 / side) / max(0.04, 6 / side), 0, 1)
        alpha = material.pixels[..., 3] / 255
        height = material.relief * material.height.astype(float) * depth**2 * (3 - 2 * depth)
        return np.stack([height * alpha, 0 * alpha, 0 * alpha, alpha], axis=-1)

    def paint_of(numbers: Any, uv: Any) -> Any:
        paint = np.tile([0.0, 0.0, 0.0, 1.0], (len(numbers), 1))
        for number, material in enumerate(scene.images):
            mine = rows.images[numbers] == number
            paint[mine] = bilinear(texels(material), uv[mine])
        paint[:, 0] *= rows.radii[numbers]
        return paint * rows.opacities[numbers, None]

    heights: Array = colors_at(rows, points, normals, paint_of)[:, 0]
    return heights
