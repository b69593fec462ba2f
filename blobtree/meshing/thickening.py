"""Thickening: plates and walls far thinner than cells, meshed as thicker ones.

Cells as small as a plate is thin would fill both of its sides, although these are flat. So thin plates grow
until the cells of the base resolve them, and so do the bodies around thin walls. The mesh of the grown tree
has the shape of the surface, in few triangles. Then its vertices go back to the surface of the tree itself:

* A vertex of a plate moves toward its foot, the closest point of the plate's skeleton. The plate's surface
  lies between both, however thin it is.
* A plate without a skeleton grows across its two faces alone. A vertex goes back by the same map, which takes
  edges to edges.
* A vertex of a wall moves toward the middle of the wall, at a distance from its leaf's skeleton.
* Where both fail, or lead farther, Newton's method finds the surface.

Growth must not close gaps, or open walls. Skeletons that are near each other limit it. At last, rays from the
vertices look for the other sides of plates, walls and gaps: each side must have vertices nearby. A tree that
fails is meshed again with less growth, and at last with cells as small as its parts are thin (`parts`).
"""

from collections.abc import Callable, Container
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Float64Array, IndexArray, Int32Array
from blobtree.cells.grid import Grid
from blobtree.cells.surface_box import longest_side, surface_box
from blobtree.declare.skeleton import BALL_CELLS, PLATE_CELLS, Skeleton
from blobtree.device import known_device, launch
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import ISO, RIM
from blobtree.kernels import load_together
from blobtree.lazy import Lazy
from blobtree.meshing.block_tree import on_device
from blobtree.meshing.leaf_gaps import hull_corners, limit_by_gaps, surface_points, thinnest_slab
from blobtree.meshing.mesh import Mesh, vertex_arrays
from blobtree.meshing.parts import FirstCells, ThinPart, first_cells, mesh_of_parts, warn_of_thin_parts
from blobtree.meshing.thickening_kernels import (
    NO_SIDE,
    find_feet,
    find_other_sides,
    improve_feet,
    return_to_surface,
)
from blobtree.meshing.walls import WALL_CELLS
from blobtree.progress import Progress
from blobtree.tape.bounds import leaf_boxes
from blobtree.tape.grown import NO_SLAB, GrownModel, leaf_tape, runs_of_leaves
from blobtree.tape.model import ImplicitModel, gradients_at, values_at
from blobtree.tape.part_sizes import bounded_by_slabs, has_warps, part_sizes
from blobtree.tape.program import PlacedPrimitive, ProgramPrimitive, Run, Slab, influence_radii

MAX_ATTEMPTS = 6
"""Most meshes of grown trees."""

MAX_GROWN_TRIANGLES = 500_000
"""Triangles of a mesh that failed, above which a mesh with less growth would take too many."""

LESS = 0.25
"""Largest growth of a part after it failed, over that before."""

PLATE_GROWS, GROWS = 1.5, 3.0
"""Least growth of a plate, and of a wall, over the size of cells that it needs: less saves few cells."""

THIN = 0.5
"""Size of cells that a part needs, over those of the base, below which it grows."""

MARGIN, WARP_MARGIN = 1.1, 1.6
"""Thickness of grown parts over what cells need, without warps and with warps, which make parts thinner."""

PLATE_LENGTHS = 4.0
"""Least length and width of a plate over half its grown thickness; those of a thin one are twice as much."""

MAX_STRETCH = 4.0
"""Largest ratio of the factors by which a plate's map scales lengths."""

BODY_CELLS = 0.25
"""Size of cells around a wall, over half the least thickness of its bodies."""

MAX_SHRINKAGE = 0.5
"""Largest part of a tool's radius by which it shrinks."""

SAGITTA_CELLS = 2.0
"""Size of cells over √(thickness · radius of curvature), up to which both sides of a wall stay apart."""

THINNEST_BEND = 1e-5
"""Thickness over the longest side of the surface's box, below which triangles of both sides may cross where
they bend."""

MAX_FIELD_ERROR = 0.05
"""Largest error of the field at a vertex that is back on the surface of the thinnest parts."""

