"""Input that cannot be baked: one exception of ours, and no file."""

import sys
from pathlib import Path
from typing import Any

import pytest

import decals
from blobtree import Point
from decals import Scene
from decals.errors import (
    Cancelled,
    ImplicitDecalsError,
    InvalidInput,
    InvalidScene,
    MissingPackage,
)
from tests.decals.baking.glb import ball_and_cube, need

BALL = Point((0, 0, 0), radius=1.0)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"size": 0}, "size: expected a whole number from 16 to 8192, got 0"),
        ({"size": -5}, "size: expected"),
        ({"size": 10**9}, "size: expected"),
        ({"size": 64.0}, "size: expected"),
        ({"size": True}, "size: expected"),
        ({"size": (64, 64)}, "size: expected"),
        ({"samples": 0}, "samples: expected a whole number from 1 to 16"),
        ({"samples": 1000}, "samples: expected"),
        ({"tiles": 0}, "tiles: expected a whole number from 1 to 100, got 0"),
        ({"tiles": 101}, "tiles: expected"),
        ({"tiles": 2, "layout": "xatlas"}, "tiles: expected 1 with layout 'xatlas', got 2; use layout='box'"),
        ({"tiles": 2, "vertex_colors": True}, "tiles: expected 1 for 'a.glb' with colors='vertices', got 2"),
        ({"layout": "sphere"}, "layout: expected one of auto, box, xatlas, own, got 'sphere'"),
        ({"layout": 3}, "layout: expected one of"),
        (
            {"layout": "own"},
            "expected texture coordinates, object 'model 1' has none; use layout='box'",
        ),
        ({"contact": 9}, "contact: expected one of"),
        ({"mapping": "planar"}, "mapping: expected one of"),
        ({"resolution": 0}, "resolution"),
        ({"progress": 3}, "progress: expected a function"),
        ({"path": "model.gltf"}, "expected a file that ends in .glb, got"),
        ({"path": "model"}, "expected a file that ends in .glb"),
        ({"path": "nowhere/model.glb"}, "'nowhere' does not exist"),
        ({"path": 7}, "expected the path of a .glb file, got 7"),
        ({"path": "folder.glb"}, "is a folder"),
        ({"scene": 7}, "expected a model, got 7"),
        ({"scene": "nowhere.json"}, "nowhere.json"),
        ({"scene": Scene(objects=(), camera=decals.Camera((0, 0, 5)))}, "at least one object"),
        ({"scene": BALL & Point((9, 9, 9), radius=1.0)}, "'model 1': .* increase the resolution"),
    ],
    ids=lambda value: value if isinstance(value, str) else "-".join(value),
)
def test_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any], says: str) -> None:
    need("trimesh", "xatlas")
    monkeypatch.chdir(tmp_path)
    Path("folder.glb").mkdir()
    arguments: dict[str, Any] = {"scene": BALL, "path": "a.glb", "size": 32} | options
    with pytest.raises(ImplicitDecalsError, match=says) as error:
        decals.bake(arguments.pop("scene"), arguments.pop("path"), **arguments)
    assert isinstance(error.value, InvalidInput) or "progress" in options
    assert [path.name for path in tmp_path.iterdir()] == ["folder.glb"]


def test_an_object_of_another_kind_is_refused(tmp_path: Path) -> None:
    need("trimesh", "xatlas")

    class Odd:
        objects = (7,)
        decals = decals.Decals.empty()
        images = ()

    with pytest.raises(InvalidScene, match="expected an object of a scene, got 7"):
        decals.bake(Odd(), tmp_path / "a.glb")  # type: ignore[arg-type]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="/proc is the folder that even root cannot write")
def test_a_folder_that_cannot_be_written_is_named_before_the_work() -> None:
    with pytest.raises(InvalidScene, match="'/proc' cannot be written"):
        decals.bake(BALL, "/proc/model.glb")


@pytest.mark.parametrize(
    ("package", "options"),
    [("xatlas", {"layout": "xatlas"}), ("trimesh", {}), ("trimesh", {"vertex_colors": True})],
)
def test_a_missing_package_is_named_with_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: str, options: dict[str, Any]
) -> None:
    for name in ("trimesh", "xatlas"):
        monkeypatch.setitem(sys.modules, name, None if name == package else type(sys)(name))
    with pytest.raises(MissingPackage, match=rf"{package}.*pip install 'implicit-decals\[bake\]'"):
        decals.bake(BALL, tmp_path / "a.glb", **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("stage", ["unwrapping the surface", "colouring texels", "writing the file"])
def test_a_stopped_bake_leaves_the_old_file(tmp_path: Path, stage: str) -> None:
    need("trimesh", "xatlas")
    path = tmp_path / "a.glb"
    path.write_bytes(b"old")
    stages: list[str] = []
    with pytest.raises(Cancelled):
        decals.bake(
            ball_and_cube(count=4),
            path,
            size=32,
            progress=lambda stage, _: stages.append(stage),
            cancel=lambda: stage in stages,
        )
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("a.glb", b"old")]


def test_a_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    need("trimesh")
    target, link = tmp_path / "target.glb", tmp_path / "link.glb"
    target.write_bytes(b"old")
    link.symlink_to(target)
    decals.bake(ball_and_cube(count=4), link, vertex_colors=True)
    assert link.is_symlink()
    assert target.read_bytes()[:4] == b"glTF"
