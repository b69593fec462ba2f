"""Outlines: closed shapes in a plane as values, from polygons, arcs, splines, drawings and text.

An outline is SVG path data, whose curves stay curves in files. For fields they become polygons, whose chords
leave the curve by at most `TOLERANCE` of the outline's size and turn by at most `LARGEST_TURN`.

Loops inside others are holes, whatever their directions are. In drawings and fonts directions count: there
only the loops stay that bound what is filled. Loops that cross are united first, see `nodes.unions`.
"""

import cmath
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from re import search
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.declare.parameters import CHECKS, Parameter, Quantity
from blobtree.errors import ImplicitDecalsError, InvalidNode, UnusableFile
from blobtree.identity import content_hash
from blobtree.lazy import Lazy
from blobtree.nodes.crossings import area_of, cross_products, meeting_edges
from blobtree.nodes.drawings import filled_shapes
from blobtree.nodes.unions import united
from blobtree.validation import LARGEST_NUMBER, LIMIT, describe, positive_number

TOLERANCE = 2e-5
"""Distance of chords from their curve, at most, over the larger side of the outline's box."""

LARGEST_TURN = math.radians(8.0)
"""Angle between chords of a curve, at most."""

CORNER = math.radians(12.0)
"""Angle between the chords of two curves from which they meet in a corner."""

STRAIGHT = 1e-6
"""Angle between two straight lines from which they meet in a corner."""

LEAST_BULGE = 1e-9
"""Bulge below which an arc is a line."""

SHORTEST = 1e-9
"""Length over the size up to which a line counts as a point, and a loop as a line."""

ARC_PIECE = math.pi / 8.0
"""Largest angle of an arc that becomes one cubic curve; they differ by 7e-8 of the radius."""

MOST_CORNERS = 50_000
"""Most corners of an outline's polygons."""

OTHER_CHARACTERS = r"[^MmZzLlHhVvCcSsQqTtAa0-9eE.,+\s-]"

Plane = tuple[float, float]
Curve = Float64Array
"""Control points (2 to 4, 2) of a line, a parabola or a cubic curve."""


class Loop(NamedTuple):
    """A polygon of an outline, which lies on the left of its edges.

    Attributes
    ----------
    points
        Its vertices (n, 2).
    corners
        Which of them are corners (n,); at all others the surface is smooth. The first one is, if any is.
    """

    points: Float64Array
    corners: Any


