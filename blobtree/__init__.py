"""Skeletal implicit modelling: trees of primitives whose fields blend, evaluated through Warp.

The pipeline: tree → program → tape → value, gradient, colour → rays (`trace`) and triangles (`polygonize`).
"""

import warp as wp

wp.config.log_level = wp.LOG_WARNING

from .errors import (  # noqa: E402  (Warp must be told to be quiet before the first kernel is made)
    BlobTreeError,
    InvalidFile,
    InvalidNode,
    InvalidPoints,
    InvalidResolution,
    UntranslatableFunction,
)
from .io import from_json, load, save, to_json  # noqa: E402
from .kernels import ISO, RIM  # noqa: E402
from .polygonize import Mesh, polygonize  # noqa: E402
from .progress import Progress  # noqa: E402
from .tape import Tape  # noqa: E402
from .tree import (  # noqa: E402
    Cone,
    Difference,
    Intersection,
    Node,
    Offset,
    Point,
    Ricci,
    Segment,
    Sum,
    Transform,
    Twist,
    Union,
)

__all__ = [
    "ISO",
    "RIM",
    "BlobTreeError",
    "Cone",
    "Difference",
    "Intersection",
    "InvalidFile",
    "InvalidNode",
    "InvalidPoints",
    "InvalidResolution",
    "Mesh",
    "Node",
    "Offset",
    "Point",
    "Progress",
    "Ricci",
    "Segment",
    "Sum",
    "Tape",
    "Transform",
    "Twist",
    "Union",
    "UntranslatableFunction",
    "from_json",
    "load",
    "polygonize",
    "save",
    "to_json",
]
