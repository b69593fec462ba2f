"""Shipped experiments: ``implicit-decals sweep NAME`` runs the experiment of a module by its name.

Each module has the function `experiment`, the design `design`, which takes a minute or two on two cores, and
the larger design `full` of ``--full``. The first line of its docstring is the title.
"""

import ast
from importlib.resources import files
from typing import Literal, get_args

Shipped = Literal[
    "contact_modes",
    "contact_peers",
    "evenness",
    "figure_14",
    "cost",
    "blends",
    "pressed_solids",
    "devices",
]
"""The name of a shipped experiment."""

SHIPPED: tuple[Shipped, ...] = get_args(Shipped)
"""The names of all shipped experiments."""


def title(name: Shipped) -> str:
    """Return the title of an experiment, without importing it."""
    source = files(__name__).joinpath(f"{name}.py").read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source)) or ""
    return docstring.partition("\n")[0]
