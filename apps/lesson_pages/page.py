"""`lesson_page`: a lesson of the contact lab as one HTML page."""

import html
import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from blobtree.progress import Progress, reporting
from decals.apps.lab.bindings import AXES, binding
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lesson import LESSONS, Guess, Lesson, Plot, Slider, Value
from decals.apps.lab.measures import MEASURES
from decals.apps.lab.plots import COLORS, DASHES, SCALE, viridis
from decals.apps.lab.script import script as python_lines
from decals.apps.lab.sketches import pad
from decals.apps.lab.symbols import SYMBOL, document, marked, regions, styles
from decals.apps.lesson_pages.code import (
    FORMS,
    WORDS,
    Code,
    access,
    javascript,
    marked_text,
    said,
    script,
    script_json,
)
from decals.apps.lesson_pages.tables import Table, positions_of, tabulated
from decals.apps.lesson_pages.translation import Translation, translation
from decals.field.mapping import ImageMapping
from decals.pages.page import Page, as_script, filled, viewer_script, viewer_slots
from decals.pages.programs import PREFIX
from decals.scenes.files import to_json
from decals.scenes.scene import Scene
from decals.shaders import compose

FILES = Path(__file__).parent
SHARED = tuple(FILES.parent / "sandbox" / name for name in ("sketch.mjs", "scores.mjs"))
"""The modules of sketches and of scores, which the contact lab has, too."""
MODULES = "measures", "plots", "puzzles", "answers", "lesson"
"""Modules of a lesson, each after those that it imports."""

NAMES = """
    at between d distance f F g h influence jump kept least lost most overlapped pushed radius share top
"""

KNOWN = frozenset([*NAMES.split(), *FORMS, *WORDS])
"""Measures that pages have, and names of modes. Other ones have values in a table."""

IMAGE_SIDE = 128
"""Most pixels of a side of an image: pages of lessons are small."""

BLOCKS = 8
"""Blocks along trees, for rays: few, as a page has many trees."""

SEND = (
    '<form class="send" name="sent" method="dialog"><label>{person} '
    '<input name="person" maxlength="40" autocomplete="off"></label> '
    '<button>{send}</button> <output role="status"></output></form>'
)
"""What a student sends in a class; the method "dialog" of a form asks no server."""

COLORS_OF_MAP = 64
"""Colours between the lowest and the highest value of a map."""

STEPS = 200
"""Steps of a slider whose lesson gives none."""


def lesson_page(
    lesson: Lesson,
    *,
    language: str = "en",
    links: Sequence[tuple[str, str]] = (),
    sends: bool = False,
    progress: Progress | None = None,
) -> Page:
    """Return a lesson as one HTML page, which needs no server and no network.

    The page shows the scene with WebGL 2. What decals do at the probe, on the map and on the line is live
    there. A lesson about solids has values in a table, for all positions of its sliders.

    Parameters
    ----------
    lesson : Lesson
        The lesson.
    language : str
        Code of the language: "en", or one with a file in ``languages``.
    links : sequence of (str, str), optional
        Text and address of links to other lessons and languages.
    sends : bool
        The page sends its numbers to the server of a class, once its student asks for that.
    progress : callable, optional
        Function of the stage and its finished fraction, 0 to 1, called repeatedly.

    Raises
    ------
    InvalidLesson
        No such language, or a lesson that has no page: a relaxation, or too many positions of sliders.

    Examples
    --------
    >>> from decals.apps.lab.lesson import LESSONS, load_lessons
    >>> from decals.apps.lesson_pages.page import lesson_page
    >>> lesson_page(load_lessons(LESSONS)[0])
    Page(title='One decal')
    """
    words, settings = translation(language), lesson.settings
    if reason := no_page(lesson):
        raise InvalidLesson(reason)
    table = tabulated(lesson) if settings.space else None
    title = words.said(settings.title)
    with reporting(progress) as report:
        slots = viewer_slots(
            _small(_page_scene(lesson, table)),
            title,
            title,
            controls=False,
            background=lesson.scene.drawing.background,
            traced=BLOCKS,
            resolution=None,
            report=report,
            picture=lesson.scene,
        )
    begin = (
        "begin(document.getElementById('lesson'), document.getElementById('data').textContent, "
        f"{script_json(_record(lesson, words, table))}, {script(_live(lesson, words, table))})"
        ".then((page) => (globalThis.page = page));\n"
    )
    slots |= _markup(lesson, words, table, links)
    slots["SEND"] = SEND.format(**words.page) if sends else ""
    slots["STYLE"] += (FILES / "lesson.css").read_text(encoding="utf-8") + styles("#lesson")
    slots["SCRIPT"] = as_script(lesson_script(), "begin") + begin
    template = (FILES / "lesson.html").read_text(encoding="utf-8")
    return Page(filled(template, slots), slots["DATA"], title)