class Outline(msgspec.Struct, frozen=True, dict=True):
    """A shape in a plane: one or more closed loops, of which those inside others are holes.

    Parameters
    ----------
    path : str
        SVG path data, with y upward. Open loops are closed by a straight line.

    Raises
    ------
    InvalidNode
        The text is no path data, no loop has an area, or loops cross or touch each other or themselves.

    Examples
    --------
    >>> from blobtree import Outline
    >>> plate = Outline("M0 0H4V3H0Z") + Outline.polygon([(1, 1), (2, 1), (1, 2)])
    >>> plate.area
    11.5
    """

    path: str

    def __post_init__(self) -> None:
        self.loops  # noqa: B018  (raises for what is no outline)

    @classmethod
    def polygon(cls, points: ArrayLike) -> Self:
        """Return a polygon by its corners (n, 2).

        Examples
        --------
        >>> from blobtree import Outline
        >>> Outline.polygon([(0, 0), (2, 0), (0, 1)]).area
        1.0
        """
        corners = _plane_points(points)
        if len(corners) < 3:
            raise InvalidNode(f"points: expected at least three, got {len(corners)}")
        return cls.arcs(corners, 0.0)

    @classmethod
    def arcs(cls, points: ArrayLike, bulges: ArrayLike) -> Self:
        """Return straight lines and arcs of circles from point to point (n, 2), and back to the first.

        In `bulges`, 0 is a line, 1 half a circle to the right of the way, −1 one to the left: it has the
        tangent of a quarter of each arc's angle. A number holds for all.

        Examples
        --------
        >>> from blobtree import Outline
        >>> circle = Outline.arcs([(0, 0), (2, 0)], 1)
        >>> round(circle.area, 3)
        3.141
        """
        corners = _plane_points(points)
        try:
            tangents = np.broadcast_to(np.asarray(bulges, np.float64), len(corners))
        except (TypeError, ValueError):
            tangents = np.array([math.nan])
        if not np.isfinite(tangents).all():
            raise InvalidNode(
                f"bulges: expected a finite number, or one for each of {len(corners)} points, "
                f"got {describe(bulges)}"
            )
        parts = [f"M{_text(corners[0])}"]
        for start, end, bulge in zip(corners, np.roll(corners, -1, axis=0), tangents.tolist(), strict=True):
            if abs(bulge) < LEAST_BULGE:
                parts.append(f"L{_text(end)}")
                continue
            radius = 0.25 * np.linalg.norm(end - start) * abs(bulge + 1.0 / bulge)
            parts.append(f"A{radius} {radius} 0 {abs(bulge) > 1.0:d} {bulge > 0.0:d} {_text(end)}")
        return cls("".join([*parts, "Z"]))

    @classmethod
    def spline(cls, points: ArrayLike) -> Self:
        """Return the closed cubic spline through points (n, 2), smooth to its second derivative.

        Its parameter is the length of the polygon, so that points may lie unevenly (de Boor 1978).

        Examples
        --------
        >>> from blobtree import Outline
        >>> round(Outline.spline([(1, 0), (0, 1), (-1, 0), (0, -1)]).area, 2)
        3.05
        """
        from scipy.interpolate import CubicSpline

        through = _plane_points(points)
        closed = np.vstack([through, through[:1]])
        lengths = np.linalg.norm(np.diff(closed, axis=0), axis=1)
        if lengths.min() == 0.0:
            raise InvalidNode(
                "points: two neighbours are equal (the first and last are neighbours too); remove one"
            )
        places = np.concatenate([[0.0], np.cumsum(lengths)])
        slopes = CubicSpline(places, closed, bc_type="periodic")(places, 1) * (1.0 / 3.0)
        curves = zip(closed, slopes, closed[1:], slopes[1:], lengths, strict=False)
        return cls._of([[np.array([a, a + h * u, b - h * v, b]) for a, u, b, v, h in curves]])

    @classmethod
    def svg(cls, drawing: str | Path, *, rule: str | None = None) -> Self:
        """Return all filled shapes of an SVG file, or of a string with its contents, with y turned upward.

        Lengths are those of the file, whatever its size on a page is. Transforms count. Strokes, clips,
        texts, style sheets and copies (`use`) are left out. Each shape is filled by its `fill-rule`, and all
        shapes are united. A `rule` fills all of them as one shape instead: `"nonzero"`, or `"evenodd"`, by
        which shapes inside others are holes.

        Examples
        --------
        >>> from blobtree import Outline
        >>> eye = '<svg><circle cx="0" cy="0" r="2"/><path d="M-1 0 0 1 1 0 0 -1Z"/></svg>'
        >>> round(Outline.svg(eye, rule="evenodd").area, 2)
        10.57
        """
        if rule is not None and not (isinstance(rule, str) and rule in ("nonzero", "evenodd")):
            raise InvalidNode(f"rule: expected 'nonzero', 'evenodd' or None, got {describe(rule)}")
        if not isinstance(drawing, str | Path):
            raise InvalidNode(f"drawing: expected a file or the text of one, got {describe(drawing)}")
        shapes = _read(lambda: list(filled_shapes(drawing)), "drawing", drawing)
        filled = [
            (
                [
                    [(curve @ matrix[:, :2].T + matrix[:, 2]) * (1.0, -1.0) for curve in loop]
                    for loop in loops
                ],
                own,
            )
            for path, matrix, own in shapes
            for loops in [_loops_of(path)]
        ]
        if rule:
            filled = [([loop for loops, _ in filled for loop in loops], rule)]
        return cls._of(_filling(filled))

    @classmethod
    def text(cls, text: str, *, size: float = 1.0, font: str | Path | None = None) -> Self:
        """Return a text in a TrueType or OpenType font, by default DejaVu Sans; it starts at the origin.

        `size` is the size of the font in model units: capitals are about 0.7 of it high. Lines are as far
        apart as the font says, and a tab is four spaces. Letters stand side by side, without kerning and
        ligatures; those that overlap or touch are united.

        Examples
        --------
        >>> from blobtree import Outline
        >>> [len(Outline.text(word).loops) for word in ("I", "B")]
        [1, 3]
        """
        if not isinstance(text, str):
            raise InvalidNode(f"text: expected a text, got {describe(text)}")
        scale = positive_number("size", size)
        letters = _loops_of(_read(partial(_letters, text, font or _default_font()), "font", font))
        return cls._of(_filling([([[curve * scale for curve in loop] for loop in letters], "nonzero")]))

    def __add__(self, other: Self) -> Self:
        """Return the loops of both; those inside others are holes."""
        if not isinstance(other, Outline):
            return NotImplemented
        return type(self)(f"{self.path} {other.path}")

    def __or__(self, other: Self) -> Self:
        """Return the union of both, which may overlap or touch.

        Examples
        --------
        >>> from blobtree import Outline
        >>> (Outline("M0 0H2V2H0Z") | Outline("M1 1H3V3H1Z")).area
        7.0
        """
        if not isinstance(other, Outline):
            return NotImplemented
        return self._of(_filling([(self._curves, "evenodd"), (other._curves, "evenodd")]))

    def scale(self, factor: float) -> Self:
        """Return this outline larger by a factor.

        Examples
        --------
        >>> from blobtree import Outline
        >>> Outline("M0 0H1V1H0Z").scale(3).area
        9.0
        """
        number = positive_number("factor", factor)
        return self._of([[curve * number for curve in loop] for loop in self._curves])

    def translate(self, offset: ArrayLike) -> Self:
        """Return this outline moved by an offset (2,).

        Examples
        --------
        >>> from blobtree import Outline
        >>> Outline("M0 0H1V1H0Z").translate((2, 0)).bounds
        ((2.0, 0.0), (3.0, 1.0))
        """
        (way,) = _plane_points((offset,), "offset")
        return self._of([[curve + way for curve in loop] for loop in self._curves])

    @property
    def content_hash(self) -> str:
        """Content hash of the path data."""
        return content_hash(self.path)

    @property
    def area(self) -> float:
        """The area of the shape, without its holes."""
        return float(sum(area_of(loop.points) for loop in self.loops))

    @property
    def bounds(self) -> tuple[Plane, Plane]:
        """The lower and the upper corner of the box around the shape."""
        (x, y), (to_x, to_y) = self.points.min(axis=0).tolist(), self.points.max(axis=0).tolist()
        return (x, y), (to_x, to_y)

    @property
    def points(self) -> Float64Array:
        """The vertices (n, 2) of the polygons of all loops."""
        return np.concatenate([loop.points for loop in self.loops])

    @property
    def _curves(self) -> list[list[Curve]]:
        """The curves of each loop."""
        return _loops_of(self.path)

    @Lazy
    def loops(self) -> tuple[Loop, ...]:
        """Return the polygons of the outline, as fine as `TOLERANCE` says."""
        loops = [polygon for polygon in _polygons(self._curves) if polygon]
        if not loops:
            raise InvalidNode("outline: expected a shape with an area, got none")
        _check_apart([loop.points for loop in loops])
        depths = _inside_others([loop.points for loop in loops])
        return tuple(
            _directed(loop, hole=len(around) % 2 == 1) for loop, around in zip(loops, depths, strict=True)
        )

    @classmethod
    def _of(cls, loops: Iterable[Sequence[Curve]]) -> Self:
        """Return the outline of loops of curves."""
        letters = " LQC"
        return cls(
            "".join(
                f"M{_text(loop[0][0])}"
                + "".join(f"{letters[len(curve) - 1]}{_text(curve[1:])}" for curve in loop)
                + "Z"
                for loop in loops
            )
        )


