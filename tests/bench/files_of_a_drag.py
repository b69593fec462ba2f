"""Count the Python files of the project that one step of dragging a decal runs, from event to pixel.

Run ``python -m tests.bench.files_of_a_drag``; it lists the files.
"""

import sys
from pathlib import Path
from types import FrameType

import blobtree
import decals
from blobtree import Point
from decals.window import EditWindow
from tests.decals.window.driver import Driver

ROOTS = [Path(package.__file__ or "").parent for package in (blobtree, decals)]


def files_of_a_drag() -> list[str]:
    """Return the files that run in the second step of a drag; the first one compiles shaders."""
    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=60, images=["scale"])
    files: set[str] = set()

    def record(frame: FrameType, _event: str, _argument: object) -> None:
        files.add(frame.f_code.co_filename)

    with EditWindow(scene, off_screen=True, size=(180, 120)) as window:
        window.show()
        driver = Driver(window)
        _, (x, y) = next(driver.visible())
        driver.click((x, y))
        driver.event("LeftButtonPressEvent", (x, y))
        driver.event("MouseMoveEvent", (x + 8, y))
        sys.setprofile(record)
        driver.event("MouseMoveEvent", (x + 12, y))
        sys.setprofile(None)
        driver.event("LeftButtonReleaseEvent", (x + 12, y))
    paths = [(Path(file), root) for file in files for root in ROOTS if root in Path(file).parents]
    return sorted(str(path.relative_to(root.parent)) for path, root in paths)


if __name__ == "__main__":
    names = files_of_a_drag()
    print("\n".join([*names, f"{len(names)} files"]))
