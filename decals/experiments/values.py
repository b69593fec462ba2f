"""Large values of trials as files of the experiment's folder, by the digest of their content."""

import functools
import hashlib
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blobtree.files import write_atomically
from decals.errors import InvalidInput
from decals.experiments.design import Trial

LARGE = 50_000
"""Bytes of a pickle from which on a value travels as a file."""

VALUES = "values"
"""Folder of these files."""


@dataclass(frozen=True)
class Stored:
    """A value that lies in a file."""

    path: Path


def pickled(name: str, value: Any) -> bytes:
    """Return the pickle of a value; functions of scripts and notebooks need cloudpickle.

    Raises
    ------
    InvalidInput
        The value cannot be pickled; the message begins with `name`.
    """
    try:
        import cloudpickle as pickler
    except ImportError:
        pickler = pickle
    try:
        return bytes(pickler.dumps(value))
    except Exception as error:  # pickles fail in many ways
        advice = (
            "define functions in a file, or install implicit-decals[experiments]"
            if pickler is pickle
            else "leave out what cannot be pickled"
        )
        raise InvalidInput(
            f"{name}: expected what other processes can read ({type(error).__name__}: {error}); {advice}, "
            "or run the trials in this process"
        ) from error


def stored(content: bytes, folder: Path) -> Path:
    """Write bytes under their digest, unless they are there; return the path."""
    path = folder / VALUES / f"{_digest(content)}.pickle"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content)
    return path


@functools.lru_cache(maxsize=8)
def unpickled(path: Path) -> Any:
    """Return the value of a file of `stored`, which a process reads once.

    Raises
    ------
    InvalidInput
        The content is not that of the name: a pickle of a stranger could run any code.
    """
    content = path.read_bytes()
    if _digest(content) != path.stem:
        raise InvalidInput(f"{path}: its content was changed; remove the file, and run again")
    return pickle.loads(content)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def light(trial: Trial, folder: Path) -> Trial:
    """Return a trial whose large values are files."""
    return {name: _light(name, value, folder) for name, value in trial.items()}


def _light(name: str, value: Any, folder: Path) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    content = pickled(name, value)
    return Stored(stored(content, folder)) if len(content) > LARGE else value


def whole(trial: Trial) -> Trial:
    """Return a trial with the values of its files."""
    return {
        name: unpickled(value.path) if isinstance(value, Stored) else value for name, value in trial.items()
    }
