"""An edit window as plain values, which a page of the sandbox shows, and the events of that page.

The page (`decals.apps.sandbox.page`) draws these values and sends its events here. All behaviour is in the
window's session and its actions.
"""

import math
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from blobtree import Node
from blobtree.custom.definition import custom_kinds
from blobtree.progress import Cancel, Progress
from decals import cover
from decals.apps.models.samples import SAMPLES, axes_of, sample, sample_mesh
from decals.apps.models.scenes import empty_scene, new_file
from decals.apps.sandbox import decal_panel
from decals.apps.sandbox.controls import controls_of, exchanged, parsed, parsed_option
from decals.apps.sandbox.display import PHASES, Display
from decals.apps.sandbox.folder import HDR, MODELS, keep_upload, listed, plain_name, read_upload
from decals.apps.sandbox.outline import outline
from decals.apps.views import THREE_QUARTER
from decals.editing import new_nodes
from decals.editing.commands import AddImage, ReplaceImage
from decals.editing.outline_actions import Part, image_on_layer
from decals.editing.queries import SurfacePick
from decals.editing.recovery import recovery_path
from decals.editing.scatter_commands import AddObject
from decals.editing.session import UndoEntry
from decals.editing.tree_actions import FollowedNode
from decals.errors import InvalidEdit
from decals.options import arguments_of
from decals.rendering.environment import Environment
from decals.scattering.scatter import scatter
from decals.scenes.camera import DEFAULT_DIRECTION, UPRIGHT
from decals.scenes.cover import fitting_camera
from decals.scenes.files import is_scene_file, load_model, load_scene
from decals.scenes.objects import MeshObject, SceneObject, TreeObject, bounds_of, unused_name
from decals.scenes.scene import DecalImage, Scene
from decals.validation import describe, finite_number, one_of, whole_number
from decals.window import EditWindow
from decals.window.host_plotter import show_background
from decals.window.view_modes import DisplayOptions

REST_SECONDS = 1.0
"""A slider that rests so long has ended its edit: keys that move it send no end."""

FIRST_IMAGES = ("scale",)
"""Images of a scene at the beginning."""

LIGHT = "light"
"""Key under which a page sends a panorama, which lights the scene."""

PLACE, PLACE_STEPS = re.compile(r"view (\d{1,5})/(\d{1,5})"), 10_000
"""Key of a place of the view, and steps across the view that it counts, from the lower left corner."""

MAX_ZOOM = 4.0
"""Largest factor of one step of two fingers."""

MAX_HISTORY = 200
"""Most entries of the history that a page lists."""


Arguments = ParamSpec("Arguments")


def event(
    method: Callable[Concatenate["Sandbox", Arguments], None],
) -> Callable[Concatenate["Sandbox", Arguments], None]:
    """Let an event be an attempt; see `Sandbox.attempt`."""

    @wraps(method)
    def reported(sandbox: "Sandbox", /, *arguments: Arguments.args, **options: Arguments.kwargs) -> None:
        sandbox.attempt(partial(method, sandbox, *arguments, **options))

    return reported


