"""Extrusions and revolutions: edges and volumes of their meshes, distances near many edges, and refusals."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Extrude, Node, Outline, Prism, Revolve, polygonize
from blobtree.errors import InvalidNode
from blobtree.nodes.sections import thin_width
from tests.blobtree.meshing.test_polygonize import assert_closed
from tests.oracles import blobtree as oracle
from tests.oracles import sharp
from tests.sharp_solids import volume_of

Floats = NDArray[np.float64]
NEAR_EDGE, NEAR_VOLUME = 1e-4, 1e-3
"""Errors of meshes: distances of vertices from edges over the size, and relative errors of volumes."""

RING = Outline.arcs([(-1, 0), (1, 0)], 1) + Outline.arcs([(-0.5, 0), (0.5, 0)], 1)
PLATE = Outline("M0 0H2V1H0Z") + Outline("M.3 .3V.7H.7V.3Z") + Outline("M1.2 .2 1.8 .2 1.5 .8Z")
BEAD = Outline("M1 0H2L1.8 .6H1Z")


def distances_from_outline(points: Any, outline: Outline) -> Floats:
    """Distances (n,) of points (n, 2) from an outline."""
    return np.abs(sharp.flat_distance(points, outline))


@pytest.mark.parametrize("outline", [RING, PLATE, Outline.text("G"), Outline.text("&g8")])
def test_meshes_of_extrusions_have_the_edges(outline: Outline) -> None:
    solid: Any = Extrude(outline, 0.3, origin=(0.1, 0.2, 0.3)).rotate((1, 2, 3), 40)
    mesh = polygonize(solid, resolution=64, creases=True)
    assert_closed(mesh)
    assert volume_of(mesh) == pytest.approx(outline.area * 0.3, rel=NEAR_VOLUME)
    assert mesh.sheet_counts is not None
    there = mesh.vertices[mesh.sheet_counts > 1] @ np.array(solid.matrix)[:, :3] - (0.1, 0.2, 0.3)
    beside = distances_from_outline(there[:, :2], outline)
    assert len(beside) > 100
    assert beside.max() < NEAR_EDGE
    on_an_end = np.minimum(np.abs(there[:, 2]), np.abs(there[:, 2] - 0.3)) < NEAR_EDGE
    corners = np.concatenate([loop.points[loop.corners] for loop in outline.loops] + [[(np.inf, np.inf)]])
    at_a_corner = np.linalg.norm(there[:, None, :2] - corners, axis=-1).min(axis=1) < NEAR_EDGE
    assert (on_an_end | at_a_corner).all()


@pytest.mark.parametrize("angle", [40.0, 90.0, 180.0, 250.0, 360.0])
def test_meshes_of_revolutions_have_the_edges(angle: float) -> None:
    solid = Revolve(BEAD, angle)
    mesh = polygonize(solid, resolution=64, creases=True)
    assert_closed(mesh)
    x, y = BEAD.loops[0].points.T
    after_x, after_y = np.roll(x, -1), np.roll(y, -1)
    moment = ((x * after_y - after_x * y) * (x + after_x)).sum() / 6.0  # by Pappus
    assert volume_of(mesh) == pytest.approx(np.radians(angle) * moment, rel=NEAR_VOLUME)
    assert mesh.sheet_counts is not None
    there = mesh.vertices[mesh.sheet_counts > 1].astype(np.float64)
    section = np.column_stack([np.hypot(there[:, 0], there[:, 1]), there[:, 2]])
    assert distances_from_outline(section, BEAD).max() < 2.0 * NEAR_EDGE
    turn = np.degrees(np.mod(np.arctan2(there[:, 1], there[:, 0]) + 1e-4, 2.0 * np.pi))
    at_end = np.minimum(turn, np.abs(turn - angle)) < 0.02
    corners = BEAD.loops[0].points[BEAD.loops[0].corners]
    at_corner = np.linalg.norm(section[:, None] - corners, axis=-1).min(axis=1) < 2.0 * NEAR_EDGE
    assert (at_end | at_corner).all()


@pytest.mark.parametrize(
    ("solid", "volume"),
    [
        (Extrude("M-1-1H1V1H-1Z", 1.5, top_scale=0.5), 4.0 * 1.5 * (1.0 + 0.5 + 0.25) / 3.0),
        (Extrude("M-1-1H1V1H-1Z", 1.5, top_turn=90.0), 6.0),
        (Extrude(RING, 0.5, top_turn=-30.0, top_scale=2.0, origin=(3, 4, 5)), RING.area * 0.5 * 7.0 / 3.0),
        (Revolve("M0 0H1V1H0Z"), np.pi),
        (Revolve("M0-1A1 1 0 0 1 0 1Z"), 4.0 * np.pi / 3.0),
        (Revolve("M0-1A1 1 0 0 1 0 1Z", 90.0), np.pi / 3.0),
    ],
)
def test_volumes(solid: Node, volume: float) -> None:
    mesh = polygonize(solid, resolution=96, creases=True)
    assert_closed(mesh)
    assert volume_of(mesh) == pytest.approx(volume, rel=NEAR_VOLUME)


STRIP = Outline("M0 0H1V1H0Z") + Outline("M1.2 0H1.22V1H1.2Z")


@pytest.mark.parametrize(
    ("solid", "volume"),
    [
        (Extrude(STRIP, 0.3), 0.3 * STRIP.area),
        (Extrude("M0 0H1V.49H3V.51H1V1H0Z", 0.3), 0.3 * 1.04),
        (Revolve(STRIP), np.pi * (1.0 + 1.22**2 - 1.2**2)),
    ],
)
def test_meshes_have_thin_parts(solid: Node, volume: float) -> None:
    mesh = polygonize(solid, creases=True)
    assert_closed(mesh)
    assert volume_of(mesh) == pytest.approx(volume, rel=NEAR_VOLUME)


@pytest.mark.parametrize("angle", [1.0, 4.0, 10.0])
def test_meshes_of_thin_wedges_lack_only_their_tips(angle: float) -> None:
    mesh = polygonize(Revolve("M0 0H1V1H0Z", angle), creases=True)
    assert volume_of(mesh) == pytest.approx(0.5 * np.radians(angle), rel=0.06)


@pytest.mark.parametrize(
    ("outline", "width"),
    [
        (STRIP, 0.02),
        (RING + Outline.arcs([(-1.02, 0), (1.02, 0)], 1) + Outline.arcs([(-1.04, 0), (1.04, 0)], 1), 0.02),
        (Outline("M0 0H1V1H0Z"), np.inf),
        (Outline("M0 0H2V.2Z"), np.inf),
        (Outline.text("Sharp & Exit"), np.inf),
    ],
)
def test_thin_parts_are_measured_without_tips_of_corners(outline: Outline, width: float) -> None:
    assert thin_width(outline) == pytest.approx(width, rel=0.01)


def test_a_thin_part_may_go_in_an_offset() -> None:
    solid = Extrude(STRIP, 0.3).offset(-0.02)
    assert (solid([(1.21, 0.5, 0.15), (0.5, 0.5, 0.15)]) > 0.5).tolist() == [False, True]
    assert volume_of(polygonize(solid, creases=True)) == pytest.approx(0.96**2 * 0.26, rel=NEAR_VOLUME)


def test_a_tapered_top_is_the_scaled_outline() -> None:
    solid = Extrude("M1 1H2V2H1Z", 2.0, top_scale=0.5, top_turn=90.0)
    inside, outside = [-0.51, 0.51, 1.99], [-0.49, 0.51, 1.99]
    assert (solid([inside, outside]) > 0.5).tolist() == [True, False]


def test_text_of_many_edges_has_its_exact_distance() -> None:
    outline = Outline.text("Sharp\nletters & curves")
    solid = Extrude(outline, 0.2)
    assert sum(len(loop.points) for loop in outline.loops) > 2000
    (x, y), (to_x, to_y) = outline.bounds
    q = np.random.default_rng(2).uniform((x - 0.1, y - 0.1, -0.1), (to_x + 0.1, to_y + 0.1, 0.3), (4000, 3))
    assert solid(q) == pytest.approx(oracle.value(solid, q), abs=2e-5)


def test_a_rounded_extrusion_holds_all_within_the_radius() -> None:
    q = np.random.default_rng(3).uniform((-0.4, -0.4, -0.4), (2.4, 1.4, 0.9), (4000, 3))
    moved = sharp.distance(Extrude(PLATE, 0.5), q) - 0.2
    clear = np.abs(moved) > 1e-5
    assert ((Extrude(PLATE, 0.5, radius=0.2)(q) > 0.5) == (moved < 0.0))[clear].all()
    assert ((Extrude(PLATE, 0.5).offset(0.2)(q) > 0.5) == (moved < 0.0))[clear].all()


def test_a_prism_is_an_extrusion() -> None:
    corners = ((0, 0, 0), (2, 0, 0), (1, 1, 0), (2, 2, 0), (0, 2, 0))
    q = np.random.default_rng(4).uniform(-1.0, 3.0, (500, 3))
    extruded = Extrude(Outline.polygon([corner[:2] for corner in corners]), 0.7)
    np.testing.assert_array_equal(Prism(corners, 0.7)(q), extruded(q))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Extrude(PLATE, 0.0), "height: expected a number above 0"),
        (lambda: Extrude([(0, 0)], 1.0), "outline: expected an Outline or SVG path data"),  # type: ignore[arg-type]
        (lambda: Extrude("circle", 1.0), "path: expected SVG path data"),
        (lambda: Extrude(PLATE, 1.0, top_scale=0.0), "top_scale: expected 0.001 to 1000"),
        (lambda: Extrude(PLATE, 1.0, top_turn=float("inf")), "top_turn: expected a finite number"),
        (lambda: Extrude(PLATE, 1.0, radius=-1.0), "radius: expected a number from 0"),
        (lambda: Revolve("M-1 0H1V1Z"), "outline: expected x from 0"),
        (lambda: Revolve(BEAD, 400.0), "angle: expected 0.1 to 360"),
        (lambda: Revolve(BEAD, 0.0), "angle: expected 0.1 to 360"),
        (lambda: Revolve(BEAD).offset(-2.0).tape, "offset: -2 leaves nothing"),
    ],
)
def test_wrong_solids_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()
