"""Baked colours beside those of `evaluate`, for tests and benchmarks."""

from pathlib import Path

import numpy as np

import decals
from decals.images.texels import encode_srgb
from tests.decals.baking.glb import BALL, ReadMesh, ball_and_cube, bilinear, linear, read_glb

POINTS = 10_000
"""Points of the ball that are compared."""


def beside_evaluated(path: Path, size: int) -> tuple[float, float]:
    """Bake a ball; return the levels of 255 within which 99 % of its points are as evaluated.

    The second number is that beside means over one and a half texels.
    """
    scene = ball_and_cube()
    decals.bake(scene, path, size=size)
    node = read_glb(path)["ball"]
    points, normals, uv = node.on_surface(POINTS, seed=3)
    assert node.texture is not None
    got = 255 * encode_srgb(bilinear(linear(node.texture / 255), uv))
    across = np.cross(normals, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    ways = np.stack([across, np.cross(normals, across)], axis=1)
    axis = 1.5 * texel_length(node) * ((np.arange(6) + 0.5) / 6 - 0.5)
    offsets = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    area = points[:, None] + np.einsum("kc,mci->mki", offsets, ways)
    found = []
    for places in (points[:, None], area):
        over = decals.evaluate(
            scene.decals,
            places.reshape(-1, 3),
            np.repeat(normals, places.shape[1], axis=0),
            images=[image.pixels for image in scene.images],
        ).color
        assert over is not None
        light = linear(np.asarray(BALL)) * (1 - over[:, 3:]) + over[:, :3]
        want = 255 * encode_srgb(light.reshape(places.shape).mean(axis=1))
        found.append(float(np.quantile(np.abs(got - want).max(axis=1), 0.99)))
    return found[0], found[1]


def texel_length(node: ReadMesh) -> float:
    """Length of a texel on the surface."""
    assert node.uv is not None
    assert node.texture is not None
    solid, flat = (
        np.linalg.norm(values[node.faces[:, 1]] - values[node.faces[:, 0]], axis=1).sum()
        for values in (node.vertices, node.uv * len(node.texture))
    )
    return float(solid / flat)
