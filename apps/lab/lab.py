"""The state of the contact lab, and the events that its page sends.

The lab runs on an edit window like the sandbox. Values and plots are computed in a thread from immutable
values, so that they never block the page.
"""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from html import escape
from typing import Any

import msgspec
import numpy as np
import pyvista as pv

from decals.apps.lab import sketches
from decals.apps.lab.bindings import AXES, MODES, binding
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.experiment import Experiment, Scope
from decals.apps.lab.lesson import Lesson, Slider, shown
from decals.apps.lab.plots import drawn
from decals.apps.lab.puzzles import Puzzle, read_puzzle
from decals.apps.lab.relaxing import Recording
from decals.apps.lab.script import script
from decals.apps.lab.symbols import document, marked, readings, table
from decals.apps.sandbox.controls import STEPS, Control, exchanged
from decals.apps.sandbox.decal_panel import set_drawing
from decals.editing.commands import ReplaceScene, SetValues
from decals.editing.gizmo import Ray, on_plane
from decals.editing.queries import move_decals
from decals.editing.slicing import SlicePlane
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.validation import number_of, whole_number
from decals.vtk.component import show_camera
from decals.window import EditWindow

STEPPING_SECONDS = 0.05
"""Time that a relaxation takes between two looks at the session."""


PROBE_SIZE = 0.015
"""Radius of the probe in the view, in widths of a map."""


@dataclass(frozen=True, eq=False)
class Results:
    """What was computed for one state."""

    key: object
    verdict: tuple[bool, str]
    values: list[dict[str, str]] = field(default_factory=list)
    plots: list[dict[str, str]] = field(default_factory=list)
    tasks: list[dict[str, Any]] = field(default_factory=list)
    guess: dict[str, Any] = field(default_factory=dict)
    scores: tuple[float, ...] = ()
    readings: str = ""


