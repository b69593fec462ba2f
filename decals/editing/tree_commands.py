"""Commands for primitives of BlobTrees: move, resize, paint, add, remove, duplicate and join."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from blobtree import ISO, Node
from blobtree._typing import Float64Array
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.nodes import surgery
from blobtree.nodes.numeric_parameters import (
    NumericParameter,
    numeric_parameters,
    numeric_values,
    with_numeric_values,
)
from blobtree.nodes.paths import (
    Path,
    mapped,
    moved,
    node_at,
    primitive_at,
    primitive_path,
    resized,
    square_matrix,
    with_node,
)
from blobtree.nodes.places import Place
from blobtree.nodes.surgery import Join
from blobtree.validation import affine_matrix, describe, finite_number, finite_vector, truth
from decals.editing.document import Document, Edit, EditCommand
from decals.editing.followers import FIELD_TOLERANCE, followers
from decals.editing.queries import move_decals, nearest_points
from decals.errors import InvalidEdit
from decals.options import inherit_descriptions
from decals.scenes.objects import SceneObject, TreeObject, flagged, with_tree
from decals.validation import instance, member, whole_number

DRAGGED = (
    Quantity.POINT,
    Quantity.POINTS,
    Quantity.RADIUS,
    Quantity.RADII,
    Quantity.LENGTH,
    Quantity.EXTENTS,
    Quantity.SEMI_AXES,
)
"""Parameters that `DragSurface` changes."""

DRAG_STEP, DRAG_STEPS = 0.01, 40
"""Steps of `DragSurface`: their length in sizes of the node's box, and how many there are at most."""

NEWTON_STEPS, DRAG_TOLERANCE = 6, 1e-5
"""Newton steps at each of its points, and the error of the field there that is left."""


class PrimitiveCommand(EditCommand):
    """Base of commands for a primitive of a BlobTree, or a branch.

    Parameters
    ----------
    object
        Index of the object.
    path
        Path of the node in the object's tree.
    """

    long: ClassVar[bool] = True
    object: int
    path: Path

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        inherit_descriptions(cls)

    def tree(self, document: Document) -> Node:
        """Return the object's tree, or raise `InvalidEdit`."""
        return self._item(document).tree

    def _item(self, document: Document) -> TreeObject:
        item = document.object(self.object)
        if not isinstance(item, TreeObject):
            raise InvalidEdit(f"expected a BlobTree, object {item.name!r} is a mesh")
        return item

    def compute_exchange(
        self, document: Document, node: Node, offset: ArrayLike = (0.0, 0.0, 0.0), *, quick: bool = False
    ) -> Edit:
        """Return the edit that puts another node at the path, and moves the decals that follow it.

        Parameters
        ----------
        document
            The document.
        node
            The new node.
        offset
            Displacement of the node in the world, shape (3,), or the affine map of its points, shape (4, 4).
        quick
            If True, the tree is not checked for a visible surface.
        """
        item = self._exchanged(document, node)
        if not truth("quick", quick, InvalidEdit):
            item.surface  # noqa: B018  # raises for a tree without a visible surface
        objects = document.objects_with(self.object, item)
        numbers, points = followers(
            document, self.object, tuple(self.path), item, np.asarray(offset, np.float64)
        )
        moved_along = move_decals(document.decals.take(numbers), points)
        return document.compute_replacement(numbers, moved_along, objects=objects)

    def compute_repainting(self, document: Document, node: Node) -> Edit:
        """Return the edit that puts a node of the same shape at the path."""
        item = self._exchanged(document, node)
        return document.compute_parts(objects=document.objects_with(self.object, item))

    def _exchanged(self, document: Document, node: Node) -> TreeObject:
        """Return the command's object with another node at the path."""
        item = self._item(document)
        return with_tree(item, with_node(item.tree, self.path, node))


class MovePrimitive(PrimitiveCommand):
    """Move a primitive, or a branch; decals follow the surface.

    Parameters
    ----------
    offset
        Displacement in the world, shape (3,).
    quick
        If True, the tree is not checked for a visible surface: for the steps of a drag. Check it at the end.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import MovePrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = decals.editing.EditSession(decals.cover(tree, count=20, images=["eye"]))
    >>> edit = session.do(MovePrimitive(0, (1,), (0.1, 0, 0)))
    >>> session.document.objects[0].tree.children[1].center
    (1.3, 0.0, 0.0)
    """

    offset: ArrayLike
    quick: bool = False
    label: ClassVar[str] = "move a primitive"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        tree = self.tree(document)
        offset = finite_vector("offset", self.offset, InvalidEdit)
        node = moved(node_at(tree, self.path), Place(tree, self.path).moved(offset))
        return self.compute_exchange(document, node, offset, quick=self.quick)


