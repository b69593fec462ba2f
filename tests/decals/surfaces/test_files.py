"""Files of other programs: all forms of OBJ, STL, OFF and PLY, and what is wrong in some of them."""

import itertools
import logging
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from decals.errors import InvalidMesh
from decals.images.texels import decode_srgb
from decals.surfaces import read_mesh
from decals.surfaces.base_color import CLAY
from decals.surfaces.mesh_file import read_mesh_data

V = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
VT = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
VN = "vn 0 0 1\n"
FACET = "facet normal 0 0 1\nouter loop\nvertex {}\nvertex {}\nvertex {}\nendloop\nendfacet\n"
STL = (
    "solid a b c\n"
    + FACET.format("0 0 0", "1 0 0", "1 1 0")
    + FACET.format("0 0 0", "1 1 0", "0 1 0")
    + "endsolid a b c\n"
)
OFF = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
)


def area(path: Path) -> float:
    vertices, faces = read_mesh(path)
    a, b, c = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


OBJ_SQUARES: dict[str, str | bytes] = {
    "plain": V + "f 1 2 3 4\n",
    "texture": V + VT + "f 1/1 2/2 3/3 4/4\n",
    "normals": V + VN + "f 1//1 2//1 3//1 4//1\n",
    "all": V + VT + VN + "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
    "mixed forms": V + VT + VN + "f 1/1/1 2//1 3/3 4\n",
    "empty parts": V + VT + "f 1/ 2/2/ 3// 4/4/\n",
    "relative": V + VT + VN + "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1\n",
    "relative between": "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf 1 3 -1\n",
    "faces first": "f 1 2 3 4\n" + V,
    "continued": V.replace("v 1 1 0", "v 1 \\\n1 0") + "f 1 2 \\\n3 4\n",
    "continued behind a keyword": V.replace("v 1 1 0", "v\\\n1 1 0") + "f\\\n1 2 3 4\n",
    "comments": "# a \\\n" + V.replace("\n", " # corner\n") + "f 1 2 3 4 # and all\n",
    "numbers": "v 0e0 -0 0.\nv +1 .0 0\nv 1e+0 1E-0 0.0\nv 0 1.00e0 0\nf +1 +2 +3 +4\n",
    "names": "o a name with spaces\ng\nusemtl\nmtllib no file.mtl\n" + V + "s off\nf 1 2 3 4\nxyzzy 1 2\n",
    "colours": "".join(line + " 0.5 0.5 0.5\n" for line in V.splitlines()) + "f 1 2 3 4\n",
    "comment that ends with a backslash": V + "f 1 2 3 # C:\\a\\\nf 1 3 4\n",
    "names that end with a backslash": "o C:\\a\\\n" + V + "g b\\\nf 1 2 3 4\n",
    "continued before spaces": V + "f 1 2 \\ \n3 4\n",
    "tabs": (V + "f 1 2 3 4\n").replace(" ", "\t"),
    "spaces": "  " + (V + "f 1 2 3 4  \n").replace(" ", "   "),
    "no last line end": V + "f 1 2 3 4",
    "two marks": "\ufeff\ufeff" + V + "f 1 2 3 4\n",
    "marks between": "v 0 0 0\nv 1 0 0\nv 1 1 0\n\ufefff 1 2 3\n\ufeffv 0 1 0\nf 1 3 4\n",
    "latin-1": (V + "o caf\xe9\nf 1 2 3 4\n").encode("latin-1"),
    "old face": V + "fo 1 2 3 4\n",
}


@pytest.mark.parametrize("name", OBJ_SQUARES)
def test_every_form_of_obj_is_the_same_square(tmp_path: Path, name: str) -> None:
    assert area(written(tmp_path, "a.obj", OBJ_SQUARES[name])) == pytest.approx(1.0)


