"""Runnable examples, a picture each: ``python -m implicit_decals.apps.gallery.NAME -o picture.png``.

Every module has a function ``panels``, which makes the scenes that stand side by side in its picture.
"""

EXAMPLES = (
    "sphere",
    "edges",
    "spanning",
    "touching",
    "particles",
    "deforming",
    "painted",
    "models",
    "dragon",
    "interactions",
    "layers",
    "contact_modes",
    "size_ratio",
    "mapping_modes",
    "own_nodes",
    "creases",
)
"""Names of the examples."""

DOWNLOADED = ("models", "dragon")
"""Examples whose meshes pyvista downloads on first use."""
