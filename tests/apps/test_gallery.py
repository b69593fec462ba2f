"""Every example of the gallery draws, and draws what its small picture in ``tests/golden`` shows.

After a change that is meant to be seen, write them anew with IMPLICIT_DECALS_GOLDEN=write, and look at them.
"""

import os
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from decals.errors import NoGraphics
from decals.render import Renderer
from implicit_decals.apps import gallery
from implicit_decals.apps.gallery.panels import draw

GOLDEN = Path(__file__).parent.parent / "golden"
SIDE = 64
TOLERANCE = 2
"""Levels of 255 by which a pixel may differ."""
FEW = 0.002
"""Part of the pixels that may differ more: rounding decides there who owns them."""
SEEDED = ("particles", "deforming", "painted", "models", "dragon")
"""Examples that show what seeding finds: better seeding makes another picture of them."""


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    try:
        made = Renderer()
    except NoGraphics as error:
        pytest.skip(str(error))
    if "llvmpipe" not in made.context.name:
        pytest.skip(f"golden images are drawn by llvmpipe, not by {made.context.name}")
    return made


@pytest.mark.parametrize("name", gallery.EXAMPLES)
def test_an_example_draws_its_golden_image(renderer: Renderer, name: str) -> None:
    if name in gallery.DOWNLOADED and "PYVISTA_DATA" not in os.environ:
        pytest.skip("its meshes would be downloaded; set PYVISTA_DATA to a folder that has them")
    module = import_module(f"{gallery.__name__}.{name}")
    assert module.__doc__
    drawn = draw(renderer, module.panels(), side=SIDE, samples=2)[..., :3]
    if name in SEEDED:
        assert drawn.std() > 20
        return
    path = GOLDEN / f"{name}.png"
    if os.environ.get("IMPLICIT_DECALS_GOLDEN") == "write":
        Image.fromarray(drawn).save(path, optimize=True)
    golden = np.asarray(Image.open(path).convert("RGB"))
    assert drawn.shape == golden.shape
    off = np.abs(drawn.astype(int) - golden).max(axis=-1) > TOLERANCE
    assert off.mean() <= FEW, f"{off.sum()} pixels of {name} differ"


def test_every_module_is_an_example() -> None:
    folder = Path(gallery.__file__).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__", "panels", "stage"}
    assert modules == set(gallery.EXAMPLES)
    assert set(gallery.DOWNLOADED) <= modules


def test_an_example_runs_by_itself(
    renderer: Renderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from implicit_decals.apps.gallery import panels, sphere

    output = tmp_path / "sphere.png"
    monkeypatch.setattr("sys.argv", ["sphere", "-o", str(output), "--side", "40"])
    panels.main(sphere.panels)
    with Image.open(output) as picture:
        assert picture.size == (84, 40)
