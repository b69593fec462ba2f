import numpy as np
import pytest

from decals.errors import InvalidSeeding
from decals.model import FACING_LIMIT
from decals.seeds.crowd import Crowd
from decals.seeds.neighbours import FacingTree
from decals.seeds.particles import CLOSEST
from decals.seeds.polishing import polish
from decals.seeds.population import Sites, World, shares
from decals.seeds.refilling import crowded, refill
from decals.seeds.relaxation import Relaxation
from decals.seeds.repulsion import CORE, CUTOFF, Law
from decals.seeds.vertex_density import vertex_density
from tests.decals.meshes import box, plane, sphere, star
from tests.oracles.coats import nearest_facing, rho
from tests.oracles.repulsion import total_energy


def test_step_by_step_is_the_same_as_in_one_run():
    by_hand, at_once = (Relaxation([sphere()], count=80, seed=3, iterations=40) for _ in range(2))
    while not by_hand.finished:
        by_hand.step()
    at_once.run()
    assert by_hand.steps == at_once.steps == 40
    assert by_hand.positions.tobytes() == at_once.positions.tobytes()


def test_energies_tell_the_crowded_from_the_lonely():
    relaxation = Relaxation([plane()], count=200, iterations=100)
    relaxation.step()
    nearest = nearest_facing(relaxation.positions, relaxation.normals)
    order = np.argsort(nearest)
    assert relaxation.energies[order[:40]].mean() > 1.5 * relaxation.energies[order[-40:]].mean() > 0


def test_statistics_are_those_of_all_pairs():
    relaxation = Relaxation([box()], count=150, iterations=60)
    relaxation.run()
    found = relaxation.statistics()
    nearest = nearest_facing(relaxation.positions, relaxation.normals)
    assert nearest.max() < 2.0 * found.ideal
    assert found.rho == pytest.approx(rho(relaxation.positions, relaxation.normals, 6.0), rel=1e-5)
    assert found.mean == pytest.approx(nearest.mean(), rel=1e-5)
    assert found.cv == pytest.approx(nearest.std() / nearest.mean(), rel=1e-4)
    assert found.ideal == pytest.approx(np.sqrt(2 * 6.0 / np.sqrt(3) / 150))


def test_relaxing_makes_even():
    relaxation = Relaxation([sphere()], count=500)
    before = relaxation.statistics()
    relaxation.run()
    after = relaxation.statistics()
    assert before.rho < 0.3 < 0.88 < after.rho
    assert after.cv < 0.025 < before.cv
    assert after.cv6 < 0.025 < before.cv6
    assert after.ringed == 1.0


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_few_particles_relax(count):
    relaxation = Relaxation([sphere()], count=count, iterations=5)
    relaxation.run()
    assert relaxation.count == len(relaxation.positions) == count
    assert relaxation.statistics().cv == 0.0 or count == 2


def test_every_surface_keeps_its_share():
    relaxation = Relaxation([sphere(), box(center=(0, 0, 9)), plane(3.0)], count=500, iterations=30)
    expected = shares(relaxation.world.areas, 500)
    relaxation.run()
    assert (expected > 0).all()
    assert np.array_equal(np.bincount(relaxation.surface_ids), expected)
    assert expected.sum() == 500


def test_touching_spheres_share_one_coat():
    left, right = sphere(), sphere(center=(2.0, 0, 0))
    relaxation = Relaxation([left, right], count=400)
    relaxation.run()
    for surface, number in ((left, 1), (right, 0)):
        assert not surface.contains(relaxation.positions[relaxation.surface_ids == number]).any()
    assert relaxation.statistics().rho > 0.8


def test_nothing_is_seeded_or_moves_inside_another_surface():
    balls = [sphere(), sphere(center=(1.2, 0, 0)), sphere(radius=0.5)]
    relaxation = Relaxation(balls, count=300)
    assert relaxation.world.areas[2] == 0
    # the lens of two unit spheres at distance 1.2 hides a cap of height 0.4 of each
    assert relaxation.world.areas[:2] == pytest.approx(2 * np.pi * 1.6, rel=0.02)
    relaxation.run()
    assert not (relaxation.surface_ids == 2).any()
    for number in (0, 1):
        own = relaxation.positions[relaxation.surface_ids == number]
        center = [1.2 * number, 0, 0]
        assert not balls[1 - number].contains(own + 1e-3 * (own - center)).any()
    assert relaxation.statistics().rho > 0.75


