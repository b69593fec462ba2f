"""Parts and rectangles of a picture: drawn part by part it is the same as drawn at once."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Part:
    """A range of rows or faces of a drawing step, as fractions from 0 to 1."""

    begin: float = 0.0
    end: float = 1.0

    def of(self, count: int) -> tuple[int, int]:
        """Return the index of the first of ``count`` rows, and that after the last."""
        return round(self.begin * count), round(self.end * count)


WHOLE = Part()

Step = Callable[[Part], None]
"""A drawing step. Its parts, drawn in order, give the same as the whole."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle by its lower left corner and size, in samples."""

    x: int
    y: int
    width: int
    height: int

    @property
    def area(self) -> int:
        """Number of samples."""
        return self.width * self.height

    def rows(self, part: Part) -> "Rectangle":
        """Return a part of the rows."""
        first, last = part.of(self.height)
        return Rectangle(self.x, self.y + first, self.width, last - first)

    def around(self, other: "Rectangle") -> "Rectangle":
        """Return the smallest rectangle that encloses both."""
        x, y = min(self.x, other.x), min(self.y, other.y)
        right = max(self.x + self.width, other.x + other.width)
        top = max(self.y + self.height, other.y + other.height)
        return Rectangle(x, y, right - x, top - y)
