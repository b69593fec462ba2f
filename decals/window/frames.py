"""Frames of a window: whole at rest, coarse while something moves, refined afterwards in slices of time.

The frame budget estimates, from the times of earlier frames, the size at which frames can be drawn in time.
"""

import time
from collections.abc import Callable, Hashable
from enum import Enum, auto

from decals.errors import InvalidScene
from decals.validation import any_number
from decals.vtk.adapters import weak_callback
from decals.vtk.subplot import SubplotRenderer

SLICE_SECONDS = 0.02
"""Time for which the window computes or draws before it handles input again."""

STATUS_INTERVAL = 0.1
"""Seconds between two updates of a progress text."""

TARGET_SECONDS = 0.08
"""Duration of a frame while something moves, at most."""

SCALES = (1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125)
"""Sizes of coarse frames relative to the window; few, because each new size allocates new targets."""

GROWTH_MARGIN = 0.7
"""A larger size is chosen only if it is expected to need less than this part of the target."""

INITIAL_PIXEL_PART = 0.8
"""Part of a frame's time that grows with its pixels, assumed until frames of two sizes were timed."""

MAX_VALUE = 1e6
"""Largest accepted number of seconds, and largest size relative to the window."""


class FrameBudget:
    """Chooses the size of frames while something moves.

    A frame takes a constant time and a time per pixel. Both are estimated from the last whole frames of two
    sizes. Partly drawn frames tell the time besides the drawn part.

    Parameters
    ----------
    target
        Duration of a frame in seconds, at most.

    Examples
    --------
    >>> from decals.window import FrameBudget
    >>> budget = FrameBudget(target=0.1)
    >>> budget.record(1.0, 0.3)
    >>> budget.scale
    0.375
    """

    def __init__(self, target: float = TARGET_SECONDS) -> None:
        self.target = _positive("target", target)
        self._seconds: dict[float, float] = {}
        self._overheads: dict[float, tuple[float, ...]] = {}
        self._scale: float | None = None

    def record(self, scale: float, seconds: float, part: float = 1.0) -> None:
        """Record the duration of a frame.

        Parameters
        ----------
        scale
            Size of the frame relative to the window, along each axis.
        seconds
            Duration.
        part
            Part of the frame that was drawn, from 0 to 1.
        """
        scale, seconds = _positive("scale", scale), any_number("seconds", seconds, InvalidScene)
        if seconds < 0.0:
            raise InvalidScene(f"seconds: expected 0 or more, got {seconds}")
        part = _part(part)
        if part < 1.0:
            overhead = max(seconds - part * self._pixel_seconds(scale), 0.0)
            self._overheads[scale] = (*self._overheads.get(scale, ())[-1:], overhead)
            return
        if scale >= 1.0:
            self._overheads.clear()  # so that a size which was slow once is tried again
        self._seconds.pop(scale, None)
        self._seconds[scale] = seconds
        self._scale = self._choose()

    @property
    def known(self) -> bool:
        """True once a whole frame was recorded."""
        return bool(self._seconds)

    @property
    def scale(self) -> float:
        """Size of the next coarse frame relative to the window."""
        return 1.0 if self._scale is None else self._scale

    def in_time(self, scale: float, part: float) -> bool:
        """Return True if a part of a frame is expected in time, or as soon as the last coarse frame."""
        limit = max(self.target, self._seconds.get(self.scale, 0.0))
        return part < 1.0 and self.expected(scale, part) <= limit

    def expected(self, scale: float, part: float = 1.0) -> float:
        """Return the expected duration of a frame, or of a part of it, in seconds.

        The time per pixel is at most that of the last frame.
        """
        scale, part = _positive("scale", scale), _part(part)
        if not self._seconds:
            return 0.0
        if part < 1.0:
            # The lower of two, because one frame may be late; 0 for a size that was not tried.
            overhead = min(self._overheads.get(scale, (0.0,)))
            return overhead + part * self._pixel_seconds(scale)
        constant, per_window = self._model()
        last, seconds = next(reversed(self._seconds.items()))
        return min(constant + per_window * scale**2, seconds * max(scale / last, 1.0) ** 2)

    def _pixel_seconds(self, scale: float) -> float:
        """Return the expected time for all pixels of a frame."""
        return self._model()[1] * scale**2 if self._seconds else 0.0

    def _model(self) -> tuple[float, float]:
        """Return the constant time of a frame, and the time for the pixels of one of the window's size."""
        latest = list(self._seconds.items())[-2:]
        if len(latest) < 2:
            ((scale, seconds),) = latest
            return (1.0 - INITIAL_PIXEL_PART) * seconds, INITIAL_PIXEL_PART * seconds / scale**2
        (large, slow), (small, fast) = sorted(latest, reverse=True)
        per_window = max((slow - fast) / (large**2 - small**2), 0.0)
        return max(fast - per_window * small**2, 0.0), per_window

    def _choose(self) -> float:
        """Return the largest size within the target; a size above the present one needs a margin."""
        present = 0.0 if self._scale is None else self._scale
        for scale in SCALES:
            limit = self.target * (GROWTH_MARGIN if scale > present and present else 1.0)
            if self.expected(scale) <= limit:
                return scale
        return SCALES[-1]