def test_coincident_surfaces_do_not_hide_each_other():
    relaxation = Relaxation([sphere(), sphere()], count=200)
    relaxation.run()
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 100]
    # one coat of 200 over a single sphere
    assert rho(relaxation.positions, relaxation.normals, sphere().area) > 0.75


def test_faces_that_touch_are_hidden():
    world = World([box(), box(center=(1, 0, 0))], seed=0)
    assert world.areas == pytest.approx([5.0, 5.0], abs=0.1)
    sites = world.sample(np.array([500, 500]), stream=1)
    assert not (np.abs(sites.positions[:, 0] - 0.5) < 1e-6).any()


def test_open_surfaces_hide_nothing():
    world = World([sphere(), plane(3.0)], seed=0)
    assert world.areas[0] == sphere().area
    assert world.areas[1] == pytest.approx(9 - np.pi, rel=0.05)


def test_shares_are_exact_and_by_largest_remainder():
    assert shares(np.array([1.0, 1.0, 1.0]), 10).tolist() == [4, 3, 3]
    assert shares(np.array([0.0, 5.0]), 3).tolist() == [0, 3]
    assert shares(np.array([1.0, 2.0, 4.0]), 0).tolist() == [0, 0, 0]
    for count in range(50):
        found = shares(np.array([0.1, 3.0, 7.7, 1e-9]), count)
        assert found.sum() == count
        assert np.abs(found - count * np.array([0.1, 3.0, 7.7, 1e-9]) / 10.8).max() < 1
    with pytest.raises(InvalidSeeding, match="visible area"):
        shares(np.array([0.0]), 1)


@pytest.mark.parametrize("wish", [{"count": -1}, {"count": 3, "seed": -1}, {"count": 3, "iterations": 0}])
def test_impossible_wishes_are_refused(wish):
    with pytest.raises(InvalidSeeding, match="expected at least"):
        Relaxation([plane()], **wish)


def row_of(places, number=0):
    """Sites in a row, facing up."""
    positions = np.zeros((len(places), 3), np.float32)
    positions[:, 0] = places
    normals = np.tile(np.float32([0, 0, 1]), (len(places), 1))
    return Sites(positions, normals, np.full(len(places), number, np.int32))


def crowd_in_a_row(movable):
    world = World([plane(100.0)], seed=0)
    sites = row_of([0.0, 0.01, 1.0, 2.0, 3.0, 4.0, 5.0])
    crowd = Crowd(world, sites, np.asarray(movable), np.ones(7, np.float32))
    crowd.begin(Law(3.0, 0.0))
    return crowd


def test_crowded_particles_move_to_bare_places():
    crowd = crowd_in_a_row([True] * 7)
    movers = crowded(crowd)
    assert movers.tolist() == [1]  # as crowded as its neighbour from the left, and more from the right
    scouts = row_of([0.5, 9.0, 1.1])
    refill(crowd, movers, scouts, np.ones(3, np.float32))
    assert crowd.sites().positions[:, 0].tolist() == [0, 9, 1, 2, 3, 4, 5]
    assert crowded(crowd_in_a_row(np.arange(7) > 1)).tolist() == []


def test_crowded_particles_move_within_their_own_surface():
    crowd = crowd_in_a_row([True] * 7)
    before = crowd.sites().positions
    refill(crowd, np.array([1]), row_of([9.0, 11.0], number=1), np.ones(2, np.float32))
    assert np.array_equal(crowd.sites().positions, before)


def test_polishing_parts_close_pairs_and_never_lets_the_least_distance_fall():
    surface = box()
    rough = Relaxation([surface], count=150, iterations=60)
    while rough.steps < 12:
        rough.step()
    everybody, sizes = np.ones(150, bool), rough.sizes_at(rough.positions)
    crowd = Crowd(rough.world, rough.sites, everybody, sizes)
    first = last = nearest_facing(rough.positions, rough.normals).min()
    for number in range(15):
        polish(crowd, rounds=1, seed=number, sizes_at=rough.sizes_at)
        sites = crowd.sites()
        least = nearest_facing(sites.positions, sites.normals).min()
        assert least > last * (1 - 1e-6)
        last = least
    assert last > 1.05 * first
    assert np.abs(surface.project(sites.positions)[0] - sites.positions).max() < 1e-6


@pytest.mark.parametrize("count", [1000, 5000])
def test_sharp_tips_and_thin_fins_are_seeded_evenly(count):
    relaxation = Relaxation([star()], count=count)
    relaxation.run()
    found = relaxation.statistics()
    assert found.rho > 0.85
    assert found.cv < 0.035


