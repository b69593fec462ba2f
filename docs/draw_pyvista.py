"""Draw the pictures of docs/pyvista.md: run its Python as it stands.

``python docs/draw_pyvista.py`` writes docs/images/pyvista/*.png, but for browser.png, a browser's picture:
``python -m tests.frontends.in_browser page docs/images/pyvista/browser.png`` takes that.
"""

import os
import re
import tempfile
from pathlib import Path

import pyvista as pv
from PIL import Image

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "pyvista.md"


def run_page() -> dict[str, object]:
    """Run the page's Python in the current folder, in one session, without windows; what it leaves."""
    pv.OFF_SCREEN = True
    session: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL):
        exec(compile(block, PAGE.name, "exec"), session)
    return session


def main() -> None:
    """Run the page in a folder of its own, and keep the pictures."""
    target = DOCS / "images" / "pyvista"
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        run_page()
        for picture in Path(folder).glob("*.png"):
            Image.open(picture).convert("RGB").quantize(256).save(target / picture.name, optimize=True)
        os.chdir(DOCS)


if __name__ == "__main__":
    main()
