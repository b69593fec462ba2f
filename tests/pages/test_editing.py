"""docs/editing.md: its table is the one that the window uses, and its Python runs as it stands."""

import re
from pathlib import Path

import pytest

from decals.edit.keys import help_table
from decals.render.libraries import install_advice, missing_gl_libraries

PAGE = Path(__file__).parents[2] / "docs" / "editing.md"


def test_the_table_is_that_of_the_window() -> None:
    """To mend the page, put what `decals.edit.keys.help_table` gives between its two marks."""
    page = PAGE.read_text(encoding="utf-8")
    assert f"<!-- keys -->\n{help_table()}<!-- /keys -->" in page


def test_the_code_blocks_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = missing_gl_libraries()
    if missing:
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL):
        exec(compile(block, PAGE.name, "exec"), names)
    assert (tmp_path / "scene.json").exists()
    assert names["session"].labels == ("scale", "change", "a drag", "move a primitive")  # type: ignore[attr-defined]
    assert len(names["edited"].decals) == 100  # type: ignore[attr-defined]
    assert len(names["selected"]) == 1  # type: ignore[arg-type]
