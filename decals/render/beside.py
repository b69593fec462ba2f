"""Pieces that need no graphics, made in a thread while the caller goes on."""

import threading
from collections.abc import Sequence

from decals.render.pieces import Piece


class Beside:
    """Makes, in a thread, those of some pieces that may be made there; whoever asks later finds them."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._error: Exception | None = None
        self.news = ""
        apart = [piece for piece in pieces if piece.beside]
        self._thread = threading.Thread(target=self._run, args=(apart,), name="pieces", daemon=True)
        self._thread.start()

    def _run(self, pieces: list[Piece]) -> None:
        try:
            for piece in pieces:
                self.news = piece.name
                piece.make()
        except Exception as error:  # it is raised where somebody waits
            self._error = error

    def end(self) -> None:
        """Wait until the thread has ended, whatever came of it."""
        self._thread.join()

    def done(self, seconds: float) -> bool:
        """Wait for so long at most; whether all is made. What went wrong is raised here, once.

        What is missing then is made by whoever asks for it: another scene may need no more of the same.
        """
        self._thread.join(seconds)
        error, self._error = self._error, None
        if error is not None:
            raise error
        return not self._thread.is_alive()
