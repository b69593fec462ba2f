"""The code of docs/pyvista.md that wants optional packages, by the word behind "python"."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "pyvista.md"


def code(word: str) -> str:
    """The one block of a kind."""
    block: str
    (block,) = re.findall(rf"```python {word}\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    return block