OBJ_FAULTS = {
    "no texture": (V + "f 1/1 2/2 3/3\n", 5, "texture coordinate 1"),
    "no normals": (V + VT + "f 1/1/1 2/2/1 3/3/1\n", 9, "normal 1"),
    "far texture": (V + VT + "f 1/1 2/2 3/1000000\n", 9, "texture coordinate 1000000"),
    "far normal": (V + VN + "f 1//1 2//1 3//1000000\n", 6, "normal 1000000"),
    "past the last": (V + VT + "f 1/1 2/2 5/3\n", 9, "vertex 5"),
    "far past": (V + "f 1 2 3\nf 1 2 99999999999\n", 6, "vertex 99999999999"),
    "more than 64 bits": (V + "f 1 2 99999999999999999999\n", 5, "expected corners"),
    "zero": (V + "f 0 1 2\n", 5, "vertex 0"),
    "relative before the first": (V + "f -5 -4 -3\n", 5, "vertex -5"),
    "relative before its vertices": ("f -3 -2 -1\n" + V, 1, "vertex -3"),
    "relative texture": (V + "f 1/-1 2/-1 3/-1\n", 5, "texture coordinate -1"),
    "continued": (V + "f 1 \\\n2 \\\n9\n", 5, "vertex 9"),
    "four parts": (V + VT + VN + "f 1/1/1/1 2/2/1/1 3/3/1/1\n", 10, "expected corners"),
    "word": (V + "f 1 2 three\n", 5, "'1 2 three'"),
    "underscore": (V + "f 1 2 0_3\n", 5, "expected corners"),
    "half": (V + "f 1 2 2.5\n", 5, "expected corners"),
    "no first part": (V + VT + "f /1 /2 /3\n", 9, "expected corners"),
    "two numbers": ("v 0 0\n" + V + "f 1 2 3\n", 1, "three finite numbers"),
    "nan": (V + "v nan 0 0\nf 1 2 3\n", 5, "three finite numbers"),
    "huge": (V + "v 1e400 0 0\nf 1 2 3\n", 5, "three finite numbers"),
    "comma": (V + "v 0,5 0 0\nf 1 2 3\n", 5, "three finite numbers"),
    "cut face": (V + "f 1 2 3\nf 1 2", 6, "ends within a face"),
}


@pytest.mark.parametrize("name", OBJ_FAULTS)
def test_a_wrong_line_of_obj_is_named(tmp_path: Path, name: str) -> None:
    content, line, reason = OBJ_FAULTS[name]
    path = written(tmp_path, "a.obj", content)
    with pytest.raises(InvalidMesh, match=r"a\.obj") as caught:
        read_mesh(path)
    assert f"line {line}:" in str(caught.value)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_polygon_round_a_hole_keeps_its_area_in_any_order(tmp_path: Path) -> None:
    """A square of 0.5 with a round hole, 66 corners: the outline, a bridge to the hole, and back."""
    around = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    outer = 0.3 * np.stack([np.cos(around), np.sin(around)], axis=1)
    inner = 0.1 * np.stack([np.cos(around), -np.sin(around)], axis=1)
    points = "".join(f"v {x} 0 {y}\n" for x, y in np.concatenate([outer, inner]).tolist())
    polygon = [*range(1, 33), 1, *range(33, 65), 33]
    expected = 16.0 * np.sin(np.pi / 16) * (0.3**2 - 0.1**2)
    for start in range(0, 66, 5):
        for step in (1, -1):
            corners = " ".join(str(k) for k in (polygon[start:] + polygon[:start])[::step])
            path = written(tmp_path, "a.obj", f"{points}f {corners}\n")
            assert len(read_mesh(path)[1]) == 64
            assert area(path) == pytest.approx(expected, rel=1e-5)


ENCODINGS = ["utf-8-sig", "utf-16", "utf-16-be", "utf-32", "utf-32-be"]
MARKS = {"utf-16-be": b"\xfe\xff", "utf-32-be": b"\0\0\xfe\xff"}


@pytest.mark.parametrize("suffix", ["obj", "stl", "off", "ply"])
@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_marks_of_encodings_and_line_ends(tmp_path: Path, suffix: str, encoding: str, end: str) -> None:
    text = {"obj": OBJ_SQUARES["all"], "stl": STL, "off": OFF, "ply": PLY}[suffix]
    content = MARKS.get(encoding, b"") + str(text).replace("\n", end).encode(encoding)
    assert area(written(tmp_path, f"a.{suffix}", content)) == pytest.approx(1.0)


