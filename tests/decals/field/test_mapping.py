"""What is drawn against log maps; what stays in place; normals that agree, jump or oppose each other."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from decals import Contact, Decals, ImageMapping, evaluate
from tests.decals.field import log_maps
from tests.decals.field.kernels import arcs_of, coordinates_of, distances_of, turns_of
from tests.decals.field.log_maps import DECAL, DISCS, dots, drawn_error, tangents
from tests.vectors import unit


def on_cpu(dtype: Any, *arrays: ArrayLike) -> list[Any]:
    """Return arrays of rows as Warp arrays; one vector is one row."""
    rows = (np.atleast_2d(np.array(a, np.float32)) if dtype is wp.vec3 else a for a in arrays)
    return [wp.array(np.array(a, np.float32), dtype=dtype, device="cpu") for a in rows]


def rolled_out(w: NDArray[Any], n_p: NDArray[Any], n_q: NDArray[Any]) -> Any:
    """Offset in the tangent plane, and length."""
    n_p = np.reshape(n_p, (-1, 3))
    inputs: list[Any] = [
        wp.array(np.array(a, np.float32).reshape(-1, 3), dtype=wp.vec3, device="cpu") for a in (w, n_p, n_q)
    ]
    result = wp.zeros(len(n_p), dtype=wp.vec4, device="cpu")
    wp.launch(arcs_of, len(n_p), [*inputs, result], device="cpu")
    arc = result.numpy().astype(np.float64)
    return arc[:, :3] - dots(arc[:, :3], n_p) * n_p, arc[:, 3:]


def mapped(w: NDArray[Any], n_p: NDArray[Any], n_q: NDArray[Any]) -> Any:
    """Return the offset's direction at the length: the map where no neighbour pushes."""
    offset, length = rolled_out(w, n_p, n_q)
    return length * offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-30)


def distances(*columns: Any) -> Any:
    inputs = on_cpu(wp.float32, *columns)
    result = wp.zeros(len(inputs[0]), dtype=wp.float32, device="cpu")
    wp.launch(distances_of, len(result), [*inputs, result], device="cpu")
    return result.numpy()


coordinate = st.floats(-1, 1, width=32)
vector = st.tuples(coordinate, coordinate, coordinate).map(np.array)
direction = vector.filter(lambda v: np.linalg.norm(v) > 1e-3).map(unit)

# -- against log maps -----------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", [log_maps.plane, log_maps.sphere, log_maps.cylinder])
@pytest.mark.parametrize("inside_out", [1, -1])
def test_the_arc_is_exact_far_round(surface: Any, inside_out: bool) -> None:
    log = log_maps.offsets(np.random.default_rng(0), 20_000, 0.9 * np.pi)
    w, n_q = surface(log)
    error = mapped(w, inside_out * np.tile([0, 0, 1.0], (len(w), 1)), inside_out * n_q)[:, :2] - log
    assert np.abs(error).max() <= (1e-6 if surface is log_maps.plane else 1e-5)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-5, 1e-4, 1e-3, 0.05, 0.2, 0.21])
def test_every_small_angle_on_the_sphere(angle: Any) -> None:
    rng = np.random.default_rng(1)
    n_p = unit(rng.normal(size=(2000, 3)))
    u = tangents(rng, n_p)
    n_q = np.cos(angle) * n_p + np.sin(angle) * u
    assert np.abs(mapped(np.sin(angle) * u + (np.cos(angle) - 1) * n_p, n_p, n_q) - angle * u).max() < 3e-7


@pytest.mark.slow_cases("torus-0.02")
@pytest.mark.parametrize(("name", "chord"), [("torus", 0.02), ("ellipsoid", 0.02)])
def test_what_is_drawn_on_curved_surfaces(name: str, chord: Any) -> None:
    corrected, projected = (
        drawn_error(name, mapping=mode) for mode in (ImageMapping.CORRECTED, ImageMapping.CHORD)
    )
    print(f"{name}: corrected {corrected:.3%}, chord {projected:.3%} of the radius")
    assert corrected <= 0.005
    assert projected > chord


@pytest.mark.parametrize("name", ["plane", "sphere", "cylinder"])
@pytest.mark.parametrize("radius", [0.05, DECAL, 1.2])
def test_what_is_drawn_is_exact(name: str, radius: float) -> None:
    error = drawn_error(name, radius, discs=20, points=500)
    print(f"{name}, radius {radius}: {error:.2e}")
    assert error <= 1e-5


