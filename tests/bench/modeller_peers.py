"""Other modellers of programs, built from their public source, as `program_peers.py` compares them.

All take the text of clauses in [-1, 1]³ with cells of one size, and return a mesh and its processor time.
"""

import ctypes
import resource
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tests.oracles.expressions import VALUES

Floats = NDArray[np.float64]
Lines = Sequence[str]

RUNS = 3
LONG = 10.0
"""Seconds from which one run is enough."""

CHUNK = 4096
"""Points for which NumPy evaluates a program at once: the values in use fit into a cache."""

LIBFIVE_NAMES = {"ln": "log"}
"""Operations that libfive calls otherwise."""


@dataclass(frozen=True)
class Meshed:
    """Vertices, triangles and processor time of a mesh."""

    vertices: Floats
    faces: NDArray[np.int64]
    seconds: float


def field(lines: Lines) -> Callable[[Floats], Floats]:
    """Return the function of a program in float64."""
    clauses = [line.split() for line in lines]
    read_last = {operand: number for number, clause in enumerate(clauses) for operand in clause[2:]}
    spent: list[list[str]] = [[] for _ in clauses]
    for operand, number in read_last.items():
        spent[number].append(operand)

    def part(points: Floats) -> Any:
        known: dict[str, Any] = {}
        for (name, operation, *operands), unused in zip(clauses, spent, strict=True):
            if operation.startswith("var-"):
                known[name] = points[:, "xyz".index(operation[4])]
            elif operation == "const":
                known[name] = float(operands[0])
            else:
                known[name] = VALUES[operation](*(known[operand] for operand in operands))
            for operand in unused:
                known.pop(operand, None)
        return known[clauses[-1][0]]

    def values(points: Floats) -> Floats:
        found = np.empty(len(points))
        with np.errstate(all="ignore"):
            for start in range(0, len(points), CHUNK):
                found[start : start + CHUNK] = part(points[start : start + CHUNK])
        return found

    return values


def least(work: Callable[[], Any], clock: Callable[[], float] = time.process_time) -> tuple[Any, float]:
    """Return a result and the least processor time of some runs, or of one long run."""
    times: list[float] = []
    while len(times) < RUNS and (not times or times[0] < LONG):
        start = clock()
        result = work()
        times.append(clock() - start)
    return result, min(times)


def welded(corners: Floats, seconds: float) -> Meshed:
    """Return the mesh of corners (3n, 3) of triangles; equal ones are one vertex."""
    vertices, places = np.unique(np.asarray(corners, np.float64), axis=0, return_inverse=True)
    return Meshed(vertices, places.reshape(-1, 3).astype(np.int64), seconds)


def read_stl(path: Path) -> Floats:
    """Return the corners (3n, 3) of the triangles of a binary STL file."""
    row = np.dtype([("normal", "<3f4"), ("corners", "<9f4"), ("attribute", "<u2")])
    return np.fromfile(path, row, offset=84)["corners"].reshape(-1, 3).astype(np.float64)


# -- fidget: its command line, `cargo build --release -p fidget-cli` --------------------------------------


