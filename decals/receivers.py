"""Receivers: which objects of a scene decals lie on, by names and labels, as masks that shaders read."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.validation import describe
from decals.errors import ImplicitDecalsError, InvalidDecals
from decals.validation import is_unicode

TEXT = np.dtypes.StringDType()
"""Type of arrays of receivers."""

MAX_RECEIVERS = 30
"""Most different receivers of the decals of a scene: a mask is an int32, its bit 0 stands for any object."""

EVERYTHING = -1
"""Mask of surface that all decals lie on."""


def label_names(name: str, text: object, error: type[ImplicitDecalsError]) -> tuple[str, ...]:
    """Return labels that are given as one text with commas, or as several texts; none twice."""
    parts: Any = text.split(",") if isinstance(text, str) else text
    try:
        listed: list[Any] = [parts] if isinstance(parts, bytes) else list(parts)
    except TypeError:
        raise error(f"{name}: expected labels such as 'hull, lid', got {describe(text)}") from None
    for part in listed:
        if not isinstance(part, str) or not is_unicode(part) or "\0" in part or "," in part:
            raise error(f"{name}: expected labels of letters, without commas, got {describe(part)}")
    if text == "":
        return ()
    labels = tuple(part.strip() for part in listed)
    if not all(labels):
        raise error(f"{name}: expected labels such as 'hull, lid', got an empty one in {describe(text)}")
    return tuple(dict.fromkeys(labels))


def receiver_array(name: str, values: Any, count: int) -> NDArray[Any]:
    """Return the receivers of decals as a new array of texts; one text stands for all."""
    is_text = isinstance(values, np.ndarray) and values.shape == (count,) and values.dtype == TEXT
    if is_text and not (values != "").any():  # empty texts, as most decals have them, need no check of each
        return np.zeros(count, TEXT)
    given = values.tolist() if isinstance(values, np.ndarray) else values
    rows = [given] * count if isinstance(given, str) else given
    if not isinstance(rows, list | tuple) or len(rows) != count:
        raise InvalidDecals(
            f"{name}: expected one text, or one for each of {count} decals, got {describe(values)}"
        )
    texts = {row: ", ".join(label_names(name, row, InvalidDecals)) for row in set(map(_text, rows))}
    receivers = np.array([texts[row] for row in rows], TEXT)
    codes_of(receivers, [""])  # raises for too many different ones
    return receivers


def _text(row: object) -> str:
    if not isinstance(row, str):
        raise InvalidDecals(f"receivers: expected texts such as 'hull, lid', got {describe(row)} in a row")
    return row


def codes_of(receivers: NDArray[Any], table: list[str]) -> NDArray[np.int32]:
    """Return the place of each decal's receivers in a table of texts; new ones are appended to the table.

    Raises
    ------
    InvalidDecals
        The table would have more than MAX_RECEIVERS texts besides that for any object. It stays as it is.
    """
    if not (receivers != "").any():
        return np.zeros(len(receivers), np.int32)
    texts, places = np.unique(receivers, return_inverse=True)
    new = [text for text in texts.tolist() if text not in table]
    if len(table) + len(new) > MAX_RECEIVERS + 1:
        raise InvalidDecals(
            f"receivers: expected at most {MAX_RECEIVERS} different ones, got {len(table) + len(new) - 1}; "
            "give objects common labels"
        )
    table += new
    return np.array([table.index(text) for text in texts.tolist()], np.int32)[places]


def labels_of(item: object) -> frozenset[str]:
    """Return the labels of an object of a scene: its name, and those that it has besides."""
    return frozenset((str(getattr(item, "name", "")), *getattr(item, "labels", ())))


def surface_mask(labels: Iterable[str], table: Sequence[str], *, named_only: bool = False) -> int:
    """Return the mask of surface with labels: bit i is 1 if decals with the receivers ``table[i]`` lie on it.

    The first text of the table is empty: any object, but for those that take decals by name only.
    """
    known = frozenset(labels)
    bits = [not named_only, *(not known.isdisjoint(text.split(", ")) for text in table[1:])]
    return sum(1 << place for place, bit in enumerate(bits) if bit)


def object_mask(item: object, table: Sequence[str]) -> int:
    """Return the mask of an object of a scene."""
    return surface_mask(labels_of(item), table, named_only=takes_named_only(item))


def mask_on(
    on: object | str | Iterable[str] | None, table: Sequence[str], error: type[ImplicitDecalsError]
) -> int:
    """Return the mask of an object, or of surface with labels; None is surface that all decals lie on."""
    if on is None:
        return EVERYTHING
    return (
        object_mask(on, table) if hasattr(on, "name") else surface_mask(label_names("on", on, error), table)
    )


def takes_named_only(item: object) -> bool:
    """Return True for an object on which only decals lie that name it as their receiver."""
    return bool(getattr(item, "named_only", False))


def check_receivers(
    receivers: NDArray[Any], objects: Sequence[object], error: type[ImplicitDecalsError]
) -> None:
    """Raise an error for receivers that are neither names nor labels of objects, if there are any."""
    if not objects or not (receivers != "").any():
        return
    known = frozenset[str]().union(*map(labels_of, objects))
    for text in np.unique(receivers).tolist():
        for label in filter(None, text.split(", ")):
            if label not in known:
                raise error(
                    f"receivers: expected names or labels of objects, one of {', '.join(sorted(known))}; "
                    f"got {label!r}; correct it, or give an object this label"
                )
