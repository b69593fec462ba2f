"""`lesson_page`: a lesson of the contact lab as one HTML page."""

import html
import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from PIL import Image

from blobtree.progress import Progress, reporting
from decals.apps.lab.bindings import binding
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.lesson import Lesson, Plot, Slider
from decals.apps.lab.measures import MEASURES
from decals.apps.lab.symbols import document
from decals.apps.lesson_pages.code import WORDS, javascript, marked_text, pieces
from decals.apps.lesson_pages.tables import Table, positions_of, tabulated
from decals.apps.lesson_pages.translation import Translation, translation
from decals.field.mapping import ImageMapping
from decals.pages.page import Page, as_script, filled, viewer_script, viewer_slots
from decals.pages.programs import PREFIX
from decals.scenes.files import to_json
from decals.scenes.scene import Scene
from decals.shaders import compose

FILES = Path(__file__).parent
MODULES = "measures", "plots", "puzzles", "answers", "lesson"
"""Modules of a lesson, each after those that it imports."""

NAMES = """
    abs at between contact count d distance f F folded g h influence interaction jump layer least max most
    kept lost overlapped owner pushed radius share stiffness stretch top where
"""

KNOWN = frozenset([*NAMES.split(), *WORDS])
"""Measures that ``measures.mjs`` has, and names of modes. Other ones have values in a table."""

IMAGE_SIDE = 128
"""Most pixels of a side of an image: pages of lessons are small."""

BLOCKS = 8
"""Blocks along trees, for rays: few, as a page has many trees."""

SEND = (
    '<form class="send"><label>{person} <input name="person" maxlength="40" autocomplete="off"></label> '
    '<button>{send}</button> <output role="status"></output></form>'
)
"""What a student sends in a class."""

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
    known, formulas = _record(lesson, words, table), _formulas(lesson, table)
    begin = (
        "begin(document.getElementById('lesson'), document.getElementById('data').textContent, "
        f"{_script_json(known)}, {{{formulas}}}).then((page) => (globalThis.page = page));\n"
    )
    slots |= _markup(lesson, words, table, links)
    slots["SEND"] = SEND.format(**words.page) if sends else ""
    slots["STYLE"] += (FILES / "lesson.css").read_text(encoding="utf-8")
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
            _formulas(lesson, None)
    except InvalidLesson as error:
        return f"{settings.title}: {error}"
    return None


@cache
def lesson_script() -> str:
    """Return the viewer with the modules of lessons, as one ES module."""
    return viewer_script(
        *((FILES / f"{name}.mjs").read_text(encoding="utf-8") for name in MODULES), name="begin"
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
    settings, question, guess = lesson.settings, lesson.settings.question, lesson.settings.guess
    camera = lesson.scene.camera

    def parts(text: str) -> list[str]:
        return pieces(words.said(text), words.definitions)

    rows = json.loads(to_json(_small(lesson.scene).replace(objects=[]), folder=Path()))["decals"]
    return {
        "camera": {name: getattr(camera, name) for name in ("position", "target", "up", "fov")},
        "size": lesson.size,
        "line": settings.line,
        "probe": settings.probe,
        "up": np.asarray(camera.axes[2]).tolist(),
        "mode": settings.contact,
        "stiffness": settings.stiffness,
        "mapping": settings.mapping,
        "mappings": [mapping.name.lower() for mapping in sorted(ImageMapping)],
        "rows": rows,
        "name": lesson.name,
        "scores": [{"formula": score.formula, "par": score.par} for score in settings.scores],
        "states": len(table.objects) if table else 0,
        "values": [value.formula for value in settings.values],
        "plots": [_plot(plot, parts, words, table) for plot in _plots(lesson)],
        "question": {
            "right": parts(question.right),
            "checks": [{"holds": c.holds, "otherwise": parts(c.otherwise)} for c in question.checks],
        },
        "guess": guess
        and {
            "truth": guess.truth,
            "why": parts(guess.why),
            "compared": html.escape(words.page["compared"]) + " ",
        },
        "words": words.page,
        "shader": compose("page_measures.frag", version=None).text.replace(
            "decal_surface_receivers", f"{PREFIX}surface_receivers"
        ),
    }


def _plots(lesson: Lesson) -> list[Plot]:
    """Return the plots of a page: maps in space are left out."""
    return [plot for plot in lesson.settings.plots if not (plot.map and lesson.settings.space)]


def _plot(plot: Plot, parts: Any, words: Translation, table: Table | None) -> dict[str, Any]:
    return {
        "curves": [{"label": words.said(curve.label), "formula": curve.formula} for curve in plot.curves],
        "map": plot.map,
        "red": plot.red,
        "redLabel": words.said(plot.red_label),
        **{name: getattr(plot, name) for name in ("x", "y", "values")},
        "marks": () if table else plot.marks,
        "formula": () if table else [{"text": parts(case.text), "when": case.when} for case in plot.formula],
        "at": table.line if table else (),
    }


def _formulas(lesson: Lesson, table: Table | None) -> str:
    """Return all formulas of a lesson as members of an object of JavaScript."""
    if table is not None:
        return ",\n".join(
            f"{_script_json(text)}: (m) => {_script_json(values)}[m.state]"
            for text, values in table.values.items()
        )
    known = {text: formula.text for text, formula in lesson.formulas.items()}
    for template in lesson.templates.values():
        known |= {part.text: part.text for part in template.parts if not isinstance(part, str)}
    return ",\n".join(
        f"{_script_json(name)}: (m, q) => {javascript(text, MEASURES, KNOWN)}" for name, text in known.items()
    )


def _script_json(value: Any) -> str:
    """Return a value as JSON that may stand in a script."""
    return msgspec.json.encode(value).decode().replace("<", "\\u003c")


# -- the markup -----------------------------------------------------------------------------------------


def _markup(
    lesson: Lesson, words: Translation, table: Table | None, links: Sequence[tuple[str, str]]
) -> dict[str, str]:
    """Return the slots of the template that texts of the lesson fill."""
    settings, guess = lesson.settings, lesson.settings.guess

    def text(given: str) -> str:
        return marked_text(words.said(given), words.definitions)

    tasks = "".join(
        f'<li data-task="{i}" id="task-{i + 1}"><span class="mark" role="img" '
        f'aria-label="{html.escape(words.page["open"])}"></span>'
        f'<span>{text(c.task)} <a href="#task={i + 1}" '
        f'aria-label="{html.escape(words.said(c.task))}">#</a></span></li>'
        for i, c in enumerate(settings.question.checks)
        if c.task
    )
    form = guess and (
        f'<form class="guess"><p>{text(guess.text)}</p><p><label>{text(guess.label)} <input name="guess" '
        f'type="number" required min="{guess.low:g}" max="{guess.high:g}" step="{guess.step:g}"></label> '
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
        '<p class="shared" role="status"></p>'
    )
    plots = "".join(
        f'<div class="plot"><h2>{text(plot.title)}</h2><div class="formula"></div>'
        f'<div class="chart" role="img" aria-label="{html.escape(words.said(plot.title))}"></div>'
        f'<div class="note">{text(plot.note)}</div></div>'
        for plot in _plots(lesson)
    )
    names = ("lessons", "about", "parameters", "values", "readings", "check", "again", "needs")
    body = words.bodies.get(lesson.name, lesson.text)
    return {
        **{name.upper(): html.escape(words.page[name]) for name in names},
        "KEYS": html.escape(words.page["turn" if settings.space else "keys"]),
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
        "PLOTS": plots,
    }


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
