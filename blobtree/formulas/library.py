"""Library kinds: the rows of all built-in kinds beyond the core tables.

Kernels for the core tables alone stay small and fast. A tree with a library kind uses kernels for the core
and the library together (`tape.instruction_set.library`). A new family of kinds is a file of formulas that
ends in a tuple of rows, and one name here.
"""

from blobtree.declare.falloff import Falloff
from blobtree.formulas.blends import BLENDS
from blobtree.formulas.contact import CONTACT_OPERATORS
from blobtree.formulas.convolution import CONVOLUTION_FIELDS
from blobtree.formulas.curve_skeletons import CURVE_SKELETONS
from blobtree.formulas.deformations import DEFORMATIONS
from blobtree.formulas.direct_fields import DIRECT_FIELDS
from blobtree.formulas.falloffs import MORE_FALLOFFS
from blobtree.formulas.fields import FieldKind
from blobtree.formulas.flat_skeletons import FLAT_SKELETONS
from blobtree.formulas.operators import Operator
from blobtree.formulas.skeletons import Skeleton
from blobtree.formulas.solid_skeletons import SOLID_SKELETONS
from blobtree.formulas.volumes import VOLUME_FIELDS
from blobtree.formulas.warps import SpaceWarp

LIBRARY_SKELETONS: tuple[Skeleton, ...] = (*CURVE_SKELETONS, *FLAT_SKELETONS, *SOLID_SKELETONS)
LIBRARY_OPERATORS: tuple[Operator, ...] = (
    *BLENDS,
    *CONTACT_OPERATORS,
)
LIBRARY_WARPS: tuple[SpaceWarp, ...] = DEFORMATIONS
LIBRARY_FIELDS: tuple[FieldKind, ...] = (*DIRECT_FIELDS, *CONVOLUTION_FIELDS, *VOLUME_FIELDS)
LIBRARY_FALLOFFS: tuple[Falloff, ...] = MORE_FALLOFFS
