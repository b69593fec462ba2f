"""How much memory there is, so that what would not fit is refused in words before it is begun."""

import re
from pathlib import Path

import warp as wp

from blobtree.errors import InvalidResolution

MEMINFO = Path("/proc/meminfo")
"""Where Linux says it; elsewhere nothing is known and nothing refused."""

GIGABYTE = 1e9


def available_memory(device: str) -> float | None:
    """Bytes that may still be taken on a Warp device, None where nobody says."""
    place = wp.get_device(device)
    if place.is_cuda:
        return float(place.free_memory)
    if not MEMINFO.exists():
        return None
    found = re.search(r"MemAvailable:\s+(\d+) kB", MEMINFO.read_text(encoding="ascii"))
    return 1024.0 * float(found[1]) if found else None


def demand_memory(amount: float, device: str, what: str) -> None:
    """Refuse what needs more bytes than there are.

    Raises
    ------
    InvalidResolution
        `amount` is not there.
    """
    there = available_memory(device)
    if there is not None and amount > there:
        raise InvalidResolution(
            f"{what} would take {amount / GIGABYTE:.3g} GB, {there / GIGABYTE:.3g} GB are free on {device}; "
            "take larger cells"
        )
