"""Functions of experiments, which worker processes import."""

import functools
import multiprocessing
import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

import decals
from blobtree import Point, polygonize


@dataclass
class Found:
    """Measures as a dataclass."""

    square: int
    root: float


def chosen(kind: Literal["big", "small"]) -> str:
    return kind


def measured(x: int, seed: int = 0) -> dict[str, Any]:
    """A number for each trial, which depends on nothing else."""
    return {"value": float(np.random.default_rng([x, seed]).random()), "x2": x * x}


def with_faults(x: int) -> dict[str, Any]:
    """End the process, fail, hang or give no number for some parameters."""
    if x == 1:
        os.kill(os.getpid(), signal.SIGSEGV)
    if x == 2:
        raise ValueError("two is\nwrong")
    if x == 3:
        time.sleep(600)
    if x == 4:
        os._exit(3)
    if x == 5:
        return {"y": float("nan")}
    if x == 6:
        hoard = [bytearray(b"x" * 2**24) for _ in range(50)]
        time.sleep(600 if hoard else 0)
    return {"y": float(x)}


def slow(x: int) -> int:
    """A trial of a tenth of a second."""
    time.sleep(0.1)
    return x + 1


def noted(x: int, folder: str) -> int:
    """Note each call."""
    with Path(folder, "calls").open("a") as file:
        file.write(f"{x}\n")
    return x


def files(x: int) -> dict[str, Any]:
    """Values that become files."""
    tree = Point((0, 0, 0), radius=1.0)
    scene = decals.cover(tree, count=2 + x)
    mesh = polygonize(tree, resolution=8)
    return {"scene": scene, "decals": scene.decals, "tree": tree, "array": np.arange(x), "mesh": mesh}


def drawn(count: int) -> dict[str, Any]:
    """A picture."""
    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=count)
    return {"count2": count * 2, "picture": decals.render(scene, size=(32, 24), samples=1)}


def summed(array: Any) -> float:
    """A large parameter."""
    return float(np.sum(array))


def empty(x: int) -> int:
    """Compute nothing."""
    return x


@functools.cache
def covered(count: int) -> decals.Scene:
    """A scene that a process makes once."""
    return decals.cover(Point((0, 0, 0), radius=1.0), count=count, seed=0)


def rendered(count: int, seed: int) -> float:
    """Draw a scene of 320 × 240 pixels; return the mean of its pixels."""
    return float(np.mean(decals.render(covered(count), size=(320, 240), samples=1))) + 0 * seed


def variable(name: str) -> str:
    """Return a variable of the environment."""
    return os.environ.get(name, "")


def called(f: Any) -> int:
    """Call a parameter."""
    return int(f(3))


def named(text: str) -> dict[str, Any]:
    """Texts that look like files and formulas."""
    return {"path": text, "cost in $": 1.0}


def ends(x: int, folder: str) -> int:
    """End the process at 1; at 2 at the first call alone, as a kill from outside does."""
    calls = Path(folder, f"call {x}")
    if x == 1 or (x == 2 and not calls.exists()):
        calls.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def with_children(x: int, limit: float) -> list[int]:
    """Compute in processes of the trial's own; at 2 start one that outlives it."""
    if x == 2:
        subprocess.Popen(["sleep", f"{limit:.6f}"])
        time.sleep(600)
    with multiprocessing.Pool(1) as pool:
        return pool.map(abs, [-x])


def summary(count: int) -> Any:
    """What `decals.measure` returns, and an array without dimensions."""
    measures = decals.measure(covered(count), samples=1000)
    return {**vars(measures), "zero": np.array(3.5)}
