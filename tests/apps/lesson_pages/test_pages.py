"""Pages of lessons: their formulas against float64 oracles, their tables, size, and what they refuse."""

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import decals.apps.lesson_pages as package
from decals.apps.cli import run
from decals.apps.lab.lesson import LESSONS, PLACEHOLDER, Lesson, load_lesson, load_lessons, shown
from decals.apps.lab.measures import MEASURES
from decals.apps.lab.puzzles import Puzzle, read_puzzle
from decals.apps.lab.symbols import DEFINITIONS
from decals.apps.lesson_pages.code import FORMS, WORDS, javascript
from decals.apps.lesson_pages.page import KNOWN, SHARED, lesson_page, lesson_script, no_page
from decals.apps.lesson_pages.tables import MOST, positions_of, tabulated
from decals.apps.lesson_pages.translation import LANGUAGES, translation
from decals.errors import InvalidInput
from decals.pages.page import as_script
from tests.decals.pages.viewer_scripts import needs_node, run_node
from tests.oracles.contact import RIM, contact_field, falloff

MODULES = Path(package.__file__).parent
MOST_BYTES = 600_000
PAGES = ["1-one-decal", "2-two-decals", "3-contact-modes", "4-many-decals", "8-over-a-bump", "9-packing"]

LINKS = [
    "puzzle=0.5,0.45,0.4,0.3&par=0.5,2",
    "puzzle=0.5,0.45,0.4&par=0.5,2",
    "puzzle=0.5,0.45,0.4,x&par=0.5,2",
    "puzzle=0.5,0.45,0.4,-1&par=0.5,2",
    "puzzle=0.5,0.45,0.4,99&par=0.5,2",
    "puzzle=0.5,0.45,0.4,0.3",
    "task=1",
]

MEASURED = f"""
import {{ Measures, shown }} from {json.dumps((MODULES / "measures.mjs").as_uri())};
"""


@pytest.fixture(scope="module")
def lessons() -> dict[str, Lesson]:
    return {lesson.name: lesson for lesson in load_lessons(LESSONS)}


def measured(formulas: list[str], points: Any, positions: Any, radii: Any) -> Any:
    """Return values of formulas at points of the plane, as a page computes them without its shader."""
    codes = [javascript(text, MEASURES, KNOWN) for text in formulas]
    script = f"""{MEASURED}
const rows = data.rows;
const decals = {{ rows, numbers: rows.map((_, number) => number) }};
const m = new Measures({{ decals, header: {{ rules: {{ rim: data.rim }} }} }}, {{ words: {{}} }});
const formulas = [{", ".join(f"(q) => {code}" for code in codes)}];
const at = (position) => ({{ position, owner: -1, x: position[0], y: position[1] }});
const values = data.points.map((point) => formulas.map((formula) => Number(formula(at(point)))));
console.log(JSON.stringify(values, (_, value) => (Number.isNaN(value) ? "NaN" : value)));
"""
    rows = [{"position": [*map(float, p)], "radius": float(r)} for p, r in zip(positions, radii, strict=True)]
    found = run_node(script, {"rows": rows, "rim": float(RIM), "points": np.asarray(points).tolist()})
    return np.array([[float(value) for value in row] for row in found])


@needs_node
def test_fields_and_h_are_those_of_the_float64_formulas() -> None:
    random = np.random.default_rng(38)
    for count in (1, 2, 3, 5):
        positions = np.column_stack([random.uniform(-1, 1, (count, 2)), np.zeros(count)])
        radii = random.uniform(0.2, 1.2, count).astype(np.float32)
        points = np.column_stack([random.uniform(-2, 2, (200, 2)), np.zeros(200)])
        d = np.linalg.norm(points[:, None] - positions, axis=2) / (radii.astype(np.float64) / RIM)
        f = falloff(d)
        last = count - 1
        found = measured([f"d({last})", f"f({last})", "top", f"h({last}, 0)"], points, positions, radii)
        np.testing.assert_allclose(found[:, 0], d[:, last], rtol=1e-9)
        np.testing.assert_allclose(found[:, 1], f[:, last], atol=1e-12)
        np.testing.assert_allclose(found[:, 2], f.max(axis=1), atol=1e-12)
        owned = (f[:, 0] >= 0.5) & (f[:, 0] >= f[:, last])
        assert np.isnan(found[~owned, 3]).all()
        if count > 1:
            clear = owned & (f[:, 0] > 0.505) & (f[:, 0] > f[:, last] + 1e-3)
            after = contact_field(f[clear][:, [0, last]])
            np.testing.assert_allclose(0.5 + (f[clear, 0] - 0.5) * found[clear, 3], after, atol=1e-9)


