"""Edits that a thread computed for a former state of a document, carried over to the present state."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from decals.editing.document import Document, Edit
from decals.editing.inputs import COLUMNS
from decals.errors import InvalidEdit


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
