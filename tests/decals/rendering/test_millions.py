"""A million decals on the card, and a million on one point: every pixel against float64."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from decals import Camera, Contact, Decals
from decals.errors import TooMuchData
from decals.rendering import Buffers, Renderer, RenderOptions
from tests.decals.shapes import Shape, View, torus
from tests.oracles.decals import decals_at

MILLION = 1_000_000
SIZE = (160, 120)
TIE = 1e-4
PAPER = RenderOptions(size=(24, 18), contact=Contact.PRODUCT)
"""Decals on one point push each other in the paper's contact alone."""


def random_decals(count: int, seed: int, *, spread: float) -> tuple[Shape, Decals]:
    """Decals all over a torus, each covered by others, of sizes that differ by up to 10^±spread."""
    shape, rng = torus(rows=300, columns=150), np.random.default_rng(seed)
    corners = shape.vertices.astype(np.float64)[shape.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    radius = np.sqrt(2.5 * areas.sum() / 2 / (np.pi * count))
    arrays: dict[str, Any] = {
        "positions": np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners[face]),
        "normals": normals[face],
        "tangents": np.cross(normals[face], rng.normal(size=(count, 3))),
        "radii": radius * 10.0 ** rng.uniform(-spread, spread, count),
    }
    return shape, Decals(**arrays)


def check_pixels(buffers: Buffers, decals: Decals, pixels: int, seed: int) -> None:
    """Some of the pixels by brute force over all decals that come near any of them."""
    rows = np.random.default_rng(seed).choice(np.flatnonzero(buffers.object_id >= 0), pixels, replace=False)
    points, normals = buffers.position.reshape(-1, 3)[rows], buffers.normal.reshape(-1, 3)[rows]
    reach = float(decals.influence.max())
    near = np.unique(np.concatenate(cKDTree(decals.positions).query_ball_point(points, reach))).astype(int)
    want = decals_at(decals[near], points, normals)
    clear = want.doubt > TIE
    owner = np.where(want.owner >= 0, np.append(near, -1)[want.owner], -1)
    found = buffers.owner.reshape(-1)[rows]
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(found[clear], owner[clear])
    both = clear & (owner >= 0) & (want.stretch < 20)
    assert both.sum() > 0.5 * pixels
    uv = buffers.uv.reshape(-1, 2)[rows]
    np.testing.assert_allclose(uv[both], want.uv[both], atol=1e-3)


def camera_of(shape: Shape) -> Camera:
    return Camera.fitting(shape.vertices, direction=(0.5, -0.9, 0.8), up=(0, 0, 1))


@pytest.mark.slow_cases("0.3-thousands")
@pytest.mark.parametrize(
    "count", [30_000, pytest.param(MILLION, marks=pytest.mark.slow)], ids=["thousands", "a million"]
)
@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_decals_by_the_million(renderer: Renderer, count: int, spread: float) -> None:
    shape, decals = random_decals(count, 1, spread=spread)
    buffers = renderer.buffers(View((shape,), camera_of(shape), decals), RenderOptions(size=SIZE))
    check_pixels(buffers, decals, 300, 2)


def one_point(count: int) -> View:
    """Equal decals, all on one point of a torus."""
    shape = torus()
    spot: dict[str, Any] = {
        "positions": np.tile([0, -1.4, 0], (count, 1)),
        "normals": np.tile([0, -1, 0], (count, 1)),
        "tangents": np.tile([1, 0, 0], (count, 1)),
        "radii": np.full(count, 0.15),
    }
    camera = Camera.fitting(shape.vertices, direction=(0, -1, 0.2), up=(0, 0, 1))
    return View((shape,), camera, Decals(**spot))


def check_one_point(buffers: Buffers) -> None:
    """The first owns every pixel of their rim, and shows its rim, pushed by all the others."""
    distance = np.linalg.norm(buffers.position - [0, -1.4, 0], axis=-1)
    clear = (buffers.object_id >= 0) & (np.abs(distance / 0.15 - 1) > TIE)
    inside = clear & (distance < 0.15)
    assert inside.sum() > 3
    np.testing.assert_array_equal(buffers.owner[clear], np.where(inside, 0, -1)[clear])
    np.testing.assert_allclose(buffers.field[inside], 0.5, atol=1e-6)


def test_thousands_on_one_point(renderer: Renderer) -> None:
    check_one_point(renderer.buffers(one_point(3_000), PAPER))


def test_a_million_on_one_point(renderer: Renderer) -> None:
    """Right, or, where the driver would end the loop before its end, refused; then all is as it was."""
    if renderer.context.max_loop_iterations is None:
        check_one_point(renderer.buffers(one_point(MILLION), PAPER))
        return
    with pytest.raises(TooMuchData, match=r"1,000,000 decals reach the same place; expected at most 8,191"):
        renderer.buffers(one_point(MILLION), PAPER)
    check_one_point(renderer.buffers(one_point(3), PAPER))