class Sandbox:
    """The state of a sandbox page, and its events.

    Parameters
    ----------
    window
        The edited window. Its plotter is the view of the page.
    folder
        Files are read and written only inside this folder. Default: the working folder.
    start
        Show the start page first.
    lessons
        Titles of lessons that the start page lists.
    start_lesson
        Starts one of them, by its index.

    Attributes
    ----------
    display : Display
        How the view shows the scene.
    in_lesson
        True while the page shows a lesson.
    schedule
        Asks for a call of `take_step` before the next frame. Default: it is called at once.
    add, wrap, combine, unwrap
        Events that add a primitive of a kind, put the selected node under another one, combine its operands
        in another way, and replace it by its only operand; see `TreeActions`.
    go_to
        Event that goes to an entry of the history; see `Actions.go_to`.

    Notes
    -----
    Events never raise for bad values: the scene stays as it was, and `status` says why. An unknown event is
    a mistake of the page and raises.
    """

    def __init__(
        self,
        window: EditWindow,
        *,
        folder: Path | None = None,
        start: bool = False,
        lessons: Sequence[str] = (),
        start_lesson: Callable[[int], None] = lambda _: None,
    ) -> None:
        self._window, actions = window, window.actions
        self._state, self._trees, self._files = actions.state, actions.trees, actions.files
        self._folder = (Path() if folder is None else folder).resolve()
        self.display = Display(window)
        self.add, self.wrap = self._event(self._trees.add_node), self._event(self._trees.wrap_node)
        self.combine = self._event(self._trees.combine_operands)
        self.unwrap, self.go_to = self._event(self._trees.unwrap_node), self._event(actions.go_to)
        window.overlay.hide_status()  # the page has its own, and handles
        window.handle.visible = False
        window.redraw(whole=True)
        self._files.screenshot = lambda: window.plotter.screenshot(None, return_img=True)
        self._files.folder, self._files.show_view = self._folder, self.display.show_from
        self._setters: dict[str, Callable[..., None]] = {
            "display": self.display.set_option,
            "decals": partial(decal_panel.set_decal_value, self._state),
            "brush": partial(decal_panel.set_brush, self._state),
            "image": self._set_image,
            "drawing": partial(decal_panel.set_drawing, self._state),
            "scattering": self._set_scattering,
        }
        self._lessons, self._start_lesson = list(lessons), start_lesson
        self.in_lesson = False
        self._before_lesson: tuple[UndoEntry | None, tuple[Any, ...]] | None = None
        self._start: dict[str, Any] = {}
        self.show_start(start)
        self._last_step = math.inf
        self.schedule: Callable[[], None] = self.take_step
        self._step: Callable[[], None] | None = None
        self._rows: list[dict[str, Any]] = []
        self._marked: list[str] = []
        self._image: int | None = None
        self._scattering: dict[str, Any] = {}
        self._background = window.document.drawing.background
        self._outlined: tuple[Any, ...] = ()
        self._measured: tuple[object, float] = None, 1.0
        self._reported_pick: tuple[object, dict[str, str]] = None, {}

    # -- values -----------------------------------------------------------------------------------------

    def values(self) -> dict[str, Any]:
        """Return all values of the page, by their names there."""
        window, state = self._window, self._state
        document, session = window.document, window.session
        return {
            "title": self._files.title,
            "status": self.status,
            "refusals": state.refusals,
            "refused": bool(state.refusal),
            "help": window.actions.help_visible,
            "busy": window.busy,
            "outline": self._outline(),
            "selected": self._selected(),
            "marked": self._marked,
            "panel": self._panel(),
            "done": list(session.labels[-MAX_HISTORY:]),
            "earlier": max(len(session.labels) - MAX_HISTORY, 0),
            "forgotten": session.forgotten,
            "undone": list(session.undone_labels[:MAX_HISTORY]),
            "start": self._start,
            "display": self.display.values(),
            "cube": self.display.cube(),
            "gizmo": {**self.display.gizmo(), "line": self.display.selection_line()},
            "decal": {
                "count": len(state.selection),
                "controls": decal_panel.decal_controls(document, state.selection),
            },
            "brush": decal_panel.brush_values(document, state.brush),
            "drawing": decal_panel.drawing_controls(document.drawing),
            "scattering": decal_panel.scatter_controls(self._scatter_values()),
            "image": decal_panel.image_values(document, self._shown_image),
            "pick": self._pick(),
            "decals": len(document.decals),
        }

    def _selected(self) -> str:
        """Return the key of the selected row."""
        if (primitive := self._state.primitive) is not None:
            return Part("node", *primitive).key
        return "" if self._shown_image is None else f"image {self._shown_image}"

    def _pick(self) -> dict[str, str]:
        """Return what the last click met."""
        state = self._state
        if state.picked is not self._reported_pick[0]:
            pick = state.picked
            facts = {} if pick is None else self._trees.report(pick)
            self._reported_pick = pick, facts
        return self._reported_pick[1]

    @property
    def status(self) -> str:
        """The last message, and the progress of background work."""
        state = self._state
        parts = (
            self._window.warmup.status,
            state.background.progress,
            state.prompt.text,
            *dict.fromkeys((state.message, state.refusal)),
            self.display.message,
        )
        return " · ".join(filter(None, parts))

    @staticmethod
    def catalog() -> dict[str, Any]:
        """Return the names of the kinds that can be added, by family, and what each is."""
        return {
            **new_nodes.families(),
            "custom": [kind.__name__ for kind in custom_kinds()],
            "docs": {name: first_line(kind) for name, kind in new_nodes.kinds().items()},
        }

    def _outline(self) -> list[dict[str, Any]]:
        """Return the rows of the outline; they change only with the document."""
        document = self._window.document
        layers = document.locked_layers, document.layer_names, document.decals.version
        shown = document.objects, document.images, *layers
        if shown != self._outlined:
            rows = outline(document)
            if rows != self._rows:  # a key may stand for another node now
                self._rows, self._marked = rows, []
            self._outlined = shown
        return self._rows

    def _panel(self) -> dict[str, Any]:
        """Return title and controls of the selected node."""
        if self._state.primitive is None:
            return {"kind": "", "name": "", "doc": "", "controls": [], "operands": 0}
        (number, path), node = self._state.primitive, self._trees.selected_node
        item = self._window.document.object(number)
        assert isinstance(item, TreeObject)  # meshes have no nodes
        return {
            "kind": type(node).__name__,
            "name": item.names.get(path, ""),
            "doc": first_line(type(node)),
            "controls": controls_of(node, self._size()),
            "operands": len(node.children),
        }

    def _size(self) -> float:
        """Return the size of the scene when the node was selected: sliders keep their ends."""
        selected = self._state.primitive
        if self._measured[0] != selected:
            low, high = bounds_of(self._window.document.objects)
            self._measured = selected, float((high - low).max())
        return self._measured[1]

    # -- events -----------------------------------------------------------------------------------------

    @event
    def mark(self, key: str) -> None:
        """Mark the node of a row too, or no longer; marked nodes are grouped and removed together."""
        node = Part.node(key)
        self._trees.select_node(node.number, node.path)
        self._outline()  # forgets the marks of a former tree
        others = [k for k in self._marked if k != node.key and Part.node(k).number == node.number]
        self._marked = others + ([] if node.key in self._marked else [node.key])

    @event
    def select(self, key: str) -> None:
        """Select a node, the root of an object, the decals of a layer, or an image; "" selects nothing."""
        self._marked, self._image = [], None
        state, document = self._state, self._window.document
        if key == "":
            state.primitive = None
            return
        kind, number, path = Part.named(key)
        if kind == "layer":
            state.selection = state.selectable(document.decals_of_layer(number))
        elif kind == "image":
            self._image = whole_number("image", number, 0, len(document.images) - 1, InvalidEdit)
            state.primitive, state.selection = None, ()
        else:
            self._trees.select_node(number, path)
            self._marked = [Part("node", number, path).key]

    @property
    def _shown_image(self) -> int | None:
        """The selected image, unless something else has been selected since, or it was removed."""
        state, count = self._state, len(self._window.document.images)
        kept = state.primitive is None and not state.selection and (self._image or 0) < count
        return self._image if kept else None

    def set_control(self, panel: str, name: str, raw: Any, last: bool = True, index: object = ()) -> None:
        """Set what a control of a panel stands for.

        Parameters
        ----------
        panel
            "node", "display", "decals", "brush", "image", "drawing" or "scattering".
        name
            Name of the control.
        raw
            What it sent.
        last
            False while a slider moves: all its values are one undo entry.
        index
            Leads through lists to the number that is set.
        """
        node = self._trees.follow_selected()  # a typed value may wait for an edit that selects another one
        setters = self._setters | {"node": partial(self._set_parameter, node)}

        def step() -> None:
            setter = setters[one_of("panel", panel, setters, InvalidEdit)]
            setter(name, raw, last=bool(last), index=index)

        self.slide(step, last=bool(last))

    def _set_parameter(
        self, followed: FollowedNode, name: str, raw: Any, *, last: bool, index: object
    ) -> None:
        _, _, node = followed.find(self._window.document)
        value = exchanged(getattr(node, str(name), ()), index, raw)
        self._trees.set_parameter(followed, name, parsed(node, name, value), last=last)

    def _set_image(self, name: str, raw: Any, *, last: bool, **_others: object) -> None:
        if (number := self._shown_image) is None:
            raise InvalidEdit("no image is selected; click on one in the outline")
        decal_panel.set_image_value(self._state, number, name, raw, last=last)

    def _set_scattering(self, name: str, raw: Any, **_others: object) -> None:
        one_of("option", name, self._scatter_values(), InvalidEdit)
        self._scattering[name] = parsed_option(scatter, name, raw)
        self._state.show(f"set {name}")

    def slide(self, step: Callable[[], None], *, last: bool) -> None:
        """Carry out a step of a slider; while it moves, only the newest one, before the next frame."""

        def stepped() -> None:
            step()
            self._last_step = math.inf if last else time.monotonic()

        if last:
            self.attempt(stepped)
            return
        self._step = lambda: self.attempt(stepped, whole=False)
        self.schedule()

    def take_step(self) -> None:
        """Carry out the newest step of a slider, if one waits."""
        step, self._step = self._step, None
        if step is not None:
            step()

    def end_input(self) -> None:
        """End the moves of a slider whose browser has left, as one entry of the history."""
        self.take_step()
        self._last_step = math.inf
        self.attempt(self._trees.end_drag)

    def settle(self) -> None:
        """Keep the view up to date, and end the edit of a slider that has rested; call this regularly."""
        if self._background != self._window.document.drawing.background:
            self._background = self._window.document.drawing.background
            show_background(self._window.plotter, self._background)
            self._window.redraw(whole=True)
        if self.display.update():
            self._window.redraw(whole=True)
        if time.monotonic() - self._last_step > REST_SECONDS:
            self.end_input()

    def drag_handle(self, name: str, phase: str, x: float, y: float, snap: bool = False) -> None:
        """Drag a handle of the selected node; see `Display.drag_handle`."""
        self.slide(lambda: self.display.drag_handle(name, phase, x, y, snap=bool(snap)), last=phase != "move")

    def show_help(self, shown: bool) -> None:
        """Show or hide the list of all actions."""
        self._window.actions.help_page = int(bool(shown))

    @event
    def perform(self, action: str) -> None:
        """Carry out an action of the key table at the middle of the view."""
        width, height = self._window.plotter.window_size
        self._window.actions.perform(action, lambda: self._window.tools.at(width / 2, height / 2))

    # -- files ------------------------------------------------------------------------------------------

    def show_start(self, shown: bool) -> None:
        """Show or hide the start page."""
        offered = {"open": bool(shown), "samples": list(SAMPLES), "lessons": self._lessons}
        self._start = offered | listed(self._folder)

    @event
    def open_lesson(self, number: int) -> None:
        """Start one of the lessons."""
        number = whole_number("lesson", number, 0, len(self._lessons) - 1, InvalidEdit)
        self._window.background.require_idle()
        if not self.in_lesson and self._window.document.objects:
            self._before_lesson = self._window.session.next_undo, self.display.kept_camera()
            self._files.set_aside()
        self.display.options = DisplayOptions()
        self._start_lesson(number)
        self.in_lesson, self._start = True, {**self._start, "open": False}

    def close_lesson(self) -> None:
        """Leave the lesson and go back to the scene before it; without one, that of the lesson stays."""
        self.in_lesson = False
        if self._before_lesson is None:
            return
        entry, camera = self._before_lesson

        def step() -> None:
            self._before_lesson = None
            session = self._window.session
            while session.labels and session.next_undo is not entry:
                session.undo()
            self.display.restore_camera(camera)
            self._files.take_back()
            self._state.show("")

        self.attempt(lambda: self._window.actions.when_idle(step))

    @event
    def new_model(self) -> None:
        """Begin an empty scene."""
        scene = empty_scene(FIRST_IMAGES, UPRIGHT["y"])
        self._open(lambda *_: scene, "scene")

    @event
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

    @event
    def open_file(self, name: str) -> None:
        """Open a file of the folder: a scene, or a model, to which decals can be added."""
        if not isinstance(name, str) or Path(name).suffix.lower() not in MODELS:
            raise InvalidEdit(f"file: expected a name that ends in {', '.join(MODELS)}, got {describe(name)}")
        path = self._files.inside(name)
        unsaved = self._files.inside(recovery_path(path))  # a link could lead elsewhere
        if not path.exists() and not unsaved.is_file():
            raise InvalidEdit(f"expected a file of the folder, found no {name!r}")

        def load(_progress: Progress, _cancel: Cancel) -> Scene:
            if not path.exists():  # the recovery file has everything
                return empty_scene(FIRST_IMAGES, UPRIGHT["y"])
            found = load_model(path, samples=sample_mesh)
            if isinstance(found, Scene):
                return found
            camera = fitting_camera([found], direction=DEFAULT_DIRECTION, aspect=width / height)
            return Scene(objects=[found], camera=camera, images=FIRST_IMAGES)

        width, height = self._window.plotter.window_size
        is_scene = path.suffix == ".json" and (not path.exists() or is_scene_file(path))
        self._open(load, path if is_scene else f"{path.stem}-decals")

    def upload(self, files: object, key: str = "") -> None:
        """Take files that were dropped on the page: images and models are added, a scene is opened.

        An image that was dropped on the row of a layer shows on its decals, on that of an image replaces it.
        One that was dropped on a place of the view, see `surface_at`, shows on a new decal there.
        One that was dropped on the key "light", and a Radiance file without a row, is the light.
        """
        for file in files if isinstance(files, list | tuple) else [files]:
            self.attempt(partial(self._take_file, file, key))

    def _take_file(self, file: object, key: str) -> None:
        found, window = read_upload(file), self._window
        file_name = str(file["name"])  # type: ignore[index]  # read_upload has checked it
        name = plain_name(file_name)
        if key == LIGHT or (not _row_of(key) and file_name.lower().endswith(HDR)):
            self._take_light(found, file)
        elif isinstance(found, Scene):
            self._open(lambda *_: found, name)
        elif isinstance(found, DecalImage):
            self._take_image(found, key)
        else:
            taken = {item.name for item in window.document.objects}
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
        name = decal_panel.image_names(session.document)[-1]
        state.show(f"added image {name}{shown or '; choose it for the selected decals'}")

    @event
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
        found = PLACE.fullmatch(str(place))
        if found is None:
            return None
        width, height = self._window.plotter.window_size
        return self._window.tools.at(
            int(found[1]) * width / PLACE_STEPS, int(found[2]) * height / PLACE_STEPS
        )

    def _take_light(self, picture: Any, file: object) -> None:
        """Light the scene with a panorama, which is kept in the folder."""
        present, up = self._window.document.drawing.environment, self._window.actions.view.axes.up
        checked = Environment(picture, up=up) if present is None else replace(present, picture=picture)
        changed = replace(checked, picture=checked.picture.kept_at(keep_upload(file, self._folder)))
        self._state.draw_with("set environment", environment=changed)

    @event
    def remove_light(self) -> None:
        """Light the scene as without a panorama."""
        self._state.draw_with("remove environment", environment=None)

    def _add_object(self, item: SceneObject) -> None:
        first = not self._window.document.objects

        def added() -> None:
            if first:
                self.move_camera("frame")

        self._state.run(AddObject(item), added)
        self._start = {**self._start, "open": False}

    @event
    def write_file(
        self, name: str, replace_existing: bool = False, size: object = "", video: str = "turntable"
    ) -> None:
        """Write a file of the folder whose suffix is the format; see `FileActions.write`.

        A picture without a size, such as "1920 x 1080", is what the view shows, with its mode and overlays.
        """
        if not isinstance(name, str) or not name.strip():
            raise InvalidEdit(f"file: expected a name, such as model.json, got {describe(name)}")
        numbers = [int(digits[:6]) for digits in re.findall(r"\d+", str(size))]
        shown = (numbers[0], numbers[1]) if len(numbers) == 2 else None
        self._files.write(name.strip(), bool(replace_existing), size=shown, video=video)

    def _open(self, load: Callable[[Progress, Cancel], Scene], path: Path | str) -> None:
        """Open a scene that belongs to a path, or to a new file of a name."""
        self._files.recovery.keep()  # so that its name is taken
        path = new_file(self._folder, path) if isinstance(path, str) else path
        self._files.open(load, path, recover=partial(load_scene, samples=sample_mesh))
        self.in_lesson, self._before_lesson = False, None
        self._start = {**self._start, "open": False}
        self.display.options = DisplayOptions()
        self.display.bookmarks.clear()

    # -- view, decals and outline -----------------------------------------------------------------------

    @event
    def move_camera(self, name: str, value: Any = None) -> None:
        """Move the camera: "frame", "look" from a side, "keep" a bookmark, or "go" to one."""
        moves: dict[str, Callable[[], None]] = {
            "frame": lambda: self._window.actions.view.frame(lambda: None),
            "look": lambda: self._window.actions.view.look_from(value),
            "keep": self.display.add_bookmark,
            "go": lambda: self.display.go_to_bookmark(value),
        }
        moves[one_of("camera", name, moves, InvalidEdit)]()

    def pinch(self, right: object, up: object, factor: object, phase: str) -> None:
        """Move the scene in heights of the view and enlarge it, as two fingers do.

        Parameters
        ----------
        right, up, factor
            The move and the enlargement since the last call.
        phase
            "begin", which cancels what the first finger did alone, "move", or "end".
        """

        def pinched() -> None:
            one_of("phase", phase, PHASES, InvalidEdit)
            if phase == "begin":
                self._window.cancel_press()
            moved, raised, ratio = (finite_number("pinch", one, InvalidEdit) for one in (right, up, factor))
            self._window.begin_motion()
            ratio = min(max(ratio, 1.0 / MAX_ZOOM), MAX_ZOOM)
            self._window.camera.move_and_zoom(min(max(moved, -1.0), 1.0), min(max(raised, -1.0), 1.0), ratio)

        self.attempt(pinched, whole=phase == "end")

    @event
    def scatter(self) -> None:
        """Cover the object of the selected node, or every object, with decals; each time another seed."""
        state, values = self._state, self._scatter_values()
        objects = range(len(self._window.document.objects))
        numbers = tuple(objects) if state.primitive is None else (state.primitive[0],)
        self._window.actions.decals.scatter_over(numbers, **arguments_of(scatter, values))
        self._scattering["seed"] = values["seed"] + 1

    def _scatter_values(self) -> dict[str, Any]:
        """Return the options of the next scattering: those that were set, else the first ones."""
        return decal_panel.first_scatter_values(len(self._window.document.decals)) | self._scattering

    @event
    def change_row(self, key: str, change: str, value: Any = None) -> None:
        """Change what a row of the outline stands for; see `OutlineActions.change`."""
        self._window.actions.outline.change(key, change, value, self._marked)

    def _event(self, action: Callable[Arguments, None]) -> Callable[Arguments, None]:
        """Return an event that attempts an action of the window."""

        @wraps(action)
        def reported(*arguments: Arguments.args, **options: Arguments.kwargs) -> None:
            self.attempt(partial(action, *arguments, **options))

        return reported

    def attempt(self, request: Callable[[], None], *, whole: bool = True) -> None:
        """End the steps before a request, carry it out as `ActionState.attempt` does, and draw the result."""
        self.take_step()
        self._state.attempt(request)
        self._window.redraw(whole=whole)


def _row_of(key: str) -> Part | None:
    """Return the part of the scene whose row a key names; None for no key and a place of the view."""
    return Part.named(key) if key and PLACE.fullmatch(str(key)) is None else None


def first_line(kind: type[Node]) -> str:
    """Return the first line of a class's description, without marks of code."""
    return (kind.__doc__ or "").strip().split("\n")[0].replace("`", "")
