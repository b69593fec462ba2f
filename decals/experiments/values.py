"""Large values of trials as files of the experiment's folder, by the digest of their content."""

import functools
import hashlib
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blobtree.files import write_atomically
from decals.experiments.design import Trial

LARGE = 50_000
"""Bytes of a pickle from which on a value travels as a file."""

VALUES = "values"
"""Folder of these files."""


@dataclass(frozen=True)
class Stored:
    """A value that lies in a file."""

    path: Path


def stored(content: bytes, folder: Path) -> Path:
    """Write bytes under their digest, unless they are there; return the path."""
    path = folder / VALUES / f"{hashlib.sha256(content).hexdigest()[:32]}.pickle"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content)
    return path


@functools.lru_cache(maxsize=8)
def unpickled(path: Path) -> Any:
    """Return the value of a file, which a process reads once."""
    return pickle.loads(path.read_bytes())


def light(trial: Trial, folder: Path) -> Trial:
    """Return a trial whose large values are files."""
    return {name: _light(value, folder) for name, value in trial.items()}


def _light(value: Any, folder: Path) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    content = pickle.dumps(value)
    return Stored(stored(content, folder)) if len(content) > LARGE else value


def whole(trial: Trial) -> Trial:
    """Return a trial with the values of its files."""
    return {
        name: unpickled(value.path) if isinstance(value, Stored) else value for name, value in trial.items()
    }
