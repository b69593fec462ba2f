"""Small pictures, and how to read them."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def small(*arguments: str) -> list[str]:
    return ["render", *arguments, "--decals", "30", "--size", "64x48", "--samples", "1"]


def picture(path: Path) -> NDArray[np.uint8]:
    return np.asarray(Image.open(path))
