"""Invalid input: one line, exit code 2, and no work before the message."""

from collections.abc import Callable
from pathlib import Path

import pytest

from decals.apps.commands import demo as demo_module
from decals.apps.commands import render as render_module
from decals.errors import NoGraphics


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "nowhere.ply", "-o", "a.png"], "nowhere.ply"),
        (["render", "nowhere", "-o", "a.png"], "creature, dragon, horse, knot, spheres"),
        (["render", ".", "-o", "a.png"], "'.' is a folder"),
        (["render", "ball.ply"], "render: missing -o FILE"),
        (["render", "--decals", "5", "-o", "a.png"], "render: missing MODEL"),
        (["render", "ball.ply", "-o"], "missing a value after -o"),
        (["render", "ball.ply", "-o", "nowhere/a.png"], "'nowhere' does not exist"),
        (["render", "ball.ply", "-o", "a.gif"], ".png"),
        (["render", "ball.ply", "-o", "a"], ".png"),
        (["render", "ball.ply", "-o", "."], "folder"),
        (["render", "ball.ply", "-o", "a.png", "--save", "nowhere/s.json"], "does not exist"),
        (["render", "ball.ply", "-o", "a.png", "--save", "s.txt"], ".json"),
        (["render", "ball.ply", "-o", "a.png", "--decals", "-1"], "--decals"),
        (["render", "ball.ply", "-o", "a.png", "--decals", "many"], "--decals"),
        (["render", "ball.ply", "-o", "a.png", "--decals", "99999999999"], "--decals"),
        (["render", "ball.ply", "-o", "a.png", "--seed", "-1"], "--seed"),
        (["render", "ball.ply", "-o", "a.png", "--samples", "0"], "--samples"),
        (["render", "ball.ply", "-o", "a.png", "--size", "0x10"], "--size"),
        (["render", "ball.ply", "-o", "a.png", "--size", "10"], "WIDTHxHEIGHT"),
        (["render", "ball.ply", "-o", "a.png", "--size", "10x10", "20"], "got also '20'"),
        (["render", "ball.ply", "-o", "a.png", "--size", "99999x99999"], "16384"),
        (["render", "ball.ply", "-o", "a.png", "--camera", "up"], "three-quarter"),
        (["render", "ball.ply", "-o", "a.png", "--camera", "0,0,0"], "0,0,0"),
        (["render", "ball.ply", "-o", "a.png", "--camera", "1,nan,0"], "finite"),
        (["render", "ball.ply", "-o", "a.png", "--image", "nowhere.png"], "nowhere.png"),
        (["render", "ball.ply", "-o", "a.png", "--image", "ball.ply"], "ball.ply"),
        (["render", "ball.ply", "-o", "a.png", "--frobnicate"], "frobnicate"),
        (["polygonize", "ball.ply", "-o", "b.ply"], "BlobTree"),
        (["polygonize", "spheres", "-o", "b.txt"], ".ply"),
        (["polygonize", "spheres", "-o", "nowhere/b.ply"], "does not exist"),
        (["polygonize", "spheres", "-o", "b.ply", "--resolution", "0"], "resolution"),
        (["polygonize", "spheres", "-o", "b.ply", "--cell-size", "-1"], "cell_size"),
        (["polygonize", "spheres", "-o", "b.ply", "--cell-size", "1", "--resolution", "9"], "drop one"),
        (["polygonize", "spheres", "-o", "b.ply", "--chord-error", "1", "--cells", "9"], "drop the others"),
        (["polygonize", "spheres", "-o", "b.ply", "--chord-error", "-1"], "chord_error"),
        (["bake", "nowhere.json", "-o", "a.glb"], "nowhere.json"),
        (["bake", "ball.ply"], "bake: missing -o FILE"),
        (["scatter", "ball.ply"], "scatter: missing -o FILE"),
        (["bake", "ball.ply", "-o", "a.obj"], ".glb"),
        (["bake", "ball.ply", "-o", "nowhere/a.glb"], "does not exist"),
        (["bake", "ball.ply", "-o", "a.glb", "--size", "0"], "size"),
        (["bake", "ball.ply", "-o", "a.glb", "--size", "100000"], "8192"),
        (["bake", "ball.ply", "-o", "a.glb", "--samples", "0"], "--samples"),
        (["demo", "--size", "big"], "--size"),
        (["demo", "-o", "nowhere/deep"], "nowhere"),
        (["demo", "-o", "ball.ply"], "ball.ply"),
        (["frobnicate"], "frobnicate"),
    ],
)
def test_bad_arguments(bad: Callable[..., str], arguments: list[str], message: str) -> None:
    assert message in bad(*arguments)


def _obj(rows: str) -> bytes:
    return rows.replace("; ", "\n").encode() + b"\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("junk.stl", b"hello world\n" * 9, "junk.stl"),
        ("cut.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n", "cut.ply"),
        ("empty.obj", b"", "no points and no faces"),
        ("cloud.obj", _obj("v 0 0 0; v 1 0 0; v 0 1 0"), "no faces"),
        ("nan.obj", _obj("v 0 0 0; v nan 0 0; v 0 1 0; f 1 2 3"), "nan.obj"),
        ("flat.obj", _obj("v 0 0 0; v 1 1 1; v 2 2 2; f 1 2 3"), "area"),
        ("out.obj", _obj("v 0 0 0; v 1 0 0; v 0 1 0; f 1 2 9"), "out.obj"),
        ("empty.json", b"", "empty.json"),
        ("list.json", b"[1, 2]", "list.json"),
        ("cut.json", b'{"format": "blobtree", "version": 1, "nodes": [{"type": "po', "cut.json"),
        (
            "cycle.json",
            b'{"format": "blobtree", "version": 1, "nodes": [{"type": "sum", "operands": [0]}]}',
            "cycle.json",
        ),
        (
            "radius.json",
            b'{"format": "blobtree", "version": 1, "nodes": '
            b'[{"type": "point", "center": [0, 0, 0], "radius": -1, "color": [1, 1, 1]}]}',
            "radius",
        ),
        (
            "scene.json",
            b'{"format": "implicit-decals-scene", "version": 1, "objects": 3}',
            "objects: expected a list",
        ),
        ("newer.json", b'{"format": "implicit-decals-scene", "version": 9}', "version 9"),
    ],
)
def test_bad_models(bad: Callable[..., str], name: str, content: bytes, message: str) -> None:
    Path(name).write_bytes(content)
    assert message in bad("render", name, "-o", "a.png")


def test_no_graphics(bad: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_options: object) -> None:
        raise NoGraphics("drawing needs libEGL.so.1; run: apt-get install libegl1")

    monkeypatch.setattr(render_module, "Renderer", fail)
    monkeypatch.setattr(demo_module, "Renderer", fail)
    assert "apt-get install" in bad("render", "ball.ply", "-o", "a.png")
    assert "apt-get install" in bad("demo")


def test_an_impossible_path_is_refused(bad: Callable[..., str]) -> None:
    assert "found no file" in bad("render", "a" * 5000 + ".ply", "-o", "a.png")
