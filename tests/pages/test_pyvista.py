"""The Python of docs/pyvista.md runs as it stands, and its pictures show what the page says."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from decals.render.libraries import install_advice, missing_gl_libraries

DOCS = Path(__file__).parents[2] / "docs"


def drawing() -> ModuleType:
    spec = spec_from_file_location("draw_pyvista", DOCS / "draw_pyvista.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_code_blocks_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if missing := missing_gl_libraries():
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pv, "OFF_SCREEN", False)  # and back to what it was
    session = drawing().run_page()
    hit = session["hit"]
    assert hit.object_id == 0
    assert hit.owner >= 0
    assert str(hit.owner) in capsys.readouterr().out
    for name in ("among", "stock", "two", "lights"):
        drawn = np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB")).astype(int)
        kept = np.asarray(Image.open(DOCS / "images" / "pyvista" / f"{name}.png").convert("RGB")).astype(int)
        assert drawn.shape == kept.shape
        assert np.abs(drawn - kept).mean() < 6
