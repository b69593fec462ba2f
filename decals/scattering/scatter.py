"""`scatter`: cover surfaces with decals in one call."""

from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree.device import known_device
from blobtree.kernels import load_together
from blobtree.progress import Progress, reporting
from blobtree.validation import describe
from decals.errors import InvalidScattering
from decals.index.build_kernels import list_cells
from decals.model import Decals
from decals.options import Values
from decals.scattering.appearance import Appearance, ImageChoice, ZonesOfModels
from decals.scattering.domain import Density, Mask
from decals.scattering.jitter import Jitter
from decals.scattering.neighbors import CLOSE_DISTANCE
from decals.scattering.orientation import Direction
from decals.scattering.relaxation import Relaxation
from decals.scattering.repulsion_kernels import repel
from decals.scattering.search_kernels import sample_around
from decals.scattering.sizing import Sizing
from decals.scattering.step_kernels import propose_moves
from decals.surfaces.convert import HasSurface, Model, as_surfaces, listed
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.mesh_kernels import closest_points
from decals.surfaces.surface import Surface
from decals.surfaces.tree_kernels import project_with_mesh
from decals.validation import allowed_number, function_or_none

SCATTER_KERNELS = (repel, sample_around, propose_moves, list_cells)
"""Kernels that scattering launches, for `load_together`, and those of an index of its decals."""

RELAXATION_SHARE = 0.8
"""Share of the relaxation in the whole work, for progress bars."""