@needs_node
def test_the_modules_of_a_page_share_no_names(lessons: dict[str, Lesson]) -> None:
    """All of them are one script, which would not start."""
    text = lesson_page(lessons["1-one-decal"]).text
    (script,) = re.findall(r"<script>\n(.*?)</script>", text, re.DOTALL)
    assert run_node("new Function(data); console.log(true);", script)


@needs_node
def test_the_surface_of_figure_7_is_equation_5() -> None:
    own, other = (grid.ravel() for grid in np.meshgrid(np.linspace(0.51, 0.999, 20), np.linspace(0, 1, 21)))
    found = measured(["pushed(x, y)"], np.column_stack([own, other, 0 * own]), [[0, 0, 0]], [1.0])[:, 0]
    expected = np.where(other > own, np.nan, contact_field(np.column_stack([own, other])))
    np.testing.assert_allclose(found, expected, atol=1e-9)


@needs_node
@pytest.mark.parametrize("seed", range(3))
def test_random_formulas_are_those_of_the_lab(seed: int) -> None:
    from tests.apps.lab.test_measures import TWO, experiment, value

    random = np.random.default_rng(seed)
    leaves = ["f(0)", "f(1)", "d(0)", "top", "g(0.3)", "0.25", "2", "radius(1)", "distance(0, 1)", "count"]

    def formula(depth: int) -> str:
        if depth == 0:
            return str(random.choice(leaves))
        a, b, c = (formula(depth - 1) for _ in range(3))
        forms = [f"({a} + {b})", f"{a} * {b} - {c}", f"-({a})", f"({a}) / ({b} + 2)", f"max({a}, {b})"]
        forms += [
            f"where({a} < {b}, {c}, {a})",
            f"abs({a} - {b}) ** 2",
            f"1.0 * ({a} < {b} and not {b} <= {c})",
        ]
        return str(random.choice(forms))

    formulas = [text for text in (formula(2) for _ in range(40)) if len(text) < 300]
    point = (0.4, -0.2, 0.0)
    found = measured(formulas, [point], TWO.positions, TWO.radii)[0]
    expected = [float(np.ravel(value(text, experiment(probe=point)))[0]) for text in formulas]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


@needs_node
def test_no_two_modules_of_a_page_declare_one_name() -> None:
    script = as_script(lesson_script(), "begin")
    assert run_node("new Function(data); console.log(JSON.stringify(true));", script) is True


@needs_node
def test_links_of_pages_are_those_of_the_lab(lessons: dict[str, Lesson]) -> None:
    lesson = lessons["9-packing"]
    rows = [{"radius": radius} for radius in Puzzle.of(lesson).radii]
    scores = [{"par": score.par} for score in lesson.settings.scores]
    links = [*LINKS, Puzzle.of(lesson).text]
    script = f"""
import {{ puzzleOf }} from {json.dumps((MODULES / "puzzles.mjs").as_uri())};
console.log(JSON.stringify(data.links.map((link) => puzzleOf("#" + link, data))));"""
    given = {"rows": rows, "scores": scores, "size": lesson.size, "links": links}
    for link, found in zip(links, run_node(script, given), strict=True):
        try:
            expected = read_puzzle(link, lesson)
        except InvalidInput:
            expected = Puzzle.of(lesson)  # a page with a wrong link shows the lesson itself
        assert Puzzle(tuple(found["radii"]), tuple(found["pars"])) == expected, link


@needs_node
@pytest.mark.parametrize("seed", range(3))
def test_an_outline_is_compared_cell_by_cell(seed: int) -> None:
    random = np.random.default_rng(seed)
    half, side = 1.5, 40
    angles = np.sort(random.uniform(0, 2 * np.pi, 12))
    corners = random.uniform(-0.3, 0.3, 2) + np.stack([np.cos(angles), 0.7 * np.sin(angles)], axis=1)
    steps = ((np.arange(side) + 0.5) / side * 2 - 1) * half
    cells = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    true = np.hypot(*(cells - random.uniform(-0.5, 0.5, 2)).T) < 0.8
    ways, offsets = np.roll(corners, -1, axis=0) - corners, cells[:, None] - corners
    drawn = (ways[:, 0] * offsets[..., 1] > ways[:, 1] * offsets[..., 0]).all(axis=1)  # it is convex
    script = f"""
import {{ compared }} from {json.dumps(SHARED[0].as_uri())};
const found = compared(() => data.cells, data.half, data.corners);
const none = compared(() => data.cells, data.half, [[0, 0], [1, 1]]);
console.log(JSON.stringify([found.difference, found.parts, none]));"""
    given = {"cells": true.tolist(), "half": half, "corners": corners.tolist()}
    difference, parts, none = run_node(script, given)
    assert difference == pytest.approx((drawn != true).sum() / true.sum())
    assert parts.count("M") == true.sum()
    assert none is None


