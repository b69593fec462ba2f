"""Attacks on the sandbox's servers, in each way of starting: how many get anything."""

from tests.apps.sandbox.attacks import WAYS, attempt

TARGETS = {"attacks_open": "0"}

QUICK = ("--share",)
"""Ways of starting that are tried quickly."""


def measure(*, quick: bool) -> dict[str, float]:
    """Try all attacks on real servers."""
    results = [got for way in (QUICK if quick else WAYS) for got in attempt(way).values()]
    return {"attacks_open": sum(map(bool, results)), "attack_cases": len(results)}
