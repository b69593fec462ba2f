"""Animations: one picture after another, as files in a folder or as a video."""

import os
import re
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Protocol

from PIL import Image

from blobtree._typing import UInt8Array
from blobtree.files import is_file, is_folder, replacing
from blobtree.progress import Cancel, Progress, reporting
from blobtree.validation import describe, finite_number
from decals.errors import InvalidScene
from decals.output_folder import output_folder
from decals.rendering.options import Size, check_scene, drawing_of
from decals.rendering.picture import Picture, on_white
from decals.rendering.renderer import Renderer
from decals.scenes.files import camera_values
from decals.scenes.pose import PosedScene
from decals.scenes.render import drawn_picture
from decals.scenes.scene import Scene
from decals.validation import allowed_number, checked_path, count_number, optional_package

MAX_FRAMES = 100_000
"""Largest number of frames that a turntable has."""

VIDEO_SUFFIXES = (".gif", ".mp4")
"""Suffixes of the files that `animate` writes; without a suffix it writes a folder."""

_FRAME = re.compile(r"frame_([0-9]{4}|[1-9][0-9]{4,})\.png")
"""Names that `animate` gives to pictures in a folder."""

_RATE = "a number of frames per second from 0.1 to 240"


class _Sink(Protocol):
    """Takes the picture of one frame after another."""

    def __call__(self, picture: Picture, number: int) -> None: ...


def turntable(scene: Scene | PosedScene, count: int = 120, *, turns: float = 1.0) -> list[Scene | PosedScene]:
    """Return a scene seen by cameras on a circle around it: frames for `animate`.

    The camera of the scene turns about the upward axis through its target. The first frame is the scene
    itself; after a whole number of turns the last one leads back to it.

    Parameters
    ----------
    scene : Scene or PosedScene
        The scene.
    count : int
        Number of frames, from 1.
    turns : float
        Number of turns; below zero the camera turns clockwise, seen from above.

    Returns
    -------
    list of Scene or PosedScene

    Raises
    ------
    InvalidScene
        The scene is of another kind, or a number is out of range.

    Examples
    --------
    >>> import blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> frames = decals.turntable(scene, 4)
    >>> len(frames), frames[0].camera.position == scene.camera.position
    (4, True)
    """
    if not isinstance(scene, Scene | PosedScene):
        raise InvalidScene(f"scene: expected a Scene or a PosedScene, got {describe(scene)}")
    frames = count_number("count", count, 1, MAX_FRAMES, InvalidScene)
    whole = finite_number("turns", turns, InvalidScene)
    camera = scene.camera
    return [replace(scene, camera=camera.turned(360.0 * whole * k / frames)) for k in range(frames)]


