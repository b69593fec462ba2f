"""`polygonize` and `Polygonizer`: the surface of a field as a triangle mesh.

Dual marching cubes (Nielson 2004) on sparse cells: one vertex per patch of surface in a cell, projected onto
the surface by Newton's method. The cost grows with the area of the surface, and vertices lie on the surface
as exactly as float32 can tell.

The chord error is the distance of the triangles to the surface. Samples are the middles of triangles and of
their edges, and points between. Each is projected onto the surface by steps whose length bounds the distance.
Between samples the error is not bounded: a surface that bends within a third of a triangle may lie farther
away. Parts of a model that fall between all cells are not measured. The cells are adaptive (`adaptive`), or
have one size.
"""

import logging
import math
from functools import partial

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.cells.grid import Grid, aligned_grid
from blobtree.cells.scan import DeviceArray
from blobtree.cells.sparse_cells import CELL_KERNELS, SparseCells, build_cells
from blobtree.device import known_device, launch
from blobtree.errors import InvalidResolution
from blobtree.formulas.skeletons import BALL_CELLS
from blobtree.kernels import load_together
from blobtree.meshing.creases import sharpened
from blobtree.meshing.crumbs import without_crumbs
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.meshing.mesh import DeviceMesh, Mesh, download, extract_mesh
from blobtree.meshing.vertex_kernels import place_vertices
from blobtree.progress import Cancel, Progress, reporting
from blobtree.tape.model import ImplicitModel, checked_tree
from blobtree.tape.operands import has_walls
from blobtree.tape.part_sizes import has_small_parts, has_warps, sized_tape
from blobtree.validation import LARGEST_NUMBER, is_whole, positive_count, real_number, shown, truth

DEFAULT_RESOLUTION = 64

MAX_RESOLUTION = 1 << 20
"""Cells along a side beyond which 32 bits cannot hold their coordinates."""

MIN_MODEL_SIZE, MAX_MODEL_SIZE = 1e-15, 1e15
"""Sizes between which squared distances, in cells too, neither vanish nor overflow in float32."""

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

MIN_RELATIVE_ERROR = 2.0**-20
"""Smallest error that float32 can resolve, over the largest coordinate."""

MAX_TRIANGLES = 10_000_000
"""Triangles that a mesh by chord error may have unless the caller allows more; they take about 2 GB."""

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


