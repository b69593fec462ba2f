from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from blobtree import Node, Point
from blobtree._typing import BoolArray, Float32Array, Float64Array
from decals import Decals, Relaxation, Scene, TreeObject, measure, scatter
from decals.errors import ImplicitDecalsError, InvalidScattering
from decals.scattering import PaintedImage, Planar, Zone, Zones
from decals.scattering.appearance import Appearance, image_shares
from decals.scenes.cover import fitting_camera
from decals.scenes.objects import as_objects
from decals.scenes.scene import as_images
from decals.surfaces import as_surface
from tests.decals.meshes import box, plane, sphere

BALL = sphere()
BLOB = Point((0, 0, 0), radius=1.0)
EDGE = 0.3
"""Height of the border between the zones of a ball."""


def rows_of(points: Any) -> Float32Array:
    return np.array(points, np.float32)


def above(points: Float32Array) -> BoolArray:
    return points[:, 2] > EDGE


def everywhere(points: Float32Array) -> BoolArray:
    return np.ones(len(points), np.bool_)


def unit_points(count: int, seed: int = 0) -> Float32Array:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return rows_of(points / np.linalg.norm(points, axis=1, keepdims=True))


def depth_below(points: Float32Array) -> Float64Array:
    """Distance of points of the unit ball from the circle at EDGE, negative above it."""
    across = np.hypot(points[:, 0], points[:, 1]).astype(np.float64)
    distances = np.hypot(points[:, 2] - EDGE, across - np.sqrt(1 - EDGE**2))
    depths: Float64Array = np.where(points[:, 2] > EDGE, -distances, distances)
    return depths


def ramp(depths: Float64Array, width: float) -> Float64Array:
    t = np.clip(0.5 + depths / width, 0, 1)
    shares: Float64Array = t**2 * (3 - 2 * t)
    return shares


def bytes_of(decals: Decals) -> list[bytes]:
    names = ("positions", "normals", "tangents", "radii", "images")
    return [getattr(decals, name).tobytes() for name in names]


# -- where zones are -------------------------------------------------------------------------------------


def test_the_first_zone_around_a_point_counts() -> None:
    heights = BALL.vertices[:, 2]
    left = PaintedImage(np.array([[1.0, 0.0]]), Planar((-1, -1, 0), (2, 0, 0), (0, 2, 0)))
    zones = Zones(
        Zone(lambda points: points[:, 1] > 0.6),
        Zone(Point((0, 0, 1), radius=0.7)),
        Zone(heights < -0.5),
        Zone(left),
    ).placed_on(BALL)
    points = BALL.sample(4000, seed=1)[0]
    x, y, z = points.astype(np.float64).T
    # flags at vertices are interpolated, so the border lies within an edge of the mesh
    clear = (np.abs(z + 0.5) > 0.1) & (np.abs(np.hypot(np.hypot(x, y), z - 1) - 0.7) > 1e-3)
    inside = [y > 0.6, np.hypot(np.hypot(x, y), z - 1) < 0.7, z < -0.5, x < 0]
    expected = np.select(inside, [0, 1, 2, 3], -1)
    assert set(expected[clear]) == {-1, 0, 1, 2, 3}
    assert np.array_equal(zones.numbers(points)[clear], expected[clear])
    assert np.array_equal(zones.mask(points), zones.numbers(points) >= 0)


@pytest.mark.parametrize("join", ["sum", "union"])
def test_a_node_of_the_model_is_the_part_that_it_makes(join: str) -> None:
    first, second = Point((-0.6, 0, 0), radius=1.0), Point((0.6, 0, 0), radius=1.0)
    tree: Node = first + second if join == "sum" else first | second
    points = as_surface(tree).sample(500, seed=1)[0]
    clear = np.abs(points[:, 0]) > 1e-3
    model = TreeObject("pair", tree, names={(1,): "right"}, labels=("both",))
    cases: Any = ((tree, (first, second)), (model, (first, "right")), (model, (first, "both")))
    for host, places in cases:
        numbers = Zones(*(Zone(where) for where in places)).placed_on(host).numbers(points)
        assert np.array_equal(numbers[clear], (points[clear, 0] > 0).astype(int))


