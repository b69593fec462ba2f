"""Fields and signed distances on grids against float64 formulas, and their files read by other libraries."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray

from blobtree import Box, Node, Point, Segment, Torus, field_grid
from blobtree.errors import ImplicitDecalsError, InvalidNode
from blobtree.sampling import FieldGrid
from tests.blobtree.trees import random_tree, triple
from tests.oracles.blobtree import value

Array = NDArray[Any]

APART = Point((0, 0, 0), radius=1.0) & Point((9, 9, 9), radius=1.0)
"""A tree without surface."""


def rows_of(grid: FieldGrid) -> Array:
    """The points of a grid, in the order of its values."""
    axes = [grid.origin[k] + grid.spacing * np.arange(count) for k, count in enumerate(grid.values.shape)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def ball(points: Array, radius: float = 1.0) -> Array:
    distances: Array = np.linalg.norm(points, axis=1) - radius
    return distances


def ring(points: Array) -> Array:
    distances: Array = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1.0, points[:, 2]) - 0.3
    return distances


def capsule(points: Array) -> Array:
    along = np.clip(points[:, :1], 0.0, 2.0) * [1.0, 0.0, 0.0]
    return ball(points - along, 0.5)


def brick(points: Array) -> Array:
    beyond = np.abs(points) - [1.0, 0.5, 0.5]
    outside: Array = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    distances: Array = outside + np.minimum(beyond.max(axis=1), 0.0) - 0.2
    return distances


def lens(points: Array) -> Array:
    """Two balls of radius 1 around (±½, 0, 0), intersected: an edge of radius √¾ in the plane x = 0."""
    x, r = np.abs(points[:, 0]), np.hypot(points[:, 1], points[:, 2])
    edge = np.hypot(x, r - np.sqrt(0.75))
    before_cap = np.arctan2(r, x + 0.5) <= np.arctan2(np.sqrt(0.75), 0.5)
    cap = np.where(before_cap, np.abs(np.hypot(x + 0.5, r) - 1.0), np.inf)
    inside = np.hypot(x + 0.5, r) < 1.0
    distances: Array = np.where(inside, -1.0, 1.0) * np.minimum(cap, edge)
    return distances


EXACT: dict[str, tuple[Node, Callable[[Array], Array]]] = {
    "ball": (Point((0, 0, 0), radius=1.0), ball),
    "ring": (Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.3), ring),
    "capsule": (Segment((0, 0, 0), (2, 0, 0), radius=0.5), capsule),
    "brick": (Box((0, 0, 0), (2, 1, 1), radius=0.2), brick),
    "lens": (Point((0.5, 0, 0), radius=1.0) & Point((-0.5, 0, 0), radius=1.0), lens),
    "two": (
        Point((0, 0, 0), radius=1.0) | Point((3, 0, 0), radius=0.5),
        lambda points: np.minimum(ball(points), ball(points - [3.0, 0, 0], 0.5)),
    ),
}
"""Trees whose exact distances are known."""


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize(
    "resolution", [16, pytest.param(40, marks=pytest.mark.slow), pytest.param(64, marks=pytest.mark.slow)]
)
def test_distances_differ_from_exact_ones_by_the_stated_error_at_most(name: str, resolution: int) -> None:
    tree, exact = EXACT[name]
    grid = field_grid(tree, resolution=resolution, distance=True)
    assert grid.error is not None
    off = np.abs(grid.values.reshape(-1) - exact(rows_of(grid)))
    rounding = 1e-6 * grid.spacing * resolution
    assert off.max() <= grid.error + rounding
    assert grid.error < 3.0 * off.max() + rounding  # it is no empty promise
    assert grid.error < grid.spacing


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(25))
def test_the_error_of_balls_in_any_place_and_size(seed: int) -> None:
    rng = np.random.default_rng(seed)
    center, radius = rng.uniform(-5, 5, 3), float(10 ** rng.uniform(-2, 2))
    center *= radius
    grid = field_grid(
        Point(triple(center), radius=radius), resolution=int(rng.integers(8, 70)), distance=True
    )
    assert grid.error is not None
    off = np.abs(grid.values.reshape(-1) - ball(rows_of(grid) - center, radius))
    assert off.max() <= grid.error + 1e-5 * radius


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(n, marks=pytest.mark.slow) for n in range(2, 12))])
def test_fields_are_those_of_the_tree(seed: int) -> None:
    tree = random_tree(np.random.default_rng(seed))
    grid = field_grid(tree, resolution=9)
    want = value(tree, rows_of(grid))
    np.testing.assert_allclose(grid.values.reshape(-1), want, atol=2e-4)
    lower, upper = tree.support
    np.testing.assert_array_less(rows_of(grid)[0], lower + 1e-6 * grid.spacing * 10 + 1e-6)
    np.testing.assert_array_less(upper - 1e-6 * grid.spacing * 10 - 1e-6, rows_of(grid)[-1])


@pytest.fixture(scope="module", params=[False, True], ids=["field", "distance"])
def grid(request: pytest.FixtureRequest) -> FieldGrid:
    """A grid with three different numbers of points."""
    return field_grid(Segment((1, 2, 3), (3, 2.5, 3), radius=0.5), spacing=0.37, distance=request.param)


def test_vti_files(grid: FieldGrid, tmp_path: Path) -> None:
    grid.save(tmp_path / "ü.vti")
    read: Any = pv.read(tmp_path / "ü.vti")
    assert read.dimensions == grid.values.shape
    assert len(set(grid.values.shape)) > 1
    np.testing.assert_array_equal(read.point_data[grid.name].reshape(read.dimensions, order="F"), grid.values)
    order = np.arange(grid.values.size).reshape(grid.values.shape).ravel(order="F")
    np.testing.assert_allclose(read.points, rows_of(grid)[order], atol=1e-6)
    assert ("error" in read.field_data) == (grid.error is not None)
    assert read.field_data.get("error", [0.0])[0] == (grid.error or 0.0)


def test_nrrd_files(grid: FieldGrid, tmp_path: Path) -> None:
    grid.save(tmp_path / "a.nrrd")
    read: Any = pv.read(tmp_path / "a.nrrd")  # VTK's reader
    assert read.dimensions == grid.values.shape
    np.testing.assert_allclose(read.spacing, 3 * [grid.spacing], rtol=1e-12)
    np.testing.assert_allclose(read.origin, grid.origin, rtol=1e-12)
    (name,) = read.point_data.keys()
    np.testing.assert_array_equal(read.point_data[name].reshape(read.dimensions, order="F"), grid.values)
    header, _, packed = (tmp_path / "a.nrrd").read_bytes().partition(b"\n\n")
    numbers = np.frombuffer(gzip.decompress(packed), "<f4").reshape(grid.values.shape, order="F")
    np.testing.assert_array_equal(numbers, grid.values)
    errors = [float(line[7:]) for line in header.decode().splitlines() if line.startswith("error:=")]
    assert errors == ([] if grid.error is None else [grid.error])


def test_numpy_files(grid: FieldGrid, tmp_path: Path) -> None:
    grid.save(tmp_path / "a.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), grid.values)
    grid.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as read:
        np.testing.assert_array_equal(read["values"], grid.values)
        assert read["origin"].tolist() == list(grid.origin)
        assert float(read["spacing"]) == grid.spacing
        assert ("error" in read) == (grid.error is not None)


def test_large_grids_are_computed_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    from blobtree.sampling import field_grid as module

    tree = Point((0, 0, 0), radius=1.0)
    whole = [field_grid(tree, resolution=20, distance=distance) for distance in (False, True)]
    monkeypatch.setattr(module, "BLOCK_POINTS", 900)
    parts = [field_grid(tree, resolution=20, distance=distance) for distance in (False, True)]
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"tree": 7}, "expected a"),
        ({"resolution": 0}, "resolution: expected a whole number from 1 to 67,108,864, got 0"),
        ({"resolution": 2.5}, "resolution"),
        ({"resolution": True}, "resolution"),
        ({"resolution": 10**400}, "resolution"),
        ({"spacing": -1.0}, "spacing"),
        ({"spacing": float("nan")}, "spacing"),
        ({"spacing": 1e-9}, "grid points"),
        ({"resolution": 8, "spacing": 0.1}, "got both"),
        ({"distance": 1}, "distance"),
        ({"tree": APART, "distance": True}, "expected a surface"),
    ],
    ids=str,
)
def test_refuses(options: dict[str, Any], says: str) -> None:
    arguments: dict[str, Any] = {"tree": Point((0, 0, 0), radius=1.0)} | options
    with pytest.raises(ImplicitDecalsError, match=says):
        field_grid(arguments.pop("tree"), **arguments)


def test_other_suffixes_and_cancelled_work(tmp_path: Path) -> None:
    tree = Point((0, 0, 0), radius=1.0)
    with pytest.raises(ImplicitDecalsError, match=r"ends in .vti or .nrrd or .npz or .npy, got '.*a.raw'"):
        field_grid(tree, resolution=4).save(tmp_path / "a.raw")
    with pytest.raises(ImplicitDecalsError, match="path: expected the path of a file, got 5"):
        field_grid(tree, resolution=4).save(5)  # type: ignore[arg-type]
    with pytest.raises(ImplicitDecalsError, match=r"[Cc]ancel"):
        field_grid(tree, resolution=4, cancel=lambda: True)
    assert list(tmp_path.iterdir()) == []
    assert issubclass(InvalidNode, ImplicitDecalsError)
