"""`polygonize_batch`: the meshes of many trees, in few launches where a loop would starve a device."""

from collections.abc import Hashable, Iterable, Sequence
from itertools import pairwise

import numpy as np

from blobtree._typing import IndexArray
from blobtree.cells.grid import BRANCHING, Grid
from blobtree.cells.joint_cells import build_joint_cells, model_starts
from blobtree.cells.surface_box import longest_side, surface_box
from blobtree.device import known_device
from blobtree.joint_work import checked_trees, is_small, of_tree, work_together
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.meshing.mesh import DeviceMesh, Mesh, bridging_faces, download, extract_mesh
from blobtree.meshing.polygonize import polygonize
from blobtree.meshing.polygonizer import DEFAULT_RESOLUTION, cell_size_of, grid_around, load_kernels
from blobtree.meshing.thin_parts import shows_thin_parts
from blobtree.meshing.vertex_kernels import place_vertices
from blobtree.progress import Cancel, Progress, reporting
from blobtree.tape.model import ImplicitModel

MAX_JOINT_BLOCKS = 1 << 18
"""Most blocks of cells that are meshed at once; they take about a gigabyte."""

SURFACE_BLOCKS = 6
"""Blocks that a surface crosses, over the squared number of blocks along its box."""


def polygonize_batch(
    trees: Iterable[ImplicitModel],
    *,
    resolution: int | None = None,
    cell_size: float | None = None,
    device: str | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> list[Mesh]:
    """Return the surfaces of many trees, each as `polygonize` returns it for this tree alone.

    Trees of the same kinds of nodes are meshed together, in few launches. On a graphics card that is much
    faster than a loop over small trees. On a processor the results equal those of a loop bit for bit. Trees
    with thin parts, narrow gaps or very many primitives are meshed alone.

    Parameters
    ----------
    trees : iterable of Node
        k models, in any order.
    resolution, cell_size, device, progress, cancel
        See `polygonize`; they hold for all trees. For meshes by chord error or with creases, use a loop.

    Returns
    -------
    list of Mesh
        The mesh of each tree; without vertices where a tree has no surface.

    Raises
    ------
    InvalidNode
        An item of `trees` is not a model.
    InvalidDevice, InvalidResolution, Cancelled
        As for `polygonize`.

    See Also
    --------
    polygonize : one tree.
    raycast_batch : rays through many trees.

    Examples
    --------
    >>> from blobtree import Point, polygonize, polygonize_batch
    >>> trees = [Point((0, 0, 0), radius=1) + Point((x, 0, 0), radius=0.5) for x in (0.5, 1.0, 1.5)]
    >>> meshes = polygonize_batch(trees, resolution=16)
    >>> meshes == [polygonize(tree, resolution=16) for tree in trees]
    True
    """
    models = checked_trees(trees)
    device = known_device(device)
    sizes, grids = [], []
    for number, tree in enumerate(models):
        with of_tree(number):
            sizes.append(cell_size_of(tree, resolution, cell_size, device))
            grids.append(grid_around(tree, sizes[-1], device))
    thin_matters = resolution is None and cell_size is None

    def kind(tree: ImplicitModel, grid: Grid) -> Hashable | None:
        if not is_small(tree) or (thin_matters and shows_thin_parts(tree, DEFAULT_RESOLUTION, device)):
            return None
        return id(tree.tape.instruction_set), grid.depth

    with reporting(progress, cancel) as report:

        def single(number: int) -> Mesh:
            return polygonize(
                models[number], resolution=resolution, cell_size=cell_size, device=device, progress=report
            )

        def joint(numbers: list[int]) -> list[Mesh]:
            chosen = [models[n] for n in numbers], [grids[n] for n in numbers]
            meshes, faces, mesh = _joint_meshes(*chosen, device, report)
            if thin_matters:
                for row in np.unique(np.searchsorted(faces, bridging_faces(mesh), side="right") - 1).tolist():
                    meshes[row] = single(numbers[row])
            return meshes

        kinds = list(map(kind, models, grids))
        blocks = list(map(_expected_blocks, models, sizes))
        return work_together(kinds, blocks, MAX_JOINT_BLOCKS, joint, single)


def _expected_blocks(tree: ImplicitModel, cell_size: float) -> float:
    """Return about as many blocks as the surface crosses, or more."""
    along = longest_side(surface_box(tree)) / (cell_size * BRANCHING) + 1.0
    return SURFACE_BLOCKS * along**2


def _joint_meshes(
    models: Sequence[ImplicitModel], grids: Sequence[Grid], device: str, report: Progress
) -> tuple[list[Mesh], IndexArray, DeviceMesh]:
    """Return the meshes of models with one instruction set and one depth; their first faces in one mesh."""
    load_kernels(models[0], device, False, sample_blocks, place_vertices)
    cells = build_joint_cells(models, grids, device, report)
    mesh = extract_mesh(cells, report)
    blocks = model_starts(cells)
    vertices = mesh.vertex_starts.numpy()[blocks]
    faces = 2 * mesh.quad_starts.numpy()[blocks]
    whole = download(mesh)
    own = whole.faces - np.repeat(vertices[:-1], np.diff(faces))[:, None]
    ends = zip(pairwise(vertices.tolist()), pairwise(faces.tolist()), strict=True)
    meshes = [
        Mesh(whole.vertices[v:w], own[f:g], whole.normals[v:w], whole.colors[v:w]) for (v, w), (f, g) in ends
    ]
    return meshes, faces, mesh
