"""The guard before a small application: which requests come through, and with which headers."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

pytest.importorskip("aiohttp")

import aiohttp
from aiohttp import web

from decals.apps.sandbox import guard as module
from decals.apps.sandbox.guard import ASKING, Guard, is_loopback, new_token, script_hashes

TOKEN = "0123456789abcdef"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
VISIT = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Site": "none", "Sec-Fetch-Dest": "document"}
INSIDE = {**VISIT, "Sec-Fetch-Dest": "iframe", "Sec-Fetch-Site": "cross-site"}


class Site:
    """An application behind a guard, and requests to it."""

    def __init__(self, guard: Guard) -> None:
        self.guard, self.port = guard, 0

    async def get(
        self, path: str = "/", cookies: Any = None, *, inside: bool = True, **options: Any
    ) -> tuple[int, str, Any]:
        """Return status, text and headers, with the header of the application: what the guard knows."""
        headers = options.pop("headers", {})
        async with aiohttp.ClientSession(cookies=cookies) as http:
            url = f"http://127.0.0.1:{self.port}{self.guard.place if inside else ''}{path}"
            async with http.get(url, headers=headers, allow_redirects=False, **options) as answer:
                return answer.status, await answer.text(), answer.headers

    async def connect(self, cookies: Any = None, **headers: str) -> str:
        """Return what the application sends through a connection for messages, or the status of a refusal."""
        url = f"ws://127.0.0.1:{self.port}{self.guard.place}/ws"
        async with aiohttp.ClientSession(cookies=cookies) as http:
            try:
                async with http.ws_connect(url, headers=headers) as socket:
                    return str(await socket.receive_str())
            except aiohttp.WSServerHandshakeError as error:
                return str(error.status)

    async def cookie(self) -> dict[str, str]:
        status, _, headers = await self.get(f"/?token={TOKEN}", headers=VISIT)
        assert (status, headers["Location"]) == (303, "./")
        name, _, value = headers["Set-Cookie"].split(";")[0].partition("=")
        assert name == f"implicit-decals-{self.port}"
        return {name: value}


def serve(check: Callable[[Site], Awaitable[None]], **options: Any) -> None:
    async def socket(request: web.Request) -> web.WebSocketResponse:
        answer = web.WebSocketResponse()
        await answer.prepare(request)
        await answer.send_str(f"trusted {ASKING.get().trusted}")
        return answer

    async def page(_: web.Request) -> web.Response:
        asking = ASKING.get()
        return web.Response(text=f"page visits {asking.visits} browser {asking.browser}")

    async def run() -> None:
        site = Site(Guard(token=TOKEN, **options))
        app = web.Application()
        app.router.add_get("/ws", socket)
        app.router.add_get("/{path:.*}", page)
        runner = web.AppRunner(site.guard.protected(app))
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        site.port = runner.addresses[0][1]
        try:
            await check(site)
        finally:
            await runner.cleanup()

    asyncio.run(run())


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"GET /" + b"a" * 9000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nCookie: " + b"a" * 9000 + b"\r\n\r\n",
        b"GET / HTTP/9.9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: x\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
    ],
    ids=["long line", "long header", "version", "length", "TLS"],
)
def test_a_request_that_is_none_leaves_no_traceback(
    request_bytes: bytes, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    async def check(site: Site) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", site.port)
        writer.write(request_bytes)
        assert b" 400 " in await reader.readline()
        writer.close()
        assert (await site.get("/"))[0] == 403  # others get their answers

    serve(check)
    assert not caplog.records
    assert capfd.readouterr() == ("", "")


def test_a_cookie_for_the_token_opens_the_page_and_keeps_its_browser() -> None:
    async def check(site: Site) -> None:
        status, text, headers = await site.get("/", headers=VISIT)
        assert (status, "address that the terminal shows" in text) == (403, True)
        cookies = await site.cookie()
        status, text, headers = await site.get("/", cookies, headers=VISIT)
        (name,) = [value.split(".")[0] for value in cookies.values()]
        assert (status, text) == (200, f"page visits True browser {name}")
        assert f"{name}." in headers["Set-Cookie"]  # for thirty more days
        status, _, headers = await site.get(f"/?token={TOKEN}", cookies, headers=VISIT)
        assert f"{name}." in headers["Set-Cookie"]  # another click on the address leads to the same session
        own = f"http://127.0.0.1:{site.port}"
        assert await site.connect(cookies, Origin=own) == "trusted True"
        assert await site.connect(cookies) == "403"
        assert await site.connect(cookies, Origin=f"http://localhost:{site.port}") == "403"
        for wrong in (
            f"{name}.",
            f"{name}.{'0' * 64}",
            "",
            "é",
            f"other.{next(iter(cookies.values()))[-64:]}",
        ):
            status, *_ = await site.get("/", dict.fromkeys(cookies, wrong), headers=VISIT)
            assert status == 403

    serve(check)


def test_the_page_lies_at_a_place_that_only_the_token_opens() -> None:
    """All ports of a machine share cookies, and a page at another port knows no path of this server."""

    async def check(site: Site) -> None:
        cookies, place = await site.cookie(), site.guard.place
        assert (await site.get("/", headers=VISIT))[0] == 403
        status, _, headers = await site.get(f"/?token={TOKEN}", inside=False, headers=VISIT)
        assert (status, headers["Location"]) == (303, f".{place}/?token={TOKEN}")
        assert f"Path={place}/;" in (await site.get("/", cookies, headers=VISIT))[2]["Set-Cookie"]
        for path in ("/", "/index.html", "/ws", place, f"{place}x/", "/?token=wrong", f"//{place[1:]}/"):
            status, text, headers = await site.get(path, cookies, inside=False, headers=VISIT)
            assert (status, place in text, "Location" in headers) == (403, False, False), path
        assert (await site.get("/vue.js", cookies, inside=False))[0] == 403

    serve(check)
    assert len({Guard().place for _ in range(100)}) == 100
    assert len(Guard().place) > 20


def test_a_link_of_another_page_opens_through_a_page_of_this_server() -> None:
    async def check(site: Site) -> None:
        for headers in ({**VISIT, "Sec-Fetch-Site": "cross-site"}, {"Accept": "text/html"}):
            status, text, answer = await site.get(f"/?token={TOKEN}", headers=headers)
            assert (status, "Set-Cookie" in answer) == (200, False)
            (again,) = re.findall(r"url=([^']*)'", text)
            near = {**headers, "Sec-Fetch-Site": "same-origin"} if "Sec-Fetch-Site" in headers else headers
            status, _, answer = await site.get(f"/{again.replace('&amp;', '&')}", headers=near)
            assert (status, answer["Location"], "Set-Cookie" in answer) == (303, "./", True)

    serve(check)


def test_names_of_this_machine_are_allowed_and_others_are_not() -> None:
    async def check(site: Site) -> None:
        cookies = await site.cookie()
        for host, status in (
            ("localhost", 200),
            ("[::1]", 200),
            ("127.0.0.9", 200),
            ("decals.example.org", 200),
            ("DECALS.example.org", 200),
            ("foreign.example", 403),
            ("127.0.0.1.foreign.example", 403),
            ("10.0.0.1", 403),
            ("", 400),
        ):
            value = f"{host}:{site.port}" if host else ""
            found, *_ = await site.get("/", cookies, headers={**VISIT, "Host": value})
            assert found == status or (not host and found in (400, 403)), host

    serve(check, allow_hosts=["decals.example.org"])


def test_a_process_with_the_token_needs_no_cookie_and_a_page_in_a_frame_brings_it_first() -> None:
    async def check(site: Site) -> None:
        assert await site.connect(**BEARER) == "trusted True"
        assert await site.connect(Authorization=f"Bearer {TOKEN}x") == "403"
        own = f"http://127.0.0.1:{site.port}"
        assert await site.connect(Origin=own) == "403"  # no notebook shows the page yet
        status, *_ = await site.get("/index.html?frame=http://a.example", headers=INSIDE)
        assert status == 403
        for bad in ("*", "null", "javascript:x", "http://a.example; script-src *", "http://a.example/x"):
            status, *_ = await site.get(f"/?token={TOKEN}&frame={bad}", headers=INSIDE)
            assert status == 403, bad
        shown = "http://a.example%20vscode-webview://x1"
        status, _, headers = await site.get(f"/?token={TOKEN}&frame={shown}", headers=INSIDE)
        assert status == 303
        status, text, headers = await site.get(f"/{headers['Location']}", headers=INSIDE)
        assert (status, text.startswith("page")) == (200, True)
        assert headers["Content-Security-Policy"].endswith(
            "frame-ancestors http://a.example vscode-webview://x1"
        )
        assert await site.connect(Origin=own) == "trusted False"
        assert await site.connect(Origin="http://b.example") == "403"
        image = {"Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "script"}
        for near, expected in (("same-origin", 200), ("cross-site", 403), ("same-site", 403)):
            status, *_ = await site.get("/vue.js", headers={**image, "Sec-Fetch-Site": near})
            assert status == expected

    serve(check, framed=True)


def test_a_proxy_that_sends_the_token_has_checked_names_and_keeps_the_cookie_to_its_path() -> None:
    async def check(site: Site) -> None:
        proxied = {**VISIT, **BEARER, "Host": "hub.example", "Origin": "https://hub.example:8443"}
        proxied |= {"X-Forwarded-Prefix": "/user/a/sandbox", "X-Forwarded-Proto": "https,http"}
        status, text, headers = await site.get("/", headers=proxied)
        assert (status, text.startswith("page visits True")) == (200, True)
        assert f"Path=/user/a/sandbox{site.guard.place}/;" in headers["Set-Cookie"]
        assert "Secure" in headers["Set-Cookie"]
        assert headers["Content-Security-Policy"].endswith("frame-ancestors 'self'")
        status, text, headers = await site.get("/", headers={**proxied, "Sec-Fetch-Site": "cross-site"})
        assert (status, "opens" in text, "Set-Cookie" in headers) == (200, True, False)
        odd = {**proxied, "X-Forwarded-Prefix": "/a; Domain=b"}
        assert f"Path={site.guard.place}/;" in (await site.get("/", headers=odd))[2]["Set-Cookie"]
        status, _, headers = await site.get("/?a=b%0d%0ac", inside=False, headers=proxied)
        assert (status, headers["Location"]) == (303, f".{site.guard.place}/?a=b%0D%0Ac")

    serve(check)


def test_connections_for_messages_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_SOCKETS", 0)

    async def check(site: Site) -> None:
        assert await site.connect(**BEARER) == "503"
        assert (await site.get("/", headers=BEARER))[0] == 200

    serve(check)


def test_tokens_are_long_and_texts() -> None:
    tokens = {new_token() for _ in range(200)}
    assert len(tokens) == 200
    assert all(len(token) > 30 and not token.isdigit() for token in tokens)
    for odd in ("", None, 3, b"x", TOKEN[:-1], f"{TOKEN}x", [TOKEN]):
        assert not Guard(token=TOKEN).is_token(odd)
    assert [is_loopback(host) for host in ("localhost", "127.3.3.3", "::1", "0.0.0.0", "a")] == [
        True,
        True,
        True,
        False,
        False,
    ]
    assert script_hashes().count("sha256-") >= 1