class TransformPrimitive(PrimitiveCommand):
    """Map a primitive, or a branch, by an affine map of the world; decals follow the surface.

    Parameters
    ----------
    matrix
        The map, shape (3, 4) or (4, 4); it multiplies points as columns.
    quick
        If True, the tree is not checked for a visible surface: for the steps of a drag. Check it at the end.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, TransformPrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> turn = [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]]
    >>> edit = session.do(TransformPrimitive(0, (1,), turn))
    >>> session.document.objects[0].tree.children[1].center
    (0.0, 1.2, 0.0)
    """

    matrix: ArrayLike
    quick: bool = False
    label: ClassVar[str] = "transform a primitive"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        tree = self.tree(document)
        matrix = square_matrix(affine_matrix(self.matrix))
        node = mapped(node_at(tree, self.path), Place(tree, self.path).mapped(matrix))
        return self.compute_exchange(document, node, matrix, quick=self.quick)


class DragSurface(PrimitiveCommand):
    """Drag a point of the surface: lengths of a primitive, or a branch, follow; decals stay on the surface.

    The point goes to its end in short steps. In each of them, the least change of points, radii and lengths,
    as a sum of squares, puts the surface there: a step of least squares on the gradient of the field by these
    parameters.

    Parameters
    ----------
    start, end
        A point of the surface, and where it is dragged, shape (3,) each.
    quick
        If True, the tree is not checked for a visible surface: for the steps of a drag. Check it at the end.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import DragSurface, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(DragSurface(0, (), (1, 0, 0), (1.5, 0, 0)))
    >>> ball = session.document.objects[0].tree
    >>> [round(value, 1) for value in (*ball.center, ball.radius)]
    [0.2, 0.0, 0.0, 1.3]
    """

    start: ArrayLike
    end: ArrayLike
    quick: bool = False
    label: ClassVar[str] = "drag the surface"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        tree = self.tree(document)
        low, high = node_at(tree, self.path).support
        path = tuple(self.path)
        start, end = (finite_vector(name, getattr(self, name), InvalidEdit) for name in ("start", "end"))
        parameters = [
            parameter
            for parameter in numeric_parameters(tree)
            if parameter.path[: len(path)] == path and parameter.declaration.quantity in DRAGGED
        ]
        if not parameters:
            raise InvalidEdit(
                f"a {type(node_at(tree, path)).__name__} has no point, radius or length to drag"
            )
        way = math.dist(start, end)
        longest = max(DRAG_STEP * float((high - low).max()), way / DRAG_STEPS)
        count = max(1, math.ceil(way / longest))
        for target in np.linspace(start, end, count + 1)[1:]:
            tree = _through(tree, parameters, target, longest)
        return self.compute_exchange(document, node_at(tree, path), quick=self.quick)


def _through(tree: Node, parameters: Sequence[NumericParameter], point: Float64Array, longest: float) -> Node:
    """Return a tree whose surface passes through a point near it, by the least change of parameters."""
    for _ in range(NEWTON_STEPS):
        miss = ISO - float(tree(point[None])[0])
        slopes = tree.parameter_gradient(point[None], parameters).values[0].astype(np.float64)
        squared = float(slopes @ slopes)
        if abs(miss) <= DRAG_TOLERANCE or squared == 0.0:
            break
        change = miss * slopes / squared
        change *= min(1.0, 2.0 * longest / float(np.linalg.norm(change)))
        tree = with_numeric_values(tree, parameters, np.asarray(numeric_values(tree, parameters)) + change)
    return tree


class ResizePrimitive(PrimitiveCommand):
    """Multiply the radii of a primitive; decals stay on the surface.

    Parameters
    ----------
    factor
        Above 1 for a thicker primitive, below 1 for a thinner one.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ResizePrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(ResizePrimitive(0, (1,), 1.5))
    >>> round(session.document.objects[0].tree.children[1].radius, 3)
    0.9
    """

    factor: float
    label: ClassVar[str] = "resize a primitive"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        factor = finite_number("factor", self.factor, InvalidEdit)
        if factor <= 0:
            raise InvalidEdit(f"factor: expected a number above 0, got {factor}")
        tree = self.tree(document)
        command = replace(self, path=primitive_path(tree, self.path))
        return command.compute_exchange(document, resized(primitive_at(tree, self.path), factor))