@pytest.mark.parametrize("surface", [sphere, box, star])
def test_the_energy_never_rises_within_an_epoch(surface):
    relaxation = Relaxation([surface()], count=400, iterations=90, density=lambda points: 2.0 + points[:, 0])
    energies, epochs = [], []
    for _ in range(89):
        relaxation.step()
        energies.append(relaxation.energy)
        epochs.append(relaxation.epoch)
    same = np.diff(epochs) == 0
    assert same.sum() > 15
    assert (np.diff(energies)[same] <= 0).all()
    assert (np.diff(energies)[same] < 0).any()


def test_a_step_that_raises_the_energy_is_taken_back():
    count = 121
    crowd = Crowd(
        World([Jumpy()], seed=0), jittered(0.3, 11), np.ones(count, bool), np.full(count, 0.3, np.float32)
    )
    law = Law(3.0, 300.0)
    crowd.begin(law)
    guides = crowd.sites().normals
    rule = {"cutoff": CUTOFF, "core": CORE, "facing_limit": FACING_LIMIT, "closest": CLOSEST}
    energies, stayed = [], 0
    for _ in range(12):
        before = crowd.sites().positions
        crowd.step()
        sites = crowd.sites()
        stayed += np.array_equal(before, sites.positions)
        sizes = crowd.host_sizes.astype(float)
        law_of = {"exponent": law.exponent, "stiffness": law.stiffness}
        energies.append(total_energy(sites.positions, sites.normals, sizes, guides=guides, **law_of, **rule))
        assert crowd.energy == pytest.approx(energies[-1], rel=1e-4)
    assert stayed > 0  # some steps did fail
    assert energies[-1] < energies[0]
    assert (np.diff(energies) <= 1e-5 * energies[0]).all()


class Jumpy:
    """A plane on which points land beside where they wanted to go, all the farther the farther they went."""

    def __init__(self):
        self._plane = plane(4.0)
        self.area, self.bounds = self._plane.area, self._plane.bounds
        self.sample, self.contains = self._plane.sample, self._plane.contains

    def project(self, points, *, within=None):
        positions, normals = self._plane.project(points)
        if within is not None:
            sideways = 60.0 * np.maximum(within - 0.001, 0.0) ** 2
            positions[:, 0] += sideways * np.where(np.arange(len(points)) % 2, 1, -1)
        return positions.astype(np.float32), normals


def jittered(spacing, side):
    """A square grid of particles, none quite in its place."""
    ticks = spacing * (np.arange(side) - 0.5 * (side - 1))
    positions = np.zeros((side**2, 3), np.float32)
    positions[:, :2] = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    positions[:, :2] += np.random.default_rng(3).uniform(-0.05, 0.05, (side**2, 2))
    return Sites(positions, np.tile(np.float32([0, 0, 1]), (side**2, 1)), np.zeros(side**2, np.int32))


def test_a_spacing_in_place_of_a_count():
    relaxation = Relaxation([sphere()], spacing=0.2, iterations=1)
    assert relaxation.count == round(sphere().area * 2 / (np.sqrt(3) * 0.04))
    assert relaxation.spacing == pytest.approx(0.2, rel=1e-3)
    for wish in ({}, {"count": 3, "spacing": 1.0}, {"spacing": 0.0}, {"spacing": np.nan}):
        with pytest.raises(InvalidSeeding, match="expected"):
            Relaxation([sphere()], **wish)


def test_density_decides_how_many_lie_where():
    # over a unit sphere the integral of exp(z) between two heights is 2 pi times its difference
    relaxation = Relaxation([sphere(level=5)], count=2000, density=lambda points: np.exp(points[:, 2]))
    relaxation.run()
    edges = np.linspace(-1, 1, 6)
    counts = np.histogram(relaxation.positions[:, 2], bins=[-2, *edges[1:-1], 2])[0]
    expected = 2000 * np.diff(np.exp(edges)) / (np.e - 1 / np.e)
    assert np.abs(counts - expected).max() < 0.02 * 2000
    assert counts == pytest.approx(expected, rel=0.02)
    assert relaxation.statistics().rho > 0.8


