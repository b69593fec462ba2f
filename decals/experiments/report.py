"""`report`: a page with figures of all measures, pictures side by side and provenance; one figure; tables."""

import base64
import csv
import html
import io
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from blobtree.files import write_atomically
from blobtree.validation import describe
from decals.errors import InvalidInput, MissingPackage
from decals.experiments.artefacts import is_artefact
from decals.experiments.results import Results

PICTURES = 24
"""Most pictures of one measure in a report."""

SHOWN_VALUES = 12
"""Most values of a text parameter on one axis."""

UNDATED = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata without the date, so that equal results give equal files."""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; font-size: 0.9rem }
td, th { padding: 0.2rem 0.7rem; border-bottom: 1px solid #ccc; text-align: left }
figure { display: inline-block; margin: 0.5rem }
figcaption { font-size: 0.8rem; max-width: 16rem }
img { max-width: 100% }
"""


def report(
    results: Results | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    measure: str | None = None,
    by: Sequence[str] = (),
) -> None:
    """Write a report of an experiment as a page, or one figure or table of it.

    The page has a figure of each measure against each parameter: its mean over all other parameters, with
    95 % bootstrap intervals. Rows that failed or have no finite number are left out and counted.

    Parameters
    ----------
    results : Results or path
        The results, or their folder.
    path : path
        An HTML file for the page; SVG, PDF or PNG for one figure; Markdown for the means of all measures, or
        of one; CSV for all rows, without times and provenance.
    measure : str, optional
        The measure of the figure, or of the Markdown table.
    by : sequence of str
        Parameters: the axis of a figure and its lines, or the first columns of a Markdown table.

    Raises
    ------
    InvalidInput
        The folder holds no experiment; the suffix is another one; a figure lacks its measure or parameter.
    MissingPackage
        Matplotlib is not installed.
    UnusableFile
        The file cannot be written.

    Examples
    --------
    >>> results = run(lambda x: x * x, Grid(x=[1, 2, 3]), "squares", workers=0)
    >>> report(results, "squares.html")
    >>> report(results, "squares.svg", measure="result", by=["x"])
    """
    results = results if isinstance(results, Results) else Results(results)
    suffix = Path(path).suffix.lower()
    if suffix not in WRITERS:
        raise InvalidInput(f"{path}: expected a file that ends in {', '.join(WRITERS)}")
    write_atomically(path, WRITERS[suffix](results, measure, [by] if isinstance(by, str) else list(by)))


def _page(results: Results, _measure: str | None, _by: list[str]) -> bytes:
    """Return the page."""
    title = html.escape(f"{results.name}: {len(results)} trials")
    body = "\n".join(
        [f"<h1>{title}</h1>", *_summary(results), *_figures(results), *_pictures(results), *_origin(results)]
    )
    page = (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{STYLE}</style><body>{body}</body></html>\n"
    )
    return page.encode()


def _rows(results: Results, _measure: str | None, _by: list[str]) -> bytes:
    """Return the parameters, status and measures of all rows as CSV."""
    names = [*results.parameters, "status", *results.measures]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    table.writerows([row.get(name) for name in names] for row in results.rows)
    return text.getvalue().encode()


def _means(results: Results, measure: str | None, by: list[str]) -> bytes:
    """Return the means of measures for each value of some parameters as Markdown."""
    measures = results.numbers if measure is None else [measure]
    groups = [results.interval(name, by) for name in measures]
    lines = [[*by, *measures], ["---"] * len(by) + ["---:"] * len(measures)]
    lines += [
        [_text(each[0][name]) for name in by] + [_text(group["mean"]) for group in each]
        for each in zip(*groups, strict=True)
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines).encode()


def _summary(results: Results) -> Iterator[str]:
    """Yield what ended how, and the mean of each measure."""
    counts = Counter(row["status"] for row in results.rows)
    yield f"<p>{html.escape(', '.join(f'{count} {status}' for status, count in counts.items()))}</p>"
    yield _table(
        ("measure", "mean", "95 % interval", "trials", "left out"),
        [
            (
                name,
                f"{all_['mean']:.5g}",
                f"{all_['low']:.5g} to {all_['high']:.5g}",
                all_["trials"],
                all_["left_out"],
            )
            for name in results.numbers
            for all_ in results.interval(name)
        ],
    )
    if results.failed:
        yield "<h2>Errors</h2>"
        errors = Counter(row["error"] for row in results.failed)
        yield _table(("error", "trials"), errors.most_common(10))


def _text(value: Any) -> str:
    """Return a value of a table, numbers to three digits."""
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return f"{value:,}" if type(value) is int else str(value).replace("|", r"\|")


def _figures(results: Results) -> Iterator[str]:
    """Yield a figure for each measure against each parameter that varies."""
    varied = [name for name in results.parameters if len({str(row.get(name)) for row in results.rows}) > 1]
    for measure in results.numbers:
        yield f"<h2>{html.escape(measure)}</h2>"
        for parameter in varied:
            drawn = _figure("svg")(results, measure, [parameter])
            yield _image(_address(drawn, "svg+xml"), f"{measure} against {parameter}")


