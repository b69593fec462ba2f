"""Sweeps and twisted extrusions: distances, volumes and edges of their meshes, courses, and refusals."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from blobtree import Extrude, Outline, Sweep, polygonize
from blobtree.errors import InvalidNode
from blobtree.nodes.courses import spans_of
from tests.blobtree.meshing.test_polygonize import assert_closed
from tests.oracles import blobtree as oracle
from tests.oracles import sharp
from tests.sharp_solids import volume_of

NEAR_VOLUME = 1e-3
"""Relative error of volumes of meshes."""

BAR = "M-.2-.1H.2V.1H-.2Z"
SHELF = Outline("M-.2-.1H.2L-.1 .1H-.2Z")
STAIR = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))
HALF_TURN = ((1, 0, 0), (0, 1, 0), (-1, 0, 0))
SQUARE = ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))
WAVING = ((1, 0, 0), (0, 1, 0.5), (-1, 0, 0), (0, -1, 0.3))

SOLIDS = [
    Extrude("M-.5-.5H.5V.5H-.5Z", 0.3, top_scale=0.5, top_turn=200.0, origin=(1, 2, 3)),
    Sweep(SHELF, STAIR[:2], end_scale=2.0, end_turn=90.0, radius=0.05),
    Sweep(SHELF, STAIR),
    Sweep(SHELF, STAIR, corners="smooth", end_turn=90.0, end_scale=0.3),
    Sweep(SHELF, HALF_TURN, corners="smooth", up=(0, 1, 1)),
    Sweep(SHELF, HALF_TURN, corners="smooth", ends="closed"),
    Sweep(SHELF, WAVING, corners="smooth", ends="closed", end_turn=360.0),
    Sweep(SHELF, SQUARE, ends="closed", radius=0.05),
]


@pytest.mark.parametrize("solid", SOLIDS, ids=range(len(SOLIDS)))
def test_fields_are_those_of_the_distance(solid: Any) -> None:
    lower, upper = solid.support
    q = np.random.default_rng(1).uniform(lower - 0.1, upper + 0.1, (4000, 3))
    np.testing.assert_allclose(solid(q), oracle.value(solid, q), atol=5e-6)


@pytest.mark.parametrize("solid", SOLIDS, ids=range(len(SOLIDS)))
def test_fields_have_no_jumps_and_no_surface_where_spans_meet(solid: Any) -> None:
    spans = sharp.course_of(solid)[0]
    inside = np.array([span.start for span in spans[1:]]).reshape(-1, 1, 3)
    tangents = np.array([span.tangent for span in spans[1:]]).reshape(-1, 1, 3)
    near = inside + np.linspace(-1e-4, 1e-4, 401)[:, None] * tangents
    assert (solid(near.reshape(-1, 3)) > 0.55).all()
    lower, upper = solid.support
    rng = np.random.default_rng(2)
    q = rng.uniform(lower, upper, (4000, 3))
    step = rng.normal(size=q.shape)
    step *= 1e-3 / np.linalg.norm(step, axis=1)[:, None]
    slope = np.abs(sharp.distance(solid, q + step) - sharp.distance(solid, q)) / 1e-3
    _, turn, scale, _ = sharp.course_of(solid)
    length = sum(span.length for span in spans)
    steep = 3.0 + 8.0 * np.hypot(scale - 1.0, turn * max(scale, 1.0)) / length
    assert slope.max() < steep


@pytest.mark.parametrize(
    ("solid", "volume"),
    [
        (Sweep(BAR, STAIR), 0.08 * 3.0),
        (Sweep(BAR, SQUARE, ends="closed"), 0.08 * 4.0 * np.sqrt(2.0)),
        (Sweep(BAR, HALF_TURN, corners="smooth"), 0.08 * np.pi),
        (Sweep(BAR, HALF_TURN, corners="smooth", ends="closed"), 0.08 * 2.0 * np.pi),
        (Sweep(BAR, HALF_TURN, corners="smooth", end_turn=180.0), 0.08 * np.pi),
        (Sweep(BAR, HALF_TURN, corners="smooth", end_scale=0.5), 0.08 * np.pi * 1.75 / 3.0),
        (Sweep(BAR, HALF_TURN, corners="smooth", ends="closed", end_turn=180.0), 0.08 * 2.0 * np.pi),
    ],
)
def test_volumes_are_those_of_pappus(solid: Sweep, volume: float) -> None:
    mesh = polygonize(solid, resolution=96, creases=True)
    assert_closed(mesh)
    assert volume_of(mesh) == pytest.approx(volume, rel=NEAR_VOLUME)


def test_a_closed_curve_in_space_has_the_volume_of_pappus() -> None:
    solid = Sweep(Outline.arcs([(-0.2, 0), (0.2, 0)], 1), WAVING, corners="smooth", ends="closed")
    length = sum(span.length for span in sharp.course_of(solid)[0])
    mesh = polygonize(solid, resolution=192)
    assert_closed(mesh)
    assert volume_of(mesh) == pytest.approx(solid.outline.area * length, rel=NEAR_VOLUME)


def test_meshes_have_the_edges_of_mitred_corners() -> None:
    mesh = polygonize(Sweep(BAR, STAIR[:3]), resolution=64, creases=True)
    assert mesh.sheet_counts is not None
    for x, z in ((1.2, 0.1), (0.8, 0.1), (1.2, -0.1), (0.8, -0.1)):
        corner = np.array([x, 1.0 - x, z])
        nearest = np.linalg.norm(mesh.vertices - corner, axis=1).argmin()
        assert mesh.sheet_counts[nearest] == 3
        np.testing.assert_allclose(mesh.vertices[nearest], corner, atol=1e-4)


def test_three_points_lead_to_their_circle() -> None:
    spans, missing = spans_of(HALF_TURN, (0, 0, 1), smooth=True, closed=True)
    np.testing.assert_allclose([span.curvature for span in spans], 1.0)
    assert sum(span.length for span in spans) == pytest.approx(2.0 * np.pi)
    assert missing == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("end_scale", "end_turn", "reach"), [(1.0, 0.0, 0.2), (1.0, 90.0, 0.2), (3.0, 0.0, 0.4)]
)
def test_boxes_hold_the_middle_of_an_arc(end_scale: float, end_turn: float, reach: float) -> None:
    angles = np.radians([-63.5, 19.0, 101.5])
    points = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles]).tolist()
    disc = Outline.arcs([(-0.2, 0), (0.2, 0)], 1)
    solid = Sweep(disc, points, corners="smooth", width=1e-4, end_scale=end_scale, end_turn=end_turn)
    assert solid.support[1][1] >= 1.0 + reach


@pytest.mark.parametrize("closed", [False, True])
def test_smooth_courses_have_no_corners_and_pass_their_points(closed: bool) -> None:
    points = np.random.default_rng(4).uniform(-1, 1, (9, 3))
    spans, _ = spans_of(points.tolist(), (0, 0, 1), smooth=True, closed=closed)
    for a, b in zip(spans, spans[1:] + spans[: int(closed)], strict=False):
        np.testing.assert_allclose(a.end, b.start, atol=1e-9)
        np.testing.assert_allclose(a.end_tangent, b.tangent, atol=1e-9)
    places = np.array([span.start for span in spans] + [spans[-1].end])
    assert all(np.linalg.norm(places - point, axis=1).min() < 1e-9 for point in points)


def test_frames_turn_as_little_as_they_can() -> None:
    """The frame of a helix turns about the tangent as its torsion says (Wang et al. 2008)."""
    turns = np.linspace(0.0, 2.0 * np.pi, 65)
    points = np.column_stack([np.cos(turns), np.sin(turns), 0.2 * turns])
    spans, _ = spans_of(points.tolist(), (0, 0, 1), smooth=True, closed=False)
    frames = []
    for span in (spans[4], spans[-4]):
        u = np.cos(span.frame) * span.inward + np.sin(span.frame) * np.cross(span.tangent, span.inward)
        normal = -span.start * (1.0, 1.0, 0.0)
        beside = np.cross(span.tangent, normal)
        frames.append(np.arctan2(u @ beside, u @ normal))
    length = sum(span.length for span in spans[4:-4])
    torsion = 0.2 / (1.0 + 0.2**2)
    turned = np.mod(frames[0] - frames[1] - torsion * length + np.pi, 2.0 * np.pi) - np.pi
    assert turned == pytest.approx(0.0, abs=0.01)


def test_an_upright_sweep_is_an_extrusion() -> None:
    q = np.random.default_rng(5).uniform(-0.5, 1.5, (500, 3))
    extruded = Extrude(SHELF, 1.0, top_turn=50.0, radius=0.05)
    swept = Sweep(SHELF, ((0, 0, 0), (0, 0, 1)), end_turn=50.0, radius=0.05)
    np.testing.assert_array_equal(swept(q), extruded(q))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sweep(BAR, ((0, 0, 0),)), "points: expected 2 to 500, got 1"),
        (lambda: Sweep(BAR, STAIR[:2], ends="closed"), "points: expected 3 to 500, got 2"),
        (lambda: Sweep(BAR, ((0, 0, 0), (0, 0, 0))), "points: two neighbours are equal"),
        (lambda: Sweep(BAR, ((0, 0, 0), (1, 0, 0), (0, 0.01, 0))), "expected turns up to 150 degrees"),
        (lambda: Sweep(BAR, ((0, 0, 0), (1, 0, 0), (0, 0, 0)), corners="smooth"), "points: the curve turns"),
        (lambda: Sweep(BAR, ((0, 0, 0), (1, 0, 0), (-1, 0, 0)), corners="smooth"), "points: the curve turns"),
        (lambda: Sweep(BAR, ((0, 0, 0), (0.1, 0, 0), (0.1, 1, 0))), "too short for its corners"),
        (
            lambda: Sweep(BAR, ((0.1, 0, 0), (0, 0.1, 0), (-0.1, 0, 0)), corners="smooth"),
            "bends too tightly near",
        ),
        (lambda: Sweep(BAR, STAIR, end_turn=20.0), "corners: expected 'smooth'"),
        (lambda: Sweep(BAR, STAIR, ends="closed"), "must bring the outline back unturned"),
        (lambda: Sweep(BAR, SQUARE, ends="closed", end_scale=2.0, corners="smooth"), "end_scale: expected 1"),
        (lambda: Sweep(BAR, SQUARE, ends="closed", end_turn=90.0, corners="smooth"), "end_turn: expected a"),
        (lambda: Sweep(BAR, STAIR, corners="round"), "corners: expected 'sharp' or 'smooth', got 'round'"),
    ],
)
def test_wrong_sweeps_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()
