"""The browsers that show a page: one of them drives, and input that a browser leaves behind is ended."""

import asyncio
import inspect
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

from aiohttp import WSCloseCode, web
from wslink.websocket import LinkProtocol

from decals.apps.sandbox.guard import ASKING, Guard, Handler

MOUSE = "viewport.mouse.interaction"
TRIGGER = "trame.trigger"
STATE = "trame.state.get"
UPDATE = "trame.state.update"
IMAGE = "viewport.image.push"
SIZE, QUALITY = f"{IMAGE}.original.size", f"{IMAGE}.quality"
"""Messages with the size of a browser's view, and with its pixels for each of a picture."""

LIFECYCLE = "trame.lifecycle.update"
ERROR = "trame.error.client"
WATCHES = frozenset({STATE, LIFECYCLE, IMAGE, f"{IMAGE}.observer.add", f"{IMAGE}.quality.get"})
"""Messages of browsers that only watch, which change nothing; all others of theirs are left out."""

DRIVES = WATCHES | {ERROR, MOUSE, SIZE, TRIGGER, UPDATE, QUALITY, "viewport.mouse.zoom.wheel"}
DRIVES |= {f"viewport.image.animation.{name}" for name in ("fps.get", "fps.max", "start", "stop")}
DRIVES |= {f"{IMAGE}.{name}" for name in ("enabled", "invalidate.cache", "observer.remove")}
"""Messages of browsers that edit; trame and VTK have more, such as one that ends the server."""

LIFE = frozenset({"client_connected", "client_exited", "client_unmounted"})
"""What a page says of itself."""

OURS = frozenset({TRIGGER, UPDATE, LIFECYCLE})
"""Messages that call functions of the page, whose errors are shown."""

OF_SERVER = "driving", "trame__template"
"""First parts of the names of values that no browser may change."""


MAX_MESSAGE_BYTES = 250_000_000
"""Longest messages whose parts may be under way: the server reserves as much as a first part announces."""

MAX_HELLO_BYTES = 512
"""Likewise before a browser has shown that it may connect."""

MAX_WATCHER_BYTES = 20_000
"""Likewise for a browser that only watches."""

MAX_ERROR_LENGTH = 1000
"""Characters of an error of a page that are shown."""

HELLO_SECONDS = 15.0
"""Time in which a browser must have shown that it may connect."""

RANGES = {
    "viewport.image.animation.fps.max": ((1, 240),),
    QUALITY: (None, (0, 100), (0.1, 8)),
    SIZE: (None, (0, 16384), (0, 16384)),
}
"""Least and greatest values of arguments that trame keeps unchecked; None for those that it checks."""

MAX_WAITING_BYTES = 32_000_000
"""Bytes of messages that wait for a browser, from which on its connection is ended."""

PICTURES, HEAD_BYTES = b"viewport.image.push.subscription", 256
"""Name that messages with pictures have among their first bytes."""


def shown_error(message: object) -> str:
    """Return an error of a page as a line of a terminal: a page may send control characters."""
    return repr(message)[:MAX_ERROR_LENGTH]