def no_page(lesson: Lesson) -> str | None:
    """Return why a lesson has no page; None if it has one."""
    settings = lesson.settings
    if settings.steps:
        return f"{settings.title}: a relaxation has no page; open it in the contact lab"
    try:
        if settings.space:
            positions_of(lesson)
        else:
            _live(lesson, translation("en"), None)
    except InvalidLesson as error:
        return f"{settings.title}: {error}"
    return None


@cache
def lesson_script() -> str:
    """Return the viewer with the modules of lessons, as one ES module."""
    return viewer_script(
        *(
            path.read_text(encoding="utf-8")
            for path in (*SHARED, *(FILES / f"{name}.mjs" for name in MODULES))
        ),
        name="begin",
    )


def _page_scene(lesson: Lesson, table: Table | None) -> Scene:
    """Return the scene of a page: without contact where a guess comes first; of a table, all its models."""
    begin = lesson.apart if lesson.settings.guess is not None else lesson.scene
    if table is None:
        return begin
    return begin.replace(objects=[*table.objects, *begin.objects])


def _small(scene: Scene) -> Scene:
    """Return a scene with small images."""
    images: list[Any] = []
    for image in scene.images:
        picture = Image.fromarray(image.pixels)
        picture.thumbnail((IMAGE_SIDE, IMAGE_SIDE))
        images.append(np.asarray(picture))
    return scene.replace(images=images)


def _record(lesson: Lesson, words: Translation, table: Table | None) -> dict[str, Any]:
    """Return what the script of a page knows of its lesson."""
    settings = lesson.settings
    camera = lesson.scene.camera
    paths = [slider.path for slider in settings.sliders]
    axes = [i for i, axis in enumerate(AXES) if f"probe.{axis}" in paths]
    return {
        "camera": {name: getattr(camera, name) for name in ("position", "target", "up", "fov")},
        "size": lesson.size,
        "line": settings.line,
        "probe": settings.probe,
        "axes": axes or [0, 1, 2],
        "up": np.asarray(camera.axes[2]).tolist(),
        "drawing": {"mode": settings.contact, "stiffness": settings.stiffness},
        "mapping": settings.mapping,
        "mappings": [mapping.name.lower() for mapping in sorted(ImageMapping)],
        "rows": _rows(lesson.scene),
        "apart": _rows(lesson.apart),
        "name": lesson.name,
        "scores": [{"formula": score.formula, "par": score.par} for score in settings.scores],
        "states": len(table.objects) if table else 0,
        "table": table.values if table else {},
        "colors": viridis(np.linspace(0.0, 1.0, COLORS_OF_MAP)).astype(int).tolist(),
        "guess": settings.guess is not None,
        "half": pad(lesson)["half"] if settings.guess and settings.guess.sketch else None,
        "words": words.page,
        "shader": compose("page_measures.frag", version=None).text.replace(
            "decal_surface_receivers", f"{PREFIX}surface_receivers"
        ),
    }


def _rows(scene: Scene) -> list[dict[str, Any]]:
    """Return the decals of a scene as files have them, with the values that lessons name."""
    rows = json.loads(to_json(_small(scene).replace(objects=[]), folder=Path()))["decals"]
    return [{"interaction": "push", "layer": 0, "opacity": 1, **row} for row in rows]


def _live(lesson: Lesson, words: Translation, table: Table | None) -> dict[str, Any]:
    """Return the functions of a page: its formulas, texts with formulas, plots and sliders."""
    settings, guess, checks = lesson.settings, lesson.settings.guess, lesson.settings.question.checks

    def code(text: str) -> str:
        if table is None:
            return javascript(text, MEASURES, KNOWN)
        return f"m.lesson.table[{script_json(text)}][m.state]"

    def value(text: str, end: str = "") -> Code:
        return Code(f"(m, q) => {code(text)}{end}")

    def text(given: str) -> Code:
        return Code(f"(m, q) => {said(words.said(given), code, words.definitions)}")

    def plotted(plot: Plot) -> dict[str, Any]:
        acts = {} if table or plot.x or plot.map else regions(in_space=False, count=len(lesson.scene.decals))
        return {
            "points": Code(_points(plot, table)),
            "curves": [
                {"formula": value(c.formula, "[q.i]" if table else ""), "look": look}
                for c, look in _lines(plot)
            ],
            "acts": [
                {"formula": value(formula), "look": f'data-region="{symbol}"'}
                for symbol, formula in acts.items()
            ],
            "map": plot.map and value(plot.map),
            "red": plot.red and value(plot.red),
            "marks": () if table else [[value(one) for one in pair] for pair in plot.marks],
            "formula": () if table else [{"text": text(c.text), "when": value(c.when)} for c in plot.formula],
            **{name: ends for name in ("x", "y", "values") if (ends := getattr(plot, name))},
        }

    def seen(guess: Guess) -> Code:
        numbers = {"guess": "m.guess", "truth": code(guess.truth)}
        compared = said(words.page["compared"] + " ", numbers.__getitem__, {})
        meters = " + ".join(_meter(words.page[name], guess, number) for name, number in numbers.items())
        return Code(
            f"(m, q) => {compared} + {meters} + {said(words.said(guess.why), code, words.definitions)}"
        )

    return {
        "values": [value(one.formula) for one in settings.values],
        "scores": [value(score.formula) for score in settings.scores],
        "checks": [{"holds": value(check.holds), "otherwise": text(check.otherwise)} for check in checks],
        "right": text(settings.question.right),
        "seen": guess and seen(guess),
        "outline": guess and guess.sketch and value(guess.outline),
        "plots": [plotted(plot) for plot in _plots(lesson)],
        "sliders": [access(slider.path) for slider in settings.sliders],
    }


