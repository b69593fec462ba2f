"""Reader of OFF files (Geomview): text, with or without normals, colours and texture coordinates."""

import re
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

_KEYWORD = re.compile(rb"(ST)?(?P<color>C?)(?P<normal>N?)(?P<space>4?n?)OFF", re.IGNORECASE)


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
    first_color = _first_color(lines)
    points, faces, lines = _counts(lines)
    if len(lines) < points + faces:
        raise ValueError(
            f"it declares {points} vertices and {faces} faces and has {len(lines)} lines for them"
        )
    if len(lines) > points + faces:
        raise lines[points + faces].expected(f"nothing behind the last of {faces} faces")
    polygons = _polygons(lines[points:], points)
    colors = [line.text.split()[first_color:][:3] for line in lines[:points]] if first_color else []
    paint = partial(_painted, colors, lines[points:], polygons.sizes)
    return points_of(lines[:points]), polygons, paint


def _first_color(lines: list[Line]) -> int | None:
    """Return the place of the first colour among the numbers of a vertex; None if it has none."""
    keyword = _KEYWORD.match(lines[0].text) if lines else None
    return None if keyword is None or not keyword["color"] else 3 + 3 * len(keyword["normal"])


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