@pytest.mark.parametrize("suffix", ["obj", "stl", "off"])
def test_null_bytes_are_named(tmp_path: Path, suffix: str) -> None:
    text = {"obj": OBJ_SQUARES["all"], "stl": STL, "off": OFF}[suffix]
    for content in (str(text).encode("utf-16-le"), str(text).encode() + b"\0" * 9):
        with pytest.raises(InvalidMesh, match="null bytes"):
            read_mesh(written(tmp_path, f"a.{suffix}", content))
    with pytest.raises(InvalidMesh, match="mark of UTF-16"):
        read_mesh(written(tmp_path, f"a.{suffix}", str(text).encode("utf-16") + b"\xd8"))


STL_SQUARES = {
    "upper case": STL.upper(),
    "two solids": STL.replace("endfacet\nfacet", "endfacet\nendsolid a\nsolid b\nfacet"),
    "no name": STL.replace(" a b c", ""),
    "remarks at the end": STL + "# exported by a program\nand its version\n",
    "name of keywords": STL.replace("a b c", "facet normal vertex"),
    "one facet a line": STL.replace("\n", " ")
    .replace("facet n", "\nfacet n")
    .replace("endsolid", "\nendsolid"),
    "tabs": STL.replace(" 0 0 1\n", "\t0\t0\t1\n").replace("vertex", "  vertex"),
    "normal of nothing": STL.replace("0 0 1", "nan nan nan"),
    "no normals": STL.replace(" normal 0 0 1", ""),
    "a normal here and there": STL.replace(" normal 0 0 1", "", 1),
    "one line": STL.replace("\n", " "),
    "one line, no name": STL.replace(" a b c", "").replace("\n", " "),
    "one line, no normals": STL.replace(" normal 0 0 1", "").replace("\n", " "),
    "one line, two solids": STL.replace("endfacet\nfacet", "endfacet endsolid a solid b facet").replace(
        "\n", " "
    ),
    "one line, name of keywords": STL.replace("a b c", "solid facet normal vertex").replace("\n", " "),
    "one word a line": "\n".join(STL.replace(" a b c", "").split()),
    "facets in the line of the name": STL.replace("a b c\nfacet", "a b c facet"),
}


@pytest.mark.parametrize("name", STL_SQUARES)
def test_every_form_of_stl_is_the_same_square(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, "a.STL", STL_SQUARES[name])
    assert area(path) == pytest.approx(1.0)
    assert len(read_mesh(path)[0]) == 4


def binary_stl(facets: int, declared: int, header: bytes = b"solid of no text") -> bytes:
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    row = struct.pack("<12fH", 0, 0, 1, *np.ravel(corners).tolist(), 0)
    return header.ljust(80, b" ") + struct.pack("<I", declared) + row * facets


def test_binary_stl(tmp_path: Path) -> None:
    assert area(written(tmp_path, "a.stl", binary_stl(2, 2))) == pytest.approx(1.0)
    assert area(written(tmp_path, "a.stl", b"\xef\xbb\xbf" + binary_stl(2, 2))) == pytest.approx(1.0)
    assert area(written(tmp_path, "a.stl", binary_stl(2, 2) + b"a remark")) == pytest.approx(1.0)
    for declared in (0, 1):
        with pytest.raises(InvalidMesh, match=f"declares {declared} facets and holds 2"):
            read_mesh(written(tmp_path, "a.stl", binary_stl(2, declared, b"\0")))
    with pytest.raises(InvalidMesh, match="declares 3 facets and holds 2"):
        read_mesh(written(tmp_path, "a.stl", binary_stl(2, 3, b"\0")))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (STL.replace("endsolid a b c\n", ""), "without 'endsolid'"),
        (STL + "solid b\nfacet normal 0 0 1\n", "without 'endsolid'"),
        (STL.replace("vertex 1 1 0\nendloop", "endloop", 1), "line 2: expected a facet"),
        (STL.replace("vertex 0 1 0", "vertex 0 x 0"), "line 9: expected a facet"),
        (STL.replace("vertex 0 1 0", "vertex 0 inf 0"), "line 9: expected a facet"),
        (STL.replace("normal 0 0 1", "normal 0 0", 1), "line 2: expected a facet"),
        (STL.replace("normal 0 0 1", "normal", 1), "line 2: expected a facet"),
        (STL.replace("\n", " ").replace("vertex 0 1 0", "vertex 0 x 0"), "line 1: expected a facet"),
        (STL.replace("\n", " ").replace(" endsolid a b c", ""), "without 'endsolid'"),
    ],
)
def test_a_wrong_stl_is_named(tmp_path: Path, content: str, reason: str) -> None:
    with pytest.raises(InvalidMesh, match=reason):
        read_mesh(written(tmp_path, "a.stl", content))


