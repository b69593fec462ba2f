"""Draw the pictures of docs/comparison.md: ``python docs/draw_comparison.py``, in the root of the project."""

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

from tests.bench import paper_methods, peer_pictures  # noqa: E402


def main() -> None:
    """Draw decals by the paper's methods, and by other methods."""
    target = DOCS / "images" / "comparison"
    target.mkdir(parents=True, exist_ok=True)
    paper_methods.draw().save(target / "methods.jpg", quality=88)
    peer_pictures.draw().save(target / "peers.jpg", quality=88)


if __name__ == "__main__":
    main()
