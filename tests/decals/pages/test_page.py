"""Pages of scenes without a browser: what they hold, what they refuse, and the modules of their viewer."""

import base64
import errno
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from PIL import Image

import decals
from blobtree import Point, Segment
from blobtree.errors import InvalidResolution
from decals import Scene
from decals.errors import InvalidScene, TooMuchData
from decals.index import DecalIndex
from decals.index.index import has_nested, index_on
from decals.pages import contents, page, viewer_script
from decals.pages.contents import camera_record, index_rules, record_rules
from decals.pages.packing import packed
from decals.pages.page import MODULES
from decals.rendering import Environment
from decals.rendering.decal_library import Form
from decals.scenes.camera import REFERENCE_ASPECT
from decals.surfaces import BaseColor, BaseTexture
from tests.decals.pages.test_viewer_index import rows_of
from tests.decals.pages.viewer_scripts import VIEWER, needs_node, run_node

NAME = '</script><img src=x onerror="alert(1)">'


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return a ball with decals, under a name that HTML must not read."""
    ball = decals.TreeObject(NAME, Point((0, 0, 0), radius=1))
    return decals.cover(ball, count=20, images=["scale"])


@pytest.fixture(scope="module")
def text(scene: Scene) -> str:
    """Return the page of that scene."""
    return page(scene, resolution=16).text


def data_of(text: str) -> bytes:
    """Return what a page packs."""
    (found,) = re.findall(r'<script type="application/octet-stream" id="data">([^<]*)</script>', text)
    return zlib.decompress(base64.b64decode(found))


def header_of(text: str) -> Any:
    """Return the header of a page."""
    data = data_of(text)
    return json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])


def test_a_page_is_whole_and_asks_no_host(text: str) -> None:
    assert text.startswith("<!doctype html>")
    assert not re.findall(r"<!--[A-Z]+-->", text)
    assert not re.findall(r"""(?:src|href)=["'](?!data:|x onerror)[^"']*:""", text)
    assert "http://" not in text
    assert "https://" not in text
    assert "import " not in text.replace("import {", "")


def test_texts_are_escaped(text: str) -> None:
    assert NAME not in text
    assert "<title>&lt;/script&gt;" in text
    assert "Tools of &lt;/script&gt;" in header_of(text)["markup"]


def test_options_reach_the_page(scene: Scene) -> None:
    shown = page(scene, title="Ball", alt="A ball", controls=False, background="white", resolution=16)
    header = header_of(shown.text)
    assert header["controls"] is False
    assert 'aria-label="A ball"' in header["markup"]
    assert 'aria-label="Tools of Ball"' in header["markup"]
    assert "linear-gradient(rgb(100% 100% 100% / 1), rgb(100% 100% 100% / 1))" in header["markup"]
    assert shown.title == "Ball"
    assert 'title="Ball"' in shown._repr_html_()
    assert header_of(page(scene, contact="radial", stiffness=3.0, resolution=16).text)["mode"] == "radial"


@pytest.mark.parametrize("surface", ["traced", "mesh"])
def test_the_camera_of_a_page_sees_the_surface_of_a_wide_field(surface: str) -> None:
    wide = decals.cover(Point((0, 0, 0), radius=1.0, width=1e3), count=20)
    header = header_of(page(wide, surface=surface, resolution=16).text)
    assert np.abs(np.abs(header["bounds"]) - 1.0).max() < 0.3


def test_a_traced_page_has_trees_and_no_meshes_of_them(scene: Scene) -> None:
    header = header_of(page(scene, surface="traced").text)
    assert [surface["program"] for surface in header["surfaces"]] == ["tree 0"]
    names = [name for array in header["arrays"] for name in array["names"]]
    assert not [name for name in names if name.startswith("faces")]
    (item,) = scene.objects
    assert isinstance(item, decals.TreeObject)
    assert np.allclose(header["bounds"], item.tree.support)
    with pytest.raises(InvalidScene, match="surface: expected one of"):
        page(scene, surface="solid")


def test_trees_of_the_same_kinds_share_a_program() -> None:
    balls = [Point((3.0 * i, 0, 0), radius=1) for i in range(3)]
    several = decals.cover([*balls, Segment((0, 3, 0), (1, 3, 0), radius=0.5)], count=20)
    header = header_of(page(several, surface="traced").text)
    assert [surface["program"] for surface in header["surfaces"]] == ["tree 0"] * 3 + ["tree 3"]
    assert set(header["programs"]) == {"tree 0", "tree 3"}


def test_textures_of_meshes_are_kept_once_and_drawn_by_their_faces() -> None:
    image = BaseTexture(np.arange(48, dtype=np.uint8).reshape(4, 4, 3), wrap=("mirror", "repeat"))
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    color = BaseColor(None, [row[:2] for row in corners], (image,), [0, -1])
    faces = [[0, 1, 2], [1, 3, 2]]
    scene = decals.cover([decals.MeshObject(name, corners, faces, color=color) for name in "ab"], count=4)
    header = header_of(page(scene).text)
    first, second = header["surfaces"]
    assert first["program"] == second["program"] == "textured"
    assert [part["count"] for part in first["parts"]] == [3, 3]
    white, own = (part["values"] for part in first["parts"])
    assert own["mirrored"] == ["2i", 1, 0]
    assert header["textures"][own["base_texture"]]["size"] == [4, 4]
    assert header["textures"][white["base_texture"]]["size"] == [1, 1]
    assert second["parts"][1]["values"]["base_texture"] == own["base_texture"]


def test_the_scene_in_a_page_is_that_of_its_file(scene: Scene, text: str, tmp_path: Path) -> None:
    record = header_of(text)["scene"]
    (tmp_path / "scene.json").write_text(json.dumps(record), encoding="utf-8")
    loaded = decals.load_scene(tmp_path / "scene.json")
    assert np.array_equal(loaded.decals.packed(), scene.decals.packed())
    assert [item.name for item in loaded.objects] == [NAME]


def test_a_page_names_no_files(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "of-this-machine.png"
    Image.fromarray(np.full((4, 8, 3), 128, np.uint8)).save(path)
    lit = scene.replace(drawing=scene.drawing.overridden(environment=Environment(str(path))))
    text = page(lit, resolution=16).text
    assert b"of-this-machine" not in data_of(text)
    assert header_of(text)["scene"]["drawing"]["environment"]["picture"]


def test_what_pages_do_not_have_is_refused(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidScene, match="walked"):
        page(scene, mapping="walked")
    with pytest.raises(InvalidScene, match="expected an object to show"):
        page(scene.replace(objects=(), decals=scene.decals.replace(receivers=None)))
    mesh = decals.cover(pv.Cube().triangulate(), count=3)
    for resolution in (0, 2.5, "x"):
        with pytest.raises(InvalidResolution, match="resolution: expected"):
            page(mesh, resolution=resolution)  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="title: expected a text"):
        page(scene, title=3)  # type: ignore[arg-type]
    monkeypatch.setattr(contents, "MAX_DECALS", 19)
    with pytest.raises(TooMuchData, match="at most 19 decals, got 20"):
        page(scene)


@pytest.mark.slow
def test_a_million_decals_are_refused_with_the_size_of_the_page(scene: Scene) -> None:
    numbers = np.zeros(1_000_000, np.int32)
    many = scene.replace(decals=scene.decals[numbers])
    with pytest.raises(TooMuchData, match=r"at most 100,000 decals, got 1,000,000, about 95 MB; show a part"):
        page(many)


def test_files_are_whole_or_not_there(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidScene, match=r"ends in \.html"):
        scene.save_html(tmp_path / "ball.txt")
    with pytest.raises(InvalidScene, match="does not exist"):
        scene.save_html(tmp_path / "none" / "ball.html")
    scene.save_html(tmp_path / "ball.html", resolution=16)
    before = (tmp_path / "ball.html").read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        page(scene, title="Other", resolution=16).save(tmp_path / "ball.html")
    assert (tmp_path / "ball.html").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["ball.html"]


def test_the_viewer_is_one_module() -> None:
    script = viewer_script()
    assert {f"{name}.mjs" for name in MODULES} == {path.name for path in VIEWER.glob("*.mjs")}
    assert re.findall(r"^\s*(?:import|export) .*", script, re.MULTILINE) == ["export { mount };"]


@needs_node
def test_modules_are_valid() -> None:
    script = "for (const name of data) await import(`./${name}.mjs`); console.log(data.length);"
    assert run_node(script, MODULES) == len(MODULES)


@needs_node
def test_packed_arrays_are_unpacked() -> None:
    random = np.random.default_rng(0)
    arrays: dict[str, NDArray[Any]] = {
        "floats": random.normal(size=(7, 3)).astype(np.float32),
        "numbers": random.integers(-(2**31), 2**31, 50, dtype=np.int32),
        "faces": np.arange(12, dtype=np.int32).reshape(4, 3),
        "normals": random.integers(-32767, 32768, (5, 3), dtype=np.int16),
        "bytes": random.integers(0, 256, (9, 4), dtype=np.uint8),
        "halves": random.normal(size=(6, 4)).astype(np.float16),
        "none": np.zeros((0, 3), np.float32),
    }
    arrays["again"] = arrays["faces"].copy()
    script = """
    const { unpacked } = await import("./packing.mjs");
    const { header, arrays } = await unpacked(data);
    const bytes = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength).toString("base64");
    const found = Object.entries(arrays).map(([name, array]) => [name, bytes(array)]);
    console.log(JSON.stringify([header.word, Object.fromEntries(found)]));
    """
    text = packed({"word": "ß"}, arrays)
    word, found = run_node(script, text)
    assert word == "ß"
    assert {name: base64.b64decode(text) for name, text in found.items()} == {
        name: array.tobytes() for name, array in arrays.items()
    }


def test_equal_arrays_are_packed_once() -> None:
    numbers = np.random.default_rng(1).integers(0, 2**31, 20_000, dtype=np.int32)
    once = packed({}, {"a": numbers})
    assert len(packed({}, {"a": numbers, "b": numbers.copy()})) < len(once) + 200
    assert len(packed({}, {"a": numbers, "b": numbers.view(np.float32)})) > 1.9 * len(once)


BOUNDS = np.array([[-1.0, -1.0, -1.0], [1.0, 2.0, 1.0]])
WIDTHS = 3, 60, 180, 300, 399, 400, 401, 420, 600, 900, 4000
"""Widths of pictures of 300 lines."""


def cameras() -> dict[str, decals.Camera]:
    """Return cameras that stay, and cameras that fit points of several shapes, one of them moved a little."""
    found = {"placed": decals.Camera((3, 2, 5), (0.5, 0, -0.5), (0.1, 1, 0), 40)}
    random = np.random.default_rng(7)
    for name, size in {
        "long": (4, 1, 1),
        "tall": (0.5, 4, 1),
        "deep": (1, 1, 5),
        "flat": (3, 0.01, 3),
    }.items():
        points = random.uniform(-1, 1, (50, 3)) * size + 0.3
        direction = tuple(random.normal(size=3))
        found[name] = decals.Camera.fitting(points, direction=direction, aspect=None, margin=1.1)
        found[f"{name}, turned"] = found[name].turned(40)
    closer = decals.Camera((0, 0, 6), fov=35).fitted_to(random.uniform(-1, 1, (30, 3)), margin=1.0)
    return found | {"fitted by hand": closer}


@needs_node
@pytest.mark.parametrize("name", cameras())
def test_the_camera_of_each_size_is_that_of_the_picture(name: str) -> None:
    script = """
    const { Camera } = await import("./camera.mjs");
    const camera = new Camera(data.camera, data.bounds, data.reference);
    const blocks = data.widths.map((width) => {
      camera.fitTo(width / 300);
      return Array.from(camera.block(width, 300));
    });
    console.log(JSON.stringify(blocks));
    """
    camera = cameras()[name]
    record = camera_record(camera)
    data = {"camera": record, "bounds": BOUNDS.tolist(), "reference": REFERENCE_ASPECT, "widths": WIDTHS}
    for width, block in zip(WIDTHS, run_node(script, data), strict=True):
        size = width, 300
        matrix = camera.clip_matrix(size, (BOUNDS[0], BOUNDS[1]))
        scale = np.abs(matrix).max()
        assert_allclose(np.reshape(block[:16], (4, 4)).T, matrix, atol=1e-6 * scale, err_msg=str(size))
        known = camera.rays(*size)
        rows = np.array([[*known.origin, 1], [*known.corner, 0], [*known.right, 0], [*known.up, 0]])
        scale = np.abs(rows).max()
        assert_allclose(np.reshape(block[16:], (4, 4)), rows, atol=1e-6 * scale, err_msg=str(size))


@needs_node
def test_a_moved_camera_keeps_its_width_in_narrower_pictures() -> None:
    """Its home goes on to fit, and what it shows in the picture in which it was moved does not jump."""
    camera = cameras()["long"]
    script = """
    const { Camera } = await import("./camera.mjs");
    const camera = new Camera(data.camera, data.bounds, data.reference);
    const found = [];
    for (const aspect of [2, 0.5, 1]) { camera.fitTo(aspect); found.push(camera.pose); }
    camera.place({ ...camera.pose, ...camera.zoom(camera.pose, 1), aspect: 1 });
    const { pose } = camera;
    const widths = [1, 0.5, 2].map((aspect) => {
      camera.fitTo(aspect);
      return camera.frame(aspect).slice(0, 2).map((axis) => Math.hypot(...axis));
    });
    const stays = camera.pose === pose;
    camera.place(camera.home);
    camera.fitTo(0.5);
    found.push(camera.pose);
    console.log(JSON.stringify({ found, widths, stays }));
    """
    data = {"camera": camera_record(camera), "bounds": BOUNDS.tolist(), "reference": REFERENCE_ASPECT}
    ended = run_node(script, data)
    for aspect, pose in zip((2, 0.5, 1, 0.5), ended["found"], strict=True):
        assert_allclose(pose["position"], camera.at(aspect).position, atol=1e-9)
        assert_allclose(pose["target"], camera.at(aspect).target, atol=1e-9)
    half = np.tan(np.radians(camera.fov) / 2)
    assert_allclose(ended["widths"], [[half, half], [half, 2 * half], [2 * half, half]])
    assert ended["stays"]


@needs_node
def test_a_shifted_picture_is_seen_through_its_pixels() -> None:
    camera = cameras()["placed"]
    script = """
    const { Camera } = await import("./camera.mjs");
    const camera = new Camera(data.camera, data.bounds, data.reference);
    const place = camera.seen([0.2, 0.3, 0.4], 2);
    const shifted = Array.from(camera.block(600, 300, [0.25, -0.5]));
    const { position, target } = camera.pose;
    const behind = camera.seen(position.map((x, i) => 2 * x - target[i]), 2);
    camera.place({ ...camera.pose, ...camera.pan(camera.pose, 0.3, -0.2, 2) });
    const panned = camera.seen(target, 2);
    console.log(JSON.stringify([shifted, place, panned, behind]));
    """
    data = {"camera": camera_record(camera), "bounds": BOUNDS.tolist(), "reference": REFERENCE_ASPECT}
    shifted, place, panned, behind = run_node(script, data)
    width = 600
    expected = camera.clip_matrix((width, 300), (BOUNDS[0], BOUNDS[1]))
    known = camera.rays(width, 300)
    corner = np.add(known.corner, 0.25 * np.array(known.right) - 0.5 * np.array(known.up))
    assert_allclose(shifted[20:23], corner, atol=1e-6)
    through = np.add(known.origin, 2.5 * (corner + 30 * np.array(known.right) + 40 * np.array(known.up)))
    x, y, _, w = np.reshape(shifted[:16], (4, 4)).T @ [*through, 1]
    assert_allclose([(x / w + 1) / 2 * width, (y / w + 1) / 2 * 300], [30, 40], atol=1e-3)
    clip = expected @ [0.2, 0.3, 0.4, 1]
    assert_allclose(place, clip[:2] / clip[3], atol=1e-12)
    assert_allclose(panned, [0.3, -0.2], atol=1e-12)
    assert behind is None


@needs_node
def test_links_hold_the_state_and_refuse_nonsense() -> None:
    script = """
    const { read, written } = await import("./link.mjs");
    const row = (x) => ({ position: [x, 0, 0], normal: [0, 0, 1], tangent: [1, 0, 0], radius: 1 });
    const originals = [row(0), row(1), row(2)];
    const rows = [originals[0], null, { ...row(5), radius: 0.25 }, { ...row(7), image: 2 }];
    const camera = { pose: { position: [1, 2, 3], target: [0, 0, 0.125], aspect: 0 } };
    const state = { camera, aspect: 1.5, mode: "radial", stiffness: 2.5, decals: { rows }, originals };
    const link = written(state);
    const many = { ...state, decals: { rows: Array.from({ length: 200 }, (_, i) => row(i)) } };
    const wrong = ["", "#", 5, "#d=99999999x", "#d=0:1,2,3", "#d=1:NaN", "#eye=1,2&at=3", "#d=7x"];
    const found = wrong.map((text) => read(text, originals));
    const edited = [row(8), originals[1], null, row(9), null];
    const again = read("mode=min&d=3:0,0,0,0,0,1,1,0,0,2", originals, edited).decals;
    console.log(JSON.stringify([read(link, originals), written(many), found, again]));
    """
    state, too_long, wrong, again = run_node(script, None)
    assert {number: row and row["position"][0] for number, row in again.items()} == {
        "0": 0,
        "1": 1,
        "2": 2,
        "3": 0,
        "4": None,
    }
    assert state["camera"] == {"position": [1, 2, 3], "target": [0, 0, 0.125], "aspect": 1.5}
    assert (state["mode"], state["stiffness"]) == ("radial", "2.5")
    changes = state["decals"]
    assert set(changes) == {"1", "2", "3"}
    assert changes["1"] is None
    assert changes["2"]["position"] == [5, 0, 0]
    assert changes["2"]["radius"] == 0.25
    assert changes["3"]["image"] == 2
    assert too_long is None
    assert wrong == [{"mode": None, "stiffness": None, "decals": {}}] * len(wrong)


@needs_node
def test_edits_are_undone_and_a_drag_is_one_step() -> None:
    script = """
    const { History } = await import("./history.mjs");
    const decals = { rows: ["a", "b"], set(number, row) { this.rows[number] = row; } };
    const history = new History(decals, () => {});
    const seen = [];
    const look = () => seen.push([...decals.rows]);
    history.change([[0, "c"]]);
    history.change([[1, "e"]], history.change([[1, "d"]]));
    history.change([[2, "f"]]);
    look();
    for (const step of [-1, -1, -1, -1, 1, 1]) { history.go(step); look(); }
    history.change([[0, null]]);
    history.go(1);
    look();
    console.log(JSON.stringify(seen));
    """
    assert run_node(script, None) == [
        ["c", "e", "f"],
        ["c", "e", None],
        ["c", "b", None],
        ["a", "b", None],
        ["a", "b", None],
        ["c", "b", None],
        ["c", "e", None],
        [None, "e", None],
    ]


@needs_node
@pytest.mark.parametrize("between", ["history.go(-1)", "history.change([[1, 'x']])", "history.go(1)"])
def test_no_state_is_lost_by_what_comes_between_steps_of_a_drag(between: str) -> None:
    script = f"""
    const {{ History }} = await import("./history.mjs");
    const decals = {{ rows: ["a", "b"], set(number, row) {{ this.rows[number] = row; }} }};
    const history = new History(decals, () => {{}});
    const step = history.change([[0, "dragged"]]);
    {between};
    history.change([[0, "farther"]], step);
    const seen = [[...decals.rows]];
    while (history.at > 0) {{ history.go(-1); seen.push([...decals.rows]); }}
    console.log(JSON.stringify(seen));
    """
    seen = run_node(script, None)
    assert seen[0][0] == "farther"
    assert seen[-1] == ["a", "b"]
    assert len(seen) == (4 if "x" in between else 2)


@needs_node
def test_poses_without_a_picture_are_refused() -> None:
    good = [[0, 0, 3], [0, 0, 0]], [[0, 1, 3], [5, 1, 0]], [[50, 0, 0], [0, 50, 0]]
    wrong = (
        [[0, 0, 0], [0, 0, 0]],
        [[0, 5, 0], [0, 0, 0]],
        [[0, -5, 0], [0, 0, 0]],
        [[1e300, 0, 0], [0, 0, 0]],
        [[0, 0, 3], [1e30, 0, 0]],
        [[None, 0, 3], ["x", 0, 0]],
    )
    script = """
    const { Camera } = await import("./camera.mjs");
    const start = { position: [1, 2, 3], target: [0, 0, 0], up: [0, 2, 0], fov: 30 };
    const found = data.map(([position, target]) => {
      const camera = new Camera(start, [[-1, -1, -1], [1, 1, 1]], 1.5);
      camera.place({ position, target });
      return camera.pose.position === position && camera.pose.target === target;
    });
    console.log(JSON.stringify(found));
    """
    assert run_node(script, [*good, *wrong]) == [True] * len(good) + [False] * len(wrong)


@needs_node
def test_vectors_are_carried_by_the_smallest_turn() -> None:
    """Rodrigues' formula about the axis of both normals is the reference."""
    random = np.random.default_rng(5)
    vectors, first, second = random.normal(size=(3, 50, 3))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    second[0], second[1] = first[0], -first[1]
    second[2] = -first[2] + 1e-4 * vectors[2]
    second[2] /= np.linalg.norm(second[2])
    script = """
    const { carried } = await import("./vectors.mjs");
    console.log(JSON.stringify(data.map((row) => carried(...row))));
    """
    found = run_node(script, np.stack([vectors, first, second], axis=1).tolist())
    for v, a, b, carried in zip(vectors, first, second, np.array(found), strict=True):
        axis, cosine = np.cross(a, b), float(a @ b)
        if cosine > -1 + 1e-12:
            turn = cosine * v + np.cross(axis, v) + axis * (axis @ v) / (1 + cosine)
        else:
            turn = v - 2 * b * (b @ v)
        assert_allclose(carried, turn, atol=1e-6)


@needs_node
def test_wrong_values_of_decals_are_named() -> None:
    """With infinite numbers the loops of the index would not end; `load_scene` refuses the others."""
    good: dict[str, Any] = {
        "position": [1, 2, 3],
        "normal": [0, 0, 1],
        "tangent": [1, 0, 0],
        "radius": 0.5,
        "image": 1,
    }
    right: list[dict[str, Any]] = [
        {"image": -1},
        {"number": 7},
        {"tint": [0, 0.5, 1], "opacity": 0.25, "layer": -3, "interaction": "overlap", "spill": True},
        {"receivers": "hull", "fade_angle": 0, "fade_depth": 0.5, "single_sheet": True},
    ]
    wrong: list[dict[str, Any]] = [
        {"position": [1e300, 0, 0]},
        {"position": [0, 0]},
        {"position": ["1", "2", "3"]},
        {"normal": [0, 0, 0]},
        {"normal": [1e-320, 0, 0]},
        {"radius": 1e300},
        {"radius": 0},
        {"radius": "0.5"},
        {"image": 2},
        {"image": -2},
        {"image": 0.5},
        {"number": -1},
        {"number": 4e9},
        {"tint": [0, 0, 2]},
        {"tint": "red"},
        {"tint": None},
        {"opacity": 1.5},
        {"opacity": None},
        {"layer": 0.5},
        {"layer": 1e9},
        {"interaction": "constructor"},
        {"spill": 1},
        {"receivers": "lid"},
        {"fade_angle": 0.5},
        {"fade_depth": -1},
        {"colour": "red"},
        {"constructor": 1},
    ]
    lacking = ["position", "normal", "radius"]
    script = """
    const { framed, wrongValue } = await import("./decals.mjs");
    console.log(JSON.stringify(data.rows.map((row) => wrongValue(framed(row), data.rules) ?? null)));
    """
    rows = [good, *({**good, **change} for change in [*right, *wrong])]
    rows += [{name: good[name] for name in good if name != left} for left in lacking]
    rows += [{**good, "tangent": [0, 0, 0]}]
    rules = record_rules(["", "hull"], Form(decals.Contact.ELASTIC), 2)
    expected = (
        [None] * (1 + len(right)) + [name for change in wrong for name in change] + lacking + ["tangent"]
    )
    assert run_node(script, {"rows": rows, "rules": rules}) == expected


@needs_node
@pytest.mark.slow_cases("1", "2")
@pytest.mark.parametrize("seed", range(3))
def test_the_page_finds_nested_decals(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = 30
    given = decals.Decals(
        positions=random.normal(size=(count, 3)),
        normals=random.normal(size=(count, 3)),
        tangents=random.normal(size=(count, 3)),
        radii=10.0 ** random.uniform(-1.5, 0.0, count),
        interactions=random.integers(0, 2, count),
    )
    nested = [
        [bool(has_nested(index_on(given[[a, b]]), 2)) for b in range(count) if b != a] for a in range(count)
    ]
    rules = record_rules([""], Form(decals.Contact.ELASTIC), 1) | {"index": index_rules(DecalIndex.of(given))}
    script = """
    const { DecalSet } = await import("./decals.mjs");
    const set = new DecalSet(data.rows, data.rules);
    const { numbers } = set;
    const row = (a) => numbers.filter((b) => b !== a).map((b) => set.areNested(a, b));
    console.log(JSON.stringify(numbers.map(row)));
    """
    assert any(map(any, nested))
    assert run_node(script, {"rows": rows_of(given), "rules": rules}) == nested


@needs_node
def test_an_edit_takes_the_full_shaders_where_it_must() -> None:
    given = decals.Decals(
        positions=[[0, 0, 0], [5, 0, 0]], normals=[[0, 0, 1]] * 2, tangents=[[1, 0, 0]] * 2, radii=[1, 1]
    )
    rows = rows_of(given)
    rules = record_rules([""], Form(decals.Contact.ELASTIC), 1) | {"index": index_rules(DecalIndex.of(given))}
    edits = {
        "moved": {"position": [4, 0, 0]},
        "nested": {"position": [5, 0, 0], "radius": 0.1},
        "over": {"interaction": "overlap"},
        "upper": {"layer": 1},
        "fading": {"fade_angle": 60},
    }
    script = """
    const { DecalSet } = await import("./decals.mjs");
    const found = Object.entries(data.edits).map(([name, change]) => {
      const set = new DecalSet(data.rows, data.rules);
      set.set(0, { ...data.rows[0], ...change });
      return [name, set.full];
    });
    console.log(JSON.stringify(Object.fromEntries(found)));
    """
    found = run_node(script, {"rows": rows, "rules": rules, "edits": edits})
    assert found == {"moved": False, "nested": True, "over": True, "upper": True, "fading": True}


def test_a_page_shows_rigid_poses_and_names_others() -> None:
    rest = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    scene = decals.cover(decals.MeshObject("sheet", rest, [[0, 1, 2]]), count=3)
    stretched = decals.pose(scene, {"sheet": 2 * rest})
    with pytest.raises(InvalidScene, match="expected one without poses"):
        page(stretched)
    lifted = rest + np.array([0, 0, 5], np.float32)
    rigid = decals.pose(scene, {"sheet": lifted}, rigid=True)
    rows = header_of(page(rigid).text)["scene"]["decals"]
    assert_allclose([row["position"] for row in rows], rigid.decals.positions, atol=1e-6)
    assert rows[0]["position"][2] == pytest.approx(5)
