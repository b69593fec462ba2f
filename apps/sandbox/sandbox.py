"""An edit window as plain values, which a page of the sandbox shows, and the events of that page.

The page (`decals.apps.sandbox.page`) draws these values and sends its events here. All behaviour is in the
window's session and its actions.
"""

import math
import time
from collections.abc import Callable, Sequence, Sized
from functools import partial, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from blobtree import Node
from decals.apps.sandbox import decal_panel
from decals.apps.sandbox.controls import KIND, controls_of, exchanged, kind_control, parsed
from decals.apps.sandbox.display import PHASES, Display
from decals.apps.sandbox.fields import Fields
from decals.apps.sandbox.files import SandboxFiles
from decals.apps.sandbox.folder import MAX_UPLOADS, thumbnails
from decals.apps.sandbox.hover import VIEW, Hover
from decals.apps.sandbox.outline import group, icon, outline
from decals.editing import new_nodes
from decals.editing.action_state import joined
from decals.editing.outline_actions import Part
from decals.editing.scatter_on_copies import ScatterOnCopies
from decals.editing.session import UndoEntry
from decals.editing.tree_actions import FollowedNode
from decals.errors import InvalidEdit
from decals.scenes.objects import TreeObject, bounds_of
from decals.validation import any_number, one_of, whole_number
from decals.window import EditWindow
from decals.window.host_plotter import show_background
from decals.window.view_modes import DisplayOptions

