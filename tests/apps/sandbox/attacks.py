"""Attacks on the sandbox's servers: ``python -m tests.apps.sandbox.attacks [WAY ...]``.

Each attack is tried against the real server in each way of starting, and returns what it got: nothing, or a
sentence. `table` prints the table of docs/sandbox-security.md.
"""

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import aiohttp
from aiohttp import web
from trame_server.client import WsLinkSession

from decals.apps.sandbox.guard import allow_connections

PYTHON = [sys.executable, "-m", "decals", "sandbox"]
PATIENCE = 90.0
"""Seconds in which a server starts; its first frame compiles shaders."""
OTHER_ACCOUNT = 65534
"""Number of an account without rights."""
FOREIGN = "http://foreign.example"
NOTEBOOK = "http://notebook.example"
NAVIGATE = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document", "Sec-Fetch-Site": "none"}
IMAGE = {"Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image", "Accept": "image/*"}
WRONG: list[object] = ["wslink-secret", "", None, True, 0, [], {}, "t" * 33]
"""Tokens that are none."""

# A window of its own without a screen: it prints the address, and waits as a window does.
WINDOW = """
import sys, types
window = types.SimpleNamespace(
    create_window=lambda _, url, **__: print("url", url, flush=True),
    start=lambda **_: sys.stdin.read(), WebViewException=LookupError)
sys.modules["webview"] = window
from decals.apps.cli import run
run(["sandbox", "--desktop"])
"""

WAYS: dict[str, list[str]] = {
    "browser": [*PYTHON, "--port", "0", "--no-browser"],
    "--host": [*PYTHON, "--host", "0.0.0.0", "--port", "0", "--no-browser"],
    "--session": [*PYTHON, "--session", "--port", "0", "--no-browser"],
    "--share": [*PYTHON, "--share", "--port", "0", "--no-browser"],
    "--lab": [*PYTHON, "--lab", "--share", "--port", "0", "--no-browser"],
    "--class": [*PYTHON, "--lab", "--class", "--port", "0", "--no-browser"],
    "--desktop": [sys.executable, "-c", WINDOW],
    "notebook": [*PYTHON, "--done", "--port", "0", "--no-browser"],
}
"""Commands of the ways of starting."""

USUAL_LIMIT = 'ulimit -Sn 1024 && exec "$@"'
"""Runs a command that may have as many files open at its start as is usual."""


@dataclass
class Server:
    """A server that runs, and what its user has."""

    way: str
    process: "subprocess.Popen[str]"
    folder: Path
    address: str = ""
    token: str = ""
    lines: list[str] = field(default_factory=list)
    cookies: dict[str, str] = field(default_factory=dict)

    @property
    def authority(self) -> str:
        return self.address.removeprefix("http://").partition("/")[0]

    @property
    def messages(self) -> str:
        """URL of the messages of the page."""
        return f"{self.address.replace('http', 'ws', 1)}ws"

    @property
    def port(self) -> int:
        return int(self.authority.rsplit(":", 1)[1])

    def children(self) -> list[int]:
        """Return the processes that it has started, and theirs."""
        found, parents = [], {self.process.pid}
        for _ in range(3):
            for entry in Path("/proc").glob("[0-9]*/stat"):
                with suppress(OSError, ValueError, IndexError):
                    number = int(entry.parent.name)
                    parent = int(entry.read_text().rsplit(")", 1)[1].split()[1])
                    if parent in parents and number not in parents:
                        parents.add(number)
                        found.append(number)
        return found

    async def enter(self) -> dict[str, str]:
        """Open the page as its user does, wait until it is there, and return the cookie."""
        if self.cookies:
            return self.cookies
        jar = aiohttp.CookieJar(unsafe=True)
        async with (
            aiohttp.ClientSession(cookie_jar=jar, headers=NAVIGATE) as browser,
            asyncio.timeout(PATIENCE),
        ):
            url = f"{self.address}?token={self.token}"
            while True:
                async with browser.get(url) as answer:
                    if "trame" in await answer.text():
                        self.cookies = {morsel.key: morsel.value for morsel in jar}
                        return self.cookies
                await asyncio.sleep(0.2)


