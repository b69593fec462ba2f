"""Tree → program: the order in which one accumulator and a few registers evaluate a tree.

A run folds primitives of one kind into the accumulator. A subtree that cannot be folded in directly gets an
accumulator of its own (push) and is combined afterwards (pop). The subtree that needs most registers goes
first (Sethi & Ullman 1970): a tree of n leaves needs at most log₂ n registers, a spine of any length none.
Affine maps and offsets fold into the primitives below them. The tree that a macro stands for replaces it.

A primitive with a negative weight has a field below 0. That field acts in sums. The operands of all other
operators are raised to 0: a program combines such an operand with the empty field by max.

The compiler knows no class of nodes: `ProgramNode` and `ProgramPrimitive` state what it reads of a node.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, ClassVar, NamedTuple, Self, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Box, Float32Array, Float64Array, IndexArray
from blobtree.declare.claims import OperatorRow, Support
from blobtree.declare.falloff import Falloff
from blobtree.declare.field import FieldKind
from blobtree.declare.registry import row_of
from blobtree.declare.skeleton import Skeleton
from blobtree.declare.warp import SpaceWarp
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import RIM
from blobtree.lazy import Lazy
from blobtree.validation import Vector

MAX_PRIMITIVES = 1 << 24
"""Beyond it a float32 cannot count the primitives of a run."""

SIMILARITY_TOLERANCE = 1e-6
"""Relative deviation from rotation × scale below which a map counts as a similarity."""

NARROWEST_WIDTH = 1e-4
"""Smallest width over the visible radius: float32 resolves no narrower edge."""

EXTENT_MARGIN = 1e-6
"""Relative widening of the extent of a profile, so that rounding leaves nothing outside."""

SIMPLE = -1
"""Weight of a node that folds into the accumulator without one of its own."""


@dataclass(frozen=True, eq=False)
class Placement:
    """What the nodes above a node do to it."""

    matrix: Float64Array
    """Map from the node's space to the world, or to the space of the warp around it."""
    growth: float = 0.0
    """Sum of the offsets of its radii, in its own units."""

    @Lazy
    def uniform_scale(self) -> float | None:
        """Return the factor by which the map scales all lengths, None if directions differ."""
        linear = self.matrix[:3, :3]
        gram = linear.T @ linear
        squared = float(np.trace(gram)) / 3.0
        if np.abs(gram - squared * np.eye(3)).max() > SIMILARITY_TOLERANCE * squared:
            return None
        return float(np.sqrt(squared))

    def folds_into(self, skeleton: Skeleton | FieldKind) -> bool:
        """Return True if the map folds into the parameters of a leaf; else leaves of this kind carry it."""
        if isinstance(skeleton, FieldKind):
            return False
        if skeleton.folds_maps:
            return self.uniform_scale is not None
        return np.array_equal(self.matrix, WORLD.matrix)


WORLD = Placement(np.eye(4))


class ProgramNode:
    """A node of a tree, as the compiler of programs reads it.

    A primitive has a `skeleton` or a `field_kind`, a combination an `operator` and a deformation a `warp`. A
    node without any of them has one program child, and `child_placement` says what it does to that child.
    """

    skeleton: ClassVar[Skeleton | None] = None
    operator: ClassVar[OperatorRow | None] = None
    warp: ClassVar[SpaceWarp | None] = None
    signed = False
    """True for a primitive with a negative weight, whose field is below 0."""

    @property
    def children(self) -> tuple["ProgramNode", ...]:
        """The operands of this node, from left to right; empty for a primitive."""
        return ()

    @property
    def program_children(self) -> tuple["ProgramNode", ...]:
        """The nodes below this one in programs: its children, or for a macro the tree that it stands for."""
        return self.children

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The numbers that the operator takes besides its operands."""
        return ()

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The numbers that the warp takes."""
        return ()

    @property
    def fixed_numbers(self) -> frozenset[str]:
        """Names of parameters whose numbers may not change while the others stay."""
        return frozenset()

    def child_placement(self, placement: Placement) -> Placement:
        """Return the placement of the child of a node that itself has `placement`."""
        return placement


AnyNode = TypeVar("AnyNode", bound=ProgramNode)


