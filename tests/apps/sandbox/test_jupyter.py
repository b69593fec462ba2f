"""The sandbox behind the proxy of a Jupyter server, whose Host and Origin are those of the proxy."""

import asyncio
import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from decals.apps.jupyter import TOKEN, sandbox

needs_proxy = pytest.mark.skipif(
    find_spec("jupyter_server_proxy") is None or find_spec("trame_vtk") is None,
    reason="needs the proxy: pip install jupyter-server-proxy 'implicit-decals[browser]'",
)

LOGIN = "login-of-jupyter"
VISIT = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Site": "none", "Sec-Fetch-Dest": "document"}
SCRIPT = {"Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Site": "same-origin", "Sec-Fetch-Dest": "script"}
HUB = "hub.example:8443"


def joined(cookies: dict[str, str]) -> str:
    """Return cookies as a browser sends them."""
    return "; ".join(f"{name}={value}" for name, value in cookies.items())


@contextmanager
def jupyter(folder: Path) -> Iterator[str]:
    """Start a Jupyter server with the proxy below a base address, as a hub does."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    config = folder / "config.py"
    config.write_text(
        "from decals.apps.jupyter import sandbox\n"
        "c.ServerProxy.servers = {'implicit-decals': sandbox()}\n"
        f"c.IdentityProvider.token = {LOGIN!r}\n"
        "c.ServerApp.base_url = '/user/a/'\n"
        f"c.ServerApp.port = {port}\nc.ServerApp.port_retries = 0\nc.ServerApp.ip = '127.0.0.1'\n"
        f"c.ServerApp.allow_origin = 'https://{HUB}'\nc.ServerApp.allow_remote_access = True\n"
        "c.ServerApp.open_browser = False\nc.ServerApp.allow_root = True\n"
        "c.ServerApp.jpserver_extensions = {'jupyter_server_proxy': True}\n"
    )
    environment = {**os.environ, "JUPYTER_CONFIG_DIR": str(folder), "JUPYTER_DATA_DIR": str(folder)}
    environment |= {"JUPYTER_RUNTIME_DIR": str(folder / "run"), "HOME": str(folder)}
    command = [sys.executable, "-m", "jupyter_server", "--config", str(config)]
    log = (folder / "log.txt").open("w")
    with log, subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log) as process:
        try:
            yield f"http://127.0.0.1:{port}/user/a/"
        finally:
            process.terminate()
            process.wait(40)


@pytest.mark.slow
@needs_proxy
@pytest.mark.skipif(sys.platform == "win32", reason="the servers of this test end by signals")
def test_a_browser_behind_the_proxy_edits_and_others_do_not(vtk_display: None, tmp_path: Path) -> None:
    import aiohttp
    from trame_server.client import WsLinkSession
    from yarl import URL

    login = {"Host": HUB}

    async def state(http: Any, url: str, origin: str) -> Any:
        async with http.ws_connect(url, origin=origin, headers=login) as messages:
            session = WsLinkSession(messages)
            listening = asyncio.create_task(session.listen())
            await session.auth(secret="")
            found = await (await session.call("trame.state.get", []))
            listening.cancel()
            return found["state"]

    async def refuses(http: Any, url: str, headers: dict[str, str]) -> bool:
        """Return True if no connection opens; the proxy opens its own first, and then closes it."""
        try:
            async with http.ws_connect(url, origin=f"https://{HUB}", headers=headers) as messages:
                return bool((await messages.receive(20)).type is aiohttp.WSMsgType.CLOSED)
        except aiohttp.WSServerHandshakeError as error:
            return bool(error.status == 403)

    async def logged_in(http: Any, base: str) -> dict[str, str]:
        """Return the cookies of a login, once the server answers."""
        while True:
            await asyncio.sleep(0.3)
            try:
                async with http.get(
                    f"{base}?token={LOGIN}", headers={**VISIT, **login}, allow_redirects=False
                ) as answer:
                    return {name: morsel.value for name, morsel in answer.cookies.items()}
            except aiohttp.ClientConnectionError:
                pass

    async def check(base: str) -> None:
        url = URL(f"{base}implicit-decals/")
        cookies: dict[str, str] = {}
        async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as http, asyncio.timeout(150):
            of_jupyter = await logged_in(http, base)
            text = ""
            while "trame" not in text:
                sent = {**VISIT, **login, "Cookie": joined({**of_jupyter, **cookies})}
                try:
                    async with http.get(url, headers=sent, allow_redirects=False) as answer:
                        text = await answer.text()
                        for cookie in answer.headers.getall("Set-Cookie", []):
                            if found := re.match(
                                rf"(implicit-decals-\d+)=([^;]+);.*Path={url.parent.path}/;", cookie
                            ):
                                cookies[found[1]] = found[2]
                        url = url.join(URL(answer.headers.get("Location", "")))
                except aiohttp.ClientConnectionError:
                    pass
                await asyncio.sleep(0.3)
            assert list(cookies) == ["implicit-decals-8443"]
            own = {**login, "Cookie": joined({**of_jupyter, **cookies})}
            async with http.get(url.join(URL("vue.global.js")), headers={**SCRIPT, **own}) as answer:
                assert answer.status == 200
                assert answer.headers["Content-Security-Policy"].endswith("frame-ancestors 'self'")
            finder = url.join(URL("paraview/"))
            async with http.post(finder, headers={**own, "Origin": f"https://{HUB}"}, json={}) as answer:
                assert await answer.json() == {"sessionURL": f"ws://USE_HOST{url.parent.path}/ws"}
            messages = str(url.with_scheme("ws").join(URL("ws")))
            login.update(own)
            assert "outline" in await state(http, messages, f"https://{HUB}")
            for headers in ({**login, "Cookie": joined(of_jupyter)}, {**login, "Cookie": joined(cookies)}):
                assert await refuses(http, messages, headers)
            with pytest.raises(aiohttp.WSServerHandshakeError):  # Jupyter compares the origin
                await state(http, messages, "https://foreign.example")
            image = {**SCRIPT, **own, "Sec-Fetch-Site": "cross-site"}
            async with http.get(url, headers=image) as answer:
                assert answer.status == 403

    with jupyter(tmp_path) as base:
        asyncio.run(check(base))
    log = (tmp_path / "log.txt").read_text()
    assert re.search(r"sandbox at http://127\.0\.0\.1:\d+/[\w-]+/ \(", log)  # without the token


def test_the_proxy_gets_a_token_that_no_argument_shows() -> None:
    first, second = sandbox(), sandbox()
    token = first["environment"][TOKEN]
    assert token != second["environment"][TOKEN]
    assert first["request_headers_override"] == {"Authorization": f"Bearer {token}"}
    assert token not in json.dumps(first["command"])
