from . import par
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
from .meshing.batch import polygonize_batch
from .meshing.creases import split_creases
from .meshing.mesh import Mesh
from .meshing.polygonize import polygonize
from .meshing.polygonizer import Polygonizer
from .nodes.blends import (
    BlendGraph,
    CleanUnion,
    ControllableBlend,
    GradientBlend,
    LocalBlend,
    Masked,
    Mirror,
    RDifference,
    RIntersection,
    RUnion,
    Shell,
    SmoothDifference,
    SmoothIntersection,
    SuperellipticBlend,
    SymmetricDifference,
    Transition,
    Unmasked,
)
from .nodes.contact import Bulge, ContactSurface, Press, RatedUnion, SolidContact
from .nodes.convolution import (
    ConvolutionArc,
    ConvolutionSegment,
    ConvolutionStroke,
    ConvolutionTriangle,
)
from .nodes.curves import Arc, Circle, CubicBezier, Polyline, QuadraticBezier, Stroke, TaperedBezier
from .nodes.deformations import Bend, CurveWarp, LimitedTwist, NoiseWarp, Shear, Stretch, Taper
from .nodes.expressions import Expression
from .nodes.fields import BoxedField, FieldPrimitive, Gyroid, Noise, Superquadric
from .nodes.flats import Polygon, Rectangle, Triangle
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
from .nodes.primitives import Box, Cone, Disc, Point, Primitive, Segment, Torus
from .nodes.profiles import Extrude, Prism, Revolve
from .nodes.repeats import EndlessRepeat, PolarRepeat, Repeat
from .nodes.rounds import RoundDifference, RoundIntersection, RoundUnion
from .nodes.sharp import Frustum
from .nodes.solids import Cylinder, Ellipsoid, HalfSpace
from .nodes.sweeps import Sweep
from .nodes.tree import Difference, Intersection, Offset, Ricci, Sum, Transform, Twist, Union
from .nodes.tree_volumes import sample
from .nodes.volumes import Volume, from_mesh, from_sdf
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
    "Arc",
    "Bend",
    "BlendGraph",
    "Box",
    "BoxedField",
    "Bulge",
    "Cancel",
    "Circle",
    "CleanUnion",
    "Cone",
    "ContactSurface",
    "ControllableBlend",
    "ConvolutionArc",
    "ConvolutionSegment",
    "ConvolutionStroke",
    "ConvolutionTriangle",
    "CubicBezier",
    "Curvatures",
    "CurveWarp",
    "Cylinder",
    "Difference",
    "Disc",
    "Ellipsoid",
    "EndlessRepeat",
    "Expression",
    "Extrude",
    "Falloff",
    "FieldPrimitive",
    "Fit",
    "Frustum",
    "GradientBlend",
    "Gyroid",
    "HalfSpace",
    "ImplicitDecalsError",
    "Intersection",
    "LimitedTwist",
    "LocalBlend",
    "Masked",
    "Mesh",
    "Mirror",
    "Node",
    "Noise",
    "NoiseWarp",
    "NumericParameter",
    "Offset",
    "Operator",
    "Outline",
    "ParameterGradient",
    "Point",
    "PolarRepeat",
    "Polygon",
    "Polygonizer",
    "Polyline",
    "Press",
    "Primitive",
    "Prism",
    "Progress",
    "QuadraticBezier",
    "RDifference",
    "RIntersection",
    "RUnion",
    "RatedUnion",
    "Rectangle",
    "Repeat",
    "Revolve",
    "Ricci",
    "RoundDifference",
    "RoundIntersection",
    "RoundUnion",
    "Segment",
    "Shear",
    "Shell",
    "SmoothDifference",
    "SmoothIntersection",
    "SolidContact",
    "Stretch",
    "Stroke",
    "Sum",
    "SuperellipticBlend",
    "Superquadric",
    "Sweep",
    "SymmetricDifference",
    "Tape",
    "Taper",
    "TaperedBezier",
    "Torus",
    "Transform",
    "Transition",
    "Triangle",
    "Twist",
    "Union",
    "Unmasked",
    "Volume",
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
