"""What edits in a thread read of a document: while only other parts change, their results stay valid."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from decals.editing.document import Document
from decals.model import Decals
from decals.scenes.objects import SceneObject, TreeObject

Inputs = Callable[[Document], object]
"""Returns what a command reads, as a value that is equal for states between which its result stays valid."""

LOOKS = ("images", "tints", "opacities")
"""Arrays of decals that decide about no other decal and no surface."""

COLUMNS = tuple(field.name for field in fields(Decals))
"""Names of all arrays of decals."""


def inputs_of(command: object) -> Inputs:
    """Return what a command reads by its method ``inputs``, else all objects, and decals but their looks.

    A command that copies decals says by its attribute ``reads_looks`` that it reads these too.
    """
    own: Inputs | None = getattr(command, "inputs", None)
    if own is not None:
        return own
    return all_inputs if getattr(command, "reads_looks", False) else usual_inputs


@dataclass(frozen=True, eq=False)
class _Same:
    """A value that is equal to itself alone, or to an array of the same numbers; it is kept for that."""

    value: object

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Same):
            return False
        values = self.value, other.value
        arrays = all(isinstance(value, np.ndarray) for value in values)
        return values[0] is values[1] or (arrays and np.array_equal(*values))  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]


def usual_inputs(document: Document) -> object:
    """Return all objects, and all arrays of decals but their looks."""
    return tuple(map(_Same, document.objects)), columns_of(document.decals.decals)


def all_inputs(document: Document) -> object:
    """Return all objects, and all arrays of decals."""
    decals = document.decals.decals
    return usual_inputs(document), tuple(_comparable(getattr(decals, name)) for name in LOOKS)


def shapes_of(objects: tuple[SceneObject, ...]) -> object:
    """Return the shapes of objects, without their names and flags."""
    shapes = ((i.tree,) if isinstance(i, TreeObject) else (i.vertices, i.faces) for i in objects)
    return tuple((tuple(map(_Same, shape)), i.origin) for shape, i in zip(shapes, objects, strict=True))


def columns_of(decals: Decals) -> object:
    """Return all arrays of decals but their looks."""
    return tuple(_comparable(getattr(decals, name)) for name in COLUMNS if name not in LOOKS)


def _comparable(column: np.ndarray[Any, Any]) -> object:
    return column.tolist() if column.dtype.kind == "T" else column.tobytes()
