"""The symbols of the paper: their definitions, marked in texts, and their values at the probe."""

import re
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

import numpy as np
from markdown_it import MarkdownIt

from blobtree._typing import BoolArray
from decals.apps.lab.experiment import Scope
from decals.apps.lab.formulas import parse
from decals.apps.lab.measures import MEASURES, F, bodies_of, h, owner
from decals.model import Interaction
from decals.record import Contact

DEFINITIONS = {
    "r": "visible radius: at this distance from the centre is the rim of the image; r = 0.454 s",
    "s": "influence radius: at this distance from the centre the field ends",
    "d": "distance of the point from the centre, over the influence radius s",
    "g": "falloff (1 − d²)³: 1 at the centre, ½ on the rim, 0 from the distance s on",
    "f": "field g(d) before contact: the image is shown where it is ½ or more",
    "h": "factor by which a neighbour lowers the owner's field: 1 without a push, 0 on the line of contact",
    "F": "field after contact, ½ + (f − ½) h: it says how far from its middle the image is read",
}
"""What each symbol means, for decals and solids."""

SYMBOL = re.compile(rf"(?<![\w'’])([{''.join(DEFINITIONS)}])([₀-₉]*)(?![^\W²³])")
"""A symbol in a text, with the number of its decal."""

TAG = re.compile(r"(<[^>]*>)")

NAMES = *DEFINITIONS, "f₀", "f₁", "F₀", "F₁"

EXPLAINED = Path(__file__).with_name("symbols.css").read_text(encoding="utf-8")
"""Styles of symbols: a tap or the focus shows their definition, as the pointer does."""

PUSHED = 1e-3
"""Least change of the field by which a push counts."""


def styles(page: str) -> str:
    """Return styles of symbols in a page, by its selector.

    A symbol under the pointer, or with the focus, lights up its curve and shades the region where it acts.
    """

    def chosen(part: str) -> str:
        symbols = (f'[data-symbol="{name}"]:is(:hover, :focus)' for name in NAMES)
        pairs = zip(symbols, NAMES, strict=True)
        return ",".join(f'{page}:has(:is(abbr, tspan){symbol}) {part}="{name}"]' for symbol, name in pairs)

    curves, places = chosen("path[data-symbol"), chosen("[data-region")
    return f"{EXPLAINED}{curves} {{ stroke-width: 5 }}\n{places} {{ opacity: 0.5 }}\n"


def marked(
    html: str,
    *,
    svg: bool = False,
    reached: bool = False,
    definitions: Mapping[str, str] = DEFINITIONS,
) -> str:
    """Return HTML, or the text of an SVG element, whose symbols show their definitions under the pointer.

    A tap shows them, too; with `reached`, also the Tab key.
    """
    tab = 0 if reached else -1

    def definition(match: re.Match[str]) -> str:
        title = escape(f"{match[0]}: {definitions[match[1]]}")
        if svg:
            return f'<tspan data-symbol="{match[0]}"><title>{title}</title>{match[0]}</tspan>'
        return f'<abbr data-symbol="{match[0]}" title="{title}" tabindex="{tab}">{match[0]}</abbr>'

    parts = TAG.split(html)
    return "".join(part if i % 2 else SYMBOL.sub(definition, part) for i, part in enumerate(parts))


def regions(*, in_space: bool, count: int) -> dict[str, str]:
    """Return the formula of the points at which each symbol acts, of that many decals or of solids.

    A field acts where its image or solid is, ½ or more, h where it lowers the highest field, and g, d and s
    where the influence of a decal reaches.
    """
    pairs = [(i, "₀₁"[i]) for i in range(2)]
    if in_space:
        measures = {"f": "body", "F": "solid"}.items()
        return {f"{symbol}{sign}": f"{name}({i}) >= 0.5" for symbol, name in measures for i, sign in pairs}
    own = {f"f{sign}": f"f({i}) >= 0.5" for i, sign in pairs if i < count}
    everywhere = dict.fromkeys("gds", "top > 0") | dict.fromkeys("fr", "top >= 0.5")
    return {**everywhere, **own, "F": "owner >= 0", "h": f"owner >= 0 and top - F > {PUSHED}"}


def acting(scope: Scope) -> dict[str, BoolArray]:
    """Return whether each symbol acts at the points of a scope, bool[n] each."""
    experiment, points = scope.experiment, scope.points
    texts = regions(in_space=experiment.in_space, count=len(experiment.decals))
    found = {text: parse(text, MEASURES, frozenset()).evaluate(scope) for text in texts.values()}
    return {name: np.asarray(found[text], np.bool_) & points.exists for name, text in texts.items()}


def document(text: str, definitions: Mapping[str, str] = DEFINITIONS) -> str:
    """Return Markdown as HTML with marked symbols; HTML and pictures in it stay text: it asks no server."""
    html: str = MarkdownIt("commonmark", {"html": False}).disable("image").enable("table").render(text)
    return marked(html, definitions=definitions)


def readings(scope: Scope) -> list[tuple[str, list[float]]]:
    """Return rows of symbols with their values at the probe, one for each of two decals or for the point.

    The decals are the one that shows, else that of the highest field, and the strongest other one, by their
    numbers. h is that of equation 5, and unknown in modes that do without it.
    """
    decals = scope.experiment.decals

    def row(name: str, measure: str, numbers: Iterable[int]) -> tuple[str, list[float]]:
        return name, [float(np.ravel(MEASURES[measure].function(scope, i))[0]) for i in numbers]

    if scope.experiment.in_space:
        solids = range(len(bodies_of(scope)))
        return [("solid", [*map(float, solids)]), row("f", "body", solids), row("F", "solid", solids)]
    if not len(decals):
        return []
    _, fields = row("f", "f", range(len(decals)))
    own = int(owner(scope)[0])
    own = int(np.argmax(fields)) if own < 0 else own
    others = sorted({*range(len(fields))} - {own}, key=fields.__getitem__)[-1:]
    pair, push = sorted([own, *others]), float("nan")
    if others and scope.experiment.rules.contact in (Contact.PRODUCT, Contact.MIN):
        alone = np.ptp(decals.layers[pair]) or (decals.interactions[pair] != Interaction.PUSH).any()
        push = 1.0 if alone else float(h(scope, others[0], own)[0])
    columns = {"r": "radius", "s": "influence", "d": "d", "f = g(d)": "f"}
    rows = [row(name, measure, pair) for name, measure in columns.items()]
    return [("decal", [*map(float, pair)]), *rows, ("h", [push]), ("F", [float(F(scope)[0])])]


def table(rows: list[tuple[str, list[str]]]) -> str:
    """Return the readings as an HTML table, with a column for each symbol."""
    height = max((len(texts) for _, texts in rows), default=0)
    head = "".join(f'<th scope="col">{marked(name, reached=True)}</th>' for name, _ in rows)
    lines = [
        "".join(f'<td rowspan="{height // len(row)}">{row[i]}</td>' for _, row in rows if i < len(row))
        for i in range(height)
    ]
    return f"<table><tr>{head}</tr><tr>{'</tr><tr>'.join(lines)}</tr></table>" if lines else ""
