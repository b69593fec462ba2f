"""Rays hit the surface where they should, never pass through it, and are checked."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from blobtree import Box, Cone, Node, Point, Prism, Repeat, Segment, Torus
from blobtree._typing import Float32Array, Float64Array
from blobtree.errors import InvalidPoints
from blobtree.tracing.ray_kernels import MAX_DISTANCE, box_interval, exit_distance, reciprocal
from blobtree.tracing.trace import trace
from blobtree.tracing.tree_cells import BLOCKS_ALONG, trace_tolerance, tracing_cells
from tests.blobtree.tracing.flat_trees import FLAT_TREES
from tests.blobtree.transpile.warp_functions import call
from tests.blobtree.trees import random_trees
from tests.oracles import blobtree as oracle
from tests.vectors import random_units, unit


def cast(tree: Node, origins: ArrayLike, directions: ArrayLike) -> Float32Array:
    return trace(tree, origins, directions)


def rays_through(rng: np.random.Generator, tree: Node, count: int) -> tuple[Float64Array, Float64Array]:
    """Origins around the tree's box, in float32's numbers, and directions toward places in it."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    centre, size = 0.5 * (lower + upper), np.linalg.norm(upper - lower)
    origins = (centre + size * random_units(rng, count)).astype(np.float32).astype(np.float64)
    return origins, unit(rng.uniform(lower, upper, (count, 3)) - origins)


def sphere_distance(origins: Float64Array, directions: Float64Array, radius: float) -> Float64Array:
    """Distance to a sphere about the origin, inf for a miss."""
    along = (origins * directions).sum(axis=1)
    beside = (origins**2).sum(axis=1) - along**2
    half = np.sqrt(np.maximum(radius**2 - beside, 0.0))
    return np.where((beside <= radius**2) & (-along + half >= 0.0), np.maximum(-along - half, 0.0), np.inf)


def depth_of(origins: Float64Array, directions: Float64Array) -> Float64Array:
    """Distance of whole rays from the origin."""
    along = (origins * directions).sum(axis=1)
    return np.asarray(np.sqrt((origins**2).sum(axis=1) - along**2))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_ball(scale: float) -> None:
    """All rays, grazing ones too: within the tolerance of the silhouette they may hit or miss."""
    ball = Point((0, 0, 0), radius=scale)
    rng = np.random.default_rng(0)
    origins, directions = rays_through(rng, ball, 20_000)
    beside = depth_of(origins, directions)
    grazing = np.concatenate([1.0 + rng.choice([-1, 1], 2000) * 10.0 ** rng.uniform(-5, -1, 2000)])
    aim = unit(np.cross(directions[:2000], rng.normal(size=(2000, 3)))) * grazing[:, None] * scale
    starts = (aim - 5.0 * scale * directions[:2000]).astype(np.float32).astype(np.float64)
    origins, directions = np.concatenate([origins, starts]), np.concatenate([directions, directions[:2000]])
    beside = depth_of(origins, directions)
    tolerance = trace_tolerance(ball.support)
    seen, expected = cast(ball, origins, directions), sphere_distance(origins, directions, scale)
    sure = np.abs(beside - scale) > 2.0 * tolerance
    np.testing.assert_array_equal(np.isfinite(seen[sure]), np.isfinite(expected[sure]))
    hit = np.isfinite(seen) & np.isfinite(expected)
    points = origins[hit] + seen[hit, None] * directions[hit]
    assert np.abs(np.linalg.norm(points, axis=1) - scale).max() <= 2.0 * tolerance
    steep = hit & (beside < 0.9 * scale)
    assert np.abs(seen[steep] - expected[steep]).max() <= 5.0 * tolerance


