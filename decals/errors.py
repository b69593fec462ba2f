"""What can go wrong with decals, as exceptions.

::

    DecalsError(Exception)                    everything this package raises on purpose
    ├── InvalidDecals(ValueError)             arrays that are no decals: shapes, NaN, radius ≤ 0, ...
    ├── InvalidMesh(ValueError)               a mesh that has no surface: empty, NaN, zero area, ...
    ├── InvalidPoints(ValueError)             points or directions that are none: shapes, NaN, ...
    ├── InvalidDevice(ValueError)             a Warp device that there is not
    ├── InvalidSeeding(ValueError)            an impossible wish for seeds: negative count, no surface, ...
    ├── InvalidImage(ValueError)              a file or array that is no image
    ├── InvalidScene(ValueError)              a scene or scene file that does not hold together
    ├── InvalidEdit(ValueError)               a command that makes no sense for the document as it is
    ├── TooMuchData(ValueError)               more than fits into a texture of this graphics card
    └── NoGraphics(RuntimeError)              no usable OpenGL here; the message says what to install

A message says what was expected, what came, and what to do.
"""


class DecalsError(Exception):
    """Root of every error that this package raises on purpose."""


class InvalidDecals(DecalsError, ValueError):
    """Arrays that do not describe decals."""


class InvalidMesh(DecalsError, ValueError):
    """A mesh that has no surface to put decals on."""


class InvalidPoints(DecalsError, ValueError):
    """Points or directions that are none."""


class InvalidDevice(DecalsError, ValueError):
    """A Warp device that there is not."""


class InvalidSeeding(DecalsError, ValueError):
    """A wish for seeds that cannot be met."""


class InvalidImage(DecalsError, ValueError):
    """A file or array that is no image."""


class InvalidScene(DecalsError, ValueError):
    """A scene, or a scene file, that does not hold together."""


class InvalidEdit(DecalsError, ValueError):
    """A command that makes no sense for the document as it is."""


class TooMuchData(DecalsError, ValueError):
    """More decals, or a larger tree, than fit into a texture of this graphics card."""


class NoGraphics(DecalsError, RuntimeError):
    """No usable OpenGL on this machine; the message says what to install."""