def _points(plot: Plot, table: Table | None) -> str:
    """Return the function of the points of a plot, in JavaScript."""
    if table is not None:
        return f"() => {script_json([{'x': x, 'i': i} for i, x in enumerate(table.line)])}"
    if plot.x is None:
        return "(m) => m.map()" if plot.map else "(m) => m.curve()"
    ranges = [script_json(ends) for ends in (plot.x, plot.y) if ends]
    return f"(m) => m.{'numbersOver' if plot.y else 'numbersAlong'}({', '.join(ranges)})"


def _plots(lesson: Lesson) -> list[Plot]:
    """Return the plots of a page: maps in space are left out."""
    return [plot for plot in lesson.settings.plots if not (plot.map and lesson.settings.space)]


# -- the markup -----------------------------------------------------------------------------------------


def _markup(
    lesson: Lesson, words: Translation, table: Table | None, links: Sequence[tuple[str, str]]
) -> dict[str, str]:
    """Return the slots of the template that texts of the lesson fill."""
    settings, guess = lesson.settings, lesson.settings.guess

    def text(given: str) -> str:
        return marked_text(words.said(given), words.definitions)

    tasks = "".join(
        f'<li data-task id="task={i + 1}"><label><input type="checkbox" disabled value="{i}"> '
        f'{text(c.task)}</label> <a href="#task={i + 1}" '
        f'aria-label="{html.escape(words.said(c.task))}">#</a></li>'
        for i, c in enumerate(settings.question.checks)
        if c.task
    )
    sketch = (
        guess
        and guess.sketch
        and (
            f'<p>{text(guess.sketch)}</p><div class="pad" role="img" '
            f'aria-label="{html.escape(words.said(guess.sketch))}">{pad(lesson)["picture"]}</div>'
        )
    )
    form = guess and (
        f'<form class="guess" name="guessed" method="dialog"><p>{text(guess.text)}</p>{sketch or ""}'
        f'<p><label>{text(guess.label)} <input name="guess" type="number" required '
        f'min="{guess.low:g}" max="{guess.high:g}" step="{guess.step:g}"></label> '
        f"<button>{words.page['see']}</button> "
        f'<button type="button" name="skip">{words.page["skip"]}</button></p></form>'
    )
    rows = "".join(f"<tr><td>{text(value.label)}</td><td></td></tr>" for value in settings.values)
    heads = "".join(f'<th scope="col">{words.page[name]}</th>' for name in ("score", "now", "par", "best"))
    lines = "".join(
        f'<tr><th scope="row">{text(score.label)}</th>{"<td></td>" * 3}</tr>' for score in settings.scores
    )
    scores = (
        f'<table class="scores"><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table>'
        f'<p><button type="button" name="share">{words.page["share"]}</button></p>'
        '<p class="shared" role="status"><a></a></p>'
    )
    plots = "".join(
        f'<div class="plot"><h2>{text(plot.title)}</h2><div class="formula"></div>{_key(plot, words)}'
        f'<div class="chart" role="img" aria-label="{html.escape(words.said(plot.title))}"></div>'
        f'<div class="note">{text(plot.note)}</div></div>'
        for plot in _plots(lesson)
    )
    names = ["lessons", "about", "parameters", "values", "readings"]
    names += ["check", "again", "needs", "later", "python", "sandbox", "run", "copy"]
    undo = f'<button type="button" name="back">{words.page["undo"]}</button>'
    body = words.bodies.get(lesson.name, lesson.text)
    return {
        **{name.upper(): html.escape(words.page[name]) for name in names},
        "KEYS": html.escape(words.page["turn" if settings.space else "keys"]),
        "UNDO": "" if settings.space else undo,
        "LANGUAGE": words.code,
        "WAITS": "true" if guess else "false",
        "NAVIGATION": "".join(
            f'<a href="{html.escape(to)}">{html.escape(label)}</a> ' for label, to in links
        ),
        "BODY": document(body, words.definitions),
        "GUESS": form or "",
        "QUESTION": text(settings.question.text),
        "TASKS": tasks,
        "SCORES": scores if settings.scores else "",
        "SLIDERS": "".join(_slider(slider, lesson, words, table) for slider in settings.sliders),
        "ROWS": rows,
        "COLORS": "".join(
            f'<stop offset="{part}" stop-color="rgb({", ".join(map(str, color))})"/>'
            for part, color in zip(np.linspace(0, 1, len(SCALE)), SCALE.astype(int), strict=True)
        ),
        "SYMBOLS": "" if settings.space else _readings(words),
        "LINES": html.escape(python_lines(lesson, lesson.experiment())),
        "COMMAND": html.escape(_command(lesson)),
        "PROBE": html.escape(words.page["probe"]),
        "PLOTS": plots,
    }