MAX_WAY = 2.5
"""Longest way back of a vertex, over the growth; longer ones lead to other parts."""

MOST_CORRECTION = 1e-3
"""Largest distance, over the growth, between a vertex and the place to which the map of a slab takes it, at
which the vertex stays on a crease."""

SLIDES = 8
"""Steps of Newton's method along the faces of a slab."""

MOST_ACROSS = 0.9
"""Largest share of a gradient across the faces with which a vertex slides; on a face the share is 1."""

MENDINGS = 3
"""Rounds in which faulty vertices start from their neighbours."""

FOOT_GROWTH = 0.03
"""Growth of a plate with which feet are found exactly, over its growth."""

ON_SURFACE = 1e-3
"""Difference of a field to ISO, below which a point is on a surface."""

RAY_REACH = 3.0
"""Length of rays from vertices over the growth."""

SHORTEST_RAY = 1e-6
"""Length of rays from which on float32 tells sides apart, over the largest coordinate."""

OPPOSED = 0.9
"""Cosine between a normal and the opposite one on the other side of a plate, a wall or a gap."""

MISSING_SHARE = 0.02
"""Share of a leaf's vertices whose other side may lack a vertex: at rims, edges and corners."""

MAX_FOLDED = 0.05
"""Largest share of a leaf's triangles that may face inward, by area."""

MAX_OFF = 0.08
"""Largest share of a leaf's triangles that may be off the surface: above, they bridge joints of parts."""

CHECKED_FACES = 400
"""Triangles of each leaf that are looked at, evenly by area."""

FACE_REACH = 0.3 * np.geomspace(0.002, 1.0, 40)
"""Distances from a triangle at which the surface is looked for, over its longest side."""

LEAST_FOUND = 0.9
"""Share of the points all over a leaf's surface that must have vertices on their side."""

ROUGHNESS = 2.0
"""How much farther off the surface the vertices on the other side may be than those on the same one."""

NEAREST_VERTICES = 5
"""Vertices that may lie on the side of a ray's end."""

SIDE_CELLS = 4.0
"""Distance along the surface, in cells, within which a side that a ray finds has a vertex."""


@dataclass(frozen=True)
class _Growth:
    """What grows, and how: one row for each leaf, in the order of the program."""

    tree: ImplicitModel
    """Before."""
    amounts: Float64Array
    """Growths, in the leaves' own units (n,)."""
    lengths: Float64Array
    """The same in the world's (n,)."""
    aims: Float64Array
    """Distances from skeletons, over influences after the growth, that lie in plates and walls (n,)."""
    slabs: dict[int, tuple[int, Slab]]
    """Of the leaves that grow across a slab, by number: its number and its place."""

    @staticmethod
    def none(tree: ImplicitModel) -> "_Growth":
        """Return no growth."""
        zeros = np.zeros(sum(1 for _ in runs_of_leaves(tree._program)))
        return _Growth(tree, zeros, zeros, zeros, {})

    @Lazy
    def grown(self) -> ImplicitModel:
        """Return the tree after."""
        if not self.amounts.any():
            return self.tree
        slabs = np.full(len(self.amounts), NO_SLAB)
        for number, (slab, _) in self.slabs.items():
            slabs[number] = slab
        return GrownModel(self.tree, self.amounts, slabs)

    @property
    def reach(self) -> float:
        """Largest growth."""
        return float(np.abs(self.lengths).max())

    def then(self, later: "_Growth") -> "_Growth":
        """Return this growth and one of its grown tree, whose leaves are others."""
        return _Growth(
            self.tree,
            self.amounts + later.amounts,
            self.lengths + later.lengths,
            self.aims + later.aims,
            self.slabs | later.slabs,
        )


