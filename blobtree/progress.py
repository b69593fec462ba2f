"""How long work reports itself: one callback type, used by every room."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with the stage in plain words and the fraction of it that is done, from 0 to 1."""
