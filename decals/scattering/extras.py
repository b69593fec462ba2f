"""Refinements of particles, in the order in which `Relaxation` applies them; each tuple may be empty."""

from decals.scattering.covering_rule import covering_decals
from decals.scattering.deform import carried
from decals.scattering.gap_filling import fill_gaps
from decals.scattering.part_shares import PartShares
from decals.scattering.polish import polish
from decals.scattering.relocation import Relocation
from decals.scattering.sizing import RULES, Sizing

RELOCATIONS = (Relocation, PartShares)
"""Made of a domain and spacings; called at intervals, they move particles of a state and return which."""

SEPARATIONS = (polish,)
"""Functions that part close pairs of a state after the last step."""

FILLINGS = (fill_gaps,)
"""Functions particles → particles after the last step."""

CARRIERS = (carried,)
"""Functions particles → particles when surfaces deform."""

RULES[Sizing.COVERING] = covering_decals