class _Pen:
    """A pen of fontTools that keeps the curves of all loops."""

    def __init__(self) -> None:
        self.loops: list[list[Curve]] = []
        self._place: Plane = (0.0, 0.0)
        self._left = MOST_CORNERS

    def moveTo(self, point: Plane) -> None:  # noqa: N802  (names of the pen protocol)
        """Begin a loop."""
        self.loops.append([])
        self._place = point

    def curveTo(self, *points: Plane) -> None:  # noqa: N802
        """Add a curve by its further control points."""
        if self._left == 0:
            raise InvalidNode(f"path: expected at most {MOST_CORNERS:,} lines, got more; simplify it")
        self._left -= 1
        self.loops[-1].append(np.array([self._place, *points], np.float64))
        self._place = points[-1]

    lineTo = qCurveTo = curveTo  # noqa: N815

    def closePath(self) -> None:  # noqa: N802
        """End a loop: all are closed."""

    endPath = closePath  # noqa: N815

    def arcTo(  # noqa: N802
        self, x_radius: float, y_radius: float, degrees: float, large: bool, left: bool, end: Plane
    ) -> None:
        """Add an arc of an ellipse as cubic curves (SVG 2, appendix B.2.4)."""
        start, goal = complex(*self._place), complex(*end)
        if start == goal:
            return
        if not (x_radius and y_radius):
            self.lineTo(end)
            return
        turn = cmath.rect(1.0, math.radians(degrees))

        def to_circle(point: complex) -> complex:
            turned = point / turn
            return complex(turned.real / x_radius, turned.imag / y_radius)

        a, b = to_circle(start), to_circle(goal)
        grown = max(1.0, 0.5 * abs(b - a))
        a, b = a / grown, b / grown
        half = 0.5 * (b - a)
        rise = math.sqrt(max(1.0 - abs(half) ** 2, 0.0)) / abs(half)
        center = 0.5 * (a + b) + 1j * half * (rise if large != left else -rise)
        angle = cmath.phase((b - center) / (a - center))
        if left and angle < 0.0:
            angle += 2.0 * math.pi
        elif not left and angle > 0.0:
            angle -= 2.0 * math.pi
        count = max(math.ceil(abs(angle) / ARC_PIECE), 1)
        lever = 4.0 / 3.0 * math.tan(0.25 * angle / count) * 1j

        def on_ellipse(point: complex) -> Plane:
            stretched = grown * (center + point)
            there = complex(x_radius * stretched.real, y_radius * stretched.imag) * turn
            return there.real, there.imag

        spokes = [(a - center) * cmath.rect(1.0, angle * step / count) for step in range(count + 1)]
        for u, v in pairwise(spokes):
            last = end if v is spokes[-1] else on_ellipse(v)
            self.curveTo(on_ellipse(u * (1.0 + lever)), on_ellipse(v * (1.0 - lever)), last)


