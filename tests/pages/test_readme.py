"""The README's Python runs as it stands."""

import re
from pathlib import Path

import numpy as np
import pytest

from decals.scenes.mesh_file import read_mesh
from decals.scenes.scene_file import load_scene

README = Path(__file__).parents[2] / "README.md"


def blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_the_code_blocks_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order in which they stand, in one session, in a folder with the files that they name."""
    import pyvista as pv
    from PIL import Image

    monkeypatch.chdir(tmp_path)
    pv.Cube(center=(3.5, 0.0, 0.0)).triangulate().save("box.ply")
    Image.fromarray(np.full((8, 8, 3), 200, np.uint8)).save("my_picture.png")
    session: dict[str, object] = {}
    for block in blocks():
        exec(compile(block, "README.md", "exec"), session)
    assert len(Image.open("duck.png").getcolors(1 << 20)) > 1000
    assert len(load_scene("scene.json").decals) == 1000
    assert len(read_mesh("box.ply")[1]) == 12
