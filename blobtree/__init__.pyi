from . import library, par
from ._version import __version__
from .conformance.laws import check_kind
from .declare.falloff import Falloff
from .declare.formula import formula
from .derivatives.curvature import Curvatures
from .errors import ImplicitDecalsError
from .fitting import Fit, fit
from .formulas.falloff import ISO, RIM
from .formulas.falloffs import FALLOFF_NAMES
from .identity import content_hash
from .io import from_json, load, save, to_json
from .library import *  # noqa: F403  all kinds of nodes
from .meshing.batch import polygonize_batch
from .meshing.creases import split_creases
from .meshing.mesh import Mesh
from .meshing.polygonize import polygonize
from .meshing.polygonizer import Polygonizer
from .nodes.contact import ContactSurface
from .nodes.fields import BoxedField, FieldPrimitive
from .nodes.node import Node
from .nodes.numeric_parameters import (
    NumericParameter,
    numeric_parameters,
    numeric_values,
    with_numeric_values,
)
from .nodes.operator import Operator
from .nodes.outlines import Outline
from .nodes.parameter_gradient import ParameterGradient
from .nodes.primitives import Primitive
from .nodes.tree_volumes import sample
from .nodes.volumes import from_mesh, from_sdf
from .nodes.warp import Warp
from .progress import Cancel, Progress
from .sampling.field_grid import field_grid
from .sampling.tree_distances import to_sdf
from .tape.tape import Tape
from .tracing.batch import raycast_batch

__all__ = [
    "FALLOFF_NAMES",
    "ISO",
    "RIM",
    "BoxedField",
    "Cancel",
    "ContactSurface",
    "Curvatures",
    "Falloff",
    "FieldPrimitive",
    "Fit",
    "ImplicitDecalsError",
    "Mesh",
    "Node",
    "NumericParameter",
    "Operator",
    "Outline",
    "ParameterGradient",
    "Polygonizer",
    "Primitive",
    "Progress",
    "Tape",
    "Warp",
    "__version__",
    "check_kind",
    "content_hash",
    "field_grid",
    "fit",
    "formula",
    "from_json",
    "from_mesh",
    "from_sdf",
    "load",
    "numeric_parameters",
    "numeric_values",
    "par",
    "polygonize",
    "polygonize_batch",
    "raycast_batch",
    "sample",
    "save",
    "split_creases",
    "to_json",
    "to_sdf",
    "with_numeric_values",
]
__all__ += library.__all__
