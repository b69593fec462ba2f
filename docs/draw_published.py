"""Draw the pictures of docs/published-nodes.md from the code on that page.

``python docs/draw_published.py [NAME ...]`` writes docs/images/published/NAME.jpg, all by default.
"""

import ast
import re
import sys

from pictures import DIRECTION, DOCS, code_of, draw_trees, run_code

PAGE = DOCS / "published-nodes.md"
SIZE = (360, 270)
VIEWS = {
    "weld": (0.5, -0.8, 1.0),
    "swirl": (0.3, -0.6, 1.0),
    "lattice": (0.25, -1.0, 0.35),
    "barth": (0.2, -1.0, 0.3),
    "water": (0.2, -0.3, 1.0),
}
"""Directions from the model to the camera, by picture."""


def models() -> dict[str, str]:
    """Return the variable of each picture's model, by picture: the last one that its section defines."""
    found = {}
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        (picture,) = re.findall(r"images/published/(\w+)\.jpg", section)
        (block,) = re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL)
        *_, last = ast.parse(block).body
        assert isinstance(last, ast.Assign)
        found[picture] = ast.unparse(last.targets[0])
    return found


def main() -> None:
    """Write the pictures."""
    names = run_code(code_of(PAGE))
    for picture, variable in models().items():
        if picture in sys.argv[1:] or len(sys.argv) == 1:
            path = DOCS / "images" / "published" / f"{picture}.jpg"
            direction = VIEWS.get(picture, DIRECTION)
            draw_trees(path, [names[variable]], SIZE, direction=direction, resolution=128)


if __name__ == "__main__":
    main()
