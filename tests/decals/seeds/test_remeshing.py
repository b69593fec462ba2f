import sys

import numpy as np
import pytest

from decals.coat.seeding import seed
from decals.errors import InvalidSeeding
from decals.seeds.remeshing import remeshed_points
from tests.decals.meshes import box, plane, sphere
from tests.oracles.coats import nearest_facing


@pytest.mark.parametrize("surface", [sphere(), plane(), box()])
def test_vertices_of_a_remesh_lie_on_the_mesh_about_evenly(surface):
    pytest.importorskip("pyacvd", reason="pyacvd is not installed")
    points = remeshed_points(surface, 300)
    assert len(points) == pytest.approx(300, rel=0.1)
    placed, normals = surface.project(points)
    assert np.abs(placed - points).max() < 1e-6
    nearest = nearest_facing(placed, normals)
    assert nearest.std() / nearest.mean() < 0.25
    decals = seed(surface, count=len(points), fixed=points)
    assert np.sort(decals.positions, axis=0) == pytest.approx(np.sort(points, axis=0), abs=1e-6)


def test_without_pyacvd_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyacvd", None)
    with pytest.raises(InvalidSeeding, match=r"pip install 'implicit-decals\[remesh\]'"):
        remeshed_points(sphere(), 100)
    with pytest.raises(InvalidSeeding, match="at least 4"):
        remeshed_points(sphere(), 3)
