"""Skeletal implicit modelling: trees of primitives whose fields blend, evaluated through Warp.

The pipeline: tree → program → tape → value, gradient, colour → rays (`trace`) and triangles (`polygonize`).
"""

from .errors import (
    BlobTreeError,
    Cancelled,
    InvalidDefinition,
    InvalidFile,
    InvalidNode,
    InvalidPoints,
    InvalidResolution,
    MissingPackage,
    UnknownKind,
    UntranslatableFunction,
)
from .io import from_json, load, save, to_json
from .kernels import ISO, RIM
from .own_operator import OwnCombination, define_operator
from .own_skeleton import OwnPrimitive, define_skeleton
from .polygonize import Mesh, Polygonizer, polygonize
from .primitives import Cone, Point, Segment
from .progress import Cancel, Progress
from .splitting import split_creases
from .tape import Tape
from .trace import Hits
from .tree import (
    Difference,
    Intersection,
    Node,
    Offset,
    Ricci,
    Sum,
    Transform,
    Twist,
    Union,
)

__all__ = [
    "ISO",
    "RIM",
    "BlobTreeError",
    "Cancel",
    "Cancelled",
    "Cone",
    "Difference",
    "Hits",
    "Intersection",
    "InvalidDefinition",
    "InvalidFile",
    "InvalidNode",
    "InvalidPoints",
    "InvalidResolution",
    "Mesh",
    "MissingPackage",
    "Node",
    "Offset",
    "OwnCombination",
    "OwnPrimitive",
    "Point",
    "Polygonizer",
    "Progress",
    "Ricci",
    "Segment",
    "Sum",
    "Tape",
    "Transform",
    "Twist",
    "Union",
    "UnknownKind",
    "UntranslatableFunction",
    "define_operator",
    "define_skeleton",
    "from_json",
    "load",
    "polygonize",
    "save",
    "split_creases",
    "to_json",
]