def test_a_hole_belongs_to_the_tool_that_makes_it() -> None:
    tool = Point((0, 0, 1), radius=0.6)
    tree = BLOB - tool
    numbers = Zones(Zone(tool), Zone(everywhere)).placed_on(tree).numbers
    points = as_surface(tree).sample(500, seed=1)[0]
    in_hole = np.abs(np.linalg.norm(points - [0, 0, 1], axis=1) - 0.6) < 0.01
    outside = np.abs(np.linalg.norm(points, axis=1) - 1) < 1e-3
    assert (numbers(points)[in_hole & ~outside] == 0).all()
    assert (numbers(points)[outside & ~in_hole] == 1).all()
    assert in_hole.sum() > 20


def test_named_objects_of_several_models() -> None:
    models = [
        TreeObject("large", BLOB),
        TreeObject("small", Point((3, 0, 0), radius=0.5), labels=("moon",)),
    ]
    points = np.concatenate([unit_points(50), models[1].surface.sample(50, seed=0)[0]])
    for name in ("small", "moon"):
        numbers = Zones(Zone(name), Zone("large")).placed_on(models).numbers(points)
        assert np.array_equal(numbers, np.repeat([1, 0], 50))


@pytest.mark.parametrize("kind", ["values", "colors", "faces", "flags", "bytes"])
def test_painted_meshes(kind: str) -> None:
    mesh = pv.Sphere(theta_resolution=40, phi_resolution=40)
    bright = mesh.points[:, 2] > 0
    middles = mesh.cell_centers().points[:, 2] > 0
    painted: Any = {
        "values": bright.astype(float),
        "colors": np.where(bright[:, None], [1.0, 0.9, 0.4], [0.1, 0.0, 0.3]),
        "faces": middles,
        "flags": bright,
        "bytes": np.where(bright[:, None], np.uint8(255), np.array([255, 255, 255, 9], np.uint8)),
    }[kind]
    (mesh.cell_data if kind == "faces" else mesh.point_data)["paint"] = painted
    points = as_surface(mesh).sample(400, seed=2)[0]
    clear = np.abs(points[:, 2]) > 0.05
    for where in ("paint", painted):
        numbers = Zones(Zone(where), Zone(everywhere)).placed_on(mesh).numbers(points)
        assert np.array_equal(numbers[clear] == 0, points[clear, 2] > 0)


def test_parts_of_a_file_and_blocks(tmp_path: Path) -> None:
    cubes = {"left": pv.Cube(), "right": pv.Cube(center=(3, 0, 0))}
    rows = []
    for number, (name, cube) in enumerate(cubes.items()):
        rows += [f"o {name}", f"g side {name}", f"usemtl {name}-paint"]
        rows += [f"v {x} {y} {z}" for x, y, z in cube.clean().points]
        rows += [
            "f " + " ".join(str(8 * number + 1 + k) for k in face) for face in cube.clean().regular_faces
        ]
    path = tmp_path / "cubes.obj"
    path.write_text("\n".join(rows))
    for model in (path, str(path), pv.MultiBlock(cubes)):
        names = ["right", *(["side right", "right-paint"] if model is path else [])]
        points = as_surface(model).sample(100, seed=0)[0]
        for name in names:
            zones = Zones(Zone(name), Zone("left")).placed_on(model)
            assert np.array_equal(zones.numbers(points) == 0, points[:, 0] > 1.5)