class Outbox:
    """Sends messages to one browser: no other waits for it, and only the newest picture is sent.

    If more than `MAX_WAITING_BYTES` wait, the connection is ended: the browser can load the page again.

    Parameters
    ----------
    socket
        The connection; all other attributes are its own.
    """

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._messages: deque[bytes] = deque()
        self._picture = b""
        self._waiting = 0
        self._task: asyncio.Task[None] | None = None
        self._end: asyncio.Task[None] | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._socket, name)

    @property
    def behind(self) -> bool:
        """True while a picture waits."""
        return bool(self._picture)

    async def send_bytes(self, message: bytes) -> None:
        """Send a message soon, in the order of calls but for pictures."""
        if self._end is not None:
            return
        loop = asyncio.get_running_loop()
        if PICTURES in message[:HEAD_BYTES]:
            self._picture = message
        else:
            self._messages.append(message)
            self._waiting += len(message)
        if self._waiting > MAX_WAITING_BYTES:
            self._forget()
            close = self._socket.close(code=WSCloseCode.TRY_AGAIN_LATER, drain=False)
            self._end = loop.create_task(close, name="end of a browser")
        elif self._task is None:
            self._task = loop.create_task(self._send(), name="messages of a browser")

    def _forget(self) -> None:
        self._messages.clear()
        self._picture, self._waiting = b"", 0

    async def _send(self) -> None:
        try:
            while self._messages or self._picture:
                if self._messages:
                    message = self._messages.popleft()
                    self._waiting -= len(message)
                else:
                    message, self._picture = self._picture, b""
                await self._socket.send_bytes(message)
        except ConnectionError:  # the browser has left
            self._forget()
        finally:
            self._task = None


@web.middleware
async def _compressed(request: web.Request, handler: Handler) -> web.StreamResponse:
    response = await handler(request)
    asks_for_part = {"If-None-Match", "If-Modified-Since", "Range"} & set(request.headers)
    if not response.prepared and not asks_for_part:  # an empty answer cannot be compressed
        response.enable_compression()
    return response


def _closing(
    handler: Any, receive: Callable[..., Awaitable[None]], limit_of: Callable[[str], int]
) -> Callable[..., Awaitable[None]]:
    """Return a receiver of messages that ends connections whose bytes are no message, or too many."""

    async def received(binary: bool, message: Any, client: str) -> None:
        chunks = handler.unchunkers[client]
        known = client in handler.authentified_client_ids
        reserved = sum(len(part["content"]) for part in chunks.pending_messages.values())
        chunks.max_message_size = (limit_of(client) if known else MAX_HELLO_BYTES) - reserved
        try:
            assert binary
            await receive(binary, message, client)
        except Exception:  # unpacking raises anything; errors of calls have been answered
            chunks.release_pending_messages()
            await handler.connections[client].close(code=WSCloseCode.INVALID_TEXT)

    return received


