"""The guard in front of the sandbox's servers: which requests they answer, and with which headers.

A browser opens the page by a URL with a token, and gets a cookie for it. A process of this machine sends the
token in the header `Authorization`. A page in the frame of a notebook sends it in its first message.

All ports of a machine share their cookies. The page therefore lies below a path that no other server knows,
and browsers send its cookie there only.
"""

import base64
import hashlib
import hmac
import ipaddress
import logging
import re
import secrets
import socket
import sys
from collections.abc import Awaitable, Callable, Collection
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlencode, urlsplit

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

if sys.platform != "win32":
    import resource

NAMES = "sketch.mjs", "scores.mjs", "page.js"
PARTS = (Path(__file__).with_name(name).read_text(encoding="utf-8") for name in NAMES)
LAB = "draw, keep, compared, best, copy, copyAddress"
SCRIPT = f"{''.join(PARTS).replace('export ', '')}trame.utils.lab = {{ {LAB} }};\n"
"""The script of the page."""

LOOPBACK = "127.0.0.1"
"""By default, the page is served to this machine only."""

ANY_ADDRESS = ("0.0.0.0", "::")
"""Hosts that stand for all addresses of this machine."""

COOKIE_SECONDS = 30 * 24 * 3600
"""Time for which a browser that was closed finds its session again."""

MAX_SOCKETS = 64
"""Most connections for messages of one server, of browsers with a cookie."""

MAX_STRANGERS = 16
"""Most connections for messages that still have to bring the token."""

MAX_FILES = 10_240
"""Open files of the server, connections among them, where the system allows so many."""

MAX_NAME_BYTES = 255
"""Longest name in an address; file systems refuse longer ones."""

MAX_FRAMES = 16
"""Most origins of notebooks that show the page in a frame."""

FINDER = "/paraview/"
"""Address at which trame's page asks for the one of its messages."""

NEAR = "none", "same-origin"
"""Values of `Sec-Fetch-Site`: a user typed the address, or a page of this server asks."""

FRAMES = "iframe", "frame", "embed", "object"
"""Values of `Sec-Fetch-Dest` of a page inside another one."""

PAGE = (
    "<!doctype html><html lang='en'><meta charset='utf-8'><title>Sandbox</title>{refresh}"
    "<link rel='icon' href='data:,'><meta name='color-scheme' content='light dark'>"
    "<body style='font: 16px sans-serif; margin: 4em'><p role='status'>{text}</p></body></html>"
)

CLOSED = (
    "The sandbox opens with the address that the terminal shows, which ends with a token. "
    "Open that address again; in a notebook, run the cell again."
)
"""What a browser without token and cookie shows."""

ORIGIN = re.compile(r"[a-z][a-z0-9+.-]{0,30}://[A-Za-z0-9.-]{1,253}(:\d{1,5})?")
"""Origins that a notebook may have."""

HOST = re.compile(r"[A-Za-z0-9.:\[\]_-]{1,300}")
HOST_NAME = re.compile(r"[A-Za-z0-9._-]{1,253}|[0-9A-Fa-f:]{2,45}")
TOKEN_TEXT = re.compile(r"[A-Za-z0-9_-]{16,256}")

