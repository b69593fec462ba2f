"""Pictures are arrays that can be saved, and that notebooks show."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from decals.errors import InvalidScene
from decals.rendering import Picture


def picture() -> Picture:
    pixels = np.zeros((3, 5, 4), np.uint8)
    pixels[:, :2] = 200, 30, 40, 255
    return Picture(pixels)


def test_a_picture_is_an_array() -> None:
    made = picture()
    assert made.shape == (3, 5, 4)
    assert len(made) == 3
    assert repr(made) == "Picture(5 × 3 pixels)"
    assert np.asarray(made) is made.pixels
    assert np.array(made, copy=True) is not made.pixels
    assert np.asarray(made, np.float32).dtype == np.float32
    np.testing.assert_array_equal(made[0, 0], [200, 30, 40, 255])
    assert np.mean(made) == np.mean(made.pixels)


@pytest.mark.parametrize("suffix", [".png", ".PNG", ".webp", ".tiff"])
def test_formats_with_alpha_keep_it(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    picture().save(path)
    assert np.asarray(Image.open(path).convert("RGBA"))[0, 4, 3] == 0


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".bmp"])
def test_other_formats_lie_on_white(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    picture().save(str(path))
    assert (np.asarray(Image.open(path).convert("RGB"))[0, 4] > 220).all()


@pytest.mark.parametrize("name", ["picture", "picture.xyz", "missing/picture.png", "picture.mp4"])
def test_other_paths_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidScene, match="picture"):
        picture().save(tmp_path / name)


@pytest.mark.parametrize("wrong", [None, BytesIO(), b"a.png"], ids=["none", "stream", "bytes"])
def test_values_that_are_no_paths_are_refused(wrong: Any) -> None:
    with pytest.raises(InvalidScene, match="path: expected the path of a file, got"):
        picture().save(wrong)


def test_notebooks_get_a_png() -> None:
    image = np.asarray(Image.open(BytesIO(picture()._repr_png_())))
    np.testing.assert_array_equal(image, picture().pixels)
