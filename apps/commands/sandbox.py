"""``implicit-decals sandbox``: modelling and decals in the browser."""

import asyncio
import atexit
import errno
import html
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import count
from pathlib import Path
from subprocess import PIPE
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console

from blobtree.files import exists
from decals.apps.commands.options import (
    Inputs,
    Start,
    Whole,
    check_count,
)
from decals.apps.jupyter import TOKEN
from decals.errors import InvalidInput, MissingPackage

HOST = "127.0.0.1"
"""By default, the page is served to this machine only."""

TITLE = "Implicit Decals sandbox"

MAX_PORT = 65535
MAX_SESSIONS = 64
WINDOW_SIZE = 1280, 800
"""Width and height of a window of its own, in pixels."""

FIRST_SIZE = (700, 700)
"""Width and height of the view in pixels until the page sends its own."""


def sandbox(
    model: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    /,
    *,
    start: Start = Start(),
    port: Whole = 8080,
    host: str = HOST,
    allow_host: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    share: Annotated[bool, Parameter(negative=())] = False,
    sessions: Whole = 8,
    browser: bool = True,
    desktop: Annotated[bool, Parameter(negative=())] = False,
    inputs: Inputs = Inputs(),
    lab: Annotated[bool, Parameter(negative=())] = False,
    lessons: Path | None = None,
    lesson: str | None = None,
    classroom: Annotated[bool, Parameter(name="--class", negative=())] = False,
    done: Annotated[bool, Parameter(negative=())] = False,
    session: Annotated[bool, Parameter(negative=(), show=False)] = False,
) -> int:
    """Open models or a scene in the sandbox, a page in the browser.

    The page is served to this machine only, unless --host is given. It opens with the URL that the terminal
    shows. Each browser has a session of its own, unless --share is given. Ctrl + C in the terminal ends all;
    unsaved changes are kept.

    Parameters
    ----------
    model
        Mesh files, BlobTrees in JSON, programs (vm, frep), samples, or one saved scene, as for render.
        Default: a start page.
    port
        Port of the page; 0 takes a free one.
    host
        Address to serve the page at, such as 0.0.0.0 for all networks. Default: this machine only.
    allow_host
        A further name of this machine that browsers use, for example behind a proxy.
    share
        All browsers show one session: the driver edits it, the others watch and can ask for control.
    sessions
        Most sessions at the same time. One without a browser is saved and ended after half an hour.
    browser
        Open the page in the default browser.
    desktop
        Show the page in a window of its own. Needs pywebview.
    lab
        Open the contact lab: lessons on decals and solids in contact.
    lessons
        A folder of other lessons for the lab.
    lesson
        The lesson with which the lab begins: its number, or the name of its file without the ending.
    classroom
        Serve the lessons to students as pages, by an address of their own, and show what they send at /class.
    done
        Show a button that saves and ends, and print the URL alone, as notebooks need it.
    session
        Serve one session with the token that the standard input begins with, print the URL without it, and
        end with the standard input.
    """
    check_count("--port", port, 0, MAX_PORT)
    check_count("--sessions", sessions, 1, MAX_SESSIONS)
    lab = lab or lessons is not None or lesson is not None
    if model and lab:
        raise InvalidInput(
            "the lab has its own scenes; leave out the model, or --lab, --lessons and --lesson"
        )
    if classroom and (desktop or share or done or session or not lab):
        raise InvalidInput("--class needs --lab or --lessons, without --share, --desktop and --done")
    if desktop or not (share or done or session):
        options = {**vars(start), **vars(inputs), "lab": lab, "lessons": lessons, "lesson": lesson}
        command = _commands(model, options, options.pop("save"))
        if desktop:
            return _show_window(command(1))
        guard = _guard(host, allow_host, os.environ.pop(TOKEN, ""))
        room = _classroom(guard, lessons) if classroom else None
        early = not model and lessons is None and lesson is None  # nothing is read that may be missing
        return _serve_sessions(command, sessions, guard, host, port, room, browser=browser, early=early)
    from decals.apps.memory import import_ahead, keep_memory_low, made_to_stay, share_heap

    share_heap()
    with made_to_stay():
        from decals.apps.commands.opening import check_options, opened, report_unsaved
        from decals.apps.models.loading import import_definitions
        from decals.window import EditWindow
        from decals.window.host_plotter import new_plotter

        check_options(start)
        serve, page = _toolkit(lessons, (lesson or "1") if lab else None)
    given = _read_token() if session else os.environ.pop(TOKEN, "")
    guard = _guard(host, allow_host, given, framed=done)
    import_definitions(inputs.define)
    opening = opened(model, start, inputs, FIRST_SIZE)
    plotter = new_plotter(True, FIRST_SIZE)
    window = EditWindow(opening.scene, path=opening.path, plotter=plotter, recover=opening.recover)
    opening.add_images(window)
    try:
        with window:
            window.show()
            server = serve(f"sandbox {id(window)}", client_type="vue3")
            fresh = not model and not lab and not window.session.modified  # nothing was recovered
            page(server, window, guard=guard, start=fresh, done=done, shared=share)
            ready = server.controller.on_server_ready
            if session:
                ready.add(lambda **_: print(guard.address(server.port), flush=True))
                ready.add(lambda **_: threading.Thread(target=_end_with_input, daemon=True).start())
            elif done:
                ready.add(lambda **_: print(guard.url(server.port), flush=True))
            if not session:
                ready.add(lambda **_: _announce(guard, server.port, open_browser=browser))
            keep_memory_low()
            import_ahead()
            with _port_in_use_reported(port):
                server.start(host=host, port=port, open_browser=False, show_connection_info=False, timeout=0)
    finally:
        report_unsaved(window, "sandbox")
    return 0


