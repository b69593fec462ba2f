"""A notebook shows the page of a scene: a kernel runs the cell, and its output holds the page in a frame."""

import html
import re
from importlib.util import find_spec

import pytest

NEEDED = "nbclient", "nbformat", "ipykernel"

CELL = """
import decals
from blobtree import Point
decals.cover(Point((0, 0, 0), radius=1.0), count=10).page(title="Ball & co", resolution=12)
"""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the packages of notebooks
def test_a_page_is_the_output_of_a_cell() -> None:
    if missing := [name for name in NEEDED if find_spec(name) is None]:
        pytest.skip(f"missing: {', '.join(missing)}; pip install nbclient ipykernel")
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    bundles = [output["data"] for output in notebook.cells[0].outputs if "data" in output]
    (shown,) = [bundle["text/html"] for bundle in bundles if "iframe" in bundle.get("text/html", "")]
    (frame,) = re.findall(r"<iframe ([^>]*)>", shown)
    attributes = dict(re.findall(r'([a-z]+)="([^"]*)"', frame))
    assert attributes["title"] == "Ball &amp; co"
    assert attributes["sandbox"] == "allow-scripts allow-downloads"
    text = html.unescape(attributes["srcdoc"])
    assert text.startswith("<!doctype html>")
    assert '<script type="application/octet-stream" id="data">' in text
    assert "mount(root," in text
