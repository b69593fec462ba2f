"""Actions on objects and on the primitives of BlobTrees: select, move, add, resize, join and remove."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node, Point, Segment
from blobtree._typing import Float32Array, Float64Array
from blobtree.formulas.falloff import RIM
from blobtree.nodes.paths import Path, node_at, primitive_at, world_box
from blobtree.nodes.places import Place
from blobtree.nodes.surgery import Join, dominant_primitive, join_of, path_of, paths_after, world_space_path
from blobtree.validation import describe
from decals.editing.action_state import Cursor, WindowActions, joined, require_pick
from decals.editing.decal_actions import TINTS
from decals.editing.document import Document
from decals.editing.gizmo import Handle, HandleDrag, Ray, handles_of, moved_point, snap_distance
from decals.editing.inputs import usual_inputs
from decals.editing.key_bindings import Group
from decals.editing.new_nodes import alternatives, checked_kind, exchanged_node, new_node, node_above
from decals.editing.queries import SurfacePick, first_hit, nearest_points
from decals.editing.scatter_commands import AddObject, RemoveObject
from decals.editing.session import EditSession, Step
from decals.editing.tree_commands import (
    AddPrimitive,
    DragSurface,
    DuplicatePrimitive,
    GroupOperands,
    JoinPrimitive,
    MirrorPrimitive,
    MoveBranch,
    MovePrimitive,
    MoveToObject,
    PaintPrimitive,
    PrimitiveCommand,
    RemovePrimitive,
    ReplaceNode,
    ResizePrimitive,
    SetParameter,
    StructureCommand,
    TransformPrimitive,
)
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.scenes.objects import SceneObject, TreeObject, bounds_of, displaced, unused_name
from decals.surfaces.implicit import project_without_mesh
from decals.surfaces.surface import unit_rows
from decals.validation import one_of

RESIZE_STEP = 1.05
"""Factor of a primitive's radius by one key press."""

BALL_RADIUS, LIMB_RADIUS, LIMB_LENGTH = 0.5, 0.4, 1.6
"""Sizes of a new ball or limb, in radii of the primitive that it grows from."""

OBJECT_RADIUS = 0.08
"""Radius of a new object, in diagonals of the scene."""

FIRST_OBJECT_RADIUS = 0.2
"""Radius of the first object of a scene, in distances between the eye and its target."""

FIRST_LIMB_RADIUS = 0.06
"""Radius of a limb that is the first object, likewise."""

NEW_NODE_EXTENT = 0.1
"""Extent of a new node of a panel, in extents of the model that it joins, or of the scene."""

MAX_DECALS_IN_DRAG = 5_000
"""With more decals than this, dragging a primitive runs in the background."""


TreeCommand = StructureCommand | MoveToObject
"""Commands that name the place of their node after the edit."""


@dataclass(eq=False)
class FollowedNode:
    """A node that is found again after edits of its tree.

    Attributes
    ----------
    place
        Index of its object, and its path in the object's tree; None for no node.
    item
        The object with that tree.
    """

    place: tuple[int, Path] | None
    item: SceneObject | None

    def find(self, document: Document) -> tuple[int, Path, Node]:
        """Return the node's object, path and present state; raise `InvalidEdit` if it is not there."""
        before = self.item
        if self.place is None or not isinstance(before, TreeObject):
            raise InvalidEdit("no node is selected; select one in the outline, or press M on the surface")
        number, path = self.place
        item = document.object(number)
        if isinstance(item, TreeObject) and item.name == before.name:
            for found in paths_after(before.tree, item.tree, [path]):
                self.place, self.item = (number, found), item
                return number, found, node_at(item.tree, found)
        raise InvalidEdit("the node was removed or replaced meanwhile; select another one")


