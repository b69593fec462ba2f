"""Meshes within a chord error: passes with smaller and smaller cells, of one size or adaptive.

The chord error is the distance of the triangles to the surface. Samples are the middles of triangles and of
their edges, and points between. Each is projected onto the surface by steps whose length bounds the distance.
Between samples the error is not bounded: a surface that bends within a third of a triangle may lie farther
away. Parts of a model that fall between all cells are not measured.
"""

import logging
import math
from functools import partial

import numpy as np
import warp as wp

from blobtree.cells.sparse_cells import build_cells
from blobtree.device import launch
from blobtree.errors import InvalidResolution
from blobtree.meshing.crumbs import without_crumbs
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.meshing.mesh import DeviceMesh, Mesh
from blobtree.meshing.polygonizer import Polygonizer, cell_size_of, grid_around, load_kernels
from blobtree.meshing.vertex_kernels import place_vertices
from blobtree.progress import Progress
from blobtree.tape.model import ImplicitModel

FIRST_RESOLUTION = 32
"""Cells along the model's longest side in the first pass, the coarsest one."""

ERROR_MARGIN = 0.8
"""Error that a pass aims at, over the allowed one: a pass that misses costs a whole pass."""

MIN_SIZE_RATIO = 0.2
"""Smallest ratio of the cell sizes of two passes: estimates hold no farther."""

MAX_PASSES = 8

MAX_ADAPTIVE_PASSES = 24
"""Most passes with adaptive cells; each divides some leaves."""

BASE_SCALES = (1.0, 2.0**-0.25, 2.0**-0.5, 2.0**-0.75)
"""Sizes of the base's cells to choose from, over the first one: each division halves them."""

RESTART_SHARE = 0.8
"""Share of the expected triangles from which on the first pass is repeated with other cells."""

MANY_TRIANGLES = 2_000_000
"""Triangles from which on a mesh by chord error is announced by a warning."""

_logger = logging.getLogger(__name__)

_STAGES = (
    "finding the surface",
    "sampling the field",
    "placing vertices",
    "connecting vertices",
    "finding creases",
    "measuring chords",
)
"""The stages of a pass that `progress` is called with, in order."""


def within_chord_error(
    tree: ImplicitModel,
    chord_error: float,
    max_triangles: int,
    creases: bool,
    device: str | None,
    report: Progress,
) -> Mesh:
    """Return the mesh of the first pass whose triangles lie within `chord_error` of the surface."""
    from blobtree.meshing.distance_kernels import measure_triangles  # imported here: most meshes need none

    passes: list[tuple[float, float]] = []
    size = cell_size_of(tree, FIRST_RESOLUTION, None, device)
    load_kernels(tree, device, creases, sample_blocks, place_vertices, measure_triangles)
    for number in range(1, MAX_PASSES + 1):
        pass_report = _numbered(report, number)
        polygonizer = Polygonizer(tree, cell_size=size, creases=creases, device=device, progress=pass_report)
        error = _largest_chord_error(polygonizer.device_mesh, pass_report)
        if error <= chord_error:
            return without_crumbs(polygonizer.mesh, chord_error)
        passes.append((size, error))
        density = len(polygonizer.device_mesh.faces) * size**2  # triangles per squared cell size
        if number == 1:
            first = (passes[0][0], min(error, passes[0][0]))  # errors of parts that cells miss are larger
            _announce_count(density / _final_cell_size([first], chord_error) ** 2, chord_error)
        size = _next_cell_size(passes, chord_error)
        _check_count(density / size**2, max_triangles, f"chord_error: {chord_error:g}")
    raise InvalidResolution(
        f"chord_error: {chord_error:g} was not reached in {MAX_PASSES} passes, the last with cells of "
        f"{passes[-1][0]:g} came to {passes[-1][1]:g}; allow more, or ask for creases where CSG cuts edges"
    )


