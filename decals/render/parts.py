"""Pieces of a picture: what is drawn part by part is the same as the whole at once."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Part:
    """From where to where in something that is drawn part by part: rows, or faces; 0 to 1."""

    begin: float = 0.0
    end: float = 1.0

    def of(self, count: int) -> tuple[int, int]:
        """Number of the first of these many, and of the first after the last."""
        return round(self.begin * count), round(self.end * count)


WHOLE = Part()

Step = Callable[[Part], None]
"""Something that a picture takes. Its parts, one after the other, are the same as the whole at once."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Lower left corner and size, in samples."""

    x: int
    y: int
    width: int
    height: int

    @property
    def area(self) -> int:
        """Number of samples."""
        return self.width * self.height

    def rows(self, part: Part) -> "Rectangle":
        """Give a part of its rows."""
        first, last = part.of(self.height)
        return Rectangle(self.x, self.y + first, self.width, last - first)

    def around(self, other: "Rectangle") -> "Rectangle":
        """Give the smallest rectangle that holds both."""
        x, y = min(self.x, other.x), min(self.y, other.y)
        right = max(self.x + self.width, other.x + other.width)
        top = max(self.y + self.height, other.y + other.height)
        return Rectangle(x, y, right - x, top - y)
