"""Quality of a window's frames: whole at rest, coarse while something moves, refined afterwards."""

import time
from collections.abc import Callable, Hashable
from enum import Enum, auto

from decals.vtk.subplot import SubplotRenderer
from decals.window.frame_budget import FrameBudget, FrameTimer
from decals.window.scheduling import SLICE_SECONDS

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
        Returns a value that changes with the picture's content.

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
        self._timer = FrameTimer(subplot, self.budget)
        self.state = FrameState.WHOLE
        self._changed_at = 0.0
        self._drawn_version = version()
        subplot.wait_for_gpu, subplot.samples = True, samples

    def release(self) -> None:
        """Stop timing frames."""
        self._timer.release()

    @property
    def outdated(self) -> bool:
        """True if the content changed since the last whole frame."""
        return self._drawn_version != self._version()

    def begin(self) -> None:
        """Begin with a coarse frame, and keep it while shaders are compiled."""
        self._subplot.keep_previous_frame = True
        self._subplot.draw_scale = FIRST_SCALE
        self._set_coarse()
        self._changed_at -= REFINE_DELAY

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
        """Draw a whole frame now, unless the shown one is whole."""
        subplot = self._subplot
        if subplot.warming_up or (subplot.draw_scale, subplot.samples) != (1.0, self.samples):
            self.draw_whole()

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
