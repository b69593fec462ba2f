"""Lessons: a file of text with its scene, read and checked."""

import re
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from msgspec import Struct, field

from blobtree import SolidContact, Union
from blobtree.files import read_text
from decals.apps.lab.bindings import MODES, OWN, binding
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.experiment import Experiment, Scope
from decals.apps.lab.formulas import Formula, parse
from decals.apps.lab.measures import MEASURES
from decals.errors import ImplicitDecalsError
from decals.field.mapping import ImageMapping
from decals.model import Interaction
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS, Contact
from decals.scenes.files import load_scene
from decals.scenes.objects import MeshObject, SceneObject, TreeObject
from decals.scenes.scene import Scene
from decals.validation import member, stiffness_number

FENCE = "+++"
"""Line before and behind the settings of a lesson, which are TOML."""

LESSONS = Path(__file__).parent / "lessons"
"""The folder of the lessons that are installed."""

ROUNDING = 1e-6
"""Least value that is not shown as 0: fields have the precision of float32."""

PLACEHOLDER = re.compile(r"\{([^{}]+)\}")
"""A formula in a text, whose value is shown in its place."""

Template = tuple[str | Formula, ...]
"""A text with formulas in braces, in parts."""

Vector = tuple[float, float, float]
Range = tuple[float, float]


class Slider(Struct, forbid_unknown_fields=True, frozen=True):
    """A slider, or a choice, of one parameter of the scene, see `bindings` for its path."""

    label: str
    path: str
    low: float = 0.0
    high: float = 1.0
    step: float = 0.0
    choices: tuple[str, ...] = ()


class Value(Struct, forbid_unknown_fields=True, frozen=True):
    """A live value, or a curve of a plot; live conditions are shown as yes or no."""

    label: str
    formula: str


class Case(Struct, forbid_unknown_fields=True, frozen=True):
    """A formula with its live numbers, shown where a condition holds."""

    text: str
    when: str = "1"


class Plot(Struct, forbid_unknown_fields=True, frozen=True):
    """Curves over a range or the lesson's line, or a map of colours over two ranges or the surface."""

    title: str
    curves: tuple[Value, ...] = ()
    map: str = ""
    red: str = ""
    red_label: str = ""
    x: Range | None = None
    y: Range | None = None
    values: Range | None = None
    marks: tuple[tuple[str, str], ...] = ()
    formula: tuple[Case, ...] = ()
    note: str = ""


class Check(Struct, forbid_unknown_fields=True, frozen=True):
    """A condition of the right answer, and the text for a scene that does not meet it."""

    holds: str
    otherwise: str
    task: str = ""


class Question(Struct, forbid_unknown_fields=True, frozen=True):
    """A question: the first check that fails gives the text of a wrong answer."""

    text: str
    right: str
    checks: tuple[Check, ...]


class Guess(Struct, forbid_unknown_fields=True, frozen=True):
    """A number to guess before contact is switched on, the formula of its true value, and an explanation.

    With a text for a sketch, students may also draw an outline: the truth is where its formula is not 0.
    """

    text: str
    label: str
    truth: str
    why: str
    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    sketch: str = ""
    outline: str = ""


class Score(Struct, forbid_unknown_fields=True, frozen=True):
    """A score of a puzzle, the lower the better, and a par: what a good answer reaches."""

    label: str
    formula: str
    par: float


