"""Faults of odd calls, random edit commands, random messages, many windows and threads.

50,000 calls, 20,000 commands and 100,000 messages take hours on two cores, so `tests.bench.trust` makes a
tenth of them. ``python -m tests.fuzz --files 0 --kills 0 --calls 50000 --commands 20000`` and
``python -m tests.apps.sandbox.messages --count 100000`` make all.
"""

from tests.apps.sandbox import messages
from tests.endurance import thread_failures, window_failures
from tests.fuzz import fuzz

TARGETS = {
    "call_faults": "0",
    "command_faults": "0",
    "message_faults": "0",
    "thread_faults": "0",
    "window_faults": "0",
}

COUNTS = {"call": 5000, "command": 2000, "message": 10_000, "window": 100, "thread": 10}
"""Number of cases of each kind; of threads, how often each does all its work."""

QUICK = {"call": 200, "command": 100, "message": 100, "window": 3, "thread": 1}


def measure(*, quick: bool) -> dict[str, float]:
    """Run all kinds of cases, and count those that failed."""
    counts = QUICK if quick else COUNTS
    found = fuzz(files=0, calls=counts["call"], commands=counts["command"], kills=0, seed=0)
    figures: dict[str, float] = {}
    for kind in ("call", "command"):
        figures[f"{kind}_faults"] = sum(map(len, found["failures"][f"{kind}s"].values()))
    figures["message_faults"] = messages.faults(messages.measure(counts["message"], 0))
    figures["thread_faults"] = len(thread_failures("cpu", counts["thread"]))
    windows, growth = window_failures(counts["window"])
    figures["window_faults"] = len(windows)
    figures["window_growth_mb_per_1000"] = growth
    return figures | {f"{kind}_cases": float(count) for kind, count in counts.items()}