@pytest.mark.parametrize(
    ("name", "radius"), [("torus", DECAL), ("sphere", 1.2), ("cylinder", 1.2), ("plane", 1)]
)
def test_an_image_ends_at_its_radius_along_the_surface(name: str, radius: float) -> None:
    """Beyond, image coordinates go on as the surface does, and colours there are those of nothing."""
    disc = DISCS[name](np.random.default_rng(5), 3000, 1.1 * radius)
    one = Decals([disc.centre], [disc.normal], [disc.tangent], [radius])
    white = np.full((2, 2, 4), 255, np.uint8)
    seen = evaluate(one, disc.points, disc.normals, images=[white], device="cpu")
    length = np.linalg.norm(disc.log, axis=1) / radius
    clear = np.abs(length - 1) > 0.01
    assert seen.color is not None
    assert ((seen.color[:, 3] > 0) == (length < 1))[clear & (seen.owner >= 0)].all()
    assert (seen.owner[length < 1] == 0).all()
    beyond = clear & (length > 1) & (seen.owner >= 0)
    assert beyond.any() == (name != "plane")
    drawn = 2 * np.linalg.norm(seen.uv[beyond] - 0.5, axis=1)
    assert drawn == pytest.approx(length[beyond], abs=0.01)


# -- across edges ----------------------------------------------------------------------------------------


@settings(max_examples=100)
@given(
    angle=st.floats(0.01, 3.1),
    concave=st.booleans(),
    near=st.floats(0.01, 0.9),
    along=st.floats(-0.9, 0.9),
    step=st.floats(1e-5, 1e-3),
)
def test_images_run_on_across_edges(angle: Any, concave: bool, near: Any, along: Any, step: int) -> None:
    """From a flat face: at the edge both normals give the projection, and beyond it nothing jumps."""
    psi = -angle if concave else angle
    up, other = np.array([[0, 0, 1.0]]), np.array([[np.sin(psi), 0, np.cos(psi)]])
    edge = np.array([[near, along, 0]])
    at_edge = mapped(edge, up, other)
    assert at_edge == pytest.approx(edge, abs=1e-5)
    over = edge + step * np.array([[np.cos(psi), 0, -np.sin(psi)]])
    assert np.linalg.norm(mapped(over, up, other) - edge) < 12 * step + 1e-5


@pytest.mark.parametrize("degrees", [20, 45, 90])
@pytest.mark.parametrize("side", [1, -1])
def test_an_edge_is_nearer_to_the_unfolded_faces_than_the_projection(degrees: Any, side: Any) -> Any:
    psi, rng = side * np.radians(degrees), np.random.default_rng(6)
    flat = log_maps.offsets(rng, 4000, 1.0)
    flat = flat[flat[:, 0] > 0.3]
    t = flat[:, :1] - 0.3
    w = np.hstack([0.3 + t * np.cos(psi), flat[:, 1:], -t * np.sin(psi)])
    n_p, n_q = (np.tile([np.sin(a), 0, np.cos(a)], (len(w), 1)) for a in (0.0, psi))

    def rms(offset: Any) -> Any:
        return np.sqrt(((offset[:, :2] - flat) ** 2).sum(axis=1).mean())

    projected = np.linalg.norm(w, axis=1, keepdims=True) * unit(w * [1, 1, 0])
    assert rms(mapped(w, n_p, n_q)) < 0.65 * rms(projected)


def test_flat_faces_do_not_mind_normals_that_are_smoothed() -> None:
    rng = np.random.default_rng(7)
    w = rng.uniform(-1, 1, (1000, 3)) * [1, 1, 0]
    n_q = unit([0, 0, 1] + 0.4 * rng.normal(size=(1000, 3)))
    assert mapped(w, np.tile([0, 0, 1.0], (1000, 1)), n_q) == pytest.approx(w, abs=1e-6)


# -- footprints ------------------------------------------------------------------------------------------


def turned(step: NDArray[Any], n_p: NDArray[Any], n_q: NDArray[Any]) -> Any:
    inputs: list[Any] = [
        wp.array(np.array(a, np.float32), dtype=wp.vec3, device="cpu") for a in (step, n_p, n_q)
    ]
    result = wp.zeros(len(step), dtype=wp.vec3, device="cpu")
    wp.launch(turns_of, len(step), [*inputs, result], device="cpu")
    return result.numpy().astype(np.float64)


