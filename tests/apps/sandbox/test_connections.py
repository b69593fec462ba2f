"""Several browsers at one server, and what becomes of input that a browser leaves behind."""

import asyncio
import gzip
import logging
import posixpath
import re
from typing import Any

import pytest

from decals.window import EditWindow
from tests.apps.sandbox.browsers import CALLS, SIZE, Connect, serve, until
from tests.decals.editing.scenes import digest
from tests.decals.window.driver import Driver

pytest.importorskip("trame_vtk")


def test_one_browser_drives_and_passes_control(vtk_display: None) -> None:
    async def check(window: EditWindow, page: Any, connect: Connect) -> None:
        first, second, third = [await connect() for _ in range(3)]
        assert [browser.driving["drives"] for browser in (first, second, third)] == [True, False, False]
        await second.trigger(page.sandbox.select, "0/1")
        await second.mouse((80, 60), action="down")
        await second.call("trame.state.update", [{"key": "theme", "value": "dark"}])
        await second.trigger("pass_control")
        assert (window.actions.state.primitive, page._server.state.theme) == (None, "light")
        await first.trigger(page.sandbox.select, "0/1")
        await first.call("trame.state.update", [{"key": "theme", "value": "dark"}])
        assert (window.actions.state.primitive, page._server.state.theme) == ((0, (1,)), "dark")
        view = str(page.view._delivery.get_global_id(window.plotter.render_window))
        pictures: list[dict[str, Any]] = []
        await first.call("viewport.image.push.observer.add", view)
        third._session.register_subscription("viewport.image.push.subscription", pictures.append)
        for browser, size in ((first, SIZE), (third, (59.5, 89.6))):
            await browser.call("viewport.image.push.original.size", view, *size)
        page.view.update()
        # Browsers show no picture of another size than theirs.
        await until(lambda: pictures and pictures[-1]["size"] == [60, 90])
        assert window.plotter.window_size == list(SIZE)
        for browser in (third, second):
            await browser.trigger("ask_to_drive")
        await until(lambda: first.driving["next"] == third.driving["number"] and second.driving["asks"])
        await first.trigger("pass_control")
        await until(lambda: third.driving["drives"] and not first.driving["drives"])
        await until(lambda: window.plotter.window_size == [60, 90])
        assert (first.driving["driver"], first.driving["browsers"]) == (third.driving["number"], 3)
        await third.close()
        await until(lambda: second.driving["drives"])  # it asked
        await second.trigger(page.sandbox.select, "0/0")
        assert window.actions.state.primitive == (0, (0,))
        for browser in (first, second):
            await browser.close()

    serve(check, shared=True)


def test_a_browser_that_leaves_in_a_drag_ends_it_as_one_entry(
    vtk_display: None, caplog: pytest.LogCaptureFixture
) -> None:
    async def check(window: EditWindow, page: Any, connect: Connect) -> None:
        before = digest(window.document)
        for times in (1, 2):  # a button that was never released would swallow the next press
            browser, other = await connect(), await connect()
            await until(lambda: any(Driver(window).visible()))  # the kernels of rays may still compile
            number, (x, y) = next(Driver(window).visible())
            window.actions.state.selection = (number,)
            await browser.mouse((x, y), action="down")
            for step in (3, 6, 9):
                await browser.mouse((x + step, y))
            assert window.tools.dragging
            await browser.close()
            await until(lambda: not window.tools.dragging and not window.session.stroke_open)
            assert window.session.labels == ("move",) * times
            await other.close()
        browser = await connect()
        await browser.trigger(page.sandbox.select, "0/1")
        await browser.trigger(page.sandbox.set_control, "node", "radius", 0.7, False)
        await browser.close()
        await until(lambda: window.session.labels[2:] == ("set radius",) and not window.session.stroke_open)
        page.sandbox.go_to(0)
        assert digest(window.document) == before

    serve(check)
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


