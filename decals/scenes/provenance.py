"""Where a result comes from: versions of packages, commit of a checkout, machine, device and time."""

import platform
import re
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

PACKAGE = "implicit-decals"

GIT_SECONDS = 5.0
"""Time that git may take to look at a checkout; on some network drives it takes minutes."""


@cache
def package_versions() -> dict[str, str]:
    """Return the versions of this package, of Python and of all dependencies, from the installed metadata."""
    names = [
        re.split(r"[\s;\[(<>=!~]", line)[0] for line in requires(PACKAGE) or () if "extra ==" not in line
    ]
    found = {PACKAGE: version(PACKAGE), "python": platform.python_version()}
    for name in sorted(names):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def checkout() -> dict[str, Any]:
    """Return the commit of our checkout, and whether it has changes; nothing for an installed copy."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists() or not (root / "pyproject.toml").is_file():
        return {}
    try:
        commit = _git(root, "rev-parse", "HEAD")
        return {"commit": commit, "dirty": bool(_git(root, "status", "--porcelain", "--untracked-files=no"))}
    except (OSError, subprocess.SubprocessError):
        return {}


def _git(root: Path, *words: str) -> str:
    """Return what git writes, without a lock that would disturb others."""
    command = ["git", "--no-optional-locks", "-C", str(root), *words]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=GIT_SECONDS)
    return done.stdout.strip()


@cache
def device_text(name: str) -> str:
    """Return what a Warp device is: a processor by its name, a graphics card with its driver."""
    if name == "cpu":
        return f"cpu ({_processor()})"
    import warp as wp

    driver = ".".join(map(str, wp.get_cuda_driver_version() or ("unknown",)))
    return f"{name} ({wp.get_device(name).name}, driver for CUDA {driver})"


def _processor() -> str:
    """Return the name of the processor, as far as the system tells it."""
    if sys.platform == "linux":
        try:
            text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        except OSError:
            text = ""
        found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
        if found:
            return found[1].strip()
    return platform.processor() or platform.machine()


def provenance(device: str) -> dict[str, Any]:
    """Return the provenance of a result that is made now on a device, as plain values.

    Keys are ``"time"`` (UTC), ``"platform"``, ``"device"``, and in a checkout ``"commit"`` and ``"dirty"``.

    Parameters
    ----------
    device : str
        What the device is, with its driver; see `device_text`.

    Examples
    --------
    >>> from decals.scenes.provenance import device_text, provenance
    >>> {"device", "platform", "time"} <= set(provenance(device_text("cpu")))
    True
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"time": now, "platform": platform.platform(), "device": device, **checkout()}


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return one line for each value that is another one, or that only one of the two has."""
    names = [*before, *(name for name in now if name not in before)]
    return [
        f"{name}: {_text(before.get(name))} then, {_text(now.get(name))} now"
        for name in names
        if before.get(name) != now.get(name)
    ]


def changes_since(before: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[str, ...]:
    """Return how versions and circumstances of two records of recipes differ, but for the time."""
    records = [
        {**record.get("versions", {}), **record.get("made", {}), "time": ""} for record in (before, now)
    ]
    return tuple(differences(*records))


def _text(value: Any) -> str:
    return "none" if value is None else str(value)
