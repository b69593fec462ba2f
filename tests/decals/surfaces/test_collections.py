"""Public collections of test files, read beside trimesh; each difference stands in a table with its reason.

The collections are no part of the project. ``ASSIMP_MODELS`` names the folder ``test`` of a copy of assimp,
and ``TRIMESH_MODELS`` the folder ``models`` of one of trimesh::

    ASSIMP_MODELS=… TRIMESH_MODELS=… pytest -m slow tests/decals/surfaces/test_collections.py
"""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from decals.errors import InvalidMesh
from decals.surfaces import read_mesh
from tests.decals.surfaces.collections_table import ASSIMP, TRIMESH, Row

SUFFIXES = {".obj", ".ply", ".stl", ".off", ".gltf", ".glb", ".3mf", ".3ds", ".wrl", ".vtk", ".vtp", ".vtu"}
"""Suffixes of mesh files that the collections have and that are read."""

TOLERANCE = 1e-3
"""Relative difference of areas and bounds that counts as none."""

Summary = tuple[int, float, Any]
"""Number of triangles, their area, and the corners of the box around them."""

COLLECTIONS = {"ASSIMP_MODELS": ASSIMP, "TRIMESH_MODELS": TRIMESH}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of trimesh
@pytest.mark.parametrize("variable", COLLECTIONS)
def test_a_collection_is_read_as_trimesh_reads_it(variable: str) -> None:
    if variable not in os.environ:
        pytest.skip(f"{variable} names no folder with the collection")
    root = Path(os.environ[variable])
    files = [path for path in sorted(root.rglob("*")) if path.suffix.lower() in SUFFIXES and path.is_file()]
    assert files, f"no models below {root}"
    found = {path.relative_to(root).as_posix(): outcome(path) for path in files}
    table = {row.file: row for row in COLLECTIONS[variable]}
    wrong = {name: text for name, text in found.items() if not as_expected(text, table.get(name))}
    assert wrong == {}
    assert table.keys() <= found.keys(), "rows of files that the collection does not have"


def as_expected(text: str, row: Row | None) -> bool:
    """Return True for a file that is read as by trimesh, or as its row of the table says."""
    if row is None:
        return text == ""
    return text.startswith("differs") if row.refusal is None else row.refusal in text


def outcome(path: Path) -> str:
    """Return the reason of a refusal, a difference, or nothing for a file that trimesh reads alike or not."""
    try:
        vertices, faces = read_mesh(path)
    except InvalidMesh as error:
        return f"refused: {error}"
    ours, theirs = summary(vertices, faces), by_trimesh(path)
    if theirs is None:
        return ""
    size = np.linalg.norm(np.subtract(*theirs[2]))
    alike = ours[0] == theirs[0] and abs(ours[1] - theirs[1]) <= TOLERANCE * theirs[1]
    alike = alike and bool(np.abs(ours[2] - theirs[2]).max() <= TOLERANCE * size)
    return "" if alike else f"differs: {ours}, {theirs} by trimesh"


def summary(vertices: Any, faces: Any) -> Summary:
    corners = np.asarray(vertices, np.float64)[faces]
    a, b, c = np.moveaxis(corners, 1, 0)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    return len(faces), area, np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])


def by_trimesh(path: Path) -> Summary | None:
    """Return what trimesh reads; None where it cannot read the file, or finds no faces."""
    trimesh = pytest.importorskip("trimesh")
    try:
        mesh = trimesh.load(path, process=False, force="mesh")
        return summary(mesh.vertices, mesh.faces) if len(mesh.faces) else None
    except Exception:  # readers raise all sorts of exceptions
        return None
