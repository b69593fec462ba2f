"""What each command does, and what it refuses."""

from typing import Any

import numpy as np
import pytest

from blobtree import Repeat
from decals import DecalImage, Decals, MeshObject, TreeObject, cover, reproduce, scatter
from decals.editing import (
    AddDecals,
    AddImage,
    AddObject,
    DeleteDecals,
    DuplicateDecals,
    EditSession,
    MoveDecals,
    OrderDecals,
    RelaxDecals,
    RemoveImage,
    RemoveObject,
    RenameObject,
    ReplaceDecals,
    ReplaceImage,
    ScaleDecals,
    ScatterDecals,
    ScatterOnCopies,
    SetCamera,
    SetValues,
    TurnDecals,
    nearest_points,
)
from decals.editing import scatter_commands as population
from decals.editing.queries import SurfacePoints
from decals.editing.scatter_commands import decals_on
from decals.errors import InvalidDecals, InvalidEdit, InvalidMesh, InvalidScene
from decals.scattering.neighbors import FacingTree
from tests.decals.editing.scenes import TREE, box, digest, one, scene

CRATE = MeshObject("crate", *box((12, -1, -1), (14, 1, 1)))


@pytest.fixture
def session() -> Any:
    return EditSession(scene())


def test_added_decals_get_the_next_numbers(session: EditSession) -> None:
    decals = session.document.decals
    session.do(AddDecals(one(radius=0.3, images=[1])))
    assert decals.numbers.tolist() == list(range(61))
    assert decals[60].radii[0] == np.float32(0.3)
    session.do(DeleteDecals([60, 3]))
    session.do(AddDecals(one()))
    assert decals.numbers.tolist() == [*range(3), *range(4, 60), 61]


def test_values_are_altered_for_all_or_for_each(session: EditSession) -> None:
    decals = session.document.decals
    session.do(SetValues.each([2, 5], tints=[1, 0.5, 0], layers=3, images=1))
    assert decals.take([2, 5]).tints.tolist() == [[1, 0.5, 0]] * 2
    assert decals.take([2, 5]).layers.tolist() == [3, 3]
    session.do(SetValues.each([5, 2], opacities=[0.25, 0.5]))
    assert decals.take([2, 5]).opacities.tolist() == [0.5, 0.25]
    assert decals.take([1, 3]).layers.tolist() == [0, 0]


def test_scaling_and_turning(session: EditSession) -> None:
    decals = session.document.decals
    before = decals.take([4, 7])
    session.do(ScaleDecals([4, 7], 2.0))
    np.testing.assert_allclose(decals.take([4, 7]).radii, 2 * before.radii, rtol=1e-6)
    session.do(TurnDecals([4, 7], 90.0))
    np.testing.assert_allclose(decals.take([4, 7]).tangents, before.bitangents, atol=1e-6)
    session.do(TurnDecals([4, 7], -90.0))
    np.testing.assert_allclose(decals.take([4, 7]).tangents, before.tangents, atol=1e-6)


def test_a_group_is_carried_as_one_and_lies_on_the_other_object() -> None:
    session = EditSession(scene(count=240))  # so dense that the group is smaller than the side it comes to
    document = session.document
    near = np.argsort(np.linalg.norm(document.decals.decals.positions - (0, 1, 0.2), axis=1))[:3]
    before = document.decals.take(near)
    position, normal = np.array([-2.5, 0.1, 1], np.float32), np.array([0, 0, 1], np.float32)
    session.do(MoveDecals(near, position, normal))
    after = document.decals.take(near)
    np.testing.assert_array_equal(after.positions[0], position)
    np.testing.assert_array_equal(after.normals[0], normal)
    assert set(near.tolist()) <= set(decals_on(document, [1]).tolist())
    np.testing.assert_allclose(after.positions[:, 2], 1.0, atol=1e-6)
    apart = [np.linalg.norm(group.positions - group.positions[0], axis=1) for group in (before, after)]
    np.testing.assert_allclose(apart[0], apart[1], rtol=0.2)


def test_duplicates_lie_beside_on_the_surface(session: EditSession) -> None:
    document = session.document
    session.do(DuplicateDecals([8, 9]))
    copies, firsts = document.decals.take([60, 61]), document.decals.take([8, 9])
    np.testing.assert_array_equal(copies.radii, firsts.radii)
    gaps = np.linalg.norm(copies.positions - firsts.positions, axis=1) / firsts.radii
    assert ((gaps > 0.5) & (gaps < 1.2)).all()
    lying = nearest_points(document.objects, copies.positions)
    np.testing.assert_allclose(lying.positions, copies.positions, atol=1e-5)
    np.testing.assert_allclose(lying.normals, copies.normals, atol=1e-4)