OFF_ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
OFF_SQUARES = {
    "counts beside the keyword": OFF.replace("OFF\n", "OFF "),
    "counts at the keyword": OFF.replace("OFF\n", "OFF"),
    "no edges": OFF.replace("4 1 0", "4 1"),
    "no keyword": OFF.replace("OFF\n", ""),
    "comments": OFF.replace("\n", " # more\n\n# x\n"),
    "face colours": OFF.replace("4 0 1 2 3", "4 0 1 2 3 255 0 0"),
    "vertex colours": "COFF\n4 1 0\n" + OFF_ROWS.replace("\n", " 255 0 0 255\n") + "4 0 1 2 3\n",
    "normals": "NOFF\n4 1 0\n" + OFF_ROWS.replace("\n", " 0 0 1\n") + "4 0 1 2 3\n",
    "texture": "STOFF\n4 1 0\n" + OFF_ROWS.replace("\n", " 0.5 0.5\n") + "4 0 1 2 3\n",
    "counts on lines of their own": OFF.replace("4 1 0", "4\n1\n0"),
    "edges on a line of their own": OFF.replace("4 1 0", "4 1\n0"),
    "one line": OFF.replace("\n", " "),
    "one line, no edges": "OFF 4 1 " + OFF_ROWS.replace("\n", " ") + "4 0 1 2 3",
    "one word a line": OFF.replace(" ", "\n"),
    "vertices on one line": "OFF\n4 1 0\n" + OFF_ROWS.replace("\n", " ") + "\n4 0 1 2 3\n",
    "vertices on lines, a coloured face": "OFF\n4 1 0\n"
    + OFF_ROWS.replace(" ", "\n")
    + "4 0 1 2 3 255 0 0\n",
    "two faces on a line": "OFF\n4 2 0\n" + OFF_ROWS + "3 0 1 2 3 0 2 3\n",
    "coloured vertices on one line": "COFF\n4 1 0\n"
    + OFF_ROWS.replace("\n", " 255 0 0 255 ")
    + "4 0 1 2 3\n",
    "three colours on one line": "COFF\n4 1 0\n" + OFF_ROWS.replace("\n", " 255 0 0 ") + "4 0 1 2 3\n",
    "normals on one line": "NOFF\n4 1 0\n" + OFF_ROWS.replace("\n", " 0 0 1 ") + "\n4 0 1\n2 3\n",
    "three colours, a corner a line": "COFF\n4 1 0\n"
    + OFF_ROWS.replace("\n", " 255 0 0\n")
    + "4\n3\n2\n1\n0\n",
    "small letters": OFF.replace("OFF", "noff")
    .replace("0\n", "0 0 0 1\n", 5)
    .replace("4 1 0 0 0 1", "4 1 0"),
    "all": "STCNOFF\n4 1 0\n" + OFF_ROWS.replace("\n", " 0 0 1 1 1 1 1 0 0\n") + "4 0 1 2 3\n",
}


def off_prism(corners: int, faces: int, components: int, layout: str) -> str:
    """Return polygons of an area of 1/6 of n(n² - 1) each, whose words lines divide in one of four ways."""
    ends = ["0 255 0"] * bool(components) + ["7"] * (components == 4)
    vertices = [
        " ".join([f"{x} {x * (corners - 1 - x)} {3 * k}", *ends])
        for k in range(faces)
        for x in range(corners)
    ]
    rows = [
        " ".join(map(str, [corners, *range(k * corners + corners - 1, k * corners - 1, -1)]))
        for k in range(faces)
    ]
    if layout != "lines":
        rows = [row.replace(" ", "\n") for row in rows]
    if layout == "words":
        vertices = [row.replace(" ", "\n") for row in vertices]
    if layout == "one line":
        vertices, rows = [" ".join(vertices)], [" ".join(rows).replace("\n", " ")]
    keyword = "COFF" if components else "OFF"
    return "\n".join([keyword, f"{corners * faces} {faces} 0", *vertices, *rows])


