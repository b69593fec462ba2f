"""Forks of a session: they go their own way until they are adopted."""

from typing import Any

import pytest

from decals.editing import DeleteDecals, EditSession, ScaleDecals, TurnDecals
from decals.editing.document import Edit
from tests.decals.editing.scenes import digest, scene

pytestmark = pytest.mark.usefixtures("few_are_many")


def test_what_few_decals_come_to_is_a_change_of_these_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", 500)
    session = EditSession(scene())
    editor = session.document.decals
    version = editor.version
    fork = session.fork()
    fork.do(ScaleDecals([1, 4], 2.0))
    assert session.adopt(fork)
    records = editor.changed_rows(version)["decal_records"]
    assert sum(end - first for first, end in records) == 8
    assert editor.changed_balls(version) is not None


def test_a_fork_goes_its_own_way_and_is_adopted_once() -> None:
    session = EditSession(scene())
    session.do(ScaleDecals([1], 2.0))
    first = digest(session.document)
    heard: list[Edit] = []
    session.subscribe(heard.append)
    fork = session.fork()
    fork.undo()
    fork.do(DeleteDecals([3, 4]))
    assert digest(session.document) == first
    late = session.fork()
    assert session.adopt(fork)
    assert [change.after.numbers.tolist() for change in heard] == [[1], [3, 4]]
    assert session.labels == ("delete",)
    assert not session.document.decals.has([3]).any()
    assert not session.adopt(late)
    assert not EditSession(scene()).adopt(session.fork())
    session.undo()
    assert digest(session.document) == digest(EditSession(scene()).document)


@pytest.mark.parametrize("few", [0, 500])
def test_a_fork_of_a_fork_brings_all_that_was_done(monkeypatch: pytest.MonkeyPatch, few: Any) -> None:
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", few)
    session, alone = EditSession(scene()), EditSession(scene())
    fork = session.fork()
    further = fork.fork()
    for command in (ScaleDecals([1, 4], 2.0), DeleteDecals([3])):
        further.do(command)
        alone.do(command)
    assert fork.adopt(further)
    fork.do(TurnDecals([5], 9.0))
    alone.do(TurnDecals([5], 9.0))
    assert session.adopt(fork)
    assert session.labels == alone.labels
    assert digest(session.document) == digest(alone.document)
