"""The Python of docs/seeding.md runs as it stands."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "seeding.md"


def test_the_code_blocks_run(capsys) -> None:
    session: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL):
        exec(compile(block, PAGE.name, "exec"), session)
    assert len(session["decals"]) == 400
    assert len(session["spots"]) == 300
    assert (session["spots"].positions[:, 1] > -0.5).all()
    assert session["relaxation"].count == 500
    assert "rho=" in capsys.readouterr().out
