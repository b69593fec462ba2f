"""The exceptions of this package; `blobtree.errors` has the rest of the tree.

::

    ImplicitDecalsError(Exception)            root of every error raised on purpose
    ├── InvalidInput(ValueError)              an argument that cannot be used
    │   ├── InvalidDecals                     arrays that are no decals: shapes, NaN, radius ≤ 0
    │   │   └── InvalidRow(IndexError)        a selection of decals that do not exist
    │   ├── InvalidMesh                       a mesh without a surface: empty, NaN, zero area
    │   ├── InvalidScattering                 an impossible request for particles: negative count, no surface
    │   ├── InvalidImage                      a file or array that is no image
    │   ├── InvalidScene                      a scene or scene file that is not consistent
    │   ├── InvalidEdit                       a command that the document cannot take
    │   └── TooMuchData                       more than fits into a texture of this graphics card
    └── (blobtree.errors has the others)
"""

from blobtree.errors import (
    Cancelled,
    ImplicitDecalsError,
    InvalidDevice,
    InvalidInput,
    InvalidPoints,
    MissingPackage,
    NoGraphics,
)

__all__ = [
    "Cancelled",
    "ImplicitDecalsError",
    "InvalidDecals",
    "InvalidDevice",
    "InvalidEdit",
    "InvalidImage",
    "InvalidInput",
    "InvalidMesh",
    "InvalidPoints",
    "InvalidRow",
    "InvalidScattering",
    "InvalidScene",
    "MissingPackage",
    "NoGraphics",
    "TooMuchData",
]


class InvalidDecals(InvalidInput):
    """Arrays that do not describe decals."""


class InvalidRow(InvalidDecals, IndexError):
    """A selection of decals that is no slice, mask or index of theirs; iteration ends at it."""


class InvalidMesh(InvalidInput):
    """A mesh without a surface to put decals on."""


class InvalidScattering(InvalidInput):
    """An impossible request for particles."""


class InvalidImage(InvalidInput):
    """A file or array that is no image."""


class InvalidScene(InvalidInput):
    """A scene or scene file that is not consistent."""


class InvalidEdit(InvalidInput):
    """A command that the document cannot take."""


class TooMuchData(InvalidInput):
    """More decals, or a larger tree, than fit into a texture of this graphics card."""
