"""Parquet files from any source, read in a process of its own with limits on memory and time."""

import json
import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from decals.child_process import answer_of, can_isolate, start_child, time_limit
from decals.errors import InvalidDecals
from decals.scenes import parquet_child
from decals.validation import optional_package

if TYPE_CHECKING:
    import pyarrow

BYTES, BYTES_PER_BYTE = 256 << 20, 64
"""Most bytes of a table: for any file, and per byte of the file."""

SECONDS, SECONDS_PER_BYTE = 20.0, 1e-6
"""Seconds of a processor for reading: for any file, and per byte of the file."""

PATIENCE = 50.0
"""Seconds on the clock, for each second of that time, after which a reader counts as stuck."""


def read_parquet(path: Path) -> "pyarrow.Table":
    """Return the table of a Parquet file.

    `parquet_child` reads it, so that a crash, an endless loop or a lack of memory ends that process only.
    Programs that embed or freeze Python cannot start it and read by themselves.

    Raises
    ------
    InvalidDecals
        The file is no Parquet file, is damaged, or has more rows or deeper columns than a table of its size.
    MissingPackage
        pyarrow is not installed.
    Cancelled
        The work that reads the file is to stop.
    """
    arrow = optional_package("pyarrow", "experiments")
    size = path.stat().st_size
    budget, seconds = BYTES + BYTES_PER_BYTE * size, SECONDS + SECONDS_PER_BYTE * size
    if not can_isolate():
        try:
            return parquet_child.checked_table(str(path), budget)
        except (arrow.ArrowException, ValueError, OSError) as error:
            raise _unreadable(path, str(error)) from error
    name = os.fsencode(path.absolute()).hex()
    child = start_child(
        parquet_child.__name__,
        *(name, str(budget), str(seconds)),
        stdin=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    with time_limit(child, PATIENCE * seconds):
        answer, _ = answer_of(child, "reading the table")
    line, _, stream = answer.partition(b"\n")
    header = json.loads(line) if line else {}
    if "error" in header or child.returncode:
        raise _unreadable(path, header.get("error", "its reader crashed, or was stopped"))
    table: pyarrow.Table = arrow.ipc.open_stream(stream).read_all()
    return table


def _unreadable(path: Path, reason: str) -> InvalidDecals:
    text = (reason.splitlines() or ["it is damaged"])[0]
    return InvalidDecals(f"{str(path)!r}: expected a Parquet file ({text:.200}); write it again")
