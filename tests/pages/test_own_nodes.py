"""The Python of docs/own-nodes.md runs as it stands, as the file that a user would make of it."""

import re
import runpy
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "own-nodes.md"


def test_the_code_blocks_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "own_nodes.py").write_text("\n\n".join(blocks), encoding="utf-8")
    names = runpy.run_path("own_nodes.py", run_name="own_nodes")
    mesh = names["mesh"]
    assert len(mesh.faces) > 1000
    assert names["model"].bounds[1][0] > 1.2
    said = capsys.readouterr().out
    (shown,) = re.findall(r"print\(error\)  # (own_nodes.py:\d+: halfway: )", text)
    assert shown in said