class _Vertices:
    """Vertices of a mesh of a grown tree, which go back to the surface of the tree itself."""

    def __init__(self, mesh: Mesh, device: str) -> None:
        self.mesh, self.device = mesh, device
        self.starts = mesh.vertices
        """The vertices before they moved."""
        self.faulty = np.zeros(len(mesh.vertices), bool)
        """Vertices that are not on the surface."""
        self.moved = self.faulty.copy()
        self.owners = np.full(len(mesh.vertices), -1, np.int32)
        """The leaf to whose surface each vertex belonged; −1 for others than those that grew."""
        self.flattened = self.faulty.copy()
        """Vertices that the map of a slab alone has brought to the surface."""

    def go_back(self, growth: _Growth) -> None:
        """Move the vertices to the surface of the tree before it grew; all others keep what they have."""
        owners, nearness, feet = self._feet(growth)
        off = np.abs(values_at(growth.tree.tape, self.starts) - ISO) > ON_SURFACE
        on_grown = nearness < ON_SURFACE
        listed = np.flatnonzero(off | on_grown)
        self.owners = owners
        self.moved[listed] = True
        on_slabs = np.isin(owners, list(growth.slabs))
        points = np.where(on_slabs[:, None], feet, self.starts)[listed]
        others = np.where(on_slabs, -1, owners)[listed]
        self._place(growth.tree, points, listed, growth.reach, others, feet[listed])
        for number, (_, slab) in growth.slabs.items():
            own = np.flatnonzero(owners == number)
            self._slide(growth, number, own)
            again = own[self.faulty[own] | self._ended_far(own, growth)]
            starts = self.starts[again]
            self._place(growth.tree, starts, again, growth.reach, owners[again], slab.projected(starts))
        corrections = np.linalg.norm(self.mesh.vertices - feet, axis=1)
        self.flattened = on_slabs & ~self.faulty & (corrections <= MOST_CORRECTION * growth.reach)
        self.faulty |= self._ended_far(np.arange(len(self.starts)), growth)
        self._mend(growth)

    def _ended_far(self, listed: IndexArray, growth: _Growth) -> BoolArray:
        """Return True for vertices that have moved too far to be on the part from which they came."""
        ways = self.mesh.vertices[listed] - self.starts[listed]
        far: BoolArray = np.linalg.norm(ways, axis=1) > MAX_WAY * growth.reach
        return far

    def _slide(self, growth: _Growth, number: int, own: IndexArray) -> None:
        """Move vertices of a slab along its faces to where other leaves cut it, by Newton's method.

        Across the faces, a step as long as the slab is thin would leave it.
        """
        mesh, normal, tape = self.mesh, growth.slabs[number][1].normal, growth.tree.tape
        rows = gradients_at(tape, mesh.vertices[own]).astype(np.float64)
        across = np.abs(rows[:, 1:] @ normal)
        slides = across < MOST_ACROSS * np.linalg.norm(rows[:, 1:], axis=1)
        off = slides & (np.abs(rows[:, 0] - ISO) > ON_SURFACE)
        if not off.any():
            return
        listed, first = own[off], rows[off]
        rows, points = first, mesh.vertices[listed].astype(np.float64)
        for _step in range(SLIDES):
            along = rows[:, 1:] - np.outer(rows[:, 1:] @ normal, normal)
            squared = np.maximum((along**2).sum(axis=1), 1e-300)
            steps = ((ISO - rows[:, 0]) / squared)[:, None] * along
            lengths = np.linalg.norm(steps, axis=1, keepdims=True)
            points += steps * np.minimum(1.0, growth.reach / np.maximum(lengths, 1e-300))
            rows = gradients_at(tape, points).astype(np.float64)
        better = np.abs(rows[:, 0] - ISO) < np.abs(first[:, 0] - ISO)
        listed, rows = listed[better], rows[better]
        vertices, normals = mesh.vertices.copy(), mesh.normals.copy()
        vertices[listed], normals[listed] = points[better], _outward(rows)
        self.mesh = replace(mesh, vertices=vertices, normals=normals)
        self.faulty[listed] = np.abs(rows[:, 0] - ISO) > MAX_FIELD_ERROR

    def _mend(self, growth: _Growth) -> None:
        """Place faulty vertices again, from the middle of their neighbours that are not."""
        for _round in range(MENDINGS):
            if not self.faulty.any():
                return
            start, end = self.mesh.faces.ravel(), np.roll(self.mesh.faces, -1, axis=1).ravel()
            used = self.faulty[start] & ~self.faulty[end]
            sums, counts = np.zeros((len(self.starts), 3)), np.zeros(len(self.starts))
            np.add.at(sums, start[used], self.mesh.vertices[end[used]])
            np.add.at(counts, start[used], 1.0)
            listed = np.flatnonzero(counts)
            places = (sums[listed] / counts[listed, None]).astype(np.float32)
            self._place(growth.tree, places, listed, growth.reach)

    def _place(
        self,
        tree: ImplicitModel,
        points: Float32Array,
        listed: IndexArray,
        reach: float,
        owners: Int32Array | None = None,
        feet: Float32Array | None = None,
    ) -> None:
        """Place some of the vertices on the surface of a tree, from points near it."""
        tape, count, device = tree.tape, len(points), self.device
        whole = tape.on(device)
        if owners is None or feet is None:
            owners, feet = np.full(count, -1, np.int32), points
        arrays = [wp.empty(count, dtype=wp.vec3, device=device) for _ in range(3)]
        errors = wp.empty(count, dtype=wp.float32, device=device)
        inputs = [on_device(points, wp.vec3, device), on_device(owners, wp.int32, device)]
        inputs += [on_device(feet, wp.vec3, device), reach, whole.data, whole.span]
        kernel = tape.instruction_set.kernel_for(return_to_surface)
        launch(kernel, count, inputs, [vertex_arrays(*arrays), errors], device)
        mesh = self.mesh
        columns = [mesh.vertices.copy(), mesh.normals.copy(), mesh.colors.copy()]
        for column, array in zip(columns, arrays, strict=True):
            column[listed] = array.numpy()
        self.mesh = Mesh(columns[0], mesh.faces, columns[1], columns[2], mesh.sheet_counts)
        self.faulty[listed] = errors.numpy() > MAX_FIELD_ERROR

    def _feet(self, growth: _Growth) -> tuple[Int32Array, Float32Array, Float32Array]:
        """Return the owners of the vertices, the differences of their owners' fields to ISO, and the feet."""
        count, device = len(self.starts), self.device
        points = on_device(self.starts, wp.vec3, device)
        nearness = wp.full(count, value=float(ISO), dtype=wp.float32, device=device)
        owners = wp.full(count, value=-1, dtype=wp.int32, device=device)
        feet = wp.zeros(count, dtype=wp.vec3, device=device)
        lower, upper = leaf_boxes(growth.grown._program)
        warped = has_warps(growth.tree)
        for number in np.flatnonzero((growth.aims >= 0.0) & (growth.amounts != 0.0)).tolist():
            near = ((self.starts >= lower[number]) & (self.starts <= upper[number])).all(axis=1) | warped
            listed = on_device(np.flatnonzero(near), wp.int32, device)
            aim, reach = float(growth.aims[number]), 4.0 * growth.reach
            tape = leaf_tape(growth.grown._program, number)
            own = tape.on(device)
            inputs = [points, listed, number, aim, reach, own.data, own.span]
            kernel = tape.instruction_set.kernel_for(find_feet)
            launch(kernel, len(listed), inputs, [nearness, owners, feet], device)
            if aim == 0.0 and number not in growth.slabs:
                tape = leaf_tape(growth.tree._program, number, FOOT_GROWTH * growth.amounts[number])
                own = tape.on(device)
                inputs = [listed, number, reach, own.data, own.span, owners]
                kernel = tape.instruction_set.kernel_for(improve_feet)
                launch(kernel, len(listed), inputs, [feet], device)
        found, places = owners.numpy(), feet.numpy()
        for number, (_, slab) in growth.slabs.items():
            own = found == number
            places[own] = slab.flattened(self.starts[own], float(growth.lengths[number]))
        return found, nearness.numpy(), places

    def finished(self) -> Mesh:
        """Return the mesh; creases that moved otherwise than by the map of a slab are left open.

        They count as parts whose sheets do not meet nearby.
        """
        counts = self.mesh.sheet_counts
        if counts is None:
            return self.mesh
        opened = self.moved & ~self.flattened & (counts > 1)
        return replace(self.mesh, sheet_counts=np.where(opened, 0, counts).astype(np.uint8))