REST_SECONDS = 1.0
"""A slider that rests so long has ended its edit: keys that move it send no end."""

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
    show_start, new_model, open_sample, open_file, write_file, place_image, add_built_in, remove_light
        Events of files; see `SandboxFiles`.

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
        self._state, self._trees = actions.state, actions.trees
        self.display, self._hover = Display(window), Hover(window)
        self.add, self.wrap = self._event(self._trees.add_node), self._event(self._trees.wrap_node)
        self.combine = self._event(self._trees.combine_operands)
        self.unwrap, self.go_to = self._event(self._trees.unwrap_node), self._event(actions.go_to)
        window.overlay.hide_status()  # the page has its own, and handles
        window.handle.visible = False
        self.display.prepare()
        window.redraw(whole=True)
        actions.files.show_view = self.display.show_from
        actions.deselect_rows = self._deselect_rows
        self._files = files = SandboxFiles(window, folder or Path(), lessons, self._begin_scene)
        self.new_model, self.show_start = self._event(files.new_model), files.show_start
        self.open_sample, self.open_file = self._event(files.open_sample), self._event(files.open_file)
        self.place_image, self.write_file = self._event(files.place_image), self._event(files.write)
        self.remove_light = self._event(files.remove_light)
        self.add_built_in = self._event(files.add_built_in)
        self._setters: dict[str, Callable[..., None]] = {
            "display": self.display.set_option,
            "decals": partial(decal_panel.set_decal_value, self._state),
            "brush": partial(decal_panel.set_brush, self._state),
            "image": self._set_image,
            "drawing": partial(decal_panel.set_drawing, self._state),
            "scattering": self._set_scattering,
        }
        self._lessons, self._start_lesson = len(lessons), start_lesson
        self.in_lesson = False
        self._before_lesson: tuple[UndoEntry | None, tuple[Any, ...]] | None = None
        self.show_start(start)
        self._last_step = math.inf
        self.schedule: Callable[[], None] = self.take_step
        self._step: Callable[[], None] | None = None
        self._rows: list[dict[str, Any]] = []
        self._keys: tuple[str, ...] = ()
        self._scattering: dict[str, Any] = {}
        self._fields = Fields()
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
            "title": window.session.title_of(window.actions.files.path),
            "status": self.status,
            "refused": bool(state.refusal),
            "fields": self._fields.values(
                session.changes, state.refusals, state.refusal, working=state.background.busy_editing
            ),
            "help": window.actions.help_visible,
            "busy": window.busy,
            "queue": [vars(work) for work in state.background.queue],
            "outline": self._outline(),
            "selected": self._selected(),
            "marked": self._marked,
            "hovered": self._hover.values(),
            "panel": self._panel(),
            "done": list(session.labels[-MAX_HISTORY:]),
            "earlier": max(len(session.labels) - MAX_HISTORY, 0),
            "forgotten": session.forgotten,
            "undone": list(session.undone_labels[:MAX_HISTORY]),
            "start": self._files.start,
            "display": self.display.values(),
            "cube": self.display.cube(),
            "gizmo": {**self.display.gizmo(), "line": self.display.selection_line()},
            "decal": {
                "count": len(state.selection),
                "controls": decal_panel.decal_controls(document, state.selection),
            },
            "brush": decal_panel.brush_values(document, state.brush),
            "drawing": decal_panel.drawing_controls(document.drawing),
            "scattering": decal_panel.scatter_controls(document, self._scatter_values()),
            "image": decal_panel.image_values(document, self._shown_image),
            "pick": self._pick(),
            "decals": len(document.decals),
            "bare": window.actions.bare.places if window.actions.bare.offer else 0,
        }

    def _selected(self) -> str:
        """Return the key of the selected row."""
        if (primitive := self._state.primitive) is not None:
            return Part("node", *primitive).key
        return "" if self._shown_image is None else f"image {self._shown_image}"

    def _pick(self) -> dict[str, str]:
        """Return what the last click met."""
        pick = self._state.picked
        if pick is not self._reported_pick[0]:
            self._reported_pick = pick, {} if pick is None else self._trees.report(pick)
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
        last = self._window.session.labels[-1:]
        return " · ".join(filter(None, parts)) or (f"last action: {last[0]}" if last else "")

    @staticmethod
    def catalog() -> dict[str, Any]:
        """Return the kinds that can be added, by family; what each is, its group and icon; and images."""
        families = new_nodes.families()
        return {
            **families,
            "docs": {name: first_line(kind) for name, kind in new_nodes.kinds().items()},
            "groups": {name: group(name, kind) for name, kind in new_nodes.kinds().items()},
            "icons": {name: icon(name, family[:-1]) for family in families for name in families[family]},
            "images": thumbnails(".png"),
        }

    def _outline(self) -> list[dict[str, Any]]:
        """Return the rows of the outline; they change only with the document."""
        document = self._window.document
        layers = document.locked_layers, document.layer_names, document.decals.version
        shown = document.objects, document.images, *layers
        if shown != self._outlined:
            self._outlined, self._rows = shown, outline(document)
        return self._rows

    def _panel(self) -> dict[str, Any]:
        """Return title and controls of the selected node."""
        if self._state.primitive is None:
            document = self._window.document
            parts: dict[str, Sized] = {
                "object": document.objects,
                "decal": document.decals,
                "image": document.images,
            }
            facts = [f"{len(of)} {name}{'' if len(of) == 1 else 's'}" for name, of in parts.items()]
            return {"kind": "", "name": "", "doc": ", ".join(facts), "controls": [], "operands": 0}
        (number, path), node = self._state.primitive, self._trees.selected_node
        item = self._window.document.object(number)
        assert isinstance(item, TreeObject)  # meshes have no nodes
        return {
            "kind": type(node).__name__,
            "name": item.names.get(path, ""),
            "doc": first_line(type(node)),
            "controls": [*kind_control(node), *controls_of(node, self._size())],
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
        """Mark a layer or the node of a row too, or no longer; marked ones are changed together."""
        if Part.named(key).kind == "layer":
            self._state.primitive = None
            layers = self._keys if self._shown_image is None else ()
            self._keys = joined(layers, key, toggle=True)
            return
        _, number, path = Part.node(key)
        self._trees.select_also(number, path, toggle=True)

    @event
    def select(self, key: str) -> None:
        """Select a node, the root of an object, the decals of a layer, or an image; "" selects nothing."""
        state, document = self._state, self._window.document
        self._keys, state.primitive = (), None
        if key == "":
            return
        kind, number, path = Part.named(key)
        if kind == "layer":
            self._keys = (key,)
            state.selection = state.selectable(document.decals_of_layer(number))
        elif kind == "image":
            whole_number("image", number, 0, len(document.images) - 1, InvalidEdit)
            self._keys, state.selection = (key,), ()
        else:
            self._trees.select_node(number, path)

    def _deselect_rows(self) -> bool:
        """Deselect the image and all marked rows; return True if there were any."""
        selected, self._keys = bool(self._keys), ()
        return selected

    @property
    def _marked(self) -> list[str]:
        """Keys of the selected nodes, else of the layers or the image whose rows are selected."""
        return [Part("node", *place).key for place in self._state.nodes] or [*self._keys]

    @property
    def _shown_image(self) -> int | None:
        """The selected image, unless something else has been selected since, or it was removed."""
        part = Part.named(self._keys[0]) if self._keys else None
        if part is None or part.kind != "image" or self._state.nodes or self._state.selection:
            return None
        return part.number if part.number < len(self._window.document.images) else None

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

        refusals, changes = self._state.refusals, self._window.session.changes
        self.slide(step, last=bool(last))
        if last:
            refused = self._state.refusals > refusals
            reason = self._state.refusal if refused else ""
            self._fields.typed(panel, name, index, reason, changes, self._state.refusals)

    def _set_parameter(
        self, followed: FollowedNode, name: str, raw: Any, *, last: bool, index: object
    ) -> None:
        _, _, node = followed.find(self._window.document)
        if name == KIND:
            self._trees.exchange_node(followed, raw)
            return
        value = exchanged(getattr(node, str(name), ()), index, raw)
        self._trees.set_parameter(followed, name, parsed(node, name, value), last=last)

    def _set_image(self, name: str, raw: Any, *, last: bool, **_others: object) -> None:
        if (number := self._shown_image) is None:
            raise InvalidEdit("no image is selected; click on one in the outline")
        decal_panel.set_image_value(self._state, number, name, raw, last=last)

    def _set_scattering(self, name: str, raw: Any, **_others: object) -> None:
        document, values = self._window.document, self._scatter_values()
        one_of("option", name, values, InvalidEdit)
        images = decal_panel.chosen_images(document, raw) if name == "images" else None
        value = decal_panel.SCATTER[name].parsed(raw, InvalidEdit) if images is None else images
        decal_panel.scatter_arguments(document, values | {name: value})
        self._scattering[name] = value
        self._state.show(f"set {name}")

    def slide(self, step: Callable[[], None], *, last: bool) -> None:
        """Carry out a step of a slider; while it moves, only the newest one, before the next frame."""

        def stepped() -> None:
            self._window.overlay.moving = not last
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
        self._last_step, self._window.overlay.moving = math.inf, False
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

    @event
    def drop_work(self, number: int) -> None:
        """Cancel the running edit or export of a number in the queue, or leave out what waits there."""
        self._state.background.drop(number)

    # -- files ------------------------------------------------------------------------------------------

    @event
    def open_lesson(self, number: int) -> None:
        """Start one of the lessons."""
        number = whole_number("lesson", number, 0, self._lessons - 1, InvalidEdit)
        self._window.background.require_idle("open a lesson")
        if not self.in_lesson and self._window.document.objects:
            self._before_lesson = self._window.session.next_undo, self.display.kept_camera()
            self._window.actions.files.set_aside()
        self.display.options = DisplayOptions()
        self._start_lesson(number)
        self.in_lesson, self._files.start_open = True, False

    def close_lesson(self, keep: bool = False) -> None:
        """Leave the lesson and go back to the scene before it; without one, or to keep it, its own stays."""
        self.in_lesson = False
        if keep is True or self._before_lesson is None:
            self._before_lesson = None
            return
        entry, camera = self._before_lesson

        def step() -> None:
            self._before_lesson = None
            session = self._window.session
            while session.labels and session.next_undo is not entry:
                session.undo()
            self.display.restore_camera(camera)
            self._window.actions.files.take_back()
            self._state.show("")

        self.attempt(lambda: self._window.actions.when_idle("close the lesson", step))

    def _begin_scene(self) -> None:
        """Leave the lesson, and show another scene as a whole."""
        self.in_lesson, self._before_lesson = False, None
        self.display.options = DisplayOptions()
        self.display.bookmarks.clear()

    def upload(self, files: object, key: str = "") -> None:
        """Take files that were dropped on the page; see `SandboxFiles.take`."""
        dropped = files if isinstance(files, list | tuple) else [files]
        if len(dropped) > MAX_UPLOADS:
            self.attempt(partial(refuse_number, len(dropped)))
            return
        for file in dropped:
            self.attempt(partial(self._files.take, file, key))

    # -- view, decals and outline -----------------------------------------------------------------------

    def hover(self, key: str) -> None:
        """Light up what the pointer is at: the row of a key in the view, or the part at a place of the view.

        A place that has no part, and a key that the scene does not have, light up nothing. "kind Torus view
        5000/5000" shows what `add_at` would add, "kind Torus view 5000/5000 view 6000/5000" in a size.
        """
        kind, *places = str(key).split(VIEW)
        if places and not self._window.background.busy_editing:
            self._hover.at_row(key, *self._files.put(*(f"view {each}" for each in places[:2])))
        elif not places and not kind.startswith("view "):
            self._hover.at_row(key)
        elif not self._window.background.busy_editing:
            self._hover.at_place(self._files.surface_at(key))

    @event
    def add_at(self, kind: str, place: str, edge: str = "") -> None:
        """Add a primitive of a kind at a place of the view, see `SandboxFiles.surface_at`.

        Its surface reaches to the place of its edge, without one as far as suits the model.
        """
        self._trees.add_node(kind, *self._files.put(place, edge))

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

    def pinch(self, right: object, up: object, factor: object, phase: str, fingers: object = 2) -> None:
        """Turn the scene and enlarge it, as two fingers do, or move it, as three do.

        Parameters
        ----------
        right, up, factor
            The move of the fingers in heights of the view, and the enlargement, since the last call.
        phase
            "begin", which cancels what the first finger did alone, "move", or "end".
        fingers
            Their number.
        """

        def pinched() -> None:
            one_of("phase", phase, PHASES, InvalidEdit)
            if phase == "begin":
                self._window.cancel_press()
            moved, raised, ratio = (any_number("pinch", one, InvalidEdit) for one in (right, up, factor))
            self._window.begin_motion()
            ratio = min(max(ratio, 1.0 / MAX_ZOOM), MAX_ZOOM)
            shift = min(max(moved, -1.0), 1.0), min(max(raised, -1.0), 1.0)
            if fingers == 2:
                self._window.camera.turn(*shift)
            self._window.camera.move_and_zoom(*((0.0, 0.0) if fingers == 2 else shift), ratio)

        self.attempt(pinched, whole=phase == "end")

    @event
    def scatter(self) -> None:
        """Cover the object of the selected node, or every object, with decals; each time another seed."""
        primitive, objects = self._state.primitive, range(len(self._window.document.objects))
        numbers = tuple(objects) if primitive is None else (primitive[0],)
        values = self._scatter_values()
        command: dict[str, Any] = {"command": ScatterOnCopies} if values.get(decal_panel.COPIES) else {}
        if command:
            self._scattering["count"] = values["count"]  # copies that touch have fewer: the next keeps it
        self._scatter(partial(self._window.actions.decals.scatter_over, numbers, **command))

    @event
    def scatter_zone(self) -> None:
        """Replace the decals on the selected nodes, else those around the selected decals, likewise."""
        density = self._scatter_values()[decal_panel.ZONE]
        self._scatter(partial(self._window.actions.zones.scatter, zone_density=density))

    def _scatter(self, scatter: Callable[..., None]) -> None:
        """Scatter with the options of the panel, and choose the next seed."""
        arguments = decal_panel.scatter_arguments(self._window.document, self._scatter_values())
        scatter(**arguments)
        self._scattering["seed"] = arguments["seed"] + 1

    def _scatter_values(self) -> dict[str, Any]:
        """Return the options of the next scattering: those that were set, else the first ones."""
        return decal_panel.scatter_values(self._window.document, self._scattering)

    @event
    def change_row(self, key: str, change: str, value: Any = None) -> None:
        """Change what a row of the outline stands for; see `OutlineActions.change`."""
        self._window.actions.outline.change(key, change, value, self._marked)

    def read_file(self, name: str, begin: int) -> bytes:
        """Return a part of a written file, none of it if the request is refused; see `SandboxFiles.read`."""
        parts: list[bytes] = []
        self.attempt(lambda: parts.append(self._files.read(name, begin)))
        return b"".join(parts)

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


def refuse_number(count: int) -> None:
    """Raise the error of too many files at once."""
    raise InvalidEdit(f"expected at most {MAX_UPLOADS} files at once, got {count}; drop fewer")


def first_line(kind: type[Node]) -> str:
    """Return the first line of a class's description, without marks of code."""
    return (kind.__doc__ or "").strip().split("\n")[0].replace("`", "")