class Connections(LinkProtocol):  # type: ignore[misc]  # wslink is not typed
    """Checks the messages of all browsers of a server before its functions are called.

    Malformed messages are refused without an exception, and those that no page sends are left out. If the
    page is shared, only the messages of the browser that drives change something; the others see what it
    does. The driver passes control to the browser that asked first. If the driver leaves, the next browser
    drives.

    Parameters
    ----------
    server
        The trame server, before its start.
    guard
        Checks the requests of the server. A browser without a cookie sends the token first.
    shared
        One browser drives. Otherwise, all may change everything.
    end_input
        Called after a browser has left that held a button or moved a slider.
    resized
        Called after trame has set the size of the window.
    """

    def __init__(
        self,
        server: Any,
        *,
        guard: Guard,
        shared: bool,
        end_input: Callable[[], None],
        resized: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__()
        self._resized = resized
        self._server, self._guard, self._shared, self._end_input = server, guard, shared, end_input
        self._strangers: dict[str, tuple[bool, asyncio.Task[None]]] = {}
        self._web: Any = None
        self._numbers: dict[str, int] = {}
        self._outboxes: dict[str, Outbox] = {}
        self._count = 0
        self._resizes: dict[str, tuple[tuple[int, int], Callable[[], Any]]] = {}
        self._driver = ""
        self._asking: list[str] = []
        self._mouse: tuple[str, Callable[[], Any]] | None = None
        self._last_input = ""
        server.state.driving = self.driving("")
        server.controller.trigger("ask_to_drive")(self.ask)
        server.controller.trigger("pass_control")(self.pass_control)
        server.add_protocol_to_configure(lambda protocol: protocol.registerLinkProtocol(self))
        server.controller.on_server_bind.add(self._bind)

    def _bind(self, bound: Any) -> None:
        """Check all calls of a web server; compress files, but no messages: pictures are small already."""
        self._web = bound
        bound.config["ws_compress"] = False
        bound.app.middlewares.extend((_compressed, self._preloaded))
        routes, bound._default_routes = bound._default_routes, []
        bound.app.add_routes(routes)  # wslink would add them to the application that is served
        bound.set_app(self._guard.protected(bound.app))
        for handler in bound._ws_handlers:
            handler.onMessage = _closing(handler, handler.onMessage, self._limit_of)
            for name, (part, call) in handler.functionMap.items():
                handler.functionMap[name] = part, self._checked(name, call)

    @web.middleware
    async def _preloaded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Name scripts and styles with the page itself: trame does in its first message only."""
        response = await handler(request)
        if request.path.endswith("/index.html"):
            kinds, state = ("script", "style"), self._server.state
            files = (
                f"<{path}>; rel=preload; as={kind}" for kind in kinds for path in state[f"trame__{kind}s"]
            )
            response.headers["Link"] = ", ".join(files)
        return response

    def _checked(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        async def checked(part: Any, *arguments: Any, **options: Any) -> Any:
            client = self._web.last_active_client_id
            allowed = self._allows(client, name, arguments)
            if not allowed and name != SIZE:
                return None
            if allowed and name not in WATCHES:
                self._last_input = client
            try:
                bound = inspect.signature(call).bind(part, *arguments, **options)
                self._check(name, *bound.args[1:])
                if name == SIZE:
                    _, width, height = bound.args[1:4]
                    self._resizes[client] = (int(width + 0.5), int(height + 0.5)), lambda: call(*bound.args)
                if not allowed:
                    return None
            except (TypeError, KeyError, ValueError, AttributeError) as error:
                return {"error": f"refused: {error}"}
            if name == ERROR:
                arguments, options = (shown_error(*bound.args[1:]),), {}
            try:
                result = call(part, *arguments, **options)
                result = await result if inspect.isawaitable(result) else result
            except Exception as error:  # functions of trame raise anything for arguments of no page
                if name in OURS:
                    raise
                return {"error": f"refused: {error}"}
            if name in (SIZE, QUALITY):
                self._resized()
            if name == MOUSE:
                self._keep_mouse(client, lambda event: call(part, event), *arguments)
            if name == STATE:
                result["state"]["driving"] = self.driving(client)
            return result

        return checked

    def _check(self, name: str, first: Any = None, *others: Any) -> None:
        """Raise an error if no page would send these arguments."""
        if name == TRIGGER:
            call = self._server.controller.trigger_fn(first)
            arguments, options = others
            inspect.signature(call).bind(*arguments, **options)
        elif name == UPDATE:
            for change in first:
                if change["key"].startswith(OF_SERVER):
                    raise KeyError(change["key"])
        elif name == LIFECYCLE and first not in LIFE:
            raise ValueError(first)
        for value, limits in zip((first, *others), RANGES.get(name, ()), strict=False):
            if limits is not None and not limits[0] <= value <= limits[1]:
                raise ValueError(f"expected a number from {limits[0]} to {limits[1]}")

    def _keep_mouse(self, client: str, call: Callable[[Any], Any], event: dict[str, Any]) -> None:
        """Remember a button that is down, to release it if its browser leaves."""
        buttons = "buttonLeft", "buttonMiddle", "buttonRight"
        held = any(event[name] for name in buttons)
        up = {**event, **dict.fromkeys(buttons, 0), "action": "up"}
        self._mouse = (client, lambda: call(up)) if held else None

    @property
    def behind(self) -> bool:
        """True if no browser is ready for another picture."""
        return bool(self._outboxes) and all(outbox.behind for outbox in self._outboxes.values())

    @property
    def sizes(self) -> dict[str, tuple[int, int]]:
        """Sizes of the views of browsers that share the page, by browser; empty if none does."""
        return {client: size for client, (size, _) in self._resizes.items()} if self._shared else {}

    # -- browsers ---------------------------------------------------------------------------------------

    def onConnect(self, _request: Any, client: str) -> None:  # noqa: N802  (wslink's name)
        """Wait for the first message of a new browser."""
        ending = asyncio.get_running_loop().create_task(self._end_stranger(client), name="first message")
        self._strangers[client] = ASKING.get().trusted, ending

    async def _end_stranger(self, client: str) -> None:
        await asyncio.sleep(HELLO_SECONDS)
        for handler in self._web._ws_handlers:
            if client in handler.connections:
                await handler.connections[client].close(code=WSCloseCode.POLICY_VIOLATION)

    async def validateToken(self, token: object, client: str) -> bool:  # noqa: N802  (wslink's name)
        """Return True if a browser may connect: it has a cookie, or its first message brings the token."""
        if client in self._strangers:
            trusted, ending = self._strangers[client]
            if not (trusted or self._guard.is_token(token)):
                return False
            del self._strangers[client]
            ending.cancel()
            self._welcome(client)
        return True

    def _welcome(self, client: str) -> None:
        """Give a browser its number, and an outbox."""
        for handler in self._web._ws_handlers:
            if client in handler.connections:
                handler.connections[client] = self._outboxes[client] = Outbox(handler.connections[client])
        self._count += 1
        self._numbers[client] = self._count
        if not self._driver:
            self._driver = client
        self._tell()

    def onClose(self, client: str) -> None:  # noqa: N802  (wslink's name)
        """End what the browser was doing, and pass control on."""
        if client in self._strangers:
            self._strangers.pop(client)[1].cancel()
            return
        del self._numbers[client]
        self._outboxes.pop(client, None)
        self._resizes.pop(client, None)
        self._asking = [other for other in self._asking if other != client]
        if self._mouse is not None and self._mouse[0] == client:
            release, self._mouse = self._mouse[1], None
            release()
        if self._last_input == client:
            self._last_input = ""
            self._end_input()
        if self._driver == client:
            self._driver = next(iter([*self._asking, *self._numbers]), "")
            self._asking = [other for other in self._asking if other != self._driver]
            self._take_size()
        self._tell()

    # -- the driver -------------------------------------------------------------------------------------

    def _drives(self, client: str) -> bool:
        return not self._shared or client == self._driver

    def _limit_of(self, client: str) -> int:
        """Return the number of bytes that a browser may send at once."""
        return MAX_MESSAGE_BYTES if self._drives(client) else MAX_WATCHER_BYTES

    def _allows(self, client: str, name: str, arguments: tuple[Any, ...]) -> bool:
        if self._drives(client):
            return name in DRIVES
        return name in WATCHES or (name == TRIGGER and arguments == ("ask_to_drive", [], {}))

    def driving(self, client: str) -> dict[str, Any]:
        """Return what a browser shows of the driver."""
        return {
            "shared": self._shared,
            "drives": self._drives(client),
            "driver": self._numbers.get(self._driver, 0),
            "number": self._numbers.get(client, 0),
            "browsers": len(self._numbers),
            "asks": client in self._asking,
            "next": self._numbers[self._asking[0]] if self._asking else 0,
        }

    def ask(self) -> None:
        """Ask for control."""
        client = self._web.last_active_client_id
        if client != self._driver and client not in self._asking:
            self._asking.append(client)
        self._tell()

    def pass_control(self) -> None:
        """Pass control to the browser that asked first."""
        if self._asking:
            self._end_input()
            self._driver = self._asking.pop(0)
            self._take_size()
        self._tell()

    def _take_size(self) -> None:
        """Draw pictures of the driver's size."""
        if self._driver in self._resizes:
            self._resizes[self._driver][1]()
            self._resized()

    def _tell(self) -> None:
        """Send each browser what it shows of the driver."""
        if self._shared:
            for client in self._numbers:
                self.publish("trame.state.topic", {"driving": self.driving(client)}, client_id=client)
