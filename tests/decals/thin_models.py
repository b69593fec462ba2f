"""Thin closed models of any thickness: plates, shells, tubes, cones and folded leaves."""

from collections.abc import Callable

import numpy as np

from tests.decals.fault_models import Arrays, joined, revolved
from tests.decals.meshes import box, icosphere


def plate(thickness: float) -> Arrays:
    """A square plate."""
    surface = box((2.0, 2.0, thickness))
    return surface.vertices.astype(float), surface.faces


def disc(thickness: float) -> Arrays:
    """A round plate."""
    half = thickness / 2
    return revolved([(0.0, -half), (1.0, -half), (1.0, half), (0.0, half)])


def shell(thickness: float) -> Arrays:
    """A ball with a concentric cavity."""
    vertices, faces = icosphere(3)
    return joined((vertices, faces), ((1.0 - thickness) * vertices, faces[:, ::-1]))


def tube(thickness: float) -> Arrays:
    """A pipe that is open at both ends."""
    heights = np.linspace(-1, 1, 17)
    return revolved(
        [*[(0.7, z) for z in heights], *[(0.7 - thickness, z) for z in heights[::-1]], (0.7, -1.0)][:-1]
    )


def cone(thickness: float) -> Arrays:
    """A hat whose brim is sharp."""
    heights = np.linspace(-0.6, 0.6, 9)
    outer = [(0.7 * (0.6 - z) / 1.2 + thickness, z) for z in heights]
    inner = [(0.7 * (0.6 - z) / 1.2, z - thickness) for z in heights[:0:-1]]
    return revolved([(0.0, -0.6), *outer, (0.0, 0.6), *inner][1:])


def leaf(thickness: float, fold: float = 0.8) -> Arrays:
    """A sheet that is folded along its middle."""
    half = thickness / 2
    section = [(-1, fold), (0, 0), (1, fold)]
    ring = [(x, z - half) for x, z in section] + [(x, z + half) for x, z in section[::-1]]
    vertices = np.array([(x, y, z) for y in (-1.0, 1.0) for x, z in ring])
    i, j = np.arange(6), (np.arange(6) + 1) % 6
    sides = [np.stack(part, axis=1) for part in ((i, j + 6, j), (i, i + 6, j + 6))]
    caps = [[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]]
    return vertices, np.concatenate([*sides, caps, np.array(caps)[:, ::-1] + 6])


THIN_MODELS: dict[str, Callable[[float], Arrays]] = {
    "plate": plate,
    "disc": disc,
    "shell": shell,
    "tube": tube,
    "cone": cone,
    "leaf": leaf,
}
"""Models by name, each a function of its thickness; they are about two units long."""
