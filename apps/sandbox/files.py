"""Files of the folder in which the sandbox was started: the start page, opening, uploads, and writing."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.files import exists, is_file
from blobtree.progress import Cancel, Progress
from blobtree.validation import describe
from decals import cover
from decals.apps.models.samples import SAMPLES, axes_of, sample, sample_mesh
from decals.apps.models.scenes import empty_scene, new_file
from decals.apps.sandbox.decal_panel import image_names
from decals.apps.sandbox.folder import HDR, MODELS, keep_upload, listed, plain_name, read_upload
from decals.apps.views import THREE_QUARTER
from decals.editing.commands import AddImage, ReplaceImage
from decals.editing.file_names import open_plain
from decals.editing.formats import WRITTEN_SUFFIXES
from decals.editing.gizmo import on_plane
from decals.editing.outline_actions import Part, image_on_layer
from decals.editing.queries import SurfacePick
from decals.editing.recovery import recovery_path
from decals.editing.scatter_commands import AddObject
from decals.errors import InvalidEdit
from decals.images.builtin import BUILTIN_IMAGES
from decals.rendering.environment import Environment
from decals.scenes.camera import DEFAULT_DIRECTION, UPRIGHT
from decals.scenes.cover import fitting_camera
from decals.scenes.files import is_scene_file, load_model, load_scene
from decals.scenes.objects import MeshObject, SceneObject, unused_name
from decals.scenes.scene import DecalImage, Scene
from decals.validation import one_of, whole_number
from decals.window import EditWindow
from decals.window.host_plotter import ray_through

FIRST_IMAGES = ("scale",)
"""Images of a scene at the beginning."""

LIGHT = "light"
"""Key under which a page sends a panorama, which lights the scene."""

PLACE, PLACE_STEPS = re.compile(r"view (\d{1,5})/(\d{1,5})"), 10_000
"""Key of a place of the view, and steps across the view that it counts, from the lower left corner."""

MAX_KEPT = 100
"""Most pictures that a session writes into the folder, because a page has sent them as light."""

PART_BYTES = 4_000_000
"""Bytes of a file that are sent to a page at once."""


class SandboxFiles:
    """Opens files in an edit window, takes those that are dropped on its page, writes files and sends them.

    Parameters
    ----------
    window
        The edited window.
    folder
        Files are read and written only inside this folder.
    lessons
        Titles of lessons that the start page lists.
    opened
        Called once another scene has taken the place of the present one.

    Attributes
    ----------
    start_open
        True while the page shows the start page.
    """

    def __init__(
        self, window: EditWindow, folder: Path, lessons: Sequence[str], opened: Callable[[], None]
    ) -> None:
        self._window, self._state, self._files = window, window.actions.state, window.actions.files
        self._folder, self._lessons, self._opened = folder.resolve(), list(lessons), opened
        self._files.folder, self._files.closable = self._folder, False
        self._files.screenshot = lambda: window.plotter.screenshot(None, return_img=True)
        self.start_open, self._listed, self._kept = False, dict[str, Any](), 0

    def show_start(self, shown: bool) -> None:
        """Show or hide the start page, with the files that are there now."""
        self.start_open, self._listed = bool(shown), listed(self._folder)

    @property
    def start(self) -> dict[str, Any]:
        """The start page as plain values."""
        return {"open": self.start_open, "samples": list(SAMPLES), "lessons": self._lessons, **self._listed}

    def new_model(self) -> None:
        """Begin an empty scene, in the file of the window if that does not exist and nothing was edited."""
        scene, session = empty_scene(FIRST_IMAGES, UPRIGHT["y"]), self._state.session
        named = None if session.document.objects or session.labels else self._files.path
        path = "scene" if named is None or exists(named) else Path(named)
        self._open(lambda *_: scene, path)

    def open_sample(self, name: str) -> None:
        """Open a sample with scattered decals."""
        one_of("sample", name, SAMPLES, InvalidEdit)
        axes, (width, height) = axes_of(name), self._window.plotter.window_size
        toward = axes.preset(THREE_QUARTER)

        def load(progress: Progress, _cancel: Cancel) -> Scene:
            scene = cover(sample(name), images=FIRST_IMAGES, view_direction=toward, progress=progress)
            camera = fitting_camera(scene.objects, direction=toward, up=axes.up, aspect=width / height)
            return scene.replace(camera=camera)

        self._open(load, f"{name}-decals")

    def open_file(self, name: str) -> None:
        """Open a file of the folder: a scene, or a model, to which decals can be added."""
        if not isinstance(name, str) or Path(name).suffix.lower() not in MODELS:
            raise InvalidEdit(f"file: expected a name that ends in {', '.join(MODELS)}, got {describe(name)}")
        path = self._files.inside(name)
        unsaved = self._files.inside(recovery_path(path))  # a link could lead elsewhere
        if not exists(path) and not is_file(unsaved):
            raise InvalidEdit(f"expected a file of the folder, found no {name!r}")

        def load(_progress: Progress, _cancel: Cancel) -> Scene:
            if not exists(path):  # the recovery file has everything
                return empty_scene(FIRST_IMAGES, UPRIGHT["y"])
            found = load_model(path, samples=sample_mesh)
            if isinstance(found, Scene):
                return found
            camera = fitting_camera([found], direction=DEFAULT_DIRECTION, aspect=width / height)
            return Scene(objects=[found], camera=camera, images=FIRST_IMAGES)

        width, height = self._window.plotter.window_size
        is_scene = path.suffix == ".json" and (not exists(path) or is_scene_file(path))
        self._open(load, path if is_scene else f"{path.stem}-decals")

    def take(self, file: object, key: str = "") -> None:
        """Take a file that was dropped on the page: an image or a model is added, a scene is opened.

        Parameters
        ----------
        file
            A dictionary with the file's "name" and "content" (bytes).
        key
            The place of the drop. On the row of a layer, an image shows on the decals of the layer. On the
            row of an image, it replaces that image. On a place of the view, see `surface_at`, it shows on a
            new decal. On `LIGHT`, an image becomes the light. A Radiance file becomes the light everywhere
            but on a row.
        """
        found, document = read_upload(file), self._window.document
        file_name = str(file["name"])  # type: ignore[index]  # read_upload has checked it
        name = plain_name(file_name)
        if key == LIGHT or (not _row_of(key) and file_name.lower().endswith(HDR)):
            self._take_light(found, file)
        elif isinstance(found, Scene):
            self._open(lambda *_: found, name)
        elif isinstance(found, DecalImage):
            self._take_image(found, key)
        else:
            taken = {item.name for item in document.objects}
            renamed = replace(found, name=unused_name(name, taken, " "))
            if isinstance(renamed, MeshObject):
                renamed = replace(renamed, source=None)  # the file that was read exists no more
            self._add_object(renamed)

    def _take_image(self, image: DecalImage, key: str) -> None:
        """Add an image that was dropped on a row or on the view, or replace that of the row."""
        row, pick = _row_of(key), self.surface_at(key)
        session, state = self._window.session, self._state
        count, shown = len(session.document.images), ""
        if row is not None and row.kind == "image":
            state.run(ReplaceImage(row.number, image))
            return
        with session.stroke("add an image"):
            session.do(AddImage(image))
            if row is not None and row.kind == "layer":
                session.do(image_on_layer(session.document, count, row.number))
                shown = f" and shown on {session.document.layer_names.get(row.number, row.key)}"
            elif pick is not None:
                self._window.actions.decals.add_decal(lambda: pick, images=[count])
                shown = " and a decal"
        name = image_names(session.document)[-1]
        state.show(f"added image {name}{shown or '; choose it for the selected decals'}")

    def add_built_in(self, name: str) -> None:
        """Add an image that the package generates."""
        self._take_image(DecalImage.load(one_of("image", name, BUILTIN_IMAGES, InvalidEdit)), "")

    def place_image(self, key: str, place: str) -> None:
        """Add a decal at a place of the view, see `surface_at`, that shows the image of a row."""
        row = Part.named(key)
        if row.kind != "image":
            raise InvalidEdit("an image alone can be dropped on the view; drop other rows on rows")
        self._window.actions.decals.add_decal(lambda: self.surface_at(place), images=[row.number])

    def surface_at(self, place: object) -> SurfacePick | None:
        """Return the surface point at a place of the view, or None.

        "view 5000/0" is the middle of the lower edge, "view 10000/10000" the upper right corner.
        """
        pixel = self._pixel_at(place)
        return None if pixel is None else self._window.tools.at(*pixel)

    def point_at(self, place: object) -> ArrayLike | None:
        """Return the surface point at a place of the view, else the point there as far away as the target."""
        if (pick := self.surface_at(place)) is not None:
            return pick.position
        pixel = self._pixel_at(place)
        return None if pixel is None else self._across(self._window.camera.eye_and_target()[1], pixel)

    def put(self, place: object, edge: object = "") -> tuple[ArrayLike | None, float | None]:
        """Return the middle (3,) of a part that is put at a place of the view, and its reach.

        The part reaches to the place of its edge, as far away as its middle. Without one, its reach is None.
        """
        middle, pixel = self.point_at(place), self._pixel_at(edge)
        if middle is None or pixel is None or (end := self._across(middle, pixel)) is None:
            return middle, None
        return middle, float(np.linalg.norm(end - np.asarray(middle))) or None

    def _across(self, point: ArrayLike, pixel: tuple[float, float]) -> Float64Array | None:
        """Return what a pixel shows of the plane through a point that faces the camera, shape (3,)."""
        ray, (eye, target) = ray_through(self._window.subplot, *pixel), self._window.camera.eye_and_target()
        return None if ray is None else on_plane(point, np.subtract(eye, target), ray)

    def _pixel_at(self, place: object) -> tuple[float, float] | None:
        """Return the pixel at a place of the view, from the lower left; None for other texts."""
        found = PLACE.fullmatch(str(place))
        sizes = self._window.plotter.window_size
        if found is None:
            return None
        return int(found[1]) * sizes[0] / PLACE_STEPS, int(found[2]) * sizes[1] / PLACE_STEPS

    def _take_light(self, picture: Any, file: object) -> None:
        """Light the scene with a panorama, which is kept in the folder."""
        present, up = self._window.document.drawing.environment, self._window.actions.view.axes.up
        checked = Environment(picture, up=up) if present is None else replace(present, picture=picture)
        if self._kept >= MAX_KEPT:
            raise InvalidEdit(f"expected at most {MAX_KEPT} pictures for the light in one session")
        changed = replace(checked, picture=checked.picture.kept_at(keep_upload(file, self._folder)))
        self._kept += 1
        self._state.draw_with("set environment", environment=changed)

    def remove_light(self) -> None:
        """Light the scene as without a panorama."""
        self._state.draw_with("remove environment", environment=None)

    def _add_object(self, item: SceneObject) -> None:
        first = not self._window.document.objects

        def added() -> None:
            if first:
                self._window.actions.view.frame(lambda: None)

        self._state.run(AddObject(item), added)
        self.start_open = False

    def write(
        self, name: str, replace_existing: bool = False, size: object = "", video: str = "turntable"
    ) -> None:
        """Write a file of the folder whose suffix is the format; see `FileActions.write`.

        A picture without a size, such as "1920 x 1080", is what the view shows, with its mode and overlays.
        """
        name = _checked_name(name)
        numbers = [int(digits[:6]) for digits in re.findall(r"\d+", str(size))]
        shown = (numbers[0], numbers[1]) if len(numbers) == 2 else None
        self._files.write(name, bool(replace_existing), size=shown, video=video)

    def read(self, name: str, begin: int) -> bytes:
        """Return the bytes of a written file from number `begin` on, `PART_BYTES` at most."""
        path = self._files.inside(_checked_name(name))
        if path.suffix.lower() not in WRITTEN_SUFFIXES or not is_file(path):
            raise InvalidEdit(f"expected a file of the folder, found no {name!r}; write it first")
        try:
            with open_plain(self._folder, path) as file:
                length = os.fstat(file.fileno()).st_size
                file.seek(whole_number("begin", begin, 0, length, InvalidEdit))
                return file.read(PART_BYTES)
        except OSError as error:
            raise InvalidEdit(f"could not read {name} ({error.strerror})") from error

    def _open(self, load: Callable[[Progress, Cancel], Scene], path: Path | str) -> None:
        """Open a scene that belongs to a path, or to a new file of a name."""
        self._files.recovery.keep()  # so that its name is taken
        path = new_file(self._folder, path) if isinstance(path, str) else path
        recover = partial(load_scene, samples=sample_mesh)
        self._files.open(load, path, recover=recover, opened=self._opened)
        self.start_open = False


def _checked_name(name: object) -> str:
    """Return the name of a file without spaces around it, or raise `InvalidEdit`."""
    if not isinstance(name, str) or not name.strip():
        raise InvalidEdit(f"file: expected a name, such as model.json, got {describe(name)}")
    return name.strip()


def _row_of(key: str) -> Part | None:
    """Return the part of the scene whose row a key names; None for no key and a place of the view."""
    return Part.named(key) if key and PLACE.fullmatch(str(key)) is None else None
