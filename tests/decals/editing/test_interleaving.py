"""Whatever comes between long edits and user, nothing is lost."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decals import load_scene
from decals.editing import Actions, EditSession
from decals.editing.background import BUSY
from tests.decals.editing.background import LONG, surface_pick, threaded
from tests.decals.editing.scenes import digest, goes_back_and_forth, scene

pytestmark = pytest.mark.usefixtures("few_are_many")

KEYS = (
    "larger", "turn_left", "delete", "duplicate", "next_tint", "fainter", "layer_up", "relax", "add_decal",
    "undo", "undo", "redo", "redo",
)  # fmt: skip
OPERATIONS = st.one_of(
    st.tuples(st.just("press"), st.sampled_from(KEYS), st.sampled_from(["all", "one", "two"])),
    st.tuples(st.sampled_from(["look", "look", "escape", "save"])),
)


class ThreadedAndDirect:
    """Actions in a thread, and others at once that are asked when the thread's are seen."""

    def __init__(self, path: Any) -> None:
        self.live, self.shadow = threaded(path=path), Actions(EditSession(scene()))
        self.path, self.saved = Path(path), None
        self.pending: Callable[[], None] | None = None
        self.pressed: Any = None
        self.requests: dict[Any, Any] = {}
        self.attempt, self.live.state.attempt = self.live.state.attempt, self._attempt

    def press(self, key: Any, chosen: Any) -> None:
        numbers = self.live.state.session.document.decals.numbers
        selection = {"all": numbers, "one": numbers[:1], "two": numbers[-2:]}[chosen]
        self.live.state.selection = tuple(selection.tolist())
        self.pressed = key, surface_pick(self.live)
        self.live.perform(key, lambda at=self.pressed[1]: at)

    def _attempt(self, request: Any, *, waits: bool = True) -> None:
        """Carry out a request, at once or after another one, and echo it once it is seen."""
        background = self.live.state.background
        if not background.busy_editing:
            self._echo_pending()
        key, at = self.requests.setdefault(request, self.pressed)
        entries = self.shadow.state.session.next_undo, self.shadow.state.session.next_redo
        echo = partial(self._echo, key, self.live.state.selection, at, entries)
        was_busy, waiting = background.busy_editing, background.waiting
        self.attempt(request, waits=waits)
        if background.busy_editing and not was_busy:
            self.pending = echo
        elif background.waiting == waiting and self.live.state.refusal != BUSY:
            echo()

    def _echo_pending(self) -> None:
        if self.pending is not None:
            self.pending()
            self.pending = None

    def _echo(self, key: Any, selection: Any, at: Any, entries: Any) -> None:
        """Do what was seen now; an undo only where nothing else came before it."""
        now = self.shadow.state.session.next_undo, self.shadow.state.session.next_redo
        if (key == "undo" and now[0] is not entries[0]) or (key == "redo" and now[1] is not entries[1]):
            return
        self.shadow.state.selection = selection
        self.shadow.perform(key, lambda: at)

    def look(self) -> None:
        self.live.state.background.poll(timeout=LONG)
        if not self.live.state.background.busy_editing:
            self._echo_pending()

    def escape(self) -> None:
        self.live.state.background.cancel()
        self.pending = None

    def save(self) -> None:
        self.saved = self.live.state.session.document.decals.decals.packed().tobytes()
        self.live.files.save(lambda: None)

    def settle(self) -> None:
        while self.live.state.background.busy:
            self.look()

    def same(self) -> Any:
        return digest(self.live.state.session.document) == digest(self.shadow.state.session.document)


RANDOM_OPERATIONS = given(operations=st.lists(OPERATIONS, max_size=14), few=st.sampled_from([0, 5, 500]))


@settings(max_examples=15)
@RANDOM_OPERATIONS
def test_whatever_comes_between_nothing_is_lost(tmp_path_factory: Any, operations: Any, few: Any) -> None:
    check_operations(tmp_path_factory, operations, few)


@pytest.mark.slow
@settings(max_examples=80)
@RANDOM_OPERATIONS
def test_whatever_comes_between_many_times_nothing_is_lost(
    tmp_path_factory: Any, operations: Any, few: Any
) -> None:
    check_operations(tmp_path_factory, operations, few)


@pytest.mark.parametrize("key", ["next_tint", "fainter", "layer_up"])
@pytest.mark.parametrize("chosen", ["one", "two", "all"])
@pytest.mark.parametrize("few", [0, 5, 500])
def test_copies_have_the_looks_of_decals_that_change_meanwhile(
    tmp_path_factory: Any, few: int, chosen: str, key: str
) -> None:
    check_operations(tmp_path_factory, [("press", "duplicate", "all"), ("press", key, chosen)], few)


def check_operations(tmp_path_factory: Any, operations: Any, few: Any) -> None:
    with patch("decals.editing.session.MAX_REPLAYED_DECALS", few):
        go_through(operations, tmp_path_factory)


def go_through(operations: Any, tmp_path_factory: Any) -> None:
    pair = ThreadedAndDirect(tmp_path_factory.mktemp("saves") / "scene.json")
    for name, *arguments in operations:
        getattr(pair, name)(*arguments)
        if pair.pending is None:
            assert pair.same()
    pair.settle()
    assert pair.same()
    pair.live.state.end_stroke()
    goes_back_and_forth(pair.live.state.session)
    if pair.saved is not None:
        assert load_scene(pair.path).decals.packed().tobytes() == pair.saved