HEADERS = {
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


SERVER_LOG = "aiohttp.server"
"""Log in which the server reports what it cannot answer."""


def _is_no_wrong_request(record: logging.LogRecord) -> bool:
    """Return False for the traceback of a request that is none, or too long: its sender gets status 400."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, HttpProcessingError)


@dataclass(frozen=True)
class Asking:
    """What the guard knows of a request that it lets through."""

    browser: str
    """Name of the browser; empty if it has no cookie."""

    visits: bool
    """True if a user opens a page, False for a part of a page."""

    trusted: bool
    """False if the first message has to bring the token."""


ASKING: ContextVar[Asking] = ContextVar("request that the guard lets through")


class Guard:
    """Answers requests of browsers that have the token, and of no other page, machine or account.

    Parameters
    ----------
    host
        Address at which the server listens.
    allow_hosts
        Further names of this machine that browsers may use.
    token
        The token. Default: a new one.
    framed
        A notebook may show the page in a frame, whose URL has the token and the origin of the notebook.

    Attributes
    ----------
    token
        The token.
    own_token
        True if the guard has made the token itself.
    place
        Path of the page, which others cannot guess.
    doors
        Functions that answer requests below other paths, by the path. Each checks its requests itself.
    """

    def __init__(
        self,
        host: str = LOOPBACK,
        *,
        allow_hosts: Collection[str] = (),
        token: str = "",
        framed: bool = False,
    ) -> None:
        self.token, self.own_token = token or new_token(), not token
        self.place = f"/{secrets.token_hex(16)}"  # trame's page asks for its messages in small letters
        self.doors: dict[str, Callable[[web.Request], Awaitable[web.StreamResponse]]] = {}
        self._host, self._framed = host, framed
        self._hosts = {name.lower() for name in (host, *allow_hosts)}
        if host in ANY_ADDRESS:
            self._hosts.add(socket.gethostname().lower())
        self._secret = secrets.token_bytes(32)
        self._frames: set[str] = set()
        self._sockets = {True: 0, False: 0}

    def url(self, port: int) -> str:
        """Return the URL that opens the page."""
        return f"{self.address(port)}?{urlencode({'token': self.token})}"

    def address(self, port: int) -> str:
        """Return the URL of the page without the token."""
        return f"{self.origin(port)}{self.place}/"

    def origin(self, port: int) -> str:
        """Return the URL of the server."""
        host = self._host
        shown = socket.gethostname() if host in ANY_ADDRESS else f"[{host}]" if ":" in host else host
        return f"http://{shown}:{port}"

    def protected(self, app: web.Application) -> web.Application:
        """Return what serves an application at the place of the page, and checks all requests before."""
        logging.getLogger(SERVER_LOG).addFilter(_is_no_wrong_request)
        allow_connections()
        outer = web.Application(middlewares=[self._check])
        outer.on_response_prepare.append(self._add_headers)
        outer.add_subapp(self.place, app)
        return outer

    def is_token(self, text: object) -> bool:
        """Return True for the token, in a time that says nothing about it."""
        return isinstance(text, str) and _equal(text, self.token)

    # -- requests ---------------------------------------------------------------------------------------

    @web.middleware
    async def _check(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer a request, or refuse it."""
        for path, answer in self.doors.items():
            if request.path.startswith(path):
                return await answer(request)
        finds = request.method == "POST" and request.path == f"{self.place}{FINDER}"
        if request.method not in ("GET", "HEAD") and not finds:
            raise web.HTTPMethodNotAllowed(request.method, ["GET", "HEAD"])
        if any(len(name.encode(errors="replace")) > MAX_NAME_BYTES for name in request.path.split("/")):
            raise web.HTTPNotFound(text="expected a shorter address")
        bearer, token = self._is_bearer(request), self.is_token(request.query.get("token"))
        visit = _is_visit(request, token)
        token = visit and token
        near = request.headers.get("Sec-Fetch-Site", "none") in NEAR
        in_frame = request.headers.get("Sec-Fetch-Dest") in FRAMES
        if token and self._framed:
            self._add_frames(request.query.get("frame", ""))
        if not bearer:  # a page cannot send that header; the process that does has checked its browser
            self.check_names(request)
        if not near and not (visit and (token or bearer)):
            raise web.HTTPForbidden(text="expected a request of the page itself")
        if not request.path.startswith(f"{self.place}/"):
            if visit and (token or bearer) and request.path in ("/", "/index.html"):
                query = request.rel_url.raw_query_string  # proxies change addresses that begin with a slash
                return web.Response(status=303, headers={"Location": f".{self.place}/?{query}"})
            return self._refuse(visit=visit)
        if in_frame and not (token and self._frames) and not (bearer and near):
            raise web.HTTPForbidden(text="expected a window for the page, not a frame")
        browser = self._browser(request)
        if token:
            return await self._exchange(request, handler, browser, in_frame=in_frame)
        of_frame = bool(self._frames) and not visit  # its files are public, its messages bring the token
        if not (browser or bearer or of_frame):
            return self._refuse(visit=visit)
        if not near:  # the browser sends its cookie once a page of this server asks
            return page_of("The sandbox opens.", refresh="?")
        if finds:
            return web.json_response({"sessionURL": f"ws://USE_HOST{self._path(request)}ws"})
        name = browser or (_new_name() if visit else "")
        ASKING.set(Asking(name, visit, bool(browser or bearer)))
        response = await self._counted(request, handler)
        if visit and not response.prepared:
            self._remember(request, response, name)
        return response

    def _refuse(self, *, visit: bool) -> web.Response:
        if visit:
            return page_of(CLOSED, 403)
        raise web.HTTPForbidden(text="expected the address with the token that the terminal shows")

    def _path(self, request: web.Request) -> str:
        """Return the path of the page as browsers see it."""
        return f"{_prefix(request)}{self.place}/"

    async def _counted(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer a request, unless too many connections for messages are open."""
        if not _is_socket(request):
            return await handler(request)
        trusted = ASKING.get().trusted
        if self._sockets[trusted] >= (MAX_SOCKETS if trusted else MAX_STRANGERS):
            raise web.HTTPServiceUnavailable(text="expected fewer open pages; close some of them")
        self._sockets[trusted] += 1
        try:
            return await handler(request)
        finally:
            self._sockets[trusted] -= 1

    def check_names(self, request: web.Request) -> None:
        """Refuse requests by a foreign name of this machine, and those of pages of other servers."""
        hosts, origins = (request.headers.getall(name, []) for name in ("Host", "Origin"))
        if len(hosts) != 1 or not self._allows(request):
            raise web.HTTPForbidden(text="expected the address of this machine; --allow-host allows others")
        own = {f"http://{request.host}", f"https://{request.host}", *self._frames}
        if not own.issuperset(origins) or (not origins and _is_socket(request)):
            raise web.HTTPForbidden(text="expected a request of the page itself")

    def _allows(self, request: web.Request) -> bool:
        """Return True if a request has a name of this machine: others can lead here from a foreign page."""
        try:
            name = urlsplit(f"//{request.host}").hostname or ""
        except ValueError:
            return False
        if HOST.fullmatch(request.host) is None:
            return False
        bound = request.get_extra_info("sockname") or ("",)
        shown = any(urlsplit(frame).netloc == request.host for frame in self._frames)
        return name in self._hosts or name == bound[0] or is_loopback(name) or shown

    def _is_bearer(self, request: web.Request) -> bool:
        kind, _, token = request.headers.get("Authorization", "").partition(" ")
        return kind == "Bearer" and self.is_token(token)

    async def _exchange(
        self, request: web.Request, handler: Handler, browser: str, *, in_frame: bool
    ) -> web.StreamResponse:
        """Give a cookie for the token, and open the page without it."""
        query = {"token": self.token}
        if in_frame:  # a cookie does not come back from there; the page sends the secret as its first message
            if "secret" in request.query:
                ASKING.set(Asking("", visits=True, trusted=False))
                return await handler(request)
            query |= {"frame": request.query.get("frame", ""), "secret": self.token}
            return web.Response(status=303, headers={"Location": f"index.html?{urlencode(query)}"})
        if request.headers.get("Sec-Fetch-Site") not in NEAR and "again" not in request.query:
            # Behind a link of another page, the browser sends its cookie once a page of this server asks.
            return page_of("The sandbox opens.", refresh=f"?{urlencode({**query, 'again': ''})}")
        response = web.Response(status=303, headers={"Location": "./"})
        self._remember(request, response, browser or _new_name())
        return response

    # -- cookies ----------------------------------------------------------------------------------------

    def _browser(self, request: web.Request) -> str:
        """Return the name of a browser from its cookie, or nothing."""
        name, _, signature = request.cookies.get(_cookie_of(request), "").partition(".")
        return name if name and _equal(signature, self._signature(name)) else ""

    def _signature(self, name: str) -> str:
        return hmac.new(self._secret, name.encode(), hashlib.sha256).hexdigest()

    def _remember(self, request: web.Request, response: web.StreamResponse, browser: str) -> None:
        """Give a browser its cookie, for the place of the page."""
        proxied = self._is_bearer(request)
        response.set_cookie(
            _cookie_of(request),
            f"{browser}.{self._signature(browser)}",
            max_age=COOKIE_SECONDS,
            path=self._path(request) if proxied else f"{self.place}/",
            httponly=True,
            samesite="Strict",
            secure=proxied and request.headers.get("X-Forwarded-Proto", "").startswith("https"),
        )

    # -- frames -----------------------------------------------------------------------------------------

    def _add_frames(self, origins: str) -> None:
        """Let the pages of some origins show the page in a frame."""
        named = {origin for origin in origins.split() if ORIGIN.fullmatch(origin)}
        if len(self._frames | named) <= MAX_FRAMES:
            self._frames |= named

    # -- headers ----------------------------------------------------------------------------------------

    async def _add_headers(self, request: web.Request, response: web.StreamResponse) -> None:
        """Limit what a page may load, and what may show it."""
        frames = "'self'" if self._is_bearer(request) else " ".join(sorted(self._frames)) or "'none'"
        host = request.host if HOST.fullmatch(request.host) else ""
        sockets = f"ws://{host} wss://{host}" if host else ""
        own = "; ".join(
            (
                "default-src 'none'",
                f"script-src 'self' 'unsafe-eval' {script_hashes()}",  # the browser compiles the templates
                "style-src 'self' 'unsafe-inline'",  # Vuetify writes its theme into the page
                "img-src 'self' data: blob:",
                "font-src 'self' data:",
                f"connect-src 'self' {sockets}",
                "base-uri 'self'",
                "form-action 'none'",
                f"frame-ancestors {frames}",
            )
        )
        response.headers.setdefault("Content-Security-Policy", own)
        response.headers.update(HEADERS)


def allow_connections() -> None:
    """Let this process open more files than the usual 256 or 1,024, which idle connections would take up."""
    if sys.platform != "win32":
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        most = MAX_FILES if hard == resource.RLIM_INFINITY else min(MAX_FILES, hard)
        if soft != resource.RLIM_INFINITY and soft < most:
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))


def new_token() -> str:
    """Return a new token; it begins with a letter, since pages read digits alone as a number."""
    return f"t{secrets.token_urlsafe(24)}"


def page_of(text: str, status: int = 200, *, refresh: str | None = None) -> web.Response:
    """Return a page with a text. If an address is given, the page asks for it at once."""
    again = f"<meta http-equiv='refresh' content='0;url={escape(refresh)}'>" if refresh else ""
    return web.Response(
        text=PAGE.format(text=escape(text), refresh=again), status=status, content_type="text/html"
    )


def is_loopback(host: str) -> bool:
    """Return True for a name or an address that leads to this machine from itself alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name
        return host == "localhost"


@cache
def script_hashes() -> str:
    """Return the hashes of the scripts inside the page: trame's, and our own."""
    found = find_spec("trame_client")
    page = Path(found.origin or "").parent / "module" / "vue3-www" / "index.html" if found else Path()
    html = page.read_text(encoding="utf-8") if page.is_file() else ""
    scripts = [*re.findall(r"<script>(.*?)</script>", html, re.DOTALL), SCRIPT]
    digests = (hashlib.sha256(script.encode()).digest() for script in scripts)
    return " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)


def _new_name() -> str:
    return secrets.token_urlsafe(18)


def _equal(text: str, other: str) -> bool:
    return hmac.compare_digest(text.encode(errors="replace"), other.encode())


def _is_socket(request: web.Request) -> bool:
    return bool(request.headers.get("Upgrade", "").lower() == "websocket")


def _is_visit(request: web.Request, token: bool) -> bool:
    """Return True if a user opens a page; older browsers say so by what they accept alone."""
    mode = request.headers.get("Sec-Fetch-Mode")
    asks = mode == "navigate" if mode else token or "text/html" in request.headers.get("Accept", "")
    return bool(asks) and not _is_socket(request)


def _prefix(request: web.Request) -> str:
    """Return the part of the address that a proxy takes away."""
    found = re.fullmatch(r"((/[\w.~%@+-]+)*)/?", request.headers.get("X-Forwarded-Prefix", ""))
    return found[1] if found else ""


def _cookie_of(request: web.Request) -> str:
    """Return the name of the cookie of a server: all ports of a machine share its cookies."""
    port = re.search(r":(\d+)$", request.host)
    return f"implicit-decals-{port[1] if port else 80}"
