"""The exception of lessons."""

from decals.errors import InvalidInput


class InvalidLesson(InvalidInput):
    """A file of a lesson that cannot be used, or a scene in which its formulas have no value."""