def _read(read: Callable[[], Any], name: str, file: object = None) -> Any:
    """Return the result of a reader; its errors become errors of ours."""
    try:
        return read()
    except ImplicitDecalsError:
        raise
    except OSError as error:
        raise UnusableFile.of(error, str(file), "read") from None
    except Exception as error:  # damaged files raise errors of all kinds
        reason = " ".join(str(error).split())
        raise InvalidNode(
            f"{name}: expected one without errors, got {type(error).__name__}: {reason}"
        ) from None


def _loops_of(path: str) -> list[list[Curve]]:
    """Return the curves of each loop of path data."""
    from fontTools.svgLib.path import parse_path

    pen = _Pen()
    if not isinstance(path, str) or search(OTHER_CHARACTERS, path):
        raise InvalidNode(f"path: expected SVG path data such as 'M0 0H1V1Z', got {describe(path)}")
    _read(lambda: parse_path(path, pen), "path")
    return pen.loops


def _default_font() -> Path:
    import matplotlib

    return Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")


def _letters(text: str, file: str | Path) -> str:
    """Return the path data of a text in a font of size 1."""
    from fontTools.pens.svgPathPen import SVGPathPen
    from fontTools.pens.transformPen import TransformPen
    from fontTools.ttLib import TTFont

    lines = text.replace("\t", "    ").splitlines()
    with TTFont(file, fontNumber=0) as font:
        letters, names = font.getGlyphSet(), font.getBestCmap() or {}
        if missing := sorted({letter for letter in "".join(lines) if ord(letter) not in names}):
            raise InvalidNode(f"text: the font has no {missing[0]!r}; choose another font")
        pen, unit, leading = SVGPathPen(letters), 1.0 / font["head"].unitsPerEm, font["hhea"]
        drop = unit * (leading.ascent - leading.descent + leading.lineGap)
        for number, line in enumerate(lines):
            x = 0.0
            for letter in (letters[names[ord(character)]] for character in line):
                letter.draw(TransformPen(pen, (unit, 0.0, 0.0, unit, x, -number * drop)))
                x += unit * letter.width
        return str(pen.getCommands())


