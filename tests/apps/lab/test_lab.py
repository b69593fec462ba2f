"""Lessons without a browser: sliders move the scene, plots are right, wrong and right answers told apart."""

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import decals
from decals import MeshObject
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lab import Lab, Results, measured
from decals.apps.lab.lesson import LESSONS, load_lesson, load_lessons, shown
from decals.apps.lab.measures import MEASURES
from decals.apps.lab.plots import LEFT, TOP
from decals.editing.slicing import SlicePlane
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.scenes.meshes import as_polydata
from decals.window import EditWindow
from tests.apps.lab.answers import ANSWERS, STEP
from tests.decals.editing.scenes import digest
from tests.oracles.contact import falloff

ROOT = Path(__file__).parents[3]
EMPTY = decals.Scene(objects=(), camera=decals.Camera((0, 0, 8)))


@pytest.fixture(scope="module")
def window(vtk_display: None) -> Iterator[EditWindow]:
    with EditWindow(EMPTY, off_screen=True, size=(60, 40)) as window:
        window.show()
        yield window


@pytest.fixture(scope="module")
def lab(window: EditWindow) -> Iterator[Lab]:
    lab = Lab(window, load_lessons(LESSONS))
    yield lab
    lab.close()


def wait(lab: Lab) -> dict[str, Any]:
    end = time.monotonic() + 60
    while lab.busy or lab._pending is not None:
        lab._window.tick()
        lab.refresh()
        assert time.monotonic() < end
        time.sleep(0.002)
    return lab.values()


def begin(lab: Lab, number: int) -> None:
    """Start a lesson, and take a guess."""
    start(lab, number)
    lab.guess(0.5)
    settle(lab)


def start(lab: Lab, number: int, *more: Any) -> None:
    """Start a lesson; a thread builds the surfaces of solids first."""
    lab.start(number, *more)
    settle(lab)


def settle(lab: Lab) -> None:
    """Wait for the scene."""
    end = time.monotonic() + 60
    while lab._window.background.busy_editing:
        lab._window.tick()
        assert time.monotonic() < end
        time.sleep(0.002)


def plain(html: str) -> str:
    """Return what a reader sees of HTML."""
    return unescape(re.sub("<[^>]+>", "", html))


def number_of(lab: Lab, label: str) -> int:
    return next(int(s["number"]) for s in lab.values()["lab_sliders"] if s["name"].startswith(label))


@pytest.mark.slow_cases("0", "5", "6")
@pytest.mark.parametrize("number", range(len(ANSWERS)))
def test_wrong_and_right_answers_are_told_apart(lab: Lab, number: int) -> None:
    begin(lab, number)
    for attempt in ANSWERS[number]:
        for label, value in attempt.settings:
            lab.set_value(number_of(lab, label), value)
        first = wait(lab)["lab_verdict"]
        assert bool(first["text"]) is attempt.right  # what is wrong is not said before the student asks
        lab.check()
        verdict = wait(lab)["lab_verdict"]
        assert not attempt.right or verdict == first
        done = [task["done"] for task in lab.values()["lab_tasks"]]
        assert len(done) == len(lab.lesson.settings.question.checks)
        assert all(done) is attempt.right
        assert verdict["right"] is attempt.right, verdict
        assert attempt.words in plain(verdict["text"])
        assert "{" not in verdict["text"]


def test_the_first_even_step_is_the_answer(lab: Lab) -> None:
    begin(lab, 4)
    assert lab.values()["lab_plots"] == []  # not those of another lesson
    lab.set_value(number_of(lab, STEP), 60)
    wait(lab)
    relaxed = lab.experiment().relaxed
    assert relaxed is not None
    assert relaxed.energies[1] > relaxed.energies[5] > 0
    assert np.isnan([relaxed.energies[0], relaxed.energies[-1]]).all()
    first = int(np.argmax(np.array(relaxed.rhos) >= 0.75))
    lab.set_value(number_of(lab, STEP), first)
    lab.check()
    verdict = wait(lab)["lab_verdict"]
    assert verdict["right"], verdict
    lab.set_value(number_of(lab, "Random start"), 3)
    wait(lab)
    assert lab.experiment().relaxed != relaxed