@needs_node
@pytest.mark.parametrize("keeps", [True, False])
def test_the_browser_keeps_the_least_score(keeps: bool) -> None:
    scores = [None, 3.5, None, 4.0, 2.25, None]
    script = f"""
import {{ best }} from {json.dumps(SHARED[1].as_uri())};
const kept = new Map();
const getItem = (key) => kept.get(key) ?? null;
const setItem = (key, value) => kept.set(key, String(value));
const getNone = () => {{ throw new Error("this frame keeps nothing"); }};
globalThis.localStorage = {{ getItem: {json.dumps(keeps)} ? getItem : getNone, setItem }};
const all = data.map((score) => best("of this puzzle", score));
console.log(JSON.stringify([...all, best("of another one", null)]));"""
    found = [np.inf if score is None else score for score in run_node(script, scores)]
    given = [np.inf if score is None else score for score in scores]
    assert found == [*(np.minimum.accumulate(given) if keeps else given), np.inf]


@needs_node
def test_numbers_are_shown_as_in_the_lab() -> None:
    random = np.random.default_rng(2)
    values = [*(10.0 ** random.uniform(-4, 6, 200)), 0.0, 1e-9, -0.5, 99.96, 100.4, 0.25]
    script = f"{MEASURED}console.log(JSON.stringify(data.map((x) => shown(x, {{ point: '.' }}))));"
    found = run_node(script, [float(f"{value:.8g}") for value in values])
    lab = [shown(float(f"{value:.8g}")) for value in values]
    assert [float(text) for text in found] == pytest.approx([float(text) for text in lab])


@needs_node
def test_pages_have_the_measures_that_formulas_may_name() -> None:
    script = f"""{MEASURED}
const m = new Measures({{}}, {{}});
console.log(JSON.stringify([...Object.keys(m), ...Object.getOwnPropertyNames(Measures.prototype)]));"""
    assert KNOWN - {*WORDS, *FORMS} <= set(run_node(script, None))


def test_pages_are_small_and_ask_no_server(lessons: dict[str, Lesson]) -> None:
    for name in PAGES:
        text = lesson_page(lessons[name]).text
        assert len(text.encode()) < MOST_BYTES, name
        assert "http://" not in text
        assert "https://" not in text
        tasks = [check.task for check in lessons[name].settings.question.checks if check.task]
        assert len(re.findall(r'<li data-task id="task=\d+">', text)) == len(tasks) > 0


def test_texts_of_a_lesson_are_no_markup(lessons: dict[str, Lesson]) -> None:
    bad = "</script><script>alert(1)</script><img src=x onerror=alert(1)>"
    lesson = lessons["1-one-decal"]
    settings = lesson.settings
    changed = msgspec.structs.replace(
        settings,
        title=bad,
        sliders=tuple(msgspec.structs.replace(slider, label=bad) for slider in settings.sliders),
        question=msgspec.structs.replace(settings.question, text=bad, right=bad),
    )
    text = lesson_page(replace(lesson, settings=changed, text=bad)).text
    assert "alert(1)</script>" not in text
    assert "<img src=x" not in text
    assert text.count("<script") == 2


def test_choices_and_remarks_in_formulas_are_no_markup(tmp_path: Path) -> None:
    bad = "</script><script>alert(1)</script>"
    shutil.copytree(LESSONS, tmp_path, dirs_exist_ok=True, ignore=shutil.ignore_patterns("[!3]*.md"))
    for source in tmp_path.glob("*.md"):
        text = source.read_text(encoding="utf-8")
        text = text.replace("choices = [", """choices = ['"><img src=x onerror=alert(1)>', """)
        text = re.sub(r'(formula = "[^"]*)"', rf'\1 # {bad}"', text, count=1)
        source.write_text(text, encoding="utf-8")
    (lesson,) = load_lessons(tmp_path)
    assert any(bad in formula for formula in lesson.formulas)
    page = lesson_page(lesson).text
    assert page.count("<script") == 2
    assert "<img src=x" not in page


def texts_of(lesson: Lesson) -> list[str]:
    """Return the texts of a lesson that its page shows, but for its body; formulas alone are none."""
    names = {"title", "label", "note", "text", "task", "otherwise", "right", "why", "red_label", "sketch"}

    def found(part: Any) -> Iterator[str]:
        if isinstance(part, dict):
            yield from (text for name, text in part.items() if isinstance(text, str) and name in names)
            part = list(part.values())
        if isinstance(part, list | tuple):
            for value in part:
                yield from found(value)

    choices = (choice for slider in lesson.settings.sliders for choice in slider.choices)
    texts = [*found(msgspec.to_builtins(lesson.settings)), *choices]
    return [text for text in texts if re.search("[a-z]{2}", PLACEHOLDER.sub("", text))]