def obj_of_triangles(count: int, more: str) -> str:
    """Text of an OBJ file of separate triangles in a row, each a group of its own, and other lines."""
    rows = [f"v {k} 0 0\nv {k + 0.9} 0 0\nv {k} 1 0" for k in range(count)]
    rows += [f"g part{k}\nf {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(count)]
    return "\n".join([*rows, more])


def test_parts_without_area_do_not_hinder_others(tmp_path: Path) -> None:
    path = tmp_path / "row.obj"
    path.write_text(obj_of_triangles(3, "g flat\nf 1 1 2\ng lines\nf 1 2\ng part0\nf 5 7 9"))
    points = rows_of([[0.2, 0.2, 0], [1.2, 0.2, 0], [1.99, 0.3, 0], [2.2, 0.2, 0]])
    numbers = Zones(Zone("part2"), Zone("part0")).placed_on(path).numbers(points)
    assert numbers.tolist() == [1, -1, 1, 0]
    with pytest.raises(InvalidScattering, match="expected visible area in zone 1"):
        Zones(Zone("flat")).placed_on(path)
    with pytest.raises(InvalidScattering, match=r"which have 'flat', 'part0', .*; got 'lines'"):
        Zones(Zone("lines")).placed_on(path)
    others = {"none": None, "empty": pv.PolyData(), "point": pv.PolyData([[0.0, 0, 0]]), "line": pv.Line()}
    cubes = pv.MultiBlock({**others, "left": pv.Cube(), "ball": pv.Sphere(center=(3, 0, 0))})
    assert Zones(Zone("left")).placed_on(cubes).numbers(rows_of([[0.5, 0.5, 0.5]])).tolist() == [0]


def test_each_of_many_groups_is_a_zone(tmp_path: Path) -> None:
    path = tmp_path / "row.obj"
    path.write_text(obj_of_triangles(40, ""))
    zones = Zones(*(Zone(f"part{k}") for k in range(40))).placed_on(path)
    points = rows_of([[k + 0.2, 0.2, 0] for k in range(40)])
    assert np.array_equal(zones.numbers(points), np.arange(40))


def test_names_are_those_that_the_user_gave() -> None:
    mesh = pv.Plane(i_resolution=3, j_resolution=3)
    mesh.clear_data()
    mesh.point_data["paint"] = np.full(mesh.n_points, np.nan)
    with pytest.raises(InvalidScattering, match=r"which have 'paint'; got 'pain'"):
        Zones(Zone("pain")).placed_on(mesh)
    with pytest.raises(InvalidScattering, match="array 'paint': flags: expected"):
        Zones(Zone("paint")).placed_on(mesh)


# -- borders -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("host", ["mesh", "tree"])
@pytest.mark.parametrize("width", [0.4, 0.1])
def test_shares_follow_the_ramp(host: str, width: float) -> None:
    model: Any = sphere(level=5) if host == "mesh" else BLOB
    zones = Zones(Zone(above), Zone(everywhere), border_width=width).placed_on(model)
    points = unit_points(3000)
    expected = ramp(depth_below(points), width)
    shares = zones.shares(points)
    errors = np.abs(shares[:, 1] - expected)
    assert errors.max() < 0.1  # a chord of the border's points, right beside it
    assert errors[(expected > 0) & (expected < 1)].mean() < 0.01
    assert shares.sum(axis=1) == pytest.approx(np.ones(3000))


def test_shares_of_three_zones_sum_to_one_and_others_have_none() -> None:
    zones = Zones(
        Zone(lambda points: (points[:, 0] > 0) & (points[:, 1] > 0)),
        Zone(lambda points: points[:, 0] > 0),
        Zone(lambda points: points[:, 1] > -0.3),
        border_width=0.3,
    ).placed_on(plane(2.0))
    points = np.random.default_rng(0).uniform(-1, 1, (500, 3)).astype(np.float32) * [1, 1, 0]
    shares = zones.shares(points.astype(np.float32))
    nowhere = (points[:, 0] <= 0) & (points[:, 1] <= -0.3)
    assert shares[~nowhere].sum(axis=1) == pytest.approx(np.ones((~nowhere).sum()))
    assert not shares[nowhere].any()
    mixed = zones.shares(rows_of([[0.0, 0.0, 0.0], [0.7, 0.0, 0.0], [0.7, 0.7, 0.0]]))
    assert (mixed[0] > 0.2).all()
    assert mixed[1:] == pytest.approx(np.array([[0.5, 0.5, 0], [1, 0, 0]]), abs=0.05)


def test_a_border_on_one_side_of_a_plate_does_not_act_on_the_other() -> None:
    plate = box((2.0, 2.0, 0.02))
    zones = Zones(
        Zone(lambda points: (points[:, 2] > 0) & (points[:, 0] > 0)), Zone(everywhere), border_width=0.4
    ).placed_on(plate)
    shares = zones.shares(rows_of([[0.01, 0, 0.01], [0.01, 0, -0.01]]))
    assert shares[0] == pytest.approx([0.5, 0.5], abs=0.1)
    assert shares[1].tolist() == [0.0, 1.0]


def test_decals_of_a_soft_border_are_drawn_by_the_shares() -> None:
    width = 0.5
    zones = Zones(Zone(above), Zone(everywhere, factor=2.0), border_width=width).placed_on(BLOB)
    points = unit_points(20_000)
    expected = ramp(depth_below(points), width)
    (_, first), (style, second), (_, nowhere) = zones.styles(Appearance(), points, seed=1)
    assert style.factor == 2.0
    assert len(nowhere) == 0
    assert len(first) + len(second) == len(points)
    drawn = np.zeros(len(points))
    drawn[second] = 1.0
    for low in np.arange(0.0, 1.0, 0.1):
        rows = (expected >= low) & (expected <= low + 0.1)
        error = 4 * np.sqrt(0.25 / rows.sum()) if 0 < low < 0.9 else 0.02
        assert drawn[rows].mean() == pytest.approx(expected[rows].mean(), abs=error)
    assert np.array_equal(zones.styles(Appearance(), points, seed=1)[0][1], first)
    assert not np.array_equal(zones.styles(Appearance(), points, seed=2)[0][1], first)


@pytest.mark.slow  # 7 s
def test_a_border_far_finer_than_the_model_takes_no_longer() -> None:
    zones = Zones(Zone(above), Zone(everywhere), border_width=1e-9).placed_on(BALL)
    assert zones.shares(rows_of([[0, 0, 1], [0, 0, -1]])).tolist() == [[1.0, 0.0], [0.0, 1.0]]


@pytest.mark.slow_cases("mesh-9.0", "tree-1.0")
@pytest.mark.parametrize("density", [1.0, 9.0])
@pytest.mark.parametrize("host", ["mesh", "tree"])
def test_decals_across_a_border_touch_as_evenly_as_within(host: str, density: float) -> None:
    model: Any = BALL if host == "mesh" else BLOB
    zones = Zones(Zone(above, density=density, images=[1]), Zone(everywhere, images=[0]))
    decals = scatter(model, count=600, zones=zones)
    upper = decals.images == 1
    assert np.array_equal(upper, above(decals.positions))
    mass = 2 * np.pi * (density * (1 - EDGE) + 1 + EDGE)
    spacings = np.sqrt(2 / np.sqrt(3) * mass / 600) / np.where(upper, np.sqrt(density), 1.0)
    distances, rows = cKDTree(decals.positions).query(decals.positions, k=7)
    pairs = distances[:, 1:] / (0.5 * (spacings[:, None] + spacings[rows[:, 1:]]))
    crossing = (upper[rows[:, 1:]] != upper[:, None])[:, 0]
    nearest = pairs.min(axis=1)
    assert crossing.sum() >= 5
    assert nearest[crossing].min() > nearest[~crossing].min() - 0.08
    assert nearest[crossing].mean() == pytest.approx(nearest[~crossing].mean(), abs=0.05)
    objects = as_objects([model])
    images = as_images(["scale", "tile"])
    scene = Scene(objects=objects, camera=fitting_camera(objects), decals=decals, images=images)
    measured = measure(scene, samples=30_000)
    assert measured.coverage == 1.0
    assert measured.folded == 0.0


# -- decals of zones ---------------------------------------------------------------------------------------


def test_counts_follow_density_times_area() -> None:
    decals = scatter(BALL, count=400, zones=Zones(Zone(above, density=5.0), Zone(everywhere)))
    share = 5 * (1 - EDGE) / (5 * (1 - EDGE) + 1 + EDGE)
    assert above(decals.positions).mean() == pytest.approx(share, abs=0.015)


def test_spacings_set_the_count_and_the_radii() -> None:
    wide, narrow = 0.4, 0.2
    decals = scatter(BALL, zones=Zones(Zone(above, spacing=narrow), Zone(everywhere, spacing=wide)))
    expected = 2 / np.sqrt(3) * 2 * np.pi * ((1 - EDGE) / narrow**2 + (1 + EDGE) / wide**2)
    assert len(decals) == pytest.approx(expected, rel=0.02)
    upper, inner = above(decals.positions), np.abs(depth_below(decals.positions)) > 0.4
    for rows, spacing in ((upper & inner, narrow), (~upper & inner, wide)):
        assert np.median(decals.radii[rows]) == pytest.approx(0.6 * spacing, rel=0.15)


def test_densities_vary_within_zones_and_multiply() -> None:
    zone = Zone(everywhere, density=lambda points: 2.0 + (points[:, 0] > 0))
    zones = Zones(Zone(above), zone).placed_on(BALL, density=lambda points: 4.0 * np.ones(len(points)))
    assert zones.density is not None
    values = zones.density(rows_of([[0.5, 0, 0.8], [1, 0, 0], [-1, 0, 0]]))
    assert values == pytest.approx(np.array([4.0, 12.0, 8.0]))
    assert Zones(Zone(above), Zone(everywhere, density=1)).placed_on(BALL).density is None
    masked = Zones(Zone(above), zone).placed_on(BALL, mask=lambda points: points[:, 0] > 0)
    assert masked.numbers(rows_of([[0.5, 0, 0.8], [1, 0, 0], [-1, 0, 0]])).tolist() == [0, 1, -1]


def test_zones_have_their_own_looks_and_the_rest_from_scatter() -> None:
    zones = Zones(
        Zone(above, factor=2.0, direction=(0, 0, 1), images=[3, 5], weights=[1, 3]),
        Zone(lambda points: points[:, 2] < -EDGE, choice="size"),
        Zone(everywhere, direction=lambda points: np.tile([0.0, 1.0, 0.0], (len(points), 1))),
    )
    options: Any = {"count": 300, "direction": (1, 0, 0), "images": 2, "sizing": "touching"}
    decals = scatter(BALL, zones=zones, factor=0.5, **options)
    plain = scatter(BALL, **options)
    top, low = above(decals.positions), decals.positions[:, 2] < -EDGE
    middle = ~top & ~low
    assert np.bincount(decals.images[top], minlength=6)[[0, 1, 2, 4]].tolist() == [0, 0, 0, 0]
    assert (decals.images[top] == 5).mean() == pytest.approx(0.75, abs=0.15)
    assert set(decals.images[~top]) == {0, 1}
    assert decals.radii[low & (decals.images == 0)].max() <= decals.radii[low & (decals.images == 1)].min()
    for rows, axis in ((top, [0, 0, 1]), (low, [1, 0, 0]), (middle, [0, 1, 0])):
        tangential = axis - (decals.normals[rows] @ np.array(axis))[:, None] * decals.normals[rows]
        tangential /= np.linalg.norm(tangential, axis=1, keepdims=True)
        assert decals.tangents[rows] == pytest.approx(tangential, abs=1e-4)
    assert np.median(decals.radii[top]) == pytest.approx(np.median(plain.radii), rel=0.1)
    assert np.median(decals.radii[low]) == pytest.approx(0.5 * np.median(plain.radii), rel=0.1)


def test_numbers_of_images_stand_for_shares() -> None:
    assert image_shares([2, 0], [1, 3]).tolist() == [0.75, 0.0, 0.25]
    assert image_shares((4,), None).tolist() == [0, 0, 0, 0, 1]
    for wrong in ([], [1, 1], [-1], [0.5], ["a"], "ab", [True]):
        with pytest.raises(InvalidScattering, match="images: expected"):
            image_shares(wrong, None)  # type: ignore[arg-type]  # what the test is about


@pytest.mark.parametrize("width", [0.0, 0.3])
def test_the_seed_sets_the_bytes(width: float) -> None:
    zones = Zones(Zone(above, density=2.0, images=[1]), Zone(everywhere), border_width=width)
    first, again, other = (scatter(BALL, count=60, zones=zones, seed=seed) for seed in (3, 3, 4))
    assert bytes_of(first) == bytes_of(again)
    assert first.positions.tobytes() != other.positions.tobytes()


def test_zones_step_by_step() -> None:
    zones = Zones(Zone(above, density=3.0, images=[2]), Zone(everywhere)).placed_on(BALL)
    relaxation = Relaxation(BALL, count=80, iterations=20, density=zones.density, mask=zones.mask)
    relaxation.run()
    decals = relaxation.to_decals(zones=zones)
    assert np.array_equal(decals.images == 2, above(decals.positions))


def test_fixed_decals_outside_all_zones_have_the_looks_of_the_call() -> None:
    zones = Zones(Zone(above, images=[1]))
    decals = scatter(BALL, count=20, zones=zones, fixed=[(0, 0, -1)], images=[4])
    assert decals.images[decals.positions[:, 2] < -0.9].tolist() == [4]
    assert set(decals.images[decals.positions[:, 2] > EDGE]) == {1}
    assert len(decals) == 20


# -- what cannot be ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("zones", "message"),
    [
        (lambda: Zones(), "at least one zone"),
        (lambda: Zones(above), "zones: expected a Zone"),  # type: ignore[arg-type]
        (lambda: Zones(Zone(above, spacing=1.0), Zone(above)), "spacing of all zones or of none"),
        (lambda: Zones(Zone(above), border_width=-1.0), "border_width: expected"),
        (lambda: Zones(Zone(above), border_width=np.nan), "border_width: expected"),
        (lambda: Zone(above, density=0.0), "density of a zone: expected"),
        (lambda: Zone(above, density=np.nan), "density of a zone: expected"),
        (lambda: Zone(above, spacing="a"), "spacing of a zone: expected"),  # type: ignore[arg-type]
        (lambda: Zone(above, factor=None), "factor of a zone: expected"),  # type: ignore[arg-type]
        (lambda: Zone(above, density=1.0, spacing=1.0), "density or a spacing"),
        (lambda: Zone(above, images=[]), "images: expected"),
        (lambda: Zone(above, images=2, weights=[1]), "weights: expected"),
        (lambda: Zone(above, choice="taste"), "choice: expected"),
        (lambda: Zone(above, direction=(0, 0, 0)), "direction: expected"),
    ],
)
def test_impossible_zones_are_refused(zones: Any, message: str) -> None:
    with pytest.raises(InvalidScattering, match=message):
        zones()


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("tail", "where of zone 2: expected a name of the models, which have none; got 'tail'"),
        ([True, False], "where of zone 2: flags: expected"),
        (np.full(2562, np.nan), "where of zone 2: flags: expected .* vertices, got others"),
        (np.full((2562, 3), 2.0), "where of zone 2: expected floats from 0 to 1"),
        (np.full((2562, 2), 0.5), r"where of zone 2: flags: .* got shape \[2562, 2\]"),
        (None, "where of zone 2: expected a mask, a PaintedImage, a BlobTree, a name or values, got None"),
        (TreeObject("ball", BLOB), "a name or values, got a TreeObject"),
        (lambda points: points, "where of zone 2: expected shape"),
        (lambda points: np.full(len(points), np.nan), "where of zone 2: expected finite"),
        (lambda points: 1 / 0, "where of zone 2: expected numbers from the function"),
        (lambda points: points[:, 2] > 2, "visible area in zone 2 .* got none in 16384 samples"),
        (lambda points: points[:, 2] > 0.5, "visible area in zone 2 outside the zones before it"),
        (Point((9, 0, 0), radius=1.0), "visible area in zone 2"),
    ],
)
def test_places_that_a_model_has_not_are_refused(where: Any, message: str) -> None:
    with pytest.raises(InvalidScattering, match=message):
        scatter(BALL, count=5, zones=Zones(Zone(above), Zone(where)))


