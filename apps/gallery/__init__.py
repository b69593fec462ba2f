"""Examples: ``implicit-decals gallery NAME -o picture.png`` draws the picture of one.

The function ``panels`` of each module makes the scenes that its picture shows side by side.
The first line of its docstring is the example's title.
"""

import ast
from importlib.resources import files
from typing import Literal, get_args

Example = Literal[
    "field",
    "sphere",
    "edges",
    "spanning",
    "stain",
    "pairs",
    "touching",
    "by_hand",
    "particles",
    "deforming",
    "posing",
    "painted",
    "models",
    "dragon",
    "interactions",
    "layers",
    "materials",
    "environments",
    "relief",
    "contact_modes",
    "size_ratio",
    "mapping_modes",
    "custom_nodes",
    "creases",
    "pressed_solids",
]
"""The name of an example."""

EXAMPLES: tuple[Example, ...] = get_args(Example)
"""The names of all examples."""

DOWNLOADED = ("models", "dragon")
"""The examples whose meshes pyvista downloads on first use."""

SIDE = 300
"""Width and height of a panel of a picture, in pixels."""


def title(name: Example) -> str:
    """Return the title of an example, without importing it."""
    source = files(__name__).joinpath(f"{name}.py").read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source)) or ""
    return docstring.partition("\n")[0]
