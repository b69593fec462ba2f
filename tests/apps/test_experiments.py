"""Shipped experiments: what their functions measure, and the tables that a sweep reproduces."""

import csv
import inspect
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from blobtree.graphics import install_advice, missing_gl_libraries
from decals.apps.cli import run as command
from decals.apps.experiments import SHIPPED, title
from decals.apps.experiments.blends import blends
from decals.apps.experiments.contact_modes import MODES, contact_modes
from decals.apps.experiments.contact_peers import METHODS, contact_peers, discs
from decals.apps.experiments.cost import cost
from decals.apps.experiments.evenness import DART_RHO, body, evenness
from decals.apps.experiments.evenness import METHODS as SCATTERINGS
from decals.apps.experiments.figure_14 import figure_14
from decals.apps.experiments.pressed_solids import pressed_solids
from decals.experiments import Design, report, run
from decals.scattering.neighbors import ideal_spacing

TABLES = Path(__file__).parents[2] / "docs" / "tables"
TOLERANCE = 1e-4
"""Largest difference between two machines, which round differently."""


@pytest.fixture
def gl() -> None:
    if missing := missing_gl_libraries():
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")


@pytest.mark.parametrize("name", SHIPPED)
def test_an_experiment_has_a_title_and_two_designs_for_its_function(name: Any) -> None:
    module = import_module(f"decals.apps.experiments.{name}")
    assert (module.__doc__ or "").startswith(title(name))
    assert module.experiment.__name__ == name, "a folder of results belongs to one experiment"
    assert len(module.design) < len(module.full)
    signature = inspect.signature(module.experiment)
    for design in (module.design, module.full):
        assert isinstance(design, Design)
        assert all(signature.bind(**trial) for trial in design)


def test_shipped_experiments_are_listed_and_found_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert command(["sweep", "--list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in SHIPPED)
    assert command(["sweep"]) == 2
    assert "--list" in capsys.readouterr().err
    monkeypatch.setattr(
        "decals.apps.experiments.blends.design", Design([{"blend": "union", "angle": 180, "resolution": 16}])
    )
    assert command(["sweep", "blends", "--workers", "0"]) == 0
    assert "blends: 1 rows, 0 failed" in capsys.readouterr().out


# -- the tables of the documentation --------------------------------------------------------------------


def numbers_of(path: Path) -> list[dict[str, Any]]:
    """Rows of a table, with numbers where cells are some."""

    def number(cell: str) -> Any:
        try:
            return float(cell)
        except ValueError:
            return cell

    with path.open(newline="") as lines:
        return [{name: number(cell) for name, cell in row.items()} for row in csv.DictReader(lines)]


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("blends", lambda blend, angle: angle == 180 and blend in ("sum", "union")),
        pytest.param("blends", lambda **_: True, marks=pytest.mark.slow),
        pytest.param("pressed_solids", lambda **_: True, marks=pytest.mark.slow),
    ],
)
def test_a_sweep_gives_the_table_of_the_documentation(name: Any, part: Any, tmp_path: Path) -> None:
    module = import_module(f"decals.apps.experiments.{name}")
    design = module.design.where(part)
    results = run(module.experiment, design, tmp_path / "out", workers=0)
    report(results, tmp_path / "table.csv")
    found, stated = numbers_of(tmp_path / "table.csv"), numbers_of(TABLES / f"{name}.csv")
    assert len(stated) == len(module.design)
    keys = [{parameter: row[parameter] for parameter in results.parameters} for row in found]
    stated = [row for row in stated if {name: row[name] for name in results.parameters} in keys]
    assert len(found) == len(stated) == len(design)
    for row, expected in zip(found, stated, strict=True):
        for column, value in expected.items():
            exact = not isinstance(value, float) or column in results.parameters
            assert row[column] == (value if exact else pytest.approx(value, rel=TOLERANCE, abs=TOLERANCE))


# -- functions ------------------------------------------------------------------------------------------


def test_the_bulge_of_a_sum_is_that_of_its_formula() -> None:
    """Along a straight bar two fields of ¼ meet in the joint."""
    exact = np.sqrt((1.0 - 0.25 ** (1 / 3)) / (1.0 - 0.5 ** (1 / 3))) - 1.0
    found = blends("sum", 180.0, resolution=64)
    assert found["bulge"] == pytest.approx(exact, abs=4e-3)
    assert found["volume"] > 1.2
    assert blends("union", 180.0, resolution=32)["bulge"] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("depth", "stiffness"), [(0.2, 1.0), (0.5, 1.0), (0.5, 8.0)])
