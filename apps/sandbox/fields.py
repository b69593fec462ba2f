"""Fields in which numbers are typed: which one was refused and why, and which ones show a stale text."""

from typing import Any


class Fields:
    """The fields of a page, by keys such as ``"node center 1"``."""

    def __init__(self) -> None:
        self._refused = self._control = self._text = self._typed = ""
        self._resets: dict[str, int] = {}
        self._stale = ""
        self._before = 0
        self._refusals: int | None = None

    def typed(
        self, panel: object, name: object, index: object, refusal: str, before: int, refusals: int
    ) -> None:
        """Note what was typed in a field, and why it was refused; "" if it was not.

        Parameters
        ----------
        panel, name, index
            The control, and the number of it.
        refusal
            The reason, with the range of the value.
        before
            The number `EditSession.changes` before.
        refusals
            The number `ActionState.refusals` now: more of them follow if the edit is refused later.
        """
        control, self._before = f"{panel} {name}", before
        self._typed = " ".join([control, *map(str, index if isinstance(index, list) else ())])
        self._refusals = None if refusal else refusals
        if refusal:
            self._refuse(refusal)
        elif control == self._control:
            self._refused = self._control = self._text = ""

    def _refuse(self, refusal: str) -> None:
        self._refused, self._control = self._typed, " ".join(self._typed.split(" ")[:2])
        self._text, self._stale = refusal, self._typed

    def values(self, changes: int, refusals: int, refusal: str, *, working: bool) -> dict[str, Any]:
        """Return the values of the page; a field with a stale text shows its value again.

        Parameters
        ----------
        changes
            The number `EditSession.changes`. A change that follows the typed value may undo it before the
            page has seen it.
        refusals, refusal
            The number `ActionState.refusals`, and the reason of the last one.
        working
            True while edits go on in the background, the typed one perhaps.
        """
        if self._refusals is not None and refusals > self._refusals:
            self._refuse(refusal)
            self._refusals = None
        elif not working:
            self._refusals = None
        if self._typed and changes > self._before + 1 and self._refusals is None:
            self._stale, self._typed = self._typed, ""
        if self._stale:  # once: a page that sees two resets together sees none
            self._resets[self._stale] = self._resets.get(self._stale, 0) + 1
            self._stale = ""
        return {
            "refused": self._refused,
            "control": self._control,
            "text": self._text,
            "resets": dict(self._resets),
        }