@pytest.mark.parametrize("layout", ["lines", "faces", "words", "one line"])
def test_words_of_off_may_stand_on_any_lines(tmp_path: Path, layout: str) -> None:
    for corners, faces, components in itertools.product(range(3, 8), (1, 2, 3), (0, 3, 4)):
        text = off_prism(corners, faces, components, layout)
        n = corners - 1
        assert area(written(tmp_path, "a.off", text)) == pytest.approx(faces * n * (n * n - 1) / 6), text


@pytest.mark.parametrize("name", OFF_SQUARES)
def test_every_form_of_off_is_the_same_square(tmp_path: Path, name: str) -> None:
    assert area(written(tmp_path, "a.off", OFF_SQUARES[name])) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (OFF.replace("4 1 0", "353535235358 1 0"), "declares 353535235358 vertices"),
        (OFF.replace("4 0 1 2 3", "4 0 1 2 4"), "line 7: .*vertices from 0 to 3"),
        (OFF.replace("4 0 1 2 3", "5 0 1 2 3"), "line 7: "),
        (OFF.replace("4 0 1 2 3", "-4 0 1 2 3"), "line 7: "),
        (OFF.replace("1 1 0", "1 1"), "line 5: expected three finite"),
        (OFF + "3 0 1 2\n", "line 8: expected nothing behind the last of 1 faces"),
        (OFF.replace("OFF", "OFF BINARY"), "binary OFF"),
        (OFF.replace("OFF", "4OFF"), "other than 3 numbers"),
        (OFF.replace("OFF", "nOFF\n3"), "other than 3 numbers"),
        (OFF.replace("OFF", "4nOFF\n3"), "other than 3 numbers"),
        (OFF.replace("OFF", "NCOFF"), "line 1: expected 'OFF'"),
        (OFF.replace("OFF", "COFF BINARY"), "binary OFF"),
        ("OFF 4 1 0 " + OFF_ROWS.replace("\n", " ") + "4 0 1 2 4", "declares 4 vertices and 1 faces"),
        ("OFF 4 1 0 " + OFF_ROWS.replace("\n", " ") + "4 0 1 2", "declares 4 vertices and 1 faces"),
        (
            "OFF 4 1000000000 0 " + OFF_ROWS.replace("\n", " ") + "4 0 1 2 3",
            "declares 4 vertices and 1000000000",
        ),
        (OFF.replace("4 1 0", "4 -1 0"), "line 2: "),
        ("", "ends before"),
        ("OFF\n", "ends before"),
    ],
)
def test_a_wrong_off_is_named(tmp_path: Path, content: str, reason: str) -> None:
    with pytest.raises(InvalidMesh, match=reason):
        read_mesh(written(tmp_path, "a.off", content))


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("second", [6, 8, None])
def test_ply_faces_with_a_second_list_are_all_read(tmp_path: Path, order: str, second: int | None) -> None:
    """As MeshLab writes texture coordinates of corners; None: as many as the face needs."""
    rng = np.random.default_rng(0)
    sizes = rng.integers(3, 5, 1000) if second is None else np.full(1000, (second or 6) // 2)
    form = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = (
        f"ply\nformat {form} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1000\nproperty uchar flags\nproperty list uchar int vertex_indices\n"
        "property list uchar float texcoord\nproperty uchar red\nend_header\n"
    )
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    if order:
        body = np.array(corners, order + "f4").tobytes()
        for size in sizes.tolist():
            body += struct.pack(f"{order}BB{size}i", 7, size, *range(size))
            body += struct.pack(f"{order}B{2 * size}fB", 2 * size, *[0.5] * (2 * size), 9)
    else:
        rows = [" ".join(map(str, row)) for row in corners]
        rows += [
            " ".join(map(str, [7, size, *range(size), 2 * size, *[0.5] * (2 * size), 9]))
            for size in sizes.tolist()
        ]
        body = "\n".join(rows).encode()
    path = written(tmp_path, "a.ply", head.encode() + body)
    assert len(read_mesh(path)[1]) == (sizes - 2).sum()
    assert area(path) == pytest.approx(((sizes - 2) * 0.5).sum())


def test_ply_of_odd_headers(tmp_path: Path) -> None:
    for content in (
        PLY.replace("\n", "\r"),
        PLY.replace("end_header\n", "comment end_header is not here\nobj_info x\nend_header  \n"),
        PLY.replace("element face", "element odd 0\nproperty list uchar int x\nelement face"),
        PLY.replace("vertex_indices", "vertex_index"),
        PLY.replace("property float z", "property float z\nproperty float quality").replace(
            " 0\n", " 0 nan\n"
        ),
    ):
        assert area(written(tmp_path, "a.ply", content)) == pytest.approx(1.0)
    for undefined in ("-nan(ind)", "NaN(snan)", "1.#QNAN", "-1.#IND00"):
        content = PLY.replace("float z", "float z\nproperty float nx").replace(" 0\n", f" 0 {undefined}\n")
        assert area(written(tmp_path, "a.ply", content)) == pytest.approx(1.0), undefined
    more = PLY.replace("4 0 1 2 3", "3 0 1 2 9 1 1 1\n3 0 2 3 9 2 2 2").replace("face 1", "face 2")
    assert area(written(tmp_path, "a.ply", more)) == pytest.approx(1.0), "more words than the header declares"
    twice = PLY.replace("float z\n", "float z\nproperty uchar quality\nproperty float quality\n")
    for row in ("0 0 0", "1 0 0", "1 1 0", "0 1 0"):
        twice = twice.replace(f"\n{row}\n", f"\n{row} 7 0.5\n")
    assert area(written(tmp_path, "a.ply", twice)) == pytest.approx(1.0), "of one name, the first counts"
    binary = PLY.replace("ascii", "binary_little_endian").partition("end_header\n")[0].encode()
    body = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4").tobytes()
    body += struct.pack("<B4i", 4, 0, 1, 2, 3)
    for end in (b"\n", b"\r\n"):
        path = written(tmp_path, "a.ply", binary + b"end_header" + end + body)
        assert area(path) == pytest.approx(1.0)
    for content, reason in (
        (PLY.replace("element face 1", "element face 2"), "ends within its 2 rows of 'face'"),
        (PLY.replace("4 0 1 2 3", "4 0 1 2 2.5"), "not whole"),
        (PLY.replace("1 1 0", "1 one 0"), "expected a number, got 'one'"),
        (PLY.replace("1 1 0", "1 -nan(ind) 0"), "finite"),
        (PLY.replace("face 1", "face four"), "claims 'four' rows"),
        (PLY.replace("property float z", "property float x"), "two properties 'x'"),
        (PLY.replace("element face", "element edges"), "no faces"),
        (PLY.replace("ascii", "binary_middle_endian"), "unknown format 'binary_middle_endian'"),
        (PLY.replace("float z", "quad z"), "unknown type 'quad'"),
        (PLY.replace("element vertex", "property float q\nelement vertex"), "'q' belongs to no element"),
    ):
        with pytest.raises(InvalidMesh, match=reason):
            read_mesh(written(tmp_path, "a.ply", content))


def test_ply_elements_of_one_name_may_have_other_properties(tmp_path: Path) -> None:
    face = "element face 1\nproperty list uchar int vertex_indices\n"
    head = PLY.replace(face, face + "property uchar red\n" + face).replace("4 0 1 2 3", "3 0 1 2 9\n3 0 2 3")
    assert area(written(tmp_path, "a.ply", head)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", lambda: binary_stl(2, 2, b"COLOR=\xff\x00\x00\xff"), "colours of facets"),
        ("a.obj", lambda: b"v 0 0 0\nv 1 0 0\nv 0 1 0\n#MRGB ffff0000ffff0000ffff0000\nf 1 2 3\n", "#MRGB"),
    ],
)
def test_colours_of_other_forms_are_left_out_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, name: str, content: Callable[[], bytes], message: str
) -> None:
    assert area(written(tmp_path, name, content())) > 0.4
    assert message in caplog.text


