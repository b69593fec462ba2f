"""Write the reference of the node classes: a page for each, from its declaration and docs/nodes.toml.

A page has the class's description, a picture with the code that makes it, the formula, the parameters, bounds
and references. `docs/draw_nodes.py` draws the pictures.
"""

import inspect
import tomllib
from pathlib import Path
from typing import Any

from blobtree import Node
from blobtree.declare.claims import Support
from blobtree.declare.parameters import OPTIONAL, describe, fields_of, parameters_of
from blobtree.nodes.convolution import ConvolutionPrimitive
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.operator import Combination
from blobtree.nodes.primitives import Primitive, Profile
from blobtree.nodes.tree import Macro

DOCS = Path(__file__).parent
CLASSES = {kind.__name__: kind for kind in NODE_KINDS.values()}

BOXES = {
    Support.EITHER: "The box is that around the boxes of all operands.",
    Support.COMMON: "The box is the common part of the boxes of the operands.",
    Support.LEFT: "The box is that of the first operand.",
}


DATA = tomllib.loads((DOCS / "nodes.toml").read_text(encoding="utf-8"))
TEXTS, REFERENCES = DATA.pop("Texts"), DATA.pop("References")
SAMPLES: dict[str, dict[str, dict[str, Any]]] = DATA
"""Samples by family and class."""


def sentence(function: Any) -> str:
    """Return the docstring of a formula as one paragraph that does not begin with "Return"."""
    doc = inspect.getdoc(getattr(function, "func", function)) or ""
    text = " ".join(doc.split("\n\nRaises\n")[0].split())
    for verb in ("Return ", "Bound "):
        text = text.removeprefix(verb)
    text = text[:1].upper() + text[1:]
    return text if text.endswith(".") else text + "."


def bounds_of(kind: type[Node]) -> str:
    """Return sentences on the box and the bounds of a class."""
    if issubclass(kind, ConvolutionPrimitive):
        return str(TEXTS["convolution_bounds"])
    if issubclass(kind, Primitive):
        return str(TEXTS["skeleton_bounds"])
    if issubclass(kind, Combination):
        row = kind.operator
        return f"{BOXES[row.support]} Range: {sentence(row.range)} Slope: {sentence(row.slope)}"
    if warp := getattr(kind, "warp", None):
        bound = kind._formulas["lipschitz"].function if kind._formulas else warp.lipschitz
        box = sentence(kind.outer_box or warp.box)
        return f"Box: {box} {TEXTS['warp_bounds'].strip()} {sentence(bound)}"
    assert issubclass(kind, Macro), kind
    return f"They are those of the tree for which `{kind.__name__}` stands."


def parameters_table(kind: type[Node]) -> list[str]:
    """Return the rows of a table of operands and parameters."""
    declared = parameters_of(kind)
    lines = ["| Parameter | Meaning |", "|---|---|"]
    for field in fields_of(kind):
        if OPTIONAL in field.metadata:  # the keywords of all primitives and leaves, named below
            continue
        parameter = declared.get(field.name)
        text = "Node" if parameter is None else describe(parameter)
        if parameter is None and field.name == "operands":
            text = "Nodes"
        lines.append(f"| `{field.name}` | {text.replace('|', '&#124;')} |")
    if issubclass(kind, Profile):
        lines.append(
            "| `falloff`, `width`, `weight` | [How the field falls off](../modelling.md#primitives). |"
        )
    if "color" in declared:
        link = "../modelling.md#attributes-and-rest-coordinates"
        lines.append(f"| `attributes` | [Numbers, vectors and labels by name]({link}). |")
    return lines


def page(name: str, sample: dict[str, Any]) -> str:
    """Return the page of a class."""
    kind = CLASSES[name]
    doc = inspect.getdoc(kind) or ""
    description = (
        doc.split("\nParameters\n---")[0].split("\nRaises\n---")[0].split("\nExamples\n---")[0].strip()
    )
    lines = [
        f"# {name}",
        "",
        description,
        "",
        f"![{name}](../images/nodes/{kind.file_tag}.jpg)",
        "",
        f"```python\n{sample['code'].strip()}\n```",
        "",
        "## Formula",
        "",
        f"$$\n{sample['formula']}\n$$",
        "",
        "## Parameters",
        "",
        *parameters_table(kind),
        "",
        f"Errors and an example: {{py:class}}`blobtree.{name}`.",
        "",
        "## Bounds",
        "",
        sample.get("bounds") or bounds_of(kind),
        "",
        "## References",
        "",
        *(f"* {REFERENCES[key]}" for key in sample["references"]),
    ]
    return "\n".join(lines) + "\n"


def index() -> str:
    """Return the page that shows all classes."""
    lines = ["# Nodes", "", TEXTS["notation"].strip(), ""]
    for family, nodes in SAMPLES.items():
        cells = [
            f"[![{n}](../images/nodes/{CLASSES[n].file_tag}.jpg)]({CLASSES[n].file_tag}.md)" for n in nodes
        ]
        names = [f"[{n}]({CLASSES[n].file_tag}.md)" for n in nodes]
        lines += [f"## {family}", "", *table(cells, names), ""]
    pages = [CLASSES[name].file_tag for nodes in SAMPLES.values() for name in nodes]
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *pages, "```", ""])


def table(cells: list[str], names: list[str], columns: int = 4) -> list[str]:
    """Return a table of pictures above their names."""
    rows = []
    for start in range(0, len(cells), columns):
        for values in (cells, names):
            row = values[start : start + columns]
            rows.append("| " + " | ".join(row + [""] * (columns - len(row))) + " |")
    return ["|" + " |" * columns, "|" + "---|" * columns, *rows]


def write(folder: Path) -> None:
    """Write all pages into a folder and remove obsolete ones; unchanged files stay untouched."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        CLASSES[name].file_tag: page(name, sample)
        for nodes in SAMPLES.values()
        for name, sample in nodes.items()
    } | {"index": index()}
    for path in folder.glob("*.md"):
        if path.stem not in pages:
            path.unlink()
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
