"""Chord error: the distance of a mesh's triangles to the surface, and the cell size that reduces it.

Samples are the middles of triangles and of their edges, and points between. Each is projected onto the
surface by steps whose length bounds the distance. Between samples the error is not bounded: a surface that
bends within a third of a triangle may lie farther away. Parts of a model that fall between all cells are not
measured.
"""

import math
from functools import partial

import numpy as np
import warp as wp

from blobtree.device import launch
from blobtree.meshing.chord_kernels import measure_triangles
from blobtree.meshing.device_mesh import DeviceMesh
from blobtree.progress import Progress

FIRST_RESOLUTION = 32
"""Cells along the model's longest side in the first pass, the coarsest one."""

ERROR_MARGIN = 0.8
"""Error that a pass aims at, over the allowed one: a pass that misses costs a whole pass."""

MIN_SIZE_RATIO = 0.2
"""Smallest ratio of the cell sizes of two passes: estimates hold no farther."""

MAX_PASSES = 8

MIN_RELATIVE_ERROR = 2.0**-20
"""Smallest error that float32 can resolve, over the largest coordinate."""


def largest_chord_error(mesh: DeviceMesh, report: Progress) -> float:
    """Return the largest distance of the samples on the triangles to the surface."""
    device, count = mesh.cells.device, len(mesh.faces)
    errors = wp.zeros(count, dtype=wp.float32, device=device)
    kernel = mesh.cells.tape.instruction_set.kernel_for(measure_triangles)
    inputs = [mesh.cells.arrays, mesh.vertices, mesh.faces]
    launch(kernel, count, inputs, [errors], device, step=partial(report, "measuring chords"))
    return float(np.max(errors.numpy(), initial=0.0))


def next_cell_size(passes: list[tuple[float, float]], allowed: float) -> float:
    """Return the cell size to try after `passes`, pairs of a cell size and its error.

    The error of a smooth surface falls with the square of the cell size, that of a crease with the size
    itself. The last two passes show the exponent.
    """
    size, error = passes[-1]
    power = 2.0
    if len(passes) > 1:
        size_before, error_before = passes[-2]
        power = math.log(error_before / error) / math.log(size_before / size)
    power = min(max(power, 1.0), 2.0)
    ratio: float = (ERROR_MARGIN * allowed / error) ** (1.0 / power)
    return size * max(ratio, MIN_SIZE_RATIO)
