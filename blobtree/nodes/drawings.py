"""Filled shapes of SVG drawings as path data, each with the map from its place in the file to the drawing."""

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from blobtree._typing import Float64Array
from blobtree.errors import InvalidNode

MOST_ELEMENTS = 100_000
"""Most elements of a drawing."""

NOT_DRAWN = frozenset(
    {
        "clipPath",
        "defs",
        "filter",
        "font",
        "foreignObject",
        "linearGradient",
        "marker",
        "mask",
        "metadata",
        "pattern",
        "radialGradient",
        "style",
        "symbol",
        "text",
        "title",
        "use",
    }
)
"""Elements whose contents are not drawn at their place."""

INHERITED = {"fill": "black", "fill-rule": "nonzero", "visibility": "visible"}
"""Properties that elements inherit, with their values at the root."""

CALL = re.compile(r"(\w+)\s*\(([^)]*)\)")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")

Sizes = Callable[[str], float]


def filled_shapes(drawing: str | Path) -> Iterator[tuple[str, Float64Array, str]]:
    """Yield path data, the map (2, 3) and the rule of each filled shape in a file, or in the text of one."""
    text = drawing.lstrip("\ufeff \t\r\n") if isinstance(drawing, str) else ""
    root = ElementTree.fromstring(text) if text.startswith("<") else ElementTree.parse(drawing).getroot()
    pending = [(root, np.eye(3), INHERITED)]
    for _ in range(MOST_ELEMENTS):
        if not pending:
            return
        element, above, look = pending.pop()
        tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
        style = {**element.attrib, **_declarations(element.get("style", ""))}
        if tag in NOT_DRAWN or style.get("display") == "none":
            continue
        matrix = above @ _matrix(element.get("transform", ""))
        look = look | {name: style[name] for name in look if style.get(name, "inherit") != "inherit"}
        seen = look["fill"] != "none" and look["visibility"] == "visible"
        if seen and tag in SHAPES:
            yield SHAPES[tag](element), matrix[:2], look["fill-rule"]
        pending += [(child, matrix, look) for child in reversed(element)]
    raise InvalidNode(f"drawing: expected at most {MOST_ELEMENTS:,} elements, got more; simplify it")


def _declarations(style: str) -> dict[str, str]:
    """Return the declarations of a style by their names."""
    pairs = (part.partition(":") for part in style.split(";"))
    return {name.strip(): value.strip() for name, _, value in pairs}


def _matrix(text: str) -> Float64Array:
    """Return the matrix (3, 3) of the transform of an element."""
    matrix = np.eye(3)
    for name, arguments in CALL.findall(text):
        if name not in MAPS:
            raise InvalidNode(f"transform: expected {', '.join(MAPS)}, got {name}")
        try:
            matrix = matrix @ MAPS[name](*map(float, NUMBER.findall(arguments)))
        except TypeError:
            raise InvalidNode(
                f"transform: expected as many numbers as SVG gives {name}, got ({arguments})"
            ) from None
    return matrix


def _affine(a: float, b: float, c: float, d: float, e: float, f: float) -> Float64Array:
    return np.array([(a, c, e), (b, d, f), (0.0, 0.0, 1.0)])


def _translation(x: float, y: float = 0.0) -> Float64Array:
    return _affine(1.0, 0.0, 0.0, 1.0, x, y)


def _rotation(degrees: float, x: float = 0.0, y: float = 0.0) -> Float64Array:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return _translation(x, y) @ _affine(c, s, -s, c, 0.0, 0.0) @ _translation(-x, -y)


MAPS: dict[str, Callable[..., Float64Array]] = {
    "matrix": _affine,
    "translate": _translation,
    "scale": lambda x, y=None: _affine(x, 0.0, 0.0, x if y is None else y, 0.0, 0.0),
    "rotate": _rotation,
    "skewX": lambda degrees: _affine(1.0, 0.0, math.tan(math.radians(degrees)), 1.0, 0.0, 0.0),
    "skewY": lambda degrees: _affine(1.0, math.tan(math.radians(degrees)), 0.0, 1.0, 0.0, 0.0),
}
"""Maps (3, 3) by their names in transforms."""


def _sizes(element: ElementTree.Element) -> Sizes:
    """Return a function of the lengths of an element by their names, 0 for those that it leaves out."""

    def size(name: str) -> float:
        text = element.get(name, "0")
        try:
            return float(text.removesuffix("px"))
        except ValueError:
            raise InvalidNode(
                f"drawing: cannot read {name}={text!r} of a {element.tag.rpartition('}')[2]}; "
                "use numbers without units"
            ) from None

    return size


def _rectangle(element: ElementTree.Element) -> str:
    """Return the path of a rectangle, whose corners may be rounded."""
    of = _sizes(element)
    x, y, width, height = (of(name) for name in ("x", "y", "width", "height"))
    rx = min(of("rx" if "rx" in element.attrib else "ry"), 0.5 * width)
    ry = min(of("ry" if "ry" in element.attrib else "rx"), 0.5 * height)
    corner, across, along = f"a{rx} {ry} 0 0 1 ", width - 2.0 * rx, height - 2.0 * ry
    return (
        f"M{x + rx} {y}h{across}{corner}{rx} {ry}v{along}{corner}{-rx} {ry}"
        f"h{-across}{corner}{-rx} {-ry}v{-along}{corner}{rx} {-ry}Z"
    )


def _ellipse(element: ElementTree.Element) -> str:
    """Return the path of an ellipse or a circle."""
    of = _sizes(element)
    x, y, rx, ry = of("cx"), of("cy"), of("rx") or of("r"), of("ry") or of("r")
    return f"M{x - rx} {y}A{rx} {ry} 0 0 1 {x + rx} {y}A{rx} {ry} 0 0 1 {x - rx} {y}Z"


def _polygon(element: ElementTree.Element) -> str:
    """Return the path of a polygon or a polyline."""
    return f"M{element.get('points', '')}Z" if element.get("points") else ""


SHAPES: dict[str, Callable[[ElementTree.Element], str]] = {
    "path": lambda element: element.get("d", ""),
    "rect": _rectangle,
    "circle": _ellipse,
    "ellipse": _ellipse,
    "polygon": _polygon,
    "polyline": _polygon,
}
"""Path data of elements by their tags."""
