"""Plates and walls far thinner than cells: closed meshes of few triangles, with the area of the surface."""

import logging
from typing import Any

import numpy as np
import pytest

from blobtree import (
    Box,
    Cylinder,
    Disc,
    Extrude,
    Frustum,
    Node,
    Outline,
    Point,
    Prism,
    Segment,
    Shell,
    Superquadric,
    polygonize,
)
from blobtree._typing import Float64Array
from blobtree.meshing.leaf_gaps import limit_by_gaps, thinnest_slab
from blobtree.meshing.thin_parts import polygonize_parts
from blobtree.tape.grown import GrownModel, runs_of_leaves
from blobtree.tape.model import ImplicitModel, values_at
from blobtree.tape.part_sizes import part_sizes
from tests.thin_trees import is_closed, mesh_areas

BALL = Point((0, 0, 0), radius=1.0)
CUBE = Box((0, 0, 0), (2, 2, 2), radius=0.1)
CUBE_AREA = 24.0 + 1.2 * np.pi + 0.04 * np.pi
LARGEST_ERROR = 0.02
"""Error of the field at a vertex of the thinnest parts here, which are a hundred-thousandth of their box."""


def plate(radius: float, axis: tuple[float, float, float] = (1, 2, 3)) -> Disc:
    """Return a plate with an extent of 1."""
    return Disc((0, 0, 0), axis, 1.0, radius=radius)


def plate_area(radius: float) -> float:
    """Return its area."""
    return 2.0 * np.pi + 2.0 * np.pi**2 * radius + 4.0 * np.pi * radius**2


def checked_area(tree: Node, resolution: int = 32, most: int = 60_000) -> float:
    """Return the area of the mesh of a tree, once it is closed, small and on the surface."""
    mesh = polygonize_parts(tree, resolution=resolution)
    assert is_closed(mesh.faces)
    assert len(mesh.faces) < most
    assert np.abs(tree(mesh.vertices) - 0.5).max() < LARGEST_ERROR
    cosines = (mesh.normals * tree.gradient(mesh.vertices)).sum(axis=1)
    assert (cosines < 0.0).mean() > 0.999  # on an edge, both may be those of different faces
    return float(mesh_areas(mesh)[1].sum())