class SetParameter(PrimitiveCommand):
    """Set one parameter of a node; decals stay on the surface.

    Parameters
    ----------
    name
        Name of the parameter, such as "radius".
    value
        Its new value.
    quick
        If True, the tree is not checked for a visible surface: for the steps of a drag. Check it at the end.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, SetParameter
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(SetParameter(0, (1,), "radius", 0.8))
    >>> session.document.objects[0].tree.children[1].radius
    0.8
    """

    name: str
    value: Any
    quick: bool = False

    @property
    def label(self) -> str:
        """What the command does."""
        return f"set {self.name}"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        node = self.changed_node(document)
        if parameters_of(type(node))[self.name].quantity in (Quantity.COLOR, Quantity.ATTRIBUTES):
            return self.compute_repainting(document, node)
        return self.compute_exchange(document, node, quick=self.quick)

    def changed_node(self, document: Document) -> Node:
        """Return the node with the new value; raise `InvalidEdit` or `InvalidNode` if it cannot take it."""
        node: Any = node_at(self.tree(document), self.path)
        declared = parameters_of(type(node))
        if not isinstance(self.name, str) or self.name not in declared:
            raise InvalidEdit(
                f"parameter: expected one of {', '.join(declared)} for a {type(node).__name__}, "
                f"got {describe(self.name)}"
            )
        changed: Node = replace(node, **{self.name: self.value})
        return changed


class PaintPrimitive(PrimitiveCommand):
    """Set the colour of a primitive.

    Parameters
    ----------
    color
        sRGB, each channel in [0, 1], shape (3,).

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, PaintPrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(PaintPrimitive(0, (1,), (1, 0, 0)))
    >>> session.document.objects[0].tree.children[1].color
    (1.0, 0.0, 0.0)
    """

    color: Any
    label: ClassVar[str] = "paint a primitive"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        tree = self.tree(document)
        command = replace(self, path=primitive_path(tree, self.path))
        leaf: Any = primitive_at(tree, self.path)
        return command.compute_repainting(document, replace(leaf, color=self.color))


def same_structure(before: SceneObject, after: SceneObject) -> bool:
    """Return True if paths lead to the same nodes of two objects; affine maps around nodes do not count."""
    return before is after or (
        isinstance(before, TreeObject)
        and isinstance(after, TreeObject)
        and before.name == after.name
        and surgery.same_structure(before.tree, after.tree)
    )


def compute_restructured(document: Document, number: int, tree: Node) -> Edit:
    """Return the edit that replaces the tree of an object by one of another structure.

    Decals inside the new surface move up to it. Decals outside move down to it if that is not farther than
    their radius; otherwise they are deleted.
    """
    edit = PrimitiveCommand(number, ()).compute_exchange(document, tree)
    after = edit.after
    before = document.decals.take(after.numbers)
    distances = np.linalg.norm(after.decals.positions.astype(np.float64) - before.positions, axis=1)
    removed = (distances > before.radii) & (tree(before.positions) < ISO)
    return edit.then(document.compute_deletion(after.numbers[removed])) if removed.any() else edit


class StructureCommand(PrimitiveCommand):
    """Base of commands that change the structure of a tree."""

    @property
    def label(self) -> str:
        """What the command does."""
        raise NotImplementedError  # every subclass has its own

    def restructure(self, tree: Node) -> tuple[Node, Path | None]:
        """Return the new tree, and the path of the command's node in it, if it still exists."""
        raise NotImplementedError  # every subclass has its own

    def compute(self, document: Document) -> Edit:
        """Return the edit; see `compute_restructured` for the decals."""
        return compute_restructured(document, self.object, self.restructure(self.tree(document))[0])

    def place(self, document: Document) -> tuple[int, Path] | None:
        """Return object and path of the command's node after the edit, if it still exists."""
        path = self.restructure(self.tree(document))[1]
        return None if path is None else (self.object, path)


class AddPrimitive(StructureCommand):
    """Join a new primitive, or branch, to a node of a tree.

    Parameters
    ----------
    node
        The new node, in the space of the node at the path.
    join
        How to join them: "blend", "soft union", "union", "intersection" or "difference", or a `Join`.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import AddPrimitive, EditSession
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(AddPrimitive(0, (), Point((-1.2, 0, 0), radius=0.6)))
    >>> len(session.document.objects[0].tree.children)
    3
    """

    node: Node
    join: Join | str = Join.BLEND

    @property
    def label(self) -> str:
        """The class of the new node."""
        return f"add {type(self.node).__name__}"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the new node."""
        instance("node", self.node, Node, InvalidEdit, "such as Point(...)")
        join = member("join", self.join, Join, InvalidEdit)
        return surgery.add_node(tree, self.path, self.node, join)


class ReplaceNode(StructureCommand):
    """Put another node at a path, such as the same operands under another operator, or a warp of the node.

    Parameters
    ----------
    node
        The new node, in the space of the old one.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ReplaceNode
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(ReplaceNode(0, (), tree.twist(20)))
    >>> session.document.objects[0].tree.degrees
    20.0
    """

    node: Node
    label: str = "replace a node"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the new node."""
        instance("node", self.node, Node, InvalidEdit, "such as Point(...)")
        return with_node(tree, self.path, self.node), tuple(self.path)