def test_a_capsule() -> None:
    """Every hit lies on the capsule, and a ray hits where it comes nearer to the axis than the radius."""
    start, end = np.array([-1.0, 0.2, 0.0]), np.array([0.8, -0.3, 0.5])
    capsule = Segment(tuple(start), tuple(end), radius=0.4)
    origins, directions = rays_through(np.random.default_rng(1), capsule, 1_500)

    def distance(points: Float64Array) -> Float64Array:
        axis = end - start
        share = np.clip((points - start) @ axis / (axis @ axis), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - start - share[..., None] * axis, axis=-1))

    seen = cast(capsule, origins, directions)
    along = np.linspace(0.0, 8.0, 1601)[:, None, None]
    nearest = distance(origins + along * directions).min(axis=0)  # coarse to 0.0025² / (2 · 0.4)
    sure = np.abs(nearest - 0.4) > 1e-3
    np.testing.assert_array_equal(np.isfinite(seen)[sure], (nearest < 0.4)[sure])
    hit = np.isfinite(seen)
    on_surface = distance(origins[hit] + seen[hit, None] * directions[hit])
    assert np.abs(on_surface - 0.4).max() <= 2.0 * trace_tolerance(capsule.support)


RAYS, STEPS = 40, 1500
FLAT_RAYS = 12


def checked_hits(
    tree: Node,
    origins: Float64Array,
    directions: Float64Array,
    *,
    reach: float | None = None,
    steps: int = STEPS,
) -> int:
    """Compare rays with dense marching in float64 up to `reach`; return the number of hits.

    They end at the first sample inside or before, and on the surface.
    """
    if reach is None:
        reach = 2.0 * float(np.linalg.norm(tree.support[1] - tree.support[0]))
    places = np.linspace(0.0, reach, steps)
    samples = origins[:, None] + places[:, None] * directions[:, None]
    inside = oracle.value(tree, samples.reshape(-1, 3)).reshape(len(origins), steps) > 0.5 + 1e-5
    first = np.where(inside.any(axis=1), places[inside.argmax(axis=1)], np.inf)
    seen = cast(tree, origins, directions)
    tolerance = trace_tolerance(tree.support)
    assert (seen <= first + 2.0 * tolerance).all()
    hit = np.isfinite(seen)
    points = origins[hit] + seen[hit, None] * directions[hit]
    steepest = 1.0 + np.linalg.norm(oracle.gradient(tree, points), axis=1)
    # two tolerances before the surface at most, or past it at an edge that the ray crosses
    assert (np.abs(oracle.value(tree, points) - 0.5) <= 4.0 * tolerance * steepest + 2e-5).all()
    return int(hit.sum())


@pytest.mark.slow_cases("0")
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_no_ray_passes_through_a_random_tree_unseen(seed: int) -> None:
    rng, trees = np.random.default_rng(seed), random_trees(seed=20 + seed, count=6, depth=3)
    assert sum(checked_hits(tree, *rays_through(rng, tree, RAYS)) for tree in trees) > 25


@pytest.mark.ordinary_cases("blended row", "mirrored row", "grid")
@pytest.mark.parametrize("name", FLAT_TREES)
def test_rays_through_many_copies_end_where_the_oracle_does(name: str) -> None:
    tree = FLAT_TREES[name]
    cells = tracing_cells(tree)
    assert max(cells.counts) > BLOCKS_ALONG
    rng = np.random.default_rng(0)
    places = rng.choice(np.argwhere(cells.blocks.reshape(cells.counts) >= 0), FLAT_RAYS)
    targets = cells.lower + cells.block_size * rng.uniform(places, places + 1.0)
    directions = random_units(rng, FLAT_RAYS)
    origins = (targets - 2.0 * directions).astype(np.float32).astype(np.float64)
    assert checked_hits(tree, origins, directions, reach=4.0, steps=200) > FLAT_RAYS // 4


@pytest.mark.slow_cases("400.0")
@pytest.mark.parametrize("degrees", [120.0, 400.0])
def test_no_ray_hits_where_only_the_bound_is_steep(degrees: float) -> None:
    """Behind nested warps bounds exceed slopes by far; each hit is on the surface all the same."""
    rod = Segment((0.3, 0, -0.5), (0.3, 0, 0.5), radius=0.3)
    tree = rod.twist(degrees).rotate((1, 0, 0), 90).twist(degrees)
    assert checked_hits(tree, *rays_through(np.random.default_rng(0), tree, 400)) > 35


