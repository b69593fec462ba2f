"""Every class of nodes has a page with a sample, a picture, a formula, bounds and references."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from blobtree import Node
from blobtree.nodes.kinds import NODE_KINDS

DOCS = Path(__file__).parents[2] / "docs"


def module(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a script of the folder docs as a module."""
    monkeypatch.syspath_prepend(DOCS)
    return import_module(name)


def kinds_in(node: Node) -> set[type[Node]]:
    """Return the classes in a tree."""
    return {type(node)}.union(*map(kinds_in, node.children))


def test_every_class_has_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pages = module("node_pages", monkeypatch)
    (tmp_path / "obsolete.md").write_text("", encoding="utf-8")
    pages.write(tmp_path)
    assert {path.stem for path in tmp_path.glob("*.md")} == {*NODE_KINDS, "index"}
    for tag, kind in NODE_KINDS.items():
        text = (tmp_path / f"{tag}.md").read_text(encoding="utf-8")
        headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
        assert headings == [kind.__name__, "Formula", "Parameters", "Bounds", "References"]
        sections = text.split("\n## ")
        assert all(len(section.splitlines()) > 2 for section in sections), tag
        assert re.search(r"\b(19|20)\d\d\b", sections[-1]), f"{tag}: no year in its references"
        with Image.open(DOCS / "images" / "nodes" / f"{tag}.jpg") as picture:
            assert picture.width in (180, 360)
            assert picture.height == 150
        assert (DOCS / "images" / "nodes" / f"{tag}.jpg").stat().st_size <= 8192


def test_every_sample_shows_its_class(monkeypatch: pytest.MonkeyPatch) -> None:
    samples = module("node_pages", monkeypatch).SAMPLES
    tree_of = module("draw_nodes", monkeypatch).sample_tree
    for nodes in samples.values():
        for name, sample in nodes.items():
            assert name in {kind.__name__ for kind in kinds_in(tree_of(sample["code"]))}


def test_every_reference_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    pages = module("node_pages", monkeypatch)
    used = {
        key for nodes in pages.SAMPLES.values() for sample in nodes.values() for key in sample["references"]
    }
    assert used == set(pages.REFERENCES)
