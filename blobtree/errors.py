"""What can go wrong in a BlobTree.

BlobTreeError (ValueError)
├── InvalidNode         a node was given a parameter that makes no field
├── InvalidPoints       points to evaluate are not a finite n×3 array
├── InvalidResolution   a cell size or resolution that no grid can have
├── InvalidFile         a file that holds no BlobTree
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


class InvalidFile(BlobTreeError):
    """A file that holds no BlobTree."""


class UntranslatableFunction(BlobTreeError):
    """A typed function steps outside the subset of Python that GLSL shares."""