def scatter(
    surfaces: Surface | HasSurface | Model | Sequence[Surface | HasSurface | Model],
    *,
    count: Annotated[int | None, Values(1, 1000)] = None,
    spacing: Annotated[float | None, Values(unit="model units")] = None,
    seed: int = 0,
    density: Density | None = None,
    mask: Mask | None = None,
    fixed: ArrayLike | None = None,
    regularity: Annotated[float, Values(0.0, 1.0)] = 1.0,
    sizing: Sizing | str = Sizing.COVERING,
    factor: Annotated[float, Values(0.2, 2.0, label="radius factor")] = 1.0,
    direction: Direction = None,
    images: int | Sequence[int] = 1,
    weights: ArrayLike | None = None,
    choice: Annotated[ImageChoice | str, Values(label="image choice")] = ImageChoice.RANDOM,
    jitter: Jitter | None = None,
    zones: ZonesOfModels | None = None,
    device: str = "cpu",
    progress: Progress | None = None,
    cancel: Callable[[], bool] | None = None,
) -> Decals:
    """Cover surfaces with evenly scattered decals, without gaps.

    `Relaxation` places the decals as in the paper: particles repel each other on all surfaces at once. The
    default radii are the least ones that leave no gap.

    Parameters
    ----------
    surfaces : Surface, Model or object of a scene, or a sequence of these
        One surface, or several that are covered together. `decals.surfaces.convert.as_shape` lists all
        models.
    count : int, optional
        Exact number of decals, the fixed ones included. Give either `count` or `spacing`.
    spacing : float, optional
        Distance of neighbours, in model units; the count follows from it.
    seed : int, default: 0
        Seed of all random choices, from 0 upward; the same seed gives the same decals.
    density : callable, optional
        Relative density of decals: a function of ``points[n, 3]`` to numbers above zero, ``[n]``.
    mask : callable, optional
        Where decals may lie: a function of ``points[n, 3]`` to ``bool[n]``.
    fixed : array_like, optional
        Positions of decals that never move, ``float[k, 3]``. Points off the surfaces are moved to the nearest
        place on them first.
    regularity : float, default: 1.0
        From 0 (random positions) to 1 (as even as possible). In between the relaxation stops when the
        least distance reaches that share of the one at 1.
    sizing : Sizing or str, default: Sizing.COVERING
        Rule for the radii: ``"covering"``, ``"touching"`` or ``"delaunay"``.
    factor : float, default: 1.0
        Factor of the radii.
    direction : array_like, callable, Orientation or str, optional
        Direction of the images' u axes: a vector, a function of ``points[n, 3]`` to ``vectors[n, 3]``, or an
        `Orientation`, ``"curvature"`` or ``"cross"``. Random by default.
    images : int or sequence of int, default: 1
        Number of images to choose from, or the numbers of some, such as ``[2, 5]``.
    weights : array_like, optional
        Relative frequency of each of these images; equal by default.
    choice : ImageChoice or str, default: ImageChoice.RANDOM
        Rule for the image of each decal: ``"random"``, ``"size"`` or ``"curvature"``.
    jitter : Jitter, optional
        Random deviations of positions, radii and directions; none by default.
    zones : Zones, optional
        Parts of the surfaces with decals of their own, see `decals.scattering.Zones`. What a zone does not
        state, and `count`, are those of this call. If zones state their spacing, give no `count` or
        `spacing`.
    device : str, default: "cpu"
        Warp device of the relaxation, such as ``"cuda:0"``.
    progress : callable, optional
        Called with the name of the stage and the fraction done.
    cancel : callable, optional
        Called before every step; return True to stop the relaxation. The particles get their decals as they
        lie then.

    Returns
    -------
    Decals

    Raises
    ------
    InvalidScattering
        For an argument of the wrong kind or out of range, or a count without visible area.

    See Also
    --------
    Relaxation : The same, step by step.
    cover : Decals and a camera for whole models.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> ball = decals.surfaces.ImplicitSurface(Point((0, 0, 0), radius=1.0))
    >>> len(decals.scatter(ball, count=50))
    50
    >>> dense_below = lambda points: 1.0 + 3.0 * (points[:, 1] < 0)
    >>> half = decals.scatter(ball, count=50, seed=1, density=dense_below)
    >>> int((half.positions[:, 1] < 0).sum())
    40
    """
    models = listed(surfaces)
    checked_surfaces = as_surfaces(models)
    check_regularity(regularity)
    function_or_none("progress", progress, InvalidScattering)
    base = Appearance(sizing, factor, direction, images, weights, choice, jitter)  # before the long work
    if zones is not None and not hasattr(zones, "placed_on"):
        raise InvalidScattering(f"zones: expected such as Zones(Zone(…)), got {describe(zones)}")
    with reporting(progress) as report:
        device = known_device(device)
        load_together([*_projections(checked_surfaces), *SCATTER_KERNELS], device)
        placed = None
        if zones is not None:
            placed = zones.placed_on(models, density=density, mask=mask, seed=seed, device=device)
            placed.styles(base, np.zeros((0, 3), np.float32), seed)  # check before the long work
            density, mask = placed.density, placed.mask
            if placed.spacing is not None:
                if (count, spacing) != (None, None):
                    raise InvalidScattering("expected no count or spacing beside those of the zones, got one")
                spacing = placed.spacing
        relaxation = Relaxation(
            checked_surfaces,
            count=count,
            spacing=spacing,
            seed=seed,
            density=density,
            mask=mask,
            fixed=fixed,
            device=device,
        )
        if regularity > 0.0:
            relaxation.run(
                lambda stage, fraction: report(stage, RELAXATION_SHARE * fraction),
                until=None if regularity == 1.0 else regularity * CLOSE_DISTANCE,
                cancel=cancel,
            )
        with reporting(
            lambda stage, fraction: report(stage, RELAXATION_SHARE + (1.0 - RELAXATION_SHARE) * fraction)
        ) as report_radii:
            report_radii("measuring radii", 0.0)
            decals = relaxation.decals_of(base, seed=seed, zones=placed)
            report_radii("measuring radii", 1.0)
    return decals


def check_regularity(regularity: float) -> None:
    """Raise `InvalidScattering` unless a regularity is a number from 0 to 1."""
    allowed_number(
        "regularity", regularity, "a number from 0 to 1", lambda value: 0.0 <= value <= 1.0, InvalidScattering
    )


def _projections(surfaces: Sequence[Surface]) -> list[wp.Kernel]:
    """Return the kernels that project points onto surfaces."""
    trees = [surface.tree for surface in surfaces if isinstance(surface, ImplicitSurface)]
    kernels = [tree.tape.instruction_set.kernel_for(project_with_mesh) for tree in trees]
    has_mesh = any(isinstance(surface, MeshSurface) for surface in surfaces)
    return [*kernels, closest_points] if has_mesh else kernels