def _figure(kind: str) -> Callable[[Results, str | None, list[str]], bytes]:
    """Return the writer of a figure: a measure against a parameter, a line for each value of another."""

    def drawn(results: Results, measure: str | None, by: list[str]) -> bytes:
        try:
            from matplotlib import rc_context
            from matplotlib.figure import Figure
        except ImportError as error:
            raise MissingPackage(
                "Matplotlib is not installed; install implicit-decals[experiments]"
            ) from error
        if measure is None or len(by) not in (1, 2):
            raise InvalidInput("a figure: expected a measure, and one or two parameters to draw it by")
        if measure in results.measures and measure not in results.numbers:
            raise InvalidInput(f"a figure: expected a measure that is a number, got {describe(measure)}")
        groups = [group for group in results.interval(measure, by) if group["trials"]]
        figure = Figure(figsize=(4.8, 3.4), layout="constrained")
        axes = figure.add_subplot(xlabel=_plain(by[0]), ylabel=_plain(measure))
        _scale(axes, [group[by[0]] for group in groups])
        for line in dict.fromkeys(str(group[name]) for group in groups for name in by[1:]) or [None]:
            _draw(axes, by[0], [group for group in groups if line in (None, str(group[by[-1]]))], line)
        if len(by) == 2:
            axes.legend(title=_plain(by[1]), fontsize="small")
        file = io.BytesIO()
        with rc_context({"svg.hashsalt": "implicit-decals"}):
            figure.savefig(file, format=kind, dpi=200, metadata=UNDATED.get(kind))
        return file.getvalue()

    return drawn


def _scale(axes: Any, values: list[Any]) -> None:
    """Choose a logarithmic axis for numbers far apart."""
    if _numeric(values) and min(values) > 0 and max(values) / min(values) >= 100:
        axes.set_xscale("log")


def _draw(axes: Any, parameter: str, groups: list[dict[str, Any]], line: str | None) -> None:
    """Draw means with their intervals."""
    numeric = _numeric([group[parameter] for group in groups])
    if not numeric:
        groups = [group | {parameter: _plain(str(group[parameter]))} for group in groups[:SHOWN_VALUES]]
    means = [group["mean"] for group in groups]
    errors = [
        [group["mean"] - group["low"] for group in groups],
        [group["high"] - group["mean"] for group in groups],
    ]
    name = None if line is None else _plain(line)
    values = [group[parameter] for group in groups]
    axes.errorbar(
        values, means, yerr=errors, fmt="o-" if numeric else "o", capsize=3, markersize=4, label=name
    )


def _numeric(values: list[Any]) -> bool:
    return bool(values) and all(type(value) in (int, float) for value in values)


def _plain(text: str) -> str:
    """Return a text that Matplotlib does not take for a formula."""
    return text.replace("$", r"\$")


def _pictures(results: Results) -> Iterator[str]:
    """Yield the pictures of each measure side by side."""
    for measure in results.measures:
        drawn = [row for row in results.rows if is_artefact(row.get(measure), results.folder, ".png")]
        if drawn:
            yield f"<h2>{html.escape(measure)}</h2>"
        for row in drawn[:PICTURES]:
            caption = ", ".join(f"{name} {row.get(name)}" for name in results.parameters)
            address = _address((results.folder / row[measure]).read_bytes(), "png")
            yield _image(address, caption, f"<figcaption>{html.escape(caption)}</figcaption>")
        if len(drawn) > PICTURES:
            yield f"<p>{len(drawn) - PICTURES} more pictures lie in the folder.</p>"


def _origin(results: Results) -> Iterator[str]:
    """Yield where the rows come from."""
    yield "<h2>Provenance</h2>"
    yield _table(
        ("environment", "trials"), Counter(row.get("provenance") for row in results.rows).most_common()
    )
    seconds = sum(row.get("seconds") or 0.0 for row in results.rows)
    yield f"<p>Function {html.escape(results.name)}, all trials {seconds:.4g} s.</p>"


def _table(head: tuple[str, ...], rows: list[Any]) -> str:
    lines = [head, *rows]
    cells = ["".join(f"<td>{html.escape(str(cell))}</td>" for cell in line) for line in lines]
    return (
        "<table>"
        + "".join(f"<tr>{line}</tr>" for line in cells).replace("td>", "th>", 2 * len(head))
        + "</table>"
    )


def _image(address: str, text: str, caption: str = "") -> str:
    return f'<figure><img alt="{html.escape(text)}" src="{address}">{caption}</figure>'


def _address(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


WRITERS = {
    ".html": _page,
    ".htm": _page,
    ".svg": _figure("svg"),
    ".pdf": _figure("pdf"),
    ".png": _figure("png"),
    ".md": _means,
    ".csv": _rows,
}
"""Writers by the suffix of their files."""
