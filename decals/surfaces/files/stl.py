"""Reader of STL files, ASCII and binary, of one or several solids."""

import logging
import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from blobtree._typing import Float64Array
from decals.surfaces.files.content import (
    Line,
    encoding_of,
    file_bytes,
    finite_numbers,
    parsed,
    refusal,
    text_lines,
    without_mark,
)
from decals.surfaces.triangulate import Polygons

_logger = logging.getLogger(__name__)

_HEADER = 84
"""Bytes before the first facet of a binary file; the last four hold the number of facets."""

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_WORDS = b"facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 0 vertex 0 0 0 endloop endfacet".split()
"""Words of a facet in an ASCII file; zeros stand for numbers."""

_BARE_WORDS = [_WORDS[0], *_WORDS[5:]]
"""Words of a facet without a normal."""

_SOLID = re.compile(
    rb"(?<!\S)(?:end)?solid(?!\S).*?"
    rb"(?=(?<!\S)facet\s+(?:normal\s+(?:[-+.\d]|nan(?!\S)|inf(?!\S))|outer\s+loop(?!\S))|$)",
    re.IGNORECASE | re.DOTALL,
)
"""Begin or end of a solid with its name, as far as a facet may follow in the same line."""

_END = re.compile(rb"(?<!\S)endsolid(?!\S)", re.IGNORECASE)

_PART = re.compile(rb"(?<!\S)(solid|facet|outer|vertex)(?!\S)", re.IGNORECASE)
"""Words of a solid, which remarks behind the last one do not have."""


def read_stl(path: Path) -> tuple[Float64Array, Polygons, None]:
    """Read the facets of an STL file; equal corners become one vertex. Colours are left out with a warning.

    Raises
    ------
    InvalidMesh
        If the file ends too early, or a line of it is wrong. The message names the line.
    """
    try:
        content = file_bytes(path)
        corners = _text_corners(content) if _is_text(content) else _binary_corners(content)
    except (ValueError, MemoryError) as error:
        raise refusal(path, "STL", error) from error
    if b"COLOR=" in content[:_HEADER]:
        _logger.warning("%s: left out the colours of facets; save them as PLY, GLB or 3MF", path)
    return *_merged(corners), None


def _is_text(content: bytes) -> bool:
    """Return True for an ASCII file: it starts with "solid", as some binary files also do."""
    if encoding_of(content) not in (None, "utf-8"):
        return True
    body = without_mark(content)
    if _declared_size(body) == len(body):
        return False
    start = body[:4096].lower()
    words = start.replace(b"\0", b"")  # UTF-16 without a mark is refused as text
    return words.lstrip().startswith(b"solid") and (b"facet" in words or b"\0" not in start)


def _declared_size(body: bytes) -> int:
    """Return the size of a binary file by the number of its facets."""
    if len(body) < _HEADER:
        return -1
    return _HEADER + _FACET.itemsize * int.from_bytes(body[_HEADER - 4 : _HEADER], "little")


def _binary_corners(content: bytes) -> Float64Array:
    body = without_mark(content)
    size = _declared_size(body)
    if size < 0:
        raise ValueError("it is neither text that starts with 'solid' nor long enough for a binary file")
    there, rest = divmod(len(body) - _HEADER, _FACET.itemsize)
    declared = (size - _HEADER) // _FACET.itemsize
    if there < declared or (there > declared and not rest):  # what else stands at the end is no facet
        raise ValueError(f"it declares {declared} facets and holds {there}")
    facets = np.frombuffer(body, _FACET, declared, _HEADER)
    with np.errstate(invalid="ignore"):  # refused below
        corners: Float64Array = facets["corners"].reshape(-1, 3).astype(np.float64)
    wrong = ~np.isfinite(corners).all(axis=1)
    if wrong.any():
        raise ValueError(f"facet {int(np.argmax(wrong)) // 3 + 1} has a corner that is not finite")
    return corners


def _text_corners(content: bytes) -> Float64Array:
    lines = [Line(number, text) for number, text in enumerate(text_lines(content), 1) if text.strip()]
    if not lines:
        raise ValueError("it is empty")
    last = max((place for place, line in enumerate(lines) if _END.search(line.text)), default=-1)
    if last < 0 or any(_PART.search(line.text) for line in lines[last + 1 :]):
        raise ValueError("it ends without 'endsolid', so it is cut off")
    lines = lines[: last + 1]
    within = [
        Line(line.number, _SOLID.sub(b" ", line.text)) if b"solid" in line.text.lower() else line
        for line in lines
    ]
    words = b" ".join([line.text for line in within]).split()
    for form in (_WORDS, _BARE_WORDS):
        try:
            return _corners(words, form)
        except ValueError:
            continue
    return parsed(_facets(within, words), _corners_of, "a facet with a loop of three vertices")


def _facets(lines: list[Line], words: list[bytes]) -> list[Line]:
    """Return the words from each "facet" to the next one, with the line where they begin."""
    numbers = [line.number for line in lines for _ in line.text.split()]
    starts = [k for k, word in enumerate(words) if k == 0 or word.lower() == _WORDS[0]]
    return [Line(numbers[a], b" ".join(words[a:b])) for a, b in pairwise([*starts, len(words)])]


def _corners_of(facets: list[Line]) -> Float64Array:
    """Return the corners of facets, of which some have normals and some have none."""
    loops = [facet.text.split() for facet in facets]
    bare = len(_BARE_WORDS)
    return np.concatenate([_corners(loop, _BARE_WORDS if len(loop) == bare else _WORDS) for loop in loops])


def _corners(words: list[bytes], form: list[bytes]) -> Float64Array:
    """Return the corners of facets of a form, ``float64[k, 3]``; ValueError for other words."""
    size = len(form)
    if len(words) % size:
        raise ValueError
    keywords = [k for k, word in enumerate(form) if word != b"0"]
    if any(word.lower() != form[place] for place in keywords for word in set(words[place::size])):
        raise ValueError
    numbers = [k for k, word in enumerate(form) if word == b"0"][-9:]  # without the normal
    columns = [finite_numbers(words[k::size]) for k in numbers]
    return np.stack(columns, axis=1).reshape(-1, 3)


def _merged(corners: Float64Array) -> tuple[Float64Array, Polygons]:
    """Return equal corners as one vertex each, in the order of their first use."""
    order = np.lexsort(corners.T)  # a stable sort: the first of equal corners stays in front
    starts = np.ones(len(order), np.bool_)
    starts[1:] = (corners[order[1:]] != corners[order[:-1]]).any(axis=1)
    first = np.empty_like(order)
    first[order] = order[starts][np.cumsum(starts) - 1]
    kept = np.flatnonzero(first == np.arange(len(first)))
    return corners[kept], Polygons(np.searchsorted(kept, first), np.full(len(corners) // 3, 3, np.int64))
