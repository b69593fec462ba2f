"""Plots of lessons as SVG: curves over a line or a range, and maps of colours with contact lines."""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from PIL import Image

from blobtree._typing import BoolArray, Float64Array
from decals.apps.lab.experiment import MAP_PIXELS, Points, Scope
from decals.apps.lab.lesson import Lesson, Plot
from decals.apps.lab.measures import owner
from decals.apps.lab.symbols import SYMBOL, acting, marked
from decals.apps.sandbox.outline import png_url

WIDTH, HEIGHT, MAP_HEIGHT = 330, 150, 205
LEFT, RIGHT, TOP, BOTTOM = 38, 8, 8, 22
"""Size and margins of a plot, without its legend; a map is square."""

LEGEND_ROW, LEGEND_COLUMN = 15, 145
"""Height and width of an entry of a legend."""

SAMPLES = 401
"""Samples of a curve."""

COLORS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Colours that differ for people with colour-blindness, too, after Okabe and Ito."""

DASHES = ("", "6 3", "2 2", "8 3 2 3", "1 3", "10 4")
SCALE = np.array(
    [[253, 231, 37], [122, 209, 81], [34, 168, 132], [42, 120, 142], [65, 68, 135], [68, 1, 84]], np.float64
)[::-1]
"""Colours of a map from its lowest to its highest value: viridis, whose lightness rises evenly."""

RED, LINE = (213, 0, 0), (255, 255, 255)


def drawn(plot: Plot, lesson: Lesson, scope: Scope) -> str:
    """Return a plot as the text of an SVG element."""
    with np.errstate(all="ignore"):
        return _map(plot, lesson, scope) if plot.map else _curves(plot, lesson, scope)


class Axes:
    """A picture with axes; positions in it follow from values."""

    def __init__(self, x: Sequence[float], y: Sequence[float], height: float, *, rows: int = 0) -> None:
        self.low, self.high, self.top = (x[0], y[0]), (x[1], y[1]), TOP + rows * LEGEND_ROW
        self.height = height + rows * LEGEND_ROW
        inner = height - TOP - BOTTOM
        self.size = (WIDTH - LEFT - RIGHT if rows else inner), inner
        self.parts: list[str] = []

    def at(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Return the position of values."""
        right = (np.asarray(x) - self.low[0]) / (self.high[0] - self.low[0])
        up = (np.asarray(y) - self.low[1]) / (self.high[1] - self.low[1])
        return LEFT + right * self.size[0], self.top + (1.0 - up) * self.size[1]

    def add(self, tag: str, text: object = "", **attributes: Any) -> None:
        """Add an element."""
        pairs = " ".join(f'{name.replace("_", "-")}="{value}"' for name, value in attributes.items())
        self.parts.append(f"<{tag} {pairs}>{marked(escape(str(text)), svg=True)}</{tag}>")

    def svg(self, title: str) -> str:
        """Return the picture, with its axes."""
        parts, self.parts = self.parts, []
        grid: Any = {"stroke": "currentColor", "stroke_opacity": 0.15}
        for value in _ticks(self.low[0], self.high[0]):
            x, _ = self.at(value, 0)
            self.add("line", x1=f"{x:.1f}", x2=f"{x:.1f}", y1=self.top, y2=self.top + self.size[1], **grid)
            self.add("text", f"{value:g}", x=f"{x:.1f}", y=self.top + self.size[1] + 14, text_anchor="middle")
        for value in _ticks(self.low[1], self.high[1]):
            _, y = self.at(0, value)
            self.add("line", x1=LEFT, x2=LEFT + self.size[0], y1=f"{y:.1f}", y2=f"{y:.1f}", **grid)
            self.add("text", f"{value:g}", x=LEFT - 5, y=f"{y + 4:.1f}", text_anchor="end")
        body = "".join(self.parts + parts)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {self.height:.0f}" role="img" '
            f'aria-label="{escape(title)}" width="100%" font-size="11" fill="currentColor">{body}</svg>'
        )

    def cross(self, x: float, y: float) -> None:
        """Add the mark of the probe."""
        if np.isfinite(x) and np.isfinite(y):
            right, down = (f"{value:.1f}" for value in self.at(x, y))
            look: Any = {"fill": "#fff", "stroke": "#000", "stroke_width": 1.5}
            self.add("circle", cx=right, cy=down, r=4, **look)


