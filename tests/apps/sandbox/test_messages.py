"""Random messages of a page, valid and malformed: none raises, and undoing all restores the first state."""

import json
import random
import time
from pathlib import Path
from typing import Any

import pytest

import decals
from decals.apps.sandbox.sandbox import Sandbox
from decals.editing.actions import KEYS
from decals.window import EditWindow
from tests.apps.sandbox.test_sandbox import TREE, finish
from tests.decals.editing.scenes import digest

ODD: list[Any] = [None, "", "x", -1, 0, 7, 0.5, 1e308, float("nan"), True, [], {}, [1, 2, 3], "0", "#00ff00"]
KEYS_OF_ROWS = ["", "0", "0/0", "0/1", "0/1/0", "object 0", "object 1", "image 0", "1", "9/9", "-1", "a/b"]
UNDONE = ("close", "camera", "move", "add_image", "save", "save_as", "export")
ACTIONS = [binding.action for binding in KEYS.bindings if binding.action not in UNDONE]
KINDS = ["Point", "Torus", "Box", "Twist", "Offset", "Union", "Difference", "Nothing"]
NAMES = ["radius", "center", "degrees", "color", "opacity", "layer", "image", "tint", "spill", "interaction"]
OPTIONS = ["mode", "overlay", "slice_axis", "slice_position", "orthographic", "axes"]
SHOWN = ["traced", "polygonized", "normals", "none", "seeds", "owners", "folds", "contact lines", "x", "z"]
CHANGES = ["rename", "remove", "duplicate", "move", "group", "hide", "lock", "isolate"]
HANDLES = ["move", "move x", "turn y", "scale", "start 0"]
ALL: dict[str, list[list[Any]]] = {
    "select": [KEYS_OF_ROWS],
    "mark": [KEYS_OF_ROWS],
    "open_lesson": [[0, 1]],
    "set_value": [NAMES, [0.2, 0.9, "3", [0, 0, 1], "#ff0000"], [True, False], [[], [], [0], [1], [9]]],
    "scatter": [],
    "add": [KINDS],
    "wrap": [KINDS],
    "combine": [KINDS],
    "unwrap": [],
    "perform": [ACTIONS],
    "go_to": [[0, 1, 2, 3, 5]],
    "set_display": [OPTIONS, [*SHOWN, 0.3, True, False]],
    "move_camera": [["frame", "look", "keep", "go"], ["front", "top", 0, 3]],
    "set_decals": [NAMES, [0.1, 0.5, 2, "overlap", "tint alone", "#0000ff", True], [True, False]],
    "set_brush": [["brush", "radius", "density"], ["select", "scatter", "push", "lasso", 0.3]],
    "set_drawing": [["contact", "mapping", "stiffness", "filtered"], ["product", "chord", 2.0, True]],
    "set_scattering": [["count", "factor", "sizing", "jitter.size"], [3, "10", 0.5, "touching"]],
    "set_image": [["roughness", "relief"], [0.2, 0.5], [True, False]],
    "change_row": [KEYS_OF_ROWS, CHANGES, ["name", "0/1", "0"]],
    "drag_handle": [HANDLES, ["begin", "move", "end"], [0.1, 0.5, 0.8], [0.3, 0.6], [True, False]],
    "open_file": [["../x.json", "none.json", "a\0.json"]],
    "write_file": [["../x.py", "x.exe", "no/x.json"]],
    "upload": [[[{}], [{"name": "a.ply", "content": b"x"}], 3], KEYS_OF_ROWS],
    "settle": [],
}


def send(seed: int, count: int, folder: Path) -> int:
    """Send random messages to a sandbox, and return how many changed the scene."""
    rng, changed = random.Random(seed), 0
    with EditWindow(decals.cover(TREE, count=12, images=["tile"]), off_screen=True, size=(60, 45)) as window:
        window.show()
        sandbox, before = Sandbox(window, folder=folder), digest(window.document)
        for _ in range(count):
            name = rng.choice([*ALL])
            arguments = [rng.choice(ODD if rng.random() < 0.15 else choices) for choices in ALL[name]]
            if name == "perform" and rng.random() < 0.5:  # a click first
                at = rng.uniform(0, 60), rng.uniform(0, 45)
                window.tools.press(*at)
                window.tools.release(*at)
            if name != "perform" or arguments[0] in ACTIONS:
                getattr(sandbox, name)(*arguments)
            entries = window.session.labels
            finish(window)
            changed += entries != window.session.labels
            window.actions.state.prompt.close()
            json.dumps(sandbox.values(), default=list)
            if len(window.document.objects) > 4 or len(window.document.decals) > 300:
                sandbox.go_to(0)
        end = time.monotonic() + 60
        while sandbox.values()["display"]["busy"] and time.monotonic() < end:
            sandbox.settle()
        window.actions.state.end_stroke()
        sandbox.go_to(0)
        assert digest(window.document) == before
    return changed


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_random_messages_raise_nothing(seed: int, vtk_display: None, tmp_path: Path) -> None:
    send(seed, 150, tmp_path)
    assert [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")] == []