def polygonize(
    tree: ImplicitModel,
    *,
    resolution: int | None = None,
    cell_size: float | None = None,
    chord_error: float | None = None,
    max_triangles: int = MAX_TRIANGLES,
    creases: bool = False,
    adaptive: bool = True,
    device: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Mesh:
    """Return the surface of `tree` as closed, consistently oriented triangles.

    Give at most one of `resolution`, `cell_size` and `chord_error`. Without any of them, the cells are those
    of resolution 64, and smaller where primitives are thin or nearly touch. If these do not fit into memory,
    the log names the part or the gap.

    Parameters
    ----------
    tree : Node
        The model.
    resolution : int, optional
        Cells along the longest side of the tree's support, all of one size.
    cell_size : float, optional
        Side of a cell, in the model's units. Features thinner than a cell may be lost.
    chord_error : float, optional
        Largest distance of the triangles to the surface, in the model's units. Passes with smaller and
        smaller cells are measured at samples in every triangle, until no sample lies farther. Features
        thinner than a 32nd of the box may be lost. A warning is logged if two million triangles are needed.
    max_triangles : int, optional
        Triangles that a mesh by chord error may have. Each pass is estimated by the one before it, and is
        refused before it starts.
    creases : bool, optional
        Move vertices onto the edges and corners that unions, intersections and differences leave.
    adaptive : bool, optional
        Choose the size of each cell by the chord error there, which takes far fewer triangles where the
        surface bends more in some places than in others. False gives all cells one size, as `resolution` and
        `cell_size` always do.
    device : str, optional
        Warp device that computes the mesh; by default the current one.
    progress : callable, optional
        Called as ``progress(stage, fraction)``, with the stage in plain words and the fraction done.
    cancel : callable, optional
        Called many times; the work stops if it returns True.

    Returns
    -------
    Mesh
        Vertices, faces (counter-clockwise seen from outside), outward normals and colours.

    Raises
    ------
    InvalidNode
        `tree` is not a model.
    InvalidDevice
        `device` is not a Warp device.
    InvalidResolution
        Several sizes are given, or one that is not positive, too small for float32, or too small for memory;
        or the chord error takes more triangles than allowed.
    Cancelled
        `cancel` returned True.

    See Also
    --------
    Polygonizer : update a mesh after edits.
    split_creases : prepare a mesh with creases for rendering.

    Examples
    --------
    >>> from blobtree import Point, polygonize
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> mesh = polygonize(ball, resolution=16)
    >>> bool(abs(ball(mesh.vertices) - 0.5).max() < 1e-5)  # on the surface
    True
    >>> lens = ball & ball.translate((1, 0, 0))
    >>> int((polygonize(lens, resolution=16, creases=True).sheet_counts == 2).sum()) > 10
    True
    """
    checked_tree(tree)
    if resolution is None and cell_size is None and chord_error is None:
        return polygonize_parts(tree, creases=creases, device=device, progress=progress, cancel=cancel)
    if chord_error is None:
        return Polygonizer(
            tree,
            resolution=resolution,
            cell_size=cell_size,
            creases=creases,
            device=device,
            progress=progress,
            cancel=cancel,
        ).mesh
    if resolution is not None or cell_size is not None:
        raise InvalidResolution(
            "expected one of resolution, cell_size and chord_error, got several; drop the others"
        )
    chord_error = _chord_error(tree, chord_error)
    most = positive_count("max_triangles", max_triangles, InvalidResolution)
    truth("creases", creases, InvalidResolution)
    adaptive = truth("adaptive", adaptive, InvalidResolution)
    within = _adaptive_within_chord_error if adaptive else _within_chord_error
    with reporting(progress, cancel) as report:
        return within(tree, chord_error, most, creases, device, report)


def polygonize_parts(
    tree: ImplicitModel,
    *,
    resolution: int = DEFAULT_RESOLUTION,
    creases: bool = False,
    device: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Mesh:
    """Return the mesh with cells of `resolution`, and smaller ones where parts are thin, see `polygonize`."""
    from blobtree.meshing.gaps import samples_without_gaps  # imported here: cells of one size need none

    truth("creases", creases, InvalidResolution)
    with reporting(progress, cancel) as report:
        size = cell_size_of(tree, resolution, None)
        if not shows_thin_parts(tree, resolution, device):
            load_kernels(tree, device, creases, sample_blocks, place_vertices)
            cells = build_cells(tree.tape, grid_around(tree, size), device=device, report=report)
            samples = samples_without_gaps(tree, cells, report)
            if samples is not None:
                _, mesh, sheet_counts = _extracted(cells, None, creases, report, samples)
                return download(mesh, sheet_counts)
        return _mesh_of_thin_parts(tree, size, creases, device, report)


def shows_thin_parts(tree: ImplicitModel, resolution: int, device: str | None) -> bool:
    """Return True if cells of `resolution` do not show a part or a wall of a tree."""
    return shows_small_parts(tree, resolution, BALL_CELLS, device) or has_walls(tree._program)


def shows_small_parts(tree: ImplicitModel, resolution: int, size: float, device: str | None) -> bool:
    """Return True if a part is thinner than `size` cells of `resolution`; where there are warps, look."""
    cell = cell_size_of(tree, resolution, None)
    if not has_small_parts(tree, size * cell) or not has_warps(tree):
        return has_small_parts(tree, size * cell)
    from blobtree.meshing.parts import PART_KERNELS, least_size  # imported here, as above

    load_kernels(tree, device, False, *PART_KERNELS)
    cells = build_cells(sized_tape(tree), grid_around(tree, cell), device=device)
    return least_size(cells, 0.0) < size * cell


def _mesh_of_thin_parts(
    tree: ImplicitModel, size: float, creases: bool, device: str | None, report: Progress
) -> Mesh:
    """Return a mesh that shows thin parts; the cells of all others have the given size."""
    from blobtree.meshing.parts import PART_KERNELS  # imported here, as above
    from blobtree.meshing.thickening import mesh_of_thin_parts

    def uniform(model: ImplicitModel) -> Mesh:
        return Polygonizer(model, cell_size=size, creases=creases, device=device, progress=report).mesh

    def grid_of(model: ImplicitModel, scale: float) -> Grid:
        return grid_around(model, scale * size)

    load_kernels(tree, device, creases, *PART_KERNELS)
    return mesh_of_thin_parts(tree, grid_of, uniform, device, creases, report)


def load_kernels(tree: ImplicitModel, device: str | None, creases: bool, *kernels: wp.Kernel) -> None:
    """Load kernels of meshing, and those for cells and creases, so that they compile at the same time."""
    instruction_set = tree.tape.instruction_set
    together = [*kernels, *CELL_KERNELS]
    if creases and not instruction_set.reads_gradients:
        from blobtree.meshing.crease_kernels import move_onto_creases  # imported here: most meshes need none

        together.insert(0, move_onto_creases)
    load_together(map(instruction_set.kernel_for, together), known_device(device))


def _within_chord_error(
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
    size = cell_size_of(tree, FIRST_RESOLUTION, None)
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


def _adaptive_within_chord_error(
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
    size = cell_size_of(tree, FIRST_RESOLUTION, None)
    passes: AdaptivePasses | None = None
    for number in range(1, MAX_ADAPTIVE_PASSES + 1):
        pass_report = _never_decreasing(_numbered(report, number))
        pass_report(_STAGES[0], 0.0)
        if passes is None:
            cells = build_cells(tree.tape, grid_around(tree, size), device=device, report=pass_report)
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


class Polygonizer:
    """The mesh of a tree that is being edited, of which an update computes the changed parts alone.

    Each mesh is the one that `polygonize` returns for that tree and `cell_size`, bit for bit. The caller need
    not say what was edited: blocks of cells are compared by the primitives and operators that act in them.
    Cells are counted from the world's origin, so the grid stays in place while the model changes its size.

    Parameters
    ----------
    tree, resolution, cell_size, creases, device, progress, cancel
        As for `polygonize`. `resolution` sets the cell size by the box of the first tree.

    Raises
    ------
    InvalidNode, InvalidDevice, InvalidResolution, Cancelled
        As for `polygonize`. If an update raises, the last mesh stays.

    Examples
    --------
    >>> from blobtree import Point, Polygonizer
    >>> polygonizer = Polygonizer(Point((0, 0, 0), radius=1.0), resolution=16)
    >>> before = len(polygonizer.mesh.vertices)
    >>> after = len(polygonizer.update(Point((0, 0, 0), radius=2.0)).vertices)
    >>> after > 3 * before  # four times the area in cells of the same size
    True
    """

    def __init__(
        self,
        tree: ImplicitModel,
        *,
        resolution: int | None = None,
        cell_size: float | None = None,
        creases: bool = False,
        device: str | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> None:
        checked_tree(tree)
        self._device = device
        self._creases = truth("creases", creases, InvalidResolution)
        self._cell_size = cell_size_of(tree, resolution, cell_size)
        with reporting(progress, cancel) as report:
            load_kernels(tree, device, self._creases, sample_blocks, place_vertices)
            self._dual_mesh, self._device_mesh, self._sheet_counts = self._extract(tree, None, report)
        self._tree = tree
        self._mesh: Mesh | None = None

    @property
    def tree(self) -> ImplicitModel:
        """The tree of the mesh."""
        return self._tree

    @property
    def cell_size(self) -> float:
        """Side of a cell, in the model's units."""
        return self._cell_size

    @property
    def dual_mesh(self) -> DeviceMesh:
        """The triangles in the device's memory, before vertices are moved onto creases."""
        return self._dual_mesh

    @property
    def device_mesh(self) -> DeviceMesh:
        """The triangles in the device's memory, with vertices on creases if these were asked for."""
        return self._device_mesh

    @property
    def mesh(self) -> Mesh:
        """The triangles as NumPy arrays."""
        if self._mesh is None:
            self._mesh = download(self._device_mesh, self._sheet_counts)
        return self._mesh

    def update(
        self, tree: ImplicitModel, *, progress: Progress | None = None, cancel: Cancel | None = None
    ) -> Mesh:
        """Return the mesh of `tree`, in which unchanged parts are copied; creases are computed again."""
        self.update_device_mesh(tree, progress=progress, cancel=cancel)
        return self.mesh

    def update_device_mesh(
        self, tree: ImplicitModel, *, progress: Progress | None = None, cancel: Cancel | None = None
    ) -> DeviceMesh:
        """Do the same as `update`, and leave the triangles on the device."""
        checked_tree(tree)
        with reporting(progress, cancel) as report:
            extracted = self._extract(tree, self._dual_mesh, report)
        self._dual_mesh, self._device_mesh, self._sheet_counts = extracted
        self._tree, self._mesh = tree, None
        return self._device_mesh

    def _extract(
        self, tree: ImplicitModel, previous: DeviceMesh | None, report: Progress
    ) -> tuple[DeviceMesh, DeviceMesh, NDArray[np.uint8] | None]:
        """Return `dual_mesh`, `device_mesh` and the sheet counts of the vertices."""
        grid = grid_around(tree, self._cell_size)
        old_cells = previous.cells if previous is not None else None
        cells = build_cells(tree.tape, grid, device=self._device, previous=old_cells, report=report)
        return _extracted(cells, previous, self._creases, report)


def _extracted(
    cells: SparseCells,
    previous: DeviceMesh | None,
    creases: bool,
    report: Progress,
    samples: DeviceArray | None = None,
) -> tuple[DeviceMesh, DeviceMesh, NDArray[np.uint8] | None]:
    """Return a mesh of cells, the same with vertices on creases if asked for, and its sheet counts."""
    mesh = extract_mesh(cells, report, previous, samples)
    return (mesh, *sharpened(mesh, report)) if creases else (mesh, mesh, None)


def cell_size_of(tree: ImplicitModel, resolution: int | None, cell_size: float | None) -> float:
    """Return the side of a cell from `resolution` or `cell_size`, once it is checked."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    longest = float((upper - lower).max())
    if resolution is not None and cell_size is not None:
        raise InvalidResolution("expected either resolution or cell_size, got both; drop one")
    if cell_size is None:
        cells = DEFAULT_RESOLUTION if resolution is None else resolution
        if not is_whole(cells) or not 1 <= cells <= MAX_RESOLUTION:
            raise InvalidResolution(
                f"resolution: expected a whole number of cells from 1 to {MAX_RESOLUTION:,}, "
                f"got {shown(resolution)}"
            )
        cell_size = longest / int(cells)
    cell_size = _above_zero("cell_size", "size", cell_size)
    if not MIN_MODEL_SIZE < longest < MAX_MODEL_SIZE:
        raise InvalidResolution(
            f"the model is {longest:.3g} long; between {MIN_MODEL_SIZE:g} and {MAX_MODEL_SIZE:g} float32 can "
            "square its distances: scale it"
        )
    if longest / cell_size > MAX_RESOLUTION:
        raise InvalidResolution(
            f"cell_size: expected at most {MAX_RESOLUTION:,} cells along the model, got "
            f"{longest / cell_size:.3g} with cells of {cell_size:g}; take larger cells"
        )
    return cell_size


def _chord_error(tree: ImplicitModel, value: object) -> float:
    """Return `value` as a chord error that float32 can resolve."""
    chord_error = _above_zero("chord_error", "length", value)
    smallest = MIN_RELATIVE_ERROR * float(np.abs(tree.support).max())
    if chord_error < smallest:
        raise InvalidResolution(
            f"chord_error: {chord_error:g} is below what float32 can tell there; allow {smallest:.2g} or more"
        )
    return chord_error


def _above_zero(name: str, noun: str, value: object) -> float:
    """Return `value` as a finite number above zero; raise `InvalidResolution` otherwise."""
    try:
        number = real_number(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not 0.0 < number <= LARGEST_NUMBER:
        raise InvalidResolution(f"{name}: expected a finite {noun} above 0, got {shown(value)}")
    return number


def grid_around(tree: ImplicitModel, cell_size: float) -> Grid:
    """Return cells around the support, and one more on every side so that the surface is closed."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    return aligned_grid(lower - cell_size, upper + cell_size, cell_size)