def postorder(
    root: AnyNode,
    *,
    into: Callable[[AnyNode], bool] = lambda _node: True,
    leaves: bool = True,
    below: Callable[[AnyNode], tuple[Any, ...]] = attrgetter("children"),
) -> list[AnyNode]:
    """Return every distinct node object from `root` down, children before parents.

    The walk does not recurse, so memory alone limits the depth of a tree. Nodes below a node for which `into`
    is False are left out, unless another path leads to them. So are nodes without children if `leaves` is
    False. `below` returns the children of a node.
    """
    order: list[AnyNode] = []
    seen: set[int] = set()
    pending: list[tuple[AnyNode, bool]] = [(root, False)]
    while pending:
        node, children_done = pending.pop()
        if children_done:
            order.append(node)
        elif id(node) not in seen:
            seen.add(id(node))
            children = below(node)
            if children and into(node):
                pending.append((node, True))
                pending.extend([(child, False) for child in reversed(children) if leaves or below(child)])
            elif children or leaves:
                order.append(node)
    return order


class Slab(NamedTuple):
    """Two parallel faces between which a flat solid lies."""

    middle: Float64Array
    """A point halfway between both (3,)."""
    normal: Float64Array
    """Unit vector at right angles to both (3,)."""
    core: float
    """Half their distance without the offset of the solid."""
    offset: float
    """How far the offset moves each of them."""
    scale: float = 1.0
    """Factor of lengths across the faces, over those in the solid's own space."""

    @property
    def half(self) -> float:
        """Half their distance."""
        return self.core + self.offset

    def placed(self, placement: Placement) -> "Slab":
        """Return the faces in the space around a placement, whose growth is an offset too."""
        linear = placement.matrix[:3, :3]
        normal = np.asarray(np.linalg.solve(linear.T, self.normal), np.float64)
        length = float(np.linalg.norm(normal))
        middle = linear @ self.middle + placement.matrix[:3, 3]
        offset = self.offset + placement.growth
        core = self.core + min(offset, 0.0)  # what is left of a sharp solid has sharp edges too
        return Slab(middle, normal / length, core / length, max(offset, 0.0) / length, 1.0 / length)

    def projected(self, points: Float32Array) -> Float32Array:
        """Return the points (n, 3) halfway between the faces that are closest to points."""
        heights = (points - self.middle) @ self.normal
        return (points - np.outer(heights, self.normal)).astype(np.float32)

    def flattened(self, points: Float32Array, growth: float) -> Float32Array:
        """Return points (n, 3) from between faces that were farther out by a growth.

        What is rounded by the offset moves as a whole.
        """
        heights = (points - self.middle) @ self.normal
        core = self.core + growth
        moves = np.where(np.abs(heights) > core, np.copysign(growth, heights), heights * (growth / core))
        return (points - np.outer(moves, self.normal)).astype(np.float32)


class ProgramLeaf(ProgramNode):
    """A leaf of a tree, as the compiler of programs reads it."""

    color: Vector
    profiled = False
    """True if falloff, width or weight are not the default ones."""
    to_width_radius = 0.0
    """The radius at which the profile has its width, minus the leaf's first radius."""

    @property
    def profile(self) -> tuple[Falloff, float | None, float]:
        """Falloff, width (None in proportion to the radius) and weight."""
        raise NotImplementedError

    @property
    def plain(self) -> Self:
        """The leaf with the default falloff and width, which has the same surface."""
        return self

    @property
    def program_children(self) -> tuple[ProgramNode, ...]:
        """No nodes if this leaf stands for itself, or the leaf for which it stands."""
        return ()

    @property
    def data(self) -> ArrayLike | None:
        """Numbers for the tape's data region, None for none; see `blobtree.tape.tape`."""
        return None

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the radii (n,) of the largest balls that the skeletons, or the fields, of n leaves hold."""
        return np.zeros(len(leaves))


class ProgramPrimitive(ProgramLeaf):
    """A leaf around a skeleton."""

    skeleton: ClassVar[Skeleton]

    @classmethod
    def radii(cls, primitives: Sequence["ProgramPrimitive"]) -> Float64Array:
        """Return the visible radii (n, k) of n primitives of this kind."""
        raise NotImplementedError

    @classmethod
    def hulls(cls, primitives: Sequence["ProgramPrimitive"]) -> Float64Array:
        """Return points (n, k, 3) whose convex hulls hold the skeletons of n primitives of this kind."""
        raise NotImplementedError

    @classmethod
    def packed(
        cls,
        primitives: Sequence["ProgramPrimitive"],
        influences: Float64Array,
        matrices: Float64Array | None,
    ) -> Float64Array:
        """Return the parameters (n, ·, 4) on the tape of n primitives of this kind."""
        raise NotImplementedError


class ProgramField(ProgramLeaf):
    """A leaf whose field is a function of position itself."""

    field_kind: ClassVar[FieldKind]

    @property
    def profile_factor(self) -> float:
        """Factor k of `evaluators.profile_distance`; unused by kinds without a distance."""
        return 1.0

    @property
    def mean_radius(self) -> float:
        """Distance of the surface, to which a width is relative; for kinds with a distance."""
        raise NotImplementedError

    def grown(self, distance: float) -> Self:
        """Return this leaf with its visible surface farther out by a distance, in its own units.

        Raises
        ------
        InvalidNode
            The kind has no measure of size that an offset could change, or nothing is left.
        """
        raise NotImplementedError

    @property
    def slabs(self) -> tuple[Slab, ...]:
        """Pairs of flat faces of the leaf that can be moved apart; empty for none."""
        return ()

    def thickened(self, slab: int, growth: float) -> Self:
        """Return this leaf with both faces of a slab farther out by a growth."""
        raise NotImplementedError

    @classmethod
    def boxes(cls, leaves: Sequence[Any]) -> Box:
        """Return lower and upper corners (n, 3) of boxes outside which the fields of n leaves are 0."""
        raise NotImplementedError

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the parameters (n, ·, 4) on the tape of n leaves of this kind."""
        raise NotImplementedError


