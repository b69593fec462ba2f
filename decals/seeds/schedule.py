"""How the law of repulsion changes while particles come to rest."""

import numpy as np

from decals.seeds.repulsion import Law

EXPONENTS = (2.0, 3.0)
"""Power law of the repulsion at the first and the last step."""

STIFFNESS = 1000.0
"""Of the spring between particles that are too close, at the end."""

EVENING = 600.0
"""Weight of rings of six that are wider or narrower than the mean one, at the end."""

HARDENING = (0.6, 1.0)
"""Parts of the schedule between which both rise from nothing: first spread, then even out and pack."""

NEARBY = Law(EXPONENTS[1], STIFFNESS)
"""For a few particles among others that do not move: rings of those are not whole."""


def law_at(part: float, rest: float) -> Law:
    """How particles repel each other, by the part of the schedule done, at most 1.

    `rest` is the part of it that they have had since surfaces deformed: rings are evened out where nearly
    everybody is at rest, since elsewhere that would hold flaws fast.
    """
    first, last = EXPONENTS
    hardness, evenness = np.interp((part, rest), HARDENING, (0.0, 1.0))
    return Law(
        first + (last - first) * min(part, 1.0), STIFFNESS * float(hardness), EVENING * float(evenness)
    )
