"""The server of sessions, with small programs in place of sandboxes."""

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("aiohttp")

import aiohttp
from aiohttp import ClientSession as Client

from decals.apps.sandbox import sessions as module
from decals.apps.sandbox.sessions import Sessions

PROGRAM = """
import asyncio, pathlib, sys
from aiohttp import web
async def echo(request):
    socket = web.WebSocketResponse(); await socket.prepare(request)
    async for message in socket: await socket.send_bytes(sys.argv[1].encode() + message.data)
    return socket
async def page(request):
    return web.Response(text=f"session {sys.argv[1]} {request.path}", content_type="text/x")
async def main():
    app = web.Application(); app.router.add_get("/ws", echo); app.router.add_get("/{path:.*}", page)
    runner = web.AppRunner(app); await runner.setup(); await web.TCPSite(runner, "127.0.0.1", 0).start()
    print("wslink: starting", flush=True)
    print(f"http://127.0.0.1:{runner.addresses[0][1]}/", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    pathlib.Path(f"saved {sys.argv[1]}").touch()
asyncio.run(main())
"""


async def started(**options: Any) -> tuple[Sessions, asyncio.Task[int], str]:
    """Start a server of sessions; return also its task and its URL."""
    sessions = Sessions(lambda number: [sys.executable, "-c", PROGRAM, str(number)], **options)
    port: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(sessions.serve("127.0.0.1", 0, port.set_result))
    return sessions, task, f"http://127.0.0.1:{await port}"


async def ended(task: asyncio.Task[int]) -> None:
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def serve(check: Callable[[Sessions, str], Awaitable[None]], **options: Any) -> None:
    """Serve sessions to a check, then end them."""

    async def run() -> None:
        sessions, task, url = await started(**options)
        try:
            await check(sessions, url)
        finally:
            await ended(task)

    asyncio.run(run())


def browser() -> Client:
    return Client(cookie_jar=aiohttp.CookieJar(unsafe=True))  # cookies of a numeric address, too


async def text(client: Client, url: str, **options: Any) -> tuple[int, str]:
    async with client.get(url, **options) as answer:
        return answer.status, await answer.text()


async def opened(client: Client, url: str) -> str:
    """Return the page once its session has started."""
    async with asyncio.timeout(60):
        while "starts" in (page := (await text(client, url))[1]):
            await asyncio.sleep(0.02)
    return page


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_each_browser_has_a_session_of_its_own(folder: Path) -> None:
    async def check(_: Sessions, url: str) -> None:
        async with browser() as one, browser() as two:
            for client, number in ((one, "1"), (two, "2"), (one, "1")):
                assert await opened(client, url) == f"session {number} /index.html"
                async with client.get(url) as answer:  # also a browser that was closed meanwhile
                    (cookie,) = answer.cookies.values()
                    assert int(cookie["max-age"]) > 7 * 24 * 3600
                assert (await text(client, f"{url}/a.js"))[1] == f"session {number} /a.js"
                async with client.ws_connect(f"{url}/ws") as socket:
                    await socket.send_bytes(b"x" * 300_000)
                    assert await socket.receive_bytes() == number.encode() + b"x" * 300_000
            assert [path.name for path in folder.iterdir()] == []

    serve(check, limit=2)
    assert {path.name for path in folder.iterdir()} == {"saved 1", "saved 2"}


def test_idle_sessions_are_saved_and_ended_and_their_number_is_limited(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "CHECK_SECONDS", 0.02)

    async def check(_: Sessions, url: str) -> None:
        async with browser() as one, browser() as two, browser() as three:
            assert await opened(one, url)
            assert await opened(two, url)
            status, page = await text(three, url)
            assert (status, "2 sessions are open" in page) == (503, True)
            async with two.ws_connect(f"{url}/ws") as socket:  # it is not idle
                monkeypatch.setattr(module, "IDLE_SECONDS", 0.1)
                async with asyncio.timeout(30):
                    while not (folder / "saved 1").exists():
                        await asyncio.sleep(0.02)
                await socket.send_bytes(b"")
                assert await socket.receive_bytes() == b"2"
                monkeypatch.setattr(module, "IDLE_SECONDS", 1e3)
                assert await opened(three, url) == "session 3 /index.html"
            monkeypatch.setattr(module, "SHORT_SECONDS", 0.0)
            time.sleep(0.01)
            assert await opened(one, url) == "session 1 /index.html"  # in place of one without a browser
            monkeypatch.setattr(module, "MAX_MEGABYTES", 1.0)
            async with asyncio.timeout(30):
                while not {"saved 2", "saved 3"} <= {path.name for path in folder.iterdir()}:
                    await asyncio.sleep(0.02)

    serve(check, limit=2)


def test_the_server_ends_while_a_page_is_open() -> None:
    async def run() -> float:
        _, task, url = await started(limit=1)
        async with browser() as client:
            assert await opened(client, url)
            async with client.ws_connect(f"{url}/ws") as socket:
                leaving = asyncio.create_task(socket.receive())  # a browser answers the close
                began = time.monotonic()
                await ended(task)
                await leaving
                return time.monotonic() - began

    assert asyncio.run(run()) < 30.0  # a server that waits for its pages takes a minute


def test_requests_of_other_pages_and_without_the_token_are_refused() -> None:
    async def check(_: Sessions, url: str) -> None:
        async with browser() as one, browser() as two:
            assert (await text(one, url))[0] == 403
            assert (await text(one, f"{url}/?secret=no"))[0] == 403
            await text(one, f"{url}/?secret=key")
            assert await opened(one, url) == "session 1 /index.html"
            for headers in ({"Origin": "http://other.example"}, {"Host": "other.example"}):
                assert (await text(one, url, headers=headers))[0] == 403
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await one.ws_connect(f"{url}/ws", headers={"Origin": "http://other.example"})
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await two.ws_connect(f"{url}/ws")

    serve(check, limit=2, token="key", allows_host=lambda host: host == "127.0.0.1")


def test_a_session_that_cannot_start_ends_the_server() -> None:
    sessions_of_errors = [sys.executable, "-c", "raise SystemExit(2)"]

    async def run() -> int:
        return await Sessions(lambda _: sessions_of_errors, limit=1).serve("127.0.0.1", 0, lambda _: None)

    assert asyncio.run(run()) == 2
