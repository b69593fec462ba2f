"""Edits of a window as steps: whether they take long, and what they read of a document.

A step that takes long belongs in the background. A command reads a part of the document. While only other
parts change, its result stays valid.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from decals.editing.commands import DecalCommand
from decals.editing.document import Document
from decals.editing.session import Command, EditSession
from decals.errors import InvalidEdit
from decals.model import Decals
from decals.scenes.objects import SceneObject, TreeObject

MAX_IMMEDIATE_DECALS = 500
"""Commands for more decals than this run in the background."""

BUSY = "another edit is running; wait for it, or press Escape to cancel it"


class Busy(InvalidEdit):
    """The request has to wait for another edit.

    Attributes
    ----------
    label
        What the request does, in a few words.
    """

    def __init__(self, label: str) -> None:
        super().__init__(BUSY)
        self.label = label


Step = Callable[[EditSession], str]
"""Edits a session, and returns a message for the user (empty for none)."""


def are_many(numbers: ArrayLike) -> bool:
    """Return True if an edit of these decals belongs in the background."""
    return np.size(numbers) > MAX_IMMEDIATE_DECALS


def takes_long(command: Command) -> bool:
    """Return True if a command belongs in the background: it is `long`, or edits many decals.

    Commands that query surfaces at many points, or build surfaces, are long.
    """
    if isinstance(command, DecalCommand):
        return are_many(command.numbers)
    return bool(getattr(command, "long", False))


def step_of(command: Command) -> Step:
    """Return the step that carries out a command."""

    def step(session: EditSession) -> str:
        session.do(command)
        return command.label

    return step


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