def test_raycast_returns_position_normal_and_color() -> None:
    """Distances are `trace`'s; place, normal and colour are the field's at the hit."""
    several = 0
    for tree in random_trees(seed=40, count=6, depth=3):
        origins, directions = rays_through(np.random.default_rng(4), tree, 200)
        hits = tree.raycast(origins, 2.0 * directions)
        np.testing.assert_array_equal(hits.distances, cast(tree, origins, directions))
        assert len(hits) == 200
        np.testing.assert_array_equal(hits.hit, np.isfinite(hits.distances))
        where = hits.hit
        for array in (hits.positions, hits.normals, hits.colors):
            assert array.shape == (200, 3)
            assert array.dtype == np.float32
            assert (array[~where] == 0.0).all()
        places = origins[where] + hits.distances[where, None] * directions[where]
        size = float(np.linalg.norm(tree.support[1] - tree.support[0]))
        np.testing.assert_allclose(hits.positions[where], places, atol=1e-5 * size)
        field = oracle.evaluate(tree, hits.positions[where].astype(np.float64))
        smooth = field.margin > 2e-3
        several += int(smooth.sum())
        normals = -unit(oracle.gradient(tree, hits.positions[where][smooth].astype(np.float64)))
        np.testing.assert_allclose(hits.normals[where][smooth], normals, atol=1e-3)
        colors = tree.colors(hits.positions[where][smooth])
        np.testing.assert_allclose(hits.colors[where][smooth], colors, atol=1e-3)
    assert several > 100


# -- unusual rays ------------------------------------------------------------------------

BALL = Point((0, 0, 0), radius=1.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("width", [None, 0.2])
def test_rays_end_on_the_faces_of_a_sharp_box_at_all_angles(seed: int, width: float | None) -> None:
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.5, 2.0, 3)
    origins = 6.0 * random_units(rng, 2000)
    directions = rng.uniform(-1.2, 1.2, (2000, 3)) * half - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    sides = np.stack([(sign * half - origins) / directions for sign in (-1.0, 1.0)])
    enter, leave = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
    box = Box((0, 0, 0), tuple((2.0 * half).tolist()), radius=0, width=width)
    distances = box.raycast(origins, directions).distances.astype(np.float64)
    hit = np.isfinite(distances)
    clear = np.abs(leave - enter) > 1e-3  # others pass by an edge
    np.testing.assert_array_equal(hit[clear], (enter < leave)[clear])
    rows = np.flatnonzero(hit & clear)
    points = origins[rows] + distances[rows, None] * directions[rows]
    outside = (np.abs(points) - half).max(axis=1)
    assert (np.abs(outside) < 2e-6).mean() > 0.998  # without a step along the ray 0.85
    assert np.quantile(np.abs(distances[rows] - enter[rows]), 0.998) < 1e-4


FLAT_SOLIDS: dict[str, Node] = {
    "difference": Box((0, 0, 0), (2, 2, 2), radius=0) - Point((1, 1, 1), radius=0.8),
    "union": Box((0, 0, 0), (2, 0.5, 0.5), radius=0) | Box((0, 0, 0), (0.5, 2, 0.5), radius=0),
    "intersection": Box((0, 0, 0), (2, 2, 2), radius=0) & Point((0, 0, 0), radius=1.3),
    "turned": Box((0, 0, 0), (2, 1, 0.4), radius=0).rotate((1, 2, 3), 40),
    "scaled": Box((0, 0, 0), (2, 2, 2), radius=0).scale((1, 0.2, 3)),
    "prism": Prism(((-1, -0.5, 0.5), (1, -0.5, 0.5), (0, -0.5, 1.2)), 1.0),
    "row": Repeat(Box((0, 0, 0), (1, 1, 1), radius=0), (1.5, 0, 0), 6),
    "torus": Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.3),
}


@pytest.mark.parametrize("name", FLAT_SOLIDS)
def test_grazing_rays_end_on_other_solids_too(name: str) -> None:
    solid, rng = FLAT_SOLIDS[name], np.random.default_rng(7)
    lower, upper = (corner.astype(np.float64) for corner in solid.bounds)
    size = float(np.linalg.norm(upper - lower))
    origins = 0.5 * (lower + upper) + 1.5 * size * random_units(rng, 3000)
    targets = lower + rng.uniform(-0.1, 1.1, (3000, 3)) * (upper - lower)
    distances = solid.raycast(origins, targets - origins).distances
    hit = np.isfinite(distances)
    points = (origins + distances[:, None] * unit(targets - origins))[hit]
    slopes = np.linalg.norm(solid.gradient(points), axis=1)
    gaps = np.abs(solid(points) - 0.5) / slopes
    assert (gaps < 1e-6 * size).mean() > 0.995  # without a step along the ray 0.79 to 0.96


