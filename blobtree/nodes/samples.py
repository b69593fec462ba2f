"""Grids of numbers as values: immutable, comparable, and small in files."""

import math
import zlib
from typing import Any, Self

import msgspec
import numpy as np

from blobtree._typing import Float32Array
from blobtree.declare.parameters import CHECKS, Quantity
from blobtree.errors import InvalidNode
from blobtree.identity import content_hash
from blobtree.lazy import Lazy
from blobtree.sized_cache import sized_cache
from blobtree.validation import real

FAST_COMPRESSION = 1

MAX_NUMBERS = 1 << 24
"""Largest number of samples: a float32 cannot count more texels on a tape."""

MAX_DECODED_BYTES = 1 << 26
"""Bytes of decoded samples that are kept for the next access, at most."""


class Samples(msgspec.Struct, frozen=True, dict=True):
    """A grid of float32 numbers.

    In files it is its shape and a text: little-endian float32 numbers, compressed by zlib, in base64.

    Attributes
    ----------
    shape
        Numbers of grid points along x, y and z.
    data
        The compressed numbers, the last axis fastest.
    """

    shape: tuple[int, int, int]
    data: bytes

    @classmethod
    def of(cls, numbers: Any) -> Self:
        """Return the samples of an array (nx, ny, nz).

        Raises
        ------
        InvalidNode
            The array does not have three axes of at least two finite numbers, or too many.
        """
        try:
            with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinity, refused below
                array = np.asarray(real(numbers), np.float32)
        except (TypeError, ValueError, OverflowError):
            raise InvalidNode(
                f"samples: expected an array of numbers, got {type(numbers).__name__}"
            ) from None
        _check_shape(array.shape)
        if not np.isfinite(array).all():
            raise InvalidNode(
                f"samples: expected finite numbers, got {int((~np.isfinite(array)).sum())} others"
            )
        little_endian = np.ascontiguousarray(array, "<f4").tobytes()
        nx, ny, nz = array.shape
        return cls((nx, ny, nz), zlib.compress(little_endian, FAST_COMPRESSION))

    @property
    def array(self) -> Float32Array:
        """The numbers, float32[nx, ny, nz], read-only.

        Raises
        ------
        InvalidNode
            The data are damaged.
        """
        return _decoded(self.shape, self.data)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Samples):
            return NotImplemented
        return self.data == other.data or self.content_hash == other.content_hash

    def __hash__(self) -> int:
        return hash(self.content_hash)

    @Lazy
    def content_hash(self) -> str:
        """Content hash of the numbers, whose compressed data depend on the compressor."""
        return content_hash(self.array)

    def __repr__(self) -> str:
        nx, ny, nz = self.shape
        return f"<{nx} × {ny} × {nz} numbers; save() or to_json() keep them>"


@sized_cache(MAX_DECODED_BYTES)
def _decoded(shape: tuple[int, int, int], data: bytes) -> Float32Array:
    _check_shape(shape)
    size = 4 * math.prod(shape)
    decoder = zlib.decompressobj()
    try:
        content = decoder.decompress(data, size + 1)  # damaged data might expand without end
    except zlib.error as error:
        raise InvalidNode(
            f"samples: expected numbers compressed by zlib, got damaged data ({error})"
        ) from None
    if len(content) != size:
        raise InvalidNode(f"samples: expected {size} bytes for the shape {shape}, got {len(content)}")
    array = np.frombuffer(content, "<f4").reshape(shape).astype(np.float32)
    if not np.isfinite(array).all():
        raise InvalidNode("samples: expected finite numbers, got damaged data")
    array.setflags(write=False)
    return array


def checked_samples(name: str, value: Any) -> Samples:
    """Return `value` as samples; raise `InvalidNode` unless it is an array of finite numbers."""
    samples = value if isinstance(value, Samples) else Samples.of(value)
    samples.array  # noqa: B018  (raises for damaged data)
    return samples


def _check_shape(shape: tuple[int, ...]) -> None:
    if len(shape) != 3 or min(shape) < 2:
        raise InvalidNode(f"samples: expected a grid of at least 2 × 2 × 2 numbers, got the shape {shape}")
    if math.prod(shape) > MAX_NUMBERS:
        raise InvalidNode(f"samples: expected at most {MAX_NUMBERS:,} numbers, got {math.prod(shape):,}")


CHECKS[Quantity.SAMPLES] = checked_samples
