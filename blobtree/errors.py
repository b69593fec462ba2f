"""The exceptions of both packages, as one tree.

::

    ImplicitDecalsError(Exception)            root of every error raised on purpose
    ├── InvalidInput(ValueError)              an argument that cannot be used
    │   ├── InvalidNode                       a parameter that makes no field
    │   ├── InvalidPoints                     points or directions of a wrong shape, or not finite
    │   ├── InvalidResolution                 a cell size or resolution that no grid can have
    │   ├── InvalidDevice                     a Warp device that does not exist
    │   ├── InvalidFile                       a file that holds no BlobTree
    │   ├── InvalidDefinition                 a custom node that differs from what its definition claims
    │   ├── UnknownKind                       a custom node without a definition in this process
    │   ├── UntranslatableFunction            a typed function outside the subset that GLSL shares
    │   └── (decals.errors adds its own)
    ├── MissingPackage(ImportError)           an optional package is not installed
    ├── NoGraphics(RuntimeError)              no usable OpenGL or no screen; the message says what to do
    ├── UnusableCache                         the folder of compiled kernels cannot be written
    └── Cancelled                             the caller's `cancel` stopped the work

A message says what was expected, what came, and what to do.
"""


class ImplicitDecalsError(Exception):
    """Root of every error that `blobtree` and `decals` raise on purpose."""


class InvalidInput(ImplicitDecalsError, ValueError):
    """An argument that cannot be used."""


class InvalidNode(InvalidInput):
    """A node was given a parameter that makes no field."""


class InvalidPoints(InvalidInput):
    """Points or directions of a wrong shape, or not finite."""


class InvalidResolution(InvalidInput):
    """A cell size or resolution that no grid can have."""


class InvalidDevice(InvalidInput):
    """A Warp device that does not exist."""


class InvalidFile(InvalidInput):
    """A file that holds no BlobTree."""


class InvalidDefinition(InvalidInput):
    """A custom skeleton or operator differs from what its definition claims."""


class UnknownKind(InvalidInput):
    """A custom node without a definition in this process."""


class UntranslatableFunction(InvalidInput):
    """A typed function outside the subset of Python that GLSL shares."""


class MissingPackage(ImplicitDecalsError, ImportError):
    """An optional package is not installed."""


class NoGraphics(ImplicitDecalsError, RuntimeError):
    """No usable OpenGL on this machine, or no screen for a window; the message says what to do."""


class UnusableCache(ImplicitDecalsError):
    """The folder of compiled kernels cannot be written."""


class Cancelled(ImplicitDecalsError):
    """The caller's `cancel` stopped the work; nothing has changed."""
