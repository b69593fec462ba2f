"""Draw the picture of docs/character.md from the code on that page.

``python docs/draw_character.py`` writes docs/images/character.png.
"""

import re
import runpy
import tempfile
from pathlib import Path

import pyvista as pv
from PIL import Image

DOCS = Path(__file__).parent
SIDE = 420
VIEW = [(4.2, -6.6, 4.6), (-1.1, 0.0, -0.1), (0.0, 0.0, 1.0)]


def draw(path: Path) -> None:
    """Write the picture."""
    page = (DOCS / "character.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "character.py"
        text = "\n".join(re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL))
        script.write_text(
            text.replace('"newt.json"', repr(str(Path(folder) / "newt.json"))), encoding="utf-8"
        )
        names = runpy.run_path(str(script))
    plotter = pv.Plotter(shape=(1, 3), off_screen=True, window_size=(3 * SIDE, SIDE), border=False)
    plotter.set_background("white")
    for column, tree in enumerate((names["body"](0.0), names["resting"], names["walking"])):
        plotter.subplot(0, column)
        mesh = tree.to_pyvista(resolution=128)
        plotter.add_mesh(mesh, scalars="RGB", rgb=True, smooth_shading=True)
        plotter.camera_position = VIEW
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    Image.fromarray(pixels).quantize(128).save(path, optimize=True)


if __name__ == "__main__":
    draw(DOCS / "images" / "character.png")
