import sys

import numpy as np
import pytest

from decals import scatter
from decals.errors import InvalidScattering
from decals.scattering import remeshed_points
from decals.surfaces import MeshSurface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.sized_decals import nearest_facing


@pytest.mark.slow_cases("surface0", "surface2")
@pytest.mark.parametrize("surface", [sphere(), plane(), box()])
def test_remeshed_points_are_even(surface: MeshSurface) -> None:
    pytest.importorskip("pyacvd", reason="pyacvd is not installed")
    points = remeshed_points(surface, 300)
    assert len(points) == pytest.approx(300, rel=0.1)
    placed, normals = surface.project(points)
    assert np.abs(placed - points).max() < 1e-6
    nearest = nearest_facing(placed, normals)
    assert nearest.std() / nearest.mean() < 0.25
    decals = scatter(surface, count=len(points), fixed=points)
    assert np.sort(decals.positions, axis=0) == pytest.approx(np.sort(points, axis=0), abs=1e-6)


def test_missing_pyacvd_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyacvd", None)
    with pytest.raises(InvalidScattering, match=r"pip install 'implicit-decals\[remesh\]'"):
        remeshed_points(sphere(), 100)
    with pytest.raises(InvalidScattering, match="from 4"):
        remeshed_points(sphere(), 3)
