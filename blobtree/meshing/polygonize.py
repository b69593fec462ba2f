"""`polygonize`: the surface of a field as a triangle mesh, by one of several ways.

Cells of one size are those of `Polygonizer`. They are smaller where parts are thin (`thin_parts`), or follow
from a chord error (`chord_error`).
"""

import logging
from collections.abc import Callable

import numpy as np

from blobtree.cells.surface_box import surface_box
from blobtree.errors import InvalidResolution
from blobtree.lazy import if_present
from blobtree.meshing.mesh import Mesh
from blobtree.meshing.polygonizer import Polygonizer, above_zero
from blobtree.progress import Cancel, Progress, reporting
from blobtree.tape.model import ImplicitModel, checked_tree
from blobtree.validation import positive_count, truth

_logger = logging.getLogger(__name__)

WAYS: dict[str, Callable[..., Mesh]] = {}
"""Ways of meshing beside cells of one size."""

with if_present():
    import blobtree.meshing.creases  # noqa: F401  (adds what moves vertices onto creases)
    from blobtree.meshing.chord_error import adaptive_within_chord_error, within_chord_error
    from blobtree.meshing.thin_parts import polygonize_parts

    WAYS |= {
        "parts": polygonize_parts,
        "adaptive": adaptive_within_chord_error,
        "uniform": within_chord_error,
    }

MIN_RELATIVE_ERROR = 2.0**-20
"""Smallest error that float32 can resolve, over the largest coordinate."""

MAX_TRIANGLES = 10_000_000
"""Triangles that a mesh by chord error may have unless the caller allows more; they take about 2 GB."""


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
        Cells along the longest side of the tree's support, all of one size; along that of a box around the
        surface where this is much smaller.
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
    if resolution is None and cell_size is None and chord_error is None and "parts" in WAYS:
        return WAYS["parts"](tree, creases=creases, device=device, progress=progress, cancel=cancel)
    if chord_error is None:
        polygonizer = Polygonizer(
            tree,
            resolution=resolution,
            cell_size=cell_size,
            creases=creases,
            device=device,
            progress=progress,
            cancel=cancel,
        )
        if not len(polygonizer.mesh.faces):
            _logger.warning(
                "the mesh is empty: cells of %g show no surface; if the tree has one, its parts are thinner "
                "than these, and need a larger resolution or none",
                polygonizer.cell_size,
            )
        return polygonizer.mesh
    if resolution is not None or cell_size is not None:
        raise InvalidResolution(
            "expected one of resolution, cell_size and chord_error, got several; drop the others"
        )
    chord_error = _chord_error(tree, chord_error, device)
    most = positive_count("max_triangles", max_triangles, InvalidResolution)
    truth("creases", creases, InvalidResolution)
    adaptive = truth("adaptive", adaptive, InvalidResolution)
    within = WAYS["adaptive" if adaptive else "uniform"]
    with reporting(progress, cancel) as report:
        return within(tree, chord_error, most, creases, device, report)


def _chord_error(tree: ImplicitModel, value: object, device: str | None) -> float:
    """Return `value` as a chord error that float32 can resolve."""
    chord_error = above_zero("chord_error", "length", value)
    smallest = MIN_RELATIVE_ERROR * float(np.abs(surface_box(tree, device)).max())
    if chord_error < smallest:
        raise InvalidResolution(
            f"chord_error: {chord_error:g} is below what float32 can tell there; allow {smallest:.2g} or more"
        )
    return chord_error
