"""OBJ, PLY, STL and OFF files in the forms that programs write, and broken ones."""

import random
import re
import struct
from itertools import chain

import numpy as np

from tests.structured.model import PolygonMesh, StructuredFile, random_mesh
from tests.structured.text import NUMBERS, WORDS, damaged, encoded, spaced

BROKEN = 0.45
"""Share of broken files."""


def _finished(file: StructuredFile, chance: random.Random) -> StructuredFile:
    """Return a file as it is, or damaged."""
    return file.broken(damaged(file.content, chance)) if chance.random() < BROKEN else file


# -- OBJ ------------------------------------------------------------------------------------------------


def obj(chance: random.Random) -> StructuredFile:
    """Return an OBJ file: references of all forms, groups, comments, continued lines, broken references."""
    mesh = random_mesh(chance)
    number = chance.choice(NUMBERS)
    points = [["v", *map(number, point)] for point in mesh.points.tolist()]
    if count := chance.choice([0] * 14 + [1, 1, 3, 3, 4, 5]):
        points = [[*words, *(number(chance.random()) for _ in range(count))] for words in points]
    textures, normals = chance.choice([(0, 0), (5, 0), (0, 5), (5, 5)])
    head = [["vt", number(k / 5), "0.5"] for k in range(textures)]
    head += [["vn", "0", "0", number(1.0)] for _ in range(normals)]
    faces = _obj_faces(mesh, (textures, normals), chance)
    blocks = [points, head, faces]
    if not any("-" in word for face in faces for word in face):
        chance.shuffle(blocks)  # absolute references may come before what they name
    rows = [words for block in blocks for words in block]
    valid = True
    if chance.random() < BROKEN / 2:
        valid = not _obj_break(rows, mesh, chance)
    text = "".join(_obj_line(words, chance) for words in _obj_noise(rows, chance))
    if chance.random() < 0.2:
        text = text.rstrip("\n")
    file = StructuredFile(".obj", encoded(text, chance), mesh)
    return _finished(file, chance) if valid else file.broken(file.content)


def _obj_faces(mesh: PolygonMesh, counts: tuple[int, int], chance: random.Random) -> list[list[str]]:
    textures, normals = counts
    relative = chance.random() < 0.25
    mixed = chance.random() < 0.3
    form = chance.randrange(4)
    faces = []
    for polygon in mesh.polygons:
        words = ["f"]
        for corner in polygon:
            form = chance.randrange(4) if mixed else form
            parts = [corner - len(mesh.points) if relative else corner + 1]
            texture = chance.randint(1, textures) if textures and form in (1, 3) else None
            normal = chance.randint(1, normals) if normals and form in (2, 3) else None
            word = str(parts[0])
            if normal is not None:
                word += f"/{'' if texture is None else texture}/{normal}"
            elif texture is not None:
                word += f"/{texture}"
            words.append(word)
        faces.append(words)
    return faces


def _obj_break(rows: list[list[str]], mesh: PolygonMesh, chance: random.Random) -> bool:
    """Change one face so that it asks for what the file does not have; return True if it was changed."""
    faces = [words for words in rows if words[0] == "f"]
    words = chance.choice(faces)
    count = len(mesh.points)
    wrong = [0, count + 1, -count - 1, 10**6, 10**12, -(10**9)]
    place = chance.randrange(1, len(words))
    first = words[place].split("/")[0]
    words[place] = chance.choice(
        [
            str(chance.choice(wrong)),
            f"{first}/{chance.choice([9, 0, -9, 10**6])}",
            f"{first}//{10**6}",
            f"{first}/1/1/1",
        ]
    )
    return True


def _obj_noise(rows: list[list[str]], chance: random.Random) -> list[list[str]]:
    """Return the rows with lines between them that mean nothing for the shape."""
    noise = [
        ["#", "comment", "f 1 2 3"], ["o", chance.choice(WORDS)], ["g", "a", "b"], ["g"], ["usemtl"], [""],
        ["usemtl", chance.choice(WORDS)], ["mtllib", "none here.mtl"], ["s", "off"], ["s", "1"],
        ["unknown", "1"], ["l", "1", "2"], ["p", "1"],
    ]  # fmt: skip
    found: list[list[str]] = []
    for words in rows:
        if chance.random() < 0.1:
            found.append(chance.choice(noise))
        found.append(words)
    return found


def _obj_line(words: list[str], chance: random.Random) -> str:
    line = spaced(words, chance)
    if words[0] in ("f", "v") and chance.random() < 0.04:
        cut = chance.randrange(1, len(words))
        line = " ".join(words[:cut]) + " \\\n" + " ".join(words[cut:])
    if words[0] in ("f", "v", "vt") and chance.random() < 0.05:
        line += "# end"
    return line + "\n"


# -- PLY ------------------------------------------------------------------------------------------------

