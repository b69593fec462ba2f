"""Write the figures of the structure into docs/architecture.md: ``python docs/structure_figures.py``.

``--print`` prints the values alone. Needs a checkout with its tests, and OpenGL for the files of a drag.
"""

import argparse
import re
import statistics
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("blobtree", "decals", "apps")
BEFORE = {
    "Python product files": "324",
    "lines in them": "34,929",
    "median lines of a file": "88",
    "import cycles between modules": "5",
    "files in the largest cycle": "35",
    "files whose functions run from click to pixel of a drag": "78",
}
"""Values before the packages were laid out along the pipeline."""


def product_files(root: Path) -> list[Path]:
    """Return the Python files of the product."""
    return sorted(path for package in PACKAGES for path in (root / package).rglob("*.py"))


def lines_of(path: Path) -> int:
    """Return the number of lines of a file."""
    return len(path.read_text(encoding="utf-8").splitlines())


def drag_files(root: Path) -> set[str]:
    """Return the product files whose functions run from a mouse press on a decal to the finished frame."""
    import decals
    from blobtree import Point
    from decals.window import EditWindow

    files: set[str] = set()

    def record(frame: FrameType, event: str, _argument: Any) -> None:
        if event == "call":
            files.add(frame.f_code.co_filename)

    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=60, images=["scale"])
    with EditWindow(decals.editing.EditSession(scene), off_screen=True, size=(240, 180)) as window:
        window.show()
        interactor = window.plotter.iren.interactor

        def send(name: str, x: int, y: int) -> None:
            interactor.SetEventInformation(x, y, 0, 0, "\0", 0, None)
            getattr(interactor, name)()

        def drag(x: int, y: int) -> None:
            send("LeftButtonPressEvent", x, y)
            send("MouseMoveEvent", x + 8, y)
            window.tick()
            window.plotter.render()
            send("LeftButtonReleaseEvent", x + 8, y)

        send("LeftButtonPressEvent", 120, 90)
        send("LeftButtonReleaseEvent", 120, 90)
        drag(120, 90)  # compiles and uploads
        threading.setprofile(record)
        sys.setprofile(record)
        try:
            drag(128, 90)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]
    folders = [f"{root}/{package}/" for package in PACKAGES]
    return {name for name in files if any(name.startswith(folder) for folder in folders)}


def figures(root: Path) -> dict[str, str]:
    """Return all figures of a checkout."""
    sys.path.insert(0, str(root))
    from tests.import_graph import cycles, module_graph

    lengths = [lines_of(path) for path in product_files(root)]
    found = cycles(module_graph())
    return {
        "Python product files": f"{len(lengths):,}",
        "lines in them": f"{sum(lengths):,}",
        "median lines of a file": f"{statistics.median(lengths):.0f}",
        "import cycles between modules": str(len(found)),
        "files in the largest cycle": str(max(map(len, found), default=0)),
        "files whose functions run from click to pixel of a drag": str(len(drag_files(root))),
    }


def main() -> None:
    """Print the figures, or write them into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--print", action="store_true", help="print the values and leave the page as it is")
    values = figures(ROOT)
    if parser.parse_args().print:
        print("\n".join(f"{name}: {value}" for name, value in values.items()))
        return
    rows = [f"| {name} | {BEFORE[name]} | {value} |" for name, value in values.items()]
    table = "\n".join(["| figure | before | now |", "|---|---:|---:|", *rows])
    page = ROOT / "docs" / "architecture.md"
    text = page.read_text(encoding="utf-8")
    text = re.sub(
        r"(<!-- figures -->\n).*?(\n<!-- /figures -->)", rf"\g<1>{table}\g<2>", text, flags=re.DOTALL
    )
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
