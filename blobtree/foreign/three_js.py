"""Trees of three-js-blobtree, the JavaScript library of Zanni and others, in the JSON of its `toJSON`.

Their fields are 1 on the surface, or `iso`; all fields here are half as large, over `iso`. Scalis primitives
have a kernel (1 − r² / 4t²)³ that reaches twice the thickness t, scaled to 1 at the thickness.
"""

import math
import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from blobtree._typing import Float64Array
from blobtree.errors import ImplicitDecalsError, InvalidFile
from blobtree.foreign.content import naming, read_bytes
from blobtree.foreign.json_values import chosen, member, number, parsed_json
from blobtree.formulas.falloff import RIM
from blobtree.nodes.convolution import LINE_RIM, SHEET_RIM, ConvolutionSegment, ConvolutionTriangle
from blobtree.nodes.flats import Triangle
from blobtree.nodes.node import Node
from blobtree.nodes.primitives import Cone, Leaf, Point, Segment
from blobtree.nodes.tree import Difference, Intersection, Ricci, Sum, Union
from blobtree.validation import describe

ROOT_EXPONENT = 64.0
"""Exponent of the Ricci blend of a root, by default."""

NEAR_SUM = 1.0 + 1e-6
"""Exponent of a sum that takes operands below 0 for 0, as those of three-js-blobtree are."""

REACH = 2.0
"""Reach of a kernel over the thickness."""

BALL_SCALE, LINE_SCALE, SHEET_SCALE = ((1.0 - 1.0 / REACH**2) ** -power for power in (3.0, 3.5, 4.0))
"""Factors that make the fields of a point, an endless line and an endless plane 1 at the thickness."""

TAPER_STEPS = 30
"""Steps of the search for the radii of a tapered segment that give the kernel its reach."""

Corners = tuple[Float64Array, Float64Array]


class _Part(NamedTuple):
    """A node, the box that three-js-blobtree gives it, and whether its field may fall below 0."""

    node: Node
    box: Corners
    is_signed: bool = False


class _Entry(NamedTuple):
    """An object of a file, and its place for errors."""

    values: Any
    place: str


def read_three_js(path: str | os.PathLike[str]) -> Node:
    """Return the tree in a file that holds the JSON of a root, or another node, of three-js-blobtree.

    Raises
    ------
    InvalidFile
        The file holds no such tree, or an element that has no counterpart.
    UnusableFile
        The file cannot be read.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from blobtree.foreign import read_three_js
    >>> path = pathlib.Path(tempfile.mkdtemp(), "ball.json")
    >>> _ = path.write_text('''{"type": "RootNode", "iso": 1, "children": [{"type": "ScalisPoint",
    ...     "v": [{"position": {"x": 0, "y": 0, "z": 0}, "thickness": 2}], "density": 1,
    ...     "materials": [{"color": "#ff0000"}], "volType": "dist"}]}''')
    >>> read_three_js(path)([[2, 0, 0]]).round(3).tolist()
    [0.5]
    """
    content = read_bytes(path)
    with naming(path):
        return three_js_tree(parsed_json(content))


def three_js_tree(root: Any) -> Node:
    """Return the tree of an object that is read; raise `InvalidFile` if it is none."""
    scale = 0.5 / number(root, "iso", "root", 1e-6, default=1.0)
    order, pending = list[_Entry](), [_Entry(root, "root")]
    while pending:
        entry = pending.pop()
        order.append(entry)
        for place, child in enumerate(_children(entry)):
            pending.append(_Entry(child, f"node {len(order)}, child {place}"))
    done: list[_Part] = []
    for entry in reversed(order):
        count = len(_children(entry))
        below = done[len(done) - count :]
        del done[len(done) - count :]
        make = chosen(_ELEMENTS, member(entry.values, "type", entry.place), "type", entry.place)
        try:
            done.append(make(entry, below, scale))
        except InvalidFile:
            raise
        except ImplicitDecalsError as error:
            raise InvalidFile(f"{entry.place}: {error}") from None
    return done[-1].node


