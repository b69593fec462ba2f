"""What the literature says of the nodes on docs/published-nodes.md, in NumPy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree.transpile.python import plain_python, vector

Session = dict[str, Any]
Floats = NDArray[np.float64]
GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0


def plain(session: Session, name: str) -> Callable[..., Any]:
    """Return a typed function of the page as plain Python."""
    return plain_python(session[name].func)


def slope(function: Callable[[Floats], float], q: Floats, step: float = 1e-5) -> Floats:
    """Return the gradient by central differences."""
    steps = step * np.eye(len(q))
    return np.array([(function(q + e) - function(q - e)) / (2.0 * step) for e in steps])


def check_all(session: Session) -> None:
    """Check every node of the page."""
    rng = np.random.default_rng(0)
    check_skeletons(session, rng)
    check_conic(session, rng)
    check_displaced(session)
    check_molecule(session, rng)
    check_fields(session, rng)
    check_cauchy(session, rng)
    check_barth(session, rng)
    check_swirl(session, rng)


def check_skeletons(session: Session, rng: np.random.Generator) -> None:
    """No point of dense samples of a ring or of three bars is nearer than the returned one."""
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    rings = [r * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn]) for r in np.linspace(0.5, 1.0, 30)]
    bars = [np.outer(np.linspace(-0.9, 0.9, 400), axis) for axis in np.eye(3)]
    for name, values, samples in (("annulus", (0.5, 1.0), rings), ("jack", (0.9,), bars)):
        closest, cloud = plain(session, name), np.concatenate(samples)
        for q in rng.normal(size=(20, 3)):
            distance = np.linalg.norm(q - closest(vector(*q), *values))
            nearest = np.linalg.norm(cloud - q, axis=1).min()
            assert nearest - 0.02 < distance <= nearest + 1e-12


def check_conic(session: Session, rng: np.random.Generator) -> None:
    """Values lie on the conic of Hoffmann & Hopcroft, which is tangent to both axes."""
    conic, width = plain(session, "conic"), 0.3
    for a, b in rng.uniform(0.21, 1.0, (20, 2)):
        for mu in (-3.0, -0.5, 0.0, 0.5, 0.9):
            value = conic(a, b, width, mu)
            s, t, r = value - a, value - b, value - (0.5 - width)
            assert abs(s * s + t * t + r * r - 2 * r * s - 2 * r * t + 2 * mu * s * t) < 1e-12
            assert 0.0 <= s <= r
            assert 0.0 <= t <= r
    assert conic(0.7, 0.2 + 1e-9, width, 0.0) == pytest.approx(0.7, abs=1e-9)
    tangent = slope(lambda p: conic(p[0], p[1], width, 0.0), np.array([0.7, 0.2 + 1e-6]), 1e-7)
    np.testing.assert_allclose(tangent, [1.0, 0.0], atol=1e-5)


def check_displaced(session: Session) -> None:
    """Pasko's displacement is largest where both potentials are 0."""
    displaced = plain(session, "displaced")
    lift = [[displaced(a, b, 1.0, 0.2) - max(a, b) for b in (0.1, 0.5, 0.9)] for a in (0.1, 0.5, 0.9)]
    assert np.argmax(lift) == 4
    assert lift[1][1] == 0.25


def check_molecule(session: Session, rng: np.random.Generator) -> None:
    """The field is half of Blinn's density Σ exp(B (r²/R² − 1)), and so ½ at his threshold."""
    field = plain(session, "water")
    centers, radii = [(0, 0, 0), (-0.76, -0.58, 0), (0.76, -0.58, 0)], [0.8, 0.5, 0.5]
    for q in rng.uniform(-1.5, 1.5, (20, 3)):
        squares = ((q - centers) ** 2).sum(axis=1) / np.square(radii)
        value, *gradient = field(vector(*q), -1.6)
        np.testing.assert_allclose(value, 0.5 * np.exp(-1.6 * (squares - 1.0)).sum())
        numeric = slope(lambda p: field(vector(*p), -1.6)[0], q)
        np.testing.assert_allclose(gradient, numeric, atol=1e-6)


