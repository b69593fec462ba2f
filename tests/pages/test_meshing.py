"""The Python of docs/meshing.md runs as it stands, and its figures are true."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from blobtree import Point, polygonize

PAGE = Path(__file__).parents[2] / "docs" / "meshing.md"


def test_the_code_blocks_run() -> None:
    session: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL):
        exec(compile(block, PAGE.name, "exec"), session)
    assert len(session["mesh"].faces) > 1000
    assert set(np.unique(session["sharp"].meetings)) <= {0, 1, 2, 3}
    assert len(session["shown"].vertices) > len(session["sharp"].vertices)
    assert len(session["edited"].faces) > 1000
    assert session["surface"].n_points > 1000
    assert list(session["field"].keys()) == ["plane", "lines", "surface"]
    assert len(session["close"].faces) > 1000


def test_creases_spare_as_many_triangles_as_the_page_says() -> None:
    tree = Point((0, 0, 0), radius=1.0) - Point((0.8, 0.13, 0.07), radius=0.9)
    plain, sharp = (len(polygonize(tree, chord_error=0.01, creases=c).faces) for c in (False, True))
    text = PAGE.read_text(encoding="utf-8").replace(",", "")
    assert all(f"{count} " in text for count in (plain, sharp)), (plain, sharp)
