"""Attributes of leaves: numbers, vectors and labels by name, which belong to the user."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, cast

from blobtree.declare.parameters import CHECKS, Quantity
from blobtree.errors import InvalidNode
from blobtree.validation import describe, finite_number

AttributeValue = float | tuple[float, ...] | str
"""A number, a vector of up to three numbers, or a label."""

AttributeMapping = Mapping[str, float | Sequence[float] | str]
"""Attributes as users write them."""

LONGEST_VECTOR = 3


class Attributes(Mapping[str, AttributeValue]):
    """A constant dictionary of attributes, which nodes compare and hash as a value.

    Examples
    --------
    >>> from blobtree import Point
    >>> Point((0, 0, 0), radius=1.0, attributes={"age": 3, "bone": "arm"}).attributes["age"]
    3.0
    """

    def __init__(self, values: Mapping[str, AttributeValue]) -> None:
        self._values = dict(sorted(values.items()))

    def __getitem__(self, name: str) -> AttributeValue:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(tuple(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


NO_ATTRIBUTES = Attributes({})


def checked_attributes(name: str, value: object) -> Attributes:
    """Return attributes with checked values; raise `InvalidNode` for other types."""
    if isinstance(value, Attributes):
        return value
    if not isinstance(value, Mapping):
        raise InvalidNode(f"{name}: expected a dictionary such as {{'age': 3.0}}, got {describe(value)}")
    return Attributes({_name(key): _value(f"{name}[{key!r}]", item) for key, item in value.items()})


def _name(key: object) -> str:
    if not isinstance(key, str) or not key:
        raise InvalidNode(f"attributes: expected names as keys, got {describe(key)}")
    return key


def _value(name: str, value: object) -> AttributeValue:
    if isinstance(value, str):
        return value
    try:
        numbers = tuple(cast(Iterable[Any], value))
    except TypeError:
        return finite_number(name, value)
    if not 1 <= len(numbers) <= LONGEST_VECTOR:
        raise InvalidNode(f"{name}: expected a number, up to three numbers or a label, got {describe(value)}")
    return tuple(finite_number(name, number) for number in numbers)


CHECKS[Quantity.ATTRIBUTES] = checked_attributes
