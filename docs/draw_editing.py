"""Draw the pictures of docs/editing.md: ``python docs/draw_editing.py [FOLDER]``.

A window without a screen is driven by the same events that user make.
"""

import sys
from pathlib import Path

from PIL import Image

import decals
from blobtree import Point, Segment
from decals.window import EditWindow

BODY = Point((0, 0, 0), radius=1.0, color=(0.3, 0.3, 0.28)) + Segment(
    (0.7, 0.4, 0), (1.9, 1.1, 0), radius=0.4
)
SIZE = (720, 480)


def press(window: EditWindow, name: str, at: tuple[int, int], key: str | None = None, ctrl: int = 0) -> None:
    """Make one event at a pixel."""
    interactor = window.plotter.iren.interactor
    interactor.SetEventInformation(*at, ctrl, 0, "\0", 0, key)
    getattr(interactor, name)()


def shot(window: EditWindow, path: Path) -> None:
    """Write the whole frame, smooth."""
    window.samples = 2
    picture = Image.fromarray(window.plotter.screenshot(None, return_img=True))
    window.samples = 1
    picture.save(path, quality=88)
    print(path)


def main(folder: Path) -> None:
    """Drag a large decal among its neighbours."""
    scene = decals.cover(BODY, count=160, images=["scale#3a8a6a", "eye"], direction=(-1, 0, 0))
    scene = scene.replace(decals=scene.decals.replace(images=scene.decals.images * 0))
    with EditWindow(scene, off_screen=True, size=SIZE, samples=1) as window:
        window.show()
        at, goal = (290, 230), (350, 265)
        press(window, "LeftButtonPressEvent", at)
        press(window, "LeftButtonReleaseEvent", at)
        for _ in range(6):
            press(window, "MouseWheelForwardEvent", at, ctrl=1)
        press(window, "KeyPressEvent", at, key="i")
        shot(window, folder / "editing-before.jpg")
        press(window, "LeftButtonPressEvent", at)
        press(window, "MouseMoveEvent", goal)
        press(window, "LeftButtonReleaseEvent", goal)
        shot(window, folder / "editing-after.jpg")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "images"))
