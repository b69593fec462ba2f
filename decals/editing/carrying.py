"""Edits that a thread computed for a former state of a document, carried over to the present state.

A command reads a part of the document. While only other parts change, its result stays valid.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from decals.editing.document import Document, Edit
from decals.errors import InvalidEdit
from decals.model import Decals
from decals.scenes.objects import SceneObject, TreeObject

Inputs = Callable[[Document], object]
"""Returns what a command reads, as a value that is equal for states between which its result stays valid."""

LOOKS = ("images", "tints", "opacities")
"""Arrays of decals that decide about no other decal and no surface."""

COLUMNS = tuple(field.name for field in fields(Decals))
"""Names of all arrays of decals."""


def inputs_of(command: object) -> Inputs:
    """Return what a command reads by its method ``inputs``, else all objects, and decals but their looks."""
    own: Inputs | None = getattr(command, "inputs", None)
    return usual_inputs if own is None else own


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


def shapes_of(objects: tuple[SceneObject, ...]) -> object:
    """Return the shapes of objects, without their names and flags."""
    shapes = ((i.tree,) if isinstance(i, TreeObject) else (i.vertices, i.faces) for i in objects)
    return tuple((tuple(map(_Same, shape)), i.origin) for shape, i in zip(shapes, objects, strict=True))


def columns_of(decals: Decals) -> object:
    """Return all arrays of decals but their looks."""
    return tuple(_comparable(getattr(decals, name)) for name in COLUMNS if name not in LOOKS)


def _comparable(column: np.ndarray[Any, Any]) -> object:
    return column.tolist() if column.dtype.kind == "T" else column.tobytes()


@dataclass(frozen=True, eq=False)
class CarriedEdit:
    """An edit of a former state: only the values that it changed change now, and new decals get new numbers.

    Parameters
    ----------
    edit
        The edit.
    label
        Name of the undo entry.
    """

    edit: Edit
    label: str

    def compute(self, document: Document) -> Edit:
        """Return the edit of the present state, or raise `InvalidEdit` if another edit changed the same."""
        before, after = self.edit.before, self.edit.after
        old, new = before.numbers[before.exists], after.numbers[after.exists]
        kept = np.intersect1d(old, new)
        added, gone = np.setdiff1d(new, old), np.setdiff1d(old, new)
        if not document.decals.has(np.concatenate([kept, gone])).all():
            raise InvalidEdit("a decal was deleted meanwhile; repeat the edit")
        parts = {name: part for name, part in vars(self.edit.parts_after).items() if part is not None}
        for name in parts:
            if getattr(document, name) is not getattr(self.edit.parts_before, name):
                raise InvalidEdit(f"{name} of the scene changed meanwhile; repeat the edit")
        present = document.decals.take(kept)
        first, last = before.decals[_rows(old, kept)], after.decals[_rows(new, kept)]
        merged = present.replace(
            **{
                name: _merged(*(getattr(decals, name) for decals in (first, last, present)))
                for name in COLUMNS
            }
        )
        edit = document.compute_deletion(gone)
        edit = edit.then(document.compute_replacement(kept, merged, **parts))
        return edit.then(document.compute_addition(after.decals[_rows(new, added)])) if len(added) else edit


def _rows(numbers: np.ndarray[Any, Any], chosen: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the rows of numbers, which are among others."""
    order = np.argsort(numbers)
    rows: np.ndarray[Any, Any] = order[np.searchsorted(numbers, chosen, sorter=order)]
    return rows


def _merged(
    first: np.ndarray[Any, Any], last: np.ndarray[Any, Any], present: np.ndarray[Any, Any]
) -> np.ndarray[Any, Any]:
    """Return an array with the values that changed from the first to the last, and the present ones."""
    axes = tuple(range(1, first.ndim))
    changed, others = ((first != array).any(axis=axes) for array in (last, present))
    if (changed & others).any():
        raise InvalidEdit("another edit changed the same decals meanwhile; repeat the edit")
    result = present.copy()
    result[changed] = last[changed]
    return result
