"""One session for each browser: a process of its own, behind the address of one server.

The server starts a process when a browser comes for the first time, and finds it by a cookie later. It
passes requests and messages on, and ends processes without a browser.
"""

import asyncio
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from aiohttp import ClientError, ClientSession, ClientWebSocketResponse, WSMsgType, web

from decals.apps.sandbox.guard import ASKING, Guard, new_token, page_of

IDLE_SECONDS = 30 * 60.0
"""A session without a browser is saved and ended after this time."""

SHORT_SECONDS = 60.0
"""Likewise if another browser needs its place."""

MAX_MEGABYTES = 4000.0
"""A session that takes more memory is saved and ended."""

CHECK_SECONDS = 5.0
"""Time between two looks at idle sessions and their memory."""

STOP_SECONDS = 20.0
"""Time in which a session must have kept its changes."""

MAX_PART_BYTES = 5_000_000
"""Longest part of a message of a browser; trame sends longer messages in parts of 4 MiB."""

WAIT_SECONDS = 1.0
"""Longest time for which a request waits for a session that starts, before the page says so."""

AGAIN = "The session has ended. Load this page again."


class Session:
    """A process that serves one browser.

    Parameters
    ----------
    number
        Number of the session, from 1.
    process
        Reads a key first, and prints the URL of its page. It ends when its standard input is closed.

    Attributes
    ----------
    url
        URL of its page on this machine; empty until it is known.
    headers
        Headers with the key, without which the process answers no request.
    """

    def __init__(self, number: int, process: Process) -> None:
        self.number, self.url = number, ""
        self._process = process
        key = new_token()
        assert process.stdin is not None
        process.stdin.write(f"{key}\n".encode())  # other accounts see arguments, but no input
        self.headers = {"Authorization": f"Bearer {key}"}
        self._connections = 0
        self._left_at = time.monotonic()
        self._known = asyncio.Event()
        self._output = asyncio.get_running_loop().create_task(self._read())

    async def _read(self) -> None:
        assert self._process.stdout is not None
        async for line in self._process.stdout:
            text = line.decode(errors="replace").strip()
            if not self.url and text.startswith("http://"):
                self.url = text
                self._known.set()
        await self._process.wait()
        self._known.set()

    async def started(self, seconds: float | None = None) -> bool:
        """Wait until the URL is known or the process ends, at most so long; return True if it is known."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._known.wait(), seconds)
        return bool(self.url)

    @property
    def exit_code(self) -> int | None:
        """Exit code of the process, or None while it runs."""
        return self._process.returncode

    @property
    def idle_seconds(self) -> float:
        """Time for which no browser has shown the session."""
        return 0.0 if self._connections else time.monotonic() - self._left_at

    @property
    def megabytes(self) -> float:
        """Memory of the process; 0 if it is unknown."""
        try:
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text(encoding="ascii").split()[1])
        except (OSError, IndexError):
            return 0.0
        return pages * 4096 / 1e6

    async def relay(self, http: ClientSession, request: web.Request) -> web.WebSocketResponse:
        """Pass messages between a browser and the process until one of them leaves."""
        browser = web.WebSocketResponse(max_msg_size=MAX_PART_BYTES, compress=False)
        await browser.prepare(request)
        self._connections += 1
        try:
            async with http.ws_connect(f"{self.url}ws", headers=self.headers, max_msg_size=0) as page:
                ways = [asyncio.create_task(_pass(*way)) for way in ((browser, page), (page, browser))]
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        except ClientError:  # the process has ended
            pass
        finally:
            self._connections -= 1
            self._left_at = time.monotonic()
            await browser.close()
        return browser

    async def stop(self) -> None:
        """Let the process keep its changes, and end it."""
        stdin = self._process.stdin
        assert stdin is not None
        stdin.close()
        try:
            await asyncio.wait_for(self._process.wait(), STOP_SECONDS)
        except TimeoutError:
            with suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()
        await self._output


async def _pass(
    source: web.WebSocketResponse | ClientWebSocketResponse,
    target: web.WebSocketResponse | ClientWebSocketResponse,
) -> None:
    async for message in source:
        if message.type is WSMsgType.BINARY:
            await target.send_bytes(message.data)


class Sessions:
    """Starts, finds and ends the sessions of all browsers.

    Parameters
    ----------
    command
        Returns the command of a session from its number.
    limit
        Most sessions at the same time.
    guard
        Checks all requests.
    join
        Adds further pages to the server, such as those of a class.
    """

    def __init__(
        self,
        command: Callable[[int], Sequence[str]],
        *,
        limit: int,
        guard: Guard,
        join: Callable[[web.Application], None] = lambda _: None,
    ) -> None:
        self._join = join
        self._command, self._limit, self._guard = command, limit, guard
        self._sessions: dict[str, Session] = {}
        self._numbers: dict[str, int] = {}
        self._waiting: Session | None = None
        self._ending: set[Session] = set()
        self._opening = asyncio.Lock()

    async def serve(self, host: str, port: int, ready: Callable[[int], None], *, early: bool = False) -> int:
        """Serve until the first session fails to start, or the task is cancelled; return the exit code.

        ``ready`` is called with the port once the first session shows its page; ``early``: while it starts,
        so that the browser starts meanwhile. The page says so.
        """
        self._waiting = first = await self._start(1)
        app = web.Application()
        self._join(app)
        app.router.add_get("/ws", self._socket)
        app.router.add_get("/{path:.*}", self._get)
        runner = web.AppRunner(self._guard.protected(app))
        await runner.setup()
        async with ClientSession(auto_decompress=False) as self._http:
            try:
                await web.TCPSite(runner, host, port).start()
                if early or await first.started():
                    ready(runner.addresses[0][1])
                if await first.started():
                    await self._watch()
                return first.exit_code or 0
            finally:
                waiting = () if self._waiting is None else (self._waiting,)
                left = *self._sessions.values(), *self._ending, *waiting
                # Pages leave once their sessions end; the server alone would wait for them.
                await asyncio.gather(runner.cleanup(), *(session.stop() for session in left))

    async def _watch(self) -> None:
        """End idle sessions and those that are too large."""
        while True:
            await asyncio.sleep(CHECK_SECONDS)
            for key, session in list(self._sessions.items()):
                ended = session.exit_code is not None
                if ended or session.idle_seconds > IDLE_SECONDS or session.megabytes > MAX_MEGABYTES:
                    await self._end(key)

    async def _end(self, key: str) -> None:
        """End a session; its files are its browser's the next time."""
        session = self._sessions.pop(key)
        self._ending.add(session)  # until it has ended, so that the end of the server waits for it
        await session.stop()
        self._ending.discard(session)

    async def _start(self, number: int) -> Session:
        return Session(
            number,
            await asyncio.create_subprocess_exec(
                *self._command(number),
                stdin=PIPE,
                stdout=PIPE,
                limit=2**20,
                start_new_session=True,  # Ctrl + C reaches this process only
            ),
        )

    # -- requests ---------------------------------------------------------------------------------------

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        session = self._sessions.get(ASKING.get().browser)
        if session is None or not session.url:
            raise web.HTTPServiceUnavailable(text="expected an open session; load the page again")
        return await session.relay(self._http, request)

    async def _get(self, request: web.Request) -> web.StreamResponse:
        """Return a file of the browser's session; a user that opens the page starts one."""
        asking = ASKING.get()
        browser, path = asking.browser, request.match_info["path"]
        if asking.visits and request.method == "GET" and path in ("", "index.html"):
            async with self._opening:  # a browser may ask twice at once
                if not await self._open(browser):
                    limit = f"The limit of open sessions is {self._limit}"
                    return page_of(f"{limit}. Close one, and load this page again.", 503)
        session = self._sessions.get(browser)
        if session is None:
            return page_of(AGAIN, 404 if path else 200)
        if session.exit_code is not None:
            del self._sessions[browser]
            return page_of(AGAIN, 503)
        if not await session.started(WAIT_SECONDS):
            return page_of("The session starts. This takes some seconds.", refresh=".")
        if not path:
            return web.Response(status=302, headers={"Location": "index.html"})
        return await self._file(session, path, request)

    async def _open(self, key: str) -> bool:
        """Start the session of a browser, or return False if there is no place for it."""
        if key in self._sessions:
            return True
        if self._waiting is not None:
            self._sessions[key], self._waiting = self._waiting, None
            self._numbers[key] = self._sessions[key].number
            return True
        if len(self._sessions) >= self._limit:
            longest = max(self._sessions, key=lambda other: self._sessions[other].idle_seconds)
            if self._sessions[longest].idle_seconds < SHORT_SECONDS:
                return False
            await self._end(longest)
        number = self._numbers.setdefault(key, len(self._numbers) + 1)
        self._sessions[key] = await self._start(number)
        return True

    async def _file(self, session: Session, path: str, request: web.Request) -> web.Response:
        """Return a file of a session, in the encoding in which it comes."""
        headers = {**session.headers, "Accept-Encoding": request.headers.get("Accept-Encoding", "identity")}
        try:
            async with self._http.get(f"{session.url}{path}", headers=headers) as answer:
                names = ("Content-Type", "Content-Encoding", "Link")
                kept = {name: answer.headers[name] for name in names if name in answer.headers}
                return web.Response(body=await answer.read(), status=answer.status, headers=kept)
        except ClientError:
            return page_of(AGAIN, 503)