def adaptive_within_chord_error(
    tree: ImplicitModel,
    chord_error: float,
    max_triangles: int,
    creases: bool,
    device: str | None,
    report: Progress,
) -> Mesh:
    """Return a mesh of adaptive cells whose triangles lie within `chord_error` of the surface."""
    from blobtree.meshing.adaptive import ADAPTIVE_KERNELS, AdaptivePasses  # imported here, as above

    load_kernels(tree, device, creases, *ADAPTIVE_KERNELS)
    wish = f"chord_error: {chord_error:g}"
    size = cell_size_of(tree, FIRST_RESOLUTION, None, device)
    passes: AdaptivePasses | None = None
    for number in range(1, MAX_ADAPTIVE_PASSES + 1):
        pass_report = _never_decreasing(_numbered(report, number))
        pass_report(_STAGES[0], 0.0)
        if passes is None:
            cells = build_cells(tree.tape, grid_around(tree, size, device), device=device, report=pass_report)
            passes = AdaptivePasses(cells, chord_error, creases)
        within = passes.run(pass_report)
        pass_report(_STAGES[-1], 1.0)
        if within:
            return without_crumbs(passes.mesh.mesh(creases), chord_error)
        if number == 1:
            counts = [passes.expected_triangles(scale=scale) for scale in BASE_SCALES]
            _announce_count(min(counts), chord_error)
            _check_count(min(counts), max_triangles, wish)
            if min(counts) < RESTART_SHARE * counts[0]:
                size, passes = size * BASE_SCALES[int(np.argmin(counts))], None
                continue
        _check_count(passes.expected_triangles(1), max_triangles, wish)
        passes.refine()
    raise InvalidResolution(
        f"{wish} was not reached in {MAX_ADAPTIVE_PASSES} passes; allow more, or ask for creases where CSG "
        "cuts edges"
    )


def _largest_chord_error(mesh: DeviceMesh, report: Progress) -> float:
    """Return the largest distance of the samples on the triangles to the surface."""
    from blobtree.meshing.distance_kernels import measure_triangles

    device, count = mesh.cells.device, len(mesh.faces)
    errors = wp.zeros(count, dtype=wp.float32, device=device)
    kernel = mesh.cells.tape.instruction_set.kernel_for(measure_triangles)
    inputs = [mesh.cells.arrays, mesh.vertices, mesh.faces]
    launch(kernel, count, inputs, [errors], device, step=partial(report, "measuring chords"))
    return float(np.max(errors.numpy(), initial=0.0))


def _next_cell_size(passes: list[tuple[float, float]], allowed: float) -> float:
    """Return the cell size to try after `passes`, pairs of a cell size and its error.

    Estimates hold no farther than MIN_SIZE_RATIO.
    """
    return max(_final_cell_size(passes, allowed), MIN_SIZE_RATIO * passes[-1][0])


def _final_cell_size(passes: list[tuple[float, float]], allowed: float) -> float:
    """Return the cell size at which the error is expected to be the allowed one.

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
    return size * ratio


def _check_count(triangles: float, allowed: int, wish: str) -> None:
    """Raise `InvalidResolution` if the next pass would give more triangles than allowed."""
    if triangles > allowed:
        raise InvalidResolution(
            f"{wish} takes about {triangles:,.0f} triangles or more, and max_triangles = {allowed:,}; "
            "allow a larger error, or more triangles"
        )


def _announce_count(triangles: float, chord_error: float) -> None:
    """Log a warning if a mesh will have many triangles; creases in CSG take more than this estimate."""
    if triangles >= MANY_TRIANGLES:
        _logger.warning(
            "chord_error %g takes about %s million triangles; a larger error takes fewer",
            chord_error,
            f"{triangles / 1e6:,.0f}",
        )


def _numbered(report: Progress, number: int) -> Progress:
    """Return a callback that reports the stages of one pass as fractions of that pass, and others as is."""

    def numbered(stage: str, fraction: float) -> None:
        if stage in _STAGES:
            report(f"meshing, pass {number}", (_STAGES.index(stage) + fraction) / len(_STAGES))
        else:
            report(stage, fraction)

    return numbered


def _never_decreasing(report: Progress) -> Progress:
    """Return a callback that repeats the largest fraction where a stage is repeated."""
    largest = 0.0

    def forward(stage: str, fraction: float) -> None:
        nonlocal largest
        if stage not in _STAGES:
            report(stage, fraction)
            return
        done = _STAGES.index(stage) + fraction
        largest = done = max(done, largest)
        number = min(int(done), len(_STAGES) - 1)
        report(_STAGES[number], done - number)

    return forward
