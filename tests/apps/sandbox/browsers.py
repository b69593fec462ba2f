"""Browsers without a picture at a page that a real server serves: drivers of tests."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

from decals.window import EditWindow
from tests.apps.sandbox.test_sandbox import covered

SIZE = 160, 120
BUTTONS = "buttonLeft", "buttonMiddle", "buttonRight", "shiftKey", "ctrlKey", "altKey", "metaKey"

CALLS = (
    "trame.trigger",
    "trame.state.update",
    "trame.lifecycle.update",
    "trame.force.push",
    "viewport.mouse.interaction",
    "viewport.mouse.zoom.wheel",
    "viewport.image.push",
    "viewport.image.push.observer.add",
    "viewport.image.push.observer.remove",
    "viewport.image.push.quality",
    "viewport.image.push.quality.get",
    "viewport.image.push.original.size",
    "viewport.image.push.enabled",
    "viewport.image.animation.start",
    "viewport.image.animation.stop",
    "viewport.image.animation.fps.max",
)


class Browser:
    """A connection to the page, without a picture."""

    def __init__(self, page: Any, server: Any) -> None:
        self._page, self._server = page, server

    async def open(self, token: object = None) -> "Browser":
        """Connect as a page in the frame of a notebook does: the first message brings the token."""
        import aiohttp
        from trame_server.client import WsLinkSession
        from yarl import URL

        self._http = aiohttp.ClientSession()
        page = URL(self._page.guard.address(self._server.port))
        url = page.with_scheme("ws") / "ws"
        self.socket = await self._http.ws_connect(url, origin=str(page.origin()), autoping=True)
        self._session = WsLinkSession(self.socket)
        self._listens = asyncio.create_task(self._session.listen())
        answer = await self._session.auth(secret=self._page.guard.token if token is None else token)
        await asyncio.wait((answer, self._listens), return_when=asyncio.FIRST_COMPLETED)
        if not answer.done() or answer.exception() is not None:
            await self.close()
            raise PermissionError("the server refused the token")
        self.driving = (await self.call("trame.state.get"))["state"]["driving"]
        self._session.register_subscription("trame.state.topic", self._take)
        return self

    def _take(self, changes: dict[str, Any]) -> None:
        self.driving = changes.get("driving", self.driving)

    async def call(self, name: str, *arguments: Any) -> Any:
        return await (await self._session.call(name, list(arguments)))

    async def trigger(self, event: Callable[..., Any] | str, *arguments: Any) -> Any:
        name = event if isinstance(event, str) else self._server.controller.trigger_name(event)
        return await self.call("trame.trigger", name, list(arguments), {})

    async def mouse(self, at: tuple[float, float], *, down: bool = True, action: str = "move") -> Any:
        view = str(self._page.view._delivery.get_global_id(self._page.view._window.plotter.render_window))
        event = {**dict.fromkeys(BUTTONS, 0), "buttonLeft": int(down), "action": action, "view": view}
        x, y = (at[0] + 0.5) / SIZE[0], (at[1] + 0.5) / SIZE[1]
        return await self.call("viewport.mouse.interaction", {**event, "x": x, "y": y})

    async def ended(self, seconds: float = 30.0) -> None:
        """Wait until the server has ended the connection; `TimeoutError` if it does not."""
        await asyncio.wait_for(asyncio.shield(self._listens), seconds)

    async def watch_slowly(self, seconds: float) -> None:
        """Read all messages, but take so long for each picture."""
        from decals.apps.sandbox.connections import HEAD_BYTES, PICTURES

        self._listens.cancel()
        async for message in self.socket:
            if PICTURES in message.data[:HEAD_BYTES]:
                await asyncio.sleep(seconds)

    async def break_off(self) -> None:
        """End the connection without a closing message, also during a call."""
        self.socket._response.close()
        await self.close()

    async def close(self) -> None:
        """Vanish without a word to the page."""
        await self.socket.close()
        with suppress(asyncio.CancelledError):
            await self._listens
        await self._http.close()


Connect = Callable[..., Awaitable[Browser]]
"""Opens a connection, with a token."""

Check = Callable[[EditWindow, Any, Connect], Awaitable[None]]


def serve(check: Check, *, lessons: bool = False, **options: Any) -> None:
    """Serve a page with options to a check, with the lessons of the lab if they are wanted."""
    from trame.app import get_server

    from decals.apps.lab.lesson import LESSONS, load_lessons
    from decals.apps.lab.page import LabPage
    from decals.apps.sandbox.guard import Guard
    from decals.apps.sandbox.page import Page

    def new_page(server: Any, window: EditWindow) -> Page:
        if not lessons:
            return Page(server, window, **options)
        return LabPage(server, window, load_lessons(LESSONS), **{"begin": None, **options})

    async def run(window: EditWindow) -> None:
        server = get_server(f"connections {id(window)}", client_type="vue3")
        guard = options["guard"] = Guard(framed=True)
        page = new_page(server, window)
        network: dict[str, Any] = {"exec_mode": "task", "port": 0, "timeout": 0, "open_browser": False}
        task = server.start(host="127.0.0.1", show_connection_info=False, **network)
        await server.ready
        await show_in_frame(guard, server.port)
        assert window.subplot.keep_previous_frame
        await check(window, page, lambda *token: Browser(page, server).open(*token))
        await server.stop()
        await task

    with EditWindow(covered(), off_screen=True, size=SIZE) as window:
        window.show()  # before the loop begins, as the command does
        asyncio.run(run(window))


async def show_in_frame(guard: Any, port: int) -> None:
    """Ask for the page as the frame of a notebook does."""
    import aiohttp

    visit = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe", "Sec-Fetch-Site": "cross-site"}
    url = f"{guard.url(port)}&frame=http://notebook.example"
    async with aiohttp.ClientSession(headers=visit) as http, http.get(url) as answer:
        assert answer.status == 200
        policy = answer.headers["Content-Security-Policy"]
        assert policy.endswith("frame-ancestors http://notebook.example")


async def until(true: Callable[[], object]) -> None:
    async with asyncio.timeout(30):
        while not true():
            await asyncio.sleep(0.01)
