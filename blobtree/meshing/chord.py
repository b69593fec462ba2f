"""How far the triangles of a surface lie from the field's surface, measured by samples, and cells to match.

Samples are the middles of triangles and of their edges, and points between. Each is taken onto the surface;
the way there is never shorter than the distance, so at the samples what is measured is a bound. Between them
it is none: a surface that turns within a third of a triangle may lie farther away. Parts of a model that fall
between all cells are not seen at all.
"""

import math
from functools import partial

import numpy as np
import warp as wp

from blobtree.launch import launch
from blobtree.meshing.chord_kernels import measure_triangles
from blobtree.meshing.creases import cells_of
from blobtree.meshing.surface import Surface
from blobtree.progress import Progress

FIRST_RESOLUTION = 32
"""Cells along the model's longest side in the first pass, the coarsest one."""

MARGIN = 0.8
"""What a pass aims at, over the error that is allowed: a miss costs a whole pass."""

FASTEST = 0.2
"""Size of cells over that in the pass before, at least: an estimate reaches no farther."""

MOST_PASSES = 8

SMALLEST = 2.0**-20
"""The smallest error that float32 can tell, over the largest coordinate."""


def largest_error(surface: Surface, report: Progress) -> float:
    """Largest distance of the samples on a surface's triangles to the field's surface."""
    device = surface.cells.device
    count = len(surface.faces)
    errors = wp.zeros(count, dtype=wp.float32, device=device)
    kernel = surface.cells.tape.vocabulary.kernel(measure_triangles)
    inputs = [cells_of(surface), surface.vertices, surface.faces]
    launch(kernel, count, inputs, [errors], device, step=partial(report, "measuring chords"))
    return float(np.max(errors.numpy(), initial=0.0))


def finer(tried: list[tuple[float, float]], allowed: float) -> float:
    """The size of cells to try next, after those `tried` with their errors.

    The error of a smooth surface falls with the square of the size, that of a kink with the size itself; the
    last two passes tell which.
    """
    size, error = tried[-1]
    power = 2.0
    if len(tried) > 1:
        (size_before, error_before) = tried[-2]
        power = math.log(error_before / error) / math.log(size_before / size)
    power = min(max(power, 1.0), 2.0)
    share: float = (MARGIN * allowed / error) ** (1.0 / power)
    return size * max(share, FASTEST)
