"""Trees as pyvista objects: meshes with normals and colours, slices whose lines lie on their levels."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from blobtree import Node, Point, polygonize
from blobtree.errors import InvalidFile, InvalidNode, InvalidPoints, InvalidResolution, MissingPackage
from tests.blobtree.trees import random_trees
from tests.programs import output_of

A = Point((0, 0, 0), radius=1.0, color=(1, 0.5, 0))
B = Point((0.8, 0.13, 0.07), radius=0.9)


def test_the_package_does_not_import_pyvista() -> None:
    program = "import sys, blobtree; assert not {'pyvista', 'vtkmodules', 'moderngl'} & set(sys.modules)"
    output_of(program)


def test_without_pyvista_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    for attempt in (A.slice, lambda: A.to_pyvista(resolution=8)):
        with pytest.raises(MissingPackage, match="pip install pyvista"):
            attempt()
    assert issubclass(MissingPackage, ImportError)


def test_a_mesh_is_what_polygonize_gives() -> None:
    ours, mesh = polygonize(A, resolution=24), A.to_pyvista(resolution=24)
    assert isinstance(mesh, pv.PolyData)
    np.testing.assert_array_equal(mesh.points, ours.vertices)
    np.testing.assert_array_equal(mesh.regular_faces, ours.faces)
    np.testing.assert_array_equal(mesh.point_data.active_normals, ours.normals)
    np.testing.assert_array_equal(mesh["RGB"], np.tile(np.array([255, 128, 0], np.uint8), (mesh.n_points, 1)))
    assert mesh.is_manifold
    assert "sheet_counts" not in mesh.point_data
    assert A.to_pyvista(cell_size=0.2).n_points < A.to_pyvista(chord_error=1e-3).n_points


def test_a_mesh_with_creases_and_one_whose_normals_are_split() -> None:
    tree = A & B
    closed, split = (
        tree.to_pyvista(resolution=24, creases=True),
        tree.to_pyvista(resolution=24, split_normals=True),
    )
    assert closed.is_manifold
    assert (closed["sheet_counts"] == 2).sum() > 20
    assert split.n_points > closed.n_points
    assert split.n_open_edges > 20


def test_an_empty_tree_makes_an_empty_mesh() -> None:
    assert (A & A.translate((10, 0, 0))).to_pyvista(resolution=8, creases=True).n_points == 0


# -- slices ---------------------------------------------------------------------------------------------


def part_of(cut: pv.MultiBlock, name: str) -> pv.PolyData:
    """Return a block of a slice."""
    block = cut[name]
    assert isinstance(block, pv.PolyData)
    return block


def test_a_slice_through_a_ball_is_circles() -> None:
    cut = A.slice((0, 0, 0.5), resolution=64)
    assert list(cut.keys()) == ["plane", "lines", "surface"]
    plane, lines, surface = (part_of(cut, name) for name in ("plane", "lines", "surface"))
    np.testing.assert_allclose(plane.points[:, 2], 0.5)
    radii = np.linalg.norm(surface.points, axis=1)
    np.testing.assert_allclose(radii, 1.0, atol=2e-6)
    assert surface.n_points > 60
    for level in (0.2, 0.5, 0.7):
        points = lines.points[np.isclose(lines["field"], level)]
        expected = 2.2016606 * np.sqrt(1.0 - level ** (1.0 / 3.0))
        assert len(points) > 20
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), expected, rtol=2e-5)


@pytest.mark.parametrize("seed", range(6))
def test_slices_of_random_trees_are_exact(seed: int) -> None:
    """Every value is the field's, and lines lie on the plane and on their levels, kinks aside."""
    rng = np.random.default_rng(seed)
    (tree,) = random_trees(seed=300 + seed, count=1)
    origin, normal = rng.uniform(-0.2, 0.2, 3), rng.normal(size=3)
    cut = tree.slice(origin, normal, resolution=80)
    unit = normal / np.linalg.norm(normal)
    size = float((tree.support[1] - tree.support[0]).max())
    plane, lines, surface = (part_of(cut, name) for name in ("plane", "lines", "surface"))
    np.testing.assert_array_equal(plane["field"], tree(plane.points))
    for part in (plane, lines, surface):
        if part.n_points:
            assert np.abs((part.points - origin) @ unit).max() < 1e-6 * size
    errors = np.abs(tree(lines.points) - lines["field"])
    assert len(errors) > 100
    assert np.quantile(errors, 0.99) < 5e-6
    assert errors.max() < 0.02
    np.testing.assert_array_equal(surface["field"], 0.5)


def test_the_plane_covers_what_the_box_shows_of_it() -> None:
    tree = Point((3, 4, 5), radius=1.0) + Point((5, 4, 5), radius=1.0)
    cut = part_of(tree.slice((4, 4, 5), (0, 1, 0), resolution=50), "plane")
    lower, upper = tree.support
    np.testing.assert_allclose(cut.points.min(axis=0)[[0, 2]], lower[[0, 2]].tolist(), atol=1e-5)
    np.testing.assert_allclose(cut.points.max(axis=0)[[0, 2]], upper[[0, 2]].tolist(), atol=1e-5)
    steps = np.ptp(cut.points, axis=0)[[0, 2]] / [50, 34]
    assert steps[0] == pytest.approx(steps[1], rel=0.05)
    assert cut.n_cells == 50 * 34


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_slices_of_any_size(scale: float) -> None:
    surface = part_of(A.scale(scale).slice(resolution=40), "surface")
    np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1) / scale, 1.0, atol=5e-6)


