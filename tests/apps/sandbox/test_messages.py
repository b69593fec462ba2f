"""Random messages of browsers, valid and malformed: none raises, and undoing all restores the first state."""

import asyncio
import random
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from decals.errors import InvalidEdit
from decals.validation import one_of

pytest.importorskip("trame_vtk")


def test_growth_is_measured_after_the_first_part() -> None:
    from tests.endurance import growth

    memory = [(1000, 50.0), (2000, 90.0), (3000, 100.0), (4000, 103.0), (5000, 106.0)]
    assert growth(memory, 0.5) == pytest.approx(3.0)
    assert growth(memory, 0.3) == pytest.approx((-1.5 * 90 - 0.5 * 100 + 0.5 * 103 + 1.5 * 106) / 5)
    assert growth(memory[:1], 0.5) == 0.0


def test_pauses_of_a_loop_are_measured_on_the_clock_and_attributed() -> None:
    from tests.apps.sandbox.messages import LoopWatch, summary

    causes = ["a short one"]
    watch = LoopWatch(lambda: causes[-1])

    async def check() -> None:
        task = asyncio.create_task(watch.run())
        await asyncio.sleep(0.05)
        causes.append("a long one")
        time.sleep(0.2)
        await asyncio.sleep(0.01)
        task.cancel()

    asyncio.run(check())
    pause = next(one for one in watch.longest.values() if one.cause == "a long one")
    assert pause.place == "elsewhere"
    assert pause.clock_ms > 190
    assert pause.busy_ms < 100
    assert summary("clock", watch.clock)["loop_clock_max_ms"] >= pause.clock_ms
    assert summary("clock", watch.clock)["loop_clock_late"] >= 1
    assert summary("busy", watch.busy)["loop_busy_late"] == 0
    assert summary("busy", Counter({1.0: 98, 2.0: 1, 300.0: 1}))["loop_busy_p99_ms"] == 2.0


def test_a_pause_is_attributed_to_our_innermost_function() -> None:
    from tests.apps.sandbox.messages import place_of

    places: list[str] = []

    class Choices(set[str]):
        def __contains__(self, value: object) -> bool:
            places.append(place_of(sys._getframe()))
            return True

    one_of("name", "x", Choices(), InvalidEdit)
    assert places == ["decals.validation.one_of"]


@pytest.mark.slow
def test_random_messages_raise_nothing(vtk_display: None) -> None:
    from tests.apps.sandbox.messages import faults, measure

    figures = measure(300, seed=1)
    assert faults(figures) == 0, figures


@pytest.mark.slow
def test_an_edit_of_a_watcher_is_noticed(vtk_display: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a page on which watchers may do all, and events that open and close the help."""
    from decals.apps.sandbox.connections import DRIVES, Connections
    from tests.apps.sandbox import messages

    monkeypatch.setattr(messages, "SHARED_PART", 0.9)
    monkeypatch.setattr(messages, "EVENTS", {"show_help": [[True, False]]})
    monkeypatch.setattr(Connections, "_allows", lambda _self, _client, name, _arguments: name in DRIVES)
    figures = messages.measure(60, seed=1)
    assert any(line.startswith("a watcher's") for line in figures["first_intrusions"])


@pytest.mark.slow
def test_a_connection_that_the_server_ends_is_noticed(
    vtk_display: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tests.apps.sandbox import messages

    send = messages.Messages._send

    async def lose(self: messages.Messages) -> None:
        await send(self)
        await self._browsers[0].socket.close()

    monkeypatch.setattr(messages.Messages, "_send", lose)
    figures = messages.measure(20, seed=1)
    assert figures["lost"] == 20
    assert messages.faults(figures) >= 20


@pytest.mark.slow
@pytest.mark.parametrize("open_to_all", [False, True])
def test_strangers_get_nothing_unless_any_text_is_a_token(
    open_to_all: bool, vtk_display: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    from decals.apps.sandbox.guard import Guard
    from decals.window import EditWindow
    from tests.apps.sandbox.attacks import Server
    from tests.apps.sandbox.browsers import Connect, serve
    from tests.apps.sandbox.misuse import ask_as_stranger

    if open_to_all:
        monkeypatch.setattr(Guard, "is_token", lambda _self, text: isinstance(text, str))
    got: list[str] = []

    async def check(_: EditWindow, page: Any, _connect: Connect) -> None:
        nothing: Any = None
        server = Server("here", nothing, Path(), page.guard.address(page._server.port), page.guard.token)
        got.extend([await ask_as_stranger(server, random.Random(number)) for number in range(40)])

    serve(check)
    assert any(got) == open_to_all
