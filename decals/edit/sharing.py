"""How work in a thread leaves Python's lock to who draws frames."""

import sys
import threading

SWITCH = 0.0005
"""Seconds after which a thread that runs Python makes room for another one, in place of Python's 0.005."""


class ShortTurns:
    """Within a ``with`` block Python's threads take turns more often; blocks nest, in any threads.

    A frame gives the lock away dozens of times, for every call to the card, and waits for it each time.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._usual = sys.getswitchinterval()

    def __enter__(self) -> None:
        with self._lock:
            if not self._inside:
                self._usual = sys.getswitchinterval()
                sys.setswitchinterval(min(SWITCH, self._usual))
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                sys.setswitchinterval(self._usual)


SHORT_TURNS = ShortTurns()
"""One for the whole interpreter, as the interval is."""
