"""USD files: meshes where the file places them, and one clear line for files that cannot be read."""

import sys
from pathlib import Path

import numpy as np
import pytest

from decals.errors import InvalidMesh, MissingPackage
from decals.surfaces import read_mesh
from decals.surfaces.mesh_file import read_objects

pytest.importorskip("pxr", reason="usd-core has no wheels for this Python")

CUBE = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
SIDES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
"""A cube whose faces show their outside."""


def cube(name: str, *lines: str, sides: object = SIDES) -> str:
    """Return a cube in USD's text form."""
    points = ", ".join(f"({x}, {y}, {z})" for x, y, z in CUBE)
    corners = str(sides).replace("[[", "[").replace("]]", "]").replace("], [", ", ")
    rows = [
        f"point3f[] points = [{points}]",
        f"int[] faceVertexCounts = {[4] * 6}",
        f"int[] faceVertexIndices = {corners}",
        *lines,
    ]
    return f'def Mesh "{name}" {{\n' + "\n".join(rows) + "\n}\n"


def scaled(x: float) -> tuple[str, str]:
    return f"double3 xformOp:scale = ({x}, 1, 1)", 'uniform token[] xformOpOrder = ["xformOp:scale"]'


def written(path: Path, *parts: str) -> Path:
    path.write_text("#usda 1.0\n" + "".join(parts))
    return path


def test_meshes_lie_where_the_file_places_them_with_their_outside_outside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    left = 'uniform token orientation = "leftHanded"'
    turned = [side[::-1] for side in SIDES]
    parts = {
        "plain": cube("plain"),
        "mirrored": cube("mirrored", *scaled(-3)),
        "left": cube("left", left, sides=turned),
        "both": cube("both", left, *scaled(-2), sides=turned),
        "open": cube("open", "int[] holeIndices = [0]"),
        "hidden": cube("hidden", 'token visibility = "invisible"'),
        "guide": cube("guide", 'uniform token purpose = "guide"'),
        "ball": 'def Sphere "ball" {}\n',
        "hidden ball": 'def Sphere "b" {\ntoken visibility = "invisible"\n}\n',
        "copies": f'def PointInstancer "copies" {{\n{cube("copied")}}}\n',
    }
    volumes = {"/plain": 1, "/mirrored": 3, "/left": 1, "/both": 2}
    found = dict(read_objects(written(tmp_path / "a.usda", *parts.values())))
    assert list(found) == [*volumes, "/open"]
    assert [message.partition("a.usda: ")[2] for message in caplog.messages] == [
        "left out, as Sphere is no mesh: /ball",
        "left out, as PointInstancer is no mesh: /copies",
    ]
    assert len(found["/open"][1]) == 10
    for name, volume in volumes.items():
        vertices, faces = found[name]
        corners = vertices[faces].astype(float)
        assert np.linalg.det(corners).sum() / 6 == pytest.approx(volume)
        assert len(faces) == 12
    whole = read_mesh(tmp_path / "a.usda")
    assert len(whole[0]) == 40
    assert len(whole[1]) == 58
    assert np.array_equal(whole[0][:8], CUBE)


@pytest.mark.parametrize(
    ("arc", "named"),
    [
        ("references = @./none.usda@</a>", "none.usda"),
        ("payload = @http://example.org/x.usda@", "x.usda"),
        ("references = </nowhere>", "/nowhere"),
        ("references = </p>", "/p"),
    ],
)
def test_references_that_lead_nowhere_are_named(
    arc: str, named: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = written(tmp_path / "a.usda", f'def "p" ({arc}) {{}}\n', cube("cube"))
    with caplog.at_level("WARNING"):
        assert [name for name, _ in read_objects(path)] == ["/cube"]
    (message,) = caplog.messages
    assert "left out what cannot be found" in message
    assert named in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("no USD at all", "damaged or of another format"),
        ("#usda 1.0\n", "has no mesh"),
        ('#usda 1.0\ndef Sphere "a" {}\n', "has no mesh"),
        ("#usda 1.0\n" + cube("a", sides=[[0, 1, 2, 99]] * 6), "a.usda, /a.* asks for number 99"),
        ("#usda 1.0\n" + cube("a", sides=[[0, 1, 2]] * 6), "has 18 corners, its faces 24"),
        ('#usda 1.0\ndef "a" (references = @../b.usda@</b>) {}\n', "outside of its folder"),
    ],
)
def test_files_that_cannot_be_used_are_refused_by_one_line(
    content: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / "folder").mkdir()
    written(tmp_path / "b.usda", cube("b"))
    path = tmp_path / "folder" / "a.usda"
    path.write_text(content)
    with pytest.raises(InvalidMesh, match=message) as caught:
        read_mesh(path)
    assert "\n" not in str(caught.value)


def test_without_openusd_the_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingPackage, match=r"pip install 'implicit-decals\[usd\]'"):
        read_mesh(written(tmp_path / "a.usda", cube("a")))
