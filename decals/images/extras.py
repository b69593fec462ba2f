"""Further formats of images: for each, a test of the first bytes and a function of bytes and name."""

from collections.abc import Callable

from blobtree.lazy import if_present
from decals.images.texels import Pixels

DECODERS: list[tuple[Callable[[bytes], bool], Callable[[bytes, str], Pixels]]] = []

with if_present():
    from decals.images.radiance import decode_radiance, is_radiance

    DECODERS.append((is_radiance, decode_radiance))
