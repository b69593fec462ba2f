"""The command that makes files again."""

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import decals
from blobtree import Point
from decals.apps.cli import run
from decals.baking.export import EXPORT_FUNCTION
from decals.baking.reproduction import MAX_SCENE

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def covered() -> decals.Scene:
    return decals.cover(Point((0, 0, 0), radius=1.0), count=5, seed=2)


@pytest.fixture
def saved(covered: decals.Scene, folder: Path) -> Path:
    covered.save("scene.json")
    return folder


def test_a_scene_is_made_again(saved: Path, capsys: Capture) -> None:
    assert run(["reproduce", "scene.json"]) == 0
    assert capsys.readouterr().out == "scene.json: made again, equal bit for bit\n"
    scene = decals.load_scene("scene.json")
    scene.replace(decals=scene.decals[1:]).save("edited.json")
    assert run(["reproduce", "edited.json"]) == 3
    out = capsys.readouterr().out
    assert out.startswith("edited.json: cannot be made again; it lacks\n  edits by hand:")
    text = (saved / "scene.json").read_text()
    (saved / "other.json").write_text(
        text.replace('"seed":2', '"seed":3').replace(f'"{scene.decals.content_hash}"', '""')
    )
    assert run(["reproduce", "other.json"]) == 1
    assert "positions: 5 of 5 decals differ" in capsys.readouterr().out


@pytest.mark.slow
def test_scenes_of_samples_are_made_again(saved: Path, capsys: Capture) -> None:
    assert run(["render", "knot", "--decals", "9", "--save", "a.json", "--size", "40x30", "-o", "a.png"]) == 0
    assert run(["export", "a.json", "-o", "a.glb", "--size", "64"]) == 0
    capsys.readouterr()
    for arguments in (["a.json"], ["a.png", "--scene", "a.json"], ["a.glb"]):
        assert run(["reproduce", *arguments]) == 0
        assert capsys.readouterr().out == f"{arguments[0]}: made again, equal bit for bit\n"


def test_a_picture_is_drawn_again_with_its_scene(saved: Path, capsys: Capture) -> None:
    assert run(["render", "scene.json", "--size", "40x30", "-o", "a.png"]) == 0
    capsys.readouterr()
    assert run(["reproduce", "a.png"]) == 3
    assert "the scene: give its file with --scene" in capsys.readouterr().out
    assert run(["reproduce", "a.png", "--scene", "scene.json"]) == 0
    assert "equal bit for bit" in capsys.readouterr().out
    with Image.open("a.png") as image:
        notes, pixels = PngInfo(), np.array(image)
        notes.add_itxt("implicit-decals", image.text["implicit-decals"])  # type: ignore[attr-defined]
    pixels[3, 4, 0] ^= 8
    Image.fromarray(pixels).save("b.png", pnginfo=notes)
    assert run(["reproduce", "b.png", "--scene", "scene.json"]) == 1
    assert "pixels: 1 of 1,200 differ, up to 8 of 255" in capsys.readouterr().out
    scene = decals.load_scene("scene.json")
    scene.replace(decals=scene.decals[1:]).save("edited.json")
    assert run(["reproduce", "a.png", "--scene", "edited.json"]) == 3
    assert "the decals of the recipe: the scene has others" in capsys.readouterr().out


def test_frames_are_drawn_again_with_their_scene(saved: Path, capsys: Capture) -> None:
    options = ["--frames", "3", "--size", "40x30", "--samples", "1"]
    assert run(["animate", "scene.json", "-o", "turn", *options]) == 0
    capsys.readouterr()
    for number in (1, 2):
        frame = f"turn/frame_000{number}.png"
        assert run(["reproduce", frame, "--scene", "scene.json"]) == 0
        assert capsys.readouterr().out == f"{frame}: made again, equal bit for bit\n"
    assert run(["reproduce", "turn/frame_0002.png"]) == 3


def test_pictures_of_examples_are_drawn_again(saved: Path, capsys: Capture) -> None:
    assert run(["gallery", "sphere", "-o", "a.png", "--side", "32"]) == 0
    capsys.readouterr()
    assert run(["reproduce", "a.png"]) == 0
    assert capsys.readouterr().out == "a.png: made again, equal bit for bit\n"
    with_recipe("b.png", recipe_of("a.png") | {"parameters": {"example": "sphere", "side": 24}})
    assert run(["reproduce", "b.png"]) == 1
    assert "size: (4, 4) in the file, (52, 24) made again" in capsys.readouterr().out


def recipe_of(name: str) -> dict[str, Any]:
    """The recipe that a PNG file holds."""
    with Image.open(name) as image:
        held: dict[str, Any] = json.loads(image.text["implicit-decals"])  # type: ignore[attr-defined]
    return held


def with_recipe(name: str, recipe: dict[str, Any]) -> None:
    """Write a small picture with a recipe."""
    notes = PngInfo()
    notes.add_itxt("implicit-decals", json.dumps(recipe))
    Image.new("RGBA", (4, 4)).save(name, pnginfo=notes)


@pytest.mark.parametrize(
    "recipe",
    [
        {},
        {"function": "implicit-decals gallery"},
        {"function": "implicit-decals gallery", "parameters": {"example": "helpers", "side": 20}},
        {"function": "implicit-decals gallery", "parameters": {"example": "sphere", "side": 1 << 30}},
        {"function": "implicit-decals gallery", "parameters": {"example": ["sphere"], "side": "2"}},
        {"function": "implicit-decals demo", "parameters": {"picture": "a", "size": [9, 9], "samples": 1}},
        {"function": "implicit-decals demo", "parameters": {"picture": "span.png", "size": [], "samples": 1}},
        {"function": "decals.render", "parameters": 3, "missing": [], "scene": {}},
        {"function": "decals.render", "parameters": {}, "missing": [], "scene": {}},
        {
            "function": "decals.render",
            "parameters": {"size": [4, 4]},
            "missing": [],
            "scene": {},
            "camera": 1,
        },
    ],
)
def test_recipes_in_pictures_of_strangers_are_refused(
    saved: Path, capsys: Capture, recipe: dict[str, Any]
) -> None:
    with_recipe("a.png", recipe)
    assert run(["reproduce", "a.png", "--scene", "scene.json"]) == 3
    captured = capsys.readouterr()
    assert "a.png: cannot be made again" in captured.out
    assert "Traceback" not in captured.out + captured.err


