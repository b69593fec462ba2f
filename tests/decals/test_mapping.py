"""Mapping against analytic log maps; what happens where normals agree or oppose each other."""

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

from decals.field.evaluate import evaluate
from decals.field.mapping import Mapping, surface_offset, tangent_coordinates
from decals.model import Decals

wp.set_module_options({"enable_backward": False})


@wp.kernel
def offsets_of(
    w: wp.array(dtype=wp.vec3),
    n_p: wp.array(dtype=wp.vec3),
    n_q: wp.array(dtype=wp.vec3),
    mapping: wp.int32,
    offsets: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    offsets[i] = surface_offset(w[i], n_p[i], n_q[i], mapping)


@wp.kernel
def coordinates_of(
    m: wp.array(dtype=wp.vec3),
    n: wp.array(dtype=wp.vec3),
    u: wp.array(dtype=wp.vec3),
    xy: wp.array(dtype=wp.vec2),
):
    i = wp.tid()
    xy[i] = tangent_coordinates(m[i], n[i], u[i])


def mapped(w, n_p, n_q, mapping=Mapping.CORRECTED):
    inputs = [wp.array(np.float32(a).reshape(-1, 3), dtype=wp.vec3, device="cpu") for a in (w, n_p, n_q)]
    result = wp.zeros(len(inputs[0]), dtype=wp.vec3, device="cpu")
    wp.launch(offsets_of, len(result), [*inputs, int(mapping), result], device="cpu")
    return result.numpy().astype(np.float64)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def tangents(rng, normals):
    return unit(np.cross(normals, rng.normal(size=normals.shape)))


def dots(a, b):
    return (a * b).sum(axis=1, keepdims=True)


# -- surfaces with a closed log map -----------------------------------------------------------------


def plane(rng, n):
    normal = np.repeat(unit(rng.normal(size=(1, 3))), n, axis=0)
    log = tangents(rng, normal) * rng.random((n, 1))
    return log, normal, normal, log


def sphere(rng, n):
    n_p = unit(rng.normal(size=(n, 3)))
    angle = rng.uniform(0, 0.9 * np.pi, (n, 1))
    u = tangents(rng, n_p)
    n_q = np.cos(angle) * n_p + np.sin(angle) * u
    return n_q - n_p, n_p, n_q, angle * u


def cylinder(rng, n):
    start, angle = rng.uniform(-np.pi, np.pi, n), rng.uniform(-0.9 * np.pi, 0.9 * np.pi, n)
    rise = rng.uniform(-2, 2, n)

    def ring(a):
        return np.column_stack([np.cos(a), np.sin(a), np.zeros(n)])

    n_p, n_q = ring(start), ring(start + angle)
    axis = np.array([0, 0, 1.0]) * rise[:, None]
    return n_q - n_p + axis, n_p, n_q, angle[:, None] * ring(start + np.pi / 2) + axis


@pytest.mark.parametrize("surface", [plane, sphere, cylinder])
@pytest.mark.parametrize("inside_out", [1, -1])
def test_exact_on(surface, inside_out):
    w, n_p, n_q, log = surface(np.random.default_rng(0), 20_000)
    error = mapped(w, inside_out * n_p, inside_out * n_q) - log
    assert np.abs(error).max() <= (5e-7 if surface is plane else 1e-5)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-5, 9.9e-5, 1.1e-4, 1e-3, 0.05, 0.2, 0.21])
def test_every_small_angle_on_the_sphere(angle):
    """No step at the seam of the flat case."""
    rng = np.random.default_rng(1)
    n_p = unit(rng.normal(size=(2000, 3)))
    u = tangents(rng, n_p)
    n_q = np.cos(angle) * n_p + np.sin(angle) * u
    assert np.abs(mapped(np.sin(angle) * u + (np.cos(angle) - 1) * n_p, n_p, n_q) - angle * u).max() < 3e-7


def test_chord_projects():
    rng = np.random.default_rng(2)
    n_p, n_q = unit(rng.normal(size=(2, 1000, 3)))
    w = rng.normal(size=(1000, 3))
    assert mapped(w, n_p, n_q, Mapping.CHORD) == pytest.approx(w - dots(w, n_p) * n_p, abs=1e-6)


# -- surfaces without one: geodesics, integrated ----------------------------------------------------


def torus_gradient(x):
    ring = np.hypot(x[:, 0], x[:, 1])[:, None]
    return np.column_stack([x[:, :2] * (1 - 1 / ring), x[:, 2]])


def torus_points(rng, n):
    a, b = rng.uniform(0, 2 * np.pi, (2, n))
    ring = 1 + 0.4 * np.cos(b)
    return np.column_stack([ring * np.cos(a), ring * np.sin(a), 0.4 * np.sin(b)])


AXES = np.array([1.0, 0.7, 0.45])


def ellipsoid_gradient(x):
    return x / AXES**2


def ellipsoid_points(rng, n):
    d = unit(rng.normal(size=(n, 3)))
    return d / np.linalg.norm(d / AXES, axis=1, keepdims=True)


