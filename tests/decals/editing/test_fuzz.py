"""Random commands: none breaks anything, undoing all gives back the first state, redoing all the last."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from decals.editing import EditSession
from decals.editing.background import BackgroundJobs
from decals.editing.session import step_of
from decals.errors import ImplicitDecalsError
from tests.decals.editing.fuzz import RandomCommands
from tests.decals.editing.scenes import digest, goes_back_and_forth, scene


def play(session: Any, monkey: Any, count: int) -> Any:
    """Do so many things; how often what was tried, and what failed."""
    done = failed = 0
    while done < count:
        choice = monkey.rng.random()
        if choice < 0.12:
            session.undo()
        elif choice < 0.2:
            session.redo()
        elif choice < 0.23:
            session.begin_stroke("stroke")
        elif choice < 0.26:
            session.end_stroke() if choice < 0.25 else session.cancel_stroke()
        else:
            command = monkey.command()
            before = digest(session.document)
            try:
                session.do(command)
            except ImplicitDecalsError:
                assert digest(session.document) == before, command
                failed += 1
            done += 1
        check_whole(session.document)
    return failed


def check_whole(document: Any) -> None:
    """What holds of every document: images are there, and the index is that of the decals."""
    decals = document.decals.decals
    assert decals.images.max(initial=-1) < len(document.images)
    assert len(document.decals) == len(decals) == len(document.decals.numbers)


@pytest.mark.parametrize(("seed", "count"), [(0, 200), pytest.param(1, 4_000, marks=pytest.mark.slow)])
def test_random_commands_and_back(seed: int, count: int) -> None:
    session = EditSession(scene())
    first = digest(session.document)
    monkey = RandomCommands(seed, session.document, scene(200).decals)
    failed = play(session, monkey, count)
    assert 0.02 * count < failed < 0.6 * count
    session.end_stroke()
    last, entries = digest(session.document), len(session.labels)
    assert entries > 0.2 * count
    while session.undo() is not None:
        pass
    assert digest(session.document) == first
    while len(session.labels) < entries:  # what was undone in the end may be done again after that
        assert session.redo() is not None
    assert digest(session.document) == last


def test_the_index_is_that_of_a_fresh_build_after_random_commands() -> None:
    from decals import evaluate

    session = EditSession(scene())
    play(session, RandomCommands(2, session.document, scene(200).decals), 150)
    editor = session.document.decals
    known = editor.decals
    which, ways = np.random.default_rng(0).integers(len(known), size=2000), np.random.default_rng(1)
    points = known.positions[which] + known.radii[which, None] * ways.uniform(-0.7, 0.7, (2000, 3))
    normals = known.normals[which]
    fresh = evaluate(known, points, normals)
    edited = evaluate(editor, points, normals)
    assert (fresh.owner >= 0).any()
    np.testing.assert_array_equal(edited.owner, np.where(fresh.owner < 0, -1, editor.numbers[fresh.owner]))
    np.testing.assert_allclose(edited.uv, fresh.uv, atol=1e-6)


def tried(session: Any, command: Any) -> None:
    """Do a command that may make no sense."""
    with suppress(ImplicitDecalsError):
        session.do(command)


@pytest.mark.slow_cases("3-40-0")
@pytest.mark.parametrize(
    ("seed", "count", "few"),
    [(3, 40, 0), (5, 40, 500), *(pytest.param(4, 400, few, marks=pytest.mark.slow) for few in (0, 500))],
)
def test_random_commands_in_the_background_while_hands_go_on(
    seed: int, count: int, few: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each comes after what user do until it is seen, whatever either of them is."""
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", few)
    session, shadow = EditSession(scene()), EditSession(scene())
    background = BackgroundJobs(
        session, lambda _text: None, session.end_stroke, lambda _error: None, threaded=True
    )
    monkey = RandomCommands(seed, session.document, scene(200).decals)
    for _ in range(count):
        slow = monkey.command()
        background.edit("slow", step_of(slow))
        for _ in range(monkey.rng.integers(3)):
            quick = monkey.command()
            tried(session, quick)
            tried(shadow, quick)
        undone = monkey.rng.random() < 0.2
        if undone:
            assert session.undo() == shadow.undo()
        while background.busy:
            background.poll(timeout=30.0)
        tried(shadow, slow)
        assert session.labels == shadow.labels
        assert content(session) == content(shadow)
        check_whole(session.document)
    goes_back_and_forth(session)


def content(session: Any) -> Any:
    """Decals and their numbers; objects of two sessions are not the same ones."""
    decals = session.document.decals
    names = [item.name for item in session.document.objects]
    return decals.numbers.tolist(), decals.decals.packed().tobytes(), names, len(session.document.images)
