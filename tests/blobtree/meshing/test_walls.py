"""Walls that operators leave, thinner than any primitive: closed meshes with the area of both sides."""

import logging

import numpy as np
import pytest

from blobtree import Box, Mesh, Node, Point, Progress, Segment, Shell, SmoothDifference, polygonize
from blobtree.errors import InvalidResolution
from blobtree.meshing.adaptive_mesh import AdaptiveMesh, AdaptiveMesher, OpenMesh
from blobtree.meshing.thin_parts import polygonize_parts
from tests.thin_trees import is_closed, mesh_areas, pieces

BALL = Point((0, 0, 0), radius=1.0)
CUBE = Box((0, 0, 0), (1, 1, 1), radius=0.1)


def box_area(side: float, edge: float) -> float:
    """Return the area of everything within `edge` of a cube."""
    return 6.0 * side**2 + 6.0 * np.pi * side * edge + 4.0 * np.pi * edge**2


def lens(height: float) -> tuple[Node, float]:
    """Return what two balls of radius 1 have in common, and its area."""
    apart = 2.0 - height
    return BALL & BALL.translate((apart, 0, 0)), 2.0 * np.pi * height


WALLS: dict[str, tuple[Node, float]] = {
    "shell": (Shell(BALL, 0.1), 4.0 * np.pi * 1.81),
    "case": (CUBE - Box((0, 0, 0), (0.92, 0.92, 0.92), radius=0.1), box_area(1.0, 0.1) + box_area(0.92, 0.1)),
    "sharp case": (
        Box((0, 0, 0), (1, 1, 1), radius=1e-3) - Box((0, 0, 0), (0.9, 0.9, 0.9), radius=1e-3),
        box_area(1.0, 1e-3) + box_area(0.9, 1e-3),
    ),
    "lens": lens(0.05),
    "small lens": lens(0.01),
    "twisted pipe": (
        (Segment((0, 0, 0), (0, 0, 2), radius=0.5) - Segment((0, 0, 0), (0, 0, 2), radius=0.45)).twist(20.0),
        4.0 * np.pi * (0.95 + 0.4525),
    ),
    "stretched shell": (
        Shell(BALL, 0.1).transform(np.diag([0.01, 0.01, 0.01, 1.0])[:3]),
        4e-4 * np.pi * 1.81,
    ),
}


@pytest.mark.slow_cases("small lens")
@pytest.mark.parametrize("name", WALLS)
def test_both_sides_of_a_wall_have_their_area(name: str) -> None:
    tree, area = WALLS[name]
    mesh = polygonize_parts(tree, resolution=16)
    assert is_closed(mesh.faces)
    assert mesh_areas(mesh)[1].sum() == pytest.approx(area, rel=0.14 if name == "small lens" else 0.06)


LARGE_LENS = BALL & BALL.translate((1.4, 0, 0))


def lens_area(mesh: Mesh) -> float:
    """Return the area of a mesh on the positive side of x = 0, of a closed mesh."""
    assert is_closed(mesh.faces)
    centers, areas = mesh_areas(mesh)
    return float(areas[centers[:, 0] > 0.0].sum())


def test_a_thick_lens_smaller_than_cells_has_its_rim() -> None:
    tree = BALL.translate((-60, 0, 0)) | LARGE_LENS.rotate((1, 2, 3), 40.0).translate((10, 0, 0))
    assert lens_area(polygonize(tree)) == pytest.approx(2.0 * np.pi * 0.6, rel=0.08)


def test_a_flat_lens_smaller_than_cells_has_its_area() -> None:
    flat = BALL & BALL.translate((1.98, 0, 0))
    tree = BALL.translate((-60, 0, 0)) | flat.scale(0.8).rotate((1, 2, 3), 40.0).translate((10, 0, 0))
    assert lens_area(polygonize(tree)) == pytest.approx(0.64 * 2.0 * np.pi * 0.02, rel=0.12)