def test_decals_come_to_the_front_and_go_to_the_back(session: EditSession) -> None:
    """Within their layer and interaction, in their own order; undo gives back every number."""
    document = session.document
    with pytest.raises(InvalidEdit, match="push each other"):
        session.do(OrderDecals([3], front=True))
    session.do(SetValues.each(np.arange(10), interactions=2))
    session.do(SetValues.each([4], layers=1))
    first, before = document.decals.decals, digest(document)
    for front, expected in ((True, [0, 1, 3, 5, 7, 8, 9, 2, 6]), (False, [2, 6, 0, 1, 3, 5, 7, 8, 9])):
        command = OrderDecals([6, 2, 20], front)
        after = command.numbers_after(document)
        session.do(command)
        same_rank = [0, 1, 2, 3, 5, 6, 7, 8, 9]
        np.testing.assert_array_equal(document.decals.take(same_rank).positions, first[expected].positions)
        np.testing.assert_array_equal(document.decals.take(after).positions, first[[6, 2, 20]].positions)
        session.undo()
        assert digest(document) == before


def test_receivers_stay_objects_of_the_document(session: EditSession) -> None:
    document = session.document
    names = [item.name for item in document.objects]
    session.do(SetValues.each([1, 2], receivers=names[0]))
    before = digest(document)
    for command in (SetValues.each([3], receivers="none"), RenameObject(0, "other")):
        with pytest.raises(InvalidEdit, match="expected names or labels"):
            session.do(command)
        assert digest(document) == before
    assert document.scene.decals.receivers[:3].tolist() == ["", names[0], names[0]]


def test_images_come_and_go(session: EditSession) -> None:
    document = session.document
    rivet = DecalImage.load("rivet")
    session.do(AddImage(rivet))
    session.do(SetValues.each([0, 1, 2], images=[0, 1, 2]))
    session.do(RemoveImage(1))
    assert document.decals.take([0, 1, 2]).images.tolist() == [0, -1, 1]
    assert document.images[1] is rivet
    session.do(ReplaceImage(0, rivet))
    assert document.images[0] is rivet
    for command in (RemoveImage(2), ReplaceImage(-1, rivet)):
        with pytest.raises(InvalidEdit, match="0 to 1"):
            session.do(command)
    session.undo()
    session.undo()
    assert document.decals.take([0, 1, 2]).images.tolist() == [0, 1, 2]


def test_scattering_replaces_the_coat_of_one_object(session: EditSession) -> None:
    document = session.document
    others = decals_on(document, [0])
    before = document.decals.take(others)
    change = session.do(ScatterDecals((1,), 33, seed=5))
    assert len(decals_on(document, [1])) == 33
    assert document.decals.take(others).packed().tobytes() == before.packed().tobytes()
    assert set(document.decals.take(decals_on(document, [1])).images.tolist()) == {0, 1}
    again = ScatterDecals((1,), 33, seed=5).compute_command(document.objects, 2)
    assert again.decals.packed().tobytes() == change.after.decals.packed().tobytes()


@pytest.mark.parametrize(("count", "each"), [(40, 10), (41, 11), (1, 1), (0, 0)])
def test_copies_of_a_repeat_share_the_count_and_show_the_same_decals(count: int, each: int) -> None:
    wall = Repeat(Repeat(TREE, (6, 0, 0), 2), (0, 0, 6), 2)
    session = EditSession(cover(wall, count=7, images=["eye"]))
    before = digest(session.document)
    session.do(ScatterOnCopies((0,), count, seed=5))
    decals = session.document.decals.decals
    assert len(decals) == 4 * each
    _assert_repeated(decals, scatter(TREE, count=each, seed=5), (6.0, 6.0))
    session.undo()
    assert digest(session.document) == before


def test_copies_of_a_repeat_below_transforms_show_the_same_decals() -> None:
    wall = Repeat(Repeat(TREE, (6, 0, 0), 2).translate((0, 5, 0)), (0, 0, 6), 2).scale((2.0, 1.0, 1.0))
    session = EditSession(cover(wall, count=7, images=["eye"]))
    session.do(ScatterOnCopies((0,), 40, seed=5))
    alone = scatter(TREE.translate((0, 5, 0)).scale((2.0, 1.0, 1.0)), count=10, seed=5)
    _assert_repeated(session.document.decals.decals, alone, (12.0, 6.0))
    assert reproduce(session.document.scene).equal