def test_a_footprint_on_a_plane_stays_as_it_is() -> None:
    n, step = np.tile([0, 0, 1.0], (50, 1)), np.random.default_rng(2).normal(size=(50, 3)) * [1, 1, 0]
    assert turned(step, n, n) == pytest.approx(step, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "radius", "share"), [("cylinder", 0.5, 0.01), ("cylinder", 1.4, 0.01), ("sphere", 1.4, 0.3)]
)
def test_a_footprint_is_that_of_the_image_rolled_out(name: str, radius: float, share: Any) -> None:
    """On the sphere steps across the way are ψ / sin ψ longer in the image: 1.37 at its rim."""
    rng, h = np.random.default_rng(4), 1e-3
    log, aside = log_maps.offsets(rng, 400, 0.95 * radius), log_maps.offsets(rng, 400, 1.0)
    surface, n_p = getattr(log_maps, name), np.tile([0, 0, 1.0], (400, 1))
    step = (surface(log + h * aside)[0] - surface(log - h * aside)[0]) / (2 * h)
    back = turned(step, n_p, surface(log)[1])[:, :2]
    size = np.linalg.norm(aside, axis=1)
    error, projected = (np.linalg.norm(a - aside, axis=1) / size for a in (back, step[:, :2]))
    print(name, radius, error.max(), projected.max())
    assert error.max() <= share
    assert error.mean() < 0.4 * projected.mean()


@settings(max_examples=100)
@given(n_p=direction, n_q=direction, aside=direction, opposed=st.booleans(), size=st.floats(0, 1e-3))
def test_footprints_stay_as_large_whatever_the_normals(
    n_p: NDArray[Any], n_q: NDArray[Any], aside: Any, opposed: bool, size: Any
) -> None:
    if opposed:
        n_q = unit(-n_p + size * aside)
    step = np.cross(n_q, aside)
    back = turned(step[None], n_p[None], n_q[None])[0]
    across = back - (back @ n_p) * n_p
    assert np.linalg.norm(across) == pytest.approx(np.linalg.norm(step), rel=2e-3, abs=1e-5) or opposed
    assert np.linalg.norm(across) <= 1.01 * np.linalg.norm(step) + 1e-3


# -- lines of contact, and rays -----------------------------------------------------------------------

share = st.floats(0, 1, width=32)


@settings(max_examples=200)
@given(chord=share, pushed=share, stretch=st.floats(1, 1.625, width=32))
def test_distance_in_the_image(chord: Any, pushed: Any, stretch: Any) -> None:
    rim, length = chord + pushed * (1 - chord), chord * stretch
    seen, on_contact, alone, unbent = distances(
        [rim, 1, chord, rim], [chord] * 4, [length, length, length, chord]
    )
    assert seen >= max(rim, length) - 3e-7
    assert on_contact == max(1.0, np.float32(length))
    assert alone == pytest.approx(length, abs=3e-7)
    assert unbent == pytest.approx(rim, abs=3e-7)
    if length <= 1:
        assert seen <= 1


@pytest.mark.parametrize("contact", Contact)
def test_lines_of_contact_stay_in_place(contact: Contact) -> None:
    """Two decals of a sphere meet half-way between their centres, at their images' rims, by any mapping."""
    apart, aside = 0.3, np.linspace(-0.3, 0.3, 41)
    centres = np.array([[np.sin(a), 0, np.cos(a)] for a in (-apart, apart)])
    decals = Decals(centres, centres, [[0, 1, 0]] * 2, [0.5, 0.5])
    line = np.column_stack([0 * aside, np.sin(aside), np.cos(aside)])
    for mapping in (ImageMapping.CHORD, ImageMapping.CORRECTED):
        for side in (-1e-6, 1e-6):
            q = unit(line + side * np.eye(3)[0])
            seen = evaluate(decals, q, q, mapping=mapping, contact=contact, device="cpu")
            assert (seen.owner == (side > 0)).all()
            assert np.linalg.norm(seen.uv - 0.5, axis=1) == pytest.approx(np.full(41, 0.5), abs=1e-4)


@settings(max_examples=200)
@given(steps=st.lists(st.tuples(share, share, share), min_size=2, max_size=20))
def test_nothing_folds_where_the_arc_grows_no_slower_than_the_chord(
    steps: list[tuple[float, float, float]],
) -> None:
    """On any way along a surface chords grow by less than lengths; contact may push as it likes, outwards."""
    chord, bent, pushed = np.cumsum(steps, axis=0).T / len(steps)
    length = chord + bent
    rim = np.minimum(1 - (1 - np.minimum(chord, 1)) * np.exp(-4 * pushed), 1)
    inside = chord < 1
    assert (np.diff(distances(rim[inside], chord[inside], length[inside])) >= -3e-7).all()