class TreeActions(WindowActions):
    """Actions on the selected primitive, or on the primitive or object under the cursor."""

    _color_index = 0
    _handle_drag: tuple[HandleDrag, tuple[int, Path]] | None = None
    _followed = FollowedNode(None, None)
    _dragged_object: int | None = None

    # -- the selected primitive -------------------------------------------------------------------------

    @Group.SHAPE.action(
        "select_primitive", "m", summary="select the primitive under the cursor, or deselect it"
    )
    def toggle_primitive(self, cursor: Cursor) -> None:
        """Select the primitive under the cursor; deselect a selected one, or all where no primitive is."""
        selected, pick = self._state.primitive, cursor()
        if selected is not None and (pick is None or self._selectable(pick) in (None, selected)):
            self._state.primitive, self._state.message = None, "primitive deselected"
            return
        self._state.primitive = None
        self._select(lambda: pick)
        self._state.message = "drag its handle to move the primitive, press M on it to deselect it"

    def nodes_at(self, pick: SurfacePick) -> list[tuple[int, Path]]:
        """Return the primitive at a surface point, and the nodes above it up to the root; none on a mesh."""
        leaf = self._selectable(pick)
        return [] if leaf is None else [(leaf[0], leaf[1][:n]) for n in range(len(leaf[1]), -1, -1)]

    def select_picked(self, number: int, path: Path, pick: SurfacePick) -> None:
        """Select a node, with its handle at a surface point."""
        self._state.select_primitive(number, path, pick.position - self._middle(number, path))
        further = "; click again for the node above it" if path else ""
        self._state.message = f"{self._selected_label}{further}"

    def _selectable(self, pick: SurfacePick) -> tuple[int, Path] | None:
        """Return the primitive at a point; None on a mesh."""
        item = self._state.session.document.objects[pick.object]
        return self._primitive_under(pick) if isinstance(item, TreeObject) else None

    def _select(self, cursor: Cursor) -> tuple[int, Path]:
        """Select the primitive under the cursor if none is selected. Return the selected primitive."""
        if self._state.primitive is None:
            pick = require_pick(cursor)
            self.select_picked(*self._primitive_under(pick), pick)
        assert self._state.primitive is not None
        return self._state.primitive

    def _primitive(self, cursor: Cursor) -> tuple[int, Path]:
        """Return the selected primitive, or the one under the cursor."""
        if self._state.primitive is not None:
            return self._state.primitive
        return self._primitive_under(require_pick(cursor))

    def _primitive_under(self, pick: SurfacePick) -> tuple[int, Path]:
        tree, item = self._tree(pick.object), self._state.session.document.objects[pick.object].shown
        if not isinstance(item, TreeObject) or item.tree is tree:
            return pick.object, dominant_primitive(tree, pick.position)
        seen = node_at(item.tree, dominant_primitive(item.tree, pick.position))
        return pick.object, path_of(tree, seen)

    def _tree(self, number: int) -> Node:
        return self._item(number).tree

    def _item(self, number: int) -> TreeObject:
        item = self._state.session.document.object(number)
        if not isinstance(item, TreeObject):
            raise InvalidEdit(f"{item.name!r} is a mesh and has no primitives; point at a BlobTree")
        return item

    def _middle(self, number: int, path: Path) -> Float32Array:
        """Return the middle of a primitive's box, which moves with the primitive."""
        return Place(self._tree(number), path).middle.astype(np.float32)

    @property
    def handle_position(self) -> Float32Array:
        """Point on the surface for the handle of the selected primitive, shape (3,)."""
        assert self._state.primitive is not None
        number, path = self._state.primitive
        target = (self._middle(number, path) + self._state.handle_offset)[None]
        projected = project_without_mesh(self._tree(number), target)
        if projected is None:
            projected = self._state.session.document.objects[number].surface.project(target)
        position: Float32Array = projected[0][0]
        return position

    def begin_drag(self) -> None:
        """Begin to drag the selected primitive."""
        self._state.begin_stroke(MovePrimitive.label)

    def drag(self, offset: ArrayLike) -> None:
        """Move the selected primitive.

        Parameters
        ----------
        offset
            Displacement from the position at the beginning of the drag, shape (3,).
        """
        if self._state.primitive is None:
            return
        snap = self._state.snap
        moved = np.round(np.asarray(offset, np.float64) / snap) * snap if snap else offset
        self._drag_to(MovePrimitive(*self._state.primitive, moved, quick=True))

    def handles(self, length: float) -> list[Handle]:
        """Return the handles of the selected node for a gizmo of a length; none without a node."""
        if self._state.primitive is None or self._state.selection:
            return []
        number, path = self._state.primitive
        return handles_of(self._tree(number), path, length)

    def begin_handle_drag(self, name: str, ray: Ray, length: float) -> None:
        """Begin to drag a handle of the selected node, with the pointer at a ray."""
        handles, selected = self.handles(length), self._state.primitive
        if selected is None or name not in [handle.name for handle in handles]:
            known = ", ".join(handle.name for handle in handles) or "none"
            raise InvalidEdit(f"handle: expected one of the selected node, {known}, got {describe(name)}")
        self._handle_drag = HandleDrag(handles, name, ray, length), selected
        self._state.begin_stroke(name if name.startswith(("move", "turn", "scale")) else f"move {name}")

    def drag_handle(self, ray: Ray, *, snap: bool = False) -> None:
        """Drag the handle to the pointer's ray, while its node is selected and has it.

        Parameters
        ----------
        ray
            Origin and direction, shape (3,) each.
        snap
            If True, moves, turns and scales go in round steps.
        """
        if self._handle_drag is None or not self._state.session.stroke_open:
            return
        drag, selected = self._handle_drag
        names = [handle.name for handle in self.handles(drag.length)]
        if selected != self._state.primitive or drag.name not in names:
            return
        step = (self._state.snap or snap_distance(drag.length)) if snap else self._state.snap
        command: MovePrimitive | TransformPrimitive | SetParameter | None = None
        if drag.name.startswith("move"):
            offset = drag.offset(ray, step)
            command = None if offset is None else MovePrimitive(*selected, offset, quick=True)
        elif drag.name.startswith(("turn ", "scale")):
            matrix = drag.matrix(ray, snap=snap)
            command = None if matrix is None else TransformPrimitive(*selected, matrix, quick=True)
        elif (point := drag.point(ray, step)) is not None:
            path, name, value = moved_point(self._tree(selected[0]), selected[1], drag.name, point)
            command = SetParameter(selected[0], path, name, value, quick=True)
        if command is not None:
            self._drag_to(command)

    def begin_surface_drag(self, start: SurfacePick) -> None:
        """Begin to drag the surface by the selected node, else by the primitive at the point."""
        if self._state.primitive is None or self._state.primitive[0] != start.object:
            self._state.select_primitive(*self._primitive_under(start), np.zeros(3, np.float32))
        self._state.begin_stroke(DragSurface.label)

    def drag_surface(self, start: ArrayLike, end: ArrayLike) -> None:
        """Drag a point of the surface, shape (3,), to another one; see `DragSurface`."""
        if self._state.primitive is not None and self._state.session.stroke_open:
            self._drag_to(DragSurface(*self._state.primitive, start, end, quick=True))

    def _drag_to(self, command: MovePrimitive | TransformPrimitive | SetParameter | DragSurface) -> None:
        """Replace the edit of the open stroke by that of a command."""
        step, long = self._drag_step(command)
        self._state.run_latest_step(command.label, step, long=long)

    def _drag_step(
        self, command: MovePrimitive | TransformPrimitive | SetParameter | DragSurface
    ) -> tuple[Step, bool]:
        """Return the step that replaces the edit of the open stroke, and True if it takes long."""
        self._dragged_object = command.object

        def step(session: EditSession) -> str:
            session.revert_stroke()
            session.do(command)
            return command.label

        many = len(self._state.session.document.decals) > MAX_DECALS_IN_DRAG
        return step, many or isinstance(command, DragSurface)

    def end_drag(self) -> None:
        """End the drag; if the object has no visible surface left, the drag is reverted."""
        state, number = self._state, self._dragged_object
        self._handle_drag = self._dragged_object = None
        if number is not None:
            step = _surface_check(number)
            state.background.when_followed(
                lambda: state.run_latest_step("drag", step, long=not state.background.busy_editing)
            )
        state.end_stroke()

    # -- panels -----------------------------------------------------------------------------------------

    @property
    def selected_node(self) -> Node:
        """The selected node; `InvalidEdit` without a selection."""
        return self._selected()[2]

    def _selected(self) -> tuple[int, Path, Node]:
        """Return object, path and node of the selected node; raise `InvalidEdit` if no node is selected."""
        return self.follow_selected().find(self._state.session.document)

    def follow_selected(self) -> FollowedNode:
        """Return the selected node, if any, to be found after edits that select another one."""
        selected, known = self._state.primitive, self._followed
        item = None if selected is None else self._state.session.document.object(selected[0])
        if known.place != selected or known.item is not item:
            self._followed = FollowedNode(selected, item)
        return self._followed

    def select_node(self, number: int, path: Path) -> None:
        """Select a node of an object's tree, with its handle on the side that the camera sees."""
        low, high = world_box(self._tree(number), path)
        eye, _ = self._state.camera.eye_and_target()
        toward = unit_rows((np.asarray(eye) - (low + high) / 2)[None])[0]
        self._state.select_primitive(number, path, float((high - low).min()) / 2 * toward)

    def select_also(self, number: int, path: Path, *, toggle: bool) -> None:
        """Add a node to the selected ones; with `toggle`, remove a selected one. Decals are deselected."""
        nodes = joined(self._state.nodes, (number, path), toggle=toggle)
        self.select_node(*(nodes or [(number, path)])[-1])
        self._state.nodes = nodes
        self._state.message = f"{len(nodes)} {'node' if len(nodes) == 1 else 'nodes'}"

    def set_parameter(self, node: FollowedNode, name: str, value: Any, *, last: bool = True) -> None:
        """Set a parameter of a node.

        Parameters
        ----------
        node
            The node, which `follow_selected` returned.
        name
            Name of the parameter.
        value
            Its new value.
        last
            If False, more values of the same parameter follow, as from a slider: all are one undo entry.

        Raises
        ------
        Busy
            The last value has to wait for another edit.
        """
        state = self._state
        number, path, _ = node.find(state.session.document)
        command = SetParameter(number, path, name, value, quick=True)
        command.changed_node(state.session.document)  # raises before a stroke begins
        step, long = self._drag_step(command)
        series = "set", (number, path, name)
        state.run_in_series(series, command.label, step, long=long, last=last)
        if last:
            self.end_drag()

    def add_node(self, kind: str, at: ArrayLike | None = None, reach: float | None = None) -> None:
        """Add a primitive to a scene, blended into the selected node, else as an object.

        Parameters
        ----------
        kind
            Name of its class; see `decals.editing.new_nodes.kinds`.
        at
            Its place, shape (3,). Default: the middle of the view.
        reach
            Half of its longest extent. Default: one that suits the model.
        """
        make, middle = self.node_in_view(kind, at, reach), np.zeros(3, np.float32)
        if self._state.primitive is None:
            self._add_tree(kind.lower(), make, middle)
            return
        number, path = self._state.primitive

        def command(tree: Node) -> tuple[StructureCommand, ...]:
            return (AddPrimitive(number, world_space_path(tree, path), make()),)

        self._restructure_later(f"add {kind}", number, command, middle)

    def node_in_view(
        self, kind: str, at: ArrayLike | None = None, reach: float | None = None
    ) -> Callable[[], Node]:
        """Return a function that makes the node that `add_node` adds now."""
        checked_kind(kind)
        objects, view = self._state.session.document.objects, self._state.camera.eye_and_target()
        if self._state.primitive is not None:
            objects = objects[self._state.primitive[0] :][:1]
        return lambda: new_node(kind, (), *_place_in_view(objects, *view, kind, at, reach))

    def wrap_node(self, kind: str) -> None:
        """Put the selected node under a new node of a kind with one operand, such as a warp."""
        checked_kind(kind)
        self._replace_node(lambda node: node_above(kind, node), f"put {self._selected_label} under {kind}")

    def combine_operands(self, kind: str) -> None:
        """Combine the operands of the selected node by a node of another kind."""
        node = self.selected_node
        if len(node.children) < 2:
            raise InvalidEdit(f"select a node with two or more operands; a {type(node).__name__} has fewer")
        self._replace_node(lambda node: new_node(kind, node.children), f"combine with {kind}")

    def exchange_node(self, followed: FollowedNode, kind: str) -> None:
        """Put a node of another kind in the place of a node, with the same operands, and select it."""
        number, path, node = followed.find(self._state.session.document)
        one_of("kind", kind, alternatives(node), InvalidEdit)
        label = f"replace {type(node).__name__} by {kind}"

        def command(tree: Node) -> tuple[StructureCommand, ...]:
            return (ReplaceNode(number, path, exchanged_node(node_at(tree, path), kind), label),)

        self._restructure_later(label, number, command, np.zeros(3, np.float32))

    def unwrap_node(self) -> None:
        """Replace the selected node by its only operand."""
        node = self.selected_node
        if len(node.children) != 1:
            raise InvalidEdit(
                f"select a node with one operand; a {type(node).__name__} has {len(node.children)}"
            )
        self._replace_node(lambda node: node.children[0], f"remove {self._selected_label}")

    @property
    def _selected_label(self) -> str:
        """Name of the selected node, else of its class."""
        number, path, node = self._selected()
        return self._item(number).names.get(path, type(node).__name__)

    def _replace_node(self, make: Callable[[Node], Node], label: str) -> None:
        """Put what a function returns for the selected node in its place, and select it.

        The function runs in the background.
        """
        number, path, _ = self._selected()

        def command(tree: Node) -> tuple[StructureCommand, ...]:
            return (ReplaceNode(number, path, make(node_at(tree, path)), label),)

        self._restructure_later(label, number, command, np.zeros(3, np.float32))

    def move_node(self, number: int, path: Path, into: int, target: Path) -> None:
        """Move a node to another place in its tree, or in that of another object, and select it."""
        if number == into:
            self._restructure(MoveBranch(number, path, target))
            return
        item, node = self._item(number), node_at(self._tree(number), path)
        name = item.names.get(path, type(node).__name__ if path else item.name)
        label = f"move {name} into {self._item(into).name}"
        self._restructure(MoveToObject(number, path, into, target, label))

    def group_nodes(self, places: Sequence[tuple[int, Path]]) -> None:
        """Put operands of one combination of an object under a group, and select it; see `GroupOperands`."""
        parents = {(number, path[:-1]) for number, path in places}
        if len(parents) != 1 or len(places) < 2 or not all(path for _, path in places):
            raise InvalidEdit("select two or more operands of one combination (with Ctrl), then group them")
        self._restructure(GroupOperands(*parents.pop(), tuple(path[-1] for _, path in places)))

    def delete_nodes(self, places: Sequence[tuple[int, Path]]) -> None:
        """Remove branches of objects' trees, as one entry."""
        nodes = [
            (number, node_at(self._tree(number), path))
            for number, path in places
            if not any(number == other and path[: len(top)] == top != path for other, top in places)
        ]

        def step(session: EditSession) -> str:
            with session.stroke(RemovePrimitive.label):
                for number, node in nodes:
                    tree = RemovePrimitive(number, ()).tree(session.document)
                    session.do(RemovePrimitive(number, path_of(tree, node)))
            return RemovePrimitive.label

        self._state.background.edit(RemovePrimitive.label, step)

    def report(self, pick: SurfacePick) -> dict[str, str]:
        """Return what is at a surface point, in plain words."""
        document, position = self._state.session.document, np.asarray(pick.position, np.float32)
        if not 0 <= pick.object < len(document.objects):
            return {}
        item = document.objects[pick.object]
        facts = {"object": item.name}
        if isinstance(item, TreeObject):
            path = dominant_primitive(item.tree, position)
            where = "/".join(map(str, path)) or "root"
            facts["primitive"] = f"{type(primitive_at(item.tree, path)).__name__} ({where})"
            facts["field"] = f"{float(item.tree(position[None])[0]):.4f}"
        if pick.owner >= 0:
            facts["decal"] = str(pick.owner)
        facts["position"] = ", ".join(f"{value:.4g}" for value in position.tolist())
        return facts

    # -- primitives -------------------------------------------------------------------------------------

    @Group.SHAPE.action(
        "thicker",
        "bracketright",
        summary="thicken the selected primitive, else that under the cursor",
        repeats=True,
    )
    def thicker(self, cursor: Cursor) -> None:
        """Enlarge the radius of a primitive."""
        self._state.run(ResizePrimitive(*self._primitive(cursor), RESIZE_STEP))

    @Group.SHAPE.action("thinner", "bracketleft", summary="thin the same primitive", repeats=True)
    def thinner(self, cursor: Cursor) -> None:
        """Reduce the radius of a primitive."""
        self._state.run(ResizePrimitive(*self._primitive(cursor), 1.0 / RESIZE_STEP))

    @Group.SHAPE.action("next_color", "c", summary="next colour for the same primitive")
    def next_color(self, cursor: Cursor) -> None:
        """Give a primitive the next colour."""
        number, path = self._primitive(cursor)
        self._color_index += 1
        self._state.run(PaintPrimitive(number, path, TINTS[self._color_index % len(TINTS)]))

    @Group.SHAPE.action("next_join", "j", summary="next join: blend, soft, union, intersection, difference")
    def next_join(self, cursor: Cursor) -> None:
        """Join a primitive in the next way that leaves a visible surface."""
        number, path = self._select(cursor)
        present, joins = join_of(self._tree(number), path), list(Join)
        first = 0 if present is None else joins.index(present) + 1
        self._restructure(*(JoinPrimitive(number, path, join) for join in joins[first:] + joins[:first]))

    @Group.SHAPE.action("add_ball", "n", summary="blend a ball into the tree under the cursor, selected")
    def add_ball(self, cursor: Cursor) -> None:
        """Blend a ball into the tree under the cursor, and select it; in an empty scene it is an object."""
        if not self._state.session.document.objects:
            self.add_object(cursor)
            return
        pick = require_pick(cursor)
        path, thickness, color = self._base(pick)
        ball = Point(_coordinates(pick.position), radius=BALL_RADIUS * thickness, color=color)
        self._grow(pick, path, ball, BALL_RADIUS * thickness)

    @Group.SHAPE.action("add_limb", "l", summary="blend a limb into it that stands out")
    def add_limb(self, cursor: Cursor) -> None:
        """Blend a segment along the normal into the tree under the cursor, and select it.

        In an empty scene it is an object, across the view.
        """
        if not self._state.session.document.objects:
            self._add_first_limb()
            return
        pick = require_pick(cursor)
        path, thickness, color = self._base(pick)
        start = _coordinates(pick.position)
        end = _coordinates(pick.position + LIMB_LENGTH * thickness * pick.normal)
        limb = Segment(start, end, radius=LIMB_RADIUS * thickness, color=color)
        self._grow(pick, path, limb, (LIMB_LENGTH / 2 + LIMB_RADIUS) * thickness)

    def _base(self, pick: SurfacePick) -> tuple[Path, float, tuple[float, float, float]]:
        """Return path, approximate radius and colour of the primitive that shows at a point."""
        number, path = self._primitive_under(pick)
        tree = self._tree(number)
        return path, _thickness(tree, path), primitive_at(tree, path).color

    def _grow(self, pick: SurfacePick, path: Path, node: Node, height: float) -> None:
        command = AddPrimitive(pick.object, world_space_path(self._tree(pick.object), path), node)
        self._restructure(command, handle_offset=height * pick.normal)

    def duplicate_selected(self) -> None:
        """Add a copy of the selected primitive, to the right of it as seen."""
        number, path, _ = self._selected()
        distance = _thickness(self._tree(number), path)
        self._restructure(DuplicatePrimitive(number, path, distance * self._aside()))

    def _aside(self) -> Float64Array:
        """Return a unit vector, shape (3,), that is parallel to the picture."""
        eye, target = (np.asarray(point, np.float64) for point in self._state.camera.eye_and_target())
        toward = eye - target
        aside = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
        unit: Float64Array = unit_rows(aside[None])[0].astype(np.float64)
        return unit

    @Group.SHAPE.action("mirror", "Shift+d", summary="add the mirror image of the same primitive, across x")
    def mirror(self, cursor: Cursor) -> None:
        """Add the mirror image of the selected node, or the primitive under the cursor, across x = 0."""
        self._restructure(MirrorPrimitive(*self._primitive(cursor)), handle_offset=np.zeros(3, np.float32))

    def delete_selected(self) -> None:
        """Remove the selected primitive."""
        number, path, _ = self._selected()
        self._restructure(RemovePrimitive(number, path))

    def _restructure(self, *commands: TreeCommand, handle_offset: Float32Array | None = None) -> None:
        """Carry out the first command that leaves a visible surface, and select its primitive."""
        self._restructure_later(commands[0].label, commands[0].object, lambda _: commands, handle_offset)

    def _restructure_later(
        self,
        label: str,
        number: int,
        commands: Callable[[Node], tuple[TreeCommand, ...]],
        handle_offset: Float32Array | None,
    ) -> None:
        """Do the same for what a function returns for the tree of an object.

        The function may take long, and the edit builds a new surface, so both run in the background.
        """
        result: list[tuple[int, Path]] = []

        def step(session: EditSession) -> str:
            failure: Exception | None = None
            tree = PrimitiveCommand(number, ()).tree(session.document)
            for command in commands(tree):
                try:
                    place = command.place(session.document)
                    session.do(command)
                except ImplicitDecalsError as error:
                    failure = failure or error
                    continue
                result[:] = [] if place is None else [place]
                return command.label
            assert failure is not None
            raise failure

        def select() -> None:
            for number, path in result:
                self._state.select_primitive(number, path, handle_offset)

        self._state.background.edit(label, step, select, inputs=usual_inputs)

    # -- objects ----------------------------------------------------------------------------------------

    @Group.SHAPE.action("add_object", "Shift+n", summary="add a ball as a new object, under the cursor")
    def add_object(self, cursor: Cursor) -> None:
        """Add a ball as a new object, on the surface under the cursor or at the target of the camera."""
        objects, pick = self._state.session.document.objects, cursor()
        eye, target = (np.asarray(point, np.float64) for point in self._state.camera.eye_and_target())
        if objects:
            low, high = bounds_of(objects)
            radius = OBJECT_RADIUS * float(np.linalg.norm(high - low))
        else:
            radius = FIRST_OBJECT_RADIUS * float(np.linalg.norm(eye - target))
        up = unit_rows((eye - target)[None])[0] if pick is None else pick.normal
        center = target if pick is None else pick.position + radius * up
        ball = Point(_coordinates(center), radius=radius)
        self._add_tree("ball", lambda: ball, radius * up)

    def _add_first_limb(self) -> None:
        """Add a segment as the first object, at the target of the camera."""
        eye, target = (np.asarray(point, np.float64) for point in self._state.camera.eye_and_target())
        radius = FIRST_LIMB_RADIUS * float(np.linalg.norm(eye - target))
        half = 0.5 * LIMB_LENGTH / LIMB_RADIUS * radius * np.eye(3)[np.abs(eye - target).argmin()]
        limb = Segment(_coordinates(target - half), _coordinates(target + half), radius=radius)
        self._add_tree("limb", lambda: limb, radius * unit_rows((eye - target)[None])[0])

    def _add_tree(self, kind: str, make: Callable[[], Node], handle_offset: Float32Array) -> None:
        """Add the tree that a function returns as an object with a new name, and select it."""
        document = self._state.session.document
        names, origin = {item.name for item in document.objects}, document.origin
        name = next(name for n in range(1, len(names) + 2) if (name := f"{kind} {n}") not in names)
        self._add(f"add {name}", lambda: TreeObject(name, make(), origin), handle_offset)

    def duplicate_object(self, number: int) -> None:
        """Add a copy of an object beside it, as seen, and select it."""
        document = self._state.session.document
        item = document.object(number)
        low, high = item.bounds
        aside = self._aside()
        offset = float(np.abs(aside) @ (high - low)) * aside
        name = unused_name(item.name, {other.name for other in document.objects}, " ")
        self._add(f"duplicate {item.name}", lambda: displaced(item, offset, name), np.zeros(3, np.float32))

    def _add(self, label: str, make: Callable[[], SceneObject], handle_offset: Float32Array) -> None:
        """Add what a function returns in the background, and select its tree."""

        def select() -> None:
            objects = self._state.session.document.objects
            if isinstance(objects[-1], TreeObject):
                self._state.select_primitive(len(objects) - 1, (), handle_offset)

        self._state.background.compute(label, lambda *_: AddObject(make(), label), select)

    @Group.SHAPE.action(
        "remove_object", "Shift+Delete", summary="remove the object under the cursor, with its decals"
    )
    def remove_object(self, cursor: Cursor) -> None:
        """Remove the object under the cursor, with its decals."""
        self._state.run(RemoveObject(require_pick(cursor).object))


