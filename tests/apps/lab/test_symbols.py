"""Symbols of lessons: definitions in texts, formulas with live numbers, and all values at the probe."""

import re
from typing import Any

import numpy as np
import pytest

from decals import Contact, Decals, Interaction, TreeObject
from decals.apps.lab.experiment import Scope
from decals.apps.lab.lab import measured
from decals.apps.lab.lesson import LESSONS, Lesson, load_lessons, shown
from decals.apps.lab.plots import LEFT, RIGHT, SAMPLES, WIDTH, drawn
from decals.apps.lab.symbols import DEFINITIONS, PUSHED, acting, document, marked, readings, table
from decals.field.rules import PictureRules
from tests.apps.lab.test_lab import plain
from tests.apps.lab.test_measures import BALLS, TWO, experiment
from tests.oracles.contact import RIM, contact_field, falloff


@pytest.fixture(scope="module")
def lessons() -> list[Lesson]:
    return load_lessons(LESSONS)


def at(x: float, y: float, decals: Decals = TWO, **changes: Any) -> dict[str, list[float]]:
    state = experiment(decals=decals, probe=(x, y, 0.0), **changes)
    return dict(readings(Scope.at_probe(state)))


def test_readings_at_points_are_those_of_the_float64_formulas() -> None:
    random = np.random.default_rng(4)
    for _ in range(40):
        x, y = random.uniform(-0.7, 1.4), random.uniform(-0.6, 0.7)
        found = at(x, y)
        distances = np.linalg.norm(np.array([x, y, 0.0]) - TWO.positions.astype(np.float64), axis=1)
        influence = TWO.radii.astype(np.float64) / RIM
        d = distances / influence
        f = falloff(d)
        assert found["decal"] == [0, 1]
        np.testing.assert_allclose(found["r"], TWO.radii, rtol=1e-6)
        np.testing.assert_allclose(found["s"], influence, rtol=1e-6)
        np.testing.assert_allclose(found["d"], d, atol=2e-6)
        np.testing.assert_allclose(found["f = g(d)"], f, atol=2e-6)
        (factor,), (after,) = found["h"], found["F"]
        expected = contact_field(f[None])[0]
        if np.isfinite(expected) and abs(f[0] - f[1]) > 1e-3 and f.max() > 0.505:
            assert after == pytest.approx(expected, abs=3e-4)
            assert factor == pytest.approx((expected - 0.5) / (f.max() - 0.5), abs=3e-3)
        elif f.max() < 0.499:
            assert np.isnan(factor)
            assert after == pytest.approx(f.max(), abs=2e-6)


def test_the_two_strongest_decals_are_read() -> None:
    row = Decals([[x, 0, 0] for x in (0.0, 0.7, 1.4, 2.1)], [[0, 0, 1]] * 4, [[1, 0, 0]] * 4, [0.5] * 4)
    assert at(1.3, 0.0, row)["decal"] == [1, 2]
    assert at(1.5, 0.0, row)["decal"] == [2, 3]
    over = row.replace(layers=[0, 0, 0, 1])
    assert at(1.7, 0.0, over)["decal"] == [2, 3]  # the upper one shows there
    assert at(1.7, 0.0, over)["h"] == [1.0]  # decals of other layers push none
    overlapping = TWO.replace(interactions=[Interaction.OVERLAP, Interaction.PUSH])
    assert at(0.3, 0.0, overlapping)["h"] == [1.0]
    assert len(at(0.1, 0.0, Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.5))["f = g(d)"]) == 1
    assert at(0.0, 0.0, Decals.empty()) == {}


def test_h_is_unknown_in_modes_without_it() -> None:
    for mode in Contact:
        (factor,) = at(0.3, 0.0, rules=PictureRules(contact=mode))["h"]
        assert np.isnan(factor) is np.bool_(mode not in (Contact.PRODUCT, Contact.MIN))


def test_fields_of_solids_are_read_in_space() -> None:
    state = experiment(
        objects=(TreeObject("balls", BALLS),), decals=Decals.empty(), in_space=True, probe=(0.1, 0.2, 0)
    )
    found = dict(readings(Scope.at_probe(state)))
    expected = falloff(np.hypot([0.9, 0.7], 0.2) * RIM)
    np.testing.assert_allclose(found["f"], expected, atol=2e-6)
    assert found["solid"] == [0, 1]
    assert found["F"][0] == pytest.approx(0.5 - (expected[1] - expected[0]), abs=1e-4) or found["F"][0] < 0.5


def test_symbols_are_marked_where_they_stand_alone() -> None:
    for symbol in DEFINITIONS:
        assert f">{symbol}₁</abbr>" in marked(f"the {symbol}₁ of it")
        assert f'title="{symbol}: ' in marked(f"({symbol})")
    for text in ("for owner's and q’s", "fields", "F2", "a<b d='f'>", "&gt; &lt;", "µf", "_f"):
        assert "abbr" not in marked(text), text
    assert marked("<b>f</b>").startswith("<b><abbr")
    assert "<title>h: factor" in marked("h of the owner", svg=True)


