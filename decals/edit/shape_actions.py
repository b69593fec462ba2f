"""Actions on objects and on the primitives of trees: taking hold, moving, more of them and fewer."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from blobtree import BlobTreeError, Node, Point, Segment
from blobtree.formulas.kernels import RIM
from decals.checks import instance
from decals.edit.background import Background, Step
from decals.edit.change import Change
from decals.edit.objects import AddObject, RemoveObject
from decals.edit.pick import Pick
from decals.edit.primitives import MovePrimitive, PaintPrimitive, ResizePrimitive
from decals.edit.session import Command, EditSession
from decals.edit.shapes import (
    AddPrimitive,
    DuplicatePrimitive,
    Join,
    JoinPrimitive,
    RemovePrimitive,
    Reshaping,
    in_world,
    join_of,
    primitive_shown,
    same_structure,
)
from decals.edit.trees import Path, alone, primitive_at
from decals.errors import DecalsError, InvalidEdit
from decals.scenes.scene import TreeObject, bounds_of
from decals.surfaces.surface import Floats, unit_rows

THICKER = 1.05
"""What one press of a key makes of a primitive's radius."""

TINTS = ((1.0, 1.0, 1.0), (0.95, 0.45, 0.35), (0.95, 0.8, 0.35), (0.5, 0.85, 0.5), (0.4, 0.6, 0.95))
"""sRGB tints to go through."""

BALL, LIMB, LONG = 0.5, 0.4, 1.6
"""Radii of a new ball and of a new limb, and the limb's length, in radii of what they grow out of."""

CARRIED = 5_000
"""Decals among which a primitive is dragged while the window waits."""

OBJECT, FIRST = 0.08, 0.2
"""Radius of a new object in diagonals of the scene; of the first one, in distances from the eye."""

Cursor = Callable[[], Pick | None]
"""Says what is under the cursor, when somebody asks."""


