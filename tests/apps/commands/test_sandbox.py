"""``implicit-decals sandbox`` without a browser: what it opens, and what it says."""

import argparse
import asyncio
import errno
import subprocess
import sys
import unittest.mock
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import blobtree
from blobtree import Point
from decals.apps.cli import run
from decals.apps.commands import sandbox as sandbox_module
from decals.editing import recovery_path
from decals.editing.commands import AddImage
from decals.scenes.scene import DecalImage
from decals.window import EditWindow

Capture = pytest.CaptureFixture[str]


class Server:
    """Stands for trame's server: it ends at once."""

    port = 8123

    def __init__(self) -> None:
        self.cli = argparse.ArgumentParser()
        self.controller = self
        self.on_server_ready = self
        self.ready: list[Any] = []
        self.options: dict[str, Any] = {}

    def add(self, call: Any) -> None:
        self.ready.append(call)

    def start(self, **options: Any) -> None:
        self.options = options
        for call in self.ready:
            call()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Server, EditWindow]]:
    """Return the list of servers and windows that `sandbox` opens."""
    pages: list[tuple[Server, EditWindow]] = []
    toolkit = (lambda *_, **__: Server()), lambda server, window, **_: pages.append((server, window))
    monkeypatch.setattr(sandbox_module, "_toolkit", lambda _: toolkit)
    return pages


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
        ("127.0.0.1", None),
        ("localhost", None),
        ("::1", None),
        ("0.0.0.0", ""),
        ("192.168.0.9", "192.168.0.9"),
    ],
)
def test_other_machines_need_a_token(
    host: str,
    shown: str | None,
    folder: Path,
    opened: list[tuple[Server, EditWindow]],
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    urls: list[str] = []
    monkeypatch.setattr(webbrowser, "open", urls.append)
    assert run(["sandbox", "--host", host, "--port", "0", "--share"]) == 0
    server = opened[0][0]
    assert server.options["host"] == host
    token = server.cli.get_default("authKey")
    assert server.options["open_browser"] is False
    (url,) = urls
    assert url in capsys.readouterr().err
    if shown is None:
        assert token is None
        assert url == f"http://{f'[{host}]' if ':' in host else host}:8123/"
        return
    assert len(token) > 30
    assert not token.isdigit()
    assert url.endswith(f":8123/?secret={token}")
    assert shown in url


def test_each_session_has_its_own_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sessions_module = pytest.importorskip("decals.apps.sandbox.sessions")
    commands: list[list[str]] = []

    class Sessions:
        """Stands for the server: it asks for the commands of sessions."""

        def __init__(self, command: Any, *, limit: int, token: str, allows_host: Any) -> None:
            assert (limit, token) == (3, "")
            assert [allows_host(host) for host in ("localhost", "::1", "a.example")] == [True, True, False]
            self.command = command

        async def serve(self, host: str, port: int, _ready: Any) -> int:
            assert (host, port) == ("127.0.0.1", 8080)
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
    command = sandbox_module._commands([], {"lab": True, "lessons": None}, None)
    first = command(2)
    assert first[4:] == ["--lab", "--save", "scene-2.json", "--port", "0", "--no-browser", "--session"]
    (folder / "scene-2.recovery.json").touch()
    assert command(2) == first


def test_a_server_refuses_clients_without_its_token() -> None:
    pytest.importorskip("trame")
    from trame.app import get_server
    from trame_server.client import Client, ConnectionStatus

    async def connected(url: str, **config: Any) -> bool:
        client = Client(url)
        task = asyncio.create_task(client.connect(**config))
        while not task.done():
            await asyncio.sleep(0.01)
            if client.connected == ConnectionStatus.CONNECTED:  # not already CONNECTING
                await client.disconnect()
                await task
                return True
        return task.exception() is None

    async def serve() -> list[bool]:
        server = get_server("token", client_type="vue3")
        token = sandbox_module._protect(server, "10.0.0.9")
        task = server.start(
            exec_mode="task", host="127.0.0.1", port=0, timeout=0, open_browser=False, disable_logging=True
        )
        await server.ready
        url = f"ws://127.0.0.1:{server.port}/ws"
        results = [await connected(url, secret=secret) for secret in ("wslink-secret", "", token)]
        await server.stop()
        await task
        return results

    with unittest.mock.patch.object(sys, "argv", ["implicit-decals"]):
        assert asyncio.run(serve()) == [False, False, True]


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
    program = "import sys; print('log\\nhttp://127.0.0.1:1/', flush=True); sys.stdin.read(); sys.exit(3)"
    monkeypatch.setattr(sandbox_module, "_commands", lambda *_: lambda _: [sys.executable, "-c", program])
    assert run(["sandbox", "--desktop"]) == 3
    assert shown == [(sandbox_module.TITLE, "http://127.0.0.1:1/"), "start"]
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
    monkeypatch.delitem(sys.modules, "decals.apps.sandbox.sessions", raising=False)
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