class Lab:
    """Lessons on an edit window.

    Parameters
    ----------
    window
        The edited window; its plotter is the view.
    lessons
        The lessons.

    Attributes
    ----------
    probe
        The point at which values are measured.
    begun
        Number of changes of the session when the present lesson began, before the guess.

    Notes
    -----
    Events raise errors of the library for bad values, and the scene stays as it was.
    """

    def __init__(self, window: EditWindow, lessons: Sequence[Lesson]) -> None:
        self._window, self._lessons = window, lessons
        titles = (lesson.settings.title for lesson in lessons)
        self._titles = [{"title": f"{i + 1}. {title}", "value": i} for i, title in enumerate(titles)]
        self._texts = [document(lesson.text) for lesson in lessons]
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="lab")
        self._stepper = ThreadPoolExecutor(1, thread_name_prefix="relaxation")
        self._steps: tuple[Recording, Future[int]] | None = None
        self._starts, self._coming = 0, False
        self._pending: Future[Results] | None = None
        self._results: Results | None = None
        self._asked: object = None
        self._asking = False
        self._submitted: object = None
        self._number = self._first = self._step = self._target = self.begun = 0
        self.probe = self.lesson.settings.probe
        self._plane: SlicePlane | None = None
        self._guess: float | None = None
        self._recording: Recording | None = None
        self._puzzle: Puzzle | None = None
        self._framed: tuple[Any, ...] = (None,)

    # -- state ------------------------------------------------------------------------------------------

    @property
    def lesson(self) -> Lesson:
        """The present lesson."""
        return self._lessons[self._number]

    @property
    def numbers(self) -> list[int]:
        """Numbers of the lesson's decals, and of those that were added, in the document."""
        numbers = self._window.document.decals.numbers
        numbers = numbers[numbers >= self._first]
        own = self._first + np.arange(len(self.lesson.scene.decals))
        if not np.array_equal(numbers[: len(own)], own):
            raise InvalidLesson("a decal of the lesson was deleted; undo, or start the lesson again")
        return [int(number) for number in numbers]

    def experiment(self) -> Experiment:
        """Return the present state as immutable values."""
        document = self._window.document
        decals = document.decals.take(np.array(self.numbers, np.int64))
        relaxed = None
        if self._recording is not None:
            step = self._recording.step_of(decals.positions)
            relaxed = self._recording.relaxed(self._step if step is None else step)
        return replace(
            self.lesson.experiment(document.objects),
            decals=decals,
            rules=document.drawing.rules,
            probe=self.probe,
            relaxed=relaxed,
            plane=self._plane,
        )

    def _key(self) -> object:
        now, own = self._window.document, (self._number, self.probe, self._plane, self._step)
        return *own, now.objects, now.decals.version, now.drawing

    def values(self) -> dict[str, Any]:
        """Return all values of the page, by their names there."""
        lesson, results = self.lesson, self._results or Results(None, (False, ""))
        right, text = results.verdict
        if results.key != self._key() or not (right or self._asked == results.key):
            right, text = False, ""
        guess = msgspec.to_builtins(lesson.settings.guess) or {}
        if guess.get("sketch"):
            guess["pad"] = sketches.pad(lesson)
        return {
            "lab_titles": self._titles,
            "lab_number": self._number,
            "lab_text": self._texts[self._number],
            "lab_question": marked(escape(lesson.settings.question.text)),
            "lab_sliders": [self._slider(i, slider) for i, slider in enumerate(lesson.settings.sliders)],
            "lab_guess": {**guess, "waits": self.waits, **results.guess},
            **{f"lab_{name}": getattr(results, name) for name in ("values", "plots", "readings", "tasks")},
            "lab_stale": self.busy,
            "lab_verdict": {"right": right, "text": marked(escape(text))},
            "lab_puzzle": self._scores(results.scores, right),
        }

    def _scores(self, scores: tuple[float, ...], right: bool) -> dict[str, Any]:
        """Return the scores, the text of their link, and the pars if the decals have the puzzle's sizes."""
        if not scores:
            return {}
        decals, puzzle = self._window.document.decals, self._puzzle or Puzzle.of(self.lesson)
        radii = [float(f"{radius:.4g}") for radius in decals.take(np.array(self.numbers)).radii.tolist()]
        made, is_own = Puzzle.made(radii, scores).text, list(puzzle.radii) == radii
        rows = [
            {"label": score.label, "text": shown(value), "value": value, "par": par if is_own else None}
            for score, value, par in zip(self.lesson.settings.scores, scores, puzzle.pars, strict=True)
        ]
        key = f"{self.lesson.name} {made.split('&')[0]}"
        return {"rows": rows, "text": made, "key": key, "counts": right}

    def _slider(self, number: int, slider: Slider) -> dict[str, Any]:
        try:
            value = self._read(slider.path)
        except InvalidLesson:
            value = None
        step = slider.step or (slider.high - slider.low) / STEPS
        kind = "choice" if slider.choices else "number"
        control = Control(slider.label, kind, value, "", "", slider.low, slider.high, step, slider.choices)
        return {"number": number, **vars(control)}

    def _read(self, path: str) -> Any:
        if path.startswith("probe."):
            return self.probe[AXES.index(path[-1])]
        match path:
            case mode if mode in MODES:
                value = getattr(self._window.document.drawing, path)
                return value if path == "stiffness" else value.name.lower()
            case "step":
                return self._target
            case "seed":
                return self._recording.seed if self._recording is not None else 0
        document = self._window.document
        return binding(path).read(document.objects, document.decals.take(np.array(self.numbers, np.int64)))

    # -- measuring --------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Go on with what is under way; call this regularly."""
        if self._coming and self._window.background.busy_editing:
            return
        self._follow_size()
        if self._recording is not None and self._step != self._target:
            self._relax(self._recording)
        key = self._key()
        if self._asking and not self._editing:
            self._asked, self._asking = key, False
        try:
            if self._pending is not None and self._pending.done():
                done, self._pending = self._pending, None
                self._results = done.result()
            known = self._results is not None and self._results.key == key
            if self._pending is None and not self.waits and not known:
                self._submitted = key
                state = self.experiment()
                self._pending = self._worker.submit(measured, self.lesson, state, key, self._guess)
        except ImplicitDecalsError as error:
            self._results = Results(self._submitted, (False, str(error)))

    @property
    def busy(self) -> bool:
        """True until the values are those of the present state."""
        known = self.waits or (self._results is not None and self._results.key == self._key())
        return self._editing or self._asking or not known

    @property
    def waits(self) -> bool:
        """True while contact is off, until the student's guess."""
        return self.lesson.settings.guess is not None and self._guess is None

    @property
    def _editing(self) -> bool:
        """True until what sliders asked for is done."""
        return self._step != self._target or self._window.background.busy_editing

    def close(self) -> None:
        """End the thread."""
        for threads in (self._worker, self._stepper):
            threads.shutdown(cancel_futures=True)

    # -- events -----------------------------------------------------------------------------------------

    def guess(self, value: Any) -> None:
        """Take the student's guess, and switch contact on."""
        self.start(self._number, number_of("guess", value, InvalidEdit), self._puzzle)

    def puzzle(self, text: Any) -> tuple[int, Puzzle]:
        """Return the puzzle of a link, and the number of its lesson: the first one that has scores."""
        found = (i for i, lesson in enumerate(self._lessons) if lesson.settings.scores)
        number = next(found, self._number)
        return number, read_puzzle(text, self._lessons[number])

    def start(self, number: int, guess: float | None = None, puzzle: Puzzle | None = None) -> None:
        """Start a lesson, from its beginning: its scene replaces the present one, without contact first."""
        number = whole_number("lesson", number, 0, len(self._lessons) - 1, InvalidEdit)
        window, lesson = self._window, self._lessons[number]
        settings = lesson.settings
        self._window.actions.state.end_stroke()

        before = self._starts

        def started() -> None:
            self._starts, self._coming = before + 1, False
            if not window.actions.files.is_aside:
                window.session.mark_saved()  # a lesson without edits needs no recovery
            self._number, self._asked, self._asking = number, None, False
            self._results, self._pending, self._guess = None, None, guess
            self._puzzle = puzzle
            if guess is None:
                self.begun = window.session.changes
            self._first = window.document.decals.next_number - len(lesson.scene.decals)
            self._step = self._target = 0
            self._recording = self._recorded(0) if settings.steps else None
            window.subplot.scene = window.document  # its bounds, before the camera's planes follow from them
            self._frame()
            self._put_probe(settings.probe)
            window.redraw(whole=True)

        modes = {name: getattr(settings, name) for name in MODES}
        begin = lesson.apart if guess is None and settings.guess is not None else lesson.scene
        begin = begin if puzzle is None else puzzle.sized(begin)
        scene = begin.replace(drawing=window.document.drawing.overridden(**modes))
        window.actions.state.run(ReplaceScene(scene, f"lesson: {settings.title}"), started)
        if self._starts == before:  # a thread builds surfaces first; the text is shown meanwhile
            self._number, self._guess, self._coming = number, guess, True
            self._results = self._pending = self._recording = None
            self._step = self._target = 0
            self.begun = window.session.changes + 1 if guess is None else self.begun

    def _frame(self) -> None:
        """Show the lesson as its camera does, and all of it in a narrow view."""
        plotter = self._window.plotter
        show_camera(plotter, self.lesson.scene)
        width, height = plotter.window_size
        self._window.subplot.vtk_renderer.camera.zoom(min(width / height, 1.0))
        self._framed = plotter.window_size, plotter.camera_position, plotter.camera.view_angle

    def _follow_size(self) -> None:
        """Frame the lesson again in a window of another size, unless its view was turned."""
        plotter = self._window.plotter
        size, *view = self._framed
        if plotter.window_size != size and [plotter.camera_position, plotter.camera.view_angle] == view:
            self._frame()
            self._window.redraw(whole=True)

    def _recorded(self, seed: int) -> Recording:
        lesson = self.lesson
        return Recording(lesson.scene.objects, len(lesson.scene.decals), seed, lesson.settings.steps)

    def set_value(self, number: int, raw: Any, last: bool = True) -> None:
        """Set what a slider of the lesson moves; with ``last`` False, more values follow."""
        sliders, state = self.lesson.settings.sliders, self._window.actions.state
        path = sliders[whole_number("slider", number, 0, len(sliders) - 1, InvalidEdit)].path
        if path.startswith("probe."):
            self._put_probe(exchanged(self.probe, [AXES.index(path[-1])], number_of(path, raw, InvalidEdit)))
        elif path in MODES:
            set_drawing(state, path, raw, last=last)
        elif path in ("step", "seed") and self._recording is not None:
            number = round(max(number_of(path, raw, InvalidEdit), 0.0))
            if path == "seed":
                self._recording, self._step = self._recorded(number), -1
            else:
                self._target = min(number, self._recording.iterations)
        else:
            command = binding(path).command(self._window.document, self.numbers, raw)
            state.run_step(command, last=last)

    def move_probe(self, ray: Ray) -> None:
        """Move the probe to the pointer: on the slice, else along the axes of its sliders or the surface."""
        eye, target = self._window.camera.eye_and_target()
        across = np.subtract(eye, target) if self._plane is None else self._plane.normal
        point = on_plane(self.probe, across, ray)
        if point is None:
            return
        sliders = [s for s in enumerate(self.lesson.settings.sliders) if s[1].path.startswith("probe.")]
        for number, slider in sliders if self._plane is None else ():
            along = float(point[AXES.index(slider.path[-1])])
            self.set_value(number, min(max(along, slider.low), slider.high))
        if not sliders or self._plane is not None:
            self._put_probe(self.experiment().points_near(point).positions[0])

    def cut(self, plane: SlicePlane | None) -> None:
        """Take the slice of the view, and put the probe on it; without one, back where it was first."""
        if plane != self._plane:
            self._plane = plane
            self._put_probe(self.probe if plane else self.lesson.settings.probe)

    def _put_probe(self, place: Any) -> None:
        """Put the probe at a place, or at the point of the slice that is nearest to it, and show it."""
        x, y, z = np.array(place if self._plane is None else self._plane.nearest(place)).tolist()
        self.probe = x, y, z
        ball = pv.Sphere(radius=PROBE_SIZE * self.lesson.size, center=self.probe)
        look: Any = {"color": "white", "pickable": False, "reset_camera": False, "render": False}
        self._window.plotter.add_mesh(ball, name="probe", **look)

    def _relax(self, recording: Recording) -> None:
        """Show the step that was asked for, or the last one that a thread knows in time."""
        if self._steps is None or self._steps[0] is not recording:
            steps = self._stepper.submit(recording.advance, self._target, STEPPING_SECONDS)
            self._steps = recording, steps
        if not self._steps[1].done():
            return
        (_, steps), self._steps = self._steps, None
        self._step = min(steps.result(), self._target)
        numbers, decals = self.numbers, self._window.document.decals
        moved = move_decals(decals.take(np.array(numbers)), recording.points(self._step))
        arrays = {name: getattr(moved, name) for name in ("positions", "normals", "tangents")}
        self._window.actions.state.begin_series(("lab", "step"), "relax")
        self._window.session.do(SetValues(numbers, arrays, "relax"))
        if self._step == self._target:
            self._window.actions.state.end_stroke()
        self._window.redraw(whole=self._step == self._target)

    def script(self) -> str:
        """Return lines of Python that make the present picture."""
        return script(self.lesson, self.experiment(), self._recording)

    def leave(self) -> None:
        """Leave the lesson: its scene stays, its probe goes."""
        self._window.actions.state.end_stroke()
        self._window.plotter.remove_actor("probe", render=False)

    def check(self) -> None:
        """Check the answer: the verdict appears once it is computed, until the scene changes."""
        self._asking = True