def children_time() -> float:
    """Return the processor time of all processes that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True)
class Fidget:
    """The command of fidget, which compiles programs to machine code.

    A time is that of the command less that of the same command for the smallest result: without reading.
    """

    program: Path

    def _seconds(self, *call: str | Path) -> float:
        return least(lambda: self._run(*call), children_time)[1]

    def _run(self, *call: str | Path) -> None:
        subprocess.run([self.program, *call, "--eval", "jit"], check=True, capture_output=True)

    def mesh(self, lines: Lines, resolution: int) -> Meshed:
        """Mesh a program; the resolution is a power of two."""
        with tempfile.TemporaryDirectory() as folder:
            source, result = Path(folder, "program.vm"), Path(folder, "mesh.stl")
            source.write_text("\n".join(lines) + "\n")
            call = "mesh", "--input", source, "--depth"
            depth = str(resolution.bit_length() - 1)
            seconds = self._seconds(*call, depth) - self._seconds(*call, "1")
            self._run(*call, depth, "--out", result)
            return welded(read_stl(result), seconds)

    def rays(self, lines: Lines, size: int) -> tuple[NDArray[np.bool_], float]:
        """Return which pixels of a depth picture show the solid, the lowest row first, and the time."""
        with tempfile.TemporaryDirectory() as folder:
            source, result = Path(folder, "program.vm"), Path(folder, "depth.png")
            source.write_text("\n".join(lines) + "\n")
            call = "render3d", "--input", source, "--isometric", "--mode", "heightmap", "--size"
            seconds = self._seconds(*call, str(size)) - self._seconds(*call, "8")
            self._run(*call, str(size), "--out", result)
            picture = Image.open(result)
            opacity = np.asarray(picture.getchannel(picture.getbands()[-1]))
        return opacity[::-1] > 0, seconds


# -- libfive: its shared library ---------------------------------------------------------------------------


class _LibfiveMesh(ctypes.Structure):
    _fields_ = (
        ("vertices", ctypes.POINTER(ctypes.c_float)),
        ("triangles", ctypes.POINTER(ctypes.c_uint32)),
        ("triangle_count", ctypes.c_uint32),
        ("vertex_count", ctypes.c_uint32),
    )


class _Region(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_float) for name in ("x0", "x1", "y0", "y1", "z0", "z1"))


@dataclass(frozen=True)
class Libfive:
    """The library of libfive, through its interface for C."""

    library: Path

    def _tree(self, five: Any, lines: Lines) -> ctypes.c_void_p:
        """Return the tree of a program; its parts stay in memory."""
        known: dict[str, Any] = {}
        for line in lines:
            name, operation, *operands = line.split()
            if operation.startswith("var-"):
                tree = getattr(five, f"libfive_tree_{operation[4]}")()
            elif operation == "const":
                tree = five.libfive_tree_const(ctypes.c_float(float(operands[0])))
            else:
                code = five.libfive_opcode_enum(LIBFIVE_NAMES.get(operation, operation).encode())
                make = five.libfive_tree_unary if len(operands) == 1 else five.libfive_tree_binary
                tree = make(code, *(ctypes.c_void_p(known[operand]) for operand in operands))
            assert tree, f"libfive has no {operation}"
            known[name] = tree
        return ctypes.c_void_p(tree)

    def mesh(self, lines: Lines, resolution: int) -> Meshed:
        """Mesh a program."""
        five = ctypes.CDLL(str(self.library))
        for name in ("x", "y", "z", "const", "unary", "binary"):
            getattr(five, f"libfive_tree_{name}").restype = ctypes.c_void_p
        five.libfive_tree_render_mesh.restype = ctypes.POINTER(_LibfiveMesh)
        tree, region = self._tree(five, lines), _Region(-1, 1, -1, 1, -1, 1)
        made, seconds = least(
            lambda: five.libfive_tree_render_mesh(tree, region, ctypes.c_float(0.5 * resolution))
        )
        mesh = made.contents
        vertices = np.ctypeslib.as_array(mesh.vertices, (mesh.vertex_count, 3)).astype(np.float64)
        faces = np.ctypeslib.as_array(mesh.triangles, (mesh.triangle_count, 3)).astype(np.int64)
        return Meshed(vertices, faces, seconds)


# -- sdf of Michael Fogleman: a package of Python ---------------------------------------------------------


class PythonSdf:
    """The package `sdf`, which leaves out batches of cells as if every field were a distance."""

    def mesh(self, lines: Lines, resolution: int) -> Meshed:
        """Mesh a program, evaluated by NumPy."""
        generate = import_module("sdf").core.generate
        values, step = field(lines), 2.0 / resolution
        bounds = ((-1.0, -1.0, -1.0), (1.0 + step, 1.0 + step, 1.0 + step))
        made, seconds = least(lambda: generate(values, step=step, bounds=bounds, verbose=False))
        return welded(np.array(made).reshape(-1, 3), seconds)
