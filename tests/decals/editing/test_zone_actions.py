"""Zones of an editor: where decals are replaced, how many, and that all others stay bit by bit."""

from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Point
from blobtree._typing import IndexArray
from decals.editing import Actions, EditSession, ScatterDecals
from decals.errors import InvalidEdit, InvalidInput
from tests.decals.editing.scenes import digest

BALLS = Point((0, 0, 0), radius=1.0) + Point((4, 0, 0), radius=0.5)
"""Two balls that do not touch; the small one has a fifth of the area."""

SMALL = np.array([4.0, 0, 0])


def editing(models: Any, count: int = 100) -> Actions:
    return Actions(EditSession(decals.cover(models, count=count, images=["scale", "eye"])))


def changes(actions: Actions, numbers: IndexArray) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions of the decals that are gone, and of new ones; undo, and compare all others."""
    undone = actions.state.session
    after = undone.document.decals
    new = np.setdiff1d(after.numbers, numbers)
    assert set(actions.state.selection) == set(new.tolist())
    there, states = after.take(new).positions, after.numbers
    kept = after.take(np.intersect1d(states, numbers)).positions
    undone.undo()
    before = undone.document.decals
    np.testing.assert_array_equal(kept, before.take(np.intersect1d(states, numbers)).positions)
    return before.take(np.setdiff1d(numbers, states)).positions, there


@pytest.mark.parametrize("density", [1.0, 3.0])
def test_a_part_of_a_model_gets_decals_of_its_own(density: float) -> None:
    actions = editing(BALLS)
    document = actions.state.session.document
    before, numbers = digest(document), document.decals.numbers
    actions.state.select_primitive(0, (1,), np.zeros(3, np.float32))
    actions.zones.scatter(100, 3, density, images=[1])
    chosen = document.decals.take(np.array(actions.state.selection))
    assert set(chosen.images.tolist()) == {1}
    assert actions.state.nodes == ()
    assert abs(len(chosen) - 20 * density) <= 1
    assert actions.state.session.labels == ("scatter on Point",)
    gone, new = changes(actions, numbers)
    assert max(np.linalg.norm(places - SMALL, axis=1).max() for places in (gone, new)) < 0.6
    assert len(gone) == (np.linalg.norm(document.decals.decals.positions - SMALL, axis=1) < 0.6).sum()
    assert digest(document) == before


def test_a_zone_of_decals_is_where_they_are_the_nearest() -> None:
    ball = Point((0, 0, 0), radius=1.0).to_pyvista(resolution=24)
    actions = editing(ball, 80)
    document = actions.state.session.document
    positions, numbers = document.decals.decals.positions.astype(np.float64), document.decals.numbers
    above = positions[:, 1] > 0.3
    actions.state.selection = tuple(numbers[above].tolist())
    actions.zones.scatter(None, 1)
    assert actions.state.session.labels == (f"scatter in place of {above.sum()} decals",)
    gone, new = changes(actions, numbers)
    np.testing.assert_array_equal(gone, positions[above].astype(np.float32))
    nearest = np.linalg.norm(new[:, None] - positions[None], axis=2).argmin(axis=1)
    assert above[nearest].all()
    assert abs(len(new) - above.sum()) <= 3


def test_the_history_names_the_zone() -> None:
    actions = editing(BALLS, 20)
    state, document = actions.state, actions.state.session.document
    actions.outline.change("0/1", "rename", "small ball", [])
    state.select_primitive(0, (1,), np.zeros(3, np.float32))
    actions.zones.scatter(20, 3)
    (one, *_) = state.selection = state.selection[:1]
    actions.zones.scatter(20, 4)
    assert one not in document.decals.numbers
    state.selection = ()
    actions.trees.select_node(0, (0,))
    actions.trees.select_also(0, (1,), toggle=True)
    actions.zones.scatter(20, 5)
    assert state.session.labels[1:] == (
        "scatter on small ball",
        "scatter in place of 1 decal",
        "scatter on 2 parts",
    )


def test_a_zone_that_is_none_is_refused() -> None:
    actions = editing(BALLS, 12)
    document = actions.state.session.document
    before = digest(document)
    with pytest.raises(InvalidEdit, match="no zone is selected; click on a part"):
        actions.zones.scatter(12, 1)
    actions.state.select_primitive(0, (1,), np.zeros(3, np.float32))
    for count, seed, density in ((12, 1, 0.0), (12, 1, float("nan")), (-1, 1, 1.0), (12, -1, 1.0)):
        with pytest.raises(InvalidInput, match="expected"):
            actions.zones.scatter(count, seed, density)
    with pytest.raises(InvalidEdit, match="mask: expected a function"):
        actions.state.session.do(ScatterDecals((0,), 12, 1, {}, "x"))  # type: ignore[arg-type]
    assert digest(document) == before
