"""``implicit-decals export``."""

from pathlib import Path
from typing import Any

import pytest
import pyvista as pv

from blobtree import Point, save
from decals import save_scene
from decals.apps.cli import run
from tests.decals.baking.glb import ball_and_cube, need, read_json
from tests.decals.pages.test_page import header_of

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def saved(folder: Path) -> Path:
    """A scene file in the empty folder."""
    scene = ball_and_cube(count=8)
    save_scene(scene.replace(decals=scene.decals.replace(images=[-1] * 8), images=()), folder / "scene.json")
    return folder


def test_a_scene_becomes_a_ply_file_with_attributes(saved: Path, capsys: Capture) -> None:
    assert run(["export", "scene.json", "-o", "a.ply", "--attribute", "owner", "--attribute", "uv"]) == 0
    assert capsys.readouterr().out == "a.ply\n"
    header = (saved / "a.ply").read_bytes().partition(b"end_header")[0].decode()
    assert [line.split()[-1] for line in header.splitlines() if line.startswith("property")] == [
        *("x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "owner", "uv_0", "uv_1", "vertex_indices")
    ]


def test_unit_and_axis_reach_the_file(saved: Path) -> None:
    need("trimesh")
    save(Point((0, 0, 0), radius=1.0), "ball.json")
    words = ["export", "ball.json", "--colors", "none", "--unit", "millimeter", "--up", "z", "--cells", "8"]
    assert run([*words, "-o", "a.glb"]) == 0
    matrix = next(node for node in read_json(saved / "a.glb")["nodes"] if "mesh" in node)["matrix"]
    assert matrix[:8] == pytest.approx([1e-3, 0, 0, 0, 0, 0, -1e-3, 0])


def test_a_page_has_a_title_a_description_and_a_background(saved: Path, capsys: Capture) -> None:
    words = ["--title", "A <duck>", "--alt", "green", "--background", "#ff0000", "--no-controls"]
    assert run(["export", "scene.json", "-o", "a.html", "--contact", "min", *words]) == 0
    assert capsys.readouterr().out == "a.html\n"
    text = (saved / "a.html").read_text(encoding="utf-8")
    assert "<title>A &lt;duck&gt;</title>" in text
    assert 'alt="green"' in text
    header = header_of(text)
    assert header["mode"] == "min"
    assert header["controls"] is False
    assert "rgb(100% 0% 0% / 1)" in header["markup"]


@pytest.mark.parametrize(
    ("output", "words", "ends"),
    [
        ("a.html", ["--unit", "inch"], ".glb"),
        ("a.html", ["--size", "4096"], ".glb"),
        ("a.html", ["--creases"], ".glb"),
        ("a.html", ["--check"], ".glb"),
        ("a.ply", ["--surface", "traced"], ".html"),
        ("a.ply", ["--controls"], ".html"),
        ("a.ply", ["--distance"], ".vti"),
        ("a.vti", ["--attributes", "owner"], ".glb"),
        ("a.vti", ["--instances"], ".glb"),
        ("a.vti", ["--contact", "min"], ".glb"),
        ("a.vti", ["--crease-angle", "20"], ".glb"),
    ],
)
def test_an_option_of_other_files_is_named(
    saved: Path, capsys: Capture, output: str, words: list[str], ends: str
) -> None:
    assert run(["export", "scene.json", "-o", output, *words]) == 2
    says = capsys.readouterr().err
    assert f"{words[0]}: expected an output that ends in {ends}" in says
    assert f"got '{output}'" in says
    assert [path.name for path in saved.iterdir()] == ["scene.json"]


def test_check_prints_a_table_for_written_objects_and_for_files(saved: Path, capsys: Capture) -> None:
    assert run(["export", "scene.json", "-o", "a.stl", "--check"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "a.stl"
    assert lines[1].split() == ["ball", "cube"]
    assert lines[2].split() == ["closed", "yes", "yes"]
    sheet = pv.Plane(i_resolution=2, j_resolution=1).triangulate()
    sheet.save("sheet.vtp")
    assert run(["export", "--check", "sheet.vtp"]) == 0
    table = dict(line.rsplit(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:])
    assert {key.strip(): value for key, value in table.items()} == {
        "closed": "no", "sound": "yes", "vertices": "6", "faces": "4", "connected parts": "1",
        "edges of one face": "6", "flipped edges": "0", "closed parts that wind inward": "0",
        "degenerate faces": "0", "copied faces": "0", "edges of more than two faces": "0",
        "pinched vertices": "0", "area": "1", "volume": "nan",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["scene.json"], "missing -o FILE; or --check"),
        (["scene.json", "-o", "a.fbx"], "expected an output file that ends in .glb"),
        (["scene.json", "-o", "nowhere/a.ply"], "'nowhere' does not exist"),
        (["nothing.json", "-o", "a.ply"], "found no file 'nothing.json'"),
        (["--check", "nothing.ply"], "found no file 'nothing.ply'"),
        (["scene.json", "-o", "a.stl", "--attribute", "owner"], "attributes: expected none for 'a.stl'"),
        (["scene.json", "-o", "a.ply", "--samples", "99"], "--samples: expected"),
    ],
)
def test_bad_input_is_one_line(saved: Path, capfd: Capture, words: list[str], says: str) -> None:
    assert run(["export", *words]) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert says in line
    assert [path.name for path in saved.iterdir()] == ["scene.json"]


def test_the_field_of_a_tree_becomes_a_volume(folder: Path, capsys: Capture) -> None:
    ball = Point((1e6, 0, 0), radius=1.0)
    save(ball, "ball.json")
    assert run(["export", "ball.json", "-o", "ball.vti", "--cells", "16"]) == 0
    assert run(["export", "ball.json", "-o", "ball.nrrd", "--cells", "16", "--distance"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["ball.vti", "ball.nrrd"]
    assert lines[2].startswith("distances are exact to 0.0")
    field = pv.read("ball.vti")
    distance: Any = pv.read("ball.nrrd")
    assert field.center == pytest.approx((1e6, 0, 0), abs=0.1)
    assert field.bounds == pytest.approx(distance.bounds)
    assert field.point_data["field"].max() == pytest.approx(1.0, abs=1e-3)
    assert distance.active_scalars.min() == pytest.approx(-1.0, abs=0.1)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["scene.json", "-o", "a.vti"], "got MeshObject, MeshObject in 'scene.json'"),
        (["knot", "-o", "a.nrrd"], "got MeshObject in 'knot'"),
        (["spheres", "-o", "a.npy", "--cells", "99999"], "expected at most 67,108,864 grid points"),
    ],
)
def test_what_is_no_volume_is_one_line(saved: Path, capfd: Capture, words: list[str], says: str) -> None:
    assert run(["export", *words]) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert says in line
    assert [path.name for path in saved.iterdir()] == ["scene.json"]