def test_every_lesson_defines_its_symbols_and_shows_numbers_beside_its_plots(lessons: list[Lesson]) -> None:
    text = "".join(document(lesson.text) for lesson in lessons) + table([(name, ["1"]) for name in "rsdgfhF"])
    for symbol in DEFINITIONS:
        assert f'<abbr data-symbol="{symbol}"' in text
    for lesson in lessons:
        for plot in lesson.settings.plots:
            assert plot.formula, f"{lesson.settings.title}: {plot.title}"
            assert plot.formula[-1].when == "1"


@pytest.mark.parametrize("x", [-0.8, -0.5, 0.1, 0.18, 0.3, 0.62, 1.9])
def test_numbers_in_the_formula_of_contact_fit_together(lessons: list[Lesson], x: float) -> None:
    lesson = lessons[1]
    decals = lesson.scene.decals.replace(positions=[[-0.4, 0, 0], [0.6, 0, 0]], radii=0.6)
    state = experiment(decals=decals, camera=lesson.scene.camera, probe=(x, 0.0, 0.0))
    results = measured(lesson, state)
    line, factor = (plain(plot["formula"]) for plot in results.plots[:2])
    f = falloff(np.abs(x - np.array([-0.4, 0.6])) / (0.6 / RIM))
    after = contact_field(f[None])[0]
    if f.max() < 0.5:
        assert line == f"F = f = {shown(f.max())}: the probe is outside of both images"
        assert "unknown" in factor
        return
    own = int(f.argmax())
    numbers = re.fullmatch(rf"F = ½ \+ \(f{'₀₁'[own]} − ½\) h = ½ \+ \((.+) − ½\) · (.+) = (.+)", line)
    assert numbers is not None, line
    high, h, result = (float(number) for number in numbers.groups())
    assert high == pytest.approx(f[own], abs=0.005)
    assert result == pytest.approx(after, abs=0.005)
    assert 0.5 + (high - 0.5) * h == pytest.approx(result, abs=0.006)
    assert factor.endswith(f"= {shown(h)}") or (h == 1 and factor.startswith("h = 1, as"))
    assert 'data-symbol="h"' in results.plots[0]["svg"]


@pytest.mark.parametrize("gap", [0.5, 0.9, 1.1, 1.3])
def test_regions_lie_where_the_symbols_act(lessons: list[Lesson], gap: float) -> None:
    lesson, centers = lessons[1], np.array([-gap / 2, gap / 2])
    positions = [[x, 0, 0] for x in centers]
    decals = lesson.scene.decals.replace(positions=positions, radii=0.6)
    state = experiment(decals=decals, camera=lesson.scene.camera)
    along = state.line_points(SAMPLES)
    x = along.variables["x"] - gap / 2  # it begins at the first centre
    f = falloff(np.abs(x[:, None] - centers) / (0.6 / RIM))
    high, low = f.max(axis=1), f.min(axis=1)
    expected = {"g": high > 0, "f": high > 0.5, "f₀": f[:, 0] > 0.5, "f₁": f[:, 1] > 0.5}
    expected |= {"F": high > 0.5, "h": (high > 0.5) & (high - contact_field(f) > PUSHED)}
    found = acting(Scope.at_probe(state).at(along))
    svg = measured(lesson, state).plots[0]["svg"]
    for name, acts in expected.items():
        differs = np.flatnonzero(found[name] != acts)
        edges = np.flatnonzero(np.diff(acts)) + 0.5
        assert all(np.abs(edges - i).min(initial=np.inf) <= 1.5 for i in differs), name
        rects = re.findall(rf'<rect data-region="{name}"[^>]* x="([\d.]+)" width="([\d.]+)"', svg)
        width = sum(float(part) for _, part in rects)
        assert width / (WIDTH - LEFT - RIGHT) == pytest.approx(acts.mean(), abs=0.01), name
    assert found["h"].any() == bool((low + high > 1.01)[high > 0.51].any())


def test_maps_have_a_layer_for_each_region_and_solids_have_theirs(lessons: list[Lesson]) -> None:
    for lesson, names in ((lessons[2], "gdsfrFh"), (lessons[5], ["f₀", "f₁", "F₀", "F₁"])):
        settings = lesson.settings
        known = {"objects": lesson.scene.objects, "camera": lesson.scene.camera, "size": lesson.size}
        known |= {"line": settings.line, "in_space": settings.space, "decals": lesson.scene.decals}
        scope = Scope.at_probe(experiment(probe=settings.probe, **known))
        plots = [drawn(plot, lesson, scope) for plot in lesson.settings.plots if plot.x is None]
        assert plots
        for name in names:
            assert all(f'data-region="{name}"' in svg for svg in plots), (lesson.settings.title, name)
