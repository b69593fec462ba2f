"""Formats in which the editor writes a scene: scripts, exports, pages, pictures and videos."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

from blobtree.progress import Progress
from decals.baking.export import export
from decals.baking.formats import FORMATS
from decals.errors import InvalidEdit
from decals.pages.page import SUFFIXES as PAGE_SUFFIXES
from decals.pages.page import save_html
from decals.rendering.options import Size
from decals.scenes.animation import VIDEO_SUFFIXES, animate, turntable
from decals.scenes.render import render
from decals.scenes.scene import Scene
from decals.scenes.script import write_script

PICTURE_SUFFIXES = (".png", ".jpg")
PICTURE_SIZE = (1280, 720)
"""Width and height of pictures and videos without a size, in pixels."""

MAX_PICTURE_PIXELS, MAX_GIF_PIXELS = 1 << 26, 1 << 28
"""Most pixels of a picture, and of all frames of a GIF file; both are whole in memory."""


EXPORT_SUFFIXES = (*FORMATS, PAGE_SUFFIXES[0])
"""Formats of other programs, and pages."""

EXPORT_FIRST = ".ply"
"""Format that is proposed: it has colours and takes one file."""

WRITTEN_SUFFIXES = (".json", ".py", *EXPORT_SUFFIXES, *PICTURE_SUFFIXES, *VIDEO_SUFFIXES)


class Video(StrEnum):
    """What a video shows."""

    TURNTABLE = "turntable"
    """The scene from all sides."""
    SESSION = "session"
    """The scene at the beginning of the history, and after each entry."""


VIDEO_RATES = {Video.TURNTABLE: 25.0, Video.SESSION: 4.0}
"""Frames per second."""


def checked_size(size: Size | None) -> Size:
    """Return the size of a picture, `PICTURE_SIZE` by default; raise `InvalidEdit` if it is too large."""
    width, height = size = PICTURE_SIZE if size is None else size
    if width * height > MAX_PICTURE_PIXELS:
        raise InvalidEdit(
            f"size: expected at most {MAX_PICTURE_PIXELS:,} pixels, got {width} x {height}; take fewer, "
            "or the command render"
        )
    return size


def write_scene(
    scene: Scene,
    path: Path,
    size: Size,
    shows: Video,
    history: Callable[[], list[Scene]],
    progress: Progress,
) -> None:
    """Write a scene in the format of a suffix; `history` returns what a video of the session shows."""
    suffix, (width, height) = path.suffix.lower(), size
    if suffix == ".py":
        write_script(scene, path)
    elif suffix in PICTURE_SUFFIXES:
        render(scene, size=size).save(path)
    elif suffix in PAGE_SUFFIXES:
        save_html(scene, path, progress=progress)
    elif suffix in VIDEO_SUFFIXES:
        frames = turntable(scene) if shows is Video.TURNTABLE else history()
        if suffix == ".gif" and len(frames) * width * height > MAX_GIF_PIXELS:
            raise InvalidEdit(
                f"size: expected at most {MAX_GIF_PIXELS:,} pixels in all frames of a GIF file, got "
                f"{len(frames)} x {width} x {height}; take fewer, or write .mp4"
            )
        animate(frames, path, size=size, rate=VIDEO_RATES[shows], progress=progress)
    else:
        export(scene, path, progress=progress)