def test_density_on_vertices():
    ball = sphere()
    density = vertex_density(ball.vertices, np.where(ball.vertices[:, 2] > 0, 3.0, 1.0))
    assert density(ball.vertices) == pytest.approx(np.where(ball.vertices[:, 2] > 0, 3.0, 1.0))
    middles = ball.vertices[ball.faces].mean(axis=1)
    assert ((density(middles) >= 1.0 - 1e-9) & (density(middles) <= 3.0 + 1e-9)).all()
    relaxation = Relaxation([ball], count=400, density=density, iterations=80)
    relaxation.run()
    assert (relaxation.positions[:, 2] > 0).sum() == pytest.approx(300, abs=12)
    for values in ([1.0], np.zeros(len(ball.vertices)), np.full(len(ball.vertices), np.nan)):
        with pytest.raises(InvalidSeeding, match="values: expected"):
            vertex_density(ball.vertices, values)


def test_density_on_the_vertices_of_a_mesh_is_linear_in_its_faces():
    ball = sphere()
    density = vertex_density(ball, 2.0 + ball.vertices[:, 0])
    points, _ = ball.sample(300, seed=0)
    assert density(points) == pytest.approx(2.0 + points[:, 0], abs=1e-5)
    with pytest.raises(InvalidSeeding, match="values: expected"):
        vertex_density(ball, [1.0])


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("surface", "density", "regions"),
    [
        (plane(2.0), lambda q: np.where(q[:, 0] > 0, 4.0, 1.0), [(0.8, lambda q: q[:, 0] > 0)]),
        (
            sphere(level=5),
            lambda q: np.where(q[:, 2] > 0.5, 10.0, 1.0),
            [(10 / 13, lambda q: q[:, 2] > 0.5)],  # a cap a quarter as high as the ball
        ),
        (
            plane(2.0),
            lambda q: np.where((q[:, 0] > 0) ^ (q[:, 1] > 0), 3.0, 1.0),
            [
                (1 / 8, lambda q: (q[:, 0] > 0) & (q[:, 1] > 0)),
                (3 / 8, lambda q: (q[:, 0] > 0) & (q[:, 1] < 0)),
                (3 / 8, lambda q: (q[:, 0] < 0) & (q[:, 1] > 0)),
            ],
        ),
    ],
)
def test_counts_are_the_integral_also_where_density_jumps(surface, density, regions, seed):
    relaxation = Relaxation([surface], count=1000, density=density, seed=seed)
    relaxation.run()
    for share, region in regions:
        assert region(relaxation.positions).sum() == pytest.approx(1000 * share, rel=0.02)
    assert relaxation.statistics().rho > 0.85


def test_both_sides_of_a_jump_have_their_spacing():
    jump = Relaxation([plane(2.0)], count=1000, density=lambda points: np.where(points[:, 0] > 0, 4.0, 1.0))
    jump.run()
    dense = jump.positions[:, 0] > 0
    nearest = nearest_facing(jump.positions, jump.normals)
    assert np.median(nearest[~dense]) == pytest.approx(2 * np.median(nearest[dense]), rel=0.05)


def test_spacings_of_one_to_ten_in_one_population():
    relaxation = Relaxation([sphere()], count=3000, density=lambda points: 10.0 ** (1.0 + points[:, 2]))
    relaxation.run()
    sizes = relaxation.sizes_at(relaxation.positions)
    assert sizes.max() > 9 * sizes.min()
    assert relaxation.statistics().rho > 0.8


def test_surfaces_share_by_density():
    pair = [sphere(), sphere(center=(5, 0, 0))]
    relaxation = Relaxation(pair, count=300, density=lambda points: np.where(points[:, 0] > 2, 2.0, 1.0))
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 200]


def test_a_mask_bars_places():
    relaxation = Relaxation([sphere()], count=200, mask=lambda points: points[:, 2] > 0.2, iterations=60)
    relaxation.run()
    assert (relaxation.positions[:, 2] > 0.2).all()
    assert relaxation.world.area == pytest.approx(0.4 * sphere().area, rel=0.02)
    assert relaxation.statistics().rho > 0.6
    with pytest.raises(InvalidSeeding, match="visible area"):
        Relaxation([sphere()], count=5, mask=lambda points: points[:, 2] > 9)


