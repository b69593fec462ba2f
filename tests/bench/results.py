"""Compare results with those of a file, bit by bit: values, bounds, pruned tapes, kernels, compile times.

    python -m tests.bench.results                      # compare with tests/golden/results.json
    python -m tests.bench.results --write              # write that file
    python -m tests.bench.results --against ../before  # compile times beside those of another checkout

Results are hashes of float32 numbers, so they hold for one kind of processor and one version of Warp, which
the file names. A change of the structure leaves them as they are; a change of a formula is written anew.
Digests of kernels differ after each change of a typed function: a wheel's kernels then no longer fit.
"""

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from blobtree import Node, Sum
from blobtree._typing import Float32Array
from blobtree.device import start_warp
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.tape.instruction_set import library
from blobtree.tape.model import gradients_at
from tests.bench.blobtree import blobs, cells_of, mixed
from tests.bench.nodes import lattice_trees
from tests.blobtree.tape.evaluations import bounds_along
from tests.blobtree.tree_sets import SETS
from tests.blobtree.trees import points_around
from tests.conformance import sample
from tests.import_graph import ROOT, modules

FILE = ROOT / "tests" / "golden" / "results.json"
POINTS = 200
BOXES = 20
SAMPLES = 3
"""Sampled nodes of each kind."""

COMPILED = ("blobtree.tape.evaluate_kernels", "blobtree.cells.refine_kernels", "blobtree.tracing.ray_kernels")
"""Modules of core kernels whose compile times count."""

COMPILE = """
import importlib, sys, time, warp as wp
from blobtree import Point
from blobtree.device import start_warp
from blobtree.kernels import _parse_headers
start_warp()
Point((0, 0, 0), radius=1.0).tape
_parse_headers()
for name in sys.argv[1:]:
    module = next(v.module for v in vars(importlib.import_module(name)).values() if isinstance(v, wp.Kernel))
    start = time.process_time()
    wp.load_module(module, device="cpu")
    print(time.process_time() - start)
"""

Record = dict[str, Any]


def digest(parts: Iterable[bytes]) -> str:
    """Return a short hash of some bytes."""
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]