def _ticks(low: float, high: float) -> list[float]:
    """Return three to six round numbers from low to high."""
    span = high - low
    power = 10.0 ** np.floor(np.log10(span))
    step = next(s for s in (0.2 * power, 0.5 * power, power, 2 * power) if span / s < 6)
    first, last = np.ceil(low / step), np.floor(high / step + 1e-9)
    return [float(value * step) for value in np.arange(first, last + 1) + 0.0]  # 0 in place of -0


def _mark(plot: Plot, lesson: Lesson, scope: Scope, axes: Axes) -> None:
    """Add the marks of a plot: its own formulas at the probe."""
    for pair in plot.marks:
        axes.cross(*(float(np.ravel(lesson.formulas[text].evaluate(scope))[0]) for text in pair))


# -- curves ---------------------------------------------------------------------------------------------


def _curves(plot: Plot, lesson: Lesson, scope: Scope) -> str:
    experiment = scope.experiment
    if plot.x is None:
        points = experiment.line_points(SAMPLES)
        x = points.variables["x"]
        ends: Any = (x[0], x[-1])
    else:
        x, ends = np.linspace(*plot.x, SAMPLES), plot.x
        points = Points.in_space(np.zeros((SAMPLES, 3)), x=x)
    at = scope.at(points)
    rows = [
        np.broadcast_to(np.asarray(lesson.formulas[c.formula].evaluate(at), np.float64), x.shape)
        for c in plot.curves
    ]
    axes = Axes(ends, plot.values or padded(np.concatenate(rows), 0.05), HEIGHT, rows=(len(rows) + 1) // 2)
    for number, (curve, row) in enumerate(zip(plot.curves, rows, strict=True)):
        look = {"stroke": COLORS[number % 6], "stroke_dasharray": DASHES[number % 6]}
        path, symbol = _path(axes, x, row), SYMBOL.match(curve.label)
        of = {"data_symbol": symbol[0]} if symbol else {}
        axes.add("path", d=path, fill="none", stroke_width=2, **look, **of)
        left, down = LEFT + number % 2 * LEGEND_COLUMN, TOP + 6 + number // 2 * LEGEND_ROW
        axes.add("line", x1=left, x2=left + 22, y1=down - 4, y2=down - 4, stroke_width=2, **look)
        axes.add("text", curve.label, x=left + 27, y=down)
    if plot.x is None:
        _shade(axes, x, acting(at))
        here, _ = axes.at(experiment.along_line(scope.points.positions[0]), 0.0)
        look = {"stroke": "currentColor", "stroke_dasharray": "3 3"}
        bottom = axes.top + axes.size[1]
        axes.add("line", x1=f"{here:.1f}", x2=f"{here:.1f}", y1=axes.top, y2=bottom, **look)
    _mark(plot, lesson, scope, axes)
    return axes.svg(plot.title)


def _shade(axes: Axes, x: Float64Array, found: dict[str, BoolArray]) -> None:
    """Add where symbols act along a line; the page shows it while the pointer is at one of them."""
    half = (x[1] - x[0]) / 2
    for name, acts in found.items():
        ends = np.flatnonzero(np.diff(np.concatenate([[False], acts, [False]])))
        for first, last in ends.reshape(-1, 2):
            (left, right), _ = axes.at([max(x[first] - half, x[0]), min(x[last - 1] + half, x[-1])], 0.0)
            across = {"x": f"{left:.1f}", "width": f"{right - left:.1f}"}
            axes.add("rect", data_region=name, y=axes.top, height=axes.size[1], **across)


def padded(values: Float64Array, padding: float = 0.0) -> tuple[float, float]:
    """Return the least and the greatest number, with a margin: a part of their difference."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    margin = padding * (high - low) if high > low else 0.5
    return low - margin, high + margin


def _path(axes: Axes, x: Float64Array, y: Float64Array) -> str:
    """Return the line through points; it is interrupted where a value is no number."""
    right, down = axes.at(x, np.clip(y, axes.low[1], axes.high[1]))
    known, parts, pen = np.isfinite(y), [], "M"
    for i in range(len(x)):
        if known[i]:
            parts.append(f"{pen}{right[i]:.1f} {down[i]:.1f}")
        pen = "L" if known[i] else "M"
    return "".join(parts)


# -- maps -----------------------------------------------------------------------------------------------


def _map(plot: Plot, lesson: Lesson, scope: Scope) -> str:
    experiment, half = scope.experiment, scope.experiment.size / 2
    if plot.x is None or plot.y is None:
        points, ends = experiment.map_points(), ((-half, half), (-half, half))
    else:
        steps = (np.arange(MAP_PIXELS) + 0.5) / MAP_PIXELS
        x, y = np.meshgrid(*(low + steps * (high - low) for low, high in (plot.x, plot.y)))
        y = y[::-1]
        ends = plot.x, plot.y
        points = Points.in_space(np.zeros((x.size, 3)), x=x.ravel(), y=y.ravel())
    at = scope.at(points)

    def pixels(text: str) -> Float64Array:
        values = np.asarray(lesson.formulas[text].evaluate(at), np.float64)
        values = np.where(points.exists, np.broadcast_to(values, points.exists.shape), np.nan)
        return values.reshape(MAP_PIXELS, MAP_PIXELS)

    values = pixels(plot.map)
    low, high = plot.values or padded(values)
    red = pixels(plot.red) > 0 if plot.red else np.zeros_like(values, np.bool_)
    on_surface = plot.x is None and not experiment.in_space
    lines = _borders(owner(at).reshape(values.shape)) if on_surface else _borders(values >= 0.5)
    axes = Axes(*ends, MAP_HEIGHT)
    source = png_url(_colored(values, low, high, red, lines), compress_level=1)
    width, height = axes.size
    axes.add("image", x=LEFT, y=TOP, width=width, height=height, href=source, preserveAspectRatio="none")
    for name, acts in acting(at).items() if plot.x is None else ():
        shade = png_url(_colored(np.where(acts, 1.0, np.nan).reshape(values.shape), 0, 1, red & False, None))
        places = {"x": LEFT, "y": TOP, "width": width, "height": height}
        axes.add("image", data_region=name, href=shade, preserveAspectRatio="none", **places)
    bar = LEFT + width + 14
    scale = png_url(_colored(np.linspace(1, 0, 64)[:, None], 0, 1, np.zeros((64, 1), np.bool_), None))
    axes.add("image", x=bar, y=TOP, width=12, height=height, href=scale, preserveAspectRatio="none")
    axes.add("text", f"{high:.3g}", x=bar + 16, y=TOP + 10)
    axes.add("text", f"{low:.3g}", x=bar + 16, y=TOP + height)
    if plot.red:
        axes.add("rect", x=bar + 30, y=TOP, width=12, height=12, fill="#d50000")
        axes.add("text", plot.red_label, x=bar + 46, y=TOP + 10)
    if plot.x is None:
        axes.cross(*experiment.on_map(scope.points.positions[0]))
    _mark(plot, lesson, scope, axes)
    return axes.svg(plot.title)


def _borders(regions: Any) -> BoolArray:
    """Return True for pixels whose right or lower neighbour is in another region."""
    borders = np.zeros(regions.shape, np.bool_)
    borders[:, :-1] |= regions[:, :-1] != regions[:, 1:]
    borders[:-1] |= regions[:-1] != regions[1:]
    return borders


def viridis(parts: Any) -> Float64Array:
    """Return colours of parts from 0 to 1 of the way from the lowest value to the highest."""
    place = np.nan_to_num(parts).clip(0.0, 1.0) * (len(SCALE) - 1)
    return np.stack(
        [np.interp(place, np.arange(len(SCALE)), SCALE[:, channel]) for channel in range(3)], axis=-1
    )


def _colored(
    values: Float64Array, low: float, high: float, red: BoolArray, lines: BoolArray | None
) -> Image.Image:
    """Return colours of values; NaN and infinities are transparent."""
    alpha = np.where(np.isfinite(values), 255.0, 0.0)[..., None]
    image = np.concatenate([viridis((values - low) / (high - low)), alpha], axis=-1).astype(np.uint8)
    if lines is not None:
        image[lines & np.isfinite(values)] = (*LINE, 255)
    image[red] = (*RED, 255)
    return Image.fromarray(image, "RGBA")