def _surface_check(number: int) -> Step:
    """Return the step that reverts the stroke if an object has no visible surface."""

    def step(session: EditSession) -> str:
        try:
            session.document.object(number).surface  # noqa: B018  (the access may raise)
        except ImplicitDecalsError as error:
            session.cancel_stroke()
            return str(error)
        session.document.prepare_surfaces()
        return ""

    return step


def _place_in_view(
    objects: Sequence[SceneObject],
    eye: ArrayLike,
    target: ArrayLike,
    kind: str,
    at: ArrayLike | None,
    reach: float | None,
) -> tuple[Float64Array, float]:
    """Return centre (3,) and size for a new node of a kind.

    Without a place, it is centred at the point of the surfaces in the middle of the view, else the one
    closest to the target; without objects, at the target.
    """
    position, middle = np.asarray(eye, np.float64), np.asarray(target if at is None else at, np.float64)
    if reach is not None:
        kind_low, kind_high = new_node(kind).bounds
        return _rounded(middle, 2.0 * reach / float((kind_high - kind_low).max()))
    if not objects:
        return _rounded(middle, FIRST_OBJECT_RADIUS * float(np.linalg.norm(position - middle)))
    if at is None:
        hit = first_hit(objects, position, middle - position)
        points = hit if len(hit.objects) else nearest_points(objects, middle[None])
        middle = points.positions[0].astype(np.float64)
    (low, high), (kind_low, kind_high) = bounds_of(objects), new_node(kind).bounds
    size = NEW_NODE_EXTENT * float((high - low).max() / (kind_high - kind_low).max())
    return _rounded(middle, size)


def _rounded(center: Float64Array, size: float) -> tuple[Float64Array, float]:
    """Return a place and a size with few digits, as people would write them."""
    digits = 2 - math.floor(math.log10(max(size, 1e-30)))
    return np.round(center, digits), round(size, digits)


def _thickness(tree: Node, path: Path) -> float:
    """Return the approximate visible radius of a primitive; its box has its influence radius."""
    low, high = world_box(tree, path)
    return RIM * float((high - low).min()) / 2


def _coordinates(point: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(point, np.float64).tolist()
    return x, y, z