class RemovePrimitive(StructureCommand):
    """Remove a primitive, or branch, but not the last one; decals without a surface below them go too.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RemovePrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(RemovePrimitive(0, (1,)))
    >>> session.document.objects[0].tree.radius
    1.0
    """

    label: ClassVar[str] = "remove a primitive"

    def restructure(self, tree: Node) -> tuple[Node, None]:
        """Return the tree without the node."""
        return surgery.remove_branch(tree, self.path), None


class DuplicatePrimitive(StructureCommand):
    """Add a displaced copy of a primitive, or branch, joined in the same way.

    The operands of a difference or intersection are blended with their copies, so the copies cut, or are
    cut, too.

    Parameters
    ----------
    offset
        Displacement of the copy in the world, shape (3,).

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import DuplicatePrimitive, EditSession
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(DuplicatePrimitive(0, (1,), (0, 0.8, 0)))
    >>> session.document.objects[0].tree.children[2].center
    (1.2, 0.8, 0.0)
    """

    offset: ArrayLike
    label: ClassVar[str] = "duplicate a primitive"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the copy."""
        offset = finite_vector("offset", self.offset, InvalidEdit)
        return surgery.duplicate_branch(tree, self.path, offset)


class MirrorPrimitive(StructureCommand):
    """Add the mirror image of a primitive, or branch, beyond a plane of the world, joined in the same way.

    Parameters
    ----------
    axis
        The plane lies across this axis, through 0: 0, 1 or 2 for x, y or z.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, MirrorPrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(MirrorPrimitive(0, (1,)))
    >>> session.document.objects[0].tree.children[2].center
    (-1.2, 0.0, 0.0)
    """

    axis: int = 0
    label: ClassVar[str] = "mirror a primitive"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the image."""
        return surgery.mirror_branch(tree, self.path, whole_number("axis", self.axis, 0, 2, InvalidEdit))


