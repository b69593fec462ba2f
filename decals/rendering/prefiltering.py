"""Pictures of all directions, prefiltered as light for surface of any roughness.

A rough surface mirrors light through a lobe. The mean light in the lobe is that of the split sum (Karis,
"Real Shading in Unreal Engine 4", 2013): the mean of the picture, weighted by GGX seen head on, times a
table of what surface of this roughness reflects of light 1. The lobe of roughness 1 is the cosine, so its
means light diffuse surface too. Lobes are round: along circles of latitude, a mean is a convolution, which a
Fourier transform computes without noise.
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Float64Array
from blobtree.sized_cache import kept_with
from decals.rendering.environment import Panorama
from decals.rendering.studio import ENVIRONMENTS
from decals.shaders import constants

MAX_PICTURE_COLUMNS = 8192
"""Greatest width of a panorama in the background: more takes more than 200 MB of graphics memory."""

GRID_ROWS = (512, 256, 128, 64, 64, 64, 64)
"""Steps from pole to pole of the grids of directions, from mirrors to surface of roughness 1."""

TABLE_SHAPE = (32, 64)
"""Rows of the table, by roughness, and its columns, by the cosine between normal and eye."""

TABLE_LOBE_STEPS = (128, 12)
"""Directions over a lobe, from its axis and around it, with which the table is computed."""

MIN_FACING = constants("material.glsl")["MIN_FACING"]
"""Least cosine between normal and eye."""


@kept_with(lambda panorama: panorama)
def prefiltered(panorama: Panorama) -> NDArray[np.float16]:
    """Return what ``shaders/image_environment.glsl`` reads: all grids, and the table below them.

    It is kept as long as the panorama.
    """
    light = panorama.light
    blocks = [_mirror_grid(panorama_cells(light, GRID_ROWS[0]))]
    for level, rows in enumerate(GRID_ROWS[1:], 1):
        blocks.append(lobe_means(panorama_cells(light, rows), level_alpha(level)))
    blocks.append(np.dstack(reflection_table()))
    blocks = [np.pad(block, ((1, 1), (0, 0), (0, 0)), "edge") for block in blocks]
    texels = np.zeros((sum(map(len, blocks)), 2 * GRID_ROWS[0] + 1, 3), np.float16)
    first = 0
    for block in blocks:
        texels[first : first + len(block), : block.shape[1]] = block
        first += len(block)
    return texels


def environment_constants() -> str:
    """Return the places of the grids and of the table as GLSL, for ``shaders/image_environment.glsl``."""
    first, grids = 1, []
    for rows in GRID_ROWS:
        grids.append(f"ivec2({first}, {rows})")
        first += rows + 3  # both poles, and a row above and below
    count, (rows, columns) = len(GRID_ROWS), TABLE_SHAPE
    return (
        f"const int ENVIRONMENT_LEVELS = {count};\n"
        f"const ivec2 ENVIRONMENT_GRIDS[{count}] = ivec2[]({', '.join(grids)});\n"
        f"const ivec3 ENVIRONMENT_TABLE = ivec3({first}, {columns}, {rows});\n"
    )


ENVIRONMENTS["image"] = environment_constants


def picture_texels(light: Float32Array, max_edge: int) -> NDArray[np.float16]:
    """Return a panorama for the background: as it is, or, if it is too large, with fewer pixels."""
    rows = min(max_edge, MAX_PICTURE_COLUMNS) // 2
    small = max(light.shape) <= 2 * rows
    return (light if small else panorama_cells(light, rows)).astype(np.float16)


def level_alpha(level: int) -> float:
    """Return the width α of GGX, the squared roughness, of a grid: 0 of the first, 1 of the last."""
    return float((2.0**level - 1.0) / (2.0 ** (len(GRID_ROWS) - 1) - 1.0))


def panorama_cells(light: Float32Array, rows: int) -> Float32Array:
    """Return a panorama in another size, float32[rows, 2 rows, 3]: means over the parts of the sphere."""
    height, width = light.shape[:2]
    lines = _overlaps(_heights(rows), _heights(height)) @ light.reshape(height, -1)
    columns = lines.reshape(rows, width, 3).transpose(1, 0, 2).reshape(width, -1)
    turned = _overlaps(np.linspace(0, 1, 2 * rows + 1), np.linspace(0, 1, width + 1)) @ columns
    cells: Float32Array = turned.reshape(2 * rows, rows, 3).transpose(1, 0, 2)
    return np.ascontiguousarray(cells)


def _heights(rows: int) -> Float64Array:
    """Return the heights of the edges of rows below the upper pole, on a sphere of radius 1."""
    return 1.0 - np.cos(np.linspace(0.0, np.pi, rows + 1))


def _overlaps(edges: Float64Array, others: Float64Array) -> Any:
    """Return the part of each interval between edges that each interval between others covers."""
    from scipy.sparse import csr_array

    ends, starts = np.minimum.outer(edges[1:], others[1:]), np.maximum.outer(edges[:-1], others[:-1])
    parts = np.maximum(ends - starts, 0.0) / np.diff(edges)[:, None]
    return csr_array(parts.astype(np.float32))


def lobe(cosine: Float32Array, alpha: float) -> Float32Array:
    """Return the weight of light at an angle from the axis of a lobe that is seen head on.

    That is the distribution of GGX at half the angle, times the cosine; the factor is arbitrary.
    """
    weight: Float32Array = np.maximum(cosine, 0.0) / (1.0 - 0.5 * (1.0 + cosine) * (1.0 - alpha * alpha)) ** 2
    return weight


def lobe_means(cells: Float32Array, alpha: float) -> Float32Array:
    """Return the mean light in the lobe around each direction of a grid.

    Parameters
    ----------
    cells
        Panorama, float32[rows, 2 rows, 3].
    alpha
        Squared roughness.

    Returns
    -------
    float32[rows + 1, 2 rows + 1, 3]
        Means around the corners of the cells: the first and the last row are the poles, the first and the
        last column are the same.
    """
    from scipy.fft import dct, irfft, rfft

    rows = len(cells)
    edges = np.linspace(0.0, np.pi, rows + 1)
    middles, half = 0.5 * (edges[1:] + edges[:-1]), rows // 2 + 1
    turns = np.cos((np.arange(rows) + 0.5) * np.pi / rows).astype(np.float32)
    along = np.outer(np.cos(edges[:half]), np.cos(middles)).astype(np.float32)
    across = np.outer(np.sin(edges[:half]), np.sin(middles)).astype(np.float32)
    weights = lobe(along[..., None] + across[..., None] * turns, alpha)  # of the half that begins at a corner
    waves = dct(weights, axis=-1, overwrite_x=True) * np.diff(_heights(rows)).astype(np.float32)[:, None]
    shift = np.exp(-0.5j * np.pi * np.arange(rows) / rows)[:, None]  # from middles to corners
    spectrum = (rfft(cells, axis=1)[:, :-1] * shift).astype(np.complex64)
    both = np.concatenate([spectrum, spectrum[::-1]], axis=-1)  # the southern half is the northern, reflected
    means = np.matmul(waves.transpose(2, 0, 1), both.transpose(1, 0, 2)).transpose(1, 0, 2)
    means = irfft(means / waves[:, :, 0].sum(axis=1)[:, None, None], 2 * rows, axis=1)
    grid = np.concatenate([means[..., :3], means[-2::-1, :, 3:]])
    closed: Float32Array = np.concatenate([grid, grid[:, :1]], axis=1).astype(np.float32)
    return np.maximum(closed, 0.0)


def _mirror_grid(cells: Float32Array) -> Float32Array:
    """Return the mean of the cells around each corner, as `lobe_means` of an infinitely narrow lobe."""
    rows = np.pad(cells, ((1, 1), (0, 0), (0, 0)), "edge")
    rows = 0.5 * (rows[1:] + rows[:-1])
    corners = 0.5 * (rows + np.roll(rows, 1, axis=1))
    corners[[0, -1]] = corners[[0, -1]].mean(axis=1, keepdims=True)
    return np.concatenate([corners, corners[:, :1]], axis=1)


@cache
def reflection_table() -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return what surface reflects of light 1 from everywhere, by roughness and by the cosine to the eye.

    The first array is the factor of the reflectance seen head on, the second is added to the product: an
    integral of GGX with Smith's height-correlated shadowing, over the normals that the eye sees (Dupuy and
    Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023). The third is the mean of
    (1 - cosine to the half vector)⁵ over diffuse light.
    """
    steps = [np.linspace(0.0, 1.0, count) for count in TABLE_SHAPE]
    roughness, seen = (grid[..., None, None] for grid in np.meshgrid(*steps, indexing="ij"))
    alpha, seen = roughness**2, np.maximum(seen, MIN_FACING)
    parts, turns = ((np.arange(count) + 0.5) / count for count in TABLE_LOBE_STEPS)
    aside = np.sqrt(1.0 - seen**2)
    stretched = np.hypot(alpha * aside, seen)
    x, z = alpha * aside / stretched, seen / stretched
    height = (1.0 - parts[:, None]) * (1.0 + z) - z
    ring = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    half = [alpha * (ring * np.cos(np.pi * turns) + x), alpha * ring * np.sin(np.pi * turns), height + z]
    length = np.sqrt(sum(part**2 for part in half))
    toward_half = np.clip((half[0] * aside + half[2] * seen) / length, 0.0, 1.0)
    lit = 2.0 * toward_half * half[2] / length - seen
    smith = [
        np.sqrt(cosine**2 * (1.0 - alpha**2) + alpha**2) / cosine for cosine in (np.maximum(lit, 1e-9), seen)
    ]
    weight = np.where(lit > 0.0, (1.0 + smith[1]) / (smith[0] + smith[1]), 0.0)
    fresnel = (1.0 - toward_half) ** 5
    diffuse = aside * np.sqrt(parts[:, None]) * np.cos(np.pi * turns) + seen * np.sqrt(1.0 - parts[:, None])
    grazing = np.broadcast_to((1.0 - np.sqrt(0.5 + 0.5 * diffuse)) ** 5, weight.shape)
    means = [values.mean(axis=(2, 3)) for values in ((1.0 - fresnel) * weight, fresnel * weight, grazing)]
    return means[0], means[1], means[2]
