"""Draw the picture of docs/comparison.md: ``python docs/draw_comparison.py``, in the root of the project."""

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

from tests.bench.paper_methods import draw  # noqa: E402


def main() -> None:
    """Draw decals by vertices and by the fragment shader."""
    target = DOCS / "images" / "comparison"
    target.mkdir(parents=True, exist_ok=True)
    draw().save(target / "methods.jpg", quality=88)


if __name__ == "__main__":
    main()