def test_lines_are_drawn_at_the_given_values_only() -> None:
    cut = A.slice(resolution=40, values=[0.25])
    assert np.unique(np.round(part_of(cut, "lines")["field"], 6)).tolist() == [0.25]
    assert part_of(A.slice(resolution=40, values=[]), "lines").n_points == 0
    assert part_of(A.slice(resolution=40, values=[3.0]), "lines").n_points == 0
    assert part_of(A.slice((0, 0, 1.5), resolution=40), "surface").n_points == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"origin": (0, 0, 9)}, "misses the model"),
        ({"normal": (0, 0, 0)}, "normal: expected a direction"),
        ({"normal": (0, np.nan, 0)}, "normal: expected three finite numbers"),
        ({"origin": "here"}, "origin: expected three finite numbers"),
        ({"values": [0.5, 0.0]}, "values: expected field values above 0"),
        ({"values": 0.5}, "values: expected several field values, got 0.5; put it in a list"),
        ({"values": [np.inf]}, "values: expected a finite number"),
    ],
)
def test_slices_that_cannot_be(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        A.slice(**options)
    assert issubclass(InvalidPoints, ValueError)


@pytest.mark.parametrize("resolution", [0, -1, 2.5, "fine", 10**6])
def test_resolutions_that_no_slice_can_have(resolution: Any) -> None:
    with pytest.raises(InvalidResolution, match="resolution: expected a whole number of squares"):
        A.slice(resolution=resolution)


def _plot(cut: Any, **options: Any) -> Any:
    """Return the pixels of a plot from above, (h, w, 3)."""
    try:
        pixels = cut.plot(
            off_screen=True,
            screenshot=True,
            window_size=(160, 120),
            cpos="xy",
            background="red",
            show_axes=False,
            show_scalar_bar=False,
            **options,
        )
    except RuntimeError as error:
        pytest.skip(f"no window can be opened here: {error}")
    return np.asarray(pixels)[..., :3].astype(int)


def test_a_plotted_slice_has_white_lines_and_a_dark_surface() -> None:
    """On the plane in grey, lines of the levels are white, and the line of the surface is dark."""
    pixels = _plot(A.slice(resolution=64, values=[0.2]), cmap=["grey", "grey"])
    grey = np.abs(pixels - 128).max(axis=2) < 8
    white = pixels.min(axis=2) > 230
    dark = pixels.max(axis=2) < 60
    rows, columns = np.nonzero(grey | white | dark)
    center = np.array([(rows.min() + rows.max()) / 2, (columns.min() + columns.max()) / 2])
    unit = (np.ptp(rows) + 1) / float(A.support[1][0] - A.support[0][0])  # pixels
    assert white.sum() > 60
    assert dark.sum() > 40
    for line, level in ((white, 0.2), (dark, 0.5)):
        distances = np.linalg.norm(np.argwhere(line) - center, axis=1) / unit
        expected = 2.2016606 * np.sqrt(1.0 - level ** (1.0 / 3.0))
        np.testing.assert_allclose(distances, expected, atol=2.0 / unit)


def test_a_slice_without_lines_plots() -> None:
    pixels = _plot(A.slice((0, 0, 1.5), resolution=16, values=[]), cmap=["grey", "grey"])
    assert (np.abs(pixels - 128).max(axis=2) < 8).any()


def test_a_slice_plots_in_one_call(tmp_path: Any) -> None:
    tree: Node = A - B
    try:
        tree.slice(resolution=32).plot(
            off_screen=True, screenshot=tmp_path / "slice.png", window_size=[80, 60]
        )
    except RuntimeError as error:
        pytest.skip(f"no window can be opened here: {error}")
    assert (tmp_path / "slice.png").stat().st_size > 500


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl", "vtp"])
def test_a_mesh_is_saved(suffix: str, tmp_path: Path) -> None:
    mesh = polygonize(Point((0, 0, 0), radius=1.0, color="red"), resolution=8)
    path = tmp_path / f"ball.{suffix}"
    mesh.save(path)
    loaded: Any = pv.read(path)
    assert loaded.n_cells == len(mesh.faces)
    np.testing.assert_allclose(loaded.bounds[1::2], mesh.vertices.max(axis=0), atol=1e-5)
    if suffix in ("ply", "vtp"):
        assert (loaded.point_data["RGB"] == (255, 0, 0)).all()
    mesh.save(str(path))  # over the first file


def test_a_mesh_that_cannot_be_saved(tmp_path: Path) -> None:
    mesh = polygonize(Point((0, 0, 0), radius=1.0), resolution=8)
    for wrong in (tmp_path / "ball.xyz", "ball", None, 5):
        with pytest.raises(InvalidFile, match=r"path: expected a file that ends in \.ply"):
            mesh.save(wrong)  # type: ignore[arg-type]
    with pytest.raises(OSError, match="nowhere"):
        mesh.save(tmp_path / "nowhere" / "ball.ply")
    empty = polygonize(Point((0, 0, 0), radius=1.0) & Point((9, 0, 0), radius=1.0), resolution=8)
    with pytest.raises(InvalidFile, match="expected a mesh with faces, got none"):
        empty.save(tmp_path / "empty.ply")


def test_a_tree_is_plotted_in_its_colours() -> None:
    ball = Point((0, 0, 0), radius=1.0, color="red")
    choices: list[tuple[dict[str, Any], int]] = [({}, 0), ({"color": "blue"}, 2)]
    for options, channel in choices:
        shown = {"off_screen": True, "window_size": (60, 40), "return_img": True, "background": "black"}
        picture = ball.plot(resolution=8, **shown, **options)
        middle = picture[20, 30].astype(int)
        assert middle[channel] > 100
        assert np.delete(middle, channel).max() < 60
    with pytest.raises(InvalidNode, match="expected a tree with a surface, got none"):
        (ball & ball.translate((9, 0, 0))).plot(off_screen=True)
