"""Sharp creases: vertices on the edges and corners that CSG leaves, and meshes split there for display.

Unions, intersections and differences have kinks, which a vertex in the middle of its patch cuts off. If the
edge crossings of a patch lie on different smooth branches of the field, `sharpened` moves its vertex to where
these meet. The connectivity does not change, so the mesh stays closed and manifold.
"""

import reprlib
from dataclasses import replace
from functools import partial

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, IndexArray
from blobtree.cells.grid import CHILDREN
from blobtree.device import launch
from blobtree.errors import InvalidPoints
from blobtree.meshing.mesh import DeviceMesh, Mesh, patch_tables, vertex_arrays
from blobtree.meshing.polygonizer import SHARPENERS
from blobtree.progress import Progress
from blobtree.tape.model import ImplicitModel, checked_tree

INWARD_FRACTION = 0.05
"""Fraction of the way from a corner to the middle of its triangle at which the side's normal is taken."""

MIN_SIDE_COSINE = 0.985
"""Cosine (of 10°) between the normals of two triangles at a vertex from which they are on one side."""


def sharpened(mesh: DeviceMesh, report: Progress) -> tuple[DeviceMesh, NDArray[np.uint8]]:
    """Return `mesh` with vertices on creases, and the number of smooth sheets that meet in each (n,).

    The number is 1 on a smooth part, 2 on a crease, 3 or 4 in a corner. It is 0 if the sheets of a patch do
    not meet nearby; the vertex then keeps its position. A tree with operators that read gradients has no
    creases here: its branches are not followed.
    """
    if mesh.cells.tape.instruction_set.reads_gradients:
        return mesh, np.ones(len(mesh.vertices), np.uint8)
    from blobtree.meshing.crease_kernels import (  # imported here: most meshes need none
        SMOOTH_VERTEX,
        find_choices,
        move_onto_creases,
        turn_diagonals,
    )

    report("finding creases", 0.0)
    cells, device, kernel = mesh.cells.arrays, mesh.cells.device, mesh.cells.tape.instruction_set.kernel_for
    count = len(mesh.cells.leaves)
    choosing = wp.empty(count, dtype=wp.uint8, device=device)
    launch(kernel(find_choices), count, [cells.spans, cells.tape], [choosing], device)
    sheet_counts = wp.full(len(mesh.vertices), SMOOTH_VERTEX, dtype=wp.uint8, device=device)
    vertices, normals, colors, faces = (
        wp.clone(array) for array in (mesh.vertices, mesh.normals, mesh.colors, mesh.faces)
    )
    inputs = [cells, choosing, mesh.patches, patch_tables(device).patch_count]
    outputs = [vertex_arrays(vertices, normals, colors), sheet_counts]
    step = partial(report, "finding creases")
    launch(kernel(move_onto_creases), count * CHILDREN, inputs, outputs, device, step=step)
    inputs = [cells, vertices, sheet_counts]
    launch(kernel(turn_diagonals), len(faces) // 2, inputs, [faces], device)
    report("finding creases", 1.0)
    sharp = replace(mesh, vertices=vertices, normals=normals, colors=colors, faces=faces)
    return sharp, sheet_counts.numpy()


def _kernel() -> wp.Kernel:
    from blobtree.meshing.crease_kernels import move_onto_creases  # imported here: most meshes need none

    kernel: wp.Kernel = move_onto_creases
    return kernel


SHARPENERS.append((_kernel, sharpened))


def split_creases(tree: ImplicitModel, mesh: Mesh) -> Mesh:
    """Return `mesh` with one copy of each vertex on a crease for each side of the crease.

    A renderer that interpolates normals over triangles then shows creases as edges. The sides share positions
    but no vertices, so the mesh is no longer closed.

    Parameters
    ----------
    tree : Node
        The model of the mesh.
    mesh : Mesh
        A mesh from ``polygonize(tree, creases=True)``. A mesh without creases is returned as it is.

    Returns
    -------
    Mesh
        The same triangles. Each copy has the normal and the colour of its side.

    Raises
    ------
    InvalidNode
        `tree` is not a model.
    InvalidPoints
        `mesh` is not a `Mesh`.

    Examples
    --------
    >>> from blobtree import Point, polygonize, split_creases
    >>> lens = Point((0, 0, 0), radius=1.0) & Point((1, 0, 0), radius=1.0)
    >>> mesh = polygonize(lens, resolution=16, creases=True)
    >>> split = split_creases(lens, mesh)
    >>> len(split.faces) == len(mesh.faces), len(split.vertices) > len(mesh.vertices)
    (True, True)
    """
    checked_tree(tree)
    if not isinstance(mesh, Mesh):
        raise InvalidPoints(
            f"mesh: expected a Mesh, got {reprlib.repr(mesh)}; pass the result of polygonize()"
        )
    if mesh.sheet_counts is None:
        return mesh
    faces = mesh.faces.copy()
    corners = np.flatnonzero(mesh.sheet_counts[mesh.faces.ravel()] != 1)
    vertices = mesh.faces.ravel()[corners]
    side_normals, side_colors = _at_corners(tree, mesh, corners)
    normals, colors = mesh.normals.copy(), mesh.colors.copy()
    copies: list[int] = []
    added: list[tuple[Float32Array, Float32Array]] = []
    for group in _equal_groups(vertices):
        for number, side in enumerate(_sides(side_normals[group])):
            members = group[side]
            normal = side_normals[members].sum(axis=0)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-30)
            color = side_colors[members].mean(axis=0)
            vertex = int(vertices[members[0]])
            if number == 0:
                normals[vertex], colors[vertex] = normal, color
            else:
                faces.ravel()[corners[members]] = len(mesh.vertices) + len(copies)
                copies.append(vertex)
                added.append((normal, color))
    return Mesh(
        np.concatenate([mesh.vertices, mesh.vertices[copies]]),
        faces,
        np.concatenate([normals, *(normal[None] for normal, _ in added)]).astype(np.float32),
        np.concatenate([colors, *(color[None] for _, color in added)]).astype(np.float32),
        np.concatenate([mesh.sheet_counts, mesh.sheet_counts[copies]]),
    )


def _at_corners(tree: ImplicitModel, mesh: Mesh, corners: IndexArray) -> tuple[Float32Array, Float32Array]:
    """Return outward unit normals and colours (n, 3) a little inside the triangles at `corners` of faces."""
    middles = mesh.vertices[mesh.faces[corners // 3]].mean(axis=1)
    positions = mesh.vertices[mesh.faces.ravel()[corners]]
    points = positions + np.float32(INWARD_FRACTION) * (middles - positions)
    gradients = -tree.gradient(points)
    lengths = np.linalg.norm(gradients, axis=1, keepdims=True)
    return gradients / np.maximum(lengths, np.float32(1e-30)), tree.colors(points)


def _equal_groups(numbers: NDArray[np.int32]) -> list[IndexArray]:
    """Return the indices of equal `numbers` (n,), a group for each number in ascending order."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
    return np.split(order, starts[1:])


def _sides(normals: Float32Array) -> list[IndexArray]:
    """Return the rows of `normals` (n, 3) that point in similar directions, a group for each side."""
    sides: list[IndexArray] = []
    remaining = np.arange(len(normals))
    while len(remaining):
        near = normals[remaining] @ normals[remaining[0]] >= MIN_SIDE_COSINE
        near[0] = True
        sides.append(remaining[near])
        remaining = remaining[~near]
    return sides
