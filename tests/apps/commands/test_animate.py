"""``implicit-decals animate``, `decals.animate` and `decals.turntable`."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import decals
from decals import Camera, MeshObject, Scene
from decals.apps.cli import run
from decals.errors import Cancelled, InvalidScene, MissingPackage
from tests.apps.commands.pictures import picture

Capture = pytest.CaptureFixture[str]

SIZE = (32, 24)
SMALL = ("--size", "32x24", "--samples", "1")


def scene() -> Scene:
    """A tetrahedron with a decal, and a camera that sees both."""
    corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    body = MeshObject("body", corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    decal = decals.Decals([[1 / 3] * 3], [[1, 1, 1]], [[1, 0, -1]], [0.5], images=[decals.NO_IMAGE])
    drawing = decals.rendering.Drawing(samples=1)
    return Scene(objects=(body,), decals=decal, camera=Camera((1, 2, 6), up=(0, 2, 0)), drawing=drawing)


def test_a_turntable_turns_the_camera_only() -> None:
    one = scene()
    frames = decals.turntable(one, 8, turns=2)
    assert frames[0].camera == one.camera
    positions = np.array([frame.camera.position for frame in frames])
    np.testing.assert_allclose(positions[:, 1], 2.0)
    angles = np.unwrap(np.arctan2(positions[:, 0], positions[:, 2]))
    np.testing.assert_allclose(np.diff(angles), np.pi / 2)
    assert all(frame.decals is one.decals and frame.objects[0] is one.objects[0] for frame in frames)


def test_frames_are_the_pictures_of_their_scenes(vtk_display: None, folder: Path) -> None:
    frames = decals.turntable(scene(), 3)
    seen: list[float] = []
    written = decals.animate(
        iter(frames), "turn", size=SIZE, count=3, progress=lambda _stage, share: seen.append(share)
    )
    assert written == Path("turn")
    assert seen[-3:] == [0.0, 1 / 3, 2 / 3]
    for number, frame in enumerate(frames, 1):
        np.testing.assert_array_equal(
            picture(folder / f"turn/frame_{number:04d}.png"), np.asarray(decals.render(frame, size=SIZE))
        )


def test_videos(vtk_display: None, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clear = scene().replace(drawing=decals.rendering.Drawing(background=decals.rendering.TRANSPARENT))
    frames = decals.turntable(clear, 4)
    decals.animate(frames, folder / "turn.gif", size=SIZE, rate=10)
    with Image.open(folder / "turn.gif") as image:
        assert (getattr(image, "n_frames", 1), image.info["duration"], image.info["loop"]) == (4, 100, 0)
        image.seek(2)
        shown = np.asarray(image.convert("RGB")).astype(int)
    expected = np.asarray(decals.render(frames[2], size=SIZE)).astype(int)
    solid = expected[..., 3] == 255
    assert np.abs(shown - expected[..., :3])[solid].mean() < 6  # 256 colours
    assert (shown[expected[..., 3] == 0] == 255).all()

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingPackage, match=r"imageio_ffmpeg.*pip install 'implicit-decals\[video\]'"):
        decals.animate(frames, folder / "turn.mp4", size=SIZE)
    assert not (folder / "turn.mp4").exists()
    fake, taken = ModuleType("imageio_ffmpeg"), list[Any]()

    def write_frames(path: str, size: tuple[int, int], **options: Any) -> Any:
        taken.extend((size, options["fps"]))
        Path(path).write_bytes(b"video")
        while True:
            taken.append((yield))

    fake.write_frames = write_frames  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", fake)
    decals.animate(frames, folder / "turn.mp4", size=SIZE, rate=30)
    assert (folder / "turn.mp4").read_bytes() == b"video"
    assert taken[:2] == [SIZE, 30.0]
    assert len(taken[2:]) == 4
    sent = np.frombuffer(taken[4], np.uint8).reshape(24, 32, 3)
    np.testing.assert_array_equal(sent[solid], expected[solid][:, :3])


def test_frames_of_a_longer_animation_are_removed(vtk_display: None, folder: Path) -> None:
    kept = [
        "frame_0001.png",
        "frame_0002.png",
        "frame_003.png",
        "frame_00003.png",
        "frame_0004.jpg",
        "my_frame_0004.png",
    ]
    (folder / "turn").mkdir()
    for name in [*kept[1:], "frame_0003.png", "frame_10000.png"]:
        (folder / "turn" / name).write_bytes(b"")
    decals.animate(decals.turntable(scene(), 2), "turn", size=SIZE)
    assert sorted(file.name for file in (folder / "turn").iterdir()) == sorted(kept)


def test_cancelled_work_leaves_whole_pictures_only(vtk_display: None, folder: Path) -> None:
    second = folder / "turn" / "frame_0002.png"
    with pytest.raises(Cancelled):
        decals.animate(decals.turntable(scene(), 9), "turn", size=SIZE, cancel=second.exists)
    assert sorted(file.name for file in folder.rglob("*.*")) == ["frame_0001.png", "frame_0002.png"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"frames": scene()}, "expected a list of scenes, got a Scene"),
        ({"frames": []}, "at least one scene, got none"),
        ({"frames": [3]}, "expected a Scene, got 3"),
        ({"path": "turn.avi"}, r"\.gif or \.mp4, got 'turn.avi'"),
        ({"path": "turn.mp4", "size": (33, 24)}, "even width and height"),
        ({"path": 3}, "expected a folder or a file"),
        ({"path": "nowhere/turn"}, "could not make the output folder"),
        ({"path": "nowhere/turn.gif"}, "folder 'nowhere' does not exist"),
        ({"path": "file"}, "'file' .it is a file.; choose another"),
        ({"path": "file/turn"}, "Not a directory"),
        ({"path": "file/turn.gif"}, "folder 'file' does not exist"),
        ({"path": "turn\0"}, "null"),
        ({"rate": 0}, "frames per second"),
        ({"count": 0}, "count"),
        ({"samples": 0}, "samples"),
        ({"size": (0, 1)}, "size"),
    ],
)
def test_invalid_animations(folder: Path, wrong: dict[str, Any], message: str) -> None:
    (folder / "file").write_bytes(b"")
    given: dict[str, Any] = {"frames": [scene()], "path": "turn", **wrong}
    with pytest.raises(InvalidScene, match=message):
        decals.animate(**given)
    assert [entry.name for entry in folder.iterdir()] == ["file"]


@pytest.mark.parametrize("wrong", [{"scene": 3}, {"count": 0}, {"turns": "x"}])
def test_invalid_turntables(wrong: dict[str, Any]) -> None:
    with pytest.raises(InvalidScene, match=next(iter(wrong))):
        decals.turntable(**{"scene": scene(), **wrong})


def test_the_command_turns_and_poses(vtk_display: None, folder: Path, capsys: Capture) -> None:
    one = scene()
    one.save("scene.json")
    assert run(["animate", "scene.json", *SMALL, "--frames", "2", "-o", "turn"]) == 0
    assert capsys.readouterr().out == "turn\n"
    expected = decals.render(decals.turntable(one, 2)[1], size=SIZE)
    np.testing.assert_array_equal(picture(folder / "turn/frame_0002.png"), np.asarray(expected))

    vertices = np.asarray(one.objects[0].vertices)  # type: ignore[union-attr]
    (folder / "walk.py").write_text(
        f"import numpy\nrest = numpy.array({vertices.tolist()})\n"
        "def pose(t):\n    return {'body': rest + [t, 0, 0]}\n"
    )
    drawn = {"contact": "product", "mapping": "chord"}
    options = [text for name, value in drawn.items() for text in (f"--{name}", value)]
    command = ["animate", "scene.json", *SMALL, "--frames", "4", "--poses", "walk.py", "-o", "walk"]
    assert run([*command, *options]) == 0
    moved = decals.pose(one, {"body": np.add(vertices, (0.5, 0, 0))}).render(size=SIZE, **drawn)
    np.testing.assert_array_equal(picture(folder / "walk/frame_0003.png"), np.asarray(moved))
    assert run(command) == 0
    moved = decals.render(decals.pose(one, {"body": np.add(vertices, (0.5, 0, 0))}), size=SIZE)
    np.testing.assert_array_equal(picture(folder / "walk/frame_0003.png"), np.asarray(moved))

    (folder / "fall.py").write_text("def pose(t):\n    return {'body': t}['x']\n")
    assert run(["animate", "scene.json", *SMALL, "--frames", "4", "--poses", "fall.py", "-o", "walk"]) == 2
    line = " ".join(capsys.readouterr().err.split())
    assert "--poses fall.py, pose(0.0): " in line
    assert "fall.py:2: KeyError: 'x'" in line

    faces = np.column_stack([np.full(4, 3), one.objects[0].faces])  # type: ignore[union-attr]
    for name, shift in (("a.ply", 0.0), ("b.ply", 0.5)):
        pv.PolyData(np.add(vertices, (shift, 0, 0)).astype(np.float32), faces).save(folder / name)
    command = ["animate", "scene.json", *SMALL, "--meshes", "a.ply", "b.ply", "-o", "steps"]
    assert run(command) == 0
    assert len(list((folder / "steps").iterdir())) == 2
    np.testing.assert_array_equal(picture(folder / "steps/frame_0002.png"), np.asarray(moved))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "a.avi"], ".gif or .mp4"),
        (["-o", "nowhere/a"], "could not make the output folder"),
        (["-o", "a", "--frames", "0"], "--frames"),
        (["-o", "a", "--stiffness", "0"], "stiffness"),
        (["-o", "a", "--poses", "none.py"], "--poses: expected a Python file"),
        (["-o", "a", "--poses", "empty.py"], "expected a function pose(t)"),
        (["-o", "a", "--poses", "empty.py", "--meshes", "ball.ply"], "got both"),
    ],
)
def test_invalid_commands(bad: Callable[..., str], options: list[str], message: str) -> None:
    Path("empty.py").write_text("")
    assert message in bad("animate", "ball.ply", *options)


def test_work_that_fails_leaves_no_folder(folder: Path, capsys: Capture) -> None:
    decals.save_scene(scene(), folder / "s.json")
    (folder / "junk.ply").write_bytes(b"ply")
    assert run(["animate", "s.json", "--poses", "junk.ply", "-o", "new", *SMALL]) == 2
    assert "--poses: expected a Python file" in capsys.readouterr().err
    (folder / "poses.py").write_text("def pose(t):\n    return 1 / 0\n")
    assert run(["animate", "s.json", "--poses", "poses.py", "-o", "new", *SMALL]) == 2
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert not (folder / "new").exists()
