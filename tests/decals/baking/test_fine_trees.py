"""Meshes of trees below textures: their triangles lie within a part of a texel of the surface."""

from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from decals.baking.fine_trees import EXPECTED_USE, MAX_GAP, below_texture
from decals.baking.meshes import BakeMesh, bake_mesh
from tests.decals.baking.glb import Array

SIZE = 1024


def silent(*_: Any) -> None:
    """Report nothing."""


def fine_mesh(tree: Any, size: int = SIZE, *, creases: bool = False) -> tuple[BakeMesh, BakeMesh]:
    """The mesh of a tree, and the one below a texture."""
    item = decals.TreeObject("tree", tree)
    mesh = bake_mesh(item, resolution=24, creases=creases, report=silent)
    return mesh, below_texture([mesh], [item], size**2, silent)[0]


def edges(mesh: BakeMesh) -> tuple[Array, Array]:
    corners = mesh.vertices[mesh.faces].astype(float)
    return corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)


def open_edges(mesh: BakeMesh) -> int:
    """Count the edges, by position, that do not belong to two faces."""
    _, number = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corners = number.reshape(-1)[mesh.faces]
    sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return int((np.unique(sides, axis=0, return_counts=True)[1] != 2).sum())


@pytest.mark.parametrize("radius", [1.0, 0.01])
def test_triangles_of_a_ball_lie_within_a_part_of_a_texel(radius: float) -> None:
    coarse, fine = fine_mesh(blobtree.Point((0.0, 0.0, 0.0), radius=radius))
    texel = np.sqrt(4 * np.pi * radius**2 / (EXPECTED_USE * SIZE**2))

    def depths(mesh: BakeMesh) -> Array:
        starts, ends = edges(mesh)
        found: Array = (radius - np.linalg.norm(0.5 * (starts + ends), axis=1)) / texel
        return found

    assert depths(coarse).max() > 3 * MAX_GAP
    assert depths(fine).max() < 1.01 * MAX_GAP
    assert np.abs(np.linalg.norm(fine.vertices, axis=1) / radius - 1).max() < 1e-5
    assert np.abs(fine.normals - fine.vertices / radius).max() < 1e-3
    assert open_edges(fine) == 0


def test_small_textures_keep_the_mesh() -> None:
    coarse, fine = fine_mesh(blobtree.Point((0, 0, 0), radius=1.0), 16)
    assert np.array_equal(coarse.vertices, fine.vertices)
    assert np.array_equal(coarse.faces, fine.faces)


@pytest.mark.slow
@pytest.mark.parametrize("creases", [False, True])
def test_trees_with_creases_stay_closed_and_keep_the_normals_of_each_side(creases: bool) -> None:
    lens = blobtree.Point((0, 0, 0), radius=1.0) & blobtree.Point((1.0, 0, 0), radius=1.0)
    coarse, fine = fine_mesh(lens, creases=creases)
    assert len(fine.faces) > 2 * len(coarse.faces)
    assert open_edges(fine) == 0
    starts, ends = edges(fine)
    crosses = np.cross((ends - starts).reshape(-1, 3, 3)[:, 0], (ends - starts).reshape(-1, 3, 3)[:, 1])
    facing = np.einsum("na,nca->nc", crosses, fine.normals[fine.faces].astype(float))
    if creases:
        assert (facing > 0).all()
        left = np.linalg.norm(fine.vertices - [1, 0, 0], axis=1) - 1
        right = np.linalg.norm(fine.vertices, axis=1) - 1
        assert np.maximum(left, right).max() < 2e-3


def test_a_resolution_decides_the_mesh_alone(tmp_path: Any) -> None:
    pytest.importorskip("xatlas", reason="xatlas is not installed; it is in the extra `bake`")
    scene = decals.cover(blobtree.Point((0, 0, 0), radius=1.0), count=4)
    counts = {}
    for name, resolution in (("own", 16), ("by texels", None)):
        (check,) = decals.export(scene, tmp_path / "ball.obj", size=1024, samples=1, resolution=resolution)
        counts[name] = check.faces
    assert counts["own"] == len(
        blobtree.polygonize(blobtree.Point((0, 0, 0), radius=1.0), resolution=16).faces
    )
    assert counts["by texels"] > len(blobtree.polygonize(blobtree.Point((0, 0, 0), radius=1.0)).faces)