def test_files_that_cannot_be_made_again(saved: Path, capsys: Capture) -> None:
    Image.new("RGB", (2, 2)).save("plain.png")
    assert run(["reproduce", "plain.png"]) == 3
    assert "a recipe: the file does not say how it was made" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["a.glb", "a.gltf"])
def test_an_exported_file_is_made_again(saved: Path, capsys: Capture, name: str) -> None:
    pytest.importorskip("trimesh", reason="files of other programs need it")
    options = ["--colors", "vertices", "--resolution", "16", "--attribute", "owner", "--contact", "radial"]
    assert run(["export", "scene.json", "-o", name, *options]) == 0
    capsys.readouterr()
    Path("scene.json").rename("away.json")
    assert run(["reproduce", name]) == 0
    assert capsys.readouterr().out == f"{name}: made again, equal bit for bit\n"
    content = Path(name).read_bytes()
    Path(name).write_bytes(content.replace(b'"resolution":16', b'"resolution":18'))
    assert run(["reproduce", name]) == 1
    assert "accessors: not as in the file" in capsys.readouterr().out
    Path(name).write_bytes(content.replace(b'"source":', b'"served":'))
    assert run(["reproduce", name]) == 3
    assert "the scene: give its file with --scene" in capsys.readouterr().out
    assert run(["reproduce", name, "--scene", "away.json"]) == 0
    scene = decals.load_scene("away.json")
    scene.replace(decals=scene.decals[1:]).save("edited.json")
    capsys.readouterr()
    assert run(["reproduce", name, "--scene", "edited.json"]) == 3
    assert "the decals of the recipe: the scene has others" in capsys.readouterr().out


def held(text: bytes) -> str:
    return base64.b64encode(zlib.compress(text)).decode()


@pytest.mark.parametrize(
    "changes",
    [
        {"source": held(b" " * (MAX_SCENE + 1))},
        {"source": held(b"{}")[:8]},
        {"source": "no base64"},
        {"source": held(b"[" * 100_000)},
        {"scene": []},
        {"scene": {"decals": 5}},
        {"missing": None},
        {"parameters": []},
        {"parameters": {"path": "elsewhere.glb"}},
        {"parameters": {"size": -1}},
    ],
)
def test_recipes_of_strangers_are_refused(saved: Path, capsys: Capture, changes: dict[str, Any]) -> None:
    source = held(Path("scene.json").read_bytes())
    recipe = {"function": EXPORT_FUNCTION, "parameters": {}, "missing": [], "scene": {}, "source": source}
    Path("a.gltf").write_text(json.dumps({"asset": {"extras": {"export": recipe | changes}}}))
    assert run(["reproduce", "a.gltf"]) == 3
    captured = capsys.readouterr()
    assert "a.gltf" in captured.out
    assert "Traceback" not in captured.out + captured.err
    assert sorted(path.name for path in saved.iterdir()) == ["a.gltf", "scene.json"]


@pytest.mark.slow
def test_a_texture_is_baked_again(saved: Path, capsys: Capture) -> None:
    pytest.importorskip("trimesh", reason="files of other programs need it")
    assert run(["bake", "scene.json", "-o", "a.glb", "--size", "64"]) == 0
    capsys.readouterr()
    assert run(["reproduce", "a.glb"]) == 0
    assert "equal bit for bit" in capsys.readouterr().out


SQUARES = """from decals.experiments import Grid
def experiment(x: float, name: str | None):
    return {"square": POWER(x), "same": name}
POWER = lambda x: x**2
design = Grid(x=[1, 2.5], name=["a", None])
"""


def test_results_are_made_again(folder: Path, capsys: Capture) -> None:
    Path("squares.py").write_text(SQUARES)
    assert run(["sweep", "squares.py", "--out", "results", "--workers", "0"]) == 0
    assert run(["reproduce", "results"]) == 3
    assert "the function 'experiment'" in capsys.readouterr().out
    assert run(["reproduce", "results", "--experiment", "squares.py"]) == 0
    assert "equal bit for bit" in capsys.readouterr().out
    Path("squares.py").write_text(SQUARES.replace("**2", "**3 * 1.0"))
    assert run(["reproduce", "results", "--experiment", "squares.py"]) == 3
    assert "it has changed since" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["scene.json", "--scene", "scene.json"], "--scene: expected a PNG, GLB or glTF file beside it"),
        (["none.json"], "could not read the scene 'none.json'"),
        (["none.png"], "none.png"),
        (["a.svg"], "other files do not say how they were made"),
        (["."], "expected the folder of an experiment"),
        (["scene.json", "--experiment", "a.py"], "--experiment: expected a folder of results"),
        (["none.glb"], "none.glb"),
        (["bad.png"], "expected a PNG file, got 'bad.png'"),
        (["bad.glb"], "could not read 'bad.glb' as glTF"),
    ],
)
def test_bad_input_gets_one_line(saved: Path, capsys: Capture, arguments: list[str], words: str) -> None:
    for name in ("bad.png", "bad.glb"):
        (saved / name).write_bytes(b"glTF\0\0")
    assert run(["reproduce", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