def mesh_of_thin_parts(
    tree: ImplicitModel,
    grid_of: Callable[[ImplicitModel, float], Grid],
    uniform: Callable[[ImplicitModel], Mesh],
    device: str | None,
    creases: bool,
    report: Progress,
) -> Mesh:
    """Return a mesh that shows thin parts: thickened where they are plates or walls, else with small cells.

    `grid_of` returns a grid for a model whose cells are smaller by a factor, and `uniform` a mesh of the
    cells of the factor 1.
    """

    def with_small_cells(
        model: ImplicitModel, first: FirstCells | None, expendable: Literal["none", "some", "all"]
    ) -> tuple[Mesh, list[ThinPart]]:
        grids = partial(grid_of, model)
        mesh, unresolved = mesh_of_parts(model, grids, device, creases, report, first, expendable)
        return mesh or uniform(model), unresolved

    size = grid_of(tree, 1.0).cell_size
    limits, first = np.full(len(part_sizes(tree)[0]), np.inf), None
    for attempt in range(MAX_ATTEMPTS):
        plates = _grown_plates(tree, size, limits)
        first = first_cells(plates.grown, partial(grid_of, plates.grown), device, report)
        growth = plates.then(_grown_walls(plates.grown, first, size, limits, plates.slabs))
        if growth.grown is tree:
            break
        walls_grow = not np.array_equal(growth.amounts, plates.amounts)
        expendable: Literal["none", "some"] = "some" if attempt else "none"
        mesh, unresolved = with_small_cells(growth.grown, None if walls_grow else first, expendable)
        first = None
        kernels = (return_to_surface, find_feet, improve_feet, find_other_sides)
        load_together(map(tree.tape.instruction_set.kernel_for, kernels), known_device(device))
        vertices = _Vertices(mesh, known_device(device))
        vertices.go_back(growth)
        wrong = _wrong_leaves(tree, vertices, size, growth)
        if not len(wrong):
            warn_of_thin_parts(growth.grown, unresolved)
            return vertices.finished()
        if len(mesh.faces) > MAX_GROWN_TRIANGLES:
            break
        limits[wrong] = LESS * np.abs(growth.lengths[wrong])
    mesh, unresolved = with_small_cells(tree, first, "all")
    warn_of_thin_parts(tree, unresolved)
    return mesh


