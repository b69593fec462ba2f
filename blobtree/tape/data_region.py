"""The data region of a tape: numbers that instructions own besides their own texels, each block once."""

import hashlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree.transpile.python import Precision

TEXEL = 4
"""Numbers of a texel."""


class DataRegion:
    """Blocks of numbers, in the order in which they are added.

    Examples
    --------
    >>> from blobtree.tape.data_region import DataRegion
    >>> region = DataRegion()
    >>> region.add([1, 2, 3, 4, 5]), region.add([6]), region.add([1, 2, 3, 4, 5])
    (0, 2, 0)
    >>> region.texels.tolist()
    [[1.0, 2.0, 3.0, 4.0], [5.0, 0.0, 0.0, 0.0], [6.0, 0.0, 0.0, 0.0]]
    """

    def __init__(self, precision: Precision = np.float32) -> None:
        self._precision = precision
        self._blocks: list[NDArray[np.floating]] = []
        self._starts: dict[bytes, int] = {}
        self._size = 0

    def add(self, numbers: ArrayLike) -> int:
        """Store numbers of any shape, four to a texel, and return the index of their first texel.

        Equal blocks, bit for bit, are stored once.
        """
        flat = np.asarray(numbers, self._precision).ravel()
        block = np.pad(flat, (0, -len(flat) % TEXEL)).reshape(-1, TEXEL)
        key = hashlib.blake2b(block.data, digest_size=16).digest() + len(block).to_bytes(8, "little")
        if key not in self._starts:
            self._starts[key] = self._size
            self._blocks.append(block)
            self._size += len(block)
        return self._starts[key]

    @property
    def texels(self) -> NDArray[np.floating]:
        """All blocks as texels (n, 4)."""
        return np.concatenate([np.zeros((0, TEXEL), self._precision), *self._blocks])