def _plane_points(points: Any, name: str = "points") -> Float64Array:
    """Return points (n, 2); raise `InvalidNode` for anything else."""
    try:
        array = np.array(points, np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1] != 2 or not len(array) or not np.abs(array).max() <= LARGEST_NUMBER:
        raise InvalidNode(f"{name}: expected points of two finite numbers, got {describe(points)}; {LIMIT}")
    return array


def _text(points: Float64Array) -> str:
    """Return points as path data."""
    return " ".join(map(repr, points.ravel().tolist()))


def _polygons(loops: Sequence[Sequence[Curve]]) -> list[Loop | None]:
    """Return the polygon of each loop, None for one without an area."""
    everything = [curve for loop in loops for curve in loop]
    if not everything:
        return [None] * len(loops)
    points = np.concatenate(everything)
    if not np.abs(points).max() <= LARGEST_NUMBER:
        raise InvalidNode(f"outline: expected finite coordinates, got others; {LIMIT}")
    size = float(np.ptp(points, axis=0).max())
    polygons: list[Loop | None] = []
    left = MOST_CORNERS
    for loop in loops:
        polygons.append(_polygon(loop, size))
        left -= len(polygons[-1].points) if polygons[-1] else 0
        if left < 0:
            raise InvalidNode(f"outline: expected at most {MOST_CORNERS:,} corners, got more; simplify it")
    return polygons


def _polygon(loop: Sequence[Curve], size: float) -> Loop | None:
    """Return the polygon of a loop of an outline of a size, None for one without an area."""
    if not loop or size == 0.0:
        return None
    pieces = [_chords(curve, TOLERANCE * size) for curve in (*loop, np.array([loop[-1][-1], loop[0][0]]))]
    points = np.concatenate(pieces)
    joints = np.concatenate([np.arange(len(piece)) == 0 for piece in pieces])
    curved = np.repeat([*(len(curve) > 2 for curve in loop), False], [len(piece) for piece in pieces])
    long = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1) > SHORTEST * size
    joints |= np.roll(joints & ~long, 1)  # the start of a short edge goes away
    points, joints, curved = points[long], joints[long], curved[long]
    if len(points) < 3 or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] <= SHORTEST * size:
        return None
    ways = np.roll(points, -1, axis=0) - points
    before = np.roll(ways, 1, axis=0)
    turns = np.abs(np.arctan2(cross_products(before, ways), (before * ways).sum(axis=1)))
    return Loop(points, joints & (turns > np.where(curved | np.roll(curved, 1), CORNER, STRAIGHT)))


def _chords(curve: Curve, tolerance: float) -> Float64Array:
    """Return points of a curve from its start on, without its end, whose chords are close to it."""
    degree = len(curve) - 1
    if degree == 1:
        return curve[:1]
    legs = np.diff(curve, axis=0)
    legs = legs[np.abs(legs).max(axis=1) > 0.0]
    if not len(legs):
        return curve[:1]
    turn = np.abs(np.arctan2(cross_products(legs[:-1], legs[1:]), (legs[:-1] * legs[1:]).sum(axis=1))).sum()
    bend = degree * (degree - 1) * np.linalg.norm(np.diff(curve, 2, axis=0), axis=1).max()
    count = max(math.ceil(turn / LARGEST_TURN), math.ceil(math.sqrt(bend / (8.0 * tolerance))), 1)
    t = np.arange(min(count, MOST_CORNERS + 1))[:, None] / count
    levels = np.repeat(curve[None], len(t), axis=0)
    while levels.shape[1] > 1:  # de Casteljau's
        levels = levels[:, :-1] + t[:, :, None] * np.diff(levels, axis=1)
    return levels[:, 0]


def _check_apart(polygons: Sequence[Float64Array]) -> None:
    """Raise `InvalidNode` if polygons cross or touch each other or themselves."""
    if crossing := _meeting(polygons):
        x, y = np.concatenate(polygons)[crossing[0]]
        raise InvalidNode(
            f"outline: expected loops that neither cross nor touch, got edges that meet near ({x:g}, {y:g}); "
            "unite outlines that overlap by a | b"
        )


def _meeting(polygons: Sequence[Float64Array]) -> tuple[int, int] | None:
    """Return two edges of polygons that cross or touch, None if there are none."""
    points = np.concatenate(polygons)
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    return meeting_edges((points - low) / size, [len(polygon) for polygon in polygons])