def _grown_plates(tree: ImplicitModel, size: float, limits: Float64Array) -> _Growth:
    """Return the growth of plates that are too thin for cells of a size, up to limits."""
    needed = part_sizes(tree)[0] / BALL_CELLS
    lengths, scales, warped = np.zeros(len(needed)), np.ones(len(needed)), has_warps(tree)
    margin = size * (WARP_MARGIN if warped else MARGIN)
    leaves, slabs = list(runs_of_leaves(tree._program)), dict[int, tuple[int, Slab]]()
    for number in np.flatnonzero(needed < THIN * size).tolist():
        (run, placed), half = leaves[number], PLATE_CELLS * margin
        spectrum = np.linalg.svd(placed.placement.matrix[:3, :3], compute_uv=False)
        flat, scales[number] = None if warped else thinnest_slab(placed), spectrum[-1]
        if spectrum[0] > MAX_STRETCH * spectrum[-1] and not bounded_by_slabs(placed.primitive):
            continue
        if flat is not None:
            slabs[number], half = flat, BALL_CELLS * margin
            scales[number], needed[number] = flat[1].scale, flat[1].half / BALL_CELLS
        elif not _may_be_plate(run, placed):
            continue
        width = _width(placed)
        if width >= 2.0 * PLATE_LENGTHS * needed[number]:
            lengths[number] = min(half, width / PLATE_LENGTHS, limits[number])
    limit_by_gaps(tree, leaves, lengths, {number: slab for number, (_, slab) in slabs.items()})
    lengths[lengths < PLATE_GROWS * needed] = 0.0
    grown = {number: slab for number, slab in slabs.items() if lengths[number]}
    return _Growth(tree, lengths / scales, lengths, np.zeros(len(lengths)), grown)


