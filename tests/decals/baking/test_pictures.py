"""PNG files of textures, read back by Pillow."""

import io

import numpy as np
import pytest
from PIL import Image

from decals.baking import pictures
from decals.baking.pictures import png_bytes


@pytest.mark.parametrize("strip_bytes", [1, 100, 1 << 20])
@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 40), (40, 1, 4), (67, 35, 3), (33, 20, 2)])
def test_pillow_reads_the_same_texels(
    shape: tuple[int, ...], strip_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "STRIP_BYTES", strip_bytes)
    texels = np.random.default_rng(len(shape)).integers(0, 256, shape).astype(np.uint8)
    content = png_bytes(texels)
    with Image.open(io.BytesIO(content)) as read:
        assert np.array_equal(np.asarray(read), texels)
    with Image.open(io.BytesIO(content)) as read:
        read.verify()  # checksums


def test_even_textures_are_small() -> None:
    texels = np.full((512, 512, 3), 77, np.uint8)
    assert len(png_bytes(texels)) < 0.01 * texels.nbytes