def check_fields(session: Session, rng: np.random.Generator) -> None:
    """The D surface by another form of its equation; rods by distances from periodic lines."""
    diamond, rods, ripples = (plain(session, name) for name in ("diamond", "rods", "ripples"))
    for q in rng.uniform(-1.0, 1.0, (20, 3)):
        x, y, z = 2.0 * np.pi * q
        level = np.cos(x - y) * np.sin(z) + np.sin(x + y) * np.cos(z)
        distance = level / (2.0 * np.pi * 1.49)
        np.testing.assert_allclose(diamond(vector(*q), 1.0, 0.1), 1.0 / (1.0 + (distance / 0.05) ** 2))
        away = q - np.round(q / 0.5) * 0.5
        distance = np.sqrt(np.sum(away**2) - np.max(away**2))
        expected = 1.0 / (1.0 + (distance / 0.08) ** 2)
        assert rods(vector(*q), 0.5, 0.08) >= expected
        if distance < 0.05:
            assert abs(rods(vector(*q), 0.5, 0.08) - expected) < 0.02
        assert 0.0 <= ripples(vector(*q), 12.0, 0.12) <= 1.0


def check_cauchy(session: Session, rng: np.random.Generator) -> None:
    """The closed form is the integral of McCormack & Sherstyuk's kernel; a long line is ½ at its radius."""
    line = plain(session, "cauchy_line")
    half, limb, sharpness = 1.2, 0.35, 1.5
    along, step = np.linspace(-half, half, 4001, retstep=True)
    weights = step * np.r_[0.5, np.ones(3999), 0.5] * sharpness / limb
    long_line = 0.5 * np.pi / (1.0 + sharpness**2) ** 1.5
    for q in rng.uniform(-1.0, 1.0, (10, 3)):
        squares = (q[0] - along) ** 2 + q[1] ** 2 + q[2] ** 2
        integral = (weights / (1.0 + (sharpness / limb) ** 2 * squares) ** 2).sum()
        computed = line(vector(*q), half, limb, sharpness)
        np.testing.assert_allclose(computed, 0.5 * integral / long_line, rtol=1e-5)
    assert abs(line(vector(0.0, 0.0, limb), 100.0, limb, sharpness) - 0.5) < 1e-5


def check_barth(session: Session, rng: np.random.Generator) -> None:
    """Nodes lie where the unit sphere meets two of the six planes: value ½, gradient 0."""
    barth = plain(session, "barth")
    for signs in ((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1)):
        node = np.array([1.0, GOLDEN, GOLDEN**2]) * signs
        node /= np.linalg.norm(node)
        assert abs(barth(vector(*node), 0.5) - 0.5) < 1e-12
        assert np.linalg.norm(slope(lambda p: barth(vector(*p), 0.5), node, 1e-4)) < 1e-5
    other = rng.normal(size=3)
    assert np.linalg.norm(slope(lambda p: barth(vector(*p), 0.01), other / np.linalg.norm(other))) > 1e-3


def check_swirl(session: Session, rng: np.random.Generator) -> None:
    """A swirl keeps volumes and distances from its centre, and moves nothing beyond its reach."""
    swirl = plain(session, "swirl")
    for q in rng.uniform(-1.2, 1.2, (20, 3)):
        image = swirl(vector(*q), vector(0, 0, 0), vector(0, 0, 2), 2.0, 1.6)
        np.testing.assert_allclose(np.linalg.norm(image), np.linalg.norm(q))
        jacobian = [
            slope(lambda p, i=i: swirl(vector(*p), vector(0, 0, 0), vector(0, 0, 2), 2.0, 1.6)[i], q)  # type: ignore[misc]
            for i in range(3)
        ]
        assert abs(np.linalg.det(jacobian) - 1.0) < 1e-7
        if np.linalg.norm(q) > 1.6:
            np.testing.assert_allclose(image, q)