@pytest.mark.parametrize(
    ("suffix", "names"),
    [
        ("glb", ["node 0", "node 1"]),
        ("3mf", ["object 3", "object 4"]),
        ("obj", ["ball", "cube"]),
        ("ply", ["a.ply"]),
    ],
)
def test_check_lists_each_object_of_a_file(
    saved: Path, capsys: Capture, suffix: str, names: list[str]
) -> None:
    assert run(["export", "scene.json", "-o", f"a.{suffix}", "--colors", "none", "--check"]) == 0
    written = capsys.readouterr().out.splitlines()
    assert run(["export", "--check", f"a.{suffix}"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(name in lines[0] for name in names), lines[0]
    if len(names) == 2:
        assert faces_of(lines) == faces_of(written)


def faces_of(lines: list[str]) -> list[str]:
    return next(line.split()[1:] for line in lines if line.split()[:1] == ["faces"])


def test_faces_of_an_obj_file_before_its_first_object_have_no_name(saved: Path, capsys: Capture) -> None:
    vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    (saved / "a.obj").write_text(vertices + "f 1 2 3\no first #1\no second\nf 1 2 4\nf -1 -2 -3\n")
    assert run(["export", "--check", "a.obj"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["unnamed", "second"]
    assert faces_of(lines) == ["1", "2"]
