"""The outline of a scene: objects, the nodes of their trees, layers and images, as rows of a list."""

from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from PIL import Image

from blobtree import Node
from blobtree.nodes.paths import Path as TreePath
from decals.editing.document import Document
from decals.editing.outline_actions import Part
from decals.images.texels import as_bytes
from decals.scenes.objects import TreeObject
from decals.scenes.scene import DecalImage

PICTURE_SIZE = 32
"""Width and height of pictures of images, in pixels."""

MAX_ROWS = 2000
"""Most rows of one object: a page with more is slow."""

ICONS = {
    "object": "cube-outline",
    "mesh": "vector-triangle",
    "layer": "layers-outline",
    "combination": "set-center",
    "modifier": "tune-variant",
    "primitive": "circle-medium",
    **dict.fromkeys(("Point", "Disc"), "circle"),
    **dict.fromkeys(("Segment", "ConvolutionSegment"), "vector-line"),
    **dict.fromkeys(("Arc", "ConvolutionArc"), "vector-curve"),
    **dict.fromkeys(("QuadraticBezier", "CubicBezier", "TaperedBezier"), "vector-bezier"),
    **dict.fromkeys(("Polyline", "Stroke", "ConvolutionStroke"), "vector-polyline"),
    **dict.fromkeys(("Triangle", "ConvolutionTriangle"), "triangle"),
    **dict.fromkeys(("Ellipsoid", "Superquadric"), "ellipse"),
    **dict.fromkeys(("Twist", "LimitedTwist"), "screw-lag"),
    **dict.fromkeys(("Noise", "NoiseWarp", "Gyroid"), "waves"),
    **dict.fromkeys(("Difference", "SmoothDifference", "RDifference", "RoundDifference"), "set-left"),
    **dict.fromkeys(("Union", "RUnion", "CleanUnion", "RatedUnion", "RoundUnion"), "set-all"),
    **dict.fromkeys(("Sum", "Ricci", "SuperellipticBlend"), "plus-circle-outline"),
    "Box": "cube",
    "Circle": "circle-outline",
    "Cone": "cone",
    "Cylinder": "cylinder",
    "Expression": "function-variant",
    "Extrude": "format-text",
    "Mirror": "flip-horizontal",
    "Polygon": "vector-polygon",
    "Prism": "hexagon-outline",
    "EndlessRepeat": "dots-grid",
    "PolarRepeat": "dots-circle",
    "Rectangle": "vector-rectangle",
    "Repeat": "dots-horizontal",
    "Revolve": "rotate-3d-variant",
    "Sweep": "vector-curve",
    "Torus": "circle-double",
    "Transform": "axis-arrow",
    "Volume": "cube-scan",
}
"""Icons of rows by their class, else by their kind."""


GROUPS = {
    **dict.fromkeys(("primitives", "tree", "Shell", "Mirror"), "basic"),
    "deformations": "warps",
    "sharp": "solids",
    "sweeps": "profiles",
}
"""Groups of kinds in menus by the class, else by the file of the class, whose name is the group of others."""


@dataclass(frozen=True)
class Row:
    """One row of the outline; plain values, as a page receives them.

    Attributes
    ----------
    key
        Text that names the row; see `decals.editing.outline_actions.Part.key`.
    label
        Name of the object, node or layer; the class of a node without a name.
    kind
        "object", "combination", "modifier", "primitive", "mesh", "layer", "image" or "more".
    depth
        Indentation.
    type
        Name of the class of a node; "" for other rows.
    hidden, locked
        True if the user hid or locked it.
    picture
        URL of a small picture of an image; "" for other rows.
    """

    key: str
    label: str
    kind: str
    depth: int
    hidden: bool = False
    locked: bool = False
    picture: str = ""
    type: str = ""


def icon(name: str, kind: str) -> str:
    """Return the icon of a class, else of a kind of rows, else ""."""
    known = ICONS.get(name, ICONS.get(kind))
    return f"mdi-{known}" if known else ""


def group(name: str, kind: type[Node]) -> str:
    """Return the group of a class of nodes in a menu; "custom" for one of a user."""
    package, _, file = kind.__module__.rpartition(".")
    return GROUPS.get(name, GROUPS.get(file, file)) if package == "blobtree.nodes" else "custom"


def outline(document: Document) -> list[dict[str, Any]]:
    """Return the rows of a document: each object, with the nodes of its tree below it, layers, and images."""
    rows: list[Row] = []
    for number, item in enumerate(document.objects):
        kind = "object" if isinstance(item, TreeObject) else "mesh"
        rows.append(Row(f"object {number}", item.name, kind, 0, () in item.hidden, () in item.locked))
        if isinstance(item, TreeObject):
            rows += _nodes(number, item)
    hidden = document.hidden.decals.layers
    for layer in np.unique(np.concatenate([document.decals.column("layers"), hidden])).tolist():
        flags = layer in hidden, layer in document.locked_layers
        label = document.layer_names.get(layer, f"layer {layer}")
        rows.append(Row(f"layer {layer}", label, "layer", 0, *flags))
    for number, image in enumerate(document.images):
        name = Path(image.source).name
        rows.append(Row(f"image {number}", name, "image", 0, picture=picture(image)))
    return [{**vars(row), "icon": icon(row.type, row.kind)} for row in rows]


_pictures: WeakKeyDictionary[DecalImage, dict[int, str]] = WeakKeyDictionary()


def picture(image: DecalImage, size: int = PICTURE_SIZE) -> str:
    """Return a picture of an image, of a width and height in pixels, as a URL with its data."""
    known = _pictures.setdefault(image, {})
    if size not in known:
        known[size] = png_url(Image.fromarray(as_bytes(image.pixels)).resize((size, size)))
    return known[size]


def png_url(picture: Image.Image, **options: Any) -> str:
    """Return a URL that holds a picture, written with options of Pillow."""
    file = BytesIO()
    picture.save(file, "PNG", **options)
    return f"data:image/png;base64,{b64encode(file.getvalue()).decode('ascii')}"


def _nodes(number: int, item: TreeObject) -> list[Row]:
    rows: list[Row] = []
    pending: list[tuple[TreePath, Any]] = [((), item.tree)]
    while pending:
        path, node = pending.pop()
        if len(rows) == MAX_ROWS:
            rows.append(Row(f"more {number}", f"more than {MAX_ROWS} nodes", "more", 1))
            break
        count = len(node.children)
        kind = "primitive" if count == 0 else "modifier" if count == 1 else "combination"
        hidden, locked = (bool(path) and path in paths for paths in (item.hidden, item.locked))
        name, key = type(node).__name__, Part("node", number, path).key
        label = item.names.get(path, name)
        rows.append(Row(key, label, kind, 1 + len(path), hidden, locked, type=name))
        pending.extend(((*path, i), child) for i, child in reversed(list(enumerate(node.children))))
    return rows