class ShapeActions(ABC):
    """One method for each action of the table on shapes, and the primitive that is held.

    Attributes
    ----------
    selection
        Numbers of the selected decals, in the order in which they were selected.
    message
        What happened last, in plain words.
    grip
        Object and path of the primitive that is held, if any.
    view
        Gives the eye, and the point that it looks at; at first the document's camera's.
    background
        What takes long.
    """

    background: Background

    def __init__(self, session: EditSession) -> None:
        self.session = instance("session", session, EditSession, InvalidEdit, "EditSession(scene) makes one")
        self.selection: tuple[int, ...] = ()
        self.message = ""
        self.grip: tuple[int, Path] | None = None
        self.view: Callable[[], tuple[ArrayLike, ArrayLike]] = self._document_view
        self._grip_offset: Floats = np.zeros(3, np.float32)
        self._colors = 0

    @abstractmethod
    def begin(self, label: str) -> None:
        """End what goes on; all that follows is one entry until `settle`."""

    @abstractmethod
    def settle(self) -> None:
        """End what goes on: the next action is an entry of its own."""

    @abstractmethod
    def _do(self, command: Command, done: Callable[[], None] | None = None) -> None:
        """Do a command, then what goes with it."""

    def _follow(self, label: str, step: Step, *, long: bool) -> None:
        """Do what hands ask for again and again; what cannot be done is said in `message`."""
        try:
            if long:
                self.background.follow(label, step)
            else:
                self.message = step(self.session)
        except (DecalsError, BlobTreeError) as error:
            self.message = str(error)

    # -- holding a primitive ----------------------------------------------------------------------------

    def _grip(self, cursor: Cursor) -> None:
        if self.grip:
            self.grip, self.message = None, "let go"
            return
        self._take_hold(cursor)
        self.message = "drag the blue ball to move the primitive, m to let go"

    def _take_hold(self, cursor: Cursor) -> tuple[int, Path]:
        """Hold the primitive under the cursor, unless another one is held; say which."""
        if self.grip is None:
            found = under(cursor)
            number, path = self._primitive(lambda: found)
            self._hold(number, path, found.position - self._middle(number, path))
        assert self.grip is not None
        return self.grip

    def _hold(self, number: int, path: Path, offset: Floats | None) -> None:
        """Hold a primitive at an offset from its middle, or at the last one; decals are selected no more."""
        self.grip, self.selection = (number, path), ()
        if offset is not None:
            self._grip_offset = offset

    def _loosen(self, change: Change) -> None:
        """Let go where a change, or taking it back, makes another primitive of what is held."""
        before, after = change.parts_before.objects, change.parts_after.objects
        if self.grip is not None and before is not None:
            number = self.grip[0]
            both = number < min(len(before), len(after))
            if not both or not same_structure(before[number], after[number]):
                self.grip = None

    def _primitive(self, cursor: Cursor) -> tuple[int, Path]:
        """The held primitive, or the one under the cursor."""
        if self.grip is not None:
            return self.grip
        found = under(cursor)
        return found.object, primitive_shown(self._tree(found.object), found.position)

    def _tree(self, number: int) -> Node:
        item = self.session.document.objects[number]
        if not isinstance(item, TreeObject):
            raise InvalidEdit(f"{item.name!r} is a mesh and has no primitives; point at a BlobTree")
        return item.tree

    @property
    def grip_center(self) -> Floats:
        """Where the primitive is held, ``float32[3]``: on the surface, where the cursor was at first."""
        assert self.grip is not None
        surface = self.session.document.objects[self.grip[0]].surface
        position: Floats = surface.project((self._middle(*self.grip) + self._grip_offset)[None])[0][0]
        return position

    def _middle(self, number: int, path: Path) -> Floats:
        """Middle of the box of a primitive: it goes where the primitive goes."""
        low, high = alone(self._tree(number), path).bounds
        return np.asarray((low + high) / 2)

    def begin_grip(self) -> None:
        """Begin to move the held primitive."""
        self.begin(MovePrimitive.label)

    def move_grip(self, offset: ArrayLike) -> None:
        """Move the held primitive by an offset from where it was at first."""
        if self.grip is None:
            return
        command = MovePrimitive(*self.grip, offset, quick=True)

        def step(session: EditSession) -> str:
            session.take_back()
            session.do(command)
            return command.label

        self._follow(command.label, step, long=len(self.session.document.decals) > CARRIED)

    def end_grip(self) -> None:
        """Let go of the held primitive; where nothing is left to lay decals on, it goes back."""
        if self.grip is not None:
            step = _checked(self.grip[0])
            self.background.afterwards(
                lambda: self._follow(MovePrimitive.label, step, long=not self.background.busy_editing)
            )
        self.settle()

    # -- primitives -------------------------------------------------------------------------------------

    def _thicker(self, cursor: Cursor, factor: float = THICKER) -> None:
        self._do(ResizePrimitive(*self._primitive(cursor), factor))

    def _thinner(self, cursor: Cursor) -> None:
        self._thicker(cursor, 1.0 / THICKER)

    def _next_color(self, cursor: Cursor) -> None:
        number, path = self._primitive(cursor)
        self._colors += 1
        self._do(PaintPrimitive(number, path, TINTS[self._colors % len(TINTS)]))

    def _new_ball(self, cursor: Cursor) -> None:
        found = under(cursor)
        path, thick = self._ground(found)
        color = primitive_at(self._tree(found.object), path).color
        ball = Point(_numbers(found.position), radius=BALL * thick, color=color)
        self._grow(found, path, ball, BALL * thick)

    def _new_limb(self, cursor: Cursor) -> None:
        found = under(cursor)
        path, thick = self._ground(found)
        color = primitive_at(self._tree(found.object), path).color
        tip = found.position + LONG * thick * found.normal
        limb = Segment(_numbers(found.position), _numbers(tip), radius=LIMB * thick, color=color)
        self._grow(found, path, limb, (LONG / 2 + LIMB) * thick)

    def _ground(self, found: Pick) -> tuple[Path, float]:
        """Path of the primitive at a place, and about how thick it is, as a radius."""
        tree = self._tree(found.object)
        path = primitive_shown(tree, found.position)
        return path, _thickness(alone(tree, path))

    def _grow(self, found: Pick, path: Path, node: Node, reach: float) -> None:
        tree = self._tree(found.object)
        command = AddPrimitive(found.object, in_world(tree, path), node)
        self._reshape(command, offset=reach * found.normal)

    def _reshape(self, *commands: Reshaping, offset: Floats | None = None) -> None:
        """Do the first of some commands that leaves something to see, and hold what it is about.

        That makes another surface, which takes long: it goes on in the background.
        """
        done: list[tuple[int, Path]] = []

        def step(session: EditSession) -> str:
            failed: Exception | None = None
            for command in commands:
                try:
                    _, path = command.made(command.tree(session.document))
                    session.do(command)
                except (DecalsError, BlobTreeError) as error:
                    failed = failed or error
                    continue
                done[:] = [] if path is None else [(command.object, path)]
                return command.text
            assert failed is not None
            raise failed

        def hold() -> None:
            for number, path in done:
                self._hold(number, path, offset)

        self.background.edit(commands[0].label, step, hold)

    def _duplicate_held(self) -> None:
        assert self.grip is not None
        eye, target = (np.asarray(point, np.float64) for point in self.view())
        toward = eye - target
        aside = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
        step = _thickness(alone(self._tree(self.grip[0]), self.grip[1]))
        self._reshape(DuplicatePrimitive(*self.grip, step * unit_rows(aside[None])[0]))

    def _delete_held(self) -> None:
        assert self.grip is not None
        self._reshape(RemovePrimitive(*self.grip))

    def _next_join(self, cursor: Cursor) -> None:
        """The first of the other ways to join, from the present one on, that leaves something to see."""
        number, path = self._take_hold(cursor)
        now, ways = join_of(self._tree(number), path), list(Join)
        first = 0 if now is None else ways.index(now) + 1
        self._reshape(*(JoinPrimitive(number, path, join) for join in ways[first:] + ways[:first]))

    # -- objects ----------------------------------------------------------------------------------------

    def _new_object(self, cursor: Cursor) -> None:
        objects, found = self.session.document.objects, cursor()
        eye, target = (np.asarray(point, np.float64) for point in self.view())
        if objects:
            low, high = bounds_of(objects)
            radius = OBJECT * float(np.linalg.norm(high - low))
        else:
            radius = FIRST * float(np.linalg.norm(eye - target))
        up = unit_rows((eye - target)[None])[0] if found is None else found.normal
        center = target if found is None else found.position + radius * up
        names = {item.name for item in objects}
        name = next(name for n in range(1, len(names) + 2) if (name := f"ball {n}") not in names)
        ball = TreeObject(name, Point(_numbers(center), radius=radius))
        self._do(AddObject(ball), lambda: self._hold(len(self.session.document.objects) - 1, (), radius * up))

    def _remove_object(self, cursor: Cursor) -> None:
        self._do(RemoveObject(under(cursor).object))

    def _document_view(self) -> tuple[ArrayLike, ArrayLike]:
        camera = self.session.document.camera
        return camera.position, camera.target


def _checked(number: int) -> Step:
    """The step that takes a stroke back where it left nothing of an object to lay decals on."""

    def step(session: EditSession) -> str:
        try:
            session.document.objects[number].surface  # noqa: B018  (asking may fail)
        except (DecalsError, BlobTreeError) as error:
            session.cancel()
            return str(error)
        session.document.make_surfaces()
        return ""

    return step


def under(cursor: Cursor) -> Pick:
    """What is under the cursor, or `InvalidEdit`."""
    found = cursor()
    if found is None:
        raise InvalidEdit("point at a surface")
    return found


def _thickness(node: Node) -> float:
    """About the radius that a primitive shows: its box has that of its influence around its skeleton."""
    low, high = node.bounds
    return RIM * float((high - low).min()) / 2


def _numbers(point: ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(point, np.float64).tolist()
    return x, y, z
