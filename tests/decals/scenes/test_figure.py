"""Figures in SVG and PDF: what is seen, where it lies on the page, widths, and refusals."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import decals
from blobtree import Point
from decals.apps.cli import run
from decals.errors import InvalidScene
from decals.scenes.objects import bounds_of
from tests.decals.meshes import box
from tests.decals.scenes.test_evenness import flat, scene_of, square

NAMESPACE = "{http://www.w3.org/2000/svg}"


def drawn(path: Path) -> dict[str, list[np.ndarray]]:
    """The polylines of a figure by the kind of their lines."""
    root = ElementTree.parse(path).getroot()
    lines: dict[str, list[np.ndarray]] = {}
    for item in root.iter(f"{NAMESPACE}path"):
        parts = re.findall(r"M([^M]*)", item.attrib["d"])
        lines[item.attrib["id"]] = [
            np.array([point.split() for point in part.split("L")], float) for part in parts
        ]
    return lines


def on_page(scene: decals.Scene, points: Any, size: tuple[float, float]) -> np.ndarray:
    """Where points of a scene lie on a page."""
    matrix = scene.camera.clip_matrix((int(size[0]), int(size[1])), bounds_of(scene.objects))
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return np.asarray((clip[:, :2] / clip[:, 3:] * [0.5, -0.5] + 0.5) * size)


def front(**columns: Any) -> decals.Scene:
    layout = flat([[-0.6, 0, 0], [0.6, 0, 0]], 1.0, **columns)
    return scene_of(square(4.0), layout).replace(camera=decals.Camera((0, 0, 6), fov=40.0))


def test_lines_lie_where_the_camera_sees_them(tmp_path: Path) -> None:
    scene, size = front(), (300.0, 200.0)
    decals.save_figure(scene, tmp_path / "pair.svg", size=size)
    lines = drawn(tmp_path / "pair.svg")
    (contact,) = lines["contact"]
    assert np.ptp(contact[:, 0]) < 0.02
    ends = on_page(scene, [[0, -0.8, 0], [0, 0.8, 0]], size)
    np.testing.assert_allclose(np.sort(contact[[0, -1], 1]), np.sort(ends[:, 1]), atol=0.05)
    centers = on_page(scene, [[-0.6, 0, 0], [0.6, 0, 0]], size)
    radius = np.ptp(on_page(scene, [[0, 0, 0], [1, 0, 0]], size)[:, 0])
    for rim, center in zip(sorted(lines["rim"], key=lambda line: line[:, 0].min()), centers, strict=True):
        np.testing.assert_allclose(np.linalg.norm(rim - center, axis=1), radius, atol=0.05)
    corners = on_page(scene, [[-2, -2, 0], [2, 2, 0]], size)
    model = np.concatenate(lines["model"])
    np.testing.assert_allclose(model.min(axis=0), corners.min(axis=0), atol=0.05)
    root = ElementTree.parse(tmp_path / "pair.svg").getroot()
    assert (root.attrib["width"], root.attrib["viewBox"]) == ("300pt", "0 0 300 200")
    widths = {path.attrib["id"]: path.attrib["stroke-width"] for path in root.iter(f"{NAMESPACE}path")}
    assert widths == {"contact": "0.8", "rim": "0.5", "model": "0.35"}


def test_the_back_is_hidden(tmp_path: Path) -> None:
    """Decals in front of and behind a box: a quarter of its faces and one rim are seen."""
    mesh = box((2.0, 2.0, 0.5))
    layout = decals.Decals(
        [[0, 0, 0.25], [0, 0, -0.25]], [[0, 0, 1], [0, 0, -1]], [[1, 0, 0]] * 2, [0.6, 0.4]
    )
    scene = scene_of((mesh.vertices.astype(float), mesh.faces), layout)
    seen: list[Any] = []
    for z in (6.0, -6.0):
        view = decals.Camera((0.5, 0.4, z), fov=40.0)
        decals.save_figure(scene, tmp_path / "box.svg", camera=view)
        lines = drawn(tmp_path / "box.svg")
        (rim,) = lines["rim"]
        seen.append(np.ptp(rim[:, 0]))
        assert np.concatenate(lines["model"]).size > 0
    assert seen[0] / seen[1] == pytest.approx(1.5, rel=0.05)


def test_a_ball_has_a_whole_silhouette(tmp_path: Path) -> None:
    ball = decals.TreeObject("ball", Point((0, 0, 0), radius=1.0))
    scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5), fov=40.0))
    decals.save_figure(scene, tmp_path / "ball.svg", size=(200, 200))
    points = np.concatenate(drawn(tmp_path / "ball.svg")["model"])
    angles = np.sort(np.arctan2(*(points - 100).T))
    assert np.diff(angles).max() < 0.1
    radius = 100 / np.tan(np.radians(20)) / np.sqrt(24)
    np.testing.assert_allclose(np.linalg.norm(points - 100, axis=1), radius, rtol=0.01)


def test_objects_hide_lines_behind_them(tmp_path: Path) -> None:
    scene = front()
    wall = decals.MeshObject("wall", [[0, -3, 2], [3, -3, 2], [3, 3, 2], [0, 3, 2]], [[0, 1, 2], [0, 2, 3]])
    both = scene.replace(objects=[*scene.objects, wall])
    decals.save_figure(both, tmp_path / "wall.svg", size=(300, 200), widths={"model": 0})
    lines = drawn(tmp_path / "wall.svg")
    assert set(lines) <= {"rim", "contact"}
    assert all(line[:, 0].max() <= 151 for line in lines["rim"])


def test_widths_choose_the_lines(tmp_path: Path) -> None:
    decals.save_figure(front(), tmp_path / "rims.svg", widths={"contact": 0, "model": 0, "rim": 2})
    assert set(drawn(tmp_path / "rims.svg")) == {"rim"}
    assert 'stroke-width="2"' in (tmp_path / "rims.svg").read_text()


def test_pdf_has_the_size_and_is_the_same_again(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib, of the extra experiments, is not installed")
    for name in ("one.pdf", "two.pdf"):
        decals.save_figure(front(), tmp_path / name, size=(144, 108))
    content = (tmp_path / "one.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert b"/MediaBox [ 0 0 144 108 ]" in content
    assert content == (tmp_path / "two.pdf").read_bytes()


def test_the_command_writes_the_figure_of_the_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = front()
    scene.save("pair.json")
    decals.save_figure(scene, "library.svg", size=(200, 150), widths={"rim": 1.5, "model": 0}, contact="min")
    options = ["--width", "200", "--height", "150", "--rim-width", "1.5", "--model-width", "0"]
    assert run(["figure", "pair.json", "-o", "command.svg", *options, "--contact", "min"]) == 0
    assert Path("command.svg").read_bytes() == Path("library.svg").read_bytes()
    decals.save_table(scene.decals, "pair.csv")
    scene.replace(decals=decals.Decals.empty()).save("bare.json")
    taken = ["--table", "pair.csv", *options, "--contact", "min"]
    assert run(["figure", "bare.json", "-o", "table.svg", *taken]) == 0
    assert Path("table.svg").read_bytes() == Path("library.svg").read_bytes()
    assert run(["figure", "spheres", "-o", "model.svg"]) == 2
    assert run(["figure", "pair.json", "-o", "figure.png"]) == 2
    assert "expected a saved scene in JSON" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["svg", "pdf"])
def test_a_picture_lies_behind_the_lines(suffix: str, tmp_path: Path) -> None:
    sizes = []
    for picture in (False, True):
        path = tmp_path / f"{picture}.{suffix}"
        decals.save_figure(front(), path, size=(60, 45), picture=picture)
        sizes.append(len(path.read_bytes()))
    assert sizes[1] > sizes[0] + 1000
    if suffix == "svg":
        root = ElementTree.parse(tmp_path / "True.svg").getroot()
        assert next(item.tag for item in root) == f"{NAMESPACE}image"


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"scene": 5}, "scene: expected a Scene, got 5"),
        ({"path": "a.png"}, r"expected a file that ends in \.svg or \.pdf"),
        ({"size": 5}, "size: expected a width and a height"),
        ({"size": (0, 5)}, "size: expected sides from 0 to"),
        ({"size": (float("nan"), 5)}, "size: expected"),
        ({"widths": {"line": 1}}, "widths: expected the kinds contact, rim, model, got 'line'"),
        ({"widths": {"rim": -1}}, "width of rim: expected points from 0 to 100, got -1"),
        ({"widths": 1}, "widths: expected widths in points by kind"),
        ({"camera": 5}, "camera: expected"),
        ({"contact": "round"}, "contact: expected one of"),
        (
            {"scene": decals.Scene(objects=[], camera=decals.Camera((0, 0, 5)))},
            "expected a scene with an object",
        ),
    ],
)
def test_refuses(wrong: dict[str, Any], says: str, tmp_path: Path) -> None:
    wrong = wrong | ({"path": tmp_path / wrong["path"]} if "path" in wrong else {})
    arguments: dict[str, Any] = {"scene": front(), "path": tmp_path / "a.svg"} | wrong
    with pytest.raises(InvalidScene, match=says):
        decals.save_figure(**arguments)
    assert list(tmp_path.iterdir()) == []
