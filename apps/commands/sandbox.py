"""``implicit-decals sandbox``: modelling and decals in the browser."""

import ipaddress
import secrets
import socket
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.console import Console

from decals.apps.commands.opening import check_options, opened, report_unsaved
from decals.apps.commands.options import Definitions, OptionalWhole, Trust, Whole, check_count
from decals.apps.models.loading import import_definitions
from decals.errors import InvalidInput, MissingPackage
from decals.window import EditWindow
from decals.window.host_plotter import new_plotter

HOST = "127.0.0.1"
"""By default, the page is served to this machine only."""

ANY_ADDRESS = ("0.0.0.0", "::")
"""Hosts that stand for all addresses of this machine."""

TITLE = "Implicit Decals sandbox"

MAX_PORT = 65535
FIRST_SIZE = (700, 700)
"""Width and height of the view in pixels until the page tells its own."""


def sandbox(
    model: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    /,
    *,
    decals: OptionalWhole = None,
    image: Annotated[
        list[str] | None, Parameter(name=("--image", "--images"), negative=(), show_default=False)
    ] = None,
    up: Annotated[Literal["x", "y", "z"] | None, Parameter(show_default=False)] = None,
    seed: OptionalWhole = None,
    save: Path | None = None,
    define: Definitions = None,
    port: Whole = 8080,
    host: str = HOST,
    share: Annotated[bool, Parameter(negative=())] = False,
    browser: bool = True,
    desktop: Annotated[bool, Parameter(negative=())] = False,
    trust: Trust = False,
    lab: Annotated[bool, Parameter(negative=())] = False,
    lessons: Path | None = None,
    done: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Open models or a scene in the sandbox, a page in the browser.

    The page is served to this machine only, unless --host is given. Ctrl + C in the terminal ends it;
    unsaved changes are kept.

    Parameters
    ----------
    model
        Mesh files, BlobTrees in JSON, samples, or one saved scene, as for render. Default: a start page.
    decals
        Number of decals scattered at the start. Default: 500.
    image
        Image of the decals, as for render. Can be repeated. A saved scene keeps its images, and these are
        added. Default: scale.
    up
        The axis that points upward. Default: y, or the axis of the sample.
    seed
        Seed of the random numbers: equal seeds give equal decals. Default: 0.
    save
        The JSON file that Ctrl + S writes. Default: the opened scene, or a new file such as MODEL-decals.json
        or scene.json.
    define
        A Python file or module that defines the custom nodes of BlobTrees in JSON. Its code is run. Can be
        repeated.
    port
        Port of the page; 0 takes a free one.
    host
        Address to serve the page at, such as 0.0.0.0 for all networks. Its URL then has a token, without
        which the page does not work. Default: this machine only.
    share
        All browsers show one session: one drives, the others watch, and ask for the wheel.
    browser
        Open the page in the default browser.
    desktop
        Show the page in a window of its own. Needs pywebview.
    trust
        Let a scene read files outside its folder, and any number of images.
    lab
        Open the contact lab: six lessons on decals and solids in contact.
    lessons
        A folder of other lessons for the lab.
    done
        Show a button that saves and ends, and print the URL alone, as notebooks need it.
    """
    check_options(decals, seed, save)
    check_count("--port", port, 0, MAX_PORT)
    if model and (lab or lessons is not None):
        raise InvalidInput("the lab has its own scenes; leave out the model, or --lab and --lessons")
    serve, page = _toolkit(lessons)
    if desktop:
        _require_webview()
    import_definitions(define)
    opening = opened(
        model, decals=decals, image=image, up=up, pixels=FIRST_SIZE, seed=seed, save=save, trust=trust
    )
    plotter = new_plotter(True, FIRST_SIZE)
    window = EditWindow(opening.scene, path=opening.path, plotter=plotter, recover=opening.recover)
    opening.add_images(window)
    try:
        with window:
            window.show()
            server = serve(f"sandbox {id(window)}", client_type="vue3")
            in_lesson = lab or lessons is not None
            start = not model and not in_lesson
            page(server, window, in_lesson=in_lesson, start=start, done=done, shared=share)
            if done:
                server.controller.on_server_ready.add(
                    lambda **_: print(_url(host, server.port, ""), flush=True)
                )
            query = _protect(server, host)
            own_browser = browser and not desktop and bool(query)  # trame's knows no token
            server.controller.on_server_ready.add(
                lambda **_: _announce(host, server.port, query, open_browser=own_browser)
            )
            window_options = {"exec_mode": "desktop", "title": TITLE} if desktop else {}
            server.start(
                host=host,
                port=port,
                open_browser=browser and not query,
                show_connection_info=False,
                timeout=0,
                **window_options,
            )
    finally:
        report_unsaved(window, "sandbox")


def _toolkit(folder: Path | None) -> tuple[Any, Any]:
    """Return trame's server and our page with the lessons of a folder; both need trame."""
    try:
        from trame.app import get_server

        from decals.apps.lab.lesson import LESSONS, load_lessons
        from decals.apps.lab.page import LabPage
    except ImportError as error:
        raise MissingPackage(
            f"the sandbox needs trame ({error}); install it with: pip install 'implicit-decals[browser]'"
        ) from None
    found = load_lessons(LESSONS if folder is None else folder)
    return get_server, lambda server, window, **options: LabPage(server, window, found, **options)


def _require_webview() -> None:
    """Raise `MissingPackage` without pywebview, whose window shows the page."""
    if find_spec("webview") is None:
        raise MissingPackage(
            "--desktop needs pywebview; install it with: pip install 'pywebview[qt]', or leave out --desktop"
        )


def _protect(server: Any, host: str) -> str:
    """Ask every browser for a new token, unless only this machine is served; return the end of the URL."""
    if _is_loopback(host):
        return ""
    token = f"t{secrets.token_urlsafe(24)}"  # the page reads digits alone as a number
    server.cli.set_defaults(authKey=token)
    return f"?secret={token}"


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name
        return host == "localhost"


def _url(host: str, port: int, query: str) -> str:
    shown = socket.gethostname() if host in ANY_ADDRESS else f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}/{query}"


def _announce(host: str, port: int, query: str, *, open_browser: bool) -> None:
    """Print the URL of the page, and open it if trame does not."""
    url = _url(host, port, query)
    Console(stderr=True, soft_wrap=True).print(
        f"sandbox at {url} (Ctrl + C ends it)", highlight=False, markup=False
    )
    if open_browser:
        webbrowser.open(url)