def test_a_lesson_fits_a_window_of_another_size_until_its_view_is_turned(
    lab: Lab, window: EditWindow
) -> None:
    plotter = window.plotter
    begin(lab, 0)
    wait(lab)
    size, fov = plotter.window_size, lab.lesson.scene.camera.fov
    assert plotter.camera.view_angle == pytest.approx(fov)
    plotter.window_size = [40, 60]
    lab.refresh()
    assert plotter.camera.view_angle == pytest.approx(1.5 * fov)  # all of the plate, in a narrow window
    plotter.camera.position = (1.0, 0.0, 8.0)
    plotter.window_size = size
    lab.refresh()
    assert plotter.camera.view_angle == pytest.approx(1.5 * fov)
    begin(lab, 0)
    assert plotter.camera.view_angle == pytest.approx(fov)


def test_values_of_another_state_are_marked(lab: Lab) -> None:
    begin(lab, 0)
    assert not wait(lab)["lab_stale"]
    lab.set_value(number_of(lab, "Visible radius"), 0.8)
    assert lab.values()["lab_stale"]
    assert not wait(lab)["lab_stale"]


def test_the_probe_follows_the_pointer_where_its_slider_leads(lab: Lab, window: EditWindow) -> None:
    begin(lab, 0)
    wait(lab)
    x, y, z = lab.probe
    lab.move_probe(([0.7, 0.4, 5.0], [0.0, 0.0, -1.0]))
    assert lab.probe == pytest.approx((0.7, y, z))
    assert lab.values()["lab_sliders"][number_of(lab, "Probe")]["value"] == pytest.approx(0.7)
    bounds = window.plotter.actors["probe"].bounds
    assert (bounds[0] + bounds[1]) / 2 == pytest.approx(0.7, abs=0.01)
    lab.move_probe(([0.7, 0.4, 5.0], [1.0, 0.0, 0.0]))  # beside the plane
    assert lab.probe == pytest.approx((0.7, y, z))
    lab.move_probe(([90.0, 0.0, 5.0], [0.0, 0.0, -1.0]))
    assert lab.probe == (2.0, y, z)  # the end of the slider
    begin(lab, 0)
    assert wait(lab)["lab_sliders"][number_of(lab, "Probe")]["value"] == x


def test_the_probe_lies_on_a_slice_and_tasks_stay_on_the_surface(lab: Lab) -> None:
    begin(lab, 0)
    before = wait(lab)
    lab.cut(SlicePlane.across((0, 0.25, 0), (0, 1, 0)))
    assert lab.probe == pytest.approx((0.3, 0.25, 0.0))
    lab.move_probe(([0.2, 5.0, 0.4], [0.0, -1.0, 0.0]))
    assert lab.probe == pytest.approx((0.2, 0.25, 0.4))
    sliced = wait(lab)
    s = lab.experiment().decals.influence[0]
    expected = falloff(np.linalg.norm([0.2, 0.25, 0.4]) / s)
    assert f">{shown(expected)}<" in sliced["lab_readings"]
    assert sliced["lab_plots"][1]["svg"] != before["lab_plots"][1]["svg"]
    assert sliced["lab_tasks"] == before["lab_tasks"]
    lab.set_value(number_of(lab, "Probe"), -0.5)
    assert lab.probe == pytest.approx((-0.5, 0.25, 0.4))
    lab.cut(SlicePlane.across((0, 0.5, 0), (0, 1, 0)))
    assert lab.probe == pytest.approx((-0.5, 0.5, 0.4))
    lab.cut(None)
    assert lab.probe == lab.lesson.settings.probe


@pytest.mark.parametrize("number", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (0, 2, 3, 4, 5))])
def test_every_slider_moves_the_scene_and_undo_brings_it_back(
    lab: Lab, window: EditWindow, number: int
) -> None:
    begin(lab, number)
    for slider in wait(lab)["lab_sliders"]:
        before, state = digest(window.document), lab._key()
        done = len(window.session.labels)
        target = next(
            (c for c in slider["choices"] if c != slider["value"]), (slider["low"] + 2 * slider["high"]) / 3
        )
        lab.set_value(slider["number"], target, False)
        lab.set_value(slider["number"], target)
        wait(lab)
        now = lab.values()["lab_sliders"][slider["number"]]["value"]
        assert lab._key() != state
        assert now == target if slider["choices"] else now == pytest.approx(target, abs=1.0)
        entries = len(window.session.labels) - done
        assert entries in (0, 1)
        if entries:
            assert digest(window.document) != before
            window.session.undo()
            assert digest(window.document) == before
            window.session.redo()


def test_a_moved_decal_lies_on_the_surface(lab: Lab, window: EditWindow) -> None:
    begin(lab, 1)
    lab.set_value(number_of(lab, "Blue decal"), 0.25)
    position = lab.experiment().decals.positions[1]
    np.testing.assert_allclose(position, (0.25, 0.0, 0.0), atol=1e-6)