def measured(
    lesson: Lesson, experiment: Experiment, key: object = None, guess: float | None = None
) -> Results:
    """Return values, plots and the verdict of a lesson for one state of its scene.

    With a slice, plots and readings of the probe are taken on it.
    """
    scope, at = Scope.at_probe(replace(experiment, plane=None)), Scope.at_probe(experiment)
    plots = [
        {
            "title": plot.title,
            "note": marked(escape(plot.note)),
            "formula": marked(escape(lesson.formula_of(plot, at))),
            "svg": drawn(plot, lesson, at),
        }
        for plot in lesson.settings.plots
    ]
    values = [
        {"label": marked(escape(v.label)), "text": shown(lesson.formulas[v.formula].evaluate(scope))}
        for v in lesson.settings.values
    ]
    rows = [(name, [shown(number) for number in numbers]) for name, numbers in readings(at)]
    checks, asked = lesson.settings.question.checks, lesson.settings.guess
    done = [{"text": c.task, "done": lesson.holds(c.holds, scope)} for c in checks if c.task]
    compared: dict[str, Any] = {}
    if asked is not None and guess is not None:
        truth = float(np.ravel(lesson.formulas[asked.truth].evaluate(scope))[0])
        compared = {"ends": [guess, truth if np.isfinite(truth) else None]}
        compared |= {"texts": [shown(guess), shown(truth)], "why": lesson.filled(asked.why, scope)}
        compared["cells"] = sketches.truth(lesson, experiment, asked.outline) if asked.sketch else []
    numbers = (lesson.formulas[score.formula].evaluate(scope) for score in lesson.settings.scores)
    scores = tuple(float(np.ravel(number)[0]) for number in numbers)
    return Results(key, lesson.verdict(scope), values, plots, done, compared, scores, table(rows))
