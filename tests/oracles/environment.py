"""Light of a panorama in float64 NumPy: sums over its cells, without grids, transforms or fits."""

import numpy as np
from numpy.typing import NDArray

from tests.vectors import unit

Array = NDArray[np.float64]


def directions(rows: int) -> Array:
    """Middles of the cells of a panorama, right, up and back; the middle column looks away from the front."""
    steps = np.arange(2 * rows) + 0.5
    polar, turn = np.meshgrid(steps[:rows] * np.pi / rows, steps * np.pi / rows - np.pi, indexing="ij")
    return np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)], axis=-1)


def areas(rows: int) -> Array:
    """Solid angles of the cells, by row."""
    edges = np.linspace(0, np.pi, rows + 1)
    return np.asarray((np.cos(edges[:-1]) - np.cos(edges[1:])) * np.pi / rows)


def ggx(cosine: Array, alpha: float) -> Array:
    """Distribution of normals at an angle from the mean one."""
    return np.asarray(alpha**2 / (np.pi * (cosine**2 * (alpha**2 - 1) + 1) ** 2))


def shadowing(lit: Array, seen: float, alpha: float) -> Array:
    """Smith's height-correlated part that is lit and seen."""
    parts = [2 * x / (x + np.sqrt(alpha**2 + (1 - alpha**2) * x**2)) for x in (lit, np.float64(seen))]
    return np.asarray(1 / (1 / parts[0] + 1 / parts[1] - 1))


def lobe_mean(cells: Array, axis: Array, alpha: float) -> Array:
    """Mean light, weighted by GGX at the half vector and by the cosine, as seen head on (Karis 2013)."""
    towards = directions(len(cells))
    halfway = towards + axis
    halfway /= np.maximum(np.linalg.norm(halfway, axis=-1, keepdims=True), 1e-12)
    weight = ggx(halfway @ axis, alpha) * np.maximum(towards @ axis, 0) * areas(len(cells))[:, None]
    return np.asarray((weight[..., None] * cells).sum(axis=(0, 1)) / weight.sum())


def reflected(
    cells: Array, normal: Array, eye: Array, *, albedo: Array, roughness: float, metallic: float
) -> Array:
    """Light of all cells that a point reflects: Lambert and GGX of glTF, by a sum over the sphere."""
    light = directions(len(cells)).reshape(-1, 3)
    above = light @ normal > 0
    light, radiance = light[above], cells.reshape(-1, 3)[above]
    solid = np.repeat(areas(len(cells)), 2 * len(cells))[above]
    alpha, seen, lit = roughness**2, max(float(normal @ eye), 1e-3), light @ normal
    halfway = unit(light + eye)
    specular = ggx(halfway @ normal, alpha) * shadowing(lit, seen, alpha) / (4 * lit * seen)
    base = 0.04 + (albedo - 0.04) * metallic
    fresnel = base + (1 - base) * ((1 - np.maximum(halfway @ eye, 0)) ** 5)[:, None]
    diffuse = (1 - fresnel) * (1 - metallic) * albedo / np.pi
    return np.asarray(
        (radiance * (diffuse + fresnel * specular[:, None]) * (lit * solid)[:, None]).sum(axis=0)
    )


def reflected_parts(seen: float, roughness: float, steps: int) -> tuple[float, float, float]:
    """Factor of the reflectance, what is added, and Fresnel's part of diffuse light, as sums."""
    turns = (np.arange(steps) + 0.5) / steps
    polar, turn = np.meshgrid(turns * np.pi / 2, turns * np.pi, indexing="ij")
    light = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1)
    eye, alpha = np.array([np.sqrt(1 - seen**2), 0, seen]), roughness**2
    halfway = unit(light + eye)
    part = ggx(halfway[..., 2], alpha) * shadowing(light[..., 2], seen, alpha) / (4 * seen)
    part *= np.sin(polar) * (np.pi / steps) ** 2
    fresnel = (1 - np.clip(halfway @ eye, 0, 1)) ** 5
    diffuse = np.sin(polar) * np.cos(polar)
    grazing = (diffuse * fresnel).sum() / diffuse.sum()
    return float((part * (1 - fresnel)).sum()), float((part * fresnel).sum()), float(grazing)