def test_a_verdict_vanishes_when_the_scene_changes(lab: Lab) -> None:
    begin(lab, 1)
    lab.check()
    assert wait(lab)["lab_verdict"]["text"]
    lab.set_value(number_of(lab, "Probe"), 0.77)
    assert lab.values()["lab_verdict"]["text"] == ""
    assert wait(lab)["lab_verdict"]["text"] == ""


def test_a_right_answer_says_so_by_itself_and_vanishes_again(lab: Lab) -> None:
    begin(lab, 1)
    assert not wait(lab)["lab_verdict"]["text"]
    lab.set_value(number_of(lab, "Probe"), -0.32)
    assert wait(lab)["lab_verdict"]["right"]
    assert [task["done"] for task in lab.values()["lab_tasks"]] == [True] * 4
    lab.set_value(number_of(lab, "Probe"), -0.6)
    assert lab.values()["lab_verdict"] == {"right": False, "text": ""}
    assert [task["done"] for task in wait(lab)["lab_tasks"]] == [True, True, True, False]


TRUTHS = [0.6 / 0.27252, 0.48, None, None, None, None, None, None, None]
"""Known answers to the guesses, from the oracle: s = r / 0.4542, and x = D r₀ / (r₀ + r₁)."""


@pytest.mark.slow_cases("2", "3", "4")
@pytest.mark.parametrize("number", range(len(ANSWERS)))
def test_a_guess_comes_before_contact_and_is_compared(lab: Lab, window: EditWindow, number: int) -> None:
    start(lab, number)
    values = wait(lab)
    assert values["lab_guess"]["waits"]
    assert not any(values[f"lab_{name}"] for name in ("plots", "values", "tasks", "readings"))
    document = window.document
    assert (document.decals.decals.interactions == decals.Interaction.OVERLAP).all()
    assert not any("SolidContact" in repr(item) for item in document.objects)
    for wrong in ("much", None, float("nan")):
        with pytest.raises(InvalidEdit, match="guess: expected"):
            lab.guess(wrong)
    assert lab.values()["lab_guess"]["waits"]
    lab.guess(1.5)
    known = wait(lab)["lab_guess"]
    assert not known["waits"]
    assert known["ends"][0] == 1.5
    assert known["texts"][0] == "1.5"
    assert window.document.scene.replace(camera=lab.lesson.scene.camera).decals == lab.lesson.scene.decals
    if (truth := TRUTHS[number]) is not None:
        assert known["ends"][1] == pytest.approx(truth, rel=1e-3)
    elif number == 4:
        assert known["ends"][1] is None
    else:
        assert lab.lesson.settings.guess is not None
        assert lab.lesson.settings.guess.low <= known["ends"][1] <= lab.lesson.settings.guess.high


def test_a_lesson_whose_decal_was_deleted_says_so(lab: Lab, window: EditWindow) -> None:
    begin(lab, 1)
    wait(lab)
    window.session.do(decals.editing.DeleteDecals([lab.numbers[0]]))
    lab.check()
    values = wait(lab)
    assert "undo, or start the lesson again" in values["lab_verdict"]["text"]
    with pytest.raises(InvalidLesson, match="deleted"):
        lab.set_value(number_of(lab, "Blue decal"), 0.25)
    window.session.undo()
    lab.check()
    assert "inside one of them" in wait(lab)["lab_verdict"]["text"]


@pytest.mark.parametrize(
    ("number", "value"),
    [(99, 1.0), (-9, 1.0), ("0", 1.0), (None, 1.0), (0, "much"), (0, None), (0, float("nan")), (0, 1e99)],
)
def test_wrong_events_change_nothing(lab: Lab, window: EditWindow, number: Any, value: Any) -> None:
    begin(lab, 1)
    wait(lab)
    before = digest(window.document)
    with pytest.raises(ImplicitDecalsError, match="expected"):
        lab.set_value(number, value)
    with pytest.raises(InvalidEdit, match="lesson: expected a whole number from 0 to"):
        start(lab, number if number != 0 else True)
    assert digest(window.document) == before


# -- plots ----------------------------------------------------------------------------------------------