def _may_be_plate(run: Run, placed: PlacedPrimitive) -> bool:
    """Return True for flat skeletons and solids whose surface lies where their radii say."""
    leaf = placed.primitive
    if not isinstance(leaf, ProgramPrimitive) or leaf.profile[2] != 1.0:
        return False
    assert isinstance(run.kind, Skeleton)
    return run.kind.cells == PLATE_CELLS or float(type(leaf).inradii([leaf])[0]) > 0.0


def _width(placed: PlacedPrimitive) -> float:
    """Return the second of the three lengths of a leaf's skeleton."""
    corners = hull_corners(placed)
    axes = np.linalg.svd(corners - corners.mean(axis=0))[2]
    return float(np.sort(np.ptp(corners @ axes.T, axis=0))[1])


def _grown_walls(
    tree: ImplicitModel, first: FirstCells, size: float, limits: Float64Array, slabs: Container[int]
) -> _Growth:
    """Return the growth of bodies whose tools leave thin walls, and of tools between which there are some.

    What two bodies have in common is a lens: it would grow far beyond its rim. Leaves that have grown across
    slabs do not grow again.
    """
    leaves, halves = list(runs_of_leaves(tree._program)), part_sizes(tree)[0]
    lengths, scales, depths = np.zeros(len(leaves)), np.ones(len(leaves)), np.zeros(len(leaves))
    longest = longest_side(surface_box(tree))
    for wall in first.walls.thin if first.walls is not None else ():
        if wall.thickness > WALL_CELLS * THIN * size or not wall.facing.tool:
            continue
        for number in wall.operand.numbers:
            run, placed = leaves[number]
            scale = float(np.linalg.svd(placed.placement.matrix[:3, :3], compute_uv=False)[-1])
            radius = _radius_of_curvature(run, placed) * scale
            thickness = max(wall.thickness, THINNEST_BEND * longest)
            cell = min(size, SAGITTA_CELLS * float(np.sqrt(thickness * radius)))
            cell = min(cell, BODY_CELLS * halves[number])
            growth = min(max(WALL_CELLS * MARGIN * cell - wall.thickness, 0.0), limits[number])
            depth = 0.5 * wall.thickness
            if wall.operand.tool:
                growth, depth = -0.5 * growth, -depth
            if number in slabs or placed.primitive.signed or -growth > MAX_SHRINKAGE * radius:
                return _Growth.none(tree)
            if abs(growth) > abs(lengths[number]):
                lengths[number], scales[number], depths[number] = growth, scale, depth
    signs, lengths = np.sign(lengths), np.abs(lengths)
    limit_by_gaps(tree, leaves, lengths, {})
    lengths[lengths < GROWS * np.abs(depths)] = 0.0
    amounts = signs * lengths / scales
    aims = [
        _aim(*leaf, amount, depth)
        for leaf, amount, depth in zip(leaves, amounts.tolist(), (depths / scales).tolist(), strict=True)
    ]
    try:
        growth_of_all = _Growth(tree, amounts, signs * lengths, np.array(aims), {})
        _ = growth_of_all.grown.tape
    except InvalidNode:  # nothing is left of a tool
        return _Growth.none(tree)
    return growth_of_all


def _aim(run: Run, placed: PlacedPrimitive, growth: float, depth: float) -> float:
    """Return the distance from a skeleton, over the influence after a growth, at a depth in a wall.

    It is −1 for leaves whose distance is not known.
    """
    if growth == 0.0:
        return 0.0
    if not isinstance(run.kind, Skeleton) or placed.primitive.profile[2] != 1.0:
        return -1.0
    influence = float(influence_radii([placed]).min())
    return max(RIM * influence - depth, 0.0) / (influence + growth / RIM)


def _radius_of_curvature(run: Run, placed: PlacedPrimitive) -> float:
    """Return the radius of a leaf around a point or a curve, in its own units; infinite for all others."""
    if not isinstance(run.kind, Skeleton) or _may_be_plate(run, placed):
        return float(np.inf)
    return RIM * float(influence_radii([placed]).min())