def test_a_ray_that_starts_inside_hits_at_once() -> None:
    inside = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, -0.9]])
    assert (cast(BALL, inside, [[1, 0, 0], [0, 1, 1], [0, 0, 3]]) == 0.0).all()


def test_a_ray_that_starts_just_inside_hits_at_once_whatever_its_direction() -> None:
    starts = [[0.999, 0, 0], [0, 0.999, 0]]
    assert (cast(BALL, starts, [[1, 0, 0], [1, 1, 0]]) == 0.0).all()


def test_a_ray_that_points_away_misses() -> None:
    assert np.isinf(cast(BALL, np.diag([1.01, 5.0, 2.5]), np.eye(3))).all()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rays_along_an_axis(axis: int, sign: float) -> None:
    direction = np.zeros(3)
    direction[axis] = sign
    aside = np.roll([0.0, 0.6, 0.0], axis)
    origins = np.array([-5.0 * direction, aside - 5.0 * direction, 2.0 * aside - 5.0 * direction])
    np.testing.assert_allclose(cast(BALL, origins, [direction] * 3), [4.0, 4.2, np.inf], atol=1e-4)


@pytest.mark.parametrize("zero", [0.0, -0.0, 1e-38, -1e-45])
def test_a_direction_that_is_almost_along_an_axis(zero: float) -> None:
    np.testing.assert_allclose(cast(BALL, [[-5, 0, 0]], [[1.0, zero, zero]]), [4.0], atol=1e-4)


def test_rays_inside_the_faces_of_the_box() -> None:
    lower, upper = BALL.support
    for face in (lower[2], upper[2], np.nextafter(upper[2], np.float32(9))):
        assert np.isinf(
            cast(BALL, [[-5, 0, face], [0, 5, face], [0, 0, face]], [[1, 0, 0], [0, -1, 0], [1, 1, 0]])
        ).all()


