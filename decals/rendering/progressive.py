"""Frames that are drawn in slices of time, so that a caller never waits for a whole one."""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from blobtree.progress import check_cancelled
from decals.rendering.dirty_regions import TargetState
from decals.rendering.frame_plan import FramePlan
from decals.rendering.targets import Targets
from decals.rendering.viewpoint import Part, Step

UNITS = 1024
"""Parts of a step begin and end at multiples of 1 / UNITS."""

MIN_UNITS, FIRST_UNITS, MAX_UNITS = 4, 8, 16
"""Units of one part: at least, of a step's first part, and at most, for rows with much work may follow
empty rows."""

PART_OF_SLICE = 0.25
"""Part of a time slice after which the clock is read again."""

DRAWING = "picture"
"""Status of a frame whose warm-up is done."""


def run(work: Callable[[], object]) -> bool:
    """Run a function and return True."""
    work()
    return True


class ProgressiveFrame:
    """A frame in progress; the result is the same, bit for bit, as of `Renderer.draw`.

    Regions that are up to date in the targets at the beginning are not drawn again. If another frame is drawn
    into the targets before this frame is done, this frame begins anew.

    Parameters
    ----------
    targets
        Iterator that ends with the targets. Before that it yields None or a status text after each task of
        the warm-up.
    plan
        Function of the targets and their state at the beginning, called for every slice of time.
    finish
        Waits until the GPU is idle.
    attempt
        Runs a function; returns False if it is to be repeated later, as programs are being compiled.
    clock
        Returns seconds.

    Attributes
    ----------
    done
        True once the picture is in the targets.
    seconds
        Time that drawing has taken so far.
    work
        Part of a whole frame's work, 0 to 1, at the beginning.
    status
        The last task of the warm-up, such as ``"shaders 3 of 7"``.
    """

    def __init__(
        self,
        targets: Iterator[Targets | str | None],
        plan: Callable[[Targets, TargetState | None], FramePlan],
        finish: Callable[[], None],
        *,
        attempt: Callable[[Callable[[], object]], bool] = run,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._warmup = targets
        self._targets: Targets | None = None
        self.done, self.seconds, self.work, self.status = False, 0.0, 1.0, ""
        self._plan, self._finish, self._attempt, self._clock = plan, finish, attempt, clock
        self._previous: TargetState | None = None
        self._step, self._unit, self._part_units = 0, 0, FIRST_UNITS

    @property
    def targets(self) -> Targets:
        """The targets; they hold the picture once the frame is `done`."""
        while self._targets is None:
            self._run_warmup_task()
        return self._targets

    def advance(self, seconds: float) -> bool:
        """Draw for about so long, at least one part; return True if the frame is done.

        The context must be current, and the scene as it was when the frame began.
        """
        begin = before = self._clock()
        plan: FramePlan | None = None
        while not self.done and before - begin <= (1.0 - PART_OF_SLICE) * seconds:
            if self._targets is None:
                self._run_warmup_task()
                self._finish()
                before = self._clock()
                continue
            plan = plan or self._begin(self._targets)
            self._draw_part(plan.steps)
            self._complete_if_done(plan)
            now = self._clock()
            self._adapt_part(now - before, PART_OF_SLICE * seconds)
            before = now
        self.seconds += before - begin
        return self.done

    def complete(self, *, max_samples: int | None = None) -> None:
        """Draw the rest of the frame at once.

        With `max_samples`, wait for the GPU after parts of about so many samples. OpenGL holds the
        interpreter's lock while it draws, so other threads run between the parts only.
        """
        plan = self._begin(self.targets)
        width, height = self.targets.gbuffer.size
        parts = 1 if max_samples is None else max(1, round(plan.work * width * height / max_samples))
        for step in plan.steps[self._step :]:
            ends = np.linspace(self._unit / UNITS, 1.0, parts + 1)
            for begin, end in pairwise(ends.tolist()):
                check_cancelled("drawing")
                step(Part(begin, end))
                if parts > 1:
                    self._finish()
            self._step, self._unit = self._step + 1, 0
        self._complete_if_done(plan)

    def _run_warmup_task(self) -> None:
        result = next(self._warmup)
        if result is None or isinstance(result, str):
            self.status = result or self.status
        else:
            self._targets, self.status = result, DRAWING

    def _begin(self, targets: Targets) -> FramePlan:
        """Return the plan; begin anew if another frame was drawn into the targets since the last call."""
        anew = targets.frame is not self
        if anew:
            self._previous, targets.frame, targets.state = targets.state, self, None
            self._step, self._unit, self._part_units = 0, 0, FIRST_UNITS
        plan = self._plan(targets, self._previous)
        self.work = plan.work if anew else self.work
        return plan

    def _draw_part(self, steps: Sequence[Step]) -> None:
        """Draw the next part, unless all parts are drawn."""
        if self._step == len(steps):
            return
        end = min(self._unit + self._part_units, UNITS)
        if not self._attempt(partial(steps[self._step], Part(self._unit / UNITS, end / UNITS))):
            return
        self._finish()
        self._unit = end
        if end == UNITS:
            self._step, self._unit = self._step + 1, 0

    def _complete_if_done(self, plan: FramePlan) -> None:
        self.done = self._step == len(plan.steps)
        if self.done:
            self.targets.state = plan.state
            self.targets.frame = self._previous = None

    def _adapt_part(self, seconds: float, target_seconds: float) -> None:
        """Choose the size of the next part; steps differ in speed, so each begins with a small part."""
        fitting = self._part_units * target_seconds / max(seconds, 1e-9)
        self._part_units = FIRST_UNITS if self._unit == 0 else int(min(max(fitting, MIN_UNITS), MAX_UNITS))