class MoveBranch(StructureCommand):
    """Move a primitive, or branch, to another place in its tree; it stays where it is in the world.

    Parameters
    ----------
    target
        Path of a combination, which takes the node as its last operand; or of another node, behind which the
        node comes to stand.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, MoveBranch
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(MoveBranch(0, (0,), (1,)))
    >>> session.document.objects[0].tree.children[1].radius
    1.0
    """

    target: Path
    label: ClassVar[str] = "move in the tree"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the node in it."""
        return surgery.move_branch(tree, self.path, self.target)


class MoveToObject(PrimitiveCommand):
    """Move a primitive, or branch, into the tree of another object; it stays where it is in the world.

    Names and flags go along. If nothing is left of the object, the object is removed, and the node takes its
    name. Decals stay where they are while a surface is there; see `compute_settled` for the others.

    Parameters
    ----------
    into
        Index of the other object.
    target
        Path of a node in its tree, as for `MoveBranch`.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, MoveToObject
    >>> models = [Point((0, 0, 0), radius=1.0), Point((1.2, 0, 0), radius=0.6)]
    >>> session = EditSession(decals.cover(models, count=3, images=["eye"]))
    >>> edit = session.do(MoveToObject(1, (), 0, ()))
    >>> [len(item.tree.children) for item in session.document.objects]
    [2]
    """

    into: int
    target: Path
    label: str = "move to another object"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        return compute_settled(document, self.restructured(document)[0])

    def restructured(self, document: Document) -> tuple[tuple[SceneObject, ...], tuple[int, Path]]:
        """Return the new objects, and object and path of the moved node among them."""
        item, other = self._item(document), PrimitiveCommand(self.into, ())._item(document)
        if item is other:
            raise InvalidEdit(f"into: expected another object than that of the node, got {self.into}")
        rest, tree, found = surgery.move_branch_into(item.tree, self.path, other.tree, self.target)
        path, grown = tuple(self.path), with_tree(other, tree)
        marked = {*item.hidden, *item.locked, *item.names}
        moved = {node: (*found, *node[len(path) :]) for node in marked if node[: len(path)] == path}
        carried, kept = _marks(item, moved), _marks(item, {node: node for node in marked - moved.keys()})
        names = {found: item.name} if rest is None else {}
        marks = {flag: getattr(grown, flag) + carried[flag] for flag in ("hidden", "locked")}
        objects: dict[int, SceneObject] = dict(enumerate(document.objects))
        objects[self.into] = flagged(grown, names=grown.names | names | carried["names"], **marks)
        if rest is None:
            del objects[self.object]
        else:
            objects[self.object] = with_tree(replace(item, **kept), rest)
        return tuple(objects.values()), (list(objects).index(self.into), found)

    def place(self, document: Document) -> tuple[int, Path]:
        """Return object and path of the moved node after the edit."""
        return self.restructured(document)[1]


def _marks(item: TreeObject, paths: dict[Path, Path]) -> dict[str, Any]:
    """Return flags and names of some nodes of an object, under other paths."""
    flags = {
        flag: tuple(paths[node] for node in getattr(item, flag) if node in paths)
        for flag in ("hidden", "locked")
    }
    return flags | {"names": {paths[node]: name for node, name in item.names.items() if node in paths}}


def compute_settled(document: Document, objects: tuple[SceneObject, ...]) -> Edit:
    """Return the edit that replaces objects whose trees exchanged nodes.

    Decals on a changed tree stay while they lie on the surface of a new one. Others are treated as in
    `compute_restructured`.
    """
    edit, positions = document.compute_parts(objects=objects), document.decals.decals.positions
    before, after = (
        [item for item in items if isinstance(item, TreeObject) and not any(item is o for o in others)]
        for items, others in ((document.objects, objects), (objects, document.objects))
    )
    for item in after:
        item.surface  # noqa: B018  # raises for a tree without a visible surface
    old, new = (
        np.min([np.abs(item.tree(positions) - ISO) for item in items], axis=0) for items in (before, after)
    )
    rows = np.flatnonzero(new > old + FIELD_TOLERANCE)
    changed = [number for number, item in enumerate(document.objects) if any(item is o for o in before)]
    rows = rows[np.isin(nearest_points(document.objects, positions[rows]).objects, changed)]
    numbers, decals = document.decals.numbers[rows], document.decals.decals[rows]
    points = nearest_points(after, decals.positions)
    gaps = np.linalg.norm(points.positions.astype(np.float64) - decals.positions, axis=1)
    outside = np.max([item.tree(decals.positions) for item in after], axis=0) < ISO
    edit = edit.then(document.compute_replacement(numbers, move_decals(decals, points)))
    return edit.then(document.compute_deletion(numbers[outside & (gaps > decals.radii)]))


class GroupOperands(StructureCommand):
    """Put operands of a combination under a combination of the same kind; the shape stays.

    Parameters
    ----------
    object
        Index of the object.
    path
        Path of a sum, Ricci blend, union or intersection in the object's tree.
    steps
        Indices of two or more of its operands, but not all.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, GroupOperands
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6) + Point((2, 0, 0), radius=0.5)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(GroupOperands(0, (), (0, 2)))
    >>> [len(child.children) for child in session.document.objects[0].tree.children]
    [2, 0]
    """

    steps: tuple[int, ...]
    label: ClassVar[str] = "group"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the group in it."""
        return surgery.group_operands(tree, self.path, self.steps)


class JoinPrimitive(StructureCommand):
    """Join a primitive, or branch, to its siblings in another way; the siblings stay joined as they are.

    Parameters
    ----------
    join
        How to join them: "blend", "soft union", "union", "intersection" or "difference", or a `Join`.
        A difference subtracts the node from its siblings.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, JoinPrimitive
    >>> tree = Point((0, 0, 0), radius=1.0) + Point((1.2, 0, 0), radius=0.6)
    >>> session = EditSession(decals.cover(tree, count=3, images=["eye"]))
    >>> edit = session.do(JoinPrimitive(0, (1,), "difference"))
    >>> type(session.document.objects[0].tree).__name__
    'Difference'
    """

    join: Join | str

    @property
    def label(self) -> str:
        """How the primitive is joined."""
        return f"join by {self.join.value if isinstance(self.join, Join) else self.join}"

    def restructure(self, tree: Node) -> tuple[Node, Path]:
        """Return the new tree, and the path of the node in it."""
        join = member("join", self.join, Join, InvalidEdit)
        return surgery.rejoin_branch(tree, self.path, join)
