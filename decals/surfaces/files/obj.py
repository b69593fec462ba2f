"""Reader of Wavefront OBJ files: vertices and polygons, in all forms of reference."""

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from decals.surfaces.files.content import (
    Line,
    file_bytes,
    parsed,
    points_of,
    refusal,
    text_lines,
    whole_numbers,
)
from decals.surfaces.files.obj_colors import ObjColors
from decals.surfaces.files.paint import Paint
from decals.surfaces.triangulate import Polygons

_logger = logging.getLogger(__name__)

ABSENT = np.iinfo(np.int64).min
"""Stands for a reference that a corner does not have."""

_REFERRED = {b"v": "vertex", b"vt": "texture coordinate", b"vn": "normal"}
"""What the references of a corner name, in turn."""

_MATERIAL = (b"mtllib", b"usemtl")
"""Keywords of materials."""

_NAMED = (*_MATERIAL, b"o", b"g")
"""Keywords that names follow."""

_NUMBERS = (*_REFERRED, b"f", b"fo")
"""Keywords that numbers follow, of the lines that are read."""

_FREE_FORM = (b"surf", b"curv", b"curv2")
"""Keywords of curves and surfaces that are not polygons."""


def read_obj(path: Path) -> tuple[Float64Array, Polygons, Paint]:
    """Read the vertices and polygons of an OBJ file, and how to colour them.

    Free-form curves and surfaces are left out with a line in the log.

    Raises
    ------
    InvalidMesh
        If a line is wrong, or asks for what the file does not have. The message names the line.
    """
    try:
        return _read(file_bytes(path), path)
    except (ValueError, MemoryError) as error:
        raise refusal(path, "OBJ", error) from error


PARTS = (b"o", b"g", b"usemtl")
"""Keywords of objects, groups and materials, which name the faces below them."""


def obj_parts(path: Path, keyword: bytes) -> list[tuple[str, Int64Array]]:
    """Return the names after one of `PARTS` in an OBJ file, and the numbers of the faces below, if any."""
    lines = _lines_by_keyword(text_lines(file_bytes(path)))
    names = [b"", *(line.text.strip() for line in lines[keyword])]
    of_face = np.searchsorted([line.number for line in lines[keyword]], [line.number for line in lines[b"f"]])
    numbered = ((name, np.flatnonzero(of_face == number)) for number, name in enumerate(names))
    return [(name.decode("utf-8", "replace") or "unnamed", rows) for name, rows in numbered if len(rows)]


def _read(content: bytes, path: Path) -> tuple[Float64Array, Polygons, Paint]:
    texts = text_lines(content)
    lines = _lines_by_keyword(texts)
    faces = lines[b"f"]
    sizes = np.array([len(line.text.split()) for line in faces], np.int64)
    if faces and sizes[-1] < 3 and texts[-1] and faces[-1].number == len(texts):
        raise faces[-1].fail(f"the file ends within a face of {sizes[-1]} corners")
    references = parsed(faces, _references, "corners such as 1, 1/1, 1//1 or 1/1/1")
    corners = [
        _resolved(references[:, column], lines[keyword], faces, sizes, noun)
        for column, (keyword, noun) in enumerate(_REFERRED.items())
    ]
    if others := sum(len(lines[keyword]) for keyword in _FREE_FORM):
        _logger.warning("%s: left out %d free-form curves and surfaces; only polygons are read", path, others)
    if b"#MRGB" in content:
        _logger.warning("%s: left out the colours that ZBrush writes as comments (#MRGB)", path)
    paint = ObjColors(path, lines, corners[0], corners[1])
    return points_of(lines[b"v"]), Polygons(corners[0], sizes), paint


def _lines_by_keyword(texts: Sequence[bytes]) -> dict[bytes, list[Line]]:
    """Return the lines of the keywords that are read, without the keywords and without comments.

    Lines with names stay whole, since names such as "Material #25" are usual.
    """
    lines: dict[bytes, list[Line]] = {keyword: [] for keyword in (*_REFERRED, b"f", *_NAMED, *_FREE_FORM)}
    known = {**lines, b"fo": lines[b"f"]}  # the old name of a face
    for number, text in _whole_lines(texts):
        keyword, _, rest = text.strip().replace(b"\t", b" ").partition(b" ")
        if (found := known.get(keyword)) is not None:
            found.append(Line(number, rest if keyword in _NAMED else rest.partition(b"#")[0]))
    return lines


def _whole_lines(texts: Sequence[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield lines with their numbers; numbers that end with a backslash go on in the next line."""
    parts: list[bytes] = []
    start = 1
    for number, text in enumerate(texts, 1):
        if b"\\" in text and _goes_on(text, first=not parts):
            start = start if parts else number
            parts.append(text.rstrip()[:-1])
        elif parts:
            yield start, b" ".join([*parts, text])
            parts.clear()
        else:
            yield number, text
    if parts:
        yield start, b" ".join(parts)


def _goes_on(text: bytes, *, first: bool) -> bool:
    """Return True if a backslash continues a line; those that end comments and names do not."""
    if not text.rstrip().endswith(b"\\") or b"#" in text:
        return False
    keyword = text.split(None, 1)[0].removesuffix(b"\\")
    return not first or keyword in _NUMBERS or (keyword == b"mtllib" and text.split()[-1] == b"\\")


def _references(faces: list[Line]) -> Int64Array:
    """Return the references of all corners as written, ``int64[k, 3]``."""
    joined = b" ".join([face.text for face in faces])
    rest = joined.split()
    references = np.full((len(rest), 3), ABSENT, np.int64)
    alike = {corner.count(b"/") for corner in rest}
    numbers = joined.replace(b"/", b" ").split()
    for columns in ([0], [0, 1], [0, 1, 2]):  # most files have corners of one form
        if alike == {len(columns) - 1} and len(numbers) == len(rest) * len(columns):
            references[:, columns] = whole_numbers(numbers).reshape(-1, len(columns))
            return references
    for column in range(3):
        parts = [corner.partition(b"/")[::2] for corner in rest]
        given = [row for row, (word, _) in enumerate(parts) if word or column == 0]
        references[given, column] = whole_numbers([parts[row][0] for row in given])
        rest = [after for _, after in parts]
    if any(rest):
        raise ValueError
    return references


def _resolved(
    written: Int64Array, named: list[Line], faces: list[Line], sizes: Int64Array, noun: str
) -> Int64Array:
    """Return references as indices from 0 on; negative ones count back from the last line before the face."""
    face = np.repeat(np.arange(len(faces)), sizes)
    before = np.searchsorted([line.number for line in named], [line.number for line in faces])[face]
    places = np.where(written > 0, written - 1, before + written)
    given = written != ABSENT
    wrong = given & ((written == 0) | (places < 0) | (places >= len(named)))
    if wrong.any():
        first = int(np.argmax(wrong))
        there = f"{before[first]} before it" if written[first] < 0 else len(named)
        raise faces[face[first]].fail(
            f"a face asks for {noun} {written[first]}, but the file has {there}; the first has number 1"
        )
    return np.where(given, places, ABSENT)
