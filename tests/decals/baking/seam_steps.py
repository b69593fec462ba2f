"""The steps of colour along the seams of a textured mesh, read back from a file; in float64."""

from collections.abc import Callable

import numpy as np

from tests.decals.baking.glb import Array, ReadMesh, bilinear, linear

SPACING = 0.05
"""Distance in texels between points of a seam."""

SMOOTH = 1.0
"""Difference of the surface itself, of 255, up to which a step is one of the texture."""


def srgb(light: Array) -> Array:
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def seam_steps(node: ReadMesh, colors_at: Callable[[Array, Array], Array]) -> Array:
    """The largest difference, of 255, of the two sides at points along all seams of a mesh.

    At a crease, points within two texels of a step of the surface itself are left out: ``colors_at`` returns
    its linear colours at points with unit normals.
    """
    assert node.uv is not None
    assert node.texture is not None
    _, numbers = np.unique(node.vertices, axis=0, return_inverse=True)
    edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for face in node.faces:
        for a, b in zip(face, np.roll(face, -1), strict=True):
            first, second = (a, b) if numbers[a] < numbers[b] else (b, a)
            edges.setdefault((numbers[first], numbers[second]), []).append((first, second))
    pairs = np.array([sides for sides in edges.values() if len(sides) == 2])
    cut = (np.abs(node.uv[pairs[:, 0]] - node.uv[pairs[:, 1]]) > 1e-6).any(axis=(1, 2))
    pairs = pairs[cut]
    if not len(pairs):
        return np.zeros(0)
    sides = np.diff(node.uv[pairs], axis=2)[:, :, 0] * node.texture.shape[1::-1]
    counts = np.ceil(np.linalg.norm(sides, axis=2).max(axis=1) / SPACING).astype(int) + 1
    edges_of = np.repeat(np.arange(len(pairs)), counts)
    number = np.arange(len(edges_of)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (number / np.maximum(counts - 1, 1)[edges_of])[:, None]
    levels, surface, facings = [], [], []
    texture = linear(node.texture / 255.0)
    for side in (0, 1):
        begin, end = pairs[edges_of, side].T
        uv, points, normals = (
            values[begin] * (1 - share) + values[end] * share
            for values in (node.uv, node.vertices, node.normals)
        )
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        levels.append(255 * srgb(bilinear(texture, uv)))
        surface.append(255 * srgb(colors_at(points, normals)))
        facings.append(normals)
    crease = (facings[0] * facings[1]).sum(axis=1) < 1 - 1e-5
    own = crease & (np.abs(surface[0] - surface[1]).max(axis=1) > SMOOTH)
    near = own.copy()
    for step in range(1, round(2 / SPACING) + 1):
        near[step:] |= own[:-step] & (edges_of[step:] == edges_of[:-step])
        near[:-step] |= own[step:] & (edges_of[step:] == edges_of[:-step])
    steps: Array = np.abs(levels[0] - levels[1]).max(axis=1)[~near]
    return steps