def _commands(
    model: list[str] | None, options: dict[str, Any], save: Path | None
) -> Callable[[int], list[str]]:
    """Return the function that gives the command of each session from its number."""
    first = save or Path(f"{Path(model[0]).stem}.json" if model else "scene.json")
    names: dict[int, Path] = {}

    def command(number: int) -> list[str]:
        opened, given, path = model or [], options, save
        if number > 1:  # others have their own files
            known = names.get(number)
            path = names[number] = known or _unused(first, names.values())
            if known is not None and _exists(known) and not options["lab"]:
                opened, given = (
                    [str(known)],
                    {**options, "decals": None, "image": None, "seed": None, "table": None},
                )
        given = {**given, "save": path, "port": 0, "no_browser": True, "session": True}
        return [sys.executable, "-m", "decals", "sandbox", *opened, *_as_arguments(given)]

    return command


def _serve_sessions(
    command: Callable[[int], list[str]],
    limit: int,
    guard: Any,
    host: str,
    port: int,
    room: Any = None,
    *,
    browser: bool,
    early: bool,
) -> int:
    """Serve a session to each browser, and pages to the students of a class; return the exit code."""
    from decals.apps.sandbox.sessions import Sessions

    served = Sessions(command, limit=limit, guard=guard, **({"join": room.join} if room else {}))

    def ready(found: int) -> None:
        _announce(guard, found, open_browser=browser)
        if room:
            address = f"students at {room.url(found)}, their answers at {guard.address(found)}class"
            Console(stderr=True, soft_wrap=True).print(address, highlight=False, markup=False)

    with suppress(KeyboardInterrupt), _port_in_use_reported(port):
        return asyncio.run(served.serve(host, port, ready, early=early))
    return 0


def _classroom(guard: Any, folder: Path | None) -> Any:
    """Return the class that takes the lessons of a folder."""
    from decals.apps.lab.lesson import LESSONS, load_lessons
    from decals.apps.lesson_pages.classroom import Classroom

    return Classroom(guard, load_lessons(LESSONS if folder is None else folder))


@contextmanager
def _port_in_use_reported(port: int) -> Iterator[None]:
    """Raise InvalidInput in place of the system's error that another program has the port."""
    try:
        yield
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        raise InvalidInput(
            f"port {port} is in use; choose another by --port, or --port 0 for a free one"
        ) from None


def _show_window(command: list[str]) -> int:
    """Show a session in a window of its own, and return its exit code."""
    try:
        webview: Any = import_module("webview")
    except ImportError:
        raise _missing_window("pywebview") from None
    token = secrets.token_urlsafe(24)
    with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError):  # it has ended already
            process.stdin.write(f"{token}\n")
            process.stdin.flush()
        url = next((line.strip() for line in process.stdout if line.startswith("http://")), "")
        if url:
            url = f"{url}?token={token}"
            webview.create_window(TITLE, url, width=WINDOW_SIZE[0], height=WINDOW_SIZE[1])
            try:
                webview.start(gui="qt" if sys.platform == "linux" else None)
            except webview.WebViewException:  # pywebview draws windows with other packages
                raise _missing_window("Qt") from None
    return process.returncode  # the end of its standard input has ended it