def _children(entry: _Entry) -> list[Any]:
    """Return the objects below one; those of signed distances are part of it."""
    if not isinstance(entry.values, dict) or "children" not in entry.values:
        return []
    found = entry.values["children"]
    if not isinstance(found, list) or not found:
        raise InvalidFile(f"{entry.place}: children: expected a list of nodes, got {describe(found)}")
    return found


def _joined(make: Callable[[tuple[Node, ...]], Node]) -> Callable[[_Entry, list[_Part], float], _Part]:
    """Return what joins the nodes below one."""

    def join(entry: _Entry, below: list[_Part], scale: float) -> _Part:
        if not below:
            raise InvalidFile(f"{entry.place}: the field 'children' is missing")
        nodes = tuple(part.node for part in below)
        return _Part(
            make(nodes) if len(nodes) > 1 else nodes[0],
            _around([part.box for part in below]),
            any(part.is_signed for part in below),
        )

    return join


def _around(boxes: list[Corners]) -> Corners:
    lower, upper = zip(*boxes, strict=True)
    return np.min(lower, axis=0), np.max(upper, axis=0)


def _ricci(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    """Return a Ricci blend; its exponent is called `ricci` in older files, and a root may have none."""
    name = "ricci" if "ricci" in entry.values else "ricci_n"
    default = ROOT_EXPONENT if entry.values["type"] == "RootNode" else None
    exponent = number(entry.values, name, entry.place, 1.0, default)
    if exponent == 1.0 and not any(part.is_signed for part in below):
        return _joined(Sum)(entry, below, scale)
    return _joined(lambda nodes: Ricci(nodes, exponent=max(exponent, NEAR_SUM)))(entry, below, scale)


def _difference(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    """Return a difference of fields f − g if g is a primitive or a sum, else the nearest counterpart."""
    if len(below) != 2:
        raise InvalidFile(f"{entry.place}: children: expected two nodes, got {len(below)}")
    solid, tool = below
    if number(entry.values, "alpha", entry.place, default=1.0) == 1.0 and (carving := _negative(tool)):
        return _Part(Sum((solid.node, *carving)), solid.box, True)
    return _Part(Difference(solid.node, tool.node), solid.box, solid.is_signed)


def _negative(part: _Part) -> tuple[Node, ...]:
    """Return leaves whose sum is minus the field of a part; none if there are no such leaves."""
    leaves: tuple[Any, ...] = part.node.operands if isinstance(part.node, Sum) else (part.node,)
    if part.is_signed or not all(isinstance(leaf, Leaf) for leaf in leaves):
        return ()
    return tuple(replace(leaf, weight=-leaf.weight) for leaf in leaves)


def _middle(box: Corners) -> Float64Array:
    return 0.5 * (box[0] + box[1])


def _scaled(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    """Return the last child, scaled from the middle of the box around all."""
    box = _joined(Union)(entry, below, scale).box
    factors = np.array([number(entry.values, f"scale_{axis}", entry.place, 1e-6) for axis in "xyz"])
    middle = _middle(box)
    grown = (box[1] - box[0]) * (factors - 1.0)
    node = below[-1].node.transform(np.column_stack([np.diag(factors), middle - factors * middle]))
    return _Part(node, (box[0] - grown, box[1] + grown), below[-1].is_signed)


def _twisted(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    """Return the last child, twisted around an axis through the middle of the box around all."""
    box = _joined(Union)(entry, below, scale).box
    axis = np.array([number(entry.values, f"axis_{name}", entry.place) for name in "xyz"])
    turns = number(entry.values, "twist_amout", entry.place)
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        raise InvalidFile(f"{entry.place}: axis: expected a direction, got no length")
    z = axis / length
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    frame = np.array([x, np.cross(z, x), z])
    middle = _middle(box)
    local = below[-1].node.transform(np.column_stack([frame, -frame @ middle]))
    twisted = local.twist(math.degrees(turns)).transform(np.column_stack([frame.T, middle]))
    return _Part(twisted, box, below[-1].is_signed)


def _vertices(entry: _Entry, count: int) -> list[tuple[Float64Array, float]]:
    """Return the positions and thicknesses of a Scalis primitive."""
    found = member(entry.values, "v", entry.place)
    if not isinstance(found, list) or len(found) != count:
        raise InvalidFile(f"{entry.place}: v: expected {count} vertices, got {describe(found)}")
    return [
        (_vector(vertex, "position", f"{entry.place}, vertex {place}"),
         number(vertex, "thickness", f"{entry.place}, vertex {place}", 1e-9))
        for place, vertex in enumerate(found)
    ]  # fmt: skip


def _vector(values: Any, name: str, place: str) -> Float64Array:
    found = member(values, name, place)
    return np.array([number(found, axis, f"{place}: {name}") for axis in "xyz"])


def _keywords(entry: _Entry, factor: float) -> dict[str, Any]:
    """Return the colour, the mean one of all materials, and the weight of a Scalis primitive."""
    materials = member(entry.values, "materials", entry.place)
    if not isinstance(materials, list):
        raise InvalidFile(f"{entry.place}: materials: expected a list, got {describe(materials)}")
    colors = [member(material, "color", f"{entry.place}, material") for material in materials]
    density = number(entry.values, "density", entry.place, 0.0, default=1.0)
    return {"color": _mean_color(colors, entry.place), "weight": density * factor}


def _mean_color(colors: list[Any], place: str) -> Any:
    texts = [color for color in colors if isinstance(color, str) and len(color) == 7 and color[0] == "#"]
    if not colors or len(texts) < len(colors):
        raise InvalidFile(f"{place}: color: expected texts such as '#aaaaaa', got {describe(colors)}")
    try:
        parts = np.array([[int(text[i : i + 2], 16) for i in (1, 3, 5)] for text in texts])
    except ValueError:
        raise InvalidFile(
            f"{place}: color: expected texts such as '#aaaaaa', got {describe(colors)}"
        ) from None
    return "#" + "".join(f"{round(part):02x}" for part in parts.mean(axis=0))


def _is_convolution(entry: _Entry) -> bool:
    kind = member(entry.values, "volType", entry.place)
    if kind not in ("dist", "convol"):
        raise InvalidFile(f"{entry.place}: volType: expected dist or convol, got {describe(kind)}")
    return bool(kind == "convol")


def _kernel_box(vertices: list[tuple[Float64Array, float]]) -> Corners:
    return _around([(place - REACH * size, place + REACH * size) for place, size in vertices])


def _point(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    vertices = _vertices(entry, 1)
    ((place, size),) = vertices
    node = Point(tuple(place), radius=REACH * RIM * size, **_keywords(entry, scale * BALL_SCALE))
    return _Part(node, _kernel_box(vertices))


def _segment(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    vertices = _vertices(entry, 2)
    (start, first), (end, last) = vertices
    ends = tuple(start), tuple(end)
    if _is_convolution(entry):
        radii = _tapered_radii(REACH * np.array([first, last]), float(np.linalg.norm(end - start)))
        keywords = _keywords(entry, scale * LINE_SCALE)
        node: Node = ConvolutionSegment(*ends, radius=radii[0], end_radius=radii[1], **keywords)
    else:
        keywords, radii = _keywords(entry, scale * BALL_SCALE), [REACH * RIM * size for size in (first, last)]
        if first == last:
            node = Segment(*ends, radius=radii[0], **keywords)
        else:
            node = Cone(*ends, radius=radii[0], end_radius=radii[1], **keywords)
    return _Part(node, _kernel_box(vertices))


def _tapered_radii(reaches: Float64Array, length: float) -> list[float]:
    """Return the radii of a convolution segment whose kernels have these reaches."""
    radii = reaches * LINE_RIM
    lengths = np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])
    for _ in range(TAPER_STEPS if length > 0.0 else 0):
        columns = {
            "start": lengths[:1],
            "end": lengths[1:],
            "radius": radii[:1, None],
            "end_radius": radii[1:, None],
        }
        radii = radii * reaches / ConvolutionSegment.kernel_radii(columns)[0]
    return [float(radius) for radius in radii]


def _triangle(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    """Return a triangle of the mean thickness."""
    vertices = _vertices(entry, 3)
    corners = [tuple(place) for place, _ in vertices]
    size = float(np.mean([size for _, size in vertices]))
    if _is_convolution(entry):
        keywords = _keywords(entry, scale * SHEET_SCALE)
        node: Node = ConvolutionTriangle(*corners, radius=REACH * SHEET_RIM * size, **keywords)
    else:
        node = Triangle(*corners, radius=REACH * RIM * size, **_keywords(entry, scale * BALL_SCALE))
    return _Part(node, _kernel_box(vertices))


def _distance_root(entry: _Entry, below: list[_Part], scale: float) -> _Part:
    """Return a ball or a capsule by its distance, whose field ends where that of the functor does."""
    place = entry.place
    functor = member(entry.values, "f", place)
    if member(functor, "type", f"{place}: f") != "Poly6DistanceFunctor":
        raise InvalidFile(f"{place}: f: expected a Poly6DistanceFunctor, got {describe(functor['type'])}")
    reach = number(functor, "scale", f"{place}: f", 1e-9)
    shape = member(entry.values, "sdfRoot", place)
    while isinstance(shape, dict) and shape.get("type") == "SDFNode":
        inside = member(shape, "children", f"{place}: sdfRoot")
        if not isinstance(inside, list) or not inside:
            raise InvalidFile(f"{place}: sdfRoot: expected a child, got {describe(inside)}")
        shape = inside[0]
    kind = chosen(_DISTANCES, member(shape, "type", f"{place}: sdfRoot"), "type", f"{place}: sdfRoot")
    keywords = {"color": _keywords(entry, 1.0)["color"], "width": reach}
    node, hulls = kind(_Entry(shape, f"{place}: sdfRoot"), keywords)
    return _Part(node, _around([(point - radius - reach, point + radius + reach) for point, radius in hulls]))


def _sphere(entry: _Entry, keywords: dict[str, Any]) -> tuple[Node, list[tuple[Float64Array, float]]]:
    center, radius = _vector(entry.values, "p", entry.place), number(entry.values, "r", entry.place, 1e-9)
    return Point(tuple(center), radius=radius, **keywords), [(center, radius)]


def _capsule(entry: _Entry, keywords: dict[str, Any]) -> tuple[Node, list[tuple[Float64Array, float]]]:
    ends = [_vector(entry.values, name, entry.place) for name in ("p1", "p2")]
    radii = [number(entry.values, name, entry.place, 1e-9) for name in ("r1", "r2")]
    places = [tuple(end) for end in ends]
    node: Node = (
        Segment(*places, radius=radii[0], **keywords)
        if radii[0] == radii[1]
        else Cone(*places, radius=radii[0], end_radius=radii[1], **keywords)
    )
    return node, list(zip(ends, radii, strict=True))


_DISTANCES: dict[str, Callable[..., Any]] = {"SDFSphere": _sphere, "SDFCapsule": _capsule}
"""Signed distances that enclose a solid; a `SDFPoint` and a `SDFSegment` have a surface without an inside."""

_ELEMENTS: dict[str, Callable[..., _Part]] = {
    "RootNode": _ricci,
    "RicciNode": _ricci,
    "MaxNode": _joined(Union),
    "MinNode": _joined(Intersection),
    "DifferenceNode": _difference,
    "ScaleNode": _scaled,
    "TwistNode": _twisted,
    "ScalisPoint": _point,
    "ScalisSegment": _segment,
    "ScalisTriangle": _triangle,
    "SDFRootNode": _distance_root,
}