def test_fixed_particles_stay_and_keep_the_others_off():
    fixed = np.float32([[0, 0, 1.2], [0.05, 0, 1.2], [4.0, 0, 0]])
    balls = [sphere(), sphere(center=(5, 0, 0))]
    relaxation = Relaxation(balls, count=200, fixed=fixed)
    relaxation.run()
    stays = relaxation.fixed
    assert stays.sum() == 3
    assert relaxation.count == 200
    gaps = np.linalg.norm(relaxation.positions[stays][:, None] - fixed[None], axis=2).min(axis=0)
    assert gaps == pytest.approx([0.2, 0.2, 0.0], abs=0.01)
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 100]
    nearest = nearest_facing(relaxation.positions, relaxation.normals)
    assert nearest[~stays].min() > 0.75 * relaxation.spacing
    with pytest.raises(InvalidSeeding, match="at most the count"):
        Relaxation(balls, count=2, fixed=fixed)


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        ({"density": lambda points: points}, "density: expected shape"),
        (
            {"density": lambda points: points[:, 0] * 0},
            "density: expected finite numbers, and densities above",
        ),
        ({"density": lambda points: points[:, 0] * np.nan}, "density: expected finite"),
        ({"density": lambda points: "much"}, "density: expected numbers"),
        ({"mask": lambda points: True}, "mask: expected shape"),
    ],
)
def test_functions_that_answer_nonsense_are_refused(wish, says):
    with pytest.raises(InvalidSeeding, match=says):
        Relaxation([plane()], count=5, **wish)


def test_relaxing_stops_when_told_to_or_even_enough():
    stopped, early = Relaxation([sphere()], count=300), Relaxation([sphere()], count=300)
    stopped.run(cancel=lambda: stopped.steps >= 7)
    assert stopped.steps == 7
    early.run(until=0.5)
    assert 0 < early.steps < early.iterations
    assert early.statistics().rho >= 0.5


def test_one_more_particle_and_one_less_change_the_neighbourhood_alone():
    relaxation = Relaxation([sphere(), plane(1.0)], count=600)
    relaxation.run()
    before = relaxation.positions.copy()
    row = relaxation.insert((0, 0, 1.1))
    assert relaxation.count == 601
    others = np.delete(relaxation.positions, row, axis=0)
    far = np.linalg.norm(before - [0, 0, 1], axis=1) > 5 * relaxation.spacing
    assert np.array_equal(others[far], before[far])
    assert np.linalg.norm(relaxation.positions[row] - [0, 0, 1]) < relaxation.spacing
    assert relaxation.statistics().rho > 0.75
    relaxation.remove(row)
    assert relaxation.count == 600
    assert relaxation.statistics().rho > 0.8
    relaxation.step()
    assert np.array_equal(relaxation.surface_ids, np.sort(relaxation.surface_ids))
    row = relaxation.insert((1.0, 0, 0), fixed=True)
    assert np.linalg.norm(relaxation.positions[row] - [1, 0, 0]) < 0.01
    for number in (-1, 601):
        with pytest.raises(InvalidSeeding, match="expected a particle"):
            relaxation.remove(number)


def test_nobody_is_inserted_where_nobody_may_lie():
    relaxation = Relaxation([sphere()], count=5, mask=lambda points: points[:, 2] > 0)
    with pytest.raises(InvalidSeeding, match="neither hidden nor masked"):
        relaxation.insert((0, 0, -1))


def test_from_nobody_to_nobody():
    relaxation = Relaxation([plane()], count=0)
    relaxation.insert((0, 0, 0))
    relaxation.insert((0.1, 0, 0))
    relaxation.remove(0)
    relaxation.remove(0)
    assert relaxation.count == 0


@pytest.mark.parametrize("skip_self", [False, True])
def test_nearest_facing_neighbours_are_those_of_all_pairs(skip_self):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3)).astype(np.float32)
    normals = (points / np.linalg.norm(points, axis=1, keepdims=True)).astype(np.float32)
    distances, indices = FacingTree(points, normals).nearest(points, normals, count=3, skip_self=skip_self)
    everything = np.linalg.norm(points[:, None].astype(float) - points[None], axis=2)
    everything[normals.astype(float) @ normals.T.astype(float) <= -0.25] = np.inf
    if skip_self:
        np.fill_diagonal(everything, np.inf)
    assert np.allclose(distances, np.sort(everything, axis=1)[:, :3], atol=1e-5)
    assert np.allclose(np.take_along_axis(everything, indices, axis=1), distances, atol=1e-5)


def test_fewer_neighbours_than_asked_for():
    up, down = np.float32([[0, 0, 1]]), np.float32([[0, 0, -1]])
    spot = np.zeros((1, 3), np.float32)
    distances, indices = FacingTree(spot, up).nearest(spot, up, count=3)
    assert distances.tolist() == [[0.0, np.inf, np.inf]]
    assert indices.tolist() == [[0, -1, -1]]
    assert FacingTree(spot, up).nearest(spot, down)[1].tolist() == [[-1]]
    assert FacingTree(spot[:0], up[:0]).nearest(spot, up)[1].tolist() == [[-1]]