def test_pressed_solids_share_their_contact_and_keep_their_volumes(depth: float, stiffness: float) -> None:
    free, kept = (pressed_solids(depth, stiffness, compensated=value) for value in (False, True))
    assert free["overlap"] == kept["overlap"] == 0.0
    if stiffness == 1.0:
        assert free["kept_soft"] == pytest.approx(free["kept_stiff"], abs=1e-3)
        assert free["contact_area"] == pytest.approx(1.0, abs=0.02)
    else:
        assert free["kept_soft"] < free["kept_stiff"]
    assert kept["kept_soft"] == pytest.approx(1.0, abs=3e-3)
    assert kept["kept_stiff"] == pytest.approx(1.0, abs=3e-3)


@pytest.mark.parametrize(
    "contact", [*MODES[:1], *(pytest.param(mode, marks=pytest.mark.slow) for mode in MODES[1:])]
)
def test_contact_keeps_the_area_beside_its_lines(contact: str) -> None:
    """Neighbours that do not touch each other each cut off a segment of the large disc."""
    found = contact_modes(contact, 0.1, 2.0)
    distance = 1.4
    cut = (distance**2 + 1.0 - 0.25) / (2.0 * distance)
    segment = np.arccos(cut) - cut * np.sqrt(1.0 - cut**2)
    by_plane = 1.0 - 5.0 * segment / np.pi
    assert found["folded"] == 0.0
    if contact in ("radial", "elastic"):
        assert found["kept_large"] == pytest.approx(by_plane, abs=0.01)
    else:
        assert found["kept_large"] < by_plane
    assert 0.9 < found["kept_small"] < 1.0


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
def test_contact_is_drawn_on_request() -> None:
    assert np.asarray(contact_modes("radial", 0.5, 2.0, picture=True)["picture"]).std() > 10


def overlap_of_discs(first: float, second: float, distance: float) -> float:
    """Area of the lens of two discs."""
    angles = [
        np.arccos((distance**2 + a**2 - b**2) / (2.0 * distance * a))
        for a, b in ((first, second), (second, first))
    ]
    return float(sum(r**2 * (a - np.sin(2 * a) / 2) for r, a in zip((first, second), angles, strict=True)))


def test_discs_overlap_as_much_as_their_lenses() -> None:
    found = contact_peers("none", 0.9, count=2, seed=0)
    centers, radii = discs(0.9, 2, 0)
    first, second = radii
    distance = float(np.linalg.norm(centers[0] - centers[1]))
    assert found["free_overlap"] == pytest.approx(overlap_of_discs(first, second, distance), abs=0.003)
    assert found["overlap"] == found["free_overlap"]
    assert found["kept"] == 1.0
    assert found["moved"] == 0.0


@pytest.mark.parametrize(
    "method",
    [
        "elastic",
        *(pytest.param(name, marks=pytest.mark.slow) for name in METHODS if name not in ("none", "elastic")),
    ],
)
def test_methods_remove_the_overlap_of_discs(method: str) -> None:
    free, found = (contact_peers(name, 0.7, count=8, seed=1) for name in ("none", method))
    assert free["overlap"] > 0.01
    assert found["overlap"] < 0.05 * free["overlap"]
    assert 0.2 < found["kept_least"] <= found["kept"] <= 1.0
    if method in MODES:
        assert found["covered"] == pytest.approx(free["covered"], abs=1e-3)
    if method == "kept area":
        assert found["kept"] > contact_peers("product", 0.7, count=8, seed=1)["kept"]
        assert found["covered"] > free["covered"]
    if method == "repulsion":
        assert found["moved"] > 0.05


def test_darts_keep_their_distance_and_leave_no_room() -> None:
    surface = body(0.0, 1.0)
    darts = SCATTERINGS["darts"](surface, 100, 0, 0)
    radius = DART_RHO * ideal_spacing(surface.area, 100)
    distances, _ = cKDTree(darts).query(darts, k=2)
    assert distances[:, 1].min() >= radius
    samples, _ = surface.sample(20_000, 5)
    assert cKDTree(darts).query(samples)[0].max() < 1.1 * radius


@pytest.mark.slow
def test_longer_schedules_are_more_even_than_darts_and_lloyd() -> None:
    rho = [evenness("scatter", count=300, steps=steps)["rho"] for steps in (3, 30, 150)]
    assert all(shorter < longer for shorter, longer in pairwise(rho))
    assert all(evenness(name, count=300)["rho"] < rho[-1] for name in ("darts", "lloyd"))
    assert evenness("scatter", count=300, thickness=0.25)["spacing"] > 0.2


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
def test_figure_14_stands_beside_that_of_the_paper() -> None:
    found = figure_14("knot", 100, width=64, height=48)
    assert found["paper_index"] == 897
    assert found["frame_ms"]
    assert figure_14("knot", 20, width=64, height=48).get("paper_index") is None


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
def test_costs_are_those_of_the_number_of_decals() -> None:
    few, many = cost(20), cost(200)
    assert all(value > 0 for value in few.values())
    assert few["index_kb"] < many["index_kb"]
