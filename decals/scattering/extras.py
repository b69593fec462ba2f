"""Rules of radii, and refinements of particles in the order in which `Relaxation` applies them.

Each list may be empty.
"""

from collections.abc import Callable
from typing import Any

from blobtree.lazy import if_present
from decals.scattering.sizing import Rule, Sizing

RULES: dict[Sizing, Rule] = {}
"""Rules by their names, besides those of `decals.scattering.sizing`."""

RELOCATIONS: list[Callable[..., Any]] = []
"""Made of a domain and spacings; called at intervals, they move particles of a state and return which."""

PLACEMENTS: list[Callable[..., Any]] = []
"""Functions that move particles of a state to places that repulsion leaves bare, and return which."""

SEPARATIONS: list[Callable[..., Any]] = []
"""Functions that part close pairs of a state after the last step."""

FILLINGS: list[Callable[..., Any]] = []
"""Functions that move particles of a state beside gaps after the last step."""

CARRIERS: list[Callable[..., Any]] = []
"""Functions particles → particles when surfaces deform."""

with if_present():
    from decals.scattering.covering import covering_decals
    from decals.scattering.deform import carried
    from decals.scattering.gap_filling import fill_gaps
    from decals.scattering.polish import polish
    from decals.scattering.relocation import PartShares, Relocation, reach_narrow_places

    RULES[Sizing.COVERING] = covering_decals
    RELOCATIONS += [Relocation, PartShares]
    PLACEMENTS.append(reach_narrow_places)
    SEPARATIONS.append(polish)
    FILLINGS.append(fill_gaps)
    CARRIERS.append(carried)
