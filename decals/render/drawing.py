"""Pictures in the making, for whoever must not wait for a whole one."""

import time
from collections.abc import Callable, Iterator, Sequence

from decals.render.parts import Part, Step
from decals.render.shown import Shown
from decals.render.steps import Plan
from decals.render.targets import Targets

UNITS = 1024
"""Parts of a step begin and end at multiples of 1 / UNITS."""
LEAST, FIRST, MOST = 4, 8, 16
"""Units that are drawn at once: at least, in the beginning, and at most, because rows that show
much may follow rows that show nothing."""
SHARE = 0.25
"""Of the time that is given, so much should go by between two looks at the clock."""

PICTURE = "picture"
"""What is being made once all that it needs is there."""


class Drawing:
    """A picture in the making: the same as `Renderer.draw` gives at once, bit for bit.

    Of what the targets hold when it begins, whatever is the same stays. Where somebody else draws into them
    before it is done, it begins anew.

    Parameters
    ----------
    targets
        Ends with what is drawn into; before that come Nones, or texts that say how far it is, while that and
        all else that the picture needs is being made.
    plan
        Gives what is to be drawn into targets that hold something, always the same; asked whenever somebody
        goes on.
    finish
        Waits until the card has done what it was told.
    left
        Gives the part of the work of a whole picture, 0 to 1, that there would be now.
    clock
        Seconds.

    Attributes
    ----------
    done
        Whether the picture is in the targets.
    seconds
        What drawing it has taken until now.
    share
        Part of the work of a whole picture, 0 to 1, that there was when it was begun.
    """

    def __init__(
        self,
        targets: Iterator[Targets | str | None],
        plan: Callable[[Targets, Shown | None], Plan],
        finish: Callable[[], None],
        *,
        left: Callable[[], float] = lambda: 1.0,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._making = targets
        self._targets: Targets | None = None
        self.done, self.seconds, self.share, self.news = False, 0.0, 1.0, ""
        self.left = left
        self._plan, self._finish, self._clock = plan, finish, clock
        self._held: Shown | None = None
        self._number, self._at, self._step = 0, 0, FIRST

    @property
    def targets(self) -> Targets:
        """What is drawn into; the picture is there once `done`."""
        while self._targets is None:
            self._make()
        return self._targets

    def advance(self, seconds: float) -> bool:
        """Draw for about so long, one part at least; say whether the picture is done.

        The context must be current, and what is shown as it was when the drawing began.
        """
        begin = before = self._clock()
        plan: Plan | None = None
        while not self.done and before - begin <= (1.0 - SHARE) * seconds:
            if self._targets is None:
                self._make()
                self._finish()
                before = self._clock()
                continue
            plan = plan or self._begin(self._targets)
            self._draw(plan.steps)
            self._end(plan)
            now = self._clock()
            self._pace(now - before, SHARE * seconds)
            before = now
        self.seconds += before - begin
        return self.done

    def complete(self) -> None:
        """Draw all that is missing at once."""
        plan = self._begin(self.targets)
        for step in plan.steps[self._number :]:
            step(Part(self._at / UNITS))
            self._number, self._at = self._number + 1, 0
        self._end(plan)

    def _make(self) -> None:
        """Make the next piece of what the picture needs."""
        made = next(self._making)
        if made is None or isinstance(made, str):
            self.news = made or self.news
        else:
            self._targets, self.news = made, PICTURE

    def _begin(self, targets: Targets) -> Plan:
        """Begin, anew if somebody else has drawn into the targets since, or go on."""
        anew = targets.drawing is not self
        if anew:
            self._held, targets.drawing, targets.shown = targets.shown, self, None
            self._number, self._at, self._step = 0, 0, FIRST
        plan = self._plan(targets, self._held)
        self.share = plan.share if anew else self.share
        return plan

    def _draw(self, steps: Sequence[Step]) -> None:
        """Draw the next part, if there is any."""
        if self._number == len(steps):
            return
        end = min(self._at + self._step, UNITS)
        steps[self._number](Part(self._at / UNITS, end / UNITS))
        self._finish()
        self._at = end
        if end == UNITS:
            self._number, self._at = self._number + 1, 0

    def _end(self, plan: Plan) -> None:
        """Note what the targets show, if all of it is there."""
        self.done = self._number == len(plan.steps)
        if self.done:
            self.targets.shown = plan.shown

    def _pace(self, took: float, wished: float) -> None:
        """Choose the size of the next part: steps differ, so each begins small."""
        fitting = self._step * wished / max(took, 1e-9)
        self._step = FIRST if self._at == 0 else int(min(max(fitting, LEAST), MOST))
