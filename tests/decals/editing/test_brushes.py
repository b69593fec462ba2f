"""Brushes: what they add, push and remove, and a stroke with the pointer as one undo entry."""

from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point
from decals.editing import (
    Actions,
    BrushDecals,
    EditSession,
    LockLayers,
    PointerTools,
    PushDecals,
    RelaxDecals,
    SetValues,
)
from decals.editing.brush_settings import Brush
from decals.editing.brushes import CLOSEST
from decals.editing.scatter_commands import SPACING
from decals.errors import InvalidEdit
from tests.decals.editing.scenes import digest

TOP, UP = (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)


def covered_ball(count: int) -> EditSession:
    return EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=count, images=["eye", "scale"]))


def distances(points: np.ndarray) -> np.ndarray:
    gaps: np.ndarray = np.linalg.norm(points[:, None].astype(float) - points[None], axis=2)
    return gaps + 10.0 * np.eye(len(points))


def test_the_scatter_brush_fills_its_disc_and_keeps_distances() -> None:
    session = covered_ball(0)
    session.do(BrushDecals(TOP, UP, 0.5, 0.05, images=(1,), seed=3))
    added = session.document.decals.decals
    assert distances(added.positions).min() >= 0.999 * CLOSEST * SPACING * 0.05
    assert (np.linalg.norm(added.positions - TOP, axis=1) <= 0.5).all()
    np.testing.assert_allclose(np.linalg.norm(added.positions, axis=1), 1.0, atol=1e-4)
    assert set(added.images.tolist()) == {1}
    tiling = np.pi * 0.5**2 / (np.sqrt(3) / 2 * (SPACING * 0.05) ** 2)
    assert 0.7 * tiling < len(added) < 1.1 * tiling
    session.do(BrushDecals(TOP, UP, 0.5, 0.05, seed=4))
    assert len(session.document.decals) < 1.25 * len(added)
    thin = covered_ball(0)
    thin.do(BrushDecals(TOP, UP, 0.5, 0.05, density=0.25, seed=3))
    assert 0.15 * len(added) < len(thin.document.decals) < 0.4 * len(added)


def test_the_push_brush_moves_by_the_kernel_and_leaves_the_rest() -> None:
    session = covered_ball(300)
    before = session.document.decals.decals.positions.astype(float)
    session.do(PushDecals(TOP, (0.1, 0, 0), 0.5))
    moved = np.linalg.norm(session.document.decals.decals.positions - before, axis=1)
    d = np.linalg.norm(before - TOP, axis=1) / 0.5
    expected = np.where(d < 1, 0.1 * (1 - d**2) ** 3, 0.0)
    assert (moved[d >= 1] == 0).all()
    np.testing.assert_allclose(moved, expected, atol=0.012)  # projected back onto the ball
    assert distances(session.document.decals.decals.positions).min() > 0.4 * distances(before).min()


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (BrushDecals(TOP, UP, 0.0, 0.1), "radius"),
        (BrushDecals(TOP, UP, 1e308, 0.1), "radius"),
        (BrushDecals(TOP, UP, 1.0, -1.0), "decal radius"),
        (BrushDecals(TOP, UP, 1.0, 0.1, density=2.0), "density"),
        (BrushDecals(TOP, UP, 1.0, 0.1, images=(9,)), "image"),
        (BrushDecals((0, 0), UP, 1.0, 0.1), "point"),
        (PushDecals(TOP, (np.nan, 0, 0), 1.0), "offset"),
        (PushDecals(TOP, UP, "x"), "radius"),  # type: ignore[arg-type]
    ],
)
def test_wrong_values_are_refused(command: Any, message: str) -> None:
    with pytest.raises(InvalidEdit, match=f"{message}.*expected"):
        covered_ball(3).do(command)


@pytest.mark.parametrize("brush", [Brush.SCATTER, Brush.PUSH, Brush.ERASE, Brush.RELAX, Brush.ALIGN])
def test_a_stroke_with_the_pointer_is_one_entry(brush: Brush) -> None:
    session = covered_ball(0 if brush is Brush.SCATTER else 60)
    before, count = digest(session.document), len(session.document.decals)
    actions, rays = Actions(session), session.document.camera.rays(200, 200)
    tools = PointerTools(actions, lambda x, y: (rays.origin, rays.directions(x, y)))
    actions.state.brush.brush = brush
    assert not tools.press(1, 1)  # beside the model the drag turns the camera
    tools.release(1, 1)
    assert tools.press(90, 100)
    assert tools.dragging
    for x in (95, 100, 110):
        assert tools.move(x, 100)
    assert tools.release(110, 100)
    assert not tools.dragging
    assert session.labels == (f"{brush} brush",)
    after = len(session.document.decals)
    assert (
        after > count if brush is Brush.SCATTER else after < count if brush is Brush.ERASE else after == count
    )
    session.undo()
    assert digest(session.document) == before