def _assert_repeated(decals: Decals, alone: Decals, steps: tuple[float, float]) -> None:
    """Assert that decals are those of one copy, moved by the steps of a grid of two by two."""
    x, z = steps
    for copy, offset in enumerate(((0, 0, 0), (x, 0, 0), (0, 0, z), (x, 0, z))):
        part = decals[copy * len(alone) : (copy + 1) * len(alone)]
        np.testing.assert_allclose(part.positions, alone.positions + offset, atol=1e-5)
        np.testing.assert_allclose(part.tangents, alone.tangents, atol=1e-5)


def test_relaxing_parts_those_that_crowd_and_leaves_the_far_ones(session: EditSession) -> None:
    document = session.document
    session.do(ReplaceDecals((0, 1), scene(400).decals))
    numbers = document.decals.numbers
    place = document.decals.take(numbers[:1]).positions[0]
    near = np.argsort(np.linalg.norm(document.decals.decals.positions - place, axis=1))[:4]
    for other in near[1:]:
        goal = 0.8 * place + 0.2 * document.decals.take(numbers[other : other + 1]).positions[0]
        session.do(
            MoveDecals(numbers[[other]], *(rows[0] for rows in document.objects[0].surface.project([goal])))
        )
    before = document.decals.decals
    change = session.do(RelaxDecals(place))
    after = document.decals.decals
    moved = (after.positions != before.positions).any(axis=1)
    assert 3 < moved.sum() < 200
    np.testing.assert_array_equal(numbers[moved], np.sort(change.after.numbers))
    assert np.linalg.norm(before.positions[moved] - place, axis=1).max() < 8 * before.radii.max()
    assert least_gap(after) > 3 * least_gap(before)
    np.testing.assert_array_equal(after.radii, before.radii)


