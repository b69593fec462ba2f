"""Outlines: areas, rasters of text and drawings, holes, values and refusals."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from blobtree import Extrude, Outline, content_hash, from_json, to_json
from blobtree.errors import ImplicitDecalsError, InvalidFile, InvalidNode, MissingFile
from tests.oracles import sharp

FONT = Path(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")
PIXELS = 600
"""Pixels of a unit of length."""

FINE = 8 * PIXELS
"""Pixels of a unit of length where each pixel of coverage has 64."""

SQUARE = "M0 0H1V1H0Z"
OVERLAPPING = '<svg><circle r="2"/><rect x="0" y="-.2" width="5" height=".4"/></svg>'
TWICE = 2 * '<rect width="1" height="1"/>'
RECTANGLE = '<svg xmlns="http://www.w3.org/2000/svg"><rect width="{}" height="1"/></svg>'


def shown(outline: Outline, width: int, height: int, top: float) -> NDArray[np.bool_]:
    """Which centres of pixels an extrusion of an outline holds, whose upper left corner is at (0, top)."""
    x, y = np.meshgrid((np.arange(width) + 0.5) / PIXELS, top - (np.arange(height) + 0.5) / PIXELS)
    points = np.stack([x, y, np.full_like(x, 0.5)], axis=-1).reshape(-1, 3)
    return (Extrude(outline, 1.0)(points) > 0.5).reshape(height, width)


def assert_same_picture(outline: Outline, picture: Image.Image, top: float) -> None:
    """An outline and a picture of coverage agree but in pixels beside an edge, and so do their areas."""
    found = shown(outline, *picture.size, top)
    eroded, dilated = (
        np.asarray(picture.filter(kind(3))) for kind in (ImageFilter.MinFilter, ImageFilter.MaxFilter)
    )
    assert found[eroded == 255].all()
    assert not found[dilated == 0].any()
    area = float(np.asarray(picture, np.float64).sum()) / 255.0
    assert found.sum() == pytest.approx(area, rel=3e-3)
    assert outline.area * PIXELS**2 == pytest.approx(area, rel=3e-3)


def assert_same_coverage(outline: Outline, picture: Image.Image) -> None:
    """An outline agrees with a fine picture of two units, from the upper left corner at (0, 0)."""
    assert_same_picture(outline, picture.resize((2 * PIXELS, 2 * PIXELS), Image.Resampling.BOX), top=0.0)


@pytest.mark.parametrize("letters", ["A", "g", "&", "8", "\u00e4", "%", "\u00e7", "\u0105", "YY"])
def test_letters_are_those_of_a_rasteriser(letters: str) -> None:
    font = ImageFont.truetype(str(FONT), PIXELS, layout_engine=ImageFont.Layout.BASIC)
    picture = Image.new("L", (len(letters) * PIXELS, 2 * PIXELS))
    ImageDraw.Draw(picture).text((0, PIXELS), letters, fill=255, font=font, anchor="ls")
    assert_same_picture(Outline.text(letters), picture, top=1.0)


def test_lines_and_letters_stand_side_by_side() -> None:
    font = ImageFont.truetype(str(FONT), PIXELS, layout_engine=ImageFont.Layout.BASIC)
    wide, narrow = (Outline.text(text, size=2.0).bounds for text in ("II", "I"))
    assert wide[1][0] - narrow[1][0] == pytest.approx(2.0 * font.getlength("I") / PIXELS, abs=4e-3)
    above, below = Outline.text("I").bounds, Outline.text("\nI").bounds
    assert Outline.text("a\tb\r\nc") == Outline.text("a    b\nc")
    assert above[0][1] - below[0][1] == pytest.approx(sum(font.getmetrics()) / PIXELS, abs=4e-3)


def test_a_drawing_is_that_of_a_rasteriser() -> None:
    drawing = """<svg xmlns="http://www.w3.org/2000/svg">
      <rect x="0.1" y="0.1" width="0.5" height="0.3"/>
      <ellipse cx="1.2" cy="0.4" rx="0.4" ry="0.2" style="fill:red"/>
      <g transform="translate(0.1,0.8) rotate(90)" fill="none">
        <path d="M0 0h.6l-.3.4z" fill="blue" transform="scale(1 -1) matrix(0 -1 1 0 0 0) scale(-1 1)"/>
        <rect width="0.2" height="1"/>
      </g>
      <defs><circle r="1"/></defs>
      <path d="M1 1 A.3 .3 0 1 1 1.3 1.3 L1 1.3 Z m.1.1v.1h.1v-.1Z"/>
    </svg>"""
    picture = Image.new("L", (2 * FINE, 2 * FINE))
    draw, one = ImageDraw.Draw(picture), FINE
    draw.rectangle((0.1 * one, 0.1 * one, 0.6 * one - 1, 0.4 * one - 1), fill=255)
    draw.ellipse((0.8 * one, 0.2 * one, 1.6 * one - 1, 0.6 * one - 1), fill=255)
    draw.polygon([(0.1 * one, 0.8 * one), (0.7 * one, 0.8 * one), (0.4 * one, 1.2 * one)], fill=255)
    draw.pieslice((one, 0.7 * one, 1.6 * one - 1, 1.3 * one - 1), 180, 90, fill=255)
    draw.rectangle((one, one, 1.3 * one - 1, 1.3 * one - 1), fill=255)
    draw.rectangle((1.1 * one, 1.1 * one, 1.2 * one - 1, 1.2 * one - 1), fill=0)
    assert_same_coverage(Outline.svg(drawing), picture)


def test_a_file_is_its_text(tmp_path: Path) -> None:
    text = f'<svg><path d="{SQUARE}"/></svg>'
    (tmp_path / "square.svg").write_text(text)
    assert Outline.svg(tmp_path / "square.svg") == Outline.svg(text)
    assert Outline.svg("\ufeff\r\n" + text) == Outline.svg(text)
    assert Outline.svg(text).bounds == ((0.0, -1.0), (1.0, 0.0))


def test_shapes_that_overlap_are_those_of_a_rasteriser() -> None:
    drawing = """<svg xmlns="http://www.w3.org/2000/svg">
      <circle cx=".6" cy=".6" r=".4"/><rect x=".5" y=".5" width=".9" height=".3"/>
      <ellipse cx="1.4" cy=".7" rx=".3" ry=".5"/><path d="M.2 1.2 1 1.8V1.2L.2 1.8Z"/>
      <path fill-rule="evenodd" d="M1.2 1.2H1.8V1.8H1.2ZM1.4 1.4H2V1.6H1.4Z"/></svg>"""
    picture = Image.new("L", (2 * FINE, 2 * FINE))
    draw, one = ImageDraw.Draw(picture), FINE
    draw.ellipse((0.2 * one, 0.2 * one, one - 1, one - 1), fill=255)
    draw.rectangle((0.5 * one, 0.5 * one, 1.4 * one - 1, 0.8 * one - 1), fill=255)
    draw.ellipse((1.1 * one, 0.2 * one, 1.7 * one - 1, 1.2 * one - 1), fill=255)
    for side in (0.2, 1.0):
        draw.polygon([(side * one, 1.2 * one), (0.6 * one, 1.5 * one), (side * one, 1.8 * one)], fill=255)
    draw.rectangle((1.2 * one, 1.2 * one, 1.8 * one - 1, 1.8 * one - 1), fill=255)
    draw.rectangle((1.4 * one, 1.4 * one, 2.0 * one - 1, 1.6 * one - 1), fill=255)
    draw.rectangle((1.4 * one, 1.4 * one, 1.8 * one - 1, 1.6 * one - 1), fill=0)
    assert_same_coverage(Outline.svg(drawing), picture)


@pytest.mark.parametrize("seed", range(12))
def test_unions_hold_what_has_a_winding_number(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rule, number = str(rng.choice(["nonzero", "evenodd"])), int(rng.integers(2, 9))
    corners = rng.uniform(0.0, 1.0, (number, 5, 2)).round(int(rng.choice([1, 9])))
    paths = ["M" + " ".join(f"{x} {y}" for x, y in polygon) + "Z" for polygon in corners.tolist()]
    outline = Outline.svg(f'<svg><path d="{" ".join(paths)}"/></svg>', rule=rule)
    p = rng.uniform(0.0, 1.0, (2000, 2))
    starts, ends = corners, np.roll(corners, -1, axis=1)
    a, b = starts.reshape(-1, 1, 2), ends.reshape(-1, 1, 2)
    (x, y), (u, v) = (np.moveaxis(way, -1, 0) for way in (b - a, p - a))
    left = x * v - y * u
    rises = ((a[..., 1] <= p[:, 1]) & (b[..., 1] > p[:, 1]) & (left > 0)).sum(axis=0)
    falls = ((b[..., 1] <= p[:, 1]) & (a[..., 1] > p[:, 1]) & (left < 0)).sum(axis=0)
    windings = rises - falls
    filled = windings % 2 == 1 if rule == "evenodd" else windings != 0
    flat = sharp.flat_distance(p * (1.0, -1.0), outline)
    clear = np.abs(flat) > 1e-5
    assert ((flat < 0.0) == filled)[clear].all()
    assert clear.mean() > 0.99


@pytest.mark.parametrize(
    ("outline", "area", "loops"),
    [
        (Outline(SQUARE) | Outline("M1 0H2V1H1Z"), 2.0, 1),
        (Outline(SQUARE) | Outline("M1 1H2V2H1Z"), 2.0, 2),
        (Outline(SQUARE) | Outline(SQUARE), 1.0, 1),
        (Outline(SQUARE) | Outline("M.5 .5H.75V.75H.5Z"), 1.0, 1),
        (Outline.svg('<svg><path d="M0 0L2 2V0L0 2Z"/></svg>'), 2.0, 2),
        (Outline.text("TT", size=2048.0), 2.0 * Outline.text("T", size=2048.0).area - 12.0 * 170.0, 1),
        (Outline.svg(OVERLAPPING), 4.0 * np.pi + 0.4 * 5.0 - 0.4 * 2.0, 1),
    ],
)
def test_unions(outline: Outline, area: float, loops: int) -> None:
    assert outline.area == pytest.approx(area, rel=1e-3)
    assert len(outline.loops) == loops


def test_curves_of_unions_stay_curves() -> None:
    discs = Outline.arcs([(-1, 0), (1, 0)], 1) | Outline.arcs([(0, 0), (2, 0)], 1)
    assert discs.area == pytest.approx(4.0 / 3.0 * np.pi + 0.5 * np.sqrt(3.0), rel=1e-3)
    assert "C" in discs.path
    assert discs.loops[0].corners.sum() == 2


def test_many_nested_loops_are_holes_in_turn() -> None:
    squares = [f"M{-i} {-i}h{2 * i}v{2 * i}h{-2 * i}Z" for i in range(1, 1001)]
    assert Outline("".join(squares)).area == sum(4.0 * (-1) ** i * i**2 for i in range(1, 1001))


def test_rules_of_filling() -> None:
    nested = '<svg><path d="M0 0H4V4H0ZM1 1H3V3H1Z"/></svg>'
    assert Outline.svg(nested).area == 16.0
    assert Outline.svg(nested, rule="evenodd").area == 12.0
    opposite = '<svg><path d="M0 0H4V4H0ZM1 1V3H3V1Z"/></svg>'
    assert Outline.svg(opposite).area == 12.0
    two_shapes = opposite.replace("ZM", 'Z"/><path d="M')
    assert Outline.svg(two_shapes).area == 16.0
    assert Outline.svg(two_shapes, rule="nonzero").area == 12.0


@pytest.mark.parametrize(
    ("shapes", "area"),
    [
        ('<path fill-rule="evenodd" d="{}"/>', 12.0),
        ('<g style="fill-rule: evenodd"><path d="{}"/></g>', 12.0),
        ('<g fill-rule="evenodd"><g><path fill-rule="inherit" d="{}"/></g></g>', 12.0),
        ('<g fill-rule="evenodd"><path fill-rule="nonzero" d="{}"/></g>', 16.0),
        ('<path fill-rule="evenodd" d="{}"/><rect x="1.5" y="1.5" width="1" height="1"/>', 13.0),
        ('<g visibility="hidden"><path d="{}"/><rect width="1" height="1" visibility="visible"/></g>', 1.0),
        ('<path d="{}"/><circle r="9" visibility="hidden"/><circle/><path d="M0 0Z"/>', 16.0),
    ],
)
def test_shapes_are_filled_as_the_file_says(shapes: str, area: float) -> None:
    assert Outline.svg(f"<svg>{shapes.format('M0 0H4V4H0ZM1 1H3V3H1Z')}</svg>").area == area


@pytest.mark.parametrize(
    ("outline", "area"),
    [
        (Outline.polygon([(0, 0), (0, 2), (1, 0)]), 1.0),
        (Outline.arcs([(-3, 0), (3, 0)], 1), 9.0 * np.pi),
        (Outline.arcs([(0, 0), (1, 0), (0, 1)], [1e-200, -1e-200, 0.0]), 0.5),
        (Outline.arcs([(0, 0), (1, 0), (1, 1), (0, 1)], [0, -1, 0, 0]), 1.0 - np.pi / 8.0),
        (Outline("M0 0A2 1 30 1 1 .1 0Z"), 2.0 * np.pi),
        (Outline("M1 0C1 1 0 1 0 0ZM5 0Q6 2 7 0Z"), 0.6 + 4.0 / 3.0),
        (Outline(SQUARE).scale(2.0) + Outline(SQUARE).translate((0.5, 0.5)), 3.0),
    ],
)
def test_areas(outline: Outline, area: float) -> None:
    tolerance = 2e-3 if outline.path.startswith("M0 0A") else 3e-4
    assert outline.area == pytest.approx(area, rel=tolerance)


@given(st.floats(0.01, 6.0), st.floats(-40.0, 40.0), st.floats(0.02, 50.0))
def test_arcs_lie_on_circles(bulge: float, place: float, size: float) -> None:
    start, end = np.array([place, -place]), np.array([place + size, -place])
    (loop,) = Outline.arcs([start, end], [bulge, 0.0]).loops
    radius = 0.25 * size * (bulge + 1.0 / bulge)
    middle = 0.5 * (start + end) + np.array([0.0, radius - 0.5 * size * bulge])
    assert np.linalg.norm(loop.points - middle, axis=1) == pytest.approx(radius, rel=1e-6)
    assert loop.corners.sum() <= 2


def test_a_spline_passes_its_points_smoothly() -> None:
    angles = np.array([0.0, 0.7, 1.9, 3.0, 4.4, 5.5])
    points = np.column_stack([2.0 * np.cos(angles), np.sin(angles)])
    (loop,) = Outline.spline(points).loops
    assert not loop.corners.any()
    apart = np.linalg.norm(loop.points[:, None] - points, axis=-1).min(axis=0)
    assert apart.max() < 1e-12


def test_outlines_are_values() -> None:
    one, other = Outline(SQUARE), Outline(SQUARE)
    assert one == other
    assert hash(one) == hash(other)
    assert eval(repr(one)) == one
    solid = Extrude(SQUARE, 1.0)
    assert solid.outline == one
    assert from_json(to_json(solid)) == solid
    assert content_hash(solid) == content_hash(Extrude(other, 1.0))
    assert content_hash(solid) != content_hash(Extrude(one.scale(2.0), 1.0))


def test_the_shape_lies_on_the_left() -> None:
    outer, hole = (Outline("M0 0V3H3V0Z") + Outline("M1 1H2V2H1Z")).loops
    assert outer.points.tolist() == [[3, 0], [3, 3], [0, 3], [0, 0]]
    assert hole.points.tolist() == [[1, 2], [2, 2], [2, 1], [1, 1]]
    assert outer.corners.all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Outline(""), "expected a shape with an area"),
        (lambda: Outline("M0 0L1 1"), "expected a shape with an area"),
        (lambda: Outline("a square"), "expected SVG path data"),
        (lambda: Outline(7), "expected SVG path data"),  # type: ignore[arg-type]
        (lambda: Outline("L0 0"), "path: expected one without errors, got ValueError"),
        (lambda: Outline("M0 0A1 1 0"), "path: expected one without errors, got"),
        (lambda: Outline("M0 0H1e999V1Z"), "expected finite coordinates"),
        (lambda: Outline("M0 0L2 2V0L0 2Z"), r"got edges that meet near \("),
        (lambda: Outline("M0 0H2V2H0ZM1 1H3V3H1Z"), r"unite outlines that overlap by a \| b"),
        (lambda: Outline("M0 0H2V2H0ZM0 0L1 .5 .5 1Z"), "neither cross nor touch"),
        (lambda: Outline.polygon([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), "points: expected points of two finite"),
        (lambda: Outline.polygon([(0, 0), (np.nan, 0), (0, 1)]), "points: expected points of two finite"),
        (lambda: Outline.polygon("square"), "points: expected points of two finite"),
        (lambda: Outline.polygon([]), "points: expected points of two finite"),
        (lambda: Outline.polygon(np.random.default_rng(1).random((60_000, 2))), "at most 50,000 lines"),
        (lambda: Outline("M0 0" + "C0 9 9 9 9 0S0 -9 0 0" * 2000), "at most 50,000 corners"),
        (lambda: Outline.arcs([(0, 0), (1, 0)], [1, 1, 1]), "bulges: expected a finite number, or one for"),
        (lambda: Outline.spline([(0, 0), (0, 0), (1, 1)]), "two neighbours are equal"),
        (lambda: Outline.spline([(0, 0), (1, 1), (0, 0)]), "the first and last are neighbours too"),
        (lambda: Outline.polygon([(0, 0), (1, 1)]), "points: expected at least three, got 2"),
        (lambda: Outline.svg("<svg><path"), "drawing: expected one without errors, got ParseError"),
        (lambda: Outline.svg("<svg/>"), "expected a shape with an area"),
        (lambda: Outline.svg(3), "drawing: expected a file or the text"),  # type: ignore[arg-type]
        (lambda: Outline.svg("<svg/>", rule="all"), "rule: expected 'nonzero', 'evenodd' or None"),
        (lambda: Outline.svg("<svg/>", rule=np.zeros(2)), "rule: expected 'nonzero', 'evenodd' or None"),  # type: ignore[arg-type]
        (lambda: Outline.svg("<svg><circle/></svg>"), "expected a shape with an area"),
        (lambda: Outline.svg('<svg><path d="M0 0Z"/></svg>'), "expected a shape with an area"),
        (
            lambda: Outline.svg(f"<svg>{TWICE}</svg>", rule="evenodd"),
            "expected a shape with an area, got none",
        ),
        (
            lambda: Outline.svg(RECTANGLE.format("1mm")),
            "cannot read width='1mm' of a rect; use numbers without",
        ),
        (lambda: Outline.svg(RECTANGLE.format("50%")), "cannot read width='50%' of a rect"),
        (lambda: Outline.svg('<svg transform="scale()"/>'), "as many numbers as SVG gives scale"),
        (lambda: Outline.text(" "), "expected a shape with an area"),
        (lambda: Outline.text("\U0001f9ff"), "the font has no '.*'; choose another font"),
        (lambda: Outline.text("a", size=-1), "size: expected a number above 0"),
        (lambda: Outline.text("a", font=__file__), "font: expected one without errors, got TTLibError"),
        (lambda: Outline.text(3), "text: expected a text"),  # type: ignore[arg-type]
        (lambda: Outline(SQUARE).scale(0), "factor: expected a number above 0"),
        (lambda: Outline(SQUARE).translate((1, 2, 3)), "offset: expected points of two finite numbers"),
    ],
)
def test_wrong_outlines_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()


def test_only_outlines_are_united() -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        Outline(SQUARE) | SQUARE  # type: ignore[operator]


@pytest.mark.parametrize("other", [SQUARE, None])
def test_only_outlines_are_added_to_outlines(other: Any) -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        Outline(SQUARE) + other


def test_missing_and_damaged_files_are_refused() -> None:
    with pytest.raises(MissingFile, match=r"none\.svg"):
        Outline.svg("none.svg")
    with pytest.raises(MissingFile, match=r"none\.ttf"):
        Outline.text("a", font="none.ttf")
    with pytest.raises(InvalidFile, match="outline"):
        from_json(to_json(Extrude(SQUARE, 1.0)).replace(b"V1", b"L"))


@pytest.mark.parametrize("seed", range(40))
def test_damaged_fonts_raise_errors_of_ours(seed: int, tmp_path: Path) -> None:
    rng, damaged = np.random.default_rng(seed), bytearray(FONT.read_bytes())
    for place in rng.integers(0, 4000 if seed % 2 else len(damaged), 50):
        damaged[place] = rng.integers(0, 256)
    (tmp_path / "damaged.ttf").write_bytes(damaged)
    with suppress(ImplicitDecalsError):
        Outline.text("Ag", font=tmp_path / "damaged.ttf")


def test_gradients_of_an_extrusion_are_exact_at_corners_of_its_curves() -> None:
    outline = Outline.arcs([(-1, 0), (1, 0)], 1)
    (loop,) = outline.loops
    ways = np.roll(loop.points, -1, axis=0) - loop.points
    along = ways / np.linalg.norm(ways, axis=1)[:, None]
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    rng = np.random.default_rng(0)
    rows = rng.integers(len(along), size=4000)
    beside = 10.0 ** rng.uniform(-6, -3, (4000, 1)) * along[rows]
    places = loop.points[rows] + beside + rng.uniform(0.05, 0.4, (4000, 1)) * normals[rows]
    points = np.column_stack([places, np.ones(4000)]).astype(np.float32)
    gradients = Extrude(outline, 2.0, radius=0.5).gradient(points)
    directions = gradients[:, :2] / np.linalg.norm(gradients, axis=1)[:, None]
    np.testing.assert_allclose(directions, -normals[rows], atol=1e-6)