def test_a_lesson_without_edits_leaves_no_recovery_file(vtk_display: None, tmp_path: Path) -> None:
    with EditWindow(EMPTY, off_screen=True, size=(60, 40), path=tmp_path / "scene.json") as window:
        window.show()
        lab = Lab(window, load_lessons(LESSONS))
        begin(lab, 0)
        while window.background.busy:
            window.tick()
        assert not window.session.modified
        assert window.actions.files.recovery.keep() is None
        lab.set_value(0, 0.4)
        window.actions.state.end_stroke()
        assert window.session.modified
        lab.close()
        window.session.undo()
    assert [*tmp_path.iterdir()] == []


@pytest.mark.slow_cases("5")
@pytest.mark.parametrize("number", range(len(ANSWERS)))
def test_plots_are_pictures_without_addresses(lab: Lab, number: int) -> None:
    begin(lab, number)
    values = wait(lab)
    plots = lab.lesson.settings.plots
    assert [plot["title"] for plot in values["lab_plots"]] == [plot.title for plot in plots]
    for plot in values["lab_plots"]:
        root = ElementTree.fromstring(plot["svg"])
        for element in root.iter():
            assert element.get("href", "data:image/png").startswith("data:image/png")
        assert "nan" not in plot["svg"]
    assert "<" not in re.sub(r"</?(p|strong|em|ul|ol|li|code|abbr)( [^>]*)?>", "", values["lab_text"])


def test_the_plot_of_the_falloff_has_its_values(lab: Lab) -> None:
    begin(lab, 0)
    (path, *_) = re.findall(r'<path d="([^"]+)"', wait(lab)["lab_plots"][0]["svg"])
    right, down = np.array([pair.split() for pair in re.split("[ML]", path)[1:]], float).T
    x = (right - LEFT) / (right[-1] - LEFT) * 1.2
    top = TOP + 15 * 1
    height = (down[-1] - top) / 1.05  # g = 0 at the end, and the axis ends at 1.05
    np.testing.assert_allclose(1.05 - (down - top) / height, falloff(x), atol=0.002)


# -- files ----------------------------------------------------------------------------------------------


def test_scenes_of_lessons_are_saved_anywhere_with_their_images_and_meshes(tmp_path: Path) -> None:
    lessons = tmp_path / "lessons"
    lessons.mkdir()
    for part in LESSONS.glob("4-many-decals.*"):
        (lessons / part.name).write_bytes(part.read_bytes())
    (lessons / "target.png").write_bytes((LESSONS / "target.png").read_bytes())
    scene = decals.load_scene(lessons / "4-many-decals.json")
    (plate,) = scene.objects
    assert isinstance(plate, MeshObject)
    as_polydata([plate]).save(lessons / "plate.ply")
    scene.replace(objects=[replace(plate, source=str(lessons / "plate.ply"))]).save(
        lessons / "4-many-decals.json"
    )
    (lesson,) = load_lessons(lessons)
    (tmp_path / "work").mkdir()
    lesson.scene.save(tmp_path / "work" / "kept.json")
    again = decals.load_scene(tmp_path / "work" / "kept.json")  # in a folder without the files
    for image, other in zip(scene.images, again.images, strict=True):
        np.testing.assert_array_equal(image.pixels, other.pixels)
    assert [image.source for image in lesson.scene.images] == ["target", "eye", "rock"]


