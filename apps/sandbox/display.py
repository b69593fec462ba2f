"""How the view shows the scene: its controls, handles and cameras."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike

from decals.apps.sandbox.controls import STEPS, Control, exchanged
from decals.apps.sandbox.cube import cube_cells
from decals.apps.sandbox.decal_panel import brush_values
from decals.apps.sandbox.hover import in_view
from decals.editing.background import Job, Worker
from decals.editing.gizmo import AXES, Handle, Ray
from decals.editing.slicing import CHOICES as SLICES
from decals.editing.slicing import MOVE, NONE, TILT, TILTED, SliceDrag, SlicePlane, slice_box
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.scenes.camera import UPRIGHT, Camera
from decals.scenes.meshes import as_polydata, meshed
from decals.scenes.objects import SceneObject, same_shape
from decals.surfaces.surface import unit_rows
from decals.validation import any_number, number_of, one_of, whole_number
from decals.vtk.subplot import FrameStatus
from decals.window import EditWindow
from decals.window.host_plotter import pixels_of, ray_through
from decals.window.view_modes import (
    MODES,
    OVERLAYS,
    PREFIX,
    RESOLUTION,
    DisplayOptions,
    Shown,
    example_data,
    shown_data,
)

SCALE: dict[str, Any] = {"n_labels": 0, "title_font_size": 16, "width": 0.4, "render": False}
SCALE |= {"position_x": 0.02, "position_y": 0.02, "color": "black", "background_color": "white", "fill": True}
"""How the scale of colours looks: its title has the numbers of its ends, so all text is on its background."""

GIZMO_SIZE = 0.12
"""Length of the axes of the gizmo, in heights of the view."""

LINED = "move ", TILT
"""First parts of the names of the handles at the end of an axis."""

PHASES = "begin", "move", "end"
"""Parts of a drag."""

MAX_BOOKMARKS = 20
CAMERA_VALUES = "position", "focal_point", "up", "view_angle", "parallel_scale", "parallel_projection"


class Display:
    """Modes, overlays, handles and cameras of a window.

    Meshes are made in a thread. The view shows the old meshes meanwhile.

    Parameters
    ----------
    window
        The edited window.

    Attributes
    ----------
    points
        Further points with a handle, by name, each with what takes the ray under the pointer.
    """

    def __init__(self, window: EditWindow) -> None:
        self._window, self._worker = window, Worker()
        self.options = DisplayOptions()
        self.points: Mapping[str, tuple[ArrayLike, Callable[[Ray], None]]] = {}
        self.bookmarks: list[tuple[str, Any]] = []
        self.message = ""
        self._key: tuple[object, ...] = ()
        self._meshes: list[tuple[SceneObject, pv.PolyData]] = []
        self._names: list[str] = []
        self._axes = False
        self._slice_drag: SliceDrag | None = None

    def values(self) -> dict[str, Any]:
        """Return plain values for a page."""
        return {
            "controls": [vars(control) for control, _ in self._options()],
            "bookmarks": [name for name, _ in self.bookmarks],
            "busy": self._worker.busy,
        }

    # -- modes ------------------------------------------------------------------------------------------

    def _options(self) -> Iterator[tuple[Control, Callable[[Any], None]]]:
        """Yield the controls of the view, each with the function that takes its checked value."""
        options, plane, length = self.options, self.options.slice, "model units"
        camera, state, view = self._window.camera, self._window.actions.state, self._window.actions.view
        choice = Control.choice

        def change(**changed: Any) -> None:
            self.options = replace(options, **changed)

        up = next((name for name, known in UPRIGHT.items() if known == view.axes), "y")
        cut = NONE if plane is None else plane.choice
        cut_doc = "plane that cuts the model open: across an axis, or tilted"
        yield choice("mode", options.mode, MODES, "how surfaces are drawn"), lambda mode: change(mode=mode)
        yield (
            choice("overlay", options.overlay, OVERLAYS, "what is measured on them"),
            lambda overlay: change(overlay=overlay),
        )
        yield choice("slice", cut, SLICES, cut_doc), lambda chosen: change(slice=self._plane_of(chosen))
        if plane is not None:
            low, high = plane.reach(*self._box())
            doc, step = "distance of the slice from the origin of the model", (high - low) / STEPS
            position = Control("slice_position", "number", plane.position, doc, length, low, high, step)
            yield position, lambda at: change(slice=plane.at(at))
            normal = Control("slice_normal", "vector", plane.normal, "x, y, z; what lies on that side is cut")
            yield normal, lambda along: change(slice=SlicePlane.across(plane.point, along))
        up_doc = "axis that points upward in the model"
        yield choice("up", up, UPRIGHT, up_doc), lambda axis: setattr(view, "axes", UPRIGHT[axis])
        snap_doc = "dragged primitives move by multiples of this distance; 0: freely"
        yield Control("snap", "field", state.snap, snap_doc, length), self._set_snap
        parallel = Control("orthographic", "switch", camera.parallel, "no perspective")
        yield parallel, lambda on: setattr(camera, "parallel", on)
        yield Control("axes", "switch", self._axes, "show the axes"), self._show_axes

    def set_option(self, name: str, value: Any, index: object = (), **_others: object) -> None:
        """Set a control of the view; ``index`` holds that of the number of the normal.

        Raises
        ------
        InvalidEdit
            There is no such control or value.
        """
        options = {control.name: (control, take) for control, take in self._options()}
        control, take = options[one_of("view", name, options, InvalidEdit)]
        match control.kind:
            case "choice":
                take(one_of(name, value, control.choices, InvalidEdit))
            case "switch":
                take(bool(value))
            case "vector" if not index:
                take(value)
            case _:
                take(exchanged(control.value, index, number_of(name, value, InvalidEdit)))

    def _set_snap(self, distance: float) -> None:
        if distance < 0.0:
            raise InvalidEdit(f"snap: expected 0 or more, got {distance}")
        self._window.actions.state.snap = distance

    def _box(self) -> tuple[ArrayLike, ArrayLike]:
        """Return the corners of the scene's box; those of a cube without objects."""
        objects = self._window.document.objects
        return slice_box(objects) if objects else (-np.ones(3), np.ones(3))

    def _plane_of(self, choice: str) -> SlicePlane | None:
        """Return the plane of a choice, through the middle of the scene; a tilted one stays."""
        plane = self.options.slice
        if choice == NONE or (plane is not None and choice == plane.choice):
            return None if choice == NONE else plane
        normal = np.ones(3) if choice == TILTED else np.eye(3)[AXES.index(choice)]
        return SlicePlane.across(np.add(*self._box()) / 2, normal)

    def _show_axes(self, shown: bool) -> None:
        plotter = self._window.plotter
        (plotter.add_axes if shown else plotter.hide_axes)()
        self._axes = shown

    def update(self) -> bool:
        """Show what the options ask for, once the scene rests; return True if the view changed."""
        try:
            complete = self._worker.poll()
            if complete is not None:
                complete()
                return True
        except ImplicitDecalsError as error:  # such as a mapping that the mode does not have
            self.message = str(error)
            return False
        window = self._window
        options, document = self.options, window.document
        if self._worker.busy and (options == DisplayOptions() or not document.objects):
            self._worker.cancel()
            self.message = ""
        if self._worker.busy or window.tools.dragging or window.background.following:
            return False
        if options == DisplayOptions() or not document.objects:
            return self._clear()
        read: tuple[object, ...] = ()  # overlays alone show decals
        if options.overlay != OVERLAYS[0]:
            modes = document.drawing.modes.values()
            read = document.decals.version, *modes
        key = options, document.objects, *read
        if key == self._key:
            return False
        self._key = key
        fork, meshes = document.fork(), self._meshes

        def work(_progress: object, _cancel: object) -> Callable[[], None]:
            objects = fork.objects
            parts = [
                _known_mesh(item, meshes) or as_polydata([item], resolution=RESOLUTION) for item in objects
            ]
            shown, message = shown_data(fork, parts, options)
            polygonized = options.mode == MODES[1] and options.slice is None
            drawn = meshed(objects, parts) if polygonized else None

            def install() -> None:
                self._meshes = [*zip(objects, parts, strict=True)]
                self._install(shown, message, options, drawn)

            return install

        if options.slice is None:  # one that is dragged changes too often for a message
            self.message = "preparing the view"
        return not self._worker.start(Job("view", work))

    def prepare(self) -> None:
        """Draw once, before input comes, each kind of actor that may be shown."""
        self._install(example_data(), "", self.options)
        self._window.plotter.render_window.Render()
        self._install([], "", self.options)

    def _clear(self) -> bool:
        had, self._key, self._meshes = self._key != (), (), []
        if had:
            self._install([], "", self.options)
        return had

    def _install(
        self, shown: Shown, message: str, options: DisplayOptions, drawn: Sequence[object] | None = None
    ) -> None:
        """Exchange the actors and the drawn objects, and hide the scene where an actor stands for it."""
        plotter, subplot = self._window.plotter, self._window.subplot
        subplot.drawn_objects = drawn
        for name in self._names:
            plotter.remove_actor(name, render=False, reset_camera=False)
        for title in [*plotter.scalar_bars.keys()]:
            plotter.remove_scalar_bar(title, render=False)
        self._names, self.message = [name for name, _, _ in shown], message
        replaced = f"{PREFIX}mesh" in self._names
        subplot.actor.SetVisibility(not replaced)
        if replaced:  # a scene that is not drawn needs no warm-up
            subplot.status, self._window.warmup.status = FrameStatus.EMPTY, ""
        for name, data, given in shown:
            shown_as = {"pickable": False, "reset_camera": False, "render": False, **given}
            low, high = given.get("clim", (0.0, 0.0))
            title = f"{given.get('scalars')}, {low:.3g} to {high:.3g}".replace("-", "\N{MINUS SIGN}")
            plotter.add_mesh(data, name=name, scalar_bar_args={**SCALE, "title": title}, **shown_as)

    # -- cameras ----------------------------------------------------------------------------------------

    def show_from(self, camera: Camera) -> None:
        """Look from the camera of a scene."""
        self._window.actions.view.stand(camera.up)
        view = self._window.subplot.vtk_renderer.camera
        view.parallel_projection = False
        view.position, view.focal_point, view.up = camera.position, camera.target, camera.up
        view.view_angle = camera.fov
        self._window.subplot.vtk_renderer.reset_camera_clipping_range()

    def gizmo(self) -> dict[str, Any]:
        """Return where the handles of the selected node and of the slice lie in the view.

        Places are in parts of its width and height. A line leads to the end of each axis.
        """
        trees, plane = self._window.actions.trees, self.options.slice
        groups = [] if plane is None else [plane.handles(self._gizmo_length(plane.point))]
        if middle := trees.handles(1.0):
            groups.append(trees.handles(self._gizmo_length(middle[0].position)))
        groups += [[Handle(name, np.asarray(point))] for name, (point, _) in self.points.items()]
        handles: list[dict[str, Any]] = []
        lines: list[list[float]] = []
        for group in groups:
            pixels = pixels_of(self._window.subplot, [handle.position for handle in group])
            places = in_view(self._window, pixels).tolist()
            for handle, (x, y) in zip(group, places, strict=True):
                if np.isfinite(x):
                    handles.append({"name": handle.name, "x": x, "y": y})
                    if handle.name.startswith(LINED) and np.isfinite(places[0][0]):
                        lines.append([*places[0], x, y])
        return {"handles": handles, "lines": lines, "brush": self._brush_size()}

    def cube(self) -> list[dict[str, Any]]:
        """Return the orientation cube; see `cube_cells`."""
        eye, target = self._window.camera.eye_and_target()
        up = self._window.subplot.vtk_renderer.camera.up
        toward = tuple(np.subtract(eye, target).tolist())
        return cube_cells(self._window.actions.view.axes, toward, tuple(up))

    def _brush_size(self) -> float:
        """Return the radius of the brush at the target, in heights of the view; 0 without one."""
        controls = brush_values(self._window.document, self._window.actions.state.brush)["controls"]
        radius = next((control["value"] for control in controls if control["name"] == "radius"), 0.0)
        _, target = self._window.camera.eye_and_target()
        return round(radius * GIZMO_SIZE / self._gizmo_length(target), 4)

    def selection_line(self) -> str:
        """Return the box or lasso that is being drawn, as points of an SVG of the size 1."""
        line = in_view(self._window, self._window.tools.selection_line)
        return " ".join(f"{x},{y}" for x, y in line.tolist())

    def _gizmo_length(self, middle: ArrayLike) -> float:
        """Return the length of axes from a point, in model units: the same in all pictures of a size."""
        subplot = self._window.subplot
        camera = subplot.vtk_renderer.camera
        back = np.subtract(camera.position, camera.focal_point)
        side = unit_rows(np.cross(camera.up, back)[None])[0].astype(np.float64)
        ends = pixels_of(subplot, [middle, middle + side])
        height: int = self._window.plotter.window_size[1]
        return GIZMO_SIZE * height / float(np.linalg.norm(ends[1] - ends[0]))

    def drag_handle(self, name: str, phase: str, x: float, y: float, *, snap: bool) -> None:
        """Drag a handle of the selected node or the slice, with the pointer in parts of the view's size.

        Parameters
        ----------
        name
            Name of the handle; see `decals.editing.gizmo.Handle` and `SlicePlane.handles`.
        phase
            "begin", "move" or "end".
        x, y
            Place of the pointer, from the left and from the top.
        snap
            Move, turn and scale in round steps.
        """
        one_of("phase", phase, PHASES, InvalidEdit)
        trees, (width, height) = self._window.actions.trees, self._window.plotter.window_size
        right, down = (min(max(any_number("place", part, InvalidEdit), 0.0), 1.0) for part in (x, y))
        at = right * width - 0.5, (1.0 - down) * height - 0.5
        ray = ray_through(self._window.subplot, *at)
        assert ray is not None  # the place lies in the view
        if str(name) in self.points:  # the page may send anything
            self.points[name][1](ray)
            return
        plane = self.options.slice
        if phase == "begin":
            self._slice_drag = None
            if plane is not None and name in (MOVE, TILT):
                self._slice_drag = SliceDrag(name, plane, ray, self._gizmo_length(plane.point))
                return
            middle = trees.handles(1.0)
            length = self._gizmo_length(middle[0].position) if middle else 1.0
            self._window.tools.press_handle(name, *at, length)
            return
        if self._slice_drag is not None:
            if plane is not None:
                plane = self._slice_drag.dragged(ray, self._box(), snap=snap)
                self.options = replace(self.options, slice=plane)
            if phase == "end":
                self._slice_drag = None
            return
        self._window.tools.drag_handle(*at, snap=snap, last=phase == "end")

    def add_bookmark(self) -> None:
        """Keep the present camera."""
        if len(self.bookmarks) == MAX_BOOKMARKS:
            raise InvalidEdit(f"expected at most {MAX_BOOKMARKS} bookmarks; a new scene begins without")
        self.bookmarks.append((f"view {len(self.bookmarks) + 1}", self.kept_camera()))

    def go_to_bookmark(self, number: int) -> None:
        """Look from a kept camera."""
        number = whole_number("bookmark", number, 0, len(self.bookmarks) - 1, InvalidEdit)
        self.restore_camera(self.bookmarks[number][1])

    def kept_camera(self) -> tuple[Any, ...]:
        """Return the present camera, as `restore_camera` takes it."""
        view = self._window.subplot.vtk_renderer.camera
        return tuple(getattr(view, name) for name in CAMERA_VALUES)

    def restore_camera(self, kept: tuple[Any, ...]) -> None:
        """Look from a camera again."""
        for name, value in zip(CAMERA_VALUES, kept, strict=True):
            setattr(self._window.subplot.vtk_renderer.camera, name, value)
        self._window.subplot.vtk_renderer.reset_camera_clipping_range()


def _known_mesh(item: SceneObject, meshes: Sequence[tuple[SceneObject, pv.PolyData]]) -> pv.PolyData | None:
    """Return the mesh of another object with this shape and colour; None without such an object."""
    for other, mesh in meshes:
        drawn = getattr(item, "color", None) is getattr(other, "color", None)
        drawn &= getattr(item, "crease_angle", 0.0) == getattr(other, "crease_angle", 0.0)
        if drawn and item.hidden == other.hidden and same_shape(item, other):
            return mesh
    return None
