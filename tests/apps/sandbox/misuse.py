"""Requests of strangers and messages in wrong orders, for `tests.apps.sandbox.messages`."""

import asyncio
import random
from contextlib import suppress
from typing import Any

import aiohttp
from trame_server.client import WsLinkSession

from tests.apps.sandbox.attacks import FOREIGN, IMAGE, NAVIGATE, WRONG, Server, get, opens, talk

HELLO_SECONDS = 2.0
"""Time in which an answer to a browser without a hello would come."""

STEPS: list[tuple[Any, ...]] = [
    *(("drag_handle", name, phase, 0.6, 0.4) for name in ("move", "slice") for phase in ("move", "end")),
    ("drag_handle", "move", "begin", 0.5, 0.5),
    ("pinch", 0.1, 0.1, 1.5, "end"),
    ("pinch", 0.1, 0.1, 1.5, "begin"),
    ("set_control", "node", "radius", 0.3, False),
    ("set_control", "node", "radius", 0.4, True),
    ("scatter",),
    ("drop_work", 1),
    ("drop_work", 10**9),
    ("close_lesson",),
    ("open_lesson", 0),
    ("go_to", 0),
    ("go_to", 2),
    ("add", "Point"),
    ("select", "0/0"),
    *(("perform", action) for action in ("deselect", "undo", "redo", "delete", "end_brush")),
    *(("mouse", action) for action in ("up", "move", "down")),
    ("pass_control",),
    ("ask_to_drive",),
    ("lifecycle", "client_exited"),
    ("lifecycle", "client_unmounted"),
]
"""Messages that only an order of others makes sensible: phases of drags, work, history and control."""


def random_steps(rng: random.Random) -> list[tuple[Any, ...]]:
    """Return messages in an order that no page sends."""
    return rng.choices(STEPS, k=rng.randint(1, 6))


async def ask_as_stranger(server: Server, rng: random.Random) -> str:
    """Ask with a wrong token, or with the right one as a foreign page; return what it got, or nothing."""
    own, token = f"http://{server.authority}", server.token
    origin = rng.choice((FOREIGN, "null", f"{own}.foreign.example", f"http://127.0.0.1:{server.port + 1}"))
    host = rng.choice(("foreign.example", f"foreign.example:{server.port}", "localhost.", "[::"))
    wrong = rng.choice([*WRONG, token[:-1], f"{token}x", token.upper(), [token], {"secret": token}])
    kind = rng.randrange(5)
    if kind == 0:
        got: object = await talk(server, secret=wrong, Origin=own)
    elif kind == 1:
        got = await talk(server, secret=token, Origin=origin)
    elif kind == 2:
        got = await talk(server, secret=token, Origin=rng.choice((own, f"http://{host}")), Host=host)
    elif kind == 3:
        got = await _without_hello(server)
    else:
        headers = {**rng.choice((NAVIGATE, IMAGE)), "Sec-Fetch-Site": "cross-site", "Origin": origin}
        path = rng.choice(("", "index.html", f"?token={wrong}", "?secret=wslink-secret"))
        status, text, _ = await get(server, path, **headers)
        got = opens(status, text)
    return f"stranger {kind} of {origin}, {host}, {wrong!r}" if got else ""


async def _without_hello(server: Server) -> bool:
    """Return True if values of the page come before the first message has brought the token."""
    async with (
        aiohttp.ClientSession() as http,
        http.ws_connect(server.messages, origin=f"http://{server.authority}") as socket,
    ):
        session = WsLinkSession(socket)
        listening = asyncio.create_task(session.listen())
        try:
            with suppress(Exception):  # refused, in any form
                async with asyncio.timeout(HELLO_SECONDS):
                    return "state" in await (await session.call("trame.state.get", []))
        finally:
            listening.cancel()
    return False
