"""Mesh files that VTK reads, read in a process of its own with limits on time and memory.

`vtk_child` is that process. It is started at the first such file and kept for the next ones.
"""

import atexit
import json
import logging
import math
import os
import subprocess
import threading
from contextlib import suppress
from functools import partial
from itertools import count
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from blobtree.progress import check_cancelled, ended_by_cancel
from decals.child_process import Child, kill, start_child, time_limit
from decals.errors import InvalidMesh
from decals.surfaces.base_color import BaseColor
from decals.surfaces.mesh_data import MeshData
from decals.validation import optional_package

START_SECONDS = 120.0
"""Seconds until the process must be ready; imports from a slow disk take long."""

SECONDS, SECONDS_PER_BYTE = 6.0, 2e-5
"""Seconds of a processor for each step of reading: for any file, and per byte. Busy cores do not count."""

PATIENCE = 50.0
"""Seconds on the clock, for each second of that time, after which a reader counts as stuck."""

MEMORY, MEMORY_PER_BYTE = 2 << 30, 64
"""Bytes of memory for reading: for any file, and per byte of it."""


def read_isolated(path: Path) -> MeshData:
    """Read a mesh file by pyvista in a process of its own.

    Returns
    -------
    MeshData
        Triangles, and colours of points or faces.

    Raises
    ------
    InvalidMesh
        The file is no surface mesh, or the reader crashed, took too long or took too much memory.
    Cancelled
        The caller cancelled the work that reads the file; the process has ended.
    """
    return _process.read(path)[0]


def read_isolated_usd(path: Path) -> dict[str, MeshData]:
    """Return the meshes of a USD file by their names, read in that process; see `read_isolated`."""
    optional_package("pxr", "usd")
    whole, counts = _process.read(path)
    names, vertices, faces = zip(*counts, strict=True)
    starts = np.cumsum([0, *vertices[:-1]])
    parts = (
        np.split(of, np.cumsum(sizes)[:-1]) for of, sizes in zip(whole.arrays, (vertices, faces), strict=True)
    )
    rows = zip(names, *parts, starts, strict=True)
    return {name: MeshData(points, corners - start) for name, points, corners, start in rows}


class _ReaderProcess:
    """The client of `vtk_child`; threads use it in turn."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._child: Child | None = None
        self._requests = count()

    def read(self, path: Path) -> tuple[MeshData, list[tuple[str, int, int]]]:
        """Return the mesh of a file, and names, vertices and faces of its parts; see `read_isolated`."""
        size = path.stat().st_size
        seconds = math.ceil(SECONDS + SECONDS_PER_BYTE * size)
        memory = MEMORY + MEMORY_PER_BYTE * size
        request: dict[str, Any] = {
            "path": os.fsencode(path.absolute()).hex(),
            "seconds": seconds,
            "bytes": memory,
        }
        with self._lock:
            try:
                answer = self._answer(request, PATIENCE * seconds)
                check_cancelled("reading the file")
                if answer is None and self._has_left():
                    answer = self._answer(request, PATIENCE * seconds)
            except BaseException:
                self.stop()  # half of an answer may be in the pipe
                raise
            if answer is None:
                self.stop()
                raise InvalidMesh(
                    _failure(path, f"its reader crashed, or was stuck for {PATIENCE * seconds:.0f} s")
                )
        header, arrays = answer
        for name, level, line in header.get("log", ()):
            logging.getLogger(name).log(level, "%s", line)
        if "limit" in header:
            raise InvalidMesh(
                f"could not read {str(path)!r} within the limits for {size:,} bytes, {seconds} s of "
                "processor time for each step; if it is not damaged, convert it to .ply, .obj or .stl"
            )
        if "error" in header:
            raise InvalidMesh(header["error"] if "whole" in header else _failure(path, header["error"]))
        mesh = arrays.pop("vertices"), arrays.pop("faces")
        return MeshData(*mesh, BaseColor(**arrays) if arrays else None), header["parts"]

    def _answer(
        self, request: dict[str, Any], seconds: float
    ) -> tuple[dict[str, Any], dict[str, Any]] | None:
        """Return the header and the arrays of an answer; None if the process ended or took too long."""
        child = self._started()
        request["number"] = next(self._requests)
        assert child.stdin is not None
        assert child.stdout is not None
        with time_limit(child, seconds), ended_by_cancel(partial(kill, child)):
            try:
                child.stdin.write(json.dumps(request).encode() + b"\n")
                child.stdin.flush()
                header = json.loads(child.stdout.readline())
                shapes = header.get("arrays", {}).items()
                arrays = {name: np.empty(shape, kind) for name, (kind, *shape) in shapes}
                whole = all(_fill(child.stdout, array) for array in arrays.values())
            except (OSError, ValueError):  # the pipe is broken, or ends within a line
                return None
        if header["number"] != request["number"]:  # the former request was answered twice
            self.stop()
            return self._answer(request, seconds)
        return (header, arrays) if whole else None

    def _started(self) -> Child:
        """Return the process, started again if it has ended."""
        if self._child is not None and self._child.poll() is None:
            return self._child
        self.stop()
        self._child = child = start_child(
            "decals.surfaces.vtk_child", stdin=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert child.stdout is not None
        with time_limit(child, START_SECONDS), ended_by_cancel(partial(kill, child)):
            ready = child.stdout.readline()
        check_cancelled("starting the process that reads meshes")
        if not ready:
            raise InvalidMesh(
                "could not start the process that reads meshes by VTK; run `implicit-decals doctor`"
            )
        return child

    def _has_left(self) -> bool:
        """Return True if the process ended by itself, as it does after a while without requests."""
        return self._child is not None and self._child.wait(timeout=START_SECONDS) == 0

    def stop(self) -> None:
        """End the process, and with it the reading."""
        child, self._child = self._child, None
        if child is not None:
            kill(child)
            child.wait()
            _close_pipes(child)

    def forget(self) -> None:
        """In a forked child: leave the process to the parent."""
        self._lock = threading.Lock()
        child, self._child = self._child, None
        if child is not None:
            child.returncode = 0  # it is no child of this process, so there is nothing to wait for
            _close_pipes(child)


def _close_pipes(child: Child) -> None:
    for pipe in (child.stdin, child.stdout):
        if pipe is not None:
            with suppress(OSError):  # a request that could not be sent
                pipe.close()


def _fill(pipe: IO[bytes], array: NDArray[Any]) -> bool:
    """Read an array from a pipe; return False if the pipe ends before."""
    rest = array.data.cast("B") if array.size else memoryview(b"")
    while len(rest):
        count = pipe.readinto(rest)  # type: ignore[attr-defined]  # a buffered reader
        if not count:
            return False
        rest = rest[count:]
    return True


def _failure(path: Path, reason: str) -> str:
    return f"could not read {str(path)!r} as a mesh ({reason}); it is damaged, so export it again"


_process = _ReaderProcess()
atexit.register(_process.stop)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_process.forget)
