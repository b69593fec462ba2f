"""Sharp creases: a surface whose vertices lie on the edges and corners that CSG leaves.

Unions, intersections and differences have kinks, which a vertex in the middle of its patch cuts off. Here
every patch whose edge crossings lie on different smooth branches gives its vertex to the place where these
meet. What is connected with what does not change, so the mesh stays closed and manifold.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from blobtree.meshing.crease_kernels import SMOOTH, find_choices, place_on_creases, turn_diagonals
from blobtree.meshing.surface import Surface, tables
from blobtree.meshing.visible import Cells
from blobtree.progress import Progress
from blobtree.sparse.grid import CHILDREN


def sharpened(surface: Surface, report: Progress) -> tuple[Surface, NDArray[np.uint8]]:
    """`surface` with its vertices on creases, and how many smooth branches meet in each of them (n,).

    1 is a vertex of a smooth patch, 2 one on a crease, 3 or 4 one in a corner, 0 one whose patch touches
    several branches that were not found to meet nearby; that one stays where it was.
    """
    report("finding creases", 0.0)
    device, vocabulary = surface.cells.device, surface.cells.tape.vocabulary
    cells = cells_of(surface)
    count = len(surface.cells.leaves)
    choosing = wp.empty(count, dtype=wp.uint8, device=device)
    launch(vocabulary.kernel(find_choices), count, [cells.spans, cells.tape], [choosing], device)
    meetings = wp.full(len(surface.vertices), SMOOTH, dtype=wp.uint8, device=device)
    vertices, normals, colors, faces = (
        wp.clone(array) for array in (surface.vertices, surface.normals, surface.colors, surface.faces)
    )
    patches = tables(device)
    inputs = [cells, choosing, surface.rows, patches.patch_count, patches.patch_of_edge]
    inputs += [surface.offsets, surface.vertex_starts]
    outputs = [vertices, normals, colors, meetings]
    step = partial(report, "finding creases")
    launch(vocabulary.kernel(place_on_creases), count * CHILDREN, inputs, outputs, device, step=step)
    inputs = [cells, vertices, meetings]
    launch(vocabulary.kernel(turn_diagonals), len(faces) // 2, inputs, [faces], device)
    report("finding creases", 1.0)
    sharp = replace(surface, vertices=vertices, normals=normals, colors=colors, faces=faces)
    return sharp, meetings.numpy()


def cells_of(surface: Surface) -> Any:
    """What kernels need to know of a surface's cells."""
    cells: Any = Cells()
    leaves, grid = surface.cells.leaves, surface.cells.grid
    cells.blocks, cells.keys = leaves.blocks, leaves.keys
    cells.spans, cells.tape = leaves.spans, leaves.tape
    cells.base, cells.corner = wp.vec3i(*grid.base_of(grid.depth)), wp.vec3(*grid.corner)
    cells.cell = grid.cell_size
    cells.whole = surface.cells.tape.on(surface.cells.device).data
    return cells