def _missing_window(package: str) -> MissingPackage:
    return MissingPackage(
        f"--desktop needs {package}; install it with: pip install 'pywebview[qt]', or leave out --desktop"
    )


def _unused(first: Path, taken: Collection[Path]) -> Path:
    """Return the first of NAME-2.json, NAME-3.json, ... that no session has or has written."""
    names = (first.with_name(f"{first.stem}-{number}.json") for number in count(2))
    return next(name for name in names if name not in taken and not _exists(name))


def _exists(scene: Path) -> bool:
    """Return True if a session has kept something under this name."""
    return exists(scene) or exists(scene.with_name(f"{scene.stem}.recovery.json"))


def _as_arguments(options: dict[str, Any]) -> list[str]:
    """Return options as the command line writes them."""
    arguments: list[str] = []
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        if value is True:
            arguments.append(option)
        elif value is not None and value is not False:
            for one in value if isinstance(value, list) else [value]:
                arguments += [option, str(one)]
    return arguments


def _read_token() -> str:
    """Return the first line of the standard input, and read no more of it."""
    line = b""
    while (byte := os.read(sys.stdin.fileno(), 1)) not in (b"", b"\n"):
        line += byte
    return line.decode("ascii", "replace").strip()


def _end_with_input() -> None:
    """End this process as Ctrl + C does, once the server of sessions closes its standard input."""
    while os.read(sys.stdin.fileno(), 4096):  # Python cannot end while a thread is in its buffered reader
        pass
    signal.raise_signal(signal.SIGINT)


def _toolkit(folder: Path | None, lesson: str | None) -> tuple[Any, Any]:
    """Return trame's server and our page with the lessons of a folder, at one of them; both need trame."""
    try:
        from trame.app import get_server

        from decals.apps.lab.lesson import LESSONS, load_lessons
        from decals.apps.lab.page import LabPage
    except ImportError as error:
        raise _missing(error) from None
    found = load_lessons(LESSONS if folder is None else folder)
    begin = None if lesson is None else _index_of(lesson, [each.name for each in found])
    return get_server, lambda server, window, **options: LabPage(
        server, window, found, begin=begin, **options
    )


def _index_of(lesson: str, names: list[str]) -> int:
    """Return the index of a lesson that is given by its number, from 1 on, or by its name."""
    known = {text: i for i, name in enumerate(names) for text in (str(i + 1), name)}
    if lesson not in known:
        raise InvalidInput(
            f"--lesson: expected 1 to {len(names)}, or a name such as {names[0]}, got {lesson!r}"
        )
    return known[lesson]


def _missing(error: ImportError) -> MissingPackage:
    return MissingPackage(
        f"the sandbox needs trame ({error}); install it with: pip install 'implicit-decals[browser]'"
    )


def _guard(host: str, allow_hosts: list[str] | None, token: str, *, framed: bool = False) -> Any:
    """Return the guard of the server; a token may come from the program that started it."""
    try:
        from decals.apps.sandbox.guard import HOST_NAME, TOKEN_TEXT, Guard
    except ImportError as error:
        raise _missing(error) from None
    for name in allow_hosts or ():
        if HOST_NAME.fullmatch(name) is None:
            raise InvalidInput(f"--allow-host: expected a name such as example.org, got {name!r}")
    if token and TOKEN_TEXT.fullmatch(token) is None:
        raise InvalidInput(
            f"{TOKEN}: expected at least 16 letters, digits, - and _; leave it out for a new token"
        )
    return Guard(host, allow_hosts=allow_hosts or (), token=token, framed=framed)


def _announce(guard: Any, port: int, *, open_browser: bool) -> None:
    """Print the URL of the page, and open it in the default browser."""
    shown = guard.url(port) if guard.own_token else guard.address(port)
    Console(stderr=True, soft_wrap=True).print(
        f"sandbox at {shown} (Ctrl + C ends it)", highlight=False, markup=False
    )
    if open_browser:
        webbrowser.open(_link_file(guard.url(port)).as_uri())


def _link_file(url: str) -> Path:
    """Return a file that leads a browser to a URL: other accounts see the arguments of its process."""
    folder = Path(tempfile.mkdtemp(prefix="implicit-decals-"))  # for this account only
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    file = folder / "open.html"
    file.write_text(
        "<!doctype html><meta charset='utf-8'><meta name='referrer' content='no-referrer'>"
        f"<meta http-equiv='refresh' content='0;url={html.escape(url)}'>"
        f"<p><a href='{html.escape(url)}'>Open the sandbox</a></p>",
        encoding="utf-8",
    )
    return file