@contextmanager
def served(way: str) -> Iterator[Server]:
    """Start a server in one of the ways, in a folder of its own, and end it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "private.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        with subprocess.Popen(
            ["sh", "-c", USUAL_LIMIT, "sh", *WAYS[way]],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        ) as process:
            server = Server(way, process, folder)
            try:
                _read_address(server)
                yield server
            finally:
                process.send_signal(signal.SIGINT)
                assert process.stdin is not None
                with suppress(OSError):
                    process.stdin.close()
                try:
                    process.wait(PATIENCE)
                finally:
                    process.kill()


def _read_address(server: Server) -> None:
    """Read the address and the token that the user gets."""
    assert server.process.stdin is not None
    assert server.process.stdout is not None
    if server.way == "--session":
        server.token = "k" * 32
        server.process.stdin.write(f"{server.token}\n")
        server.process.stdin.flush()
    for line in server.process.stdout:
        server.lines.append(line)
        if found := re.search(r"http://[^/\s]+:(\d+/[\w-]+/)(?:\?token=(\S+))?", line):
            server.address, server.token = f"http://127.0.0.1:{found[1]}", found[2] or server.token
            if server.way == "--class":
                server.lines.append(server.process.stdout.readline())
            return
    raise RuntimeError(f"expected an address, got {''.join(server.lines)}")


async def talk(
    server: Server,
    *,
    secret: object = "wslink-secret",
    cookies: dict[str, str] | None = None,
    **headers: str,
) -> dict[str, Any] | None:
    """Connect, and return the values of the page if the server gives them."""
    sent = {name.replace("_", "-"): text for name, text in headers.items()}
    async with aiohttp.ClientSession(cookies=cookies) as http:
        try:
            async with http.ws_connect(server.messages, headers=sent) as socket_:
                session = WsLinkSession(socket_)
                listening = asyncio.create_task(session.listen())
                try:
                    async with asyncio.timeout(20):
                        await (await _sent(session.auth(secret=secret)))
                        return dict((await (await session.call("trame.state.get", [])))["state"])
                except Exception:  # refused, in any form
                    return None
                finally:
                    listening.cancel()
        except aiohttp.ClientError:
            return None


async def _sent(call: Any) -> Any:
    return await call if asyncio.iscoroutine(call) else call


async def get(
    server: Server, path: str = "", cookies: dict[str, str] | None = None, /, **headers: str
) -> tuple[int, str, Any]:
    """Return status, text and headers of an answer."""
    sent = {name.replace("_", "-"): text for name, text in headers.items()}
    async with aiohttp.ClientSession(cookies=cookies) as http:
        url = f"{server.address}{path}"
        async with http.get(url, headers=sent, allow_redirects=False) as answer:
            return answer.status, await answer.text(errors="replace"), answer.headers


def opens(status: int, text: str) -> bool:
    return status < 400 and ("trame" in text or "session starts" in text)


# -- another page in the same browser -----------------------------------------------------------------------


async def foreign_socket(server: Server) -> str:
    """A page of another server opens a connection for messages; the browser may send a cookie."""
    for cookies in (None, await server.enter()):
        for host in (server.authority, "foreign.example"):
            for token in WRONG:
                if await talk(server, secret=token, cookies=cookies, Origin=FOREIGN, Host=host):
                    return f"read the scene with Host {host}"
        for origin in (
            "null",
            f"http://127.0.0.1:{server.port + 1}",
            f"http://{server.authority}.foreign.example",
        ):
            if await talk(server, cookies=cookies, Origin=origin):
                return f"read the scene with Origin {origin}"
        if await talk(server, cookies=cookies):
            return "read the scene without Origin"
    return ""


async def rebinding(server: Server) -> str:
    """A foreign name leads to this machine, so that its page counts as the same server."""
    cookies = await server.enter()
    for host in (
        f"foreign.example:{server.port}",
        "foreign.example",
        "127.0.0.1.foreign.example",
        "localhost.",
        "[::",
    ):
        for known in ({}, cookies):
            if await talk(server, cookies=known, Origin=f"http://{host}", Host=host):
                return f"read the scene as {host}"
            status, text, _ = await get(server, "index.html", known, Host=host, **NAVIGATE)
            if opens(status, text):
                return f"read the page as {host}"
    return ""


async def image(server: Server) -> str:
    """A page shows an image of the server's address: no process starts for it, and nothing comes."""
    known, before = await server.enter(), len(server.children())
    for site in ("cross-site", "same-site"):
        for cookies in ({}, known):
            status, text, _ = await get(server, "", cookies, **IMAGE, Sec_Fetch_Site=site)
            if opens(status, text):
                return "got an answer"
    for headers in ({}, IMAGE, {"Accept": "image/*"}):
        status, text, _ = await get(server, "", {}, **headers)
        if opens(status, text):
            return "got an answer without a cookie"
    await asyncio.sleep(0.5)
    return "a process started" if len(server.children()) > before else ""