@pytest.mark.parametrize("seed", range(3))
def test_a_case_smaller_than_cells_has_walls_without_holes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    place, size = tuple(rng.uniform(9.0, 10.0, 3).tolist()), float(rng.uniform(0.6, 1.2))
    turn = float(rng.uniform(0.0, 90.0))
    case = WALLS["case"][0].scale(size).rotate((1, 2, 3), turn).translate(place)
    mesh = polygonize(BALL.translate((-60, 0, 0)) | case)
    assert is_closed(mesh.faces)
    of_case = np.unique(pieces(mesh)[mesh.vertices[:, 0] > 0.0])
    assert len(of_case) == 2
    centers, areas = mesh_areas(mesh)
    assert areas[centers[:, 0] > 0.0].sum() == pytest.approx(size**2 * WALLS["case"][1], rel=0.08)


def test_walls_far_thinner_than_parts_that_count_are_named(caplog: pytest.LogCaptureFixture) -> None:
    flat = BALL & BALL.translate((1.999, 0, 0))
    mesh = polygonize(BALL.translate((-30, 0, 0)) | flat | Point((10, 0, 0), radius=0.01))
    assert "a wall of the Intersection at path (1,)" in caplog.text
    assert len(mesh.faces) < 20_000
    assert lens_area(mesh) == pytest.approx(4.0 * np.pi * 1e-4, rel=0.15)


def test_a_wall_between_two_holes_has_its_area() -> None:
    holes = [Segment((x, 0, -1), (x, 0, 1), radius=0.3) for x in (-0.31, 0.31)]
    box = Box((0, 0, 0), (2, 1, 0.4), radius=0.01)
    arc = 2.0 * 0.3 * np.arccos((0.31 - 0.02) / 0.3)
    for tree in (box - holes[0] - holes[1], box - (holes[0] | holes[1])):
        mesh = polygonize_parts(tree, resolution=24)
        centers, areas = mesh_areas(mesh)
        middle = (np.abs(centers[:, 0]) < 0.02) & (np.abs(centers[:, 2]) < 0.15)
        assert is_closed(mesh.faces)
        assert areas[middle].sum() == pytest.approx(2.0 * arc * 0.3, rel=0.1)


