"""Vertices lie on the surface even in cells that are far wider than the parts."""

from collections import Counter

import numpy as np
import pytest

from blobtree import ISO, Node, Point, Polygonizer, Segment, Sum, Union, polygonize

OFF = 1e-3
"""Field error of a vertex that does not lie on the surface."""


def crumbs(seed: int) -> Node:
    """Small parts all over a box."""
    rng = np.random.default_rng(seed)
    radius = float(rng.uniform(0.02, 0.15))
    parts: list[Node] = []
    for place in rng.uniform(-1, 1, (int(rng.integers(5, 80)), 3)):
        end = place + rng.normal(0, 0.3, 3)
        parts.append(
            Point(place, radius=radius) if rng.random() < 0.6 else Segment(place, end, radius=radius / 2)
        )
    if seed % 3 == 0:
        return Sum(tuple(parts))
    return Union(tuple(parts)) if seed % 3 == 1 else Sum(tuple(parts)) - Point((0, 0, 0), radius=0.5)


def test_vertices_in_wide_cells_lie_on_the_surface() -> None:
    gaps, normals = [], []
    for seed in range(24):
        tree = crumbs(seed)
        for resolution in (5, 8, 12):
            mesh = polygonize(tree, resolution=resolution)
            gaps.append(np.abs(tree(mesh.vertices) - ISO))
            normals.append(np.linalg.norm(mesh.normals, axis=1))
    every = np.concatenate(gaps)
    assert len(every) > 3000
    assert (every > OFF).mean() < 1e-3
    assert every.max() < 0.1
    assert np.concatenate(normals) == pytest.approx(1.0, abs=1e-4)


def test_meshes_of_wide_cells_are_closed_with_vertices_near_their_cells() -> None:
    for seed in range(4, 10):
        polygonizer = Polygonizer(crumbs(seed), resolution=12)
        mesh = polygonizer.mesh
        edges = Counter(
            (int(a), int(b)) for face in mesh.faces for a, b in zip(face, np.roll(face, -1), strict=True)
        )
        assert all(edges[b, a] == count for (a, b), count in edges.items())
        corners = mesh.vertices[mesh.faces]
        assert len(mesh.faces)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        # neighbours lie in cells that share a face or an edge, and no farther than one cell from there
        assert sides.max() < (2 * np.sqrt(3) + 2) * polygonizer.cell_size


def test_an_edit_in_wide_cells_matches_a_new_mesh() -> None:
    before, after = crumbs(3), crumbs(3) + Point((0.4, 0.4, 0.4), radius=0.05)
    polygonizer = Polygonizer(before, resolution=6)
    again = polygonizer.update(after)
    fresh = Polygonizer(after, cell_size=polygonizer.cell_size).mesh
    assert np.array_equal(again.vertices, fresh.vertices)
    assert np.array_equal(again.faces, fresh.faces)
    assert np.array_equal(again.normals, fresh.normals)