def _wrong_leaves(tree: ImplicitModel, vertices: _Vertices, size: float, growth: _Growth) -> IndexArray:
    """Return the leaves that grew too much: vertices are not on the surface, or parts of it have none."""
    if not len(vertices.mesh.faces):
        return np.flatnonzero(growth.amounts)
    sides = _Sides(vertices.mesh, SIDE_CELLS * size)
    missing, count = vertices.faulty.copy(), len(growth.amounts)
    for sign in (-1.0, 1.0):
        missing |= _without_other_side(tree, vertices, sides, growth.reach, sign)
    owners = vertices.owners + 1
    checked = np.bincount(owners[vertices.moved], minlength=count + 1)
    failed = np.bincount(owners[missing & ~vertices.faulty], minlength=count + 1) > MISSING_SHARE * checked
    failed[owners[vertices.faulty]] = True
    failed |= _folded_share(vertices.mesh, owners, count + 1) > MAX_FOLDED
    failed[1:] |= _share_off_surface(tree, vertices.mesh, vertices.owners, count) > MAX_OFF
    failed[1:] |= _without_vertices(tree, sides, growth)
    if failed[0]:
        return np.flatnonzero(growth.amounts)
    return np.flatnonzero(failed[1:])


def _folded_share(mesh: Mesh, owners: Int32Array, count: int) -> Float64Array:
    """Return by owner the share of the area of triangles that face away from the normals of their corners."""
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(crosses, axis=1)
    folded = (crosses * mesh.normals[mesh.faces].sum(axis=1)).sum(axis=1) < 0.0
    of_faces = owners[mesh.faces[:, 0]]
    whole, away = (
        np.bincount(of_faces, weights=weights, minlength=count).astype(np.float64)
        for weights in (areas, areas * folded)
    )
    shares: Float64Array = away / np.maximum(whole, 1e-300)
    shares[0] = 0.0  # triangles that did not grow
    return shares


def _share_off_surface(tree: ImplicitModel, mesh: Mesh, owners: Int32Array, count: int) -> Float64Array:
    """Return by leaf the share of triangles, by area, along whose normals is no surface nearby."""
    leaves, shares = owners[mesh.faces].max(axis=1), np.zeros(count)
    for leaf in np.unique(leaves[leaves >= 0]):
        corners = mesh.vertices[mesh.faces[leaves == leaf]].astype(np.float64)
        sides = corners - np.roll(corners, 1, axis=1)
        crosses = np.cross(sides[:, 0], sides[:, 1])
        doubled = np.linalg.norm(crosses, axis=1)
        total = np.cumsum(doubled)
        chosen = np.searchsorted(total, (np.arange(CHECKED_FACES) + 0.5) * (total[-1] / CHECKED_FACES))
        longest = np.linalg.norm(sides[chosen], axis=2).max(axis=1)
        ways = crosses[chosen] * (longest / np.maximum(doubled[chosen], 1e-300))[:, None]
        steps = np.concatenate([-FACE_REACH, [0.0], FACE_REACH])[:, None, None]
        points = corners[chosen].mean(axis=1) + steps * ways
        inside = values_at(tree.tape, points.reshape(-1, 3)).reshape(len(steps), -1) >= ISO
        shares[leaf] = (inside.all(axis=0) | ~inside.any(axis=0)).mean()
    return shares