def test_rays_that_touch_a_corner_or_an_edge_of_the_box_miss() -> None:
    """Nothing lies there, however short the way through the box is."""
    lower, upper = (corner.astype(np.float64) for corner in BALL.support)
    corners = np.array([[(lower, upper)[i][0], (lower, upper)[j][1], (lower, upper)[k][2]]
                        for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip
    rng = np.random.default_rng(2)
    for shift in (0.0, 1e-7, -1e-7, 1e-3):
        targets = np.repeat(corners * (1.0 + shift), 50, axis=0)
        directions = unit(np.cross(targets, rng.normal(size=targets.shape)))
        assert np.isinf(cast(BALL, targets - 3.0 * directions, directions)).all()


def test_a_ray_with_the_box_behind_it_misses() -> None:
    assert np.isinf(cast(BALL, [[10, 0, 0], [-10, 9, 0]], [[1, 0, 0], [1, 0, 0]])).all()


def test_the_length_of_a_direction_does_not_matter() -> None:
    lengths = np.array([1e-18, 1e-3, 1.0, 1e6, 1e18])
    np.testing.assert_allclose(
        cast(BALL, [[-5.0, 0.0, 0.0]] * 5, lengths[:, None] * [1.0, 0, 0]), 4.0, atol=1e-4
    )


@pytest.mark.parametrize("away", [1e2, 1e4, 1e6])
def test_distant_origins(away: float) -> None:
    seen = cast(BALL, [[-away, 0, 0], [-away, 0, 5]], [[1, 0, 0], [1, 0, 0]])
    assert seen[0] == pytest.approx(away - 1.0, abs=1e-4 + 1e-6 * away)
    assert np.isinf(seen[1])


def test_a_model_far_from_the_origin() -> None:
    there = BALL.translate((1000, -2000, 3000))
    np.testing.assert_allclose(cast(there, [[995, -2000, 3000]], [[1, 0, 0]]), [4.0], atol=2e-3)


def test_an_empty_model_is_missed() -> None:
    nothing = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    assert np.isinf(cast(nothing, [[-5, 0, 0], [0, 0, 0]], [[1, 0, 0], [1, 0, 0]])).all()


def test_no_rays_give_no_hits() -> None:
    assert cast(BALL, np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
    assert len(BALL.raycast(np.zeros((0, 3)), np.zeros((0, 3)))) == 0


@pytest.mark.parametrize("length", [1e-44, 1e-30, 1e-22, 1e-18, 1e17])
def test_tiny_and_huge_directions_are_directions(length: float) -> None:
    directions = np.float32(length) * np.array([[0, 0, -1], [0, 1, -1]], np.float32)
    starts = [[0, 0, 5.0], [0, -4.5, 5]]
    expected = cast(BALL, starts, np.sign(directions))
    np.testing.assert_array_equal(cast(BALL, starts, directions), expected)


def test_invalid_rays_are_refused() -> None:
    with pytest.raises(InvalidPoints, match="directions: expected vectors with a length, got a zero vector"):
        cast(BALL, [[0, 0, 5], [0, 0, 5]], [[0, 0, 1], [0, 0, 0]])
    with pytest.raises(InvalidPoints, match="directions: expected one per origin, 2, got 1"):
        cast(BALL, [[0, 0, 5], [0, 0, 5]], [[0, 0, 1]])
    with pytest.raises(InvalidPoints, match="finite"):
        cast(BALL, [[0.0, 0.0, np.nan]], [[0, 0, 1]])
    with pytest.raises(InvalidPoints, match="finite"):
        cast(BALL, [[0, 0, 5]], [[0, 0, np.inf]])


def test_box_intervals() -> None:
    rng = np.random.default_rng(3)
    origins, directions = rng.uniform(-3, 3, (1000, 3)), random_units(rng, 1000)
    directions[::5, 0] = 0.0
    lower, upper = np.array([-1.0, -0.5, 0.0]), np.array([1.0, 2.0, 0.5])
    span = call(box_interval, origin=origins, direction=directions, lower=lower, upper=upper)
    places = np.linspace(0.0, 8.0, 1001)
    points = origins[:, None] + places[:, None] * directions[:, None]
    inside = ((points >= lower) & (points <= upper)).all(axis=2)
    claimed = (places >= span[:, :1]) & (places <= span[:, 1:])
    near = (np.abs(places - span[:, :1]) < 1e-5) | (np.abs(places - span[:, 1:]) < 1e-5)
    np.testing.assert_array_equal(claimed | near, inside | near)
    assert (span[:, 0] >= 0.0).all()


def test_exit_distances() -> None:
    rng = np.random.default_rng(4)
    lower, upper = np.array([-1.0, -0.5, 0.0]), np.array([1.0, 2.0, 0.5])
    origins, directions = rng.uniform(lower, upper, (1000, 3)), random_units(rng, 1000)
    directions[::5, 0] = 0.0
    directions[1::50] = [0.0, -1.0, 0.0]
    inverse = call(reciprocal, direction=directions)
    leave = call(exit_distance, origin=origins, inverse=inverse, lower=lower, upper=upper)
    span = call(box_interval, origin=origins, direction=directions, lower=lower, upper=upper)
    np.testing.assert_allclose(leave, span[:, 1], rtol=1e-4, atol=1e-6)


def test_reciprocals_are_finite() -> None:
    seen = call(reciprocal, direction=np.array([[0.0, -0.0, 1e-45], [-1e-38, 2.0, -0.5]], np.float32))
    np.testing.assert_allclose(seen, [[0.0, 0.0, MAX_DISTANCE], [-MAX_DISTANCE, 0.5, -2.0]], rtol=1e-6)


def test_rays_do_not_hit_beside_steep_bands() -> None:
    """A taper in a thin band: one step along its gradient seems to reach the surface, and does not."""
    cone = Cone((-0.87, -0.7355, 0.682), (-1.135, -0.1557, 0.441), radius=0.483, end_radius=0.3894)
    tree = cone.taper(2.06, (0.04784, 0.04863)).stretch(0.5693, (0.013292, 0.112812))
    start = np.array([2.159329, -6.895301, -3.779844]) + np.random.default_rng(0).normal(size=(400, 3)) * 0.02
    hits = tree.raycast(start, np.tile([[-0.480698, 0.761076, 0.435537]], (400, 1)))
    np.testing.assert_allclose(tree(hits.positions[hits.hit]), 0.5, atol=1e-3)