@pytest.mark.parametrize("radius", [1e-2, 1e-3, 1e-4])
def test_a_plate_at_an_angle_has_its_area(radius: float) -> None:
    assert checked_area(plate(radius)) == pytest.approx(plate_area(radius), rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_plates_at_random_angles_are_whole(seed: int) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    tree = BALL | plate(1e-4, (axis[0], axis[1], axis[2])).translate((4, 0, 0))
    assert checked_area(tree, 64) == pytest.approx(4.0 * np.pi + 2.0 * np.pi, rel=0.02)


def twisted_area(degrees: float) -> float:
    """Return the area of both sides of a disc in the plane x = 0 that is twisted about the z axis."""
    y = np.linspace(-1.0, 1.0, 100_001)
    return float(4.0 * (np.sqrt(1.0 - y**2) * np.sqrt(1.0 + (np.radians(degrees) * y) ** 2)).mean() * 2.0)


DIAMOND = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
RING = Outline.arcs([(-1, 0), (1, 0)], 1) + Outline.arcs([(-0.5, 0), (0.5, 0)], 1)


def sharp_plates(thickness: float) -> dict[str, Node]:
    """Return flat solids with sharp edges by name; their bases lie in the plane z = 0, their tops above."""
    top = (0.0, 0.0, thickness)
    return {
        "block": Box((0, 0, 0.5 * thickness), (1, 2, thickness), radius=0.0),
        "coin": Cylinder((0, 0, 0), top, 0.8, radius=0.0),
        "frustum": Frustum((0, 0, 0), top, 0.8, 0.8 - 0.5 * thickness),
        "prism": Prism(DIAMOND, thickness),
        "ring": Extrude(RING, thickness),
        "stretched cube": Box((0, 0, 0.5), (1, 2, 1), radius=0.0).scale((1, 1, thickness)),
    }


SHARP_AREAS = {
    "block": 4.0,
    "coin": 1.28 * np.pi,
    "frustum": 1.28 * np.pi,
    "prism": 4.0,
    "ring": 1.5 * np.pi,
    "stretched cube": 4.0,
}
"""Areas of both sides, without rims."""


@pytest.mark.parametrize("name", SHARP_AREAS)
def test_sharp_plates_at_an_angle_have_their_areas(name: str) -> None:
    tree = sharp_plates(3e-4)[name].rotate((1, 2, 3), 40)
    assert checked_area(tree) == pytest.approx(SHARP_AREAS[name], rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [1e-2, 1e-3])
@pytest.mark.parametrize("name", SHARP_AREAS)
def test_sharp_plates_join_and_are_cut(name: str, thickness: float) -> None:
    """A ball comes out of both sides, a hole goes through, or a block stands on top."""
    area, rim = SHARP_AREAS[name], 12.0 * thickness
    x, y, z = 0.1, 0.75 if name == "ring" else 0.3, 0.03
    plate, ball = sharp_plates(thickness)[name], Point((x, y, z), radius=0.2)
    block = Box((x, y, thickness + 0.1), (0.2, 0.2, 0.2), radius=0.0)
    drill = Cylinder((x, y, -1), (x, y, 1), 0.15, radius=0.0)
    lost = np.pi * (0.08 - z**2 - (z - thickness) ** 2)
    for tree, expected in (
        (plate | ball, area - lost + 0.16 * np.pi),
        (plate - drill, area - 0.045 * np.pi),
        (plate | block, area + 0.16),
    ):
        turned = tree.rotate((3, 1, 2), 25)
        assert checked_area(turned) == pytest.approx(expected, rel=0.05, abs=rim)


@pytest.mark.parametrize("thickness", [1e-2, 1e-4])
def test_sharp_plates_have_their_edges(thickness: float) -> None:
    size = np.array([1.0, 2.0, thickness])
    mesh = polygonize_parts(sharp_plates(thickness)["block"], resolution=32, creases=True)
    assert is_closed(mesh.faces)
    assert mesh.sheet_counts is not None
    area = 2.0 * (size.prod() / size).sum()
    assert mesh_areas(mesh)[1].sum() == pytest.approx(area, rel=1e-4)
    beyond = np.abs(mesh.vertices - [0, 0, 0.5 * thickness]) - 0.5 * size
    on_faces = (np.abs(beyond) < 1e-6).sum(axis=1)
    assert (on_faces[mesh.sheet_counts == 2] >= 2).all()
    assert (on_faces == 3).sum() == (mesh.sheet_counts == 3).sum() == 8


@pytest.mark.parametrize("profile", [{"width": 0.1}, {"falloff": "gaussian"}])
def test_plates_of_any_profile_have_their_areas(profile: dict[str, Any]) -> None:
    thin = Disc((0, 0, 0), (1, 2, 3), 1.0, radius=1e-3, **profile)
    assert checked_area(thin) == pytest.approx(plate_area(1e-3), rel=0.01)


@pytest.mark.parametrize("name", ["block", "coin"])
def test_sharp_plates_far_from_the_origin(name: str) -> None:
    """Rounded numbers lift vertices off the faces; along these, Newton's method would lead anywhere."""
    tree = sharp_plates(4e-3)[name].rotate((1, 2, 3), 20).translate((100, 50, 20))
    assert checked_area(tree) == pytest.approx(SHARP_AREAS[name], rel=0.04)


@pytest.mark.parametrize("name", ["block", "coin"])
def test_a_ball_that_is_added_to_a_sharp_plate_blends_thinly(name: str) -> None:
    """The plate's own field ends near its faces: Newton's method alone leaves it, toward the ball."""
    tree = (sharp_plates(4e-3)[name] + Point((0.1, 0.3, 0), radius=0.25)).rotate((1, 2, 3), 40)
    assert checked_area(tree) == pytest.approx(SHARP_AREAS[name] + 0.125 * np.pi, rel=0.04)


def surface_of(tree: ImplicitModel, rng: np.random.Generator, count: int = 300) -> Float64Array:
    """Return points on the surface of a tree: where lines from outside into it enter the solid."""
    lower, upper = tree.support
    inside = rng.uniform(lower, upper, (200 * count, 3))
    inside = inside[values_at(tree.tape, inside) > 0.5][:count]
    outside = inside + 3.0 * np.linalg.norm(upper - lower) * rng.normal(size=inside.shape)
    for _halving in range(60):
        middle = 0.5 * (inside + outside)
        solid = (values_at(tree.tape, middle) > 0.5)[:, None]
        inside, outside = np.where(solid, middle, inside), np.where(solid, outside, middle)
    return inside


@pytest.mark.parametrize("name", [*SHARP_AREAS, "rounded", "eroded"])
def test_slabs_flatten_what_they_thicken(name: str) -> None:
    """The surface of the thicker solid lies on that of the solid, once it is flattened."""
    block = sharp_plates(0.2)["block"]
    shapes = {**sharp_plates(0.2), "rounded": Prism(DIAMOND, 0.2, radius=0.1), "eroded": block}
    offsets = {"frustum": 0.0, "eroded": -0.04}  # exact for sides at right angles to the faces
    tree = shapes[name].offset(offsets.get(name, 0.05)).scale(2.0).rotate((1, 2, 3), 40)
    ((_, placed),) = runs_of_leaves(tree._program)
    found = thinnest_slab(placed)
    assert found is not None
    number, slab = found
    thicker = GrownModel(tree, np.array([0.3 / slab.scale]), np.array([number]))
    points = surface_of(thicker, np.random.default_rng(0))
    heights = (points - slab.middle) @ slab.normal
    assert np.abs(heights).max() == pytest.approx(slab.half + 0.3, rel=0.01)
    assert len(points) > 100
    np.testing.assert_allclose(tree(slab.flattened(points.astype(np.float32), 0.3)), 0.5, atol=2e-4)


def test_a_flat_cone_with_a_sharp_rim_has_no_slab() -> None:
    (leaf,) = (placed for _, placed in runs_of_leaves(Frustum((0, 0, 0), (0, 0, 0.1), 1.0, 0.5)._program))
    assert thinnest_slab(leaf) is None


def test_rounded_solids_are_as_thick_as_they_are() -> None:
    """The size that cells have to resolve is that of the solid, not that of its rounded edges."""
    for solid in (
        Frustum((0, 0, 0), (0, 0, 2), 1.0, 1.0, radius=0.02),
        Prism(((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), 2.0, radius=0.02),
    ):
        assert part_sizes(solid)[0] == pytest.approx([1.02])
    stretched = Box((0, 0, 0), (2, 2, 2), radius=0.0).scale((1, 0.1, 3)).rotate((1, 2, 3), 40)
    assert part_sizes(stretched)[0] == pytest.approx([0.1])


FLAT: dict[str, tuple[Node, float]] = {
    "box": (Box((0, 0, 0), (1, 2, 1e-3), radius=1e-4).rotate((1, 2, 3), 40), 4.0),
    "twisted": (plate(1e-4, (1, 0, 0)).twist(40.0), twisted_area(40.0)),
    "stretched": (plate(1e-3, (0, 0, 1)).scale((0.1, 0.2, 0.1)), 0.04 * np.pi),
    "shell": (Shell(BALL, 1e-3), 4.0 * np.pi * (1.0 + 0.999**2)),
    "pipe": (
        Segment((0, 0, 0), (0, 1, 2), radius=0.5) - Segment((0, 0, 0), (0, 1, 2), radius=0.499),
        2.0 * np.pi * 0.999 * 5.0**0.5 + 4.0 * np.pi * (0.25 + 0.499**2),
    ),
    "case": (CUBE - Box((0, 0, 0), (1.999, 1.999, 1.999), radius=0.1), 2.0 * CUBE_AREA),
    "slit": (CUBE - Disc((0, 0, 0), (1, 2, 3), 0.7, radius=1e-4), CUBE_AREA + 0.98 * np.pi),
}
"""Trees with a thin plate or wall, and their areas."""


@pytest.mark.slow_cases("twisted", "stretched", "shell", "pipe", "case")
@pytest.mark.parametrize("name", FLAT)
def test_each_kind_has_the_area_of_both_sides(name: str) -> None:
    tree, area = FLAT[name]
    assert checked_area(tree) == pytest.approx(area, rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("joined", ["union", "sum"])
@pytest.mark.parametrize("radius", [1e-2, 1e-4])
def test_a_plate_that_grows_out_of_a_ball_is_whole(joined: str, radius: float) -> None:
    fin = Disc((1.9, 0, 0), (0, 1, 0.3), 1.0, radius=radius)
    tree = BALL | fin if joined == "union" else BALL + fin
    mesh = polygonize(tree)
    centers, areas = mesh_areas(mesh)
    beyond = centers[:, 0] > 1.9
    assert is_closed(mesh.faces)
    assert areas[beyond].sum() == pytest.approx(np.pi * (1.0 + np.pi * radius), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0.05, 0.02])
def test_gaps_beside_plates_stay_open(gap: float) -> None:
    thin = Disc((0, 0, 1.1 + gap), (0, 0, 1), 0.6, radius=1e-3)
    assert checked_area(CUBE | thin, 48, 400_000) == pytest.approx(CUBE_AREA + 0.72 * np.pi, rel=0.02)
    beside = Disc((2.0 + gap, 0, 0), (0, 1, 0.3), 1.0, radius=1e-4)
    assert checked_area(BALL | beside, 48, 400_000) == pytest.approx(6.0 * np.pi, rel=0.02)


@pytest.mark.slow
def test_a_gap_that_does_not_fit_into_memory_is_named(caplog: pytest.LogCaptureFixture) -> None:
    over = Disc((0, 0, 1.1 + 1e-3), (0, 0, 1), 0.6, radius=2e-5)
    with caplog.at_level(logging.WARNING):
        mesh = polygonize(CUBE | over)
    (record,) = caplog.records
    assert is_closed(mesh.faces)
    assert "Disc at path (1,)" in record.getMessage()


def gap_limit(first: Node, second: Node) -> float:
    """Return the largest growth of the first of two leaves, up to 1."""
    tree = first | second
    lengths: Float64Array = np.array([1.0, 0.0])
    leaves = list(runs_of_leaves(tree._program))
    flat = thinnest_slab(leaves[0][1])
    limit_by_gaps(tree, leaves, lengths, {} if flat is None else {0: flat[1]})
    return float(lengths[0])


def test_growth_is_a_third_of_a_gap() -> None:
    disc = Disc((0, 0, 0), (0, 0, 1), 1.0, radius=1e-3)
    assert gap_limit(disc, disc.translate((0.3, 0, 0.102))) == pytest.approx(0.1 / 3, rel=0.05)
    assert gap_limit(disc, disc.translate((2.102, 0, 0))) == pytest.approx(0.1 / 3, rel=0.05)
    assert gap_limit(disc, disc.rotate((1, 0, 0), 90)) == 1.0
    assert gap_limit(disc, Point((0, 0, 5), radius=1.0)) == 1.0


def test_growth_across_a_slab_is_a_third_of_a_gap() -> None:
    plate = Box((0, 0, 0), (2, 2, 1e-3), radius=0.0)
    assert gap_limit(plate, plate.translate((0.3, 0, 0.101))) == pytest.approx(0.1 / 3, rel=0.01)
    assert gap_limit(plate, Point((0, 0, -0.7), radius=0.5)) == pytest.approx(0.2 / 3, rel=0.01)
    assert gap_limit(plate, Box((0, 0, 0.5005), (1, 1, 1), radius=0.0)) == 1.0
    assert gap_limit(plate, Point((0, 0, 0.1), radius=0.5)) == 1.0
    assert gap_limit(plate, Point((2, 0, 0.1), radius=0.5)) == 1.0
    over = Superquadric((0, 0, 0.3), (0.2, 0.2, 0.2))
    assert 0.05 / 3 < gap_limit(plate, over) <= 0.1 / 3


@pytest.mark.slow
def test_creases_away_from_thin_plates_stay_sharp() -> None:
    cut = (BALL - Point((0.9, 0, 0), radius=0.5)) | Disc((-2.5, 0, 0), (1, 1, 0), 1.0, radius=1e-4)
    mesh = polygonize(cut, creases=True)
    assert is_closed(mesh.faces)
    assert mesh.sheet_counts is not None
    assert (mesh.sheet_counts == 2).sum() > 50
    assert np.abs(cut(mesh.vertices) - 0.5).max() < LARGEST_ERROR


@pytest.mark.slow
def test_a_case_smaller_than_a_few_cells_is_whole() -> None:
    case = Box((0, 0, 0), (1, 0.8, 0.9), radius=0.02) - Box((0, 0, 0), (0.98, 0.78, 0.88), radius=0.02)
    tree = case | BALL.translate((20, 0, 0))
    mesh = polygonize(tree)
    centers, areas = mesh_areas(mesh)
    outer, inner = 2.0 * (0.8 + 0.9 + 0.72), 2.0 * (0.98 * 0.78 + 0.98 * 0.88 + 0.78 * 0.88)
    assert is_closed(mesh.faces)
    assert areas[centers[:, 0] < 10.0].sum() == pytest.approx(outer + inner, rel=0.15)