def result_of(node: Node, rng: np.random.Generator) -> bytes:
    """Return all that a tree answers at random points, as bytes."""
    points = points_around(rng, node, POINTS)
    directions = rng.normal(size=(POINTS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reaches = 10.0 ** rng.uniform(-3.0, 0.5, POINTS)
    halves = 10.0 ** rng.uniform(-2.0, -0.3, BOXES)
    boxes = zip(points[:BOXES], halves, strict=True)
    answers: list[Float32Array] = [
        gradients_at(node.tape, points),
        node.colors(points),
        bounds_along(node.tape, points, directions, reaches),
        np.array([node.interval(center - half, center + half) for center, half in boxes], np.float32),
        np.array(node.field_box, np.float32),
    ]
    return b"".join(np.ascontiguousarray(answer, "<f4").tobytes() for answer in answers)


def result_of_kind(tag: str) -> str:
    """Return the hash of what sampled nodes of a kind answer."""
    rng = np.random.default_rng(7)
    return digest(result_of(sample(NODE_KINDS[tag], rng), rng) for _ in range(SAMPLES))


def result_of_set(name: str) -> str:
    """Return the hash of what the first trees of a set of random trees answer."""
    rng = np.random.default_rng(8)
    return digest(result_of(tree, rng) for tree in SETS[name][0].trees)


def pruned_texels(tree: Node, resolution: int) -> list[int]:
    """Return the numbers of blocks, and of the texels of their pruned tapes, of each level of cells."""
    levels = cells_of(tree, resolution).levels
    return [n for level in levels for n in (len(level), int(np.diff(level.spans.numpy(), axis=1).sum()))]


BENCH_MODELS: dict[str, Callable[[], Node]] = {
    "sum of 1000 points": lambda: Sum(blobs(1000)),
    "mixed 1000 points": lambda: mixed(1000),
    **{f"lattice, {name}": partial(lattice_trees().__getitem__, name) for name in lattice_trees()},
}


def kernels() -> Record:
    """Return the number of kernels, of those that read tables of kinds, and digests of their modules."""
    sources = {name: path for name, path in modules().items() if name.startswith(("blobtree.", "decals."))}
    named = [name for name, path in sources.items() if "\n@wp.kernel" in path.read_text(encoding="utf-8")]
    known = [
        value
        for name in sorted(named)
        for value in vars(import_module(name)).values()
        if isinstance(value, wp.Kernel) and value.module.name == name
    ]
    instances = {kernel: library().kernel_for(kernel) for kernel in known}
    reading = {kernel: instance for kernel, instance in instances.items() if instance is not kernel}

    def code(group: Iterable[wp.Kernel]) -> str:
        hashes = {kernel.module.name: kernel.module.get_module_hash(1) for kernel in group}
        return digest(bytes(hashes[name]) for name in sorted(hashes))

    return {
        "count": len(known),
        "reading kinds": len(reading),
        "digest of others": code(set(known) - set(reading)),
        "digest of core": code(reading),
        "digest of library": code(reading.values()),
    }


def compile_seconds(folder: Path) -> dict[str, float]:
    """Return the processor time that modules of core kernels of a checkout take to compile."""
    with tempfile.TemporaryDirectory() as cache:
        paths = os.pathsep.join([str(folder / "build" / "links"), str(folder)])
        settings = {**os.environ, "WARP_CACHE_PATH": cache, "PYTHONPATH": paths}
        run = [sys.executable, "-c", COMPILE, *COMPILED]
        text = subprocess.check_output(run, cwd=folder, env=settings, text=True)
    return dict(zip(COMPILED, map(float, text.split()[-len(COMPILED) :]), strict=True))


def machine() -> str:
    """Return what the hashes depend on besides the code."""
    blas = os.environ.get("OPENBLAS_CORETYPE", "own choice")
    return f"{platform.machine()}, Warp {wp.config.version}, NumPy {np.__version__}, OpenBLAS core: {blas}"


def measured() -> Record:
    """Return everything that the file keeps."""
    start_warp()
    return {
        "machine": machine(),
        "kinds": {tag: result_of_kind(tag) for tag in NODE_KINDS},
        "sets": {name: result_of_set(name) for name in SETS},
        "pruned": {name: pruned_texels(tree(), 64) for name, tree in BENCH_MODELS.items()},
        "kernels": kernels(),
        "compile_s": {name: round(seconds, 2) for name, seconds in compile_seconds(ROOT).items()},
    }


def differences(before: Record, now: Record) -> list[str]:
    """Return a line for each entry that differs; compile times do not count."""
    groups = [name for name in before if isinstance(before[name], dict) and name != "compile_s"]
    names = [(group, name) for group in groups for name in {**before[group], **now[group]}]
    return [
        f"{group}, {name}: {before[group].get(name)} → {now[group].get(name)}"
        for group, name in names
        if before[group].get(name) != now[group].get(name)
    ]


def main() -> None:
    """Compare, write, or compare compile times."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench.results",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--write", action="store_true", help="write the file")
    parser.add_argument("--against", type=Path, help="another checkout, for compile times alone")
    options = parser.parse_args()
    if options.against:
        rounds = [(compile_seconds(ROOT), compile_seconds(options.against.resolve())) for _ in range(3)]
        for name in COMPILED:
            here, there = (min(pair[side][name] for pair in rounds) for side in (0, 1))
            print(f"{name}: {here:.2f} s, {there:.2f} s there, ratio {here / there:.3f}")
        return
    now = measured()
    if options.write:
        FILE.write_text(json.dumps(now, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return
    before = json.loads(FILE.read_text(encoding="utf-8"))
    if before["machine"] != now["machine"]:
        print(f"The file is of another machine: {before['machine']}; this one is {now['machine']}.")
    lines = differences(before, now)
    print("\n".join(lines) or "All results are those on file.")
    print(f"Compile times: {now['compile_s']}, on file {before['compile_s']}")
    sys.exit(any(not line.startswith("kernels, digest") for line in lines))


if __name__ == "__main__":
    main()
