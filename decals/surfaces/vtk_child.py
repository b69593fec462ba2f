"""The process in which `vtk_process` reads mesh files: VTK's readers may crash or hang on damaged ones.

It imports pyvista once, reads a small file of its own, and forks for every other file, so that a crash or
corrupt memory does not reach the next file. Where the system has no fork it reads by itself, and is started
again after a crash.
"""

import contextlib
import gc
import json
import logging
import math
import os
import select
import signal
import sys
import tempfile
import time
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyvista  # noqa: F401  # here, because every fork would import it again
import vtkmodules.vtkIOXML  # noqa: F401  # for the same reason: of the most common formats
from vtkmodules.vtkCommonCore import vtkSMPTools

import blobtree.vtk_errors  # noqa: F401
from decals.errors import ImplicitDecalsError
from decals.surfaces.base_color import COLOR_ARRAYS
from decals.surfaces.files.usd import SUFFIXES, usd_objects
from decals.surfaces.mesh_data import MeshData, joined
from decals.surfaces.mesh_file import dataset_mesh, read_dataset

if sys.platform != "win32":
    import resource

STATM = Path("/proc/self/statm")
"""The size of this process, to which the memory for reading is added; macOS has no such file."""

IDLE_SECONDS = 120.0
"""Seconds without a request after which the process ends."""

TRIANGLE = b"""# vtk DataFile Version 3.0
one triangle
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 3 float
0 0 0 1 0 0 0 1 0
CELLS 1 4
3 0 1 2
CELL_TYPES 1
5
"""
"""File of a grid, whose reading passes through all steps of `_read`."""


def main() -> None:
    """Answer requests until the parent closes the pipe, or sends none for a while."""
    requests = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open("r+b") as nothing:  # libraries may print
        for descriptor in (0, 1, 2):
            os.dup2(nothing.fileno(), descriptor)
    if hasattr(os, "fork"):
        warm_up()
    _send(answers, {}, {"ready": True})
    while True:
        if sys.platform != "win32" and not select.select([requests], [], [], IDLE_SECONDS)[0]:
            return
        line = requests.readline()
        if not line:
            return
        request = json.loads(line)
        if hasattr(os, "fork"):
            _answer_in_fork(request, answers)
        else:
            _send(answers, request, *_answer(request))


def warm_up() -> None:
    """Load what reading needs before the first fork, because every fork would load it again."""
    backend = vtkSMPTools.GetBackend()
    vtkSMPTools.SetBackend("Sequential")  # a pool of threads would not be there in the forks
    with contextlib.suppress(OSError), tempfile.TemporaryDirectory() as folder:  # the disk may be full
        path = Path(folder) / "triangle.vtk"
        path.write_bytes(TRIANGLE)
        dataset_mesh(read_dataset(path), name=str(path))
    vtkSMPTools.SetBackend(backend)
    gc.freeze()  # a collection in a fork would copy the pages of all objects


def _answer_in_fork(request: dict[str, Any], answers: BinaryIO) -> None:
    child = os.fork()
    if child == 0:
        try:
            _limit(request)
            answer = _answer(request)  # VTK's data are freed: a crash there comes before the answer
            _send(answers, request, *answer)
            os._exit(0)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    if status != 0:
        limited = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU
        _send(answers, request, {"limit": "time"} if limited else {"error": "its reader crashed"})


def _limit(request: dict[str, Any]) -> None:
    """Limit the memory of this process on Linux, and let it write no core file."""
    if STATM.exists():
        pages = int(STATM.read_text(encoding="ascii").split()[0])
        memory = pages * resource.getpagesize() + int(request["bytes"])
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _limit_step(seconds: float) -> None:
    """Limit the processor time of this process from now on; Windows has no such limit."""
    if sys.platform != "win32":
        most = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + seconds), most))


def _answer(request: dict[str, Any]) -> tuple[Any, ...]:
    """Return the header of an answer, with what was logged, and the contents of its arrays."""
    logger, kept = logging.getLogger(), BufferingHandler(sys.maxsize)
    logger.addHandler(kept)
    try:
        header, *contents = _mesh_answer(request)
    finally:
        logger.removeHandler(kept)
    return {
        **header,
        "log": [(line.name, line.levelno, line.getMessage()) for line in kept.buffer],
    }, *contents


def _mesh_answer(request: dict[str, Any]) -> tuple[Any, ...]:
    try:
        parts = _read(Path(os.fsdecode(bytes.fromhex(request["path"]))), request["seconds"])
        mesh = joined(list(parts.values()))
    except ImplicitDecalsError as error:
        return ({"error": str(error), "whole": True},)
    except MemoryError:
        return ({"error": "it would take too much memory"},)
    except Exception as error:
        return ({"error": f"{type(error).__name__}: {error}"},)
    arrays = {
        "vertices": np.ascontiguousarray(mesh.vertices),
        "faces": np.ascontiguousarray(mesh.faces, np.int32),
    }
    for name in COLOR_ARRAYS if mesh.color is not None else ():
        if (array := getattr(mesh.color, name)) is not None:
            arrays[name] = np.ascontiguousarray(array)
    shapes = {name: [array.dtype.str, *array.shape] for name, array in arrays.items()}
    counts = [(name, len(part.vertices), len(part.faces)) for name, part in parts.items()]
    return {"arrays": shapes, "parts": counts}, *(
        array.data.cast("B") for array in arrays.values() if array.size
    )


def _read(path: Path, seconds: float) -> dict[str, MeshData]:
    """Read a mesh file by pyvista or OpenUSD, as triangles; each step has its limit of processor time."""
    _limit_step(seconds)
    if path.suffix.lower() in SUFFIXES:
        return usd_objects(path)
    dataset = read_dataset(path)
    _limit_step(seconds)
    return {path.name: dataset_mesh(dataset, name=str(path))}


def _send(answers: BinaryIO, request: dict[str, Any], header: dict[str, Any], *contents: memoryview) -> None:
    """Send an answer with the number of its request, so that no answer is taken for that of another file."""
    answers.write(json.dumps({**header, "number": request.get("number")}).encode() + b"\n")
    for content in contents:
        answers.write(content)
    answers.flush()


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError, KeyboardInterrupt):
        main()
