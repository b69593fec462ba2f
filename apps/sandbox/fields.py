"""Fields in which numbers are typed: which one was refused and why, and which ones show a stale text."""

from typing import Any


class Fields:
    """The fields of a page, by keys such as ``"node center 1"``."""

    def __init__(self) -> None:
        self._refused = self._control = self._text = self._typed = ""
        self._resets: dict[str, int] = {}
        self._before = 0

    def typed(self, panel: object, name: object, index: object, refusal: str, before: int) -> None:
        """Note what was typed in a field, and why it was refused; "" if it was not.

        Parameters
        ----------
        panel, name, index
            The control, and the number of it.
        refusal
            The reason, with the range of the value.
        before
            The number `EditSession.changes` before.
        """
        control, self._before = f"{panel} {name}", before
        self._typed = " ".join([control, *map(str, index if isinstance(index, list) else ())])
        if refusal:
            self._refused, self._control, self._text = self._typed, control, refusal
            self._reset()
        elif control == self._control:
            self._refused = self._control = self._text = ""

    def _reset(self) -> None:
        """Let the field in which was typed last show its value, in place of what was typed."""
        self._resets[self._typed] = self._resets.get(self._typed, 0) + 1

    def values(self, changes: int) -> dict[str, Any]:
        """Return the values of the page.

        Parameters
        ----------
        changes
            The number `EditSession.changes`. A change that follows the typed value may undo it before the
            page has seen it.
        """
        if self._typed and changes > self._before + 1:
            self._reset()
            self._typed = ""
        return {
            "refused": self._refused,
            "control": self._control,
            "text": self._text,
            "resets": dict(self._resets),
        }
