"""Whatever comes between long edits and hands, nothing is lost."""

from functools import partial
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decals.edit import Actions, EditSession
from decals.edit.background import WAIT
from decals.scenes.scene_file import load_scene
from tests.edit.background import LONG, surface_pick, threaded
from tests.edit.scenes import digest, goes_back_and_forth, scene

pytestmark = pytest.mark.usefixtures("few_are_many")

KEYS = (
    "larger", "turn_left", "delete", "duplicate", "next_tint", "fainter", "layer_up", "relax", "place",
    "undo", "undo", "redo", "redo",
)  # fmt: skip
OPERATIONS = st.one_of(
    st.tuples(st.just("press"), st.sampled_from(KEYS), st.sampled_from(["all", "one", "two"])),
    st.tuples(st.sampled_from(["look", "look", "escape", "save"])),
)


class Twins:
    """Actions in a thread, and others at once that are asked when the thread's are seen."""

    def __init__(self, path):
        self.live, self.shadow = threaded(path=path), Actions(EditSession(scene()))
        self.path, self.pending, self.saved = Path(path), None, None

    def press(self, key, chosen):
        numbers = self.live.session.document.decals.numbers
        selection = {"all": numbers, "one": numbers[:1], "two": numbers[-2:]}[chosen]
        at, was_busy = surface_pick(self.live), self.live.background.busy_editing
        entries = self.shadow.session.next_undo, self.shadow.session.next_redo
        self.live.selection = tuple(selection.tolist())
        self.live.perform(key, lambda: at)
        echo = partial(self._echo, key, tuple(selection.tolist()), at, entries)
        if self.live.background.busy_editing and not was_busy:
            self.pending = echo
        elif self.live.message != WAIT:
            echo()

    def _echo(self, key, selection, at, entries):
        """Do what was seen now; an undo only where nothing else came before it."""
        now = self.shadow.session.next_undo, self.shadow.session.next_redo
        if (key == "undo" and now[0] is not entries[0]) or (key == "redo" and now[1] is not entries[1]):
            return
        self.shadow.selection = selection
        self.shadow.perform(key, lambda: at)

    def look(self):
        self.live.background.look(timeout=LONG)
        if not self.live.background.busy_editing and self.pending is not None:
            self.pending()
            self.pending = None

    def escape(self):
        self.live.background.cancel()
        self.pending = None

    def save(self):
        self.saved = self.live.session.document.decals.decals.packed().tobytes()
        self.live.perform("save", lambda: None)

    def settle(self):
        while self.live.background.busy:
            self.look()

    def same(self):
        return digest(self.live.session.document) == digest(self.shadow.session.document)


@settings(max_examples=40, deadline=None)
@given(operations=st.lists(OPERATIONS, max_size=14), few=st.sampled_from([0, 5, 500]))
def test_whatever_comes_between_nothing_is_lost(tmp_path_factory, operations, few):
    with patch("decals.edit.session.FEW", few):
        go_through(operations, tmp_path_factory)


def go_through(operations, tmp_path_factory):
    twins = Twins(tmp_path_factory.mktemp("saves") / "scene.json")
    for name, *arguments in operations:
        getattr(twins, name)(*arguments)
        if twins.pending is None:
            assert twins.same()
    twins.settle()
    assert twins.same()
    twins.live.settle()
    goes_back_and_forth(twins.live.session)
    if twins.saved is not None:
        assert load_scene(twins.path).decals.packed().tobytes() == twins.saved
