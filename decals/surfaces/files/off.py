"""Reader of OFF files (Geomview): text, with or without normals, colours and texture coordinates."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals.images.texels import decode_srgb
from decals.surfaces.base_color import CLAY, BaseColor, linear_colors
from decals.surfaces.files.content import (
    Line,
    file_bytes,
    finite_numbers,
    parsed,
    points_of,
    refusal,
    shown,
    text_lines,
    whole_numbers,
)
from decals.surfaces.files.paint import Paint
from decals.surfaces.triangulate import Polygons, Triangulation

_FORM = rb"(?P<place>(ST)?)(?P<color>C?)(?P<normal>N?)"
_KEYWORDS = (
    re.compile(_FORM + rb"(?P<space>4?n?)OFF"),
    re.compile(_FORM + rb"(?P<space>4?)OFF", re.IGNORECASE),
)
"""The keyword as it is written, where a small "n" means any number of dimensions; or in other letters."""


MAX_DIGITS = 9
"""Digits of a number of corners, at most."""


def read_off(path: Path) -> tuple[Float64Array, Polygons, Paint]:
    """Read the vertices and polygons of an OFF file, with their colours.

    Raises
    ------
    InvalidMesh
        If the file is binary or has other than three dimensions, or a line of it is wrong.
    """
    try:
        return _read(file_bytes(path))
    except (ValueError, MemoryError) as error:
        raise refusal(path, "OFF", error) from error


def _read(content: bytes) -> tuple[Float64Array, Polygons, Paint]:
    if re.match(rb"[^\n]{0,20}OFF\s+BINARY", content, re.IGNORECASE):
        raise ValueError("it is a binary OFF file; only text is read")
    lines = [
        Line(number, text)
        for number, line in enumerate(text_lines(content), 1)
        if (text := line.partition(b"#")[0].strip())
    ]
    keyword, lines = _keyword(lines)
    points, faces, lines, edges = _counts(lines)
    if len(lines) != points + faces:
        for rows in _of_words(keyword, points, faces, lines, edges=edges):
            try:
                return _of_lines(keyword, points, faces, rows)
            except ValueError:
                continue
    return _of_lines(keyword, points, faces, lines)


@dataclass(frozen=True)
class _Keyword:
    """What the lines of vertices hold: the place of the first colour, and how many numbers there may be."""

    first_color: int | None = None
    widths: tuple[int, ...] = (3,)


def _keyword(lines: list[Line]) -> tuple[_Keyword, list[Line]]:
    """Return what the keyword says, and the lines without it; without a keyword, what OFF says."""
    found = next((match for form in _KEYWORDS if lines and (match := form.match(lines[0].text))), None)
    if found is None:
        return _Keyword(), lines
    if found["space"]:
        raise ValueError(f"its keyword {shown(found[0])} stands for points of other than 3 numbers")
    rest = lines[0].text[found.end() :]  # some programs write "OFF8 6 12"
    width = 3 + 3 * len(found["normal"])
    places = 2 * bool(found["place"])
    keyword = (
        _Keyword(width, (width + 4 + places, width + 3 + places))
        if found["color"]
        else _Keyword(None, (width + places,))
    )
    return keyword, [Line(lines[0].number, rest), *lines[1:]] if rest.strip() else lines[1:]


def _of_lines(
    keyword: _Keyword, points: int, faces: int, lines: list[Line]
) -> tuple[Float64Array, Polygons, Paint]:
    """Return what lines of one vertex or face each hold."""
    if len(lines) < points + faces:
        raise ValueError(
            f"it declares {points} vertices and {faces} faces and has {len(lines)} lines for them"
        )
    if len(lines) > points + faces:
        raise lines[points + faces].expected(f"nothing behind the last of {faces} faces")
    polygons = _polygons(lines[points:], points)
    first = keyword.first_color
    colors = [] if first is None else [line.text.split()[first:][:3] for line in lines[:points]]
    paint = partial(_painted, colors, lines[points:], polygons.sizes)
    return points_of(lines[:points]), polygons, paint


def _of_words(
    keyword: _Keyword, points: int, faces: int, lines: list[Line], *, edges: bool
) -> Iterator[list[Line]]:
    """Yield a line for each vertex and face of a file whose own lines end elsewhere.

    The first word may be the number of edges, which usually stands beside the two other numbers.
    """
    first, _, rest = lines[0].text.strip().partition(b" ") if lines else (b"", b"", b"")
    if edges and first.isdigit():
        behind = [Line(lines[0].number, rest), *lines[1:]] if rest else lines[1:]
        yield behind
        yield from _of_words(keyword, points, faces, behind, edges=False)
    words = [Line(line.number, word) for line in lines for word in line.text.split()]
    for width in keyword.widths:
        end = points * width
        if end > len(words):
            continue
        vertices = [_line(words[k : k + width]) for k in range(0, end, width)]
        counts = np.cumsum([len(line.text.split()) for line in lines])
        row = int(np.searchsorted(counts, end, side="right")) if end else 0
        whole = len(lines) - row == faces and end == (counts[row - 1] if row else 0)
        if whole and any(_size(line.text.split()[0]) >= 3 for line in lines[row:]):  # they may have colours
            yield [*vertices, *lines[row:]]
        yield [*vertices, *_face_rows(words[end:])]


def _face_rows(words: list[Line]) -> Iterator[Line]:
    """Yield the words of each face: a number of corners and as many vertices."""
    place = 0
    while place < len(words):
        size = _size(words[place].text)
        if size < 3:  # so that a file with a missing line is not read as another mesh
            return
        yield _line(words[place : place + 1 + size])
        place += 1 + size


def _size(word: bytes) -> int:
    """Return the number of corners that a word states, or 0."""
    return int(word) if word.isdigit() and len(word) < MAX_DIGITS else 0


def _line(words: list[Line]) -> Line:
    """Return words as one line; an empty one if a file ends before them."""
    return Line(words[0].number, b" ".join(word.text for word in words)) if words else Line(0, b"")


def _counts(lines: list[Line]) -> tuple[int, int, list[Line], bool]:
    """Return the numbers of vertices and of faces, the lines behind them, and if that of edges may follow."""
    if not lines:
        raise ValueError("it ends before its numbers of vertices and faces")
    words = lines[0].text.split()
    if len(words) == 1 and len(lines) > 2:  # each number has a line of its own
        return _counts([Line(lines[0].number, words[0] + b" " + lines[1].text), *lines[2:]])
    points, faces = parsed(lines[:1], _two_counts, "'OFF', and the numbers of vertices and faces")
    if len(words) < 4 or len(lines) - 1 == points + faces:
        return points, faces, lines[1:], len(words) == 2  # some programs leave edges out
    return points, faces, [Line(lines[0].number, b" ".join(words[2:])), *lines[1:]], True


def _two_counts(lines: list[Line]) -> tuple[int, int]:
    points, faces = whole_numbers(lines[0].text.split()[:2]).tolist()
    if min(points, faces) < 0:
        raise ValueError
    return points, faces


def _polygons(lines: list[Line], points: int) -> Polygons:
    def corners(some: list[Line]) -> Polygons:
        sizes = whole_numbers(line.text.split(None, 1)[0] for line in some)
        words = (
            line.text.split()[1 : 1 + max(size, 0)] for line, size in zip(some, sizes.tolist(), strict=True)
        )
        found = whole_numbers(chain.from_iterable(words))
        if len(found) != sizes.sum() or (sizes < 0).any() or ((found < 0) | (found >= points)).any():
            raise ValueError
        return Polygons(found, sizes)

    return parsed(lines, corners, f"a number of corners, and as many vertices from 0 to {points - 1}")


def _painted(
    vertices: list[list[bytes]], faces: list[Line], sizes: Int64Array, triangles: Triangulation
) -> BaseColor | None:
    """Return the colours of vertices, or of faces; None without either."""
    if vertices:
        return BaseColor(_light(vertices, "vertices"))
    colors = [line.text.split()[1 + size :] for line, size in zip(faces, sizes.tolist(), strict=True)]
    colored = np.array([len(words) in (3, 4) for words in colors], np.bool_)  # one number is of a palette
    if not colored.any():
        return None
    light = np.tile(decode_srgb(np.array(CLAY)), (len(colors), 1))
    light[colored] = _light([colors[k][:3] for k in np.flatnonzero(colored)], "faces")
    return BaseColor.of_faces(light[triangles.polygons])


def _light(colors: list[list[bytes]], what: str) -> Float32Array:
    """Return linear light of colours: bytes if any is above 1 and none has a fraction, else from 0 to 1."""
    words = list(chain.from_iterable(colors))
    values = finite_numbers(words).reshape(-1, 3)
    levels = 255.0 if not any(b"." in word for word in words) and values.max() > 1.0 else 1.0
    return linear_colors(values, levels=levels, name=f"colours of {what}")
