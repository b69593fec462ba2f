"""The orientation cube of the view: a click on a side, an edge or a corner looks from there."""

from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from decals.editing.view_actions import SIDE_KEYS
from decals.scenes.camera import Axes

CUTS = -1.0, -0.55, 0.55, 1.0
"""Where edges and corners begin on a side of the cube, whose half length is 1."""

FACING = 0.05
"""Cosine of the angle between a side and the viewer from which on the side is drawn."""

WORDS = (("bottom", "top"), 1), (("back", "front"), 2), (("left", "right"), 0)
"""Names of the directions against and along the axes to the right, upward and toward the front."""


@lru_cache(maxsize=1)  # the camera rests most of the time
def cube_cells(axes: Axes, toward: tuple[float, ...], up: tuple[float, ...]) -> list[dict[str, Any]]:
    """Return the visible parts of the cube as polygons of an SVG, in which the cube is 2 wide.

    Each has a name, as `ViewActions.look_from` takes it, a title, its corners, and on the middle of a side
    the map of its label.

    Parameters
    ----------
    axes
        Which way the scene stands.
    toward, up
        Direction to the viewer, and upward direction of the picture, shape (3,) each.
    """
    back = np.asarray(toward, np.float64) / np.linalg.norm(toward)
    right = np.cross(np.asarray(up, np.float64), back)
    right /= np.linalg.norm(right)
    picture = axes.matrix @ np.array([right, -np.cross(back, right), back]).T
    cells = []
    for axis, sign in product(range(3), (-1.0, 1.0)):
        normal = sign * np.eye(3)[axis]
        if (normal @ picture)[2] < FACING:
            continue
        upward = np.array([0.0, 1.0, 0.0]) if axis != 1 else np.array([0.0, 0.0, -sign])
        side = np.cross(upward, normal)
        for i, j in product(range(3), repeat=2):
            name = _name(normal + (i - 1) * side + (j - 1) * upward)
            spans = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
            corners = [normal + CUTS[a] * side + CUTS[b] * upward for a, b in spans]
            label = np.array([side, -upward, normal]) @ picture if i == j == 1 else None
            cells.append(
                {
                    "name": name,
                    "title": f"{name} view" + (f" ({SIDE_KEYS[name]})" if name in SIDE_KEYS else ""),
                    "points": " ".join(f"{x:.2f},{y:.2f}" for x, y, _ in np.array(corners) @ picture),
                    "label": "" if label is None else _matrix(label[:, :2]),
                }
            )
    return cells


def _name(parts: Float64Array) -> str:
    return " ".join(words[int(parts[axis] > 0)] for words, axis in WORDS if parts[axis])


def _matrix(rows: Float64Array) -> str:
    return f"matrix({' '.join(f'{number:.3f}' for number in rows.ravel())})"