LeafKind = Skeleton | FieldKind


def leaf_kind(leaf: ProgramLeaf) -> LeafKind:
    """Return the row of the tables for a leaf."""
    kind = leaf.field_kind if isinstance(leaf, ProgramField) else leaf.skeleton
    assert kind is not None
    return kind


class PlacedPrimitive(NamedTuple):
    """A leaf and its placement."""

    primitive: ProgramLeaf
    placement: Placement


PROGRAM_CHILDREN: Callable[[ProgramNode], tuple[ProgramNode, ...]] = attrgetter("program_children")

_PlacedNode = tuple[ProgramNode, Placement]
"""Another node and its placement."""


def distinct_placements(primitives: list[PlacedPrimitive]) -> tuple[list[Placement], IndexArray]:
    """Return the placements of primitives, each object once, and the index of each primitive's own."""
    identities = np.fromiter((id(placed.placement) for placed in primitives), np.int64, len(primitives))
    if (identities == identities[0]).all():
        return [primitives[0].placement], np.zeros(len(primitives), np.intp)
    _, first, placed_by = np.unique(identities, return_index=True, return_inverse=True)
    placements = [primitives[i].placement for i in first]
    return placements, placed_by


def influence_radii(primitives: list[PlacedPrimitive]) -> Float64Array:
    """Return the influence radii (n, k) of n primitives of a kind: radius / RIM, offsets included.

    Offsets change the radii of primitives with a negative weight the other way.

    Raises
    ------
    InvalidNode
        An offset leaves nothing of a primitive.
    """
    leaves = cast("list[ProgramPrimitive]", [placed.primitive for placed in primitives])
    radii = leaves[0].radii(leaves)
    placements, placed_by = distinct_placements(primitives)
    growth = np.array([placement.growth for placement in placements])[placed_by]
    if growth.any():
        growth = np.where([placed.primitive.signed for placed in primitives], -growth, growth)
    influences: Float64Array = radii / RIM + (growth / RIM)[:, None]
    if (influences <= 0.0).any():
        vanished = primitives[int(np.argmin(influences.min(axis=1)))]
        raise InvalidNode(f"offset: {vanished.placement.growth:g} leaves nothing of {vanished.primitive!r}")
    return influences


def grown_fields(leaves: list[PlacedPrimitive]) -> list[ProgramField]:
    """Return direct fields with the offsets of their placements applied, see `influence_radii`."""
    return [
        leaf.grown(-placement.growth if leaf.signed else placement.growth) if placement.growth else leaf
        for leaf, placement in cast("list[tuple[ProgramField, Placement]]", leaves)
    ]


def profile_factors(primitives: list[PlacedPrimitive], influences: Float64Array) -> Float64Array:
    """Return the factors k (n,) of n primitives with influence radii (n, ·); 0 for those without a profile.

    k is the width that the falloff would have in proportion to the radius, over the wanted width.

    Raises
    ------
    InvalidNode
        A width is too small for its radius.
    """
    factors = np.zeros(len(primitives))
    for number, (primitive, _) in enumerate(primitives):
        if primitive.profiled:
            falloff, width, _ = primitive.profile
            radius = float(influences[number, 0]) * RIM + primitive.to_width_radius
            factors[number] = 1.0 if width is None else profile_factor(falloff, width, radius)
    return factors


