"""What can go wrong in a BlobTree.

BlobTreeError (ValueError)
├── InvalidNode         a node was given a parameter that makes no field
├── InvalidPoints       points to evaluate are not a finite n×3 array
├── InvalidResolution   a cell size or resolution that no grid can have
├── InvalidDevice       a Warp device that there is not
├── InvalidFile         a file that holds no BlobTree
├── InvalidDefinition   an own skeleton or operator is not what its definition claims
├── UnknownKind         a node of an own kind that this process has no definition of
├── MissingPackage      a package that this one call needs is not installed (also an ImportError)
├── Cancelled           the caller's `cancel` stopped the work
└── UntranslatableFunction   a typed function outside the subset that GLSL shares
"""


class BlobTreeError(ValueError):
    """Root of every error that `blobtree` raises on purpose."""


class InvalidNode(BlobTreeError):
    """A node was given a parameter that makes no field."""


class InvalidPoints(BlobTreeError):
    """Points to evaluate are not a finite n×3 array."""


class InvalidResolution(BlobTreeError):
    """A cell size or resolution that no grid can have."""


class InvalidDevice(BlobTreeError):
    """A Warp device that there is not."""


class InvalidFile(BlobTreeError):
    """A file that holds no BlobTree."""


class InvalidDefinition(BlobTreeError):
    """A user's skeleton or operator is not what its definition claims."""


class UnknownKind(BlobTreeError):
    """A node of a user's kind that this process has no definition of."""


class MissingPackage(BlobTreeError, ImportError):
    """A package that this one call needs is not installed."""


class Cancelled(BlobTreeError):
    """The caller's `cancel` stopped the work; nothing has changed."""


class UntranslatableFunction(BlobTreeError):
    """A typed function steps outside the subset of Python that GLSL shares."""
