"""`report`: one HTML file with figures of all measures, pictures side by side, and provenance."""

import base64
import html
import io
import os
from collections import Counter
from collections.abc import Iterator
from typing import Any

from blobtree.files import write_atomically
from decals.errors import MissingPackage
from decals.experiments.artefacts import is_artefact
from decals.experiments.results import Results

PICTURES = 24
"""Most pictures of one measure in a report."""

SHOWN_VALUES = 12
"""Most values of a text parameter on one axis."""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; font-size: 0.9rem }
td, th { padding: 0.2rem 0.7rem; border-bottom: 1px solid #ccc; text-align: left }
figure { display: inline-block; margin: 0.5rem }
figcaption { font-size: 0.8rem; max-width: 16rem }
img { max-width: 100% }
"""


def report(results: Results | str | os.PathLike[str], path: str | os.PathLike[str]) -> None:
    """Write a report of an experiment as one HTML file.

    Each figure shows the mean of a measure against one parameter, over all other parameters, with 95 %
    bootstrap intervals. Rows that failed or have no finite number are left out and counted.

    Parameters
    ----------
    results : Results or path
        The results, or their folder.
    path : path
        The HTML file.

    Raises
    ------
    InvalidInput
        The folder holds no experiment.
    MissingPackage
        Matplotlib is not installed.
    UnusableFile
        The file cannot be written.

    Examples
    --------
    >>> results = run(lambda x: x * x, Grid(x=[1, 2, 3]), "squares", workers=0)
    >>> report(results, "squares.html")
    """
    results = results if isinstance(results, Results) else Results(results)
    title = html.escape(f"{results.name}: {len(results)} trials")
    body = "\n".join(
        [f"<h1>{title}</h1>", *_summary(results), *_figures(results), *_pictures(results), *_origin(results)]
    )
    page = (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{STYLE}</style><body>{body}</body></html>\n"
    )
    write_atomically(path, page.encode())


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
                all_["count"],
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


def _figures(results: Results) -> Iterator[str]:
    """Yield a figure for each measure against each parameter that varies."""
    varied = [name for name in results.parameters if len({str(row.get(name)) for row in results.rows}) > 1]
    for measure in results.numbers:
        yield f"<h2>{html.escape(measure)}</h2>"
        for parameter in varied:
            yield _image(_figure(results, measure, parameter), f"{measure} against {parameter}")


def _figure(results: Results, measure: str, parameter: str) -> str:
    """Return the figure of a measure against a parameter as the address of an image."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPackage("Matplotlib is not installed; install implicit-decals[experiments]") from error
    groups = [group for group in results.interval(measure, by=[parameter]) if group["count"]]
    values: list[Any] = [group[parameter] for group in groups]
    numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    if not numeric:
        groups, values = groups[:SHOWN_VALUES], [_plain(str(value)) for value in values[:SHOWN_VALUES]]
    means = [group["mean"] for group in groups]
    errors = [
        [group["mean"] - group["low"] for group in groups],
        [group["high"] - group["mean"] for group in groups],
    ]
    figure = Figure(figsize=(4.8, 3.4), layout="constrained")
    axes = figure.add_subplot(xlabel=_plain(parameter), ylabel=_plain(measure))
    axes.errorbar(values, means, yerr=errors, fmt="o-" if numeric else "o", capsize=3)
    if numeric and min(values) > 0 and max(values) / min(values) >= 100:
        axes.set_xscale("log")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None})
    return _address(drawn.getvalue(), "svg+xml")


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