def _command(lesson: Lesson) -> str:
    """Return the line that opens a lesson in the sandbox; of other lessons it names their folder."""
    folder = [] if lesson.folder == LESSONS else ["--lessons", lesson.folder.name]
    return shlex.join(["implicit-decals", "sandbox", *folder, "--lesson", lesson.name])


def _key(plot: Plot, words: Translation) -> str:
    """Return the key of the lines of a plot, or of the red part of its map."""
    if plot.red:
        return f'<p class="red">{html.escape(words.said(plot.red_label))}</p>'
    lines = "".join(
        f'<span><svg viewBox="0 0 22 4" aria-hidden="true"><path d="M0 2h22" {look}/></svg> '
        f"{marked_text(words.said(curve.label), words.definitions)}</span>"
        for curve, look in _lines(plot)
    )
    return f'<div class="key">{lines}</div>'


def _lines(plot: Plot) -> Iterator[tuple[Value, str]]:
    """Yield the curves of a plot, each with the attributes of its line: its look, and its symbol."""
    for curve, color, dashes in zip(plot.curves, cycle(COLORS), cycle(DASHES), strict=False):
        symbol = SYMBOL.match(curve.label)
        of = f' data-symbol="{symbol[0]}"' if symbol else ""
        yield curve, f'stroke="{color}" stroke-width="2" stroke-dasharray="{dashes}"{of}'


def _meter(label: str, guess: Guess, number: str) -> str:
    """Return an expression of JavaScript: a bar for a number, on the scale of a guess."""
    ends = f'min="{guess.low:g}" max="{guess.high:g}"'
    begin = f"<label class='meter'>{html.escape(label)} <meter {ends} value='"
    end = "'></meter></label>"
    return f"{script_json(begin)} + {number} + {script_json(end)}"


def _readings(words: Translation) -> str:
    """Return the table of the symbols at the probe, without its rows."""
    names = (html.escape(words.page["decal"]), *"rsdfhF", html.escape(words.page["stretch"]))
    heads = (marked(name, reached=True, definitions=words.definitions) for name in names)
    cells = "".join(f'<th scope="col">{head}</th>' for head in heads)
    return f"<table><thead><tr>{cells}</tr></thead><tbody></tbody></table>"


def _slider(slider: Slider, lesson: Lesson, words: Translation, table: Table | None) -> str:
    """Return a slider or a choice, with the value at the beginning."""
    own: Mapping[str, Any] = {
        **{name: getattr(lesson.settings, name) for name in ("contact", "stiffness", "mapping")},
        **{f"probe.{axis}": value for axis, value in zip("xyz", lesson.settings.probe, strict=True)},
    }
    value = own.get(slider.path)
    if value is None:
        value = binding(slider.path).read(lesson.scene.objects, lesson.scene.decals)
    data = f'data-path="{html.escape(slider.path)}" data-value="{html.escape(str(value))}"'
    if table is not None and slider.path in table.positions:
        positions = table.positions[slider.path]
        data += f' data-count="{len(positions)}"'
    label = f"<label><span>{marked_text(words.said(slider.label), words.definitions)}</span>"
    if slider.choices:
        options = "".join(
            f'<option value="{html.escape(choice)}">{html.escape(words.said(choice))}</option>'
            for choice in slider.choices
        )
        return f"{label}<select {data}>{options}</select></label>"
    step = slider.step or (slider.high - slider.low) / STEPS
    ends = f'min="{slider.low:g}" max="{slider.high:g}" step="{step:g}"'
    return f'{label}<input type="range" {ends} {data}><output></output></label>'