@pytest.mark.slow  # kernels of this operator compile
def test_a_smooth_difference_leaves_a_wall() -> None:
    tree = SmoothDifference(BALL, Point((0, 0, 0), radius=0.9), 0.02)
    mesh = polygonize_parts(tree, resolution=16)
    assert is_closed(mesh.faces)
    assert mesh_areas(mesh)[1].sum() == pytest.approx(4.0 * np.pi * 1.81, rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_without_walls_cuts_keep_cells_of_one_size(seed: int) -> None:
    turned = Segment((0, 0, -2), (0, 0.1 * seed, 2), radius=0.3)
    for tree in (CUBE - turned, BALL & CUBE.translate((0.4, 0, 0)), BALL - turned.rotate((1, 2, 3), 70)):
        uniform, default = polygonize(tree, resolution=64), polygonize(tree)
        assert np.array_equal(uniform.vertices, default.vertices)
        assert np.array_equal(uniform.faces, default.faces)


def test_sharp_edges_are_no_walls() -> None:
    crescent = BALL - Point((0.5, 0.3, 0), radius=0.9)
    uniform, default = polygonize(crescent, resolution=64), polygonize(crescent)
    assert np.array_equal(uniform.vertices, default.vertices)


@pytest.mark.slow
def test_a_wall_too_thin_for_memory_is_named_once(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        mesh = polygonize(BALL.translate((4, 0, 0)) | (CUBE & CUBE.translate((0, 0, 1.1995))))
    assert is_closed(mesh.faces)
    (record,) = caplog.records
    assert "a wall of the Intersection at path (1,)" in record.getMessage()
    assert "resolution of" in record.getMessage()


@pytest.mark.parametrize("height", [1e-5, 3e-6])
def test_a_wall_thinner_than_all_cells_is_named(height: float, caplog: pytest.LogCaptureFixture) -> None:
    for tree in (CUBE & CUBE.translate((0, 0, 1.2 - 1.42 * height)), lens(4.4 * height)[0]):
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            polygonize_parts(tree, resolution=24)
        (record,) = caplog.records
        assert "a wall of the Intersection at path ()" in record.getMessage()


@pytest.mark.parametrize(
    "tree",
    [
        CUBE - CUBE,
        BALL - Point((0.5, 0.3, 0), radius=0.9),
        BALL - Point((0.5, 0, 0), radius=0.5),
        CUBE - Box((0, 0, 0.6), (0.5, 0.5, 0.6), radius=0.01),
    ],
)
def test_sides_that_touch_are_no_walls(tree: Node, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        polygonize_parts(tree, resolution=24)
    assert not caplog.records


@pytest.mark.slow
@pytest.mark.parametrize("height", [1e-4, 2e-5, 5e-6])
def test_a_membrane_thinner_than_all_cells_has_both_sides(height: float) -> None:
    tree = Box((0, 0, 0), (1, 1, 1), radius=0.05) - Box(
        (0, 0, -0.1), (0.6, 0.6, 1.2 - 2.0 * height), radius=0.05
    )
    mesh = polygonize(tree)
    centers, areas = mesh_areas(mesh)
    ceiling = (np.abs(centers[:, :2]) < 0.25).all(axis=1) & (centers[:, 2] > 0.5)
    assert is_closed(mesh.faces)
    assert np.abs(tree(mesh.vertices) - 0.5).max() < 1e-4
    assert areas[ceiling].sum() == pytest.approx(0.5, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("share", [1e-5, 2e-6])
def test_a_shell_thinner_than_all_cells_has_both_sides(share: float) -> None:
    mesh = polygonize(Shell(BALL, 4.4 * share))
    assert is_closed(mesh.faces)
    assert mesh_areas(mesh)[1].sum() == pytest.approx(8.0 * np.pi, rel=0.01)


def test_parts_that_cells_cannot_close_leave_the_rest(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    tree = BALL.translate((4, 0, 0)) | (CUBE & CUBE.translate((0, 0, 1.1)))

    def failing(self: AdaptiveMesher, report: Progress, *limits: int) -> AdaptiveMesh:
        raise InvalidResolution("cells could not be divided")

    monkeypatch.setattr(AdaptiveMesher, "mesh", failing)
    with caplog.at_level(logging.WARNING):
        mesh = polygonize_parts(tree, resolution=24)
    (record,) = caplog.records
    assert is_closed(mesh.faces)
    assert mesh_areas(mesh)[1].sum() > 4.0 * np.pi * 0.95
    assert "a wall of the Intersection at path (1,)" in record.getMessage()


@pytest.mark.parametrize("thickness", [0.08, 0.01])
def test_a_wall_that_cells_cannot_close_leaves_the_other_walls(
    thickness: float, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    inner = 1.0 - thickness
    case = CUBE - Box((0, 0, 0), (inner, inner, inner), radius=0.1)
    tree = case | (BALL & BALL.translate((1.95, 0, 0))).translate((4, 0, 0))
    mesh_of_cells = AdaptiveMesher.mesh

    def failing(self: AdaptiveMesher, report: Progress, *limits: int) -> AdaptiveMesh:
        mesh = mesh_of_cells(self, report, *limits)
        at_lens = mesh.vertices.positions[:, 0] > 3.0
        if (mesh.leaves.sizes[mesh.owners[at_lens]] < mesh.leaves.sizes.max()).any():
            raise OpenMesh("cells could not be divided", mesh.vertices.positions[at_lens][:1].astype(float))
        return mesh

    monkeypatch.setattr(AdaptiveMesher, "mesh", failing)
    with caplog.at_level(logging.WARNING):
        mesh = polygonize_parts(tree, resolution=24)
    (record,) = caplog.records
    assert is_closed(mesh.faces)
    centers, areas = mesh_areas(mesh)
    expected = box_area(1.0, 0.1) + box_area(inner, 0.1)
    assert areas[centers[:, 0] < 2.0].sum() == pytest.approx(expected, rel=0.06)
    assert "a wall of the Intersection at path (1, 0)" in record.getMessage()
    assert "Difference" not in record.getMessage()


@pytest.mark.slow
def test_a_wall_of_a_thickened_tree_is_named_by_its_own_node(caplog: pytest.LogCaptureFixture) -> None:
    plate = Box((0, 0, 0), (1, 1, 0.005), radius=0)
    with caplog.at_level(logging.WARNING):
        polygonize_parts(Shell(plate, 0.002))
    assert "a wall of the Shell at path ()" in caplog.text