def stroke(session: EditSession, brush: Brush, places: list[tuple[int, int]]) -> tuple[Actions, list[Any]]:
    """Drag a brush of the radius 0.3 over pixels, and return the actions and the points that it met."""
    actions, rays = Actions(session), session.document.camera.rays(200, 200)
    tools = PointerTools(actions, lambda x, y: (rays.origin, rays.directions(x, y)))
    actions.state.brush.brush, actions.state.brush.radius = brush, 0.3
    assert tools.press(*places[0])
    for place in places[1:]:
        tools.move(*place)
    tools.release(*places[-1])
    met = [tools.at(*place) for place in places]
    return actions, [np.asarray(pick.position, np.float64) for pick in met if pick is not None]


def test_a_stroke_that_changes_nothing_says_so() -> None:
    session = covered_ball(0)
    actions, _ = stroke(session, Brush.ERASE, [(80, 90), (110, 105)])
    assert actions.state.message == "erase brush: nothing to change here"
    stroke(session, Brush.SCATTER, [(80, 90), (110, 105)])
    actions, _ = stroke(session, Brush.ERASE, [(80, 90), (110, 105)])
    assert session.labels == ("scatter brush", "erase brush")
    assert "nothing" not in actions.state.message
    actions, _ = stroke(session, Brush.PAINT, [(80, 90), (110, 105)])
    assert "nothing" not in actions.state.message


def test_the_align_brush_turns_images_along_the_stroke() -> None:
    session = covered_ball(60)
    before = session.document.decals.decals
    actions, (start, end) = stroke(session, Brush.ALIGN, [(80, 90), (110, 105)])
    after = session.document.decals.decals
    touched = np.linalg.norm(before.positions - end, axis=1) < 0.3
    assert 1 < touched.sum() < 30
    np.testing.assert_array_equal(after.tangents[~touched], before.tangents[~touched])
    np.testing.assert_array_equal(after.positions, before.positions)
    for tangent, normal in zip(after.tangents[touched], after.normals[touched], strict=True):
        assert abs(np.dot(tangent, normal)) < 1e-5
        across = np.cross(normal, end - start)
        assert abs(np.dot(tangent, across)) < 1e-5
        assert np.dot(tangent, end - start) > 0.0
    before = after
    stroke(session, Brush.ALIGN, [(80, 90), (81, 90)])  # too short for a direction
    np.testing.assert_array_equal(session.document.decals.decals.tangents, before.tangents)
    assert actions.state.selection == ()


def test_the_paint_brush_selects_what_it_touches() -> None:
    session = covered_ball(60)
    positions = session.document.decals.decals.positions
    session.do(SetValues.each([0], layers=3))
    session.do(LockLayers((3,)))
    actions, met = stroke(session, Brush.PAINT, [(80, 90), (95, 95), (110, 105)])
    gaps = np.linalg.norm(positions[:, None] - np.array(met)[None], axis=2).min(axis=1)
    assert sorted(actions.state.selection) == [
        number for number in np.flatnonzero(gaps < 0.3).tolist() if number
    ]
    assert session.labels == ("set values", LockLayers.label)
    assert actions.state.message == f"{len(actions.state.selection)} decals"


def test_the_relax_brush_moves_decals_within_its_radius_alone() -> None:
    moved = []
    for radius in (0.3, 1.0):
        session = covered_ball(60)
        session.do(PushDecals(TOP, (0.3, 0.0, 0.0), 0.6))
        before = session.document.decals.decals.positions
        session.do(RelaxDecals(TOP, radius))
        changed = (session.document.decals.decals.positions != before).any(axis=1)
        assert (np.linalg.norm(before[changed] - TOP, axis=1) < radius + 1e-6).all()
        moved.append(changed.sum())
    assert 0 < moved[0] < moved[1]
    session.do(RelaxDecals(TOP, 1e308))  # all of them
    assert session.labels[-1] == "relax"
    with pytest.raises(InvalidEdit, match="radius: expected"):
        session.do(RelaxDecals(TOP, float("nan")))
