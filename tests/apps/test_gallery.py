"""Each example of the gallery draws the picture of its name in ``tests/golden``.

After an intended change, write the pictures again with IMPLICIT_DECALS_GOLDEN=write and look at them.
"""

import os
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from decals.apps import gallery
from decals.apps.gallery import sphere
from decals.apps.gallery.helpers import draw, main
from decals.rendering import Renderer

GOLDEN = Path(__file__).parent.parent / "golden"
SIDE = 64
TOLERANCE = 2
"""Levels of 255 by which a pixel may differ."""
MAX_DIFFERENT = 0.002
"""Fraction of pixels that may differ more: at equal fields, rounding decides the owner."""
SCATTERED = ("particles", "deforming", "posing", "painted", "models", "dragon")
"""Examples that depend on scattering: better scattering changes their pictures."""


@pytest.fixture
def golden_renderer(renderer: Renderer) -> Renderer:
    if "llvmpipe" not in renderer.context.name:
        pytest.skip(f"golden images are drawn by llvmpipe, not by {renderer.context.name}")
    return renderer


@pytest.mark.slow_cases(
    "by_hand",
    "custom_nodes",
    "deforming",
    "environments",
    "materials",
    "painted",
    "particles",
    "posing",
    "pressed_solids",
    "relief",
    "stain",
)
@pytest.mark.parametrize("name", gallery.EXAMPLES)
def test_an_example_draws_its_golden_image(golden_renderer: Renderer, name: str) -> None:
    if name in gallery.DOWNLOADED and "PYVISTA_DATA" not in os.environ:
        pytest.skip("its meshes would be downloaded; set PYVISTA_DATA to a folder that has them")
    module = import_module(f"{gallery.__name__}.{name}")
    assert module.__doc__
    drawn = draw(golden_renderer, module.panels(), side=SIDE, samples=2)[..., :3]
    if name in SCATTERED:
        assert drawn.std() > 20
        return
    path = GOLDEN / f"{name}.png"
    if os.environ.get("IMPLICIT_DECALS_GOLDEN") == "write":
        Image.fromarray(drawn).save(path, optimize=True)
    golden = np.asarray(Image.open(path).convert("RGB"))
    assert drawn.shape == golden.shape
    off = np.abs(drawn.astype(int) - golden).max(axis=-1) > TOLERANCE
    assert off.mean() <= MAX_DIFFERENT, f"{off.sum()} pixels of {name} differ"


@pytest.mark.parametrize("name", gallery.EXAMPLES)
def test_an_example_imports_public_names_only(name: str) -> None:
    source = (Path(gallery.__file__).parent / f"{name}.py").read_text(encoding="utf-8")
    imported = re.findall(r"^(?:from|import) ((?:blobtree|decals)[\w.]*)", source, re.MULTILINE)
    deep = [name for name in imported if name.count(".") > 1 and not name.startswith("decals.apps.")]
    assert imported
    assert not deep


def test_every_module_is_an_example() -> None:
    folder = Path(gallery.__file__).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__", "helpers"}
    assert modules == set(gallery.EXAMPLES)
    assert set(gallery.DOWNLOADED) <= modules


def test_an_example_runs_by_itself(
    renderer: Renderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "sphere.png"
    monkeypatch.setattr("sys.argv", ["sphere", "-o", str(output), "--side", "40"])
    main(sphere.panels)
    with Image.open(output) as picture:
        assert picture.size == (84, 40)
