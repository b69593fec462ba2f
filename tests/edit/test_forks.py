"""Forks of a session: they go their own way until they are adopted."""

import pytest

from decals.edit import Delete, EditSession, Scale, Turn
from tests.edit.scenes import digest, scene

pytestmark = pytest.mark.usefixtures("few_are_many")


def test_what_few_decals_come_to_is_a_change_of_these_alone(monkeypatch):
    monkeypatch.setattr("decals.edit.session.FEW", 500)
    session = EditSession(scene())
    editor = session.document.decals
    version = editor.version
    fork = session.fork()
    fork.do(Scale([1, 4], 2.0))
    assert session.adopt(fork)
    records = editor.changes(version)["decal_records"]
    assert sum(end - first for first, end in records) == 8
    assert editor.touched(version) is not None


def test_a_fork_goes_its_own_way_and_is_adopted_once():
    session = EditSession(scene())
    session.do(Scale([1], 2.0))
    first, heard = digest(session.document), []
    session.listen(heard.append)
    fork = session.fork()
    fork.undo()
    fork.do(Delete([3, 4]))
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
def test_a_fork_of_a_fork_brings_all_that_was_done(monkeypatch, few):
    monkeypatch.setattr("decals.edit.session.FEW", few)
    session, alone = EditSession(scene()), EditSession(scene())
    fork = session.fork()
    further = fork.fork()
    for command in (Scale([1, 4], 2.0), Delete([3])):
        further.do(command)
        alone.do(command)
    assert fork.adopt(further)
    fork.do(Turn([5], 9.0))
    alone.do(Turn([5], 9.0))
    assert session.adopt(fork)
    assert session.labels == alone.labels
    assert digest(session.document) == digest(alone.document)