class _Sides:
    """The vertices of a mesh by place and normal: which are on the side of a point of the surface."""

    def __init__(self, mesh: Mesh, reach: float) -> None:
        from scipy.spatial import cKDTree  # most meshes have no thin plates or walls

        self._mesh, self._reach = mesh, reach
        self._search = cKDTree(np.concatenate([mesh.vertices, reach * mesh.normals], axis=1))

    def have_vertex(self, places: Float64Array, normals: Float64Array, depths: Float64Array) -> BoolArray:
        """Return True for points whose side has a vertex nearby, no farther off the surface than a depth."""
        gaps, offsets = self._nearest(places, normals)
        return np.asarray(((gaps < self._reach) & (offsets < depths[:, None])).any(axis=1))

    def roughness(self, listed: IndexArray) -> Float64Array:
        """Return how far the nearest vertices of some vertices are off the surface, by the same measure."""
        gaps, offsets = self._nearest(self._mesh.vertices[listed], self._mesh.normals[listed])
        roughness: Float64Array = np.where(gaps < self._reach, offsets, 0.0).max(axis=1)
        return roughness

    def _nearest(
        self, places: Float64Array | Float32Array, normals: Float64Array | Float32Array
    ) -> tuple[Float64Array, Float64Array]:
        """Return distances of vertices near points with normals, and how far they are off the surface.

        A vertex on the same side has a similar normal, and lies in the plane between both normals.
        """
        mesh = self._mesh
        rows = np.concatenate([places, self._reach * normals], axis=1)
        gaps, nearest = self._search.query(rows, k=NEAREST_VERTICES)
        between = normals[:, None] + mesh.normals[nearest]
        between /= np.maximum(np.linalg.norm(between, axis=2, keepdims=True), 1e-30)
        return gaps, np.abs((between * (mesh.vertices[nearest] - places[:, None])).sum(axis=2))


def _without_vertices(tree: ImplicitModel, sides: _Sides, growth: _Growth) -> BoolArray:
    """Return the leaves that grew where the surface of a leaf has no vertices (n,)."""
    grown, leaves = growth.amounts != 0.0, list(runs_of_leaves(tree._program))
    lower, upper = leaf_boxes(growth.grown._program)
    failed = np.zeros(len(grown), bool)
    for number, (_, placed) in enumerate(leaves):
        beside = grown & ((lower <= upper[number]) & (upper >= lower[number])).all(axis=1)
        if not beside.any():
            continue
        points = surface_points(tree, placed, number)
        rows = gradients_at(tree.tape, points).astype(np.float64)
        visible = np.abs(rows[:, 0] - ISO) < MAX_FIELD_ERROR
        points, normals = points[visible], _outward(rows[visible])
        if len(points):
            found = sides.have_vertex(points, normals, np.full(len(points), np.inf))
            if found.mean() < LEAST_FOUND:
                failed[[number] if grown[number] else beside] = True
    return failed


def _outward(rows: Float64Array) -> Float64Array:
    """Return the normals at points with values and gradients (n, 4)."""
    lengths = np.linalg.norm(rows[:, 1:], axis=1, keepdims=True)
    normals: Float64Array = -rows[:, 1:] / np.maximum(lengths, 1e-300)
    return normals


def _without_other_side(
    tree: ImplicitModel, vertices: _Vertices, sides: _Sides, reach: float, sign: float
) -> BoolArray:
    """Return the vertices from which rays find sides of plates, walls or gaps that have no vertices.

    Rays go along normals, or against them.
    """
    mesh, device, tape = vertices.mesh, vertices.device, tree.tape
    whole, listed = tape.on(device), np.flatnonzero(vertices.moved)
    shortest = SHORTEST_RAY * float(np.abs(mesh.vertices).max(initial=0.0))
    rays = sign * mesh.normals[listed]
    found = wp.empty(len(listed), dtype=wp.float32, device=device)
    inputs = [on_device(rows, wp.vec3, device) for rows in (mesh.vertices[listed], rays)]
    inputs += [shortest, RAY_REACH * reach, whole.data, whole.span]
    launch(tape.instruction_set.kernel_for(find_other_sides), len(listed), inputs, [found], device)
    distances = found.numpy().astype(np.float64)
    hit = np.flatnonzero(distances < NO_SIDE)
    places = mesh.vertices[listed[hit]] + distances[hit, None] * rays[hit]
    normals = _outward(gradients_at(tape, places).astype(np.float64))
    opposed = -sign * (normals * rays[hit]).sum(axis=1) > OPPOSED
    depths = 0.5 * distances[hit] + ROUGHNESS * sides.roughness(listed[hit])
    there = sides.have_vertex(places, normals, depths)
    result = np.zeros(len(mesh.vertices), bool)
    result[listed[hit[opposed & ~there]]] = True
    return result
