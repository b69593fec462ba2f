"""Generated files are read as what they hold; the check notices a mesh that is another."""

import random
from pathlib import Path

import numpy as np
import pytest

from tests.structured.formats import FORMATS
from tests.structured.model import MisreadError, PolygonMesh, StructuredFile, check, random_mesh


@pytest.mark.parametrize("name", FORMATS)
def test_generated_files_are_read_right(name: str, tmp_path: Path) -> None:
    files = [FORMATS[name](random.Random(f"{name}:{number}")) for number in range(12)]
    assert any(file.mesh is None for file in files)
    assert any(file.mesh is not None for file in files)
    for file in files:
        check(file, tmp_path)


def test_a_case_follows_from_its_number() -> None:
    for make in FORMATS.values():
        assert make(random.Random("1")).content == make(random.Random("1")).content


@pytest.mark.parametrize("fault", ["face", "corner", "point", "refused"])
def test_a_misread_file_is_noticed(fault: str, tmp_path: Path) -> None:
    mesh = PolygonMesh(
        np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (5, 5, 5)], float), [[0, 1, 2, 3]]
    )
    faces = {"face": "3 0 1 2", "corner": "4 0 1 2 4", "point": "4 0 1 2 3", "refused": "4 0 1 2 9"}[fault]
    far = "2 0 0" if fault == "point" else "1 0 0"
    content = f"OFF\n5 1 0\n0 0 0\n{far}\n1 1 0\n0 1 0\n5 5 5\n{faces}\n".encode()
    with pytest.raises(MisreadError):
        check(StructuredFile(".off", content, mesh), tmp_path)


def test_random_meshes_have_flat_polygons() -> None:
    for seed in range(50):
        mesh = random_mesh(random.Random(seed))
        for polygon in mesh.polygons:
            loop = mesh.points[polygon] - mesh.points[polygon[0]]
            assert np.linalg.svd(loop)[1][2] < 1e-9 * np.abs(mesh.points).max()