def test_relaxing_asks_for_the_neighbourhood_alone(
    session: EditSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many decals there are, what a window waits for does not grow."""
    session.do(ReplaceDecals((0, 1), scene(400).decals))
    asked: list[int] = []

    def counted(objects: Any, points: Any) -> SurfacePoints:
        asked.append(len(points))
        return nearest_points(objects, points)

    monkeypatch.setattr(population, "nearest_points", counted)
    change = session.do(RelaxDecals(session.document.decals.decals.positions[0]))
    assert len(change.after.numbers) <= sum(asked) < len(session.document.decals)


def test_relaxing_where_no_decal_is_near_does_nothing(session: EditSession) -> None:
    session.do(AddObject(CRATE))
    before = digest(session.document)
    assert session.do(RelaxDecals((13, 1, 1))).empty
    assert digest(session.document) == before


def least_gap(decals: Any) -> Any:
    tree = FacingTree(decals.positions, decals.normals)
    return tree.nearest(decals.positions, decals.normals, count=1, skip_self=True)[0].min()


def test_layers_that_do_not_crowd_stay_where_they_are(session: EditSession) -> None:
    document = session.document
    place = document.decals[0].positions[0]
    session.do(AddDecals(document.decals[0].replace(layers=[2], radii=[0.01])))
    session.do(AddDecals(document.decals[0].replace(layers=[2], radii=[0.01])))
    change = session.do(RelaxDecals(place + np.float32(0.5)))
    assert not {60, 61} & set(change.after.numbers.tolist())


NAN = np.array([np.nan, 0, 0], np.float32)


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (DeleteDecals([60]), InvalidDecals, "got 60"),
        (DeleteDecals([1, 1]), InvalidDecals, "each number once"),
        (ScaleDecals([0], 0.0), InvalidDecals, "radii"),
        (ScaleDecals([0], np.inf), InvalidEdit, "factor"),
        (TurnDecals([0], np.nan), InvalidEdit, "degrees"),
        (SetValues.each([0], images=2), InvalidEdit, "expected an image from 0 to 1, got 2"),
        (SetValues.each([0], colour=2), InvalidEdit, "'layers', got 'colour'"),
        (SetValues.each([0], tints=[0, 2, 0]), InvalidDecals, "tints"),
        (AddDecals(one(images=[7])), InvalidEdit, "add the image first"),
        (
            MoveDecals([0], NAN, np.ones(3, np.float32)),
            InvalidEdit,
            "position: expected three finite numbers",
        ),
        (
            MoveDecals([0], np.zeros(3, np.float32), np.zeros(3, np.float32)),
            InvalidEdit,
            "a zero vector",
        ),
        (RelaxDecals(NAN), InvalidEdit, "point"),
        (ScatterDecals((2,), 5), InvalidEdit, "object: .* from 0 to 1, got 2"),
        (ScatterDecals((0,), -5), InvalidEdit, "got -5"),
        (ScatterOnCopies((0,), 5), InvalidEdit, "one object whose root is a Repeat"),
        (ScatterOnCopies((0, 1), 5), InvalidEdit, "one object whose root is a Repeat"),
        (ScatterOnCopies((0,), 5, mask=len), InvalidEdit, "mask: expected none"),
        (ScatterOnCopies((2,), 5), InvalidEdit, "object: .* from 0 to 1, got 2"),
        (ReplaceDecals((-1,), one()), InvalidEdit, "0 to 1, got -1"),
    ],
)
def test_what_makes_no_sense_is_refused_and_changes_nothing(
    session: Any, command: Any, error: Any, message: Any
) -> None:
    before = digest(session.document)
    with pytest.raises(error, match=message):
        session.do(command)
    assert digest(session.document) == before
    assert session.labels == ()
    assert not session.modified


def test_looking_is_a_command_too(session: EditSession) -> None:
    camera = scene().camera
    session.do(SetCamera(type(camera)((9, 9, 9))))
    assert session.document.scene.camera.position == (9, 9, 9)
    session.undo()
    assert session.document.camera is camera


def test_an_object_is_added_and_decals_go_onto_it(session: EditSession) -> None:
    document = session.document
    first = digest(document)
    session.do(AddObject(CRATE))
    assert document.objects[2] is CRATE
    session.do(MoveDecals([3], np.array([13, 0, 1], np.float32), np.array([0, 0, 1], np.float32)))
    assert decals_on(document, [2]).tolist() == [3]
    session.undo()
    session.undo()
    assert digest(document) == first


def test_an_object_goes_with_the_decals_that_lie_on_it_and_comes_back_with_them(session: EditSession) -> None:
    document = session.document
    session.do(AddObject(CRATE))
    first = digest(document)
    lying = decals_on(document, [0])
    assert 0 < len(lying) < 60
    session.do(RemoveObject(0))
    assert [item.name for item in document.objects] == ["box", "crate"]
    assert not document.decals.has(lying).any()
    assert len(document.decals) == 60 - len(lying)
    last = digest(document)
    session.undo()
    assert digest(document) == first
    session.redo()
    assert digest(document) == last


def test_all_objects_may_go(session: EditSession) -> None:
    first = digest(session.document)
    for _ in range(2):
        session.do(RemoveObject(0))
    assert session.document.objects == ()
    assert len(session.document.decals) == 0
    assert session.document.scene.objects == ()
    with pytest.raises(InvalidEdit, match="object: expected no index, as the scene has none of these, got 0"):
        session.do(RemoveObject(0))
    session.undo()
    session.undo()
    assert digest(session.document) == first


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (AddObject(None), InvalidEdit, "a MeshObject or a TreeObject to add, got None"),  # type: ignore[arg-type]
        (AddObject(TreeObject("box", TREE)), InvalidScene, "'box' twice"),
        (AddObject(TreeObject("hollow", TREE - TREE.scale(3))), InvalidMesh, "surface"),
        (RemoveObject(2), InvalidEdit, "from 0 to 1, got 2"),
        (RemoveObject(-1), InvalidEdit, "from 0 to 1, got -1"),
    ],
)
def test_objects_that_cannot_come_or_go(session: Any, command: Any, error: Any, message: Any) -> None:
    before = digest(session.document)
    with pytest.raises(error, match=message):
        session.do(command)
    assert digest(session.document) == before


def test_a_coat_that_was_made_for_what_is_no_more_is_refused(session: EditSession) -> None:
    coat = ScatterDecals((1,), 20).compute_command(session.document.objects, 2)
    session.do(RemoveObject(0))
    with pytest.raises(InvalidEdit, match="0 to 0, got 1"):
        session.do(coat)
    session.do(AddObject(CRATE))
    before = digest(session.document)
    with pytest.raises(InvalidEdit, match="changed while its new decals were computed"):
        session.do(coat)
    assert digest(session.document) == before
    session.undo()
    session.undo()
    session.do(coat)
    assert len(decals_on(session.document, [1])) == 20
