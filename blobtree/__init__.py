"""Skeletal implicit modelling: trees of primitives whose fields blend, evaluated through Warp.

The pipeline: tree → program → tape → value, gradient, colour → rays (`trace`) and triangles (`polygonize`).
"""

from .errors import (
    BlobTreeError,
    Cancelled,
    InvalidDefinition,
    InvalidDevice,
    InvalidFile,
    InvalidNode,
    InvalidPoints,
    InvalidResolution,
    MissingPackage,
    UnknownKind,
    UntranslatableFunction,
)
from .formulas.kernels import ISO, RIM
from .meshing.polygonize import Mesh, Polygonizer, polygonize
from .meshing.splitting import split_creases
from .nodes.io import from_json, load, save, to_json
from .nodes.primitives import Cone, Point, Segment
from .nodes.tree import (
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
from .own.operator import OwnCombination, define_operator
from .own.skeleton import OwnPrimitive, define_skeleton
from .progress import Cancel, Progress
from .tapes.tape import Tape
from .tracing.trace import Hits

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
    "InvalidDevice",
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