def _positive(name: str, value: float) -> float:
    """Return a number in (0, MAX_VALUE], or raise `InvalidScene`."""
    number = any_number(name, value, InvalidScene)
    if not 0.0 < number <= MAX_VALUE:
        raise InvalidScene(f"{name}: expected a number above 0 and at most {MAX_VALUE:g}, got {number}")
    return number


def _part(part: float) -> float:
    """Return a number in [0, 1], or raise `InvalidScene`."""
    number = any_number("part", part, InvalidScene)
    if not 0.0 <= number <= 1.0:
        raise InvalidScene(f"part: expected a number from 0 to 1, got {number}")
    return number


FIRST_SCALE = 0.25
"""Size of the first frame relative to the window, before any frame was timed."""

REFINE_DELAY = 0.2
"""Seconds without movement after which a coarse frame is refined."""


class FrameState(Enum):
    """Quality of the frame that the window shows, or is about to draw."""

    WHOLE = auto()
    """The window's size, with all samples."""
    COARSE = auto()
    """Smaller, or with fewer samples. The frame is refined once nothing moves."""


class FrameController:
    """Chooses size and samples of the frames of a subplot.

    Parameters
    ----------
    subplot
        The subplot.
    samples
        Samples per pixel along each axis of a whole frame.
    render
        Draws a frame of the plotter.
    version
        Returns a value that changes with the picture's content and its camera.

    Attributes
    ----------
    samples : int
        Samples per pixel along each axis of a whole frame.
    state : FrameState
        Quality of the shown frame.
    budget : FrameBudget
        Expected durations of frames.
    """

    def __init__(
        self,
        subplot: SubplotRenderer,
        samples: int,
        render: Callable[[], None],
        version: Callable[[], Hashable],
    ) -> None:
        self._subplot, self.samples, self._render, self._version = subplot, samples, render, version
        self.budget = FrameBudget()
        self._frame_began_at = 0.0
        self._tags = [
            subplot.vtk_renderer.AddObserver("StartEvent", weak_callback(self._begin_timing)),
            subplot.vtk_renderer.AddObserver("EndEvent", weak_callback(self._end_timing)),
        ]
        self.state = FrameState.WHOLE
        self._changed_at = 0.0
        self._drawn_version = version()
        subplot.wait_for_gpu, subplot.samples = True, samples

    def release(self) -> None:
        """Stop timing frames."""
        for tag in self._tags:
            self._subplot.vtk_renderer.RemoveObserver(tag)

    def _begin_timing(self) -> None:
        self._frame_began_at = time.perf_counter()

    def _end_timing(self) -> None:
        part = self._subplot.drawn_fraction
        if part:
            size = self._subplot.draw_scale * self._subplot.samples
            self.budget.record(size, time.perf_counter() - self._frame_began_at, part)

    @property
    def outdated(self) -> bool:
        """True if the content or the camera changed since the last whole frame."""
        return self._drawn_version != self._version()

    def begin(self) -> None:
        """Begin with a coarse frame."""
        self._subplot.draw_scale = FIRST_SCALE
        self._set_coarse()
        self._changed_at -= REFINE_DELAY

    def prepare_aside(self, aside: bool) -> None:
        """Choose if a frame stays while the next one's shaders and walks are made, else these come first."""
        self._subplot.keep_previous_frame = self._subplot.walks_in_thread = aside

    def choose_for_edit(self) -> None:
        """Choose the best quality at which the changed part of the frame can be drawn in time."""
        for samples in dict.fromkeys((self.samples, 1)):
            if self.budget.in_time(samples, self._subplot.work_fraction(samples)):
                self._subplot.draw_scale, self._subplot.samples = 1.0, samples
                if samples == self.samples:
                    self._set_whole()
                else:
                    self._set_coarse()
                return
        self.choose_for_motion()

    def choose_for_motion(self) -> None:
        """Choose the quality at which entire frames can be drawn in time."""
        self._set_coarse()
        if self.budget.expected(self.samples) > self.budget.target:
            self._subplot.draw_scale, self._subplot.samples = self.budget.scale, 1

    def draw_whole(self) -> None:
        """Draw a whole frame now, however long it takes."""
        subplot = self._subplot
        subplot.draw_scale, subplot.samples = 1.0, self.samples
        self._set_whole()
        keep, subplot.keep_previous_frame = subplot.keep_previous_frame, False
        self._render()
        subplot.keep_previous_frame = keep

    def require_whole(self) -> None:
        """Draw a whole frame now, with all walks, unless the shown frame is whole."""
        subplot = self._subplot
        whole = (subplot.draw_scale, subplot.samples) == (1.0, self.samples)
        if not whole or subplot.warming_up or subplot.walking:
            aside, subplot.walks_in_thread = subplot.walks_in_thread, False
            self.draw_whole()
            subplot.walks_in_thread = aside

    def refine_when_due(self) -> None:
        """Improve a coarse frame for one slice, once nothing has moved for `REFINE_DELAY`."""
        if self.state is FrameState.COARSE and time.perf_counter() - self._changed_at > REFINE_DELAY:
            self._refine()

    def _refine(self) -> None:
        """Draw the next better frame: first at the window's size, then with all samples."""
        samples = 1 if self._subplot.draw_scale < 1.0 else self.samples
        if not self.budget.known or self.budget.expected(samples) > SLICE_SECONDS:
            seconds = self._subplot.prepare(samples, SLICE_SECONDS)
            if seconds is None:
                return
            if seconds:
                self.budget.record(samples, seconds)
        if samples == self.samples:
            self.draw_whole()
        else:
            self._subplot.draw_scale, self._subplot.samples = 1.0, samples
            self._render()

    def give_up(self) -> None:
        """Stop refining: better frames would fail in the same way."""
        self.state = FrameState.WHOLE

    def _set_whole(self) -> None:
        self.state, self._drawn_version = FrameState.WHOLE, self._version()

    def _set_coarse(self) -> None:
        self.state, self._changed_at = FrameState.COARSE, time.perf_counter()