@pytest.mark.slow_cases("torus")
@pytest.mark.parametrize("name", ["torus", "ellipsoid", "sphere", "cylinder"])
def test_radial_contact_does_not_fold_on_curved_surfaces(name: str) -> None:
    """Along geodesics from the centre of a decal among neighbours of other sizes, as long as it is drawn."""
    rng, steps, pushed = np.random.default_rng(8), 60, 0
    for _ in range(12):
        disc = DISCS[name](rng, 1, 1e-3)
        rows = np.linspace(0.02, 1, steps)
        around = rng.uniform(0, 2 * np.pi, 30)
        rays = np.column_stack([np.cos(around), np.sin(around)])
        log = DECAL * (rows[:, None, None] * rays).reshape(-1, 2)
        q, normals = on_surface(name, disc, log)
        places = on_surface(name, disc, log_maps.offsets(rng, 6, 1.5 * DECAL))
        centres, up = np.vstack([disc.centre, places[0]]), np.vstack([disc.normal, places[1]])
        away = np.vstack([disc.tangent, tangents(rng, places[1])])
        decals = Decals(centres, up, away, [DECAL, *rng.uniform(0.2, 0.8, 6)])
        seen = evaluate(decals, q, normals, contact=Contact.RADIAL, device="cpu")
        distance = np.linalg.norm(seen.uv - 0.5, axis=1).reshape(steps, -1)
        first = (seen.owner == 0).reshape(steps, -1)
        both = first[1:] & first[:-1]
        assert (np.diff(distance, axis=0)[both] > 0).all()
        pushed += (distance > 0.6 * rows[:, None])[first].sum()
    assert pushed > 100


def on_surface(name: str, disc: Any, log: Any) -> Any:
    """Points and normals of these log maps around the centre of a disc."""
    axes = np.stack([disc.tangent, np.cross(disc.normal, disc.tangent), disc.normal])
    if name in ("sphere", "cylinder"):
        w, n_q = getattr(log_maps, name)(log)
        return disc.centre + w @ axes, n_q @ axes
    gradient = getattr(log_maps, f"{name}_gradient")
    length = np.linalg.norm(log, axis=1, keepdims=True)
    start = np.repeat(disc.centre[None], len(log), axis=0)
    q = log_maps.walk(gradient, start, (log / length) @ axes[:2], length, steps=40)
    return q, unit(gradient(q))


# -- hostile ----------------------------------------------------------------------------------------


@settings(max_examples=150)
@given(w=vector, n_p=direction, n_q=direction, opposed=st.booleans(), noise=vector, size=st.floats(0, 1e-3))
def test_finite_and_bounded(
    w: NDArray[Any], n_p: NDArray[Any], n_q: NDArray[Any], opposed: bool, noise: Any, size: Any
) -> None:
    if opposed:
        n_q = unit(-n_p + size * noise)
    offset, length = rolled_out(w, n_p, n_q)
    chord = np.linalg.norm(w)  # below 1e-18 its square leaves the range of float32
    assert np.isfinite(offset).all()
    assert np.linalg.norm(offset) <= 2.4 * chord + 1e-6
    assert 0.999999 * chord - 1e-18 <= length[0, 0] <= 1.63 * chord + 1e-6


def test_opposed_and_equal_normals_give_the_projection() -> None:
    n = np.array([[0, 0, 1.0]])
    w = np.array([[0.3, -0.2, 0.5]])
    for other in (n, -n):
        assert rolled_out(w, n, other)[0].tolist() == np.array([[0.3, -0.2, 0]], np.float32).tolist()


def test_tangent_coordinates_are_right_handed() -> None:
    m, n, u = ([[3.0, 4, 5], [0.5, 0.99, 0]], [[0.0, 0, 1]] * 2, [[0.0, 1, 0], [1.0, 0, 0]])
    inputs = on_cpu(wp.vec3, m, n, u)
    xy, seen = (wp.zeros(2, dtype=dtype, device="cpu") for dtype in (wp.vec2, wp.bool))
    wp.launch(coordinates_of, 2, [*inputs, xy, seen], device="cpu")
    assert xy.numpy()[0].tolist() == [4, -3]
    assert seen.numpy().tolist() == [False, True]