_KINDS = [
    ("char", "int8", "b"), ("uchar", "uint8", "B"), ("short", "int16", "h"), ("ushort", "uint16", "H"),
    ("int", "int32", "i"), ("uint", "uint32", "I"), ("float", "float32", "f"), ("double", "float64", "d"),
]  # fmt: skip
_CODES = {name: code for name, _, code in _KINDS}
_ALIASES = {name: alias for name, alias, _ in _KINDS}


def ply(chance: random.Random) -> StructuredFile:
    """Return a PLY file: each byte order, odd types, further properties, lists and elements."""
    mesh = random_mesh(chance)
    order = chance.choice(["", "<", ">"])
    number = chance.choice(NUMBERS)
    axis = chance.choice(["float", "double"])
    before, after = _extras(chance), _extras(chance)
    index, count = (
        chance.choice(["int", "uint", "short", "ushort"]),
        chance.choice(["uchar", "int", "ushort", "uint"]),
    )
    lists = chance.sample(["texcoord", "weights"], chance.choice([0, 0, 1, 2]))
    tables: list[tuple[str, list[tuple[str, ...]], list[list[object]]]] = []
    vertices = [[1] * len(before) + point + [1] * len(after) for point in mesh.points.tolist()]
    properties = [*before, *((axis, name) for name in "xyz"), *after]
    tables.append(("vertex", properties, vertices))
    face_properties: list[tuple[str, ...]] = [("uchar", "flags")] if chance.random() < 0.3 else []
    flags = [1] * len(face_properties)
    face_properties += [("list", count, index, chance.choice(["vertex_indices", "vertex_index"]))]
    face_properties += [("list", "uchar", "float", name) for name in lists]
    extra = chance.choice([None, 6])
    faces = [
        [*flags, list(loop), *([0.5] * (2 * len(loop) if extra is None else extra) for _ in lists)]
        for loop in mesh.polygons
    ]
    tables.append(("face", face_properties, faces))
    if chance.random() < 0.3:
        edges: tuple[str, list[tuple[str, ...]], list[list[object]]]
        edges = ("edge", [("int", "vertex1"), ("list", "uchar", "double", "more")], [[0, [1.5, 2]], [1, []]])
        tables.insert(chance.randrange(3), edges)
    if chance.random() < BROKEN / 2:
        loop = chance.choice(faces)[len(flags)]
        assert isinstance(loop, list)
        loop[chance.randrange(len(loop))] = min(chance.choice([len(mesh.points), 30000]), 32767)
        return StructuredFile(".ply", _ply_content(tables, order, number, chance), None)
    return _finished(StructuredFile(".ply", _ply_content(tables, order, number, chance), mesh), chance)


def _extras(chance: random.Random) -> list[tuple[str, ...]]:
    names = chance.sample(["nx", "red", "quality", "s", "confidence"], chance.choice([0, 0, 1, 3]))
    return [(chance.choice(list(_CODES)), f"{name}{chance.randrange(1000)}") for name in names]


def _ply_content(
    tables: list[tuple[str, list[tuple[str, ...]], list[list[object]]]],
    order: str,
    number: object,
    chance: random.Random,
) -> bytes:
    form = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    aliases = _ALIASES if chance.random() < 0.3 else {}
    lines = ["ply", f"format {form} 1.0"]
    for name, properties, rows in tables:
        if chance.random() < 0.3:
            lines.append(chance.choice(["comment end_header is below", "obj_info made by hand", "comment"]))
        lines.append(f"element {name} {len(rows)}")
        lines += ["property " + " ".join(aliases.get(word, word) for word in prop) for prop in properties]
    text = "\n".join([*lines, "end_header", ""])
    if not order:
        more = ["9", "1", "1"] if chance.random() < 0.2 else []  # beyond what the header declares
        words = [[*_ply_words(row, number), *more] for _, _, rows in tables for row in rows]
        return encoded(text + "".join(spaced(line, chance) + "\n" for line in words), chance)
    end = chance.choice(["\n", "\n", "\r\n"])
    body = b"".join(
        _ply_bytes(value, prop, order)
        for _, properties, rows in tables
        for row in rows
        for value, prop in zip(row, properties, strict=True)
    )
    return text.replace("\n", end).encode() + body


def _ply_words(row: list[object], number: object) -> list[str]:
    assert callable(number)
    words: list[str] = []
    for value in row:
        if isinstance(value, list):
            words += [str(len(value)), *map(str, value)]
        else:
            words.append(number(value) if isinstance(value, float) else str(value))
    return words


def _ply_bytes(value: object, prop: tuple[str, ...], order: str) -> bytes:
    if isinstance(value, list):
        return struct.pack(order + _CODES[prop[1]] + _CODES[prop[2]] * len(value), len(value), *value)
    return struct.pack(order + _CODES[prop[0]], value)


# -- STL ------------------------------------------------------------------------------------------------