def profile_factor(falloff: Falloff, width: float, radius: float) -> float:
    """Return the factor k of a width around a surface at the distance `radius`.

    Raises
    ------
    InvalidNode
        The width is too small for the radius.
    """
    if width < NARROWEST_WIDTH * radius:
        raise InvalidNode(
            f"width: expected at least {NARROWEST_WIDTH:g} of the radius {radius:g}, got {width:g}"
        )
    return radius * (1.0 / falloff.rim - 1.0) / width


def profile_extent(falloff: Falloff, factor: float) -> float:
    """Return the distance at which a profile ends, over the influence radius."""
    return RIM * (1.0 + (1.0 / falloff.rim - 1.0) / factor) * (1.0 + EXTENT_MARGIN)


def support_radii(primitives: list[PlacedPrimitive]) -> Float64Array:
    """Return the distances (n, k) from n skeletons at which fields end; influence radii by default.

    Raises
    ------
    InvalidNode
        An offset leaves nothing of a primitive, or a width is too small.
    """
    influences = influence_radii(primitives)
    if not any(placed.primitive.profiled for placed in primitives):
        return influences
    factors = profile_factors(primitives, influences)
    extents = [
        profile_extent(primitive.profile[0], factor) if factor else 1.0
        for (primitive, _), factor in zip(primitives, factors.tolist(), strict=True)
    ]
    radii: Float64Array = influences * np.array(extents)[:, None]
    return radii


@dataclass(frozen=True)
class Run:
    """Instruction: fold `primitives`, one after the other, into the accumulator."""

    kind: LeafKind
    stretched: bool
    """True if each primitive carries its inverse map and its profile: maps do not fold into parameters."""
    operator: OperatorRow
    parameters: tuple[float, ...]
    primitives: list[PlacedPrimitive] = field(default_factory=list)

    def accepts(self, other: "Run") -> bool:
        """Return True if `other` only continues this run."""
        key = (self.packer, self.stretched, self.operator, self.parameters)
        return key == (other.packer, other.stretched, other.operator, other.parameters)

    @property
    def packer(self) -> type[ProgramLeaf]:
        """The class of the primitives, which packs them; several classes may have one skeleton."""
        return type(self.primitives[0].primitive)


@dataclass(frozen=True)
class Push:
    """Instruction: store the accumulator in `register`, and start again from the empty field."""

    register: int


@dataclass(frozen=True)
class Pop:
    """Instruction: combine `register` (left operand) with the accumulator; `swapped` exchanges them."""

    register: int
    operator: OperatorRow
    parameters: tuple[float, ...]
    swapped: bool = False


@dataclass(frozen=True)
class EnterWarp:
    """Instruction: map the point through a map and a warp until `LeaveWarp`; `register` keeps the point."""

    warp: SpaceWarp
    parameters: tuple[float, ...]
    placement: Placement
    register: int


@dataclass(frozen=True)
class LeaveWarp:
    """Instruction: restore the point that `entry` kept, and pull the accumulator back through the warp."""

    entry: EnterWarp


Instruction = Run | Push | Pop | EnterWarp | LeaveWarp


@dataclass(frozen=True)
class _Emit:
    """Pending step: fold `node` into the accumulator; registers from `register` on are free."""

    node: ProgramNode
    placement: Placement
    register: int = 0
    warp_register: int = 0

    def into(self, node: ProgramNode, placement: Placement, *, deeper: int = 0) -> "_Emit":
        """Return the step for a node below, with `deeper` more registers in use."""
        return replace(self, node=node, placement=placement, register=self.register + deeper)


def compile_program(root: ProgramNode) -> list[Instruction]:
    """Return the instructions that leave the value of `root` in the accumulator, which starts at 0.

    Raises
    ------
    InvalidNode
        Shared subtrees, counted as often as they are used, hold too many primitives.
    """
    weights, signed = _weights(root), _signed_nodes(root)
    program: list[Instruction] = []
    pending: list[_Emit | Instruction] = [_Emit(root, WORLD)]
    while pending:
        step = pending.pop()
        if isinstance(step, _Emit):
            pending.extend(reversed(list(_expand(step, weights, signed))))
        elif isinstance(step, Run) and program and isinstance(program[-1], Run) and program[-1].accepts(step):
            program[-1].primitives.extend(step.primitives)
        else:
            program.append(step)
    return program


def registers_needed(program: list[Instruction]) -> int:
    """Return the number of registers that a program uses."""
    return max((step.register + 1 for step in program if isinstance(step, Push)), default=0)


