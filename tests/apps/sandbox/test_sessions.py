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
from yarl import URL

from decals.apps.sandbox import sessions as module
from decals.apps.sandbox.guard import Guard
from decals.apps.sandbox.sessions import Sessions

TOKEN = "0123456789abcdef"

PROGRAM = """
import asyncio, pathlib, sys
from aiohttp import web
async def echo(request):
    if request.headers.get("Authorization") != "Bearer " + key: raise web.HTTPForbidden
    socket = web.WebSocketResponse(); await socket.prepare(request)
    async for message in socket: await socket.send_bytes(sys.argv[1].encode() + message.data)
    return socket
async def page(request):
    if request.headers.get("Authorization") != "Bearer " + key: raise web.HTTPForbidden
    return web.Response(text=f"session {sys.argv[1]} {request.path}", content_type="text/x")
key = sys.stdin.readline().strip()
async def main():
    app = web.Application(); app.router.add_get("/ws", echo); app.router.add_get("/{path:.*}", page)
    runner = web.AppRunner(app); await runner.setup(); await web.TCPSite(runner, "127.0.0.1", 0).start()
    print("wslink: starting", flush=True)
    print(f"http://127.0.0.1:{runner.addresses[0][1]}/", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    pathlib.Path(f"saved {sys.argv[1]}").touch()
asyncio.run(main())
"""


async def started(name: str = "", **options: Any) -> tuple[Sessions, asyncio.Task[int], str]:
    """Start a server of sessions; return also its task and its URL."""
    guard = Guard(token=TOKEN)
    program = [sys.executable, "-c", PROGRAM]
    sessions = Sessions(lambda number: [*program, f"{name}{number}"], guard=guard, **options)
    port: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(sessions.serve("127.0.0.1", 0, port.set_result))
    return sessions, task, guard.address(await port).rstrip("/")


LATE = 'import pathlib, time\nwhile not pathlib.Path("go").exists(): time.sleep(0.01)\n'


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
    """Return a client that opens pages as a user does, and keeps the cookies of a numeric address too."""
    visit = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Site": "none", "Sec-Fetch-Dest": "document"}
    return Client(cookie_jar=aiohttp.CookieJar(unsafe=True), headers=visit)


async def connected(client: Client, url: str) -> aiohttp.ClientWebSocketResponse:
    return await client.ws_connect(f"{url}/ws", origin=url.rpartition("/")[0])


async def text(client: Client, url: str, **options: Any) -> tuple[int, str]:
    async with client.get(url, **options) as answer:
        return answer.status, await answer.text()


async def opened(client: Client, url: str) -> str:
    """Return the page once its session has started."""
    async with asyncio.timeout(60):
        while "starts" in (page := (await text(client, f"{url}/?token={TOKEN}"))[1]):
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
                async with client.get(
                    f"{url}/index.html"
                ) as answer:  # also a browser that was closed meanwhile
                    (cookie,) = answer.cookies.values()
                    assert int(cookie["max-age"]) > 7 * 24 * 3600
                assert (await text(client, f"{url}/a.js"))[1] == f"session {number} /a.js"
                async with await connected(client, url) as socket:
                    await socket.send_bytes(b"x" * 300_000)
                    assert await socket.receive_bytes() == number.encode() + b"x" * 300_000
            assert [path.name for path in folder.iterdir()] == []

    serve(check, limit=2)
    assert {path.name for path in folder.iterdir()} == {"saved 1", "saved 2"}


def test_an_early_server_answers_while_its_first_session_starts(folder: Path) -> None:
    async def run() -> None:
        guard, ports = Guard(token=TOKEN), asyncio.Queue[int]()
        sessions = Sessions(lambda _: [sys.executable, "-c", LATE + PROGRAM, "one"], limit=1, guard=guard)
        task = asyncio.create_task(sessions.serve("127.0.0.1", 0, ports.put_nowait, early=True))
        try:
            url = guard.address(await ports.get())
            async with browser() as user:
                assert "The session starts" in (await text(user, f"{url}?token={TOKEN}"))[1]
                page = asyncio.create_task(text(user, url))
                await asyncio.wait({page}, timeout=0.1)
                (folder / "go").touch()
                assert await page == (200, "session one /index.html")
            assert ports.empty()
        finally:
            await ended(task)

    asyncio.run(run())


def test_servers_on_two_ports_keep_their_sessions_apart() -> None:
    """A browser would send the cookies of a machine to all its ports."""

    async def run() -> None:
        (_, first, here), (_, second, there) = await started("a", limit=2), await started("b", limit=2)
        try:
            async with browser() as user:
                for _ in range(2):  # to and fro
                    for url, name in ((here, "a1"), (there, "b1")):
                        assert await opened(user, url) == f"session {name} /index.html"
                        async with await connected(user, url) as socket:
                            await socket.send_bytes(b"")
                            assert await socket.receive_bytes() == name.encode()
                one, other = (user.cookie_jar.filter_cookies(URL(f"{url}/")) for url in (here, there))
                names = [f"implicit-decals-{URL(url).port}" for url in (here, there)]
                assert [[*one], [*other]] == [[name] for name in names]
                stolen = {names[0]: other[names[1]].value}
            async with aiohttp.ClientSession(cookies=stolen) as stranger:
                assert (await text(stranger, f"{here}/a.js"))[
                    0
                ] == 403  # each server signs with its own secret
        finally:
            await ended(first)
            await ended(second)

    asyncio.run(run())


def test_idle_sessions_are_saved_and_ended_and_their_number_is_limited(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "CHECK_SECONDS", 0.02)

    async def check(_: Sessions, url: str) -> None:
        async with browser() as one, browser() as two, browser() as three:
            assert await opened(one, url)
            assert await opened(two, url)
            status, page = await text(three, f"{url}/?token={TOKEN}")
            assert (status, "limit of open sessions is 2" in page) == (503, True)
            async with await connected(two, url) as socket:  # it is not idle
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
            async with await connected(client, url) as socket:
                leaving = asyncio.create_task(socket.receive())  # a browser answers the close
                began = time.monotonic()
                await ended(task)
                await leaving
                return time.monotonic() - began

    assert asyncio.run(run()) < 30.0  # a server that waits for its pages takes a minute


def test_a_page_starts_a_session_and_nothing_else_does(folder: Path) -> None:
    async def check(sessions: Sessions, url: str) -> None:
        image = {"Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image", "Sec-Fetch-Site": "same-origin"}
        async with browser() as one, browser() as two:
            assert await opened(one, url) == "session 1 /index.html"
            async with two.get(f"{url}/?token={TOKEN}", allow_redirects=False) as answer:
                assert (answer.status, answer.headers["Location"]) == (303, "./")  # the token is gone
            for path in ("/", "/index.html", "/a.js"):
                await text(two, f"{url}{path}", headers=image)
            await two.head(f"{url}/")
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await connected(two, url)
            assert len(sessions._sessions) == 1
            assert await opened(two, url) == "session 2 /index.html"
            for path in ("/", "/index.html"):  # a bookmark, a second tab
                assert await text(one, f"{url}{path}") == (200, f"session {1} /index.html")

    serve(check, limit=2)


def test_a_session_that_cannot_start_ends_the_server() -> None:
    sessions_of_errors = [sys.executable, "-c", "raise SystemExit(2)"]

    async def run() -> int:
        sessions = Sessions(lambda _: sessions_of_errors, limit=1, guard=Guard())
        return await sessions.serve("127.0.0.1", 0, lambda _: None)

    assert asyncio.run(run()) == 2