def test_malformed_messages_are_refused_without_an_exception(
    vtk_display: None, caplog: pytest.LogCaptureFixture
) -> None:
    odd: list[Any] = [None, 3, "x", [], {}, [1, 2], {"view": "-1"}, {"key": 3}]

    async def check(window: EditWindow, page: Any, connect: Connect) -> None:
        before, browser = digest(window.document), await connect()
        templates = {
            key: page._server.state[key] for key in page._server.state.to_dict() if "template" in key
        }
        for name in CALLS:
            for count in range(4):
                for value in odd:
                    await browser.call(name, *[value] * count)
        for value in odd:
            await browser.trigger(page.sandbox.set_control, "node", value)
            await browser.trigger(page.sandbox.set_control, "node", value, value, value)
        changes = [{"key": key, "value": "<b>x</b>"} for key in [*templates, "driving"]]
        await browser.call("trame.state.update", changes)
        assert {key: page._server.state[key] for key in templates} == templates
        assert digest(window.document) == before
        for name, *values in (
            ("viewport.image.animation.fps.max", "x"),
            ("viewport.image.push.quality", "-1", 50, "2"),
            ("viewport.image.push.original.size", "-1", 1e9, 1e9),
        ):
            assert "refused" in (await browser.call(name, *values))["error"]
        view = str(page.view._delivery.get_global_id(window.plotter.render_window))
        for action in ("start", "stop", "start", "stop", "start", "start"):
            await browser.call(f"viewport.image.animation.{action}", view)
        names = [task.get_name() for task in asyncio.all_tasks()]
        assert names.count("camera of the sandbox") == 1
        await browser.close()
        announced = (3_000_000_000).to_bytes(4, "little")  # the whole message, of which the rest never comes
        for data in (b"", b"x", bytes(12), b"x" * 40, bytes(8) + announced + b"x", "text"):
            browser = await connect()
            await (
                browser.socket.send_str(data) if isinstance(data, str) else browser.socket.send_bytes(data)
            )
            await browser.ended()
            await browser.close()

    serve(check)
    assert [record for record in caplog.records if record.levelno >= logging.ERROR] == []


def test_the_page_is_small_and_names_no_other_server(vtk_display: None) -> None:
    async def check(_: EditWindow, page: Any, _connect: Connect) -> None:
        import aiohttp

        state, base = page._server.state, page.guard.address(page._server.port)
        files = {*state.trame__scripts, *state.trame__styles}
        names = ["index.html", "vue.global.js", *files]
        bearer = {"Authorization": f"Bearer {page.guard.token}"}
        async with aiohttp.ClientSession(auto_decompress=False, headers=bearer) as client:
            sent = 0
            while names:
                name = names.pop()
                async with client.get(base + name, headers={"Accept-Encoding": "gzip"}) as answer:
                    body = await answer.read()
                    assert answer.status == 200
                named = set(re.findall(r"<([^>]*)>; rel=preload; as=\w+", answer.headers.get("Link", "")))
                assert named == (files if name == "index.html" else set())
                known = {"Accept-Encoding": "gzip", "If-None-Match": answer.headers["ETag"]}
                async with client.get(base + name, headers=known) as answer:
                    assert (answer.status, await answer.read()) == (304, b"")
                sent += len(body)
                if not name.endswith((".css", ".html")):
                    continue
                text = gzip.decompress(body).decode()
                assert not re.search(r"""(src|href)=["']?(https?:)?//|url\(["']?(https?:)?//""", text)
                fonts = re.findall(r"""url\(["']?([^"')?#]+\.woff2)""", text)
                names += {posixpath.normpath(posixpath.join(posixpath.dirname(name), font)) for font in fonts}
        assert sent < 2e6

    serve(check)


def test_nobody_waits_for_a_slow_browser_which_gets_the_newest_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("aiohttp")
    from decals.apps.sandbox import connections
    from decals.apps.sandbox.connections import PICTURES, Outbox

    class Socket:
        closed = False

        def __init__(self) -> None:
            self.sent: list[bytes] = []
            self.goes = asyncio.Event()

        async def close(self, **_: object) -> None:
            self.closed = True

        async def send_bytes(self, message: bytes) -> None:
            await self.goes.wait()
            self.sent.append(message)

    async def watched() -> None:
        socket = Socket()
        outbox = Outbox(socket)
        assert not outbox.behind
        pictures = [PICTURES + b"%d" % number for number in range(4)]
        for message in (b"a", *pictures, b"b"):
            await asyncio.wait_for(outbox.send_bytes(message), 1.0)
        assert outbox.behind
        assert not outbox.closed
        socket.goes.set()
        while outbox.behind:
            await asyncio.sleep(0)
        await outbox.send_bytes(b"c")
        while len(socket.sent) < 4:
            await asyncio.sleep(0)
        assert socket.sent == [b"a", b"b", pictures[-1], b"c"]
        monkeypatch.setattr(connections, "MAX_WAITING_BYTES", 100)
        socket.goes.clear()
        for _ in range(30):
            await outbox.send_bytes(b"0123456789")
        await asyncio.sleep(0)
        assert outbox.closed
        outbox = Outbox(Broken())
        await outbox.send_bytes(PICTURES)
        while outbox.behind:
            await asyncio.sleep(0)

    class Broken:
        async def send_bytes(self, message: bytes) -> None:
            raise ConnectionResetError

    asyncio.run(watched())