class RateLimit:
    """Limits how often something is done.

    Parameters
    ----------
    interval
        Shortest time between two times, in seconds.
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._last = 0.0

    def take(self) -> bool:
        """Return True, and start the next interval, if the last interval is over."""
        now = time.perf_counter()
        over = now - self._last > self._interval
        if over:
            self._last = now
        return over


class Warmup:
    """Compiles and uploads, in slices, what a subplot needs for its next frame.

    Parameters
    ----------
    subplot
        The subplot.
    show
        Draws the frame, with the status.
    give_up
        Called before an error is raised because the frame cannot be drawn.

    Attributes
    ----------
    status
        What is being prepared, in plain words; empty for nothing.
    """

    def __init__(
        self, subplot: SubplotRenderer, show: Callable[[], None], give_up: Callable[[], None]
    ) -> None:
        self._subplot, self._show, self._give_up = subplot, show, give_up
        self._limit = RateLimit(STATUS_INTERVAL)
        self.status = ""

    def advance(self) -> bool:
        """Warm up for one slice and return True, or return False if the last frame needs no warm-up."""
        if not self._subplot.warming_up:
            return False
        self.status = ""
        try:
            status = self._subplot.warm(SLICE_SECONDS)
        except BaseException:
            self._give_up()
            raise
        self.status = "" if status is None else f"preparing: {status}"
        if self._limit.take() or status is None:
            self._show()
        return True
