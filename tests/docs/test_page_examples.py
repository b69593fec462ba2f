"""Pages that the documentation embeds are written when it is built."""

import re
from pathlib import Path

import pytest

from tests.docs.test_node_pages import DOCS, module

FRAME = re.compile(r'^```\{raw\} html\n<iframe src="([^"#]+)" title="[^"]+"', re.MULTILINE)


@pytest.mark.slow
def test_all_embedded_pages_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module("page_examples", monkeypatch).write(tmp_path / "extra")
    written = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "extra").iterdir()}
    shown = [name for path in DOCS.glob("*.md") for name in FRAME.findall(path.read_text(encoding="utf-8"))]
    assert sorted(shown) == sorted(written)
    assert all(text.startswith("<!doctype html>") for text in written.values())
