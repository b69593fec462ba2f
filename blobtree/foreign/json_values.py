"""JSON of any depth as plain values, and the checks of what foreign files hold.

The parsers of the standard library and of msgspec recurse, and scenes of a thousand nested unions exist.
"""

import json
import re
from collections.abc import Callable, Iterator
from typing import Any

from blobtree.errors import InvalidFile
from blobtree.validation import LARGEST_NUMBER, describe

_TOKEN = re.compile(r'[ \t\n\r]*("(?:[^"\\]|\\.)*"|-?\d[-+.\deE]*|true|false|null|[][{},:]|$)', re.DOTALL)

Members = dict[str, Any]


def parsed_json(text: bytes) -> Any:
    """Return the value of a JSON text.

    Raises
    ------
    InvalidFile
        It is no JSON; the message names the line.
    """
    try:
        return _Parser(text.decode("utf-8-sig")).value()
    except UnicodeDecodeError as error:
        raise InvalidFile(f"expected JSON in UTF-8, got other bytes at {error.start}") from None


class _Parser:
    """A parser with a stack of its own."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._place = 0
        self._tokens = self._read()

    def _read(self) -> Iterator[str]:
        while True:
            found = _TOKEN.match(self._text, self._place)
            if found is None:
                raise self._refusal(f"a value, got {self._text[self._place : self._place + 20].strip()!r}")
            self._place = found.end()
            yield found[1]

    def _refusal(self, expected: str) -> InvalidFile:
        line = self._text.count("\n", 0, self._place) + 1
        return InvalidFile(f"no valid JSON in line {line}: expected {expected}")

    def _next(self, allowed: str = "") -> str:
        token = next(self._tokens)
        if not token:
            raise self._refusal("more, the file ends too early")
        if allowed and token not in allowed.split(" "):
            raise self._refusal(f"{' or '.join(allowed.split(' '))}, got {token[:20]}")
        return token

    def _scalar(self, token: str) -> Any:
        try:
            return json.loads(token, parse_int=float)
        except ValueError:
            raise self._refusal(f"a value, got {token[:20]}") from None

    def _key(self, token: str) -> str:
        if not token.startswith('"'):
            raise self._refusal(f"the name of a field, got {token[:20]}")
        key: str = self._scalar(token)
        self._next(":")
        return key

    def value(self) -> Any:
        """Return the value of the whole text."""
        open_values: list[tuple[Any, str]] = []
        token = self._next()
        while True:
            if token in ("{", "["):
                value: Any = {} if token == "{" else []
                end = "}" if token == "{" else "]"
                token = self._next()
                if token != end:
                    key = self._key(token) if end == "}" else ""
                    open_values.append((value, key))
                    token = self._next() if end == "}" else token
                    continue
            else:
                value = self._scalar(token)
            while open_values:
                around, key = open_values.pop()
                if isinstance(around, dict):
                    around[key] = value
                    if self._next(", }") == ",":
                        open_values.append((around, self._key(self._next())))
                        break
                else:
                    around.append(value)
                    if self._next(", ]") == ",":
                        open_values.append((around, ""))
                        break
                value = around
            else:
                if next(self._tokens):
                    raise self._refusal("no more values")
                return value
            token = self._next()


def member(values: Any, name: str, place: str) -> Any:
    """Return a field of an object in a file, which `place` names in errors."""
    if not isinstance(values, dict):
        raise InvalidFile(f"{place}: expected an object in braces, got {describe(values)}")
    if name not in values:
        raise InvalidFile(f"{place}: the field {name!r} is missing")
    return values[name]


def number(values: Any, name: str, place: str, low: float = -LARGEST_NUMBER, default: Any = None) -> float:
    """Return a number of an object, at least `low`; if it is missing, the default, where one is given."""
    if default is not None and isinstance(values, dict) and name not in values:
        return float(default)
    return as_number(member(values, name, place), f"{place}: {name}", low)


def as_number(value: Any, place: str, low: float = -LARGEST_NUMBER) -> float:
    """Return a value as a number from `low` on."""
    if not isinstance(value, float) or not low <= value <= LARGEST_NUMBER:
        raise InvalidFile(
            f"{place}: expected a number from {low:g} to {LARGEST_NUMBER:g}, got {describe(value)}"
        )
    return value


def numbers(
    values: Any, name: str, place: str, count: int, low: float = -LARGEST_NUMBER
) -> tuple[float, ...]:
    """Return a list of so many numbers of an object."""
    found = member(values, name, place)
    if not isinstance(found, list) or len(found) != count:
        raise InvalidFile(f"{place}: {name}: expected a list of {count} numbers, got {describe(found)}")
    return tuple(as_number(value, f"{place}: {name}", low) for value in found)


def chosen(table: dict[str, Callable[..., Any]], name: Any, what: str, place: str) -> Callable[..., Any]:
    """Return an entry of a table by the name that a file gives."""
    if not isinstance(name, str) or name not in table:
        raise InvalidFile(f"{place}: expected {what} among {', '.join(table)}; got {describe(name)}")
    return table[name]
