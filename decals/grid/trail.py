"""Where edits changed anything: the balls of the decals that changed, as they were and as they are.

A decal acts on points within its reach alone, so what shows elsewhere is what it was, bit for bit: what a
point shows depends on the decals that reach it, in the order in which they are drawn, and on nothing else.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from decals.field.contact import Contact
from decals.grid.cells import REACH_WITH_SLACK
from decals.records import RIM_RADIUS

Balls = NDArray[np.float32]
"""Centres and radii of influence, ``float32[n, 4]``."""

MOST = 4096
"""Balls that are kept, and edits; who asks for older ones is told that anything may have changed."""

UNEVEN = 100.0
"""In radial contact, sizes that may differ so many times: rounding still tells reach from none.

(It does up to some 2,000 times: float32 has 2⁻²⁴, and what tells them apart falls with the square.)
"""


class Trail:
    """Balls that decals left or came to, with the version of the editor that has them."""

    def __init__(self) -> None:
        self._entries: deque[tuple[int, Balls]] = deque()
        self._count = 0
        self._forgotten = 0

    def add(self, version: int, balls: Balls) -> None:
        """Note where an edit changed something; old entries give way."""
        self._entries.append((version, balls))
        self._count += len(balls)
        while self._entries and (self._count > MOST or len(self._entries) > MOST):
            self._forgotten, dropped = self._entries.popleft()
            self._count -= len(dropped)

    def everywhere(self, version: int) -> None:
        """Note an edit that may have changed anything."""
        self._entries.clear()
        self._count, self._forgotten = 0, version

    def since(self, version: int) -> Balls | None:
        """Where something changed after a version; None for anywhere."""
        if version < self._forgotten:
            return None
        found = [balls for stamp, balls in self._entries if stamp > version]
        return np.concatenate(found) if found else np.zeros((0, 4), np.float32)


def reach_of(balls: Balls, contact: Contact, largest: float) -> NDArray[np.float64] | None:
    """Grow balls of influence to what changes with their decals, ``float64[n, 4]``; None for anything.

    In radial contact a decal stretches its neighbours' images along whole rays, from the rim where it is met
    back to the centre (`decals.field.cells.radial_complement`): as far as the ``largest`` influence of
    any decal has its rim. A decal that does not reach the rim there cuts no ray, unless it is so
    small beside the neighbour that rounding decides.
    """
    grown = balls.astype(np.float64)
    grown[:, 3] *= REACH_WITH_SLACK
    if contact is Contact.RADIAL and len(balls):
        widest = max(largest, float(balls[:, 3].max()))
        if widest > UNEVEN * float(balls[:, 3].min()):
            return None
        grown[:, 3] += RIM_RADIUS * widest
    return grown


def same_order(before: dict[int, int], after: dict[int, int]) -> bool:
    """Whether the levels that two indices share follow each other alike: sums over neighbours round alike."""
    return [size for size in before if size in after] == [size for size in after if size in before]
