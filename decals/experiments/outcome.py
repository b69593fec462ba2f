"""One trial: the call of the function, and the row that it gives."""

import functools
import json
import platform
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import warp as wp

from blobtree.device import start_warp
from decals.errors import ImplicitDecalsError
from decals.experiments.artefacts import measures_of
from decals.experiments.design import Trial
from decals.experiments.values import whole
from decals.scenes.provenance import checkout, device_text, package_versions

Row = dict[str, Any]
"""Columns of one trial: its parameters, its measures, and `COLUMNS`."""

COLUMNS = (
    "trial",
    "function",
    "status",
    "error",
    "seconds",
    "processor_seconds",
    "peak_mb",
    "started",
    "provenance",
)
"""Columns of every row beside parameters and measures."""

_CLEAR_PEAK, _STATUS = Path("/proc/self/clear_refs"), Path("/proc/self/status")


def outcome(function: Callable[..., Any], trial: Trial, folder: Path) -> Row:
    """Call a function with the parameters of a trial; return its measures, times, peak memory and error.

    Parameters
    ----------
    function
        Returns a number, or a mapping or a dataclass of measures. A measure is a number, a text, a list of
        these, or a value that becomes a file: a picture, a scene, a tree, decals, an array, a mesh, a figure.
    trial
        Its arguments.
    folder
        Folder of the experiment, in which the files are written.

    Returns
    -------
    dict
        Measures and those of `COLUMNS` that a trial knows itself. An exception gives the status ``failed``.
    """
    _forget_peak()
    row: Row = {"started": datetime.now(UTC).isoformat(timespec="milliseconds")}
    clock, processor = time.perf_counter(), time.process_time()
    try:
        row |= {"status": "done", "error": None} | measures_of(
            function(**whole(trial)), {*trial, *COLUMNS}, folder
        )
    except ImplicitDecalsError as error:
        row |= {"status": "failed", "error": f"{type(error).__name__}: {error}"}
    except (Exception, SystemExit) as error:  # of the user's function, whatever it is
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = " ".join(f"{type(error).__name__}: {error}".split())
        row |= {"status": "failed", "error": f"{text} (line {place.lineno} of {place.name})"}
    row["seconds"] = time.perf_counter() - clock
    row["processor_seconds"] = time.process_time() - processor
    row["provenance"] = _provenance(_device())
    row["peak_mb"] = _peak() / 2**20
    return row


@functools.cache
def _provenance(device: str) -> str:
    """Return versions, checkout, platform and a device as JSON."""
    made = {"platform": platform.platform(), "device": device_text(device), **checkout()}
    return json.dumps({**package_versions(), **made})


def _device() -> str:
    """Return the name of the device on which kernels run by default."""
    start_warp()
    return str(wp.get_device())


def _forget_peak() -> None:
    """Let Linux measure the peak of memory anew."""
    with suppress(OSError):
        _CLEAR_PEAK.write_text("5")


def _peak() -> float:
    """Return the peak of memory in bytes, since `_forget_peak` where the system allows that."""
    with suppress(OSError, StopIteration):
        line = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM"))
        return 1024.0 * int(line.split()[1])
    if sys.platform == "win32":
        return 0.0
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else peak * 1024)
