"""Examples: ``python -m decals.apps.gallery.NAME -o picture.png`` draws the picture of one.

The function ``panels`` of each module makes the scenes that its picture shows side by side.
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
    "custom_nodes",
    "creases",
)
"""The names of all examples."""

DOWNLOADED = ("models", "dragon")
"""The examples whose meshes pyvista downloads on first use."""