def test_a_lesson_of_the_docs_is_loaded_and_answered(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "lessons.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"````markdown\n(.*?)````", page, flags=re.DOTALL)
    (tmp_path / "1-touch.md").write_text(text, encoding="utf-8")
    made: dict[str, Any] = {}
    (code,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    exec(code.replace("1-touch.json", str(tmp_path / "1-touch.json")), made)
    (lesson,) = load_lessons(tmp_path)
    state = made["scene"].decals

    def results(x: float) -> Results:
        from tests.apps.lab.test_measures import experiment

        moved = state.replace(positions=[state.positions[0], (x, 0, 0)])
        return measured(lesson, experiment(decals=moved, camera=lesson.scene.camera))

    assert results(1.5).verdict == (False, "The distance is 1.5, and the radii together are 1.")
    assert results(1.0).verdict[0]
    texts = [re.findall(">([^<]+)</text>", plot["svg"]) for plot in results(1.0).plots]
    assert not any(text.startswith("-0") for text in texts[0] + texts[1])  # neither -0 nor fields below 0
    for name in MEASURES:
        assert f"`{name}" in page, f"the docs do not name the measure {name}"


LESSON = """+++
title = "Touch"
scene = "1-one-decal.json"
[[sliders]]
label = "x"
path = "decals.0.x"
[[plots]]
title = "f"
map = "f(0)"
[question]
text = "Where?"
right = "Right."
[[question.checks]]
holds = "d(0) < 1"
otherwise = "Wrong: {d(0)}."
+++
Text
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("+++\nT", "T", "settings between two lines"),
        ('title = "Touch"', "title = Touch", "settings: Invalid value"),
        ('title = "Touch"', "", "missing required field `title`"),
        ('title = "Touch"', "title = 3", "title"),
        ('title = "Touch"', 'title = "Touch"\ncolour = 1', "unknown field `colour`"),
        ('title = "Touch"', 'title = "Touch"\ncontact = "soft"', "contact: expected one of"),
        ('title = "Touch"', 'title = "Touch"\nstiffness = 0', "stiffness: expected"),
        ('title = "Touch"', 'title = "Touch"\nsize = -1.0', "size: expected"),
        ('title = "Touch"', 'title = "Touch"\nsteps = 5000', "steps: expected"),
        ("1-one-decal.json", "missing.json", "missing.json"),
        ('"decals.0.x"', '"decals.0.w"', r"sliders\[0\]: path: expected"),
        ('"decals.0.x"', '"decals.7.x"', r"sliders\[0\]: expected a decal from 0 to 0, got 7"),
        ('"decals.0.x"', '"decals.*.x"', r"sliders\[0\]: path: expected"),
        ('"decals.0.x"', '"objects.0.radius"', r"sliders\[0\]: expected the path of a parameter"),
        ('"decals.0.x"', '"decals.0.interaction"', r"expected choices, as its value is 'push'"),
        ('"decals.0.x"', '"decals.0.x"\nlow = 2.0', r"sliders\[0\]: expected low < high"),
        ('map = "f(0)"', "", r"plots\[0\]: expected either curves or a map"),
        ('map = "f(0)"', 'map = "f(0"', r"plots\[0\]: expected a formula"),
        ('map = "f(0)"', 'map = "f(0)"\nx = [1.0, 0.0]', r"plots\[0\].x: expected two numbers"),
        ('map = "f(0)"', 'map = "f(0)"\nx = [0.0, 1.0]', "both x and y"),
        ('"d(0) < 1"', '"e(0) < 1"', r"question.checks\[0\]: .* unknown name 'e'"),
        ('"d(0) < 1"', '"x < 1"', "unknown name 'x'"),
        ("{d(0)}", "{d(0}", r"question.checks\[0\].otherwise: expected a formula"),
        ('right = "Right."', "", "missing required field `right`"),
    ],
)
def test_malformed_lessons_say_what_is_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    for name in ("1-one-decal.json", "target.png"):
        (tmp_path / name).write_bytes((LESSONS / name).read_bytes())
    path = tmp_path / "lesson.md"
    path.write_text(LESSON, encoding="utf-8")
    assert load_lesson(path).settings.title == "Touch"
    assert old in LESSON
    path.write_text(LESSON.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InvalidLesson, match=words) as error:
        load_lesson(path)
    assert "lesson.md" in str(error.value)


def test_lessons_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for name in ("1-one-decal.json", "target.png"):
        (tmp_path / name).write_bytes((LESSONS / name).read_bytes())
    names = ["1-a", "2-b", "02-c", "10-a2", "10-a11", "more"]
    for name in names:
        (tmp_path / f"{name}.md").write_text(LESSON, encoding="utf-8")
    assert [lesson.name for lesson in load_lessons(tmp_path)] == names


def test_each_lesson_has_its_row_in_the_docs_and_its_answers() -> None:
    _, _, page = (ROOT / "docs" / "lessons.md").read_text(encoding="utf-8").partition("| lesson | about |\n")
    rows = re.findall(r"^\| (\w.+?) \|", page.partition("\n\n")[0], flags=re.MULTILINE)
    assert rows == [lesson.settings.title for lesson in load_lessons(LESSONS)]
    assert len(rows) == len(ANSWERS)


def test_a_folder_without_lessons_is_refused(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(InvalidLesson, match="expected a folder with lessons"):
            load_lessons(folder)
    (tmp_path / "binary.md").write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidLesson, match="could not read"):
        load_lessons(tmp_path)


def test_values_are_short() -> None:
    texts = {0.4999999: "0.5", 1234.5: "1234", 1e-8: "0", 0.01234: "0.0123", 100.4: "100"}
    assert {number: shown(number) for number in texts} == texts
    assert (shown(np.bool_(True)), shown(np.nan)) == ("yes", "–")
