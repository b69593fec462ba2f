"""Meshes for display: a vertex on a crease in several copies, one with the normal of each side."""

import reprlib

import numpy as np
from numpy.typing import NDArray

from blobtree.errors import InvalidPoints
from blobtree.meshing.polygonize import Mesh
from blobtree.nodes.tree import Node, checked_tree

INWARD = 0.05
"""How far into a triangle, over the way to its middle, its side of a crease is looked at."""

SAME_SIDE = 0.985
"""Cosine, of 10°, from which two triangles' normals at a vertex count as one side's."""

Floats = NDArray[np.float32]


def split_creases(tree: Node, mesh: Mesh) -> Mesh:
    """`mesh`, made of `tree` with creases, with a vertex for each side of a crease.

    A renderer that blends normals over triangles then shows creases as edges. The sides share positions but
    no vertices any more, so the mesh is no longer closed.
    """
    checked_tree(tree)
    if not isinstance(mesh, Mesh):
        raise InvalidPoints(f"mesh: expected what polygonize() returns, got {reprlib.repr(mesh)}")
    if mesh.meetings is None:
        return mesh
    faces = mesh.faces.copy()
    corners = np.flatnonzero(mesh.meetings[mesh.faces.ravel()] != 1)
    vertices = mesh.faces.ravel()[corners]
    normals, colors = _seen_from(tree, mesh, corners)
    order = np.argsort(vertices, kind="stable")
    starts = np.flatnonzero(np.diff(vertices[order], prepend=-1))
    copies: list[int] = []
    new_normals, new_colors = mesh.normals.copy(), mesh.colors.copy()
    added: list[tuple[Floats, Floats]] = []
    for group in np.split(order, starts[1:]):
        for number, side in enumerate(_sides(normals[group])):
            members = group[side]
            normal = normals[members].sum(axis=0)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-30)
            color = colors[members].mean(axis=0)
            vertex = int(vertices[members[0]])
            if number == 0:
                new_normals[vertex], new_colors[vertex] = normal, color
            else:
                faces.ravel()[corners[members]] = len(mesh.vertices) + len(copies)
                copies.append(vertex)
                added.append((normal, color))
    return Mesh(
        np.concatenate([mesh.vertices, mesh.vertices[copies]]),
        faces,
        np.concatenate([new_normals, *(normal[None] for normal, _ in added)]).astype(np.float32),
        np.concatenate([new_colors, *(color[None] for _, color in added)]).astype(np.float32),
        np.concatenate([mesh.meetings, mesh.meetings[copies]]),
    )


def _seen_from(tree: Node, mesh: Mesh, corners: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Outward unit normals and colours (n, 3) a little inside the triangles, beside these corners."""
    middles = mesh.vertices[mesh.faces[corners // 3]].mean(axis=1)
    places = mesh.vertices[mesh.faces.ravel()[corners]]
    points = places + np.float32(INWARD) * (middles - places)
    gradients = -tree.gradient(points)
    lengths = np.linalg.norm(gradients, axis=1, keepdims=True)
    return gradients / np.maximum(lengths, np.float32(1e-30)), tree.colors(points)


def _sides(normals: Floats) -> list[NDArray[np.int64]]:
    """Rows of `normals` (n, 3) that belong together, each group around one of them."""
    sides: list[NDArray[np.int64]] = []
    left = np.arange(len(normals))
    while len(left):
        near = normals[left] @ normals[left[0]] >= SAME_SIDE
        near[0] = True
        sides.append(left[near])
        left = left[~near]
    return sides