class Settings(Struct, forbid_unknown_fields=True, frozen=True):
    """What stands between the fences of a lesson."""

    title: str
    scene: str
    question: Question
    guess: Guess | None = None
    contact: str = DEFAULT_CONTACT.name.lower()
    stiffness: float = DEFAULT_STIFFNESS
    mapping: str = "corrected"
    probe: Vector = (0.0, 0.0, 0.0)
    size: float | None = None
    space: bool = False
    line: tuple[int | Vector, int | Vector] = (0, 1)
    steps: int = 0
    sliders: tuple[Slider, ...] = ()
    values: tuple[Value, ...] = ()
    scores: tuple[Score, ...] = ()
    plots: tuple[Plot, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class Lesson:
    """A lesson.

    Attributes
    ----------
    settings
        Its settings.
    text
        Its text, in Markdown.
    scene
        The scene at the beginning.
    formulas
        All formulas by their text, for the variables of their places.
    templates
        All texts with formulas in braces.
    folder, name
        The folder of its files, and the name of its own without an ending.

    Examples
    --------
    >>> from decals.apps.lab.lesson import LESSONS, load_lessons
    >>> lessons = load_lessons(LESSONS)
    >>> lessons[0].settings.title
    'One decal'
    """

    settings: Settings
    text: str
    scene: Scene
    formulas: dict[str, Formula]
    templates: dict[str, Template]
    folder: Path
    name: str

    @property
    def size(self) -> float:
        """Width of maps in model units."""
        camera = self.scene.camera
        visible = 2.0 * camera.distance * float(np.tan(np.radians(camera.fov) / 2))
        return visible if self.settings.size is None else self.settings.size

    @property
    def apart(self) -> Scene:
        """The scene without contact: decals lie on each other, and solids in each other."""
        objects = [
            replace(item, tree=Union(item.tree.children))
            if isinstance(item, TreeObject) and isinstance(item.tree, SolidContact)
            else item
            for item in self.scene.objects
        ]
        alone = self.scene.decals.replace(interactions=Interaction.OVERLAP)
        return self.scene.replace(objects=objects, decals=alone)

    def experiment(self, objects: Sequence[SceneObject] | None = None) -> Experiment:
        """Return the state at the beginning, with contact; objects take the place of the scene's."""
        settings, scene = self.settings, self.scene
        modes = {name: getattr(settings, name) for name in MODES}
        return Experiment(
            objects=scene.objects if objects is None else tuple(objects),
            decals=scene.decals,
            rules=scene.drawing.overridden(**modes).rules,
            probe=settings.probe,
            camera=scene.camera,
            size=self.size,
            in_space=settings.space,
            line=settings.line,
        )

    def filled(self, text: str, scope: Scope) -> str:
        """Return one of the lesson's texts with the values of its formulas."""
        parts = self.templates[text]
        return "".join(p if isinstance(p, str) else shown(p.evaluate(scope)) for p in parts)

    def holds(self, formula: str, scope: Scope) -> bool:
        """Return True if one of the lesson's conditions holds."""
        return bool(np.all(self.formulas[formula].evaluate(scope)))

    def verdict(self, scope: Scope) -> tuple[bool, str]:
        """Return whether the scene answers the question, and the text to say so."""
        question = self.settings.question
        for check in question.checks:
            if not self.holds(check.holds, scope):
                return False, self.filled(check.otherwise, scope)
        return True, self.filled(question.right, scope)

    def formula_of(self, plot: Plot, scope: Scope) -> str:
        """Return the formula beside a plot, with the numbers at the probe."""
        cases = (case.text for case in plot.formula if self.holds(case.when, scope))
        return next((self.filled(text, scope) for text in cases), "")


def shown(value: Any) -> str:
    """Return a value as a lesson shows it: three digits, yes or no, or nothing for NaN."""
    number = np.ravel(value)[0]
    if isinstance(number, bool | np.bool_):
        return "yes" if number else "no"
    if not np.isfinite(number):
        return "–"
    if abs(number) < ROUNDING:
        return "0"
    return f"{float(number):.0f}" if abs(number) >= 100 else f"{float(number):.3g}"


def load_lessons(folder: Path) -> list[Lesson]:
    """Return the lessons of a folder, in the order of their names; numbers in names count as numbers.

    Raises
    ------
    InvalidLesson
        The folder has no lesson, or one that cannot be used; the message names the file and the field.
    """
    paths = sorted(folder.glob("*.md"), key=_order) if folder.is_dir() else []
    if not paths:
        raise InvalidLesson(
            f"expected a folder with lessons (*.md), found none in {str(folder)!r}; check the path"
        )
    return [load_lesson(path) for path in paths]


def _order(path: Path) -> list[str | int]:
    """Return the words and numbers of a name in turn."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", path.stem)]


def load_lesson(path: Path) -> Lesson:
    """Return the lesson of a file; see `load_lessons`."""
    try:
        return _parsed(read_text(path), path)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidLesson(f"could not read the lesson {str(path)!r} ({error})") from error
    except ImplicitDecalsError as error:
        raise InvalidLesson(f"{str(path)!r}: {error}") from error


def _parsed(source: str, path: Path) -> Lesson:
    fence, *rest = source.split(f"{FENCE}\n", 2)
    if fence or len(rest) != 2:
        raise InvalidLesson(f"expected settings between two lines {FENCE!r} at the top; write them in TOML")
    try:
        settings = msgspec.convert(tomllib.loads(rest[0]), type=Settings)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidLesson(f"settings: {error}; correct the TOML") from error
    except msgspec.ValidationError as error:
        raise InvalidLesson(f"settings: {error}") from error
    _check_ranges(settings)
    formulas: dict[str, Formula] = {}
    for place, text, variables in _formulas(settings):
        with _place(place):
            formulas[text] = parse(text, MEASURES, variables)
    scene = _without_files(load_scene(path.parent / settings.scene))
    for i, slider in enumerate(settings.sliders):
        with _place(f"sliders[{i}]"):
            _check_slider(slider, scene)
    templates: dict[str, Template] = {}
    for place, text in _texts(settings):
        with _place(place):
            templates[text] = _template(text)
    return Lesson(settings, rest[1].strip(), scene, formulas, templates, path.parent, path.stem)


def _without_files(scene: Scene) -> Scene:
    """Return a scene that names no files: what is saved of it in another folder has its images and meshes."""
    images = [replace(image, source=Path(image.source).stem) for image in scene.images]
    objects = [replace(one, source=None) if isinstance(one, MeshObject) else one for one in scene.objects]
    return scene.replace(images=images, objects=objects)


def _check_ranges(settings: Settings) -> None:
    """Raise `InvalidLesson` for numbers that types do not exclude."""
    member("contact", settings.contact, Contact, InvalidLesson)
    member("mapping", settings.mapping, ImageMapping, InvalidLesson)
    stiffness_number(settings.stiffness, InvalidLesson)
    if not settings.question.checks:
        raise InvalidLesson("question.checks: expected one check or more; a question needs an answer")
    if settings.size is not None and not 0.0 < settings.size < np.inf:
        raise InvalidLesson(f"size: expected a width above 0, got {settings.size!r}")
    if not 0 <= settings.steps <= 1000:
        raise InvalidLesson(f"steps: expected 0 to 1000, got {settings.steps!r}")
    sliders: list[Any] = [*settings.sliders, *filter(None, [settings.guess])]
    for i, slider in enumerate(sliders):
        if not getattr(slider, "choices", ()) and not -np.inf < slider.low < slider.high < np.inf:
            raise InvalidLesson(f"sliders[{i}]: expected low < high, got {slider.low!r} and {slider.high!r}")
    for i, plot in enumerate(settings.plots):
        if bool(plot.curves) == bool(plot.map):
            raise InvalidLesson(f"plots[{i}]: expected either curves or a map; give one of them")
        for name, ends in {"x": plot.x, "y": plot.y, "values": plot.values}.items():
            if ends is not None and not -np.inf < ends[0] < ends[1] < np.inf:
                raise InvalidLesson(f"plots[{i}].{name}: expected two numbers, low < high, got {list(ends)}")
        if plot.map and (plot.x is None) != (plot.y is None):
            raise InvalidLesson(f"plots[{i}]: a map has both x and y, or neither")


def _check_slider(slider: Slider, scene: Scene) -> None:
    """Raise `InvalidLesson` if a slider leads to no number or choice of the scene."""
    if slider.path in OWN:
        return
    value = binding(slider.path).read(scene.objects, scene.decals)
    if isinstance(value, str) != bool(slider.choices):
        expected = "choices" if isinstance(value, str) else "no choices"
        raise InvalidLesson(f"{slider.path}: expected {expected}, as its value is {value!r}")
    if not isinstance(value, str | int | float):
        raise InvalidLesson(f"{slider.path}: expected one number, got {value!r:.60}; add its index")


def _formulas(settings: Settings) -> Iterator[tuple[str, str, set[str]]]:
    """Yield place, text and variables of all formulas."""
    for i, value in enumerate(settings.values):
        yield f"values[{i}]", value.formula, set()
    for i, score in enumerate(settings.scores):
        yield f"scores[{i}]", score.formula, set()
    for i, plot in enumerate(settings.plots):
        names = ({"x", "y"} if plot.x else set()) if plot.map else {"x"}
        texts = [*(curve.formula for curve in plot.curves), *filter(None, (plot.map, plot.red))]
        yield from ((f"plots[{i}]", text, names) for text in texts)
        yield from ((f"plots[{i}].marks", text, set()) for mark in plot.marks for text in mark)
        yield from ((f"plots[{i}].formula", case.when, set()) for case in plot.formula)
    for i, check in enumerate(settings.question.checks):
        yield f"question.checks[{i}]", check.holds, set()
    if settings.guess is not None:
        yield "guess.truth", settings.guess.truth, set()
        if settings.guess.sketch or settings.guess.outline:
            yield "guess.outline", settings.guess.outline, set()


def _texts(settings: Settings) -> Iterator[tuple[str, str]]:
    """Yield place and text of all texts that may have formulas in braces."""
    for i, plot in enumerate(settings.plots):
        yield from ((f"plots[{i}].formula", case.text) for case in plot.formula)
    for i, check in enumerate(settings.question.checks):
        yield f"question.checks[{i}].otherwise", check.otherwise
    yield "question.right", settings.question.right
    if settings.guess is not None:
        yield "guess.why", settings.guess.why


def _template(text: str) -> Template:
    pieces = PLACEHOLDER.split(text)
    return tuple(parse(p, MEASURES, set()) if i % 2 else p for i, p in enumerate(pieces))


@contextmanager
def _place(name: str) -> Iterator[None]:
    """Let errors name the place in the file."""
    try:
        yield
    except InvalidLesson as error:
        raise InvalidLesson(f"{name}: {error}") from None
