"""``implicit-decals sandbox`` without a browser: what it opens, and what it says."""

import errno
import html
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest

import blobtree
from blobtree import Point
from decals import DecalImage
from decals.apps.cli import run
from decals.apps.commands import sandbox as sandbox_module
from decals.apps.jupyter import TOKEN
from decals.apps.lab.lesson import LESSONS, Lesson, load_lessons
from decals.apps.lesson_pages.page import lesson_page
from decals.editing import AddImage, recovery_path
from decals.window import EditWindow

Capture = pytest.CaptureFixture[str]


class Server:
    """Stands for trame's server: it ends at once."""

    port = 8123

    def __init__(self) -> None:
        self.controller = self
        self.on_server_ready = self
        self.ready: list[Any] = []
        self.options: dict[str, Any] = {}

    def add(self, call: Any) -> None:
        self.ready.append(call)

    def start(self, **options: Any) -> None:
        self.options |= options
        for call in self.ready:
            call()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Server, EditWindow]]:
    """Return the list of servers and windows that `sandbox` opens."""
    pages: list[tuple[Server, EditWindow]] = []

    def page(server: Server, window: EditWindow, **options: Any) -> None:
        server.options = options
        pages.append((server, window))

    toolkit = (lambda *_, **__: Server()), page
    monkeypatch.setattr(sandbox_module, "_toolkit", lambda *_: toolkit)
    return pages