@pytest.mark.parametrize("code", [path.stem for path in LANGUAGES.glob("*.toml")])
def test_languages_have_all_texts_of_lessons_and_no_others(lessons: dict[str, Lesson], code: str) -> None:
    shown_lessons = [lesson for lesson in lessons.values() if not no_page(lesson)]
    expected = {text for lesson in shown_lessons for text in texts_of(lesson)} | {*DEFINITIONS.values()}
    words = translation(code)
    assert {*words.texts} == expected
    assert {*words.bodies} == {lesson.name for lesson in shown_lessons}
    page = lesson_page(lessons["1-one-decal"], language=code).text
    assert f'<html lang="{code}">' in page
    assert words.said("The probe is on the rim") in page
    assert "The probe is on the rim" not in page


@pytest.mark.parametrize(
    ("found", "given", "message"),
    [
        ("{f(0)}", "{f(1)}", "expected the formulas of"),
        ('check = "', 'chekc = "', "check, chekc"),
        ('name = "', "name = 3 # ", "Expected `str`"),
    ],
)
def test_a_wrong_language_file_is_refused(tmp_path: Path, found: str, given: str, message: str) -> None:
    text = (LANGUAGES / "de.toml").read_text(encoding="utf-8")
    assert found in text
    (tmp_path / "xx.toml").write_text(text.replace(found, given, 1), encoding="utf-8")
    with pytest.raises(InvalidInput, match=re.escape(message)):
        translation("xx", tmp_path)


def test_lessons_without_a_page_say_why(lessons: dict[str, Lesson]) -> None:
    assert [name for name, lesson in lessons.items() if not no_page(lesson)] == [
        *PAGES[:4],
        "7-volume-and-area",
        *PAGES[4:],
    ]
    assert "relaxation" in str(no_page(lessons["5-scattering"]))
    assert f"at most {MOST} positions" in str(no_page(lessons["6-solids"]))
    with pytest.raises(InvalidInput, match="relaxation"):
        lesson_page(lessons["5-scattering"])
    with pytest.raises(InvalidInput, match="expected one of de, en"):
        lesson_page(lessons["1-one-decal"], language="xx")


@pytest.mark.slow
def test_a_table_has_the_values_of_balls(tmp_path: Path) -> None:
    for end in ("md", "json"):
        text = (LESSONS / f"7-volume-and-area.{end}").read_text(encoding="utf-8")
        text = text.replace("high = 1.4\nstep = 0.1", "high = 0.9\nstep = 0.5")
        (tmp_path / f"7-volume-and-area.{end}").write_text(
            text.replace("low = 0.25\nhigh = 1.0\nstep = 0.25", "low = 1.0\nhigh = 1.5\nstep = 1.0"),
            encoding="utf-8",
        )
    lesson = load_lesson(tmp_path / "7-volume-and-area.md")
    assert list(positions_of(lesson).values()) == [[0.4, 0.9], [1.0]]
    table = tabulated(lesson)
    for place, area, depth in zip(
        [0.4, 0.9], table.values["area(0, 1)"], table.values["penetration(0, 1)"], strict=True
    ):
        apart = place + 0.8
        assert depth == pytest.approx(2.0 - apart, abs=0.01)
        disc = np.pi * (1 - (apart / 2) ** 2)
        assert area == pytest.approx(disc, rel=0.05)
    line = np.array(table.line) - 2.2
    alone = falloff(np.abs(line + 0.8) * RIM)
    np.testing.assert_allclose(table.values["body(0)"][0], alone, atol=1e-4)
    page = lesson_page(lesson)
    assert 'data-count="2"' in page.text


def test_a_curve_in_a_text_is_refused(lessons: dict[str, Lesson]) -> None:
    lesson = lessons["7-volume-and-area"]
    template = (lesson.formulas["body(0)"],)
    with pytest.raises(InvalidInput, match=r"shows 'body\(0\)' as a curve or as a number"):
        tabulated(replace(lesson, templates={"{body(0)}": template}))


def test_the_command_writes_pages_that_link_to_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "own", tmp_path / "pages"
    folder.mkdir()
    for name in ("1-one-decal.md", "1-one-decal.json", "2-two-decals.md", "2-two-decals.json", "target.png"):
        (folder / name).write_bytes((LESSONS / name).read_bytes())
    assert run(["lessons", str(folder), "-o", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["1-one-decal.html", "2-two-decals.html"]
    assert 'href="2-two-decals.html"' in (out / "1-one-decal.html").read_text(encoding="utf-8")
    capsys.readouterr()
    assert run(["lessons", str(folder), "-o", str(out), "--language", "xx"]) != 0
    assert "expected one of de, en" in capsys.readouterr().err