def _inside_others(polygons: Sequence[Float64Array]) -> Iterator[list[int]]:
    """Yield for each polygon the others around it, if they neither cross nor touch."""
    begin = np.concatenate(polygons)
    end = np.concatenate([np.roll(polygon, -1, axis=0) for polygon in polygons])
    owners = np.repeat(np.arange(len(polygons)), list(map(len, polygons)))
    for inner, polygon in enumerate(polygons):
        x, y = polygon[0]
        level = np.flatnonzero((begin[:, 1] > y) != (end[:, 1] > y))
        (ax, ay), (bx, by) = begin[level].T, end[level].T
        beyond = owners[level[ax + (y - ay) / (by - ay) * (bx - ax) > x]]
        outer = np.flatnonzero(np.bincount(beyond, minlength=1) % 2)
        yield outer[outer != inner].tolist()


def _directed(loop: Loop, *, hole: bool) -> Loop:
    """Return a loop with the shape on its left, which starts at a corner if it has one."""
    step = 1 if (area_of(loop.points) < 0.0) == hole else -1
    points, corners = loop.points[::step], loop.corners[::step]
    first = int(corners.argmax())
    return Loop(np.roll(points, -first, axis=0), np.roll(corners, -first))


def _filling(shapes: Iterable[tuple[Sequence[Sequence[Curve]], str]]) -> list[Sequence[Curve]]:
    """Return the loops around the filled area of shapes, each a list of loops and a fill rule of SVG."""
    owned = [(loop, (number, rule)) for number, (loops, rule) in enumerate(shapes) for loop in loops]
    polygons = _polygons([loop for loop, _ in owned])
    known = [(*own, polygon.points) for own, polygon in zip(owned, polygons, strict=True) if polygon]
    if not known:
        raise InvalidNode("outline: expected a shape with an area, got none")
    points = [points for *_, points in known]
    if _meeting(points):
        return _united([(loop, own) for loop, own, _ in known])
    ways = [1 if area_of(polygon) > 0.0 else -1 for polygon in points]

    def filled(around: Iterable[int]) -> bool:
        """Return True if a shape fills the places that are inside these loops alone."""
        windings: Counter[tuple[int, str]] = Counter()
        for loop in around:
            windings[known[loop][1]] += ways[loop]
        return any(count % 2 if rule == "evenodd" else count for (_, rule), count in windings.items())

    return [
        known[number][0]
        for number, around in enumerate(_inside_others(points))
        if filled(around) != filled([*around, number])
    ]


def _united(owned: Sequence[tuple[Sequence[Curve], tuple[int, str]]]) -> list[Sequence[Curve]]:
    """Return the loops around the filled area of shapes that cross or touch."""
    rules = [rule for _, (_, rule) in owned]
    curves, shapes = list[Curve](), list[int]()
    for number, (loop, (shape, _)) in enumerate(owned):
        closed = [*loop, np.array([loop[-1][-1], loop[0][0]])]
        curves += closed
        shapes += len(closed) * [next(at for at in range(number + 1) if owned[at][1][0] == shape)]
    size = float(np.ptp(np.concatenate(curves), axis=0).max())
    chords = [_chords(curve, TOLERANCE * size) for curve in curves]
    parts, lines = united(curves, chords, shapes, rules)
    polygons = [polygon.points for polygon in _polygons(parts) if polygon]
    return [*(lines if polygons and _meeting(polygons) else parts)]


def _checked_outline(name: str, value: Any) -> Outline:
    """Return an outline, also that of path data; raise `InvalidNode` otherwise."""
    if isinstance(value, Outline):
        return value
    if isinstance(value, str):
        return Outline(value)
    raise InvalidNode(f"{name}: expected an Outline or SVG path data, got {describe(value)}")


CHECKS[Quantity.OUTLINE] = _checked_outline

if TYPE_CHECKING:

    class Section:
        """For type checkers: a field that takes an outline or path data, and holds an outline."""

        def __get__(self, instance: object, owner: Any) -> Outline: ...

        def __set__(self, instance: object, value: Outline | str) -> None: ...

else:
    Section = Annotated[
        Outline, Parameter(Quantity.OUTLINE, "shape in a plane: an `Outline`, or SVG path data")
    ]
