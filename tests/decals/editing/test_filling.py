"""Bare places that pulls open: found as a plain search over all decals finds them, and filled."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Node, Point, Segment
from decals import evaluate
from decals.editing import (
    Actions,
    DeleteDecals,
    EditSession,
    FillBarePlaces,
    LockLayers,
    MovePrimitive,
    SetParameter,
    SetValues,
)
from decals.editing.bare_watch import BareWatch
from decals.errors import InvalidEdit
from decals.model import FACING_LIMIT
from tests.decals.editing.scenes import digest, tree_of

SAMPLES = 60_000
"""Points of the independent search."""

SPECKS = 3
"""Most of them that may stay bare: specks between the samples of the product."""


def random_tree(rng: np.random.Generator) -> Node:
    """Two to five round parts, each beside one of those before."""
    ends = [np.zeros(3)]
    tree: Node = Point((0, 0, 0), radius=1.0)
    for _ in range(rng.integers(1, 5)):
        start = ends[rng.integers(len(ends))]
        way = rng.normal(size=3)
        end, radius = start + rng.uniform(0.8, 1.3) * way / np.linalg.norm(way), rng.uniform(0.35, 0.8)
        first, last = ((float(x), float(y), float(z)) for x, y, z in (start, end))
        kinds = (Point(last, radius=radius), Segment(first, last, radius=radius))
        tree += kinds[rng.integers(2)]
        ends.append(end)
    return tree


def pulled(seed: int, count: int) -> tuple[EditSession, Any]:
    """A covered random tree, one part of which a pull moves or enlarges; its edit."""
    rng = np.random.default_rng(seed)
    scene = decals.cover(random_tree(rng), count=count, images=["eye", "scale"], seed=seed)
    session = EditSession(scene)
    parts = len(tree_of(session.document).children)
    path: tuple[int, ...] = (int(rng.integers(parts)),)
    way = rng.normal(size=3)
    while tree_of(session.document).children and not hasattr(node(session, path), "radius"):
        path = (*path, int(rng.integers(len(node(session, path).children))))
    if rng.random() < 0.3:
        radius = float(node(session, path).radius)  # type: ignore[attr-defined]
        return session, session.do(SetParameter(0, path, "radius", 1.6 * radius))
    offset = rng.uniform(0.6, 1.2) * way / np.linalg.norm(way)
    return session, session.do(MovePrimitive(0, path, offset))


def node(session: EditSession, path: tuple[int, ...]) -> Node:
    part = tree_of(session.document)
    for step in path:
        part = part.children[step]
    return part


def bare(session: EditSession, seed: int = 99, number: int = 0) -> np.ndarray:
    """Random points of an object that no decal colours, by `evaluate` and by a plain search beside it.

    The search knows balls alone: a point outside the balls of all decals that face it is bare in any mode.
    """
    item = session.document.objects[number]
    points, normals = item.surface.sample(SAMPLES, seed)
    shown = evaluate(session.document.decals, points, normals, on=item).owner >= 0
    cloud = session.document.decals.decals
    rows = np.flatnonzero(~shown)[:500]
    rows = np.concatenate([rows, np.arange(0, SAMPLES, 150)])
    offsets = points[rows, None].astype(np.float64) - cloud.positions
    near = np.linalg.norm(offsets, axis=2) < cloud.radii
    near &= normals[rows].astype(np.float64) @ cloud.normals.T.astype(np.float64) > FACING_LIMIT
    assert not (shown[rows] & ~near.any(axis=1)).any()
    result: np.ndarray = points[~shown]
    return result


def counted(watch: BareWatch) -> int:
    """Let the count end."""
    watch.update(resting=True)
    while watch.busy:
        watch.update(resting=True)
    return watch.places


@pytest.mark.parametrize(
    ("seed", "count"), [(1, 60), *(pytest.param(seed, 80, marks=pytest.mark.slow) for seed in range(2, 13))]
)
def test_places_that_a_pull_opens_are_filled(seed: int, count: int) -> None:
    session, edit = pulled(seed, count)
    before, kept = digest(session.document), session.document.decals.decals
    opened = len(bare(session))
    assert opened > 0.002 * SAMPLES, "the pull opens nothing: choose another seed"
    places = counted(BareWatch(session))
    filling = session.do(FillBarePlaces((0,), opened_by=edit))
    assert len(bare(session)) <= SPECKS
    assert decals.measure(session.document.scene, seed=7).coverage > 0.9999
    present = session.document.decals.decals
    for name in ("positions", "normals", "tangents", "radii", "images", "layers"):
        np.testing.assert_array_equal(getattr(present, name)[: len(kept)], getattr(kept, name))
    added = present[np.arange(len(kept), len(present))]
    np.testing.assert_array_equal(filling.after.decals.positions, added.positions)
    assert added.radii.max() <= 1.2 * kept.radii.max()
    assert added.radii.min() >= 0.5 * kept.radii.min()
    assert {*added.images.tolist()} <= {*kept.images.tolist()}
    assert abs(tree_of(session.document)(added.positions) - 0.5).max() < 1e-3
    area, radius = surface_area(session), float(np.median(kept.radii))
    small_discs = area * opened / SAMPLES / (0.3 * radius) ** 2  # over large places; else one for each place
    assert len(added) <= 3 + 1.5 * places + small_discs
    assert session.labels[-1] == "fill bare places"
    session.undo()
    assert digest(session.document) == before
    session.redo()
    assert len(bare(session)) <= SPECKS


@pytest.mark.slow
def test_the_same_seed_fills_the_same() -> None:
    first, second = (pulled(1, 60)[0] for _ in range(2))
    for session in (first, second):
        session.do(FillBarePlaces((0,), seed=3))
    assert digest_of_decals(first) == digest_of_decals(second)


def digest_of_decals(session: EditSession) -> bytes:
    cloud = session.document.decals.decals
    return b"".join(getattr(cloud, name).tobytes() for name in ("positions", "tangents", "radii", "images"))


@cache
def upper_half() -> Any:
    """A ball with an arm, covered above the plane z = 0 alone."""
    tree = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0.6), (0, 0, 1.2), radius=0.5)
    scene = decals.cover(tree, count=90, images=["eye"])
    return scene.replace(decals=scene.decals[np.flatnonzero(scene.decals.positions[:, 2] > 0.0)])


def surface_area(session: EditSession) -> float:
    return float(session.document.objects[0].surface.area)


def test_places_that_were_bare_before_stay_bare() -> None:
    session = EditSession(upper_half())
    lower, area = bare(session), surface_area(session)
    assert (lower[:, 2] < 0.3).all()
    edit = session.do(MovePrimitive(0, (1,), (0.3, 0, 0.9)))
    opened = bare(session)
    assert (opened[:, 2] > 0.5).sum() > 100
    session.do(FillBarePlaces((0,), opened_by=edit))
    after = bare(session)
    assert (after[:, 2] < 0.45).all()
    assert surface_area(session) * len(after) > 0.9 * area * len(lower)
    session.do(FillBarePlaces((0,)))
    assert len(bare(session)) <= SPECKS


def test_a_covered_object_gets_nothing() -> None:
    session = EditSession(upper_half())
    session.do(FillBarePlaces((0,)))
    assert session.do(FillBarePlaces((0,))).empty
    assert session.labels == ("fill bare places",)
    assert session.do(FillBarePlaces(())).empty


@pytest.mark.slow
def test_holes_of_a_mesh_are_filled_like_their_neighbours() -> None:
    import pyvista as pv

    scene = decals.cover([pv.Cube(), pv.Sphere(center=(3, 0, 0))], count=150, images=["eye", "scale"])
    on_cube = scene.decals.positions[:, 0] < 1.5
    scene = scene.replace(decals=scene.decals.replace(images=np.where(on_cube, 0, 1), layers=2))
    session = EditSession(scene)
    session.do(DeleteDecals(np.flatnonzero(on_cube)[::4]))
    assert len(bare(session)) > 0
    session.do(FillBarePlaces((0,)))
    assert len(bare(session)) <= SPECKS
    added = session.document.decals.decals[len(scene.decals) - len(np.flatnonzero(on_cube)[::4]) :]
    assert {*added.images.tolist()} == {0}
    assert {*added.layers.tolist()} == {2}


@pytest.mark.slow
def test_locked_layers_get_no_decals() -> None:
    session = EditSession(upper_half())
    count = len(session.document.decals)
    session.do(SetValues.each(np.arange(0, count, 2), layers=1))
    session.do(LockLayers((1,)))
    session.do(FillBarePlaces((0,)))
    added = session.document.decals.decals[count:]
    assert {*added.layers.tolist()} == {0}
    session.do(LockLayers((0, 1)))
    with pytest.raises(InvalidEdit, match="unlocked"):
        session.do(FillBarePlaces((0,)))


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (FillBarePlaces((1,)), "object: expected"),
        (FillBarePlaces("0"), "objects: expected"),  # type: ignore[arg-type]
        (FillBarePlaces((0,), seed=-1), "seed: expected"),
        (FillBarePlaces((0,), opened_by=3), "opened_by: expected"),  # type: ignore[arg-type]
    ],
)
def test_wrong_values_are_refused(command: Any, message: str) -> None:
    with pytest.raises(InvalidEdit, match=message):
        EditSession(upper_half()).do(command)


def test_more_places_than_one_command_fills_are_refused() -> None:
    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=50)
    session = EditSession(scene.replace(decals=scene.decals.replace(radii=scene.decals.radii * 0.005)))
    with pytest.raises(InvalidEdit, match=r"at most 200,000 decals, got some for about .* of radius 0\.00"):
        session.do(FillBarePlaces((0,)))
    assert len(session.document.decals.numbers) == 50


def test_a_scene_without_decals_has_nothing_to_be_like() -> None:
    session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=0, images=["eye"]))
    with pytest.raises(InvalidEdit, match="scatter some"):
        session.do(FillBarePlaces((0,)))


def test_places_are_offered_after_a_pull_and_filled_by_one_action() -> None:
    session, _ = pulled(1, 60)
    actions = Actions(session)
    places = counted(actions.bare)
    assert places > 0
    actions.perform("fill", lambda: None)
    assert actions.state.message.endswith("fill the bare places")
    assert len(bare(session)) <= SPECKS
    assert counted(actions.bare) == 0
    actions.perform("undo", lambda: None)
    assert counted(actions.bare) == places
    actions.perform("undo", lambda: None)
    assert counted(actions.bare) == 0
    actions.perform("fill", lambda: None)
    assert "no surface under the cursor" in actions.state.message


@pytest.mark.slow
def test_nothing_is_offered_while_a_stroke_is_open_or_where_nothing_opened() -> None:
    session, _ = pulled(1, 60)
    watch = BareWatch(session)
    assert counted(watch) > 0
    session.begin_stroke("drag")
    watch.update(resting=True)
    assert watch.offer is None
    assert not watch.busy
    session.cancel_stroke()
    assert counted(watch) > 0
    session.do(DeleteDecals([0, 1, 2]))  # holes that the user made
    assert counted(watch) == 0
    watch.close()
    half = EditSession(upper_half())
    half.do(MovePrimitive(0, (1,), (0.001, 0, 0)))  # the lower half was bare before
    assert counted(BareWatch(half)) == 0
