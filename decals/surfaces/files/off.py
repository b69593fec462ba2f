"""Reader of OFF files (Geomview): text, with or without normals, colours and texture coordinates."""

import re
from itertools import chain
from pathlib import Path

from blobtree._typing import Float64Array
from decals.surfaces.files.content import (
    Line,
    file_bytes,
    parsed,
    points_of,
    refusal,
    shown,
    text_lines,
    whole_numbers,
)
from decals.surfaces.triangulate import Polygons

_KEYWORD = re.compile(rb"(ST)?C?N?(?P<space>4?n?)OFF", re.IGNORECASE)


def read_off(path: Path) -> tuple[Float64Array, Polygons]:
    """Read the vertices and polygons of an OFF file.

    Raises
    ------
    InvalidMesh
        If the file is binary or has other than three dimensions, or a line of it is wrong.
    """
    try:
        return _read(file_bytes(path))
    except (ValueError, MemoryError) as error:
        raise refusal(path, "OFF", error) from error


def _read(content: bytes) -> tuple[Float64Array, Polygons]:
    if re.match(rb"[^\n]{0,20}OFF\s+BINARY", content, re.IGNORECASE):
        raise ValueError("it is a binary OFF file; only text is read")
    lines = [
        Line(number, text)
        for number, line in enumerate(text_lines(content), 1)
        if (text := line.partition(b"#")[0].strip())
    ]
    points, faces, lines = _counts(lines)
    if len(lines) < points + faces:
        raise ValueError(
            f"it declares {points} vertices and {faces} faces and has {len(lines)} lines for them"
        )
    if len(lines) > points + faces:
        raise lines[points + faces].expected(f"nothing behind the last of {faces} faces")
    return points_of(lines[:points]), _polygons(lines[points:], points)


def _counts(lines: list[Line]) -> tuple[int, int, list[Line]]:
    """Return the numbers of vertices and of faces, and the lines behind them; check the keyword."""
    keyword = _KEYWORD.match(lines[0].text) if lines else None
    if keyword:
        if keyword["space"]:
            raise ValueError(f"its keyword {shown(keyword[0])} stands for points of other than 3 numbers")
        rest = lines[0].text[keyword.end() :]  # some programs write "OFF8 6 12"
        lines = [Line(lines[0].number, rest), *lines[1:]] if rest else lines[1:]
    if not lines:
        raise ValueError("it ends before its numbers of vertices and faces")
    points, faces = parsed(lines[:1], _two_counts, "'OFF', and the numbers of vertices and faces")
    return points, faces, lines[1:]


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
