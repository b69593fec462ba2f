"""Regions of a mesh's faces or vertices as masks."""

from typing import Any

import numpy as np
import pytest

from decals import Relaxation
from decals.errors import InvalidScattering
from decals.scattering import region_mask
from tests.decals.meshes import box, sphere


def test_region_masks_of_faces_and_vertices() -> None:
    ball = sphere()
    middles = ball.vertices[ball.faces].mean(axis=1)
    relaxation = Relaxation(ball, count=200, mask=region_mask(ball, middles[:, 2] > 0.2), iterations=30)
    relaxation.run()
    assert (middles[ball.locate(relaxation.positions)[0], 2] > 0.2).all()
    # a zone of the unit ball is 2 pi times its height
    assert relaxation.domain.area == pytest.approx(2 * np.pi * 0.8, rel=0.05)
    mask = region_mask(ball, ball.vertices[:, 2] > 0.0)
    points, _ = ball.sample(4000, seed=1)
    certain = np.abs(points[:, 2]) > 0.1
    assert np.array_equal(mask(points)[certain], points[certain, 2] > 0)


@pytest.mark.parametrize(
    "wrong", [None, "x", [True], np.zeros(5), [[True]], 2.0 * np.ones(12), np.full(12, np.nan)]
)
def test_invalid_flags_raise(wrong: Any) -> None:
    with pytest.raises(InvalidScattering, match="flags: expected"):
        region_mask(box(), wrong)
    with pytest.raises(InvalidScattering, match="surface: expected a MeshSurface"):
        region_mask(wrong, [True])