def animate(
    frames: Iterable[Scene | PosedScene],
    path: str | os.PathLike[str],
    *,
    size: Size = (800, 600),
    rate: float = 25.0,
    samples: int | None = None,
    count: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Path:
    """Draw scenes one after another, and write them as pictures or as a video.

    Each scene is drawn as its ``drawing`` says. What several scenes share, such as meshes, images and
    decals, is put on the graphics card once. Scenes of a generator are made one by one.

    Parameters
    ----------
    frames : iterable of Scene or PosedScene
        The scenes, such as those of `turntable`, or of `pose` at several times.
    path : str or path
        A folder for pictures ``frame_0001.png``, ``frame_0002.png`` and so on, made if it does not exist; or
        a video that ends in ".gif" or ".mp4", in which transparent pixels are white. An .mp4 file needs the
        package imageio-ffmpeg. Once all pictures are written, those of a longer animation that was in the
        folder are removed.
    size : (int, int)
        Width and height in pixels, even for .mp4 files.
    rate : float
        Frames per second of a video, from 0.1 to 240. Viewers show .gif files at 50 at most.
    samples : int, optional
        Samples along each axis of a pixel, in place of those of the scenes.
    count : int, optional
        Number of frames, for the progress of a generator.
    progress : callable, optional
        Called with a stage and the fraction done.
    cancel : callable, optional
        Called often; once it returns True, `blobtree.errors.Cancelled` is raised. Pictures that are drawn
        stay, a video is not written.

    Returns
    -------
    Path
        The folder or the file.

    Raises
    ------
    InvalidScene
        There is no frame, one is of another kind, an argument is out of range, or the path cannot be used.
    MissingPackage
        imageio-ffmpeg is not installed.
    NoGraphics
        There is no OpenGL; the message says what to install.
    OSError
        The folder or the file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile, blobtree, decals
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12)
    >>> folder = pathlib.Path(tempfile.mkdtemp()) / "turn"
    >>> written = decals.animate(decals.turntable(scene, 3), folder, size=(32, 24))
    >>> sorted(picture.name for picture in written.iterdir())
    ['frame_0001.png', 'frame_0002.png', 'frame_0003.png']
    """
    target = _target(path)
    speed = allowed_number("rate", rate, _RATE, lambda number: 0.1 <= number <= 240.0, InvalidScene)
    scenes = _scenes(frames)
    if count is None:
        expected = len(frames) if isinstance(frames, Sized) else 0
    else:
        expected = count_number("count", count, 1, 10 * MAX_FRAMES, InvalidScene)
    first = next(scenes, None)
    if first is None:
        raise InvalidScene("frames: expected at least one scene, got none")
    check_scene(first)
    pixel_size = drawing_of(first).overridden(samples=samples).at(size).size
    with reporting(progress, cancel) as report, _sink(target, pixel_size, speed) as write:
        report("drawing frames", 0.0)
        with Renderer() as renderer:
            for number, scene in enumerate(chain((first,), scenes), 1):
                check_scene(scene)
                of_count = f" of {expected}" if expected else ""
                report(
                    f"drawing frames: {number}{of_count}",
                    min((number - 1) / expected, 1.0) if expected else 0.0,
                )
                options = drawing_of(scene).overridden(samples=samples).at(pixel_size)
                with reporting(_silent):
                    picture = drawn_picture(renderer, scene, options, {"samples": samples})
                if picture.recipe is not None:  # the camera of a frame stands in no scene file
                    recipe = {**picture.recipe, "camera": camera_values(scene.camera)}
                    picture = Picture(picture.pixels, recipe)
                write(picture, number)
    return target


def _scenes(frames: Iterable[Scene | PosedScene]) -> Iterator[Scene | PosedScene]:
    """Return the frames one by one; raise InvalidScene for anything else, such as an array without axes."""
    if not isinstance(frames, Scene | PosedScene):
        with suppress(TypeError):
            return iter(frames)
    raise InvalidScene(
        f"frames: expected a list of scenes, got {describe(frames)}; decals.turntable makes one"
    )


def _target(path: str | os.PathLike[str]) -> Path:
    """Return where to write; the folder of a video is checked."""
    try:
        target = Path(path)
    except TypeError:
        raise InvalidScene(f"path: expected a folder or a file, got {describe(path)}") from None
    if not target.suffix or is_folder(target):
        return target
    if target.suffix.lower() not in VIDEO_SUFFIXES:
        raise InvalidScene(
            f"path: expected a folder, or a file that ends in .gif or .mp4, got {str(target)!r}; rename it"
        )
    return checked_path(target, VIDEO_SUFFIXES)


@contextmanager
def _sink(target: Path, size: Size, rate: float) -> Iterator[_Sink]:
    """Yield the function that takes frames; at the end the video is whole."""
    match target.suffix.lower() if not is_folder(target) else "":
        case ".gif":
            images: list[Image.Image] = []
            yield lambda picture, _number: images.append(_opaque(picture.pixels).quantize(256))
            with replacing(target) as file:
                pause = max(round(100.0 / rate), 2) * 10  # milliseconds; the format counts hundredths
                images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=pause, loop=0)
        case ".mp4":
            if size[0] % 2 or size[1] % 2:
                raise InvalidScene(f"size: expected an even width and height for .mp4 files, got {size}")
            writer = optional_package("imageio_ffmpeg", "video")
            with replacing(target) as file:
                stream = writer.write_frames(str(file), size, fps=rate, quality=8, macro_block_size=2)
                stream.send(None)
                try:
                    yield lambda picture, _number: stream.send(_opaque(picture.pixels).tobytes())
                finally:
                    stream.close()
        case _:
            count = 0

            def write(picture: Picture, number: int) -> None:
                nonlocal count
                picture.save(target / f"frame_{number:04d}.png")
                count = number

            with output_folder(target, InvalidScene):
                yield write
            _remove_later_frames(target, count)


def _remove_later_frames(folder: Path, count: int) -> None:
    """Remove the pictures of a longer animation from a folder that got ``count`` new ones."""
    for file in list(folder.iterdir()):
        match = _FRAME.fullmatch(file.name)
        if match is not None and int(match[1]) > count and is_file(file):
            file.unlink()


def _opaque(pixels: UInt8Array) -> Image.Image:
    """Return the pixels on white."""
    return on_white(Image.fromarray(pixels))


def _silent(_stage: str, _fraction: float) -> None:
    """Take the reports of one frame, whose number was reported."""