def warp_registers_needed(program: list[Instruction]) -> int:
    """Return the depth to which warps nest in a program."""
    return max((step.register + 1 for step in program if isinstance(step, EnterWarp)), default=0)


def _weights(root: ProgramNode) -> dict[int, int]:
    """Return the weight of every node with children; raise `InvalidNode` for too many primitives."""
    weights: dict[int, int] = {}
    counts: dict[int, int] = {}
    for node in postorder(root, leaves=False, below=PROGRAM_CHILDREN):
        children = [id(child) for child in node.program_children]
        counts[id(node)] = sum([counts.get(child, 1) for child in children])
        weights[id(node)] = _weight(node, [weights.get(child, SIMPLE) for child in children])
    if counts.get(id(root), 1) > MAX_PRIMITIVES:
        raise InvalidNode(
            f"tree: its subtrees, counted as often as they are used, exceed {MAX_PRIMITIVES:,} primitives"
        )
    return weights


def _weight(node: ProgramNode, child_weights: list[int]) -> int:
    """Return the registers that a node with children needs, SIMPLE if it folds without an accumulator."""
    if node.warp is not None:
        return max(0, child_weights[0])
    if len(child_weights) == 1:
        return child_weights[0]
    heaviest, *others = sorted(child_weights, reverse=True)
    return max([0, heaviest, *(weight + 1 for weight in others)])


def _signed_nodes(root: ProgramNode) -> frozenset[int]:
    """Return the ids of the nodes with children whose fields may be below 0."""
    signed: set[int] = set()
    for node in postorder(root, leaves=False, below=PROGRAM_CHILDREN):
        keeps_sign = node.operator is None or _operation(node)[0].signed
        children = node.program_children
        if keeps_sign and (
            any(map(attrgetter("signed"), children)) or not signed.isdisjoint(map(id, children))
        ):
            signed.add(id(node))
    return frozenset(signed)


def _expand(step: _Emit, weights: dict[int, int], signed: frozenset[int]) -> Iterator[_Emit | Instruction]:
    """Yield smaller steps for a step that starts from an empty accumulator."""
    node, placement = _strip(step.node, step.placement)
    if isinstance(node, ProgramLeaf):
        yield from _runs([PlacedPrimitive(node, placement)], row_of("sum"), ())
    elif node.warp is not None:
        yield from _expand_warp(replace(step, node=node, placement=placement), node, node.warp)
    elif node.operator is not None:
        expand = _expand_commutative if node.operator.commutes else _expand_ordered
        yield from expand(replace(step, node=node, placement=placement), node, weights, signed)


def _expand_warp(step: _Emit, node: ProgramNode, warp: SpaceWarp) -> Iterator[_Emit | Instruction]:
    """Yield the steps of a warp: its child in a space of its own."""
    outer = Placement(step.placement.matrix)
    entry = EnterWarp(warp, node.warp_parameters, outer, step.warp_register)
    (child,) = node.program_children
    inner = _Emit(child, Placement(np.eye(4), step.placement.growth), step.register, step.warp_register + 1)
    yield from (entry, inner, LeaveWarp(entry))


def _raised(step: _Emit, operator: OperatorRow, signed: frozenset[int]) -> Iterator[_Emit | Instruction]:
    """Yield the steps of an operand, raised to 0 where it is below, if the operator asks for it."""
    yield step
    if not operator.signed and (step.node.signed or id(step.node) in signed):
        yield Push(step.register)
        yield Pop(step.register, row_of("union"), ())


def _raised_primitive(placed: PlacedPrimitive) -> PlacedPrimitive:
    """Return a primitive as an operand of an operator other than the sum: without its field below 0."""
    if not placed.primitive.signed:
        return placed
    return PlacedPrimitive(replace(cast(Any, placed.primitive), weight=0.0), placed.placement)


def _expand_commutative(
    step: _Emit, node: ProgramNode, weights: dict[int, int], signed: frozenset[int]
) -> Iterator[_Emit | Instruction]:
    """Yield the heaviest operand first; primitives fold in at the end, kind by kind."""
    operator, parameters = _operation(node)
    subtrees: list[_PlacedNode] = []
    primitives: list[PlacedPrimitive] = []
    for placed in _flatten(node, step.placement):
        if isinstance(placed, PlacedPrimitive):
            primitives.append(placed if operator.signed else _raised_primitive(placed))
        else:
            subtrees.append(placed)
    subtrees.sort(key=lambda subtree: -weights[id(subtree[0])])
    for number, (operand, placement) in enumerate(subtrees):
        if number == 0:
            yield from _raised(step.into(operand, placement), operator, signed)
        else:
            yield Push(step.register)
            yield from _raised(step.into(operand, placement, deeper=1), operator, signed)
            yield Pop(step.register, operator, parameters)
    if not subtrees and not operator.starts_from_zero:
        first, *primitives = primitives
        yield from _runs([first], row_of("sum"), ())
    yield from _runs(primitives, operator, parameters)