def test_what_is_left_out_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        read_mesh(written(tmp_path, "a.obj", V + "f 1 2 3\nf 1 2\nsurf 0 1 0 1 1 2 3\nf 1 3 2 4\n"))
    messages = "\n".join(record.getMessage() for record in caplog.records)
    for part in ("1 faces of fewer than three", "1 free-form", "1 faces cross themselves"):
        assert part in messages


STRIPS = (
    "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n{vertex}"
    "element face 1\nproperty list uchar int vertex_indices\n{face}element tristrips 1\n"
    "property list int int vertex_indices\n{strip}end_header\n{rows}4 0 1 2 3{red}\n4 4 5 7 6{blue}\n"
)
STRIP_ROWS = [f"{x} {y} {z}" for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
CHANNELS = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
CLAY_LIGHT = decode_srgb(np.array(CLAY))


@pytest.mark.parametrize(
    ("face", "strip"),
    [(True, False), (False, True), (True, True)],
    ids=["colours of faces", "colours of strips", "colours of both"],
)
def test_ply_faces_keep_their_colours_beside_strips(tmp_path: Path, face: bool, strip: bool) -> None:
    content = STRIPS.format(
        vertex="",
        face=CHANNELS if face else "",
        strip=CHANNELS if strip else "",
        rows="\n".join(STRIP_ROWS) + "\n",
        red=" 255 0 0" if face else "",
        blue=" 0 0 255" if strip else "",
    )
    mesh = read_mesh_data(written(tmp_path, "a.ply", content))
    assert mesh.color is not None
    assert mesh.color.colors is not None
    assert mesh.color.corners is not None
    light = mesh.color.colors[mesh.color.corners[:, 0]]
    above = mesh.vertices[mesh.faces[:, 0], 2] > 0.5
    assert above.sum() == 2
    assert light[~above] == pytest.approx(np.tile([1.0, 0, 0] if face else CLAY_LIGHT, (2, 1)), abs=1e-6)
    assert light[above] == pytest.approx(np.tile([0, 0, 1.0] if strip else CLAY_LIGHT, (2, 1)), abs=1e-6)


def test_ply_faces_keep_their_texture_beside_strips(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (0, 255, 0)).save(tmp_path / "green.png")
    content = STRIPS.format(
        vertex="", face="property list uchar float texcoord\n", strip="", rows="\n".join(STRIP_ROWS) + "\n",
        red=" 8 0 0 1 0 1 1 0 1", blue="",
    ).replace("1.0\n", "1.0\ncomment TextureFile green.png\n")  # fmt: skip
    mesh = read_mesh_data(written(tmp_path, "a.ply", content))
    assert mesh.color is not None
    light = mesh.color.light_at(mesh.faces, np.arange(len(mesh.faces)), np.full((len(mesh.faces), 3), 1 / 3))
    above = mesh.vertices[mesh.faces[:, 0], 2] > 0.5
    assert light[~above] == pytest.approx(np.tile([0.0, 1.0, 0.0], (2, 1)), abs=1e-6)
    assert light[above] == pytest.approx(np.ones((2, 3)), abs=1e-6)


def test_colours_of_ply_faces_under_those_of_vertices_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    content = STRIPS.format(
        vertex=CHANNELS, face=CHANNELS, strip="", rows="".join(f"{row} 0 255 0\n" for row in STRIP_ROWS),
        red=" 255 0 0", blue="",
    )  # fmt: skip
    color = read_mesh_data(written(tmp_path, "a.ply", content)).color
    assert color is not None
    assert color.simplified == (0.0, 1.0, 0.0)
    assert "colours of faces are left out: those of vertices count" in caplog.text


SEVENTH = "v 0 0 0 {0}\nv 1 0 0 {1}\nv 1 1 0 {2}\nv 0 1 0 {2}\nf 1 2 3 4\n"


@pytest.mark.parametrize(
    ("paints", "expected", "reading"),
    [
        (["1 1 0 0", "1 0 1 0", "1 0 0 1"], "red green blue", "w r g b"),
        (["1 0 0 1", "0 1 0 1", "0 0 1 1"], "red green blue", "r g b a"),
        (["1 0 0 0.5", "0 1 0 0.25", "0 0 1 0"], "red green blue", "r g b a"),
        (["1.0 1 0 0"] * 3, "red red red", "w r g b"),
        (["1 0 0 1"] * 3, "red red red", "r g b a"),
        (["0 0 1 0"] * 3, "blue blue blue", "r g b a"),
    ],
)
def test_seven_numbers_of_an_obj_vertex(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, paints: list[str], expected: str, reading: str
) -> None:
    mesh = read_mesh_data(written(tmp_path, "a.obj", SEVENTH.format(*paints)))
    assert mesh.color is not None
    light = mesh.color.at_vertices(mesh.faces, 4)
    named = {"red": [1, 0, 0], "green": [0, 1, 0], "blue": [0, 0, 1]}
    assert light[:3] == pytest.approx(np.array([named[name] for name in expected.split()], float), abs=1e-6)
    assert f"vertices have 7 numbers: read as x y z {reading}" in caplog.text


def test_eight_and_more_numbers_of_an_obj_vertex(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    mesh = read_mesh_data(written(tmp_path, "a.obj", SEVENTH.format(*["1 0 0 1 0.5"] * 3)))
    assert mesh.color is not None
    assert mesh.color.at_vertices(mesh.faces, 4) == pytest.approx(np.tile([0.0, 0.0, 1.0], (4, 1)))
    assert "numbers" not in caplog.text
    assert read_mesh_data(written(tmp_path, "b.obj", SEVENTH.format(*["1 0 0 1 0 0"] * 3))).color is None
    assert "colours of vertices are left out: lines of 9 numbers" in caplog.text


@pytest.mark.parametrize("paint", ["255 0 0", "255 0 0 255", "1 0 0", "1.0 0.0 0.0 1.0"])
@pytest.mark.parametrize("of_vertices", [True, False])
def test_colours_of_off(tmp_path: Path, paint: str, of_vertices: bool) -> None:
    rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    content = f"OFF\n4 1 0\n{rows}4 0 1 2 3 {paint}\n"
    if of_vertices:
        painted = rows.replace("\n", f" 0 0 1 {paint}\n")
        content = f"CNOFF\n4 1 0\n{painted}4 0 1 2 3\n"
    mesh = read_mesh_data(written(tmp_path, "a.off", content))
    assert mesh.color is not None
    assert mesh.color.simplified == (1.0, 0.0, 0.0)
    assert len(mesh.color) == (4 if of_vertices else 2)


def test_off_faces_without_a_colour_have_the_usual_one(tmp_path: Path) -> None:
    faces = "3 0 1 2 255 0 0\n3 0 2 3\n"
    path = written(tmp_path, "a.off", OFF.replace("4 1 0", "4 2 0").replace("4 0 1 2 3\n", faces))
    color = read_mesh_data(path).color
    assert color is not None
    assert color.corners is not None
    assert color.colors is not None
    light = color.colors[color.corners[:, 0]]
    usual = decode_srgb(np.array(CLAY))
    assert light == pytest.approx(np.stack([np.array([1.0, 0.0, 0.0]), usual]), abs=1e-6)


def test_off_without_whole_colours_is_read_without_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert read_mesh_data(written(tmp_path, "a.off", OFF.replace("4 0 1 2 3", "4 0 1 2 3 7"))).color is None
    assert read_mesh_data(written(tmp_path, "a.off", OFF.replace("OFF", "COFF"))).color is None
    assert "Left out the colours" in caplog.text


@pytest.mark.parametrize(
    "content", [b"", b" \n\n", b"\xff\xfe", "\n \n".encode("utf-16"), b"\xef\xbb\xbf\n" * 60]
)
def test_an_stl_file_of_blanks_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "blank.stl"
    path.write_bytes(content)
    with pytest.raises(InvalidMesh, match=r"blank\.stl"):
        read_mesh(path)