def test_values_of_a_mesh_need_that_mesh_alone() -> None:
    for models in ([BALL, sphere(center=(3, 0, 0))], BLOB):
        with pytest.raises(InvalidScattering, match="where of zone 1: expected a single mesh"):
            scatter(models, count=5, zones=Zones(Zone([True])))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"zones": [Zone(above)]}, "zones: expected such as"),
        ({"zones": Zones(Zone(above, spacing=0.5))}, "no count or spacing beside those of the zones"),
        ({"zones": Zones(Zone(above, weights=[1, 2]))}, "weights: expected shape"),
        ({"zones": Zones(Zone(above, density=lambda points: -points[:, 2]))}, "density of zone 1: expected"),
    ],
)
def test_options_that_contradict_zones_are_refused(options: Any, message: str) -> None:
    with pytest.raises(InvalidScattering, match=message):
        scatter(BALL, count=5, **options)


HOSTILE = st.one_of(
    st.none(),
    st.text(max_size=3),
    st.floats(),
    st.integers(),
    st.lists(st.floats(), max_size=4),
    st.booleans(),
    st.just(above),
    st.just(BLOB),
    st.just(np.zeros((2, 2, 2))),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(where=HOSTILE, width=HOSTILE, options=st.dictionaries(
    st.sampled_from(["density", "spacing", "factor", "direction", "images", "weights", "choice"]),
    HOSTILE, max_size=2,
))  # fmt: skip
def test_hostile_zones_raise_our_errors_alone(where: Any, width: Any, options: Any) -> None:
    square = plane()
    try:
        decals = scatter(square, count=3, zones=Zones(Zone(where, **options), border_width=width))
    except ImplicitDecalsError:
        return
    assert len(decals) == 3 or "spacing" in options