def _expand_ordered(
    step: _Emit, node: ProgramNode, weights: dict[int, int], signed: frozenset[int]
) -> Iterator[_Emit | Instruction]:
    """Yield the left operand first, unless the right one needs more registers."""
    operator, parameters = _operation(node)
    left, right = node.program_children
    left_placement = step.placement
    cuts = operator.support is Support.LEFT
    right_placement = replace(left_placement, growth=-left_placement.growth) if cuts else left_placement
    if weights.get(id(right), SIMPLE) == SIMPLE:
        leaf, placement = _strip(right, right_placement)
        assert isinstance(leaf, ProgramLeaf)
        yield from _raised(step.into(left, left_placement), operator, signed)
        yield from _runs([_raised_primitive(PlacedPrimitive(leaf, placement))], operator, parameters)
        return
    swapped = weights[id(right)] > weights.get(id(left), SIMPLE)
    operands = [(left, left_placement), (right, right_placement)]
    first, second = reversed(operands) if swapped else operands
    yield from _raised(step.into(*first), operator, signed)
    yield Push(step.register)
    yield from _raised(step.into(*second, deeper=1), operator, signed)
    yield Pop(step.register, operator, parameters, swapped)


def _runs(
    primitives: Iterable[PlacedPrimitive], operator: OperatorRow, parameters: tuple[float, ...]
) -> Iterator[Run]:
    """Yield one run per kind of primitive, in the order in which the kinds first occur."""
    runs: dict[tuple[type[ProgramLeaf], bool], Run] = {}
    run: Run | None = None
    packer: type[ProgramLeaf] | None = None
    placement: Placement | None = None
    profiled = False
    for placed in primitives:
        primitive = placed.primitive
        if (
            run is None
            or placed.placement is not placement
            or type(primitive) is not packer
            or primitive.profiled is not profiled
        ):
            packer, placement, profiled = type(primitive), placed.placement, primitive.profiled
            kind = leaf_kind(primitive)
            stretched = profiled or not placement.folds_into(kind)
            run = runs.setdefault((packer, stretched), Run(kind, stretched, operator, parameters))
        run.primitives.append(placed)
    yield from runs.values()


def _operation(node: ProgramNode) -> tuple[OperatorRow, tuple[float, ...]]:
    """Return operator and parameters; a Ricci blend of exponent 1 is the sum (GLSL has no pow(0, 0))."""
    assert node.operator is not None
    if node.operator is row_of("ricci") and node.operator_parameters == (1.0,):
        return row_of("sum"), ()
    return node.operator, node.operator_parameters


def _strip(node: ProgramNode, placement: Placement) -> tuple[ProgramNode, Placement]:
    """Return the node below maps, offsets, macros and one-operand combinations, and its placement."""
    while len(node.program_children) == 1 and node.warp is None:
        placement = node.child_placement(placement)
        (node,) = node.program_children
    return node, placement


def _flatten(root: ProgramNode, placement: Placement) -> Iterator[PlacedPrimitive | _PlacedNode]:
    """Yield the operands of `root`; nested combinations by the same operator yield theirs."""
    operation = _operation(root)
    pending = _placed(root.program_children, placement)
    while pending:
        placed = pending.pop()
        if isinstance(placed, PlacedPrimitive):
            yield placed
            continue
        node, node_placement = _strip(*placed)
        if node.operator is not None and _operation(node) == operation:
            pending.extend(_placed(node.program_children, node_placement))
        elif isinstance(node, ProgramLeaf):
            yield PlacedPrimitive(node, node_placement)
        else:
            yield node, node_placement


def _placed(nodes: tuple[ProgramNode, ...], placement: Placement) -> list[PlacedPrimitive | _PlacedNode]:
    """Return nodes and their placements, the last one first."""
    return [
        PlacedPrimitive(node, placement)
        if isinstance(node, ProgramLeaf) and not node.program_children
        else (node, placement)
        for node in reversed(nodes)
    ]
