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
    ├── UnusableFile(OSError)                 a file that the system does not read or write
    │   └── MissingFile(FileNotFoundError)    a file or a folder that does not exist
    ├── UnusableCache                         the folder of compiled kernels cannot be written
    └── Cancelled                             the caller's `cancel` stopped the work

A message says what was expected, what came, and what to do.
"""

import errno
import os
from typing import Literal

__all__ = [
    "Cancelled",
    "ImplicitDecalsError",
    "InvalidDefinition",
    "InvalidDevice",
    "InvalidFile",
    "InvalidInput",
    "InvalidNode",
    "InvalidPoints",
    "InvalidResolution",
    "MissingFile",
    "MissingPackage",
    "NoGraphics",
    "UnknownKind",
    "UntranslatableFunction",
    "UnusableCache",
    "UnusableFile",
]


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


class UnusableFile(ImplicitDecalsError, OSError):
    """A file that the system does not read or write, with the number, reason and path of an OSError."""

    action: Literal["read", "write"] = "read"

    @classmethod
    def of(
        cls, error: OSError, path: "str | os.PathLike[str]", action: Literal["read", "write"]
    ) -> "UnusableFile":
        """Return the exception for an error of the system at a path."""
        number = error.errno or errno.EIO
        kind = MissingFile if number == errno.ENOENT else UnusableFile
        result = kind(number, error.strerror or str(error), os.fspath(path))
        result.action = action
        return result

    def __str__(self) -> str:
        advice = _ADVICE.get(self.errno or 0, "check the disk")
        if self.errno == errno.ENOENT:
            advice = "create its folder first" if self.action == "write" else "check its name"
        return f"could not {self.action} {self.filename!r} ({self.strerror}); {advice}"


class MissingFile(UnusableFile, FileNotFoundError):
    """A file, or the folder for a file, that does not exist."""


_ADVICE = {
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ENOSPC: "free space on the disk",
    errno.EFBIG: "free space on the disk",
    errno.EISDIR: "add the name of a file",
    errno.ENOTDIR: "choose another folder",
    errno.EACCES: "choose another folder, or change the permissions",
    errno.EPERM: "choose another folder, or change the permissions",
    errno.EROFS: "choose another folder",
    errno.EINVAL: "choose another name",
}
if hasattr(errno, "EDQUOT"):
    _ADVICE[errno.EDQUOT] = "free space on the disk"


class UnusableCache(ImplicitDecalsError):
    """The folder of compiled kernels cannot be written."""


class Cancelled(ImplicitDecalsError):
    """The caller's `cancel` stopped the work; nothing has changed."""
