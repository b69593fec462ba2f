"""Meshes by chord error: accurate enough, without many more triangles than needed."""

from typing import Any

import numpy as np
import pytest

from blobtree import Cone, Mesh, Node, Point, Segment, polygonize
from blobtree._typing import Float64Array
from blobtree.errors import InvalidResolution
from blobtree.kernels import COMPILING
from tests.blobtree.meshing.test_polygonize import assert_closed

BALL = Point((0, 0, 0), radius=1.0)
CUT = BALL - Point((0.8, 0.13, 0.07), radius=0.9)


def points_on(mesh: Mesh, each: int = 40) -> Float64Array:
    """Return `each` random points of every triangle."""
    weights = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), (len(mesh.faces), each))
    points = np.einsum("fsk,fkd->fsd", weights, mesh.vertices[mesh.faces].astype(np.float64))
    return np.asarray(points.reshape(-1, 3))


@pytest.mark.slow_cases("0.001-0.0005", "1.0-0.0005", "1000.0-0.0005")
@pytest.mark.parametrize("error", [0.05, 0.005, 0.0005])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_ball_meets_its_chord_error(error: float, scale: float) -> None:
    mesh = polygonize(BALL.scale(scale), chord_error=error * scale)
    assert_closed(mesh)
    farthest = np.abs(np.linalg.norm(points_on(mesh), axis=1) / scale - 1.0).max()
    assert farthest <= error
    if error < 0.02:
        assert farthest > 0.4 * error


@pytest.mark.parametrize(
    "tree",
    [
        BALL + Point((1.2, 0, 0), radius=0.5),
        Cone((0, 0, 0), (2, 0, 0), radius=0.6, end_radius=0.2),
        (Segment((-1, 0, 0), (1, 0, 0), radius=0.4) | Segment((0, -1, 0), (0, 1, 0), radius=0.4)),
    ],
    ids=["blend", "cone", "union"],
)
def test_other_shapes(tree: Node) -> None:
    """Distances along the gradient, which are right to first order."""
    error = 0.004
    points = points_on(polygonize(tree, chord_error=error, creases=True), each=10)
    distances = np.abs(tree(points) - 0.5) / np.linalg.norm(tree.gradient(points), axis=1)
    assert distances.max() <= 1.1 * error


def test_creases_need_fewer_triangles() -> None:
    """An edge that is cut off lies as far away as a cell is large, one that is kept lies exact."""
    for adaptive, gain in ((False, 4), (True, 2)):
        plain, sharp = (
            polygonize(CUT, chord_error=0.02, creases=creases, adaptive=adaptive) for creases in (False, True)
        )
        assert len(plain.faces) > gain * len(sharp.faces)


def test_a_tenth_of_the_error_takes_ten_times_the_triangles() -> None:
    counts = [len(polygonize(BALL, chord_error=error).faces) for error in (2e-3, 2e-4)]
    assert 5.0 < counts[1] / counts[0] < 20.0


def test_a_tree_without_surface() -> None:
    assert len(polygonize(BALL & BALL.translate((9, 0, 0)), chord_error=0.01).faces) == 0


@pytest.mark.parametrize("bad", [0.0, -0.1, float("nan"), float("inf")])
def test_invalid_chord_errors_are_refused(bad: float) -> None:
    with pytest.raises(InvalidResolution, match="chord_error: expected a finite length above 0"):
        polygonize(BALL, chord_error=bad)


@pytest.mark.parametrize("other", [{"resolution": 9}, {"cell_size": 0.1}])
def test_several_sizes_are_refused(other: dict[str, Any]) -> None:
    with pytest.raises(InvalidResolution, match="drop the others"):
        polygonize(BALL, chord_error=0.1, **other)


def test_chord_errors_below_float32_are_refused() -> None:
    with pytest.raises(InvalidResolution, match="below what float32 can tell"):
        polygonize(BALL, chord_error=1e-12)
    with pytest.raises(InvalidResolution, match="below what float32 can tell"):
        polygonize(BALL.translate((1e6, 0, 0)), chord_error=1e-3)


def test_progress_names_the_passes_and_never_decreases() -> None:
    told: list[tuple[str, float]] = []
    polygonize(BALL, chord_error=2e-3, creases=True, progress=lambda stage, part: told.append((stage, part)))
    told = [report for report in told if not report[0].startswith(COMPILING)]
    assert [stage for stage, _ in told] == sorted(stage for stage, _ in told)
    for stage in ("meshing, pass 1", "meshing, pass 2"):
        fractions = [part for name, part in told if name == stage]
        assert fractions == sorted(fractions)
        assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_a_mesh_of_too_many_triangles_is_refused_before_its_pass() -> None:
    with pytest.raises(InvalidResolution, match=r"chord_error: 1e-05 takes about .* max_triangles = 50,000"):
        polygonize(BALL, chord_error=1e-5, max_triangles=50_000)
    allowed = polygonize(BALL, chord_error=2e-3, max_triangles=20_000)
    assert len(allowed.faces) <= 20_000
    for wrong in (0, 1.5, "many"):
        with pytest.raises(InvalidResolution, match="max_triangles: expected a whole number from 1"):
            polygonize(BALL, chord_error=0.1, max_triangles=wrong)  # type: ignore[arg-type]


def test_many_triangles_are_announced_after_the_first_pass(caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(InvalidResolution):
        polygonize(BALL, chord_error=3e-6, max_triangles=50_000)
    (message,) = [record.getMessage() for record in caplog.records if "chord_error" in record.getMessage()]
    millions = int(message.split("about ")[1].split(" million")[0])
    assert 3 <= millions <= 7  # 140,652 triangles at 1e-4
    caplog.clear()
    polygonize(BALL, chord_error=0.01)
    assert not any("chord_error" in record.getMessage() for record in caplog.records)