def stl(chance: random.Random) -> StructuredFile:
    """Return an STL file: binary or ASCII, of several solids, in upper case, with odd names."""
    mesh = random_mesh(chance, largest=3)
    rounded = PolygonMesh(mesh.points.astype(np.float32).astype(np.float64), mesh.polygons)
    facets = [rounded.points[list(loop)] for loop in rounded.polygons]
    if chance.random() < 0.4:
        header = chance.choice([b"binary", b"solid of a binary file", b"", b"\0\1\2"]).ljust(
            80, chance.choice([b" ", b"\0"])
        )
        rows = b"".join(struct.pack("<12fH", 0, 0, 1, *facet.ravel().tolist(), 7) for facet in facets)
        content = header + struct.pack("<I", len(facets)) + rows
        if chance.random() < BROKEN / 2:
            wrong = chance.choice([len(facets) + 1, 1 << 31, (1 << 32) - 1])
            return StructuredFile(".stl", header + struct.pack("<I", wrong) + rows, None)
        return _finished(StructuredFile(chance.choice([".stl", ".STL"]), content, rounded), chance)
    number = chance.choice(NUMBERS)
    lines: list[str] = []
    name = chance.choice([name for name in WORDS if "\\" not in name])
    split = chance.randrange(len(facets)) if chance.random() < 0.3 else -1
    lines.append(f"solid {name}")
    for row, facet in enumerate(facets):
        if row == split:
            lines += [f"endsolid {name}", "", "solid another"]
        normal = chance.choice(["0 0 1", "0.0 -0.0 1e0", "nan nan nan"])
        loop = [f"vertex {' '.join(map(number, corner))}" for corner in facet.tolist()]
        lines += [f"facet normal {normal}", "outer loop", *loop, "endloop", "endfacet"]
    lines.append(chance.choice([f"endsolid {name}", "endsolid"]))
    bare = chance.choice([0.0, 0.0, 0.5, 1.0])
    lines = [line if chance.random() >= bare else re.sub("^facet normal .*", "facet", line) for line in lines]
    gap = "\n" if chance.random() < 0.85 or any(word in name for word in ("solid", "#")) else " "
    text = gap.join(spaced(line.split(" "), chance) for line in lines) + chance.choice(["", "\n", "\n\n"])
    if chance.random() < 0.3:
        text = text.upper()
    return _finished(StructuredFile(".stl", encoded(text, chance), rounded), chance)


def _rearranged(rows: list[list[str]], chance: random.Random) -> list[list[str]]:
    """Return the words of rows as they are, on one line, or one a line."""
    words = list(chain.from_iterable(rows))
    return chance.choice([rows, [words], [[word] for word in words]])


# -- OFF ------------------------------------------------------------------------------------------------


def off(chance: random.Random) -> StructuredFile:
    """Return an OFF file: all keywords, counts in several places, colours of faces, broken references."""
    mesh = random_mesh(chance)
    number = chance.choice(NUMBERS)
    texture, color, normal = (chance.random() < 0.3 for _ in range(3))
    keyword = "ST" * texture + "C" * color + "N" * normal + "OFF"
    counts = f"{len(mesh.points)} {len(mesh.polygons)}" + chance.choice([" 0", " 12", ""])
    extra = ["0"] * (3 * normal) + ["255"] * (chance.choice([3, 4]) * color) + ["0.5"] * (2 * texture)
    rows = [[*map(number, point), *extra] for point in mesh.points.tolist()]
    faces = [[str(len(loop)), *map(str, loop)] for loop in mesh.polygons]
    paint = chance.choice([[], [], ["3"], ["255", "0", "0"], ["0.5", "0.5", "0.5", "1.0"]])
    faces = [[*words, *paint] for words in faces]
    if broken := chance.random() < BROKEN / 2:
        words = chance.choice(faces)
        words[chance.randrange(len(words) - len(paint))] = str(
            chance.choice([len(mesh.points), -1, 99, 10**12])
        )
    head = chance.choice([[keyword, counts], [keyword, "# comment", "", counts], [f"{keyword} {counts}"]])
    if keyword == "OFF" and chance.random() < 0.1:
        head = chance.choice([[counts], [f"OFF{counts}"]])
    lines = [*head, *(spaced(words, chance) for words in [*rows, *faces])]
    if not paint and all(len(loop) > 2 for loop in mesh.polygons) and chance.random() < 0.2:
        parts = [_rearranged(rows, chance), _rearranged(faces, chance)]
        lines = [*head, *(spaced(words, chance) for words in chain.from_iterable(parts))]
    if chance.random() < 0.3:
        lines = [line + chance.choice(["", " # comment", "\n\n", "\n# 1 2 3"]) for line in lines]
    file = StructuredFile(".off", encoded("\n".join(lines) + chance.choice(["", "\n"]), chance), mesh)
    return file.broken(file.content) if broken else _finished(file, chance)
