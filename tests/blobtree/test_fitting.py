"""Fits: parameters come back from exact samples; noise is measured; ranges hold; bad input is refused."""

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import (
    Box,
    Node,
    Point,
    Ricci,
    Segment,
    Torus,
    fit,
    numeric_parameters,
    polygonize,
    with_numeric_values,
)
from blobtree.errors import Cancelled, InvalidNode, InvalidPoints
from tests.bench.fitting import perturbed, random_model, recovery_error, samples_in
from tests.blobtree.tape.evaluations import project

Numbers = NDArray[np.float64]

MODEL = Ricci(
    (
        Point((0, 0, 0), radius=1.0),
        Segment((0.5, 0, 0), (2, 0.3, 0), radius=0.4),
        Torus((0, 0, 0.8), (0.2, 0, 1), 0.9, radius=0.25),
    ),
    exponent=2.0,
)


def surface_samples(node: Node, count: int) -> tuple[Numbers, Numbers]:
    """Return points on the surface and the normals there, both exact."""
    vertices = polygonize(node, resolution=24).vertices
    chosen = np.random.default_rng(0).permutation(len(vertices))[:count]
    points, normals = project(node.tape, vertices[chosen], 0.1)
    return points.astype(np.float64), normals.astype(np.float64)


def test_parameters_come_back_from_field_values() -> None:
    start = perturbed(MODEL, np.random.default_rng(1))
    points = samples_in(MODEL, np.random.default_rng(2), 500)
    found = fit(start, points, MODEL(points))
    assert found.converged
    assert recovery_error(found.tree, MODEL) < 1e-3
    assert recovery_error(start, MODEL) > 0.02
    assert np.abs(found.residuals).max() < 1e-5
    assert found.normal_residuals is None
    assert found.values.shape == (len(found.parameters),) == (len(numeric_parameters(MODEL)),)


@pytest.mark.parametrize("with_normals", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_parameters_come_back_from_the_surface(with_normals: bool) -> None:
    points, normals = surface_samples(MODEL, 400)
    start = with_numeric_values(
        perturbed(MODEL, np.random.default_rng(3), amount=0.4), numeric_parameters(MODEL)[:1], [2.0]
    )
    found = fit(start, points, normals=normals if with_normals else None, fixed=["exponent"])
    assert np.abs(found.residuals).max() < 1e-5
    if with_normals:
        assert found.normal_residuals is not None
        assert np.abs(found.normal_residuals).max() < 1e-3


def test_random_trees_come_back() -> None:
    rng = np.random.default_rng(7)
    model = random_model(rng, 4)
    points = samples_in(model, rng, 800)
    found = fit(perturbed(model, rng), points, model(points))
    assert recovery_error(found.tree, model) < 1e-3


def test_fixed_parameters_stay() -> None:
    points, _ = surface_samples(MODEL, 300)
    start = perturbed(MODEL, np.random.default_rng(3), amount=0.3)
    one = numeric_parameters(start)[-1]
    found = fit(start, points, fixed=["center", (1,), one], max_evaluations=4)
    names = {(parameter.path, parameter.name) for parameter in found.parameters}
    assert names == {((), "exponent"), ((0,), "radius"), ((2,), "axis"), ((2,), "ring_radius")}
    assert isinstance(found.tree, Ricci)
    assert isinstance(start, Ricci)
    assert found.tree.operands[1] == start.operands[1]
    assert not found.converged
    moved = Point((0, 0, 0), radius=1.0).translate((1, 0, 0))
    assert {parameter.name for parameter in fit(moved, points).parameters} == {"center", "radius"}
    assert "matrix" in {
        parameter.name for parameter in fit(moved, points, fixed=(), max_evaluations=2).parameters
    }


def test_the_covariance_states_the_error_of_noisy_samples() -> None:
    rng = np.random.default_rng(5)
    model = Point((0, 0, 0), radius=1.0)
    points = samples_in(model, rng, 400)
    ratios = []
    for _ in range(12):
        noisy = model(points) + rng.normal(0.0, 0.01, len(points))
        found = fit(Point((0.1, 0, 0), radius=1.1), points, noisy)
        ratios.append((found.values - [0.0, 0.0, 0.0, 1.0]) / found.standard_errors)
    assert 0.7 < np.std(ratios) < 1.3
    assert np.std(found.residuals) == pytest.approx(0.01, rel=0.2)


def test_a_parameter_that_no_sample_depends_on_has_an_infinite_error() -> None:
    far = Point((0, 0, 0), radius=1.0) + Point((50, 0, 0), radius=1.0)
    points = samples_in(Point((0, 0, 0), radius=1.1), np.random.default_rng(0), 50)
    found = fit(far, points, Point((0, 0, 0), radius=1.1)(points))
    assert np.isinf(found.standard_errors[4:]).all()
    assert np.isfinite(found.standard_errors[:4]).all()
    assert found.values[3] == pytest.approx(1.1, abs=1e-4)


def test_ranges_hold() -> None:
    points = np.random.default_rng(0).normal(size=(60, 3))
    found = fit(Box((0, 0, 0), (0.5, 0.0, 0.5), radius=0.6), points, np.zeros(60), max_evaluations=15)
    assert isinstance(found.tree, Box)
    assert min(found.tree.size) >= 0.0
    assert found.tree.radius > 0.0
    blend = fit(
        Ricci((Point((0, 0, 0), radius=1.0),) * 2, exponent=1.5), points, np.full(60, 2.0), max_evaluations=9
    )
    assert isinstance(blend.tree, Ricci)
    assert blend.tree.exponent >= 1.0


def test_bad_input_is_refused() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    points = np.eye(3)
    with pytest.raises(InvalidNode, match="expected a BlobTree node"):
        fit("ball", points)  # type: ignore[arg-type]
    with pytest.raises(InvalidNode, match=r"expected names of parameters \(center, radius\).*got 'colour'"):
        fit(ball, points, fixed=["colour"])
    with pytest.raises(InvalidNode, match="got all of them"):
        fit(ball, points, fixed=[()])
    with pytest.raises(InvalidPoints, match=r"at least as many numbers as free parameters \(4\), got 3"):
        fit(ball, points)
    with pytest.raises(InvalidPoints, match="values: expected 3 finite numbers"):
        fit(ball, points, [1.0], fixed=["radius"])
    with pytest.raises(InvalidPoints, match="normals: expected 3 vectors"):
        fit(ball, points, normals=np.zeros((3, 3)), fixed=["radius"])
    with pytest.raises(InvalidPoints):
        fit(ball, [[np.inf, 0, 0]])
    with pytest.raises(InvalidPoints, match="within reach of the start's field, got none"):
        fit(ball, points + 9.0, fixed=["radius"])
    with pytest.raises(Cancelled):
        fit(ball, points, fixed=["radius"], cancel=lambda: True)