async def link(server: Server) -> str:
    """A page opens the address in a window, without the token, again and again."""
    await server.enter()
    before = len(server.children())
    for site in ("cross-site", "same-site", "none"):
        for path in ("", "index.html", "?again=", "?token=", "?secret=wslink-secret"):
            status, text, _ = await get(server, path, **{**NAVIGATE, "Sec-Fetch-Site": site})
            if opens(status, text):
                return f"opened /{path}"
    await asyncio.sleep(0.5)
    return "a process started" if len(server.children()) > before else ""


async def frame(server: Server) -> str:
    """A page shows the sandbox in a frame, to steal clicks."""
    cookies = await server.enter()
    inside = {**NAVIGATE, "Sec-Fetch-Dest": "iframe"}
    for site in ("cross-site", "same-site", "same-origin", "none"):
        for path in ("", "index.html", f"?frame={FOREIGN}"):
            status, text, _ = await get(server, path, cookies, **{**inside, "Sec-Fetch-Site": site})
            if opens(status, text):
                return f"showed /{path}"
    _, _, headers = await get(server, "index.html", cookies, **NAVIGATE)
    policy = headers.get("Content-Security-Policy", "")
    return "" if policy.endswith(f"frame-ancestors {'none'!r}") else f"may be framed: {policy}"