def walk(gradient, start, direction, length, steps=100):
    """End points of geodesics of the implicit surface with this gradient: Runge-Kutta of order four."""
    h = length / steps

    def acceleration(x, v):
        g = gradient(x)
        bend = (gradient(x + 1e-5 * v) - gradient(x - 1e-5 * v)) / 2e-5
        return -dots(v, bend) / dots(g, g) * g

    x, v = start, direction
    for _ in range(steps):
        a1 = acceleration(x, v)
        v2 = v + h / 2 * a1
        a2 = acceleration(x + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = acceleration(x + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4)
        x, v = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x


DECAL = 0.5


def discs(rng, points, gradient, n=4000):
    """Chords, normals and log maps of points around random centres, out to the rim of a large decal."""
    p = points(rng, n)
    n_p = unit(gradient(p))
    log = tangents(rng, n_p) * rng.uniform(0, DECAL, (n, 1))
    length = np.linalg.norm(log, axis=1, keepdims=True)
    q = walk(gradient, p, log / length, length)
    return q - p, n_p, unit(gradient(q)), log


@pytest.mark.parametrize(
    ("points", "gradient", "limit"),
    [(torus_points, torus_gradient, 0.003), (ellipsoid_points, ellipsoid_gradient, 0.0045)],
)
def test_error_on_curved_surfaces(points, gradient, limit):
    w, n_p, n_q, log = discs(np.random.default_rng(3), points, gradient)

    def rms(offsets):
        return np.sqrt(((offsets - log) ** 2).sum(axis=1).mean()) / DECAL

    corrected = mapped(w, n_p, n_q)
    projected = mapped(w, n_p, n_q, Mapping.CHORD)
    print(f"{points.__name__}: corrected {rms(corrected):.3%}, chord {rms(projected):.3%} of the radius")
    assert rms(corrected) <= limit
    assert rms(projected) > 5 * rms(corrected)
    assert (np.linalg.norm(corrected, axis=1) >= 0.99 * np.linalg.norm(w, axis=1)).all()


@pytest.mark.parametrize(
    ("points", "gradient", "radius"),
    [(torus_points, torus_gradient, 0.2), (ellipsoid_points, ellipsoid_gradient, 0.1)],
)
def test_what_is_drawn_of_decals_up_to_half_the_radius_of_curvature(points, gradient, radius):
    """The field takes the chord for a length; the least radii of curvature are 0.4 and 0.45²."""
    rng, errors = np.random.default_rng(4), []
    for p in points(rng, 60):
        start = np.repeat(p[None], 50, axis=0)
        n_p = unit(gradient(start))
        log = tangents(rng, n_p) * rng.uniform(0, radius, (50, 1))
        length = np.linalg.norm(log, axis=1, keepdims=True)
        q = walk(gradient, start, log / length, length, steps=40)
        one = Decals(start[:1], n_p[:1], log[:1], [radius])
        uv = evaluate(one, q, unit(gradient(q)), device="cpu").uv.astype(np.float64)
        axes = np.stack([one.tangents[0], one.bitangents[0]]).astype(np.float64)
        errors.append(2 * radius * (uv - 0.5) - log @ axes.T)
    rms = np.sqrt((np.concatenate(errors) ** 2).sum(axis=1).mean()) / radius
    print(f"{points.__name__}: drawn {rms:.3%} of the radius")
    assert rms <= 0.005


# -- hostile ----------------------------------------------------------------------------------------

coordinate = st.floats(-1, 1, width=32)
vector = st.tuples(coordinate, coordinate, coordinate).map(np.array)
direction = vector.filter(lambda v: np.linalg.norm(v) > 1e-3).map(unit)


@settings(max_examples=150, deadline=None)
@given(w=vector, n_p=direction, n_q=direction, opposed=st.booleans(), noise=vector, size=st.floats(0, 1e-3))
def test_finite_tangent_and_bounded(w, n_p, n_q, opposed, noise, size):
    if opposed:
        n_q = unit(-n_p + size * noise)
    for mapping in Mapping:
        m = mapped(w, n_p, n_q, mapping)[0]
        assert np.isfinite(m).all()
        assert abs(m @ np.float32(n_p)) < 4e-3
        assert np.linalg.norm(m) <= 2.4 * np.linalg.norm(w) + 1e-6


def test_opposed_and_equal_normals_give_the_projection():
    n = np.array([[0, 0, 1.0]])
    w = np.array([[0.3, -0.2, 0.5]])
    for other in (n, -n):
        assert mapped(w, n, other).tolist() == np.float32([[0.3, -0.2, 0]]).tolist()


def test_tangent_coordinates_are_right_handed():
    m, n, u = ([[3, 4, 5]], [[0, 0, 1]], [[0, 1, 0]])
    inputs = [wp.array(np.float32(a), dtype=wp.vec3, device="cpu") for a in (m, n, u)]
    xy = wp.zeros(1, dtype=wp.vec2, device="cpu")
    wp.launch(coordinates_of, 1, [*inputs, xy], device="cpu")
    assert xy.numpy().tolist() == [[4, -3]]