@pytest.fixture
def urls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list of addresses that a browser opens."""
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    return opened


def test_the_sandbox_opens_models_and_serves_this_machine_only(
    folder: Path, opened: list[tuple[Server, EditWindow]], capsys: Capture
) -> None:
    blobtree.save(Point((0, 0, 0), radius=1.0), folder / "ball.json")
    assert run(["sandbox", "ball.json", "--decals", "20", "--port", "0", "--no-browser", "--share"]) == 0
    server, window = opened[0]
    assert len(window.document.decals) == 20
    assert window.actions.files.path == Path("ball-decals.json")
    assert (server.options["host"], server.options["port"]) == ("127.0.0.1", 0)
    assert server.options["open_browser"] is False
    assert "http://127.0.0.1:8123/" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("host", "shown"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("localhost", "localhost"),
        ("::1", "[::1]"),
        ("0.0.0.0", ""),
        ("192.168.0.9", "192.168.0.9"),
    ],
)
def test_the_url_has_a_token_that_no_argument_of_a_process_shows(
    host: str,
    shown: str,
    folder: Path,
    opened: list[tuple[Server, EditWindow]],
    capsys: Capture,
    urls: list[str],
) -> None:
    assert run(["sandbox", "--host", host, "--port", "0", "--share"]) == 0
    server = opened[0][0]
    assert (server.options["host"], server.options["open_browser"]) == (host, False)
    (file,) = urls
    assert file.startswith("file://")
    path = Path(url2pathname(urlsplit(file).path))
    (address,) = re.findall(r"url=(http[^']*)", path.read_text(encoding="utf-8"))
    assert address in capsys.readouterr().err
    host_and_port = re.escape(f"http://{shown or socket.gethostname()}:8123/")
    ((place, token),) = re.findall(rf"^{host_and_port}([\w-]+)/\?token=(\S+)$", address)
    assert min(len(place), len(token)) > 20
    assert not token.isdigit()
    if os.name == "posix":
        assert path.parent.stat().st_mode & 0o77 == 0


def test_a_program_that_starts_the_server_may_give_the_token(
    folder: Path,
    opened: list[tuple[Server, EditWindow]],
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(TOKEN, "0123456789abcdef")
    assert run(["sandbox", "--share", "--no-browser"]) == 0
    assert opened[0][0].options["guard"].token == "0123456789abcdef"
    assert TOKEN not in os.environ
    assert "0123456789abcdef" not in capsys.readouterr().err  # a log may be read by others
    monkeypatch.setenv(TOKEN, "short")
    assert run(["sandbox", "--share", "--no-browser"]) == 2
    assert "expected at least 16 letters, digits, - and _" in capsys.readouterr().err


def test_each_session_has_its_own_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sessions_module = pytest.importorskip("decals.apps.sandbox.sessions")
    commands: list[list[str]] = []

    class Sessions:
        """Stands for the server: it asks for the commands of sessions."""

        def __init__(self, command: Any, *, limit: int, guard: Any) -> None:
            assert limit == 3
            assert guard.url(8080).startswith(f"http://127.0.0.1:8080{guard.place}/?token=")
            self.command = command

        async def serve(self, host: str, port: int, _ready: Any, *, early: bool) -> int:
            assert (host, port, early) == ("127.0.0.1", 8080, False)
            (folder / "knot-3.recovery.json").touch()
            for number in (1, 2, 2, 3):
                commands.append(self.command(number)[4:])
                if number == 2:
                    (folder / "knot-2.json").touch()
            return 0

    monkeypatch.setattr(sessions_module, "Sessions", Sessions)
    assert run(["sandbox", "knot", "--decals", "20", "--image", "eye", "--trust", "--sessions", "3"]) == 0
    ending = ["--port", "0", "--no-browser", "--session"]
    scattered = ["knot", "--decals", "20", "--image", "eye", "--trust"]
    assert commands[0] == [*scattered, *ending]
    assert commands[1] == [*scattered, "--save", "knot-2.json", *ending]
    assert commands[2] == ["knot-2.json", "--trust", "--save", "knot-2.json", *ending]
    assert commands[3] == [*scattered, "--save", "knot-4.json", *ending]


def test_a_session_of_the_lab_starts_again_in_the_lab(folder: Path) -> None:
    command = sandbox_module._commands([], {"lab": True, "lessons": None, "lesson": None}, None)
    first = command(2)
    assert first[4:] == ["--lab", "--save", "scene-2.json", "--port", "0", "--no-browser", "--session"]
    (folder / "scene-2.recovery.json").touch()
    assert command(2) == first


def test_the_line_of_a_page_opens_its_lesson(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    trame = pytest.importorskip("trame.app")
    lab_page = pytest.importorskip("decals.apps.lab.page")
    begun: list[object] = []

    def page(server: Server, window: EditWindow, lessons: list[Lesson], *, begin: int, **_: Any) -> None:
        begun.append(lessons[begin].name)

    monkeypatch.setattr(lab_page, "LabPage", page)
    monkeypatch.setattr(trame, "get_server", lambda *_, **__: Server())
    serving = ["--share", "--no-browser", "--port", "0"]
    shutil.copytree(LESSONS, folder / "own lessons")
    for lesson in (load_lessons(LESSONS)[1], load_lessons(folder / "own lessons")[1]):
        text = lesson_page(lesson).text
        (line,) = re.findall(r"<pre[^>]*>(implicit-decals sandbox .*?)</pre>", text)
        assert run([*shlex.split(html.unescape(line))[1:], *serving]) == 0
    assert run(["sandbox", "--lesson", "3", *serving]) == 0
    assert run(["sandbox", "--lab", *serving]) == 0
    assert begun == ["2-two-decals", "2-two-decals", "3-contact-modes", "1-one-decal"]
    assert run(["sandbox", "--lesson", "x", *serving]) == 2
    assert "--lesson: expected 1 to 9, or a name such as 1-one-decal, got 'x'" in capsys.readouterr().err
    assert run(["sandbox", "knot", "--lesson", "1", *serving]) == 2
    assert "leave out the model" in capsys.readouterr().err


def test_a_window_of_its_own_shows_a_session(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, "webview", None)
    assert run(["sandbox", "--desktop"]) == 2
    assert "pip install 'pywebview[qt]'" in capsys.readouterr().err
    shown: list[Any] = []
    window = SimpleNamespace(
        create_window=lambda *a, **_: shown.append(a),
        start=lambda gui: shown.append("start"),
        WebViewException=LookupError,
    )
    monkeypatch.setitem(sys.modules, "webview", window)
    program = (
        "import sys; token = input(); print(f'log\\nhttp://127.0.0.1:{len(token)}/', flush=True); "
        "sys.stdin.read(); sys.exit(3)"
    )
    monkeypatch.setattr(sandbox_module, "_commands", lambda *_: lambda _: [sys.executable, "-c", program])
    assert run(["sandbox", "--desktop"]) == 3
    title, url = shown[0]
    address, token = url.split("?token=")
    assert (title, address, shown[1]) == (sandbox_module.TITLE, f"http://127.0.0.1:{len(token)}/", "start")
    assert len(token) > 30
    window.start = lambda gui: [][0]  # pywebview alone draws no window on Linux
    assert run(["sandbox", "--desktop"]) == 2
    assert "needs Qt; install it with: pip install 'pywebview[qt]'" in capsys.readouterr().err


def test_a_session_may_end_before_its_input() -> None:
    end = "from decals.apps.commands.sandbox import _end_with_input as end; "
    wait = "import threading, time; threading.Thread(target=end, daemon=True).start(); time.sleep(0.2)"
    with subprocess.Popen([sys.executable, "-c", end + wait], stdin=subprocess.PIPE) as process:
        assert process.wait(60) == 0


def test_unsaved_changes_are_kept(
    folder: Path, monkeypatch: pytest.MonkeyPatch, opened: list[tuple[Server, EditWindow]], capsys: Capture
) -> None:
    def edit(_server: Server, **_options: Any) -> None:
        opened[-1][1].session.do(AddImage(DecalImage.load("eye")))

    monkeypatch.setattr(Server, "start", edit)
    assert run(["sandbox", "--share"]) == 0
    assert recovery_path(folder / "scene.json").exists()
    assert "implicit-decals sandbox scene.json" in capsys.readouterr().err


def test_without_trame_a_line_says_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, "trame.app", None)
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    monkeypatch.delitem(sys.modules, "decals.apps.sandbox.guard", raising=False)
    for options in ([], ["--share"]):
        assert run(["sandbox", *options]) == 2
    assert "pip install 'implicit-decals[browser]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["--port", "70000"], ["--sessions", "0"], ["--decals", "-1"], ["nothing.json"]]
)
def test_wrong_arguments_are_refused(
    arguments: list[str], folder: Path, opened: list[tuple[Server, EditWindow]], capsys: Capture
) -> None:
    assert run(["sandbox", "--share", *arguments]) == 2
    assert "error:" in capsys.readouterr().err
    assert opened == []


def test_a_port_in_use_is_named(
    folder: Path,
    opened: list[tuple[Server, EditWindow]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    def start(*_: Any, **__: Any) -> None:
        raise OSError(errno.EADDRINUSE, "error while attempting to bind: address already in use")

    monkeypatch.setattr(Server, "start", start)
    assert run(["sandbox", "--share", "--port", "8123"]) == 2
    assert "port 8123 is in use; choose another by --port" in capsys.readouterr().err