async def form(server: Server) -> str:
    """A page sends a form, or another method."""
    cookies = await server.enter()
    async with aiohttp.ClientSession(cookies=cookies) as http:
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"):
            for path in ("", "index.html", "paraview/", "ws"):
                headers = {"Origin": FOREIGN, "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}
                async with http.request(method, f"{server.address}{path}", headers=headers) as answer:
                    if answer.status < 400:
                        return f"{method} /{path} was answered"
                    if "Access-Control-Allow-Origin" in answer.headers:
                        return "an answer may be read by other pages"
    return ""


async def leak(server: Server) -> str:
    """The token or the cookie comes to a script, another page or another server."""
    status, _, headers = await get(server, f"?token={server.token}", **NAVIGATE)
    cookie = headers.get("Set-Cookie", "")
    if status != 303 or "token" in headers.get("Location", "token"):
        return "the token stays in the address"
    if (
        not all(part in cookie for part in ("HttpOnly", "SameSite=Strict", "Path=/"))
        or server.token in cookie
    ):
        return f"a cookie without its limits: {cookie}"
    if str(server.port) not in cookie.split("=")[0]:
        return "servers of other ports share the name of the cookie"
    status, text, headers = await get(server, "index.html", await server.enter(), **NAVIGATE)
    if server.token in text or headers.get("Referrer-Policy") != "no-referrer":
        return "the page gives the token away"
    policy = headers.get("Content-Security-Policy", "")
    strict = "default-src 'none'" in policy and "'unsafe-inline'" not in policy.split("style-src")[0]
    return "" if strict and headers.get("X-Content-Type-Options") == "nosniff" else f"a weak policy: {policy}"


async def other_port(server: Server) -> str:
    """A user opens the page of another server at another port of this machine; all ports share cookies."""
    got: list[str] = []

    async def answer(request: web.Request) -> web.Response:
        got.append(request.headers.get("Cookie", ""))
        return web.Response(text="a page")

    other = web.Application()
    other.router.add_get("/{path:.*}", answer)
    runner = web.AppRunner(other)
    await runner.setup()
    jar = aiohttp.CookieJar(unsafe=True)
    try:
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        foreign = f"http://127.0.0.1:{runner.addresses[0][1]}"
        async with aiohttp.ClientSession(cookie_jar=jar, headers=NAVIGATE) as browser:
            async with browser.get(f"{server.address}?token={server.token}") as page:
                await page.read()
            if not len(jar):
                raise RuntimeError("expected a cookie")
            for path in ("/", "/index.html", "/ws", "/paraview/"):
                async with browser.get(f"{foreign}{path}") as page:
                    await page.read()
    finally:
        await runner.cleanup()
    return "the cookie came to another server" if any(got) else ""


# -- another account, another machine -----------------------------------------------------------------------


async def stranger(server: Server) -> str:
    """A program without the token asks for pages, files and messages; it may send any header."""
    await server.enter()
    own, name = f"http://{server.authority}", f"implicit-decals-{server.port}"
    browser = {**NAVIGATE, "Origin": own}
    for cookies in ({}, {name: "x"}, {name: f"x.{'0' * 64}"}, {name: "."}, {name: f"x.{server.port}é"}):
        for token in (*WRONG[:2], "x", server.token[:-1], server.token.upper()):
            bearer = {"Authorization": f"Bearer {token}"}
            if await talk(server, secret=token, cookies=cookies, Origin=own, **bearer):
                return f"read the scene with {token!r}"
            for path in ("index.html", "vue.global.js", "", f"?token={token}", f"?secret={token}"):
                status, text, _ = await get(server, path, cookies, **browser, **bearer)
                if status < 400 or opens(status, text):
                    return f"got /{path}"
    return ""


async def hello(server: Server) -> str:
    """A program connects as the frame of a notebook does, and guesses the first message."""
    url = f"index.html?token={server.token}&frame={NOTEBOOK}"
    await get(server, url, **{**NAVIGATE, "Sec-Fetch-Dest": "iframe", "Sec-Fetch-Site": "cross-site"})
    own = f"http://{server.authority}"
    for token in WRONG:
        if await talk(server, secret=token, Origin=own):
            return f"read the scene with {token!r}"
    async with aiohttp.ClientSession() as http:
        try:
            async with http.ws_connect(server.messages, origin=own) as socket_:
                session = WsLinkSession(socket_)
                listening = asyncio.create_task(session.listen())
                for call in ("trame.state.get", "application.exit"):
                    with suppress(Exception):
                        async with asyncio.timeout(3):
                            if "state" in (await (await session.call(call, []))):
                                return "read the scene before the first message"
                listening.cancel()
        except aiohttp.ClientError:
            pass
    return "" if server.process.poll() is None else "ended the server"


async def processes(server: Server) -> str:
    """Another account lists the arguments of all processes, and the files that anybody can read."""
    await server.enter()
    for number in (server.process.pid, *server.children()):
        for kind in ("cmdline", "environ"):
            with suppress(OSError):
                if server.token in Path(f"/proc/{number}/{kind}").read_text(errors="replace"):
                    return f"{kind} of a process shows the token"
    return ""


async def account(server: Server) -> str:
    """Another account of the machine tries all that needs no token, and reads what it may."""
    await server.enter()
    place = server.address.partition(server.authority)[2].rstrip("/")  # even if it were known
    program = f"""
import glob, http.client, json
found = []
for path in ("/", "/index.html", "/vue.global.js", "/?secret=wslink-secret"):
    connection = http.client.HTTPConnection("127.0.0.1", {server.port}, timeout=20)
    connection.request("GET", {place!r} + path, headers={{"Accept": "text/html"}})
    found.append(connection.getresponse().status)
places = ("/proc/[0-9]*/cmdline", "/proc/[0-9]*/environ", "/tmp/*/*.html")
for name in [name for place in places for name in glob.glob(place)]:
    try: found.append({server.token!r} in open(name, errors="replace").read())
    except OSError: pass
print(json.dumps(found))
"""
    run = await asyncio.to_thread(
        subprocess.run,
        ["python3", "-I", "-"],
        input=program,
        capture_output=True,
        text=True,
        user=OTHER_ACCOUNT,
        group=OTHER_ACCOUNT,
        extra_groups=[],
        cwd="/",
        check=True,
        timeout=60,
    )
    found = json.loads(run.stdout)
    return (
        ""
        if all(one is False or one in (403, 404) for one in found)
        else f"got {found[:4]}, {sum(map(bool, found[4:]))} files"
    )


async def path(server: Server) -> str:
    """A program with the cookie asks for files outside the page's folder, and for impossible names."""
    cookies = await server.enter()
    for name in (
        "../" * 8 + "etc/passwd",
        "%2e%2e/" * 8 + "etc/passwd",
        "..%5c" * 8 + "etc/passwd",
        "//etc/passwd",
        "a" * 3000,
    ):
        request = f"GET /{name} HTTP/1.1\r\nHost: {server.authority}\r\nConnection: close\r\n"
        request += "".join(f"Cookie: {key}={value}\r\n" for key, value in cookies.items()) + "\r\n"
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(request.encode())
        answer = await asyncio.wait_for(reader.read(), 20)
        if b"root:" in answer or answer.startswith(b"HTTP/1.1 500"):
            return f"read or failed at {name[:40]}"
        writer.close()
    return ""


# -- a browser that only watches -----------------------------------------------------------------------------

MESSAGES = [
    "application.exit",
    "application.exit.later",
    "trame.error.client",
    "trame.force.push",
    "trame.lifecycle.update",
    "trame.state.get",
    "trame.state.update",
    "trame.trigger",
    "viewport.axes.center.visibility.update",
    "viewport.axes.orientation.visibility.update",
    "viewport.camera.reset",
    "viewport.camera.update",
    "viewport.geometry.array.get",
    "viewport.geometry.view.get.export",
    "viewport.geometry.view.get.state",
    "viewport.geometry.view.observer.add",
    "viewport.geometry.view.observer.remove",
    "viewport.image.animation.fps.get",
    "viewport.image.animation.fps.max",
    "viewport.image.animation.start",
    "viewport.image.animation.stop",
    "viewport.image.push",
    "viewport.image.push.enabled",
    "viewport.image.push.invalidate.cache",
    "viewport.image.push.observer.add",
    "viewport.image.push.observer.remove",
    "viewport.image.push.original.size",
    "viewport.image.push.quality",
    "viewport.image.push.quality.get",
    "viewport.mouse.interaction",
    "viewport.mouse.zoom.wheel",
]
"""All messages that trame and VTK have registered."""

TRIGGERS = ["read", "handle", "look", "move", "pass_control", "pinch", "place", "rename", "trigger"]
TRIGGERS += [f"trigger__{number}" for number in range(1, 40)]
SHOWN = (
    "outline",
    "selected",
    "done",
    "undone",
    "display",
    "decal",
    "brush",
    "drawing",
    "start",
    "help",
    "theme",
)
"""Values that edits change."""


async def watcher(server: Server) -> str:
    """A browser that watches a shared page sends every message, with arguments that do something."""
    cookies, before = await server.enter(), _files(server)
    async with _connected(server, cookies) as driver, _connected(server, cookies) as other:
        first, theirs = [await _call(one, "trame.state.get") for one in (driver, other)]
        if theirs["state"]["driving"]["drives"]:
            return "two browsers drive"
        found = {name: first["state"].get(name) for name in SHOWN}
        picture = {"name": "x.hdr", "content": b"#?RADIANCE"}
        mouse = dict.fromkeys(("buttonLeft", "shiftKey", "ctrlKey", "altKey", "metaKey"), 1)
        arguments: list[list[Any]] = [[], ["1"], ["-1", 1, 2], [{"view": "1", "x": 0.5, "y": 0.5, **mouse}]]
        for name in TRIGGERS:
            for values in ([], [1], ["creature"], ["private.obj"], ["private.obj", 0], ["stolen.json", True]):
                answer = await _call(other, "trame.trigger", name, values, {})
                if answer is not None:
                    return f"{name} was answered: {answer!r}"
        changes = [{"key": key, "value": value} for key, value in (("dropped", [picture]), ("theme", "dark"))]
        await _call(other, "trame.state.update", changes)
        for name in MESSAGES:
            for values in arguments:
                await _call(other, name, *values)
        await asyncio.sleep(1.5)
        state = (await _call(driver, "trame.state.get"))["state"]
        changed = [name for name in SHOWN if state.get(name) != found[name]]
        if changed or _files(server) != before:
            return f"changed {changed}, wrote {set(_files(server)) - set(before)}"
        await _call(other, "trame.trigger", "ask_to_drive", [], {})  # the only one that it may send
        asked = (await _call(other, "trame.state.get"))["state"]["driving"]["asks"]
    return "" if asked else "cannot ask for control"


def _files(server: Server) -> dict[str, bytes]:
    return {str(one): one.read_bytes() for one in sorted(server.folder.rglob("*")) if one.is_file()}


@asynccontextmanager
async def _connected(server: Server, cookies: dict[str, str]) -> AsyncIterator[WsLinkSession]:
    async with (
        aiohttp.ClientSession(cookies=cookies) as http,
        http.ws_connect(server.messages, origin=f"http://{server.authority}") as socket_,
    ):
        session = WsLinkSession(socket_)
        listening = asyncio.create_task(session.listen())
        await (await _sent(session.auth(secret="")))
        yield session
        listening.cancel()


async def _call(session: WsLinkSession, name: str, *arguments: Any) -> Any:
    """Return an answer, or None for an error."""
    async with asyncio.timeout(20):
        try:
            return await (await session.call(name, list(arguments)))
        except Exception:
            return None


# -- a student of a class -----------------------------------------------------------------------------------

ODD_ANSWERS: list[Any] = [
    None,
    [],
    "x",
    {},
    {"numbers": ["x"] * 6},
    {"numbers": [1.0] * 5},
    {"numbers": [[1.0]] * 6},
    {"numbers": [1e999] * 6},
    {"lesson": "5-scattering"},
    {"lesson": 3},
    {"name": "n" * 41},
    {"name": "a\x1b[2J"},
    {"right": "yes"},
    {"token": "x"},
]
"""Changes of an answer that make it none; those that are no dictionaries stand for the answer."""


async def student(server: Server) -> str:
    """A student tries all but one answer, and other pages try that."""
    token = re.search(r"/student/([\w-]+)/", server.lines[-1])
    assert token
    own, path = f"http://{server.authority}", f"/student/{token[1]}/"
    jar = aiohttp.CookieJar(unsafe=True)
    good = {"lesson": "9-packing", "name": "", "numbers": [1.0] * 6, "right": True}
    async with aiohttp.ClientSession(cookie_jar=jar) as http:

        async def ask(method: str, where: str, body: Any = None, **headers: str) -> int:
            sent = {"Origin": own, "Content-Type": "application/json"}
            sent |= {name.replace("_", "-"): text for name, text in headers.items()}
            data = body if isinstance(body, bytes) else json.dumps(body).encode()
            url = f"{own if where.startswith('/') else server.address}{where}"
            async with http.request(method, url, data=data, headers=sent, allow_redirects=False) as answer:
                return int(answer.status)

        if await ask("POST", f"{path}answer", good) < 400:
            return "answered without a page"
        for wrong in ("x", token[1][:-1], token[1].upper(), server.token, "%00", "é"):
            for method, name in (("GET", ""), ("GET", "1-one-decal.html"), ("POST", "answer")):
                if await ask(method, f"/student/{wrong}/{name}", good) < 400:
                    return f"the token {wrong!r} opens {name or 'the list'}"
        async with http.get(f"{own}{path}", headers=NAVIGATE) as page:
            if page.status != 200 or "Path=/student/" not in page.headers["Set-Cookie"]:
                return f"the list answers {page.status}"
        for headers in (
            {"Origin": FOREIGN},
            {"Origin": "null"},
            {"Host": "foreign.example", "Origin": "http://foreign.example"},
            {"Sec_Fetch_Site": "cross-site"},
            {"Content_Type": "text/plain"},
            {"Content_Type": "application/x-www-form-urlencoded"},
        ):
            if await ask("POST", f"{path}answer", good, **headers) < 400:
                return f"answered with {headers}"
        for method in ("GET", "PUT", "DELETE", "OPTIONS", "PATCH"):
            if await ask(method, f"{path}answer", good) < 400:
                return f"{method} of an answer"
        for name in (
            "class",
            "answers",
            "../../class",
            "%2e%2e/%2e%2e/class",
            "ws",
            "index.html",
            "../9-packing.html",
        ):
            for method in ("GET", "POST"):
                if await ask(method, f"{path}{name}", good) < 400:
                    return f"{method} {name}"
        if await ask("POST", f"{path}answer", b" " * 2001) != 413:
            return "sent a long answer"
        for odd in ODD_ANSWERS:
            await asyncio.sleep(0.51)
            sent = {**good, **odd} if isinstance(odd, dict) and odd else odd
            if await ask("POST", f"{path}answer", sent) < 400:
                return f"sent {odd}"
        await asyncio.sleep(0.51)
        many = [await ask("POST", f"{path}answer", good) for _ in range(5)]
        if many[0] != 204 or any(status < 400 for status in many[1:]):
            return f"sent many answers: {many}"
        cookie = next(morsel.value for morsel in jar if morsel.key == "class")
        for name in ("class", f"implicit-decals-{server.port}"):
            known = {name: cookie}
            for where in (
                "",
                "index.html",
                "class",
                "class/answers",
                "class/1-one-decal.csv",
                f"?token={token[1]}",
            ):
                status, text, _ = await get(server, where, known, **NAVIGATE)
                if status < 400 and (opens(status, text) or "Class" in text or "answers" in text):
                    return f"opened /{where}"
            bearer = {"Authorization": f"Bearer {token[1]}"}
            if await talk(server, secret=token[1], cookies=known, Origin=own, **bearer):
                return "read the scene"
    return ""


# -- a slow or flooding client ------------------------------------------------------------------------------


IDLE_CONNECTIONS = 1200
"""More than the files that servers may have open at their start."""


async def flood(server: Server) -> str:
    """A program opens idle connections, or sends half requests; the user's page still opens."""
    allow_connections()
    cookies = await server.enter()
    half = f"GET / HTTP/1.1\r\nHost: {server.authority}\r\n".encode()
    open_ = []
    try:
        for number in range(IDLE_CONNECTIONS):
            client = socket.create_connection(("127.0.0.1", server.port), 10)
            client.sendall(half if number % 2 else b"")
            open_.append(client)
        async with asyncio.timeout(20):
            status, text, _ = await get(server, "index.html", cookies, **NAVIGATE)
        return "" if opens(status, text) else f"the page answers {status}"
    except TimeoutError:
        return "the page does not open"
    finally:
        for client in open_:
            client.close()


async def parts(server: Server) -> str:
    """A browser with the cookie announces messages of gigabytes, or many at once; the server stays small."""
    cookies, before = await server.enter(), _megabytes(server)
    for sizes in ([3_000_000_000], [240_000_000] * 20):
        async with _connected(server, cookies) as session:
            with suppress(ConnectionError, aiohttp.ClientError):
                for number, size in enumerate(sizes):
                    head = b"".join(part.to_bytes(4, "little") for part in (number + 7, 0, size))
                    await session.ws.send_bytes(head + b"x")
            try:
                async with asyncio.timeout(20):
                    while not session.ws.closed:
                        await asyncio.sleep(0.05)
            except TimeoutError:
                return f"announced {len(sizes)} messages of {sizes[0]} bytes"
    grown = _megabytes(server) - before
    return f"grew by {grown:.0f} MB" if grown > 400 else ""


def _megabytes(server: Server) -> float:
    total = 0.0
    for number in (server.process.pid, *server.children()):
        with suppress(OSError):
            total += int(Path(f"/proc/{number}/statm").read_text().split()[1]) * 4096 / 1e6
    return total


Attack = Callable[[Server], Awaitable[str]]

ATTACKS: dict[str, Attack] = {
    one.__name__: one
    for one in (
        foreign_socket, rebinding, image, link, frame, form, leak, other_port,
        stranger, hello, processes, account, path,
        watcher, student, flood, parts,
    )
}  # fmt: skip

SHARED = "--share", "--lab"
"""Ways in which browsers share one page."""


def applies(attack: str, way: str) -> bool:
    """Return True if an attack can be tried in a way of starting."""
    return {"watcher": way in SHARED, "student": way == "--class"}.get(attack, True)


LEFT_OUT: dict[str, Callable[[], str]] = {
    "account": lambda: "" if hasattr(os, "geteuid") and os.geteuid() == 0 else "needs the rights of root",
    "processes": lambda: "" if Path("/proc/self/cmdline").exists() else "needs /proc",
    "parts": lambda: "" if Path("/proc/self/statm").exists() else "needs /proc",
}
"""Why an attack cannot be tried here, or nothing."""


def table() -> str:
    """Return the table of attacks and ways of starting."""
    rows = [["attack", *WAYS], ["---"] * (1 + len(WAYS))]
    for name in ATTACKS:
        marks = ["refused" if applies(name, way) else "–" for way in WAYS]
        rows.append([name.replace("_", " "), *marks])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def attempt(way: str, names: list[str] | None = None) -> dict[str, str]:
    """Try attacks on a server that starts in one way, and return what each got."""
    with served(way) as server:
        got = {}
        for name in names or ATTACKS:
            if applies(name, way) and not LEFT_OUT.get(name, str)():
                got[name] = asyncio.run(_tried(ATTACKS[name], server))
        return got


async def _tried(attack: Attack, server: Server) -> str:
    """Return what an attack got; a user that cannot enter is a fault too."""
    try:
        return await attack(server)
    except Exception as error:
        return f"failed: {error!r}"


def main() -> int:
    """Try all attacks in all ways, or in those that are named."""
    print(table())
    opened = 0
    for way in sys.argv[1:] or WAYS:
        for name, got in attempt(way).items():
            opened += bool(got)
            print(f"{way:10} {name:16} {got or 'refused'}", flush=True)
    print(f"{opened} attacks open")
    return int(opened > 0)


if __name__ == "__main__":
    sys.exit(main())
