"""How large to draw while things move, chosen from how long frames took."""

from decals.checks import finite
from decals.errors import InvalidScene

TARGET = 0.08
"""Seconds that a frame may take while things move."""

SCALES = (1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125)
"""Sizes to draw at, relative to the window's; few, because a new size wants new targets."""

ROOM = 0.7
"""A larger size is taken where it is expected to need less than this part of the time."""

PIXELS_PART = 0.8
"""Part of a frame's time that is taken to grow with the number of its pixels, until two sizes were seen."""

LARGEST = 1e6
"""Seconds that are waited for, and times the window's size."""


class Quality:
    """Chooses the size of frames while things move; at rest frames are whole.

    A frame takes some time whatever its size, and some for each pixel. Both are estimated from the last
    whole frames of two sizes. Frames of which a part alone is drawn tell how long the rest of a frame takes.

    Parameters
    ----------
    target
        Seconds that a frame may take.
    """

    def __init__(self, target: float = TARGET) -> None:
        self.target = _positive("target", target)
        self._seconds: dict[float, float] = {}
        self._besides: dict[float, tuple[float, ...]] = {}
        self._scale: float | None = None

    def saw(self, scale: float, seconds: float, share: float = 1.0) -> None:
        """Take note of a frame so many times the window's size along each axis, or of a share of one."""
        scale, seconds = _positive("scale", scale), finite("seconds", seconds, InvalidScene)
        if seconds < 0.0:
            raise InvalidScene(f"seconds: expected 0 or more, got {seconds}")
        share = _share(share)
        if share < 1.0:
            rest = max(seconds - share * self._pixels(scale), 0.0)
            self._besides[scale] = (*self._besides.get(scale, ())[-1:], rest)
            return
        if scale >= 1.0:
            self._besides.clear()  # what was slow once is tried again
        self._seconds.pop(scale, None)
        self._seconds[scale] = seconds
        self._scale = self._choose()

    @property
    def known(self) -> bool:
        """Whether there was any frame to judge by."""
        return bool(self._seconds)

    @property
    def scale(self) -> float:
        """Size for the next frame of something that moves."""
        return 1.0 if self._scale is None else self._scale

    def in_time(self, scale: float, share: float) -> bool:
        """Whether a share of a frame should be done in time, or no later than the last small one was."""
        limit = max(self.target, self._seconds.get(self.scale, 0.0))
        return share < 1.0 and self.expected(scale, share) <= limit

    def expected(self, scale: float, share: float = 1.0) -> float:
        """Seconds that a frame of some size, or a share of its work, should take.

        They are at most the last frame's for each of its pixels.
        """
        scale, share = _positive("scale", scale), _share(share)
        if not self._seconds:
            return 0.0
        if share < 1.0:
            besides = min(self._besides.get(scale, (0.0,)))  # one frame may be late; none was tried: no time
            return besides + share * self._pixels(scale)
        fixed, each = self._model()
        last, seconds = next(reversed(self._seconds.items()))
        return min(fixed + each * scale**2, seconds * max(scale / last, 1.0) ** 2)

    def _pixels(self, scale: float) -> float:
        """Seconds for all pixels of a frame of some size."""
        return self._model()[1] * scale**2 if self._seconds else 0.0

    def _model(self) -> tuple[float, float]:
        """Seconds for any frame, and for one of the window's size besides."""
        latest = list(self._seconds.items())[-2:]
        if len(latest) < 2:
            ((scale, seconds),) = latest
            return (1.0 - PIXELS_PART) * seconds, PIXELS_PART * seconds / scale**2
        (a, slow), (b, fast) = sorted(latest, reverse=True)
        each = max((slow - fast) / (a**2 - b**2), 0.0)
        return max(fast - each * b**2, 0.0), each

    def _choose(self) -> float:
        """The largest size that should be done in time; larger than now only with room to spare."""
        now = 0.0 if self._scale is None else self._scale
        for scale in SCALES:
            limit = self.target * (ROOM if scale > now and now else 1.0)
            if self.expected(scale) <= limit:
                return scale
        return SCALES[-1]


def _positive(name: str, value: float) -> float:
    """Give a number that must be above 0, and no larger than a window's size may be."""
    number = finite(name, value, InvalidScene)
    if not 0.0 < number <= LARGEST:
        raise InvalidScene(f"{name}: expected a number above 0 and at most {LARGEST:g}, got {number}")
    return number


def _share(share: float) -> float:
    """Give a part of the whole."""
    number = finite("share", share, InvalidScene)
    if not 0.0 <= number <= 1.0:
        raise InvalidScene(f"share: expected a number from 0 to 1, got {number}")
    return number
