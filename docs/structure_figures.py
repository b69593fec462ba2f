"""Write the figures of the structure into docs/architecture.md: ``python docs/structure_figures.py``.

``--print`` prints the values alone, and ``--json`` prints further ones as JSON. Needs a checkout
with its tests, and OpenGL for the files of a drag.
"""

import argparse
import ast
import io
import json
import re
import statistics
import sys
import tempfile
import threading
import tokenize
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("blobtree", "decals", "apps")
BEFORE = {
    "Python product files": "324",
    "lines in them": "34,929",
    "median lines of a file": "88",
    "import cycles between modules": "5",
    "files in the largest cycle": "35",
    "files whose functions run from click to pixel of a drag": "78",
}
"""Values before the packages were laid out along the pipeline."""

CODE_LINES_BEFORE = 67053
"""Lines of code of the product before kinds of nodes became single declarations."""


def product_files(root: Path) -> list[Path]:
    """Return the Python files of the product."""
    return sorted(path for package in PACKAGES for path in (root / package).rglob("*.py"))


def lines_of(path: Path) -> int:
    """Return the number of lines of a file."""
    return len(path.read_text(encoding="utf-8").splitlines())


def code_lines(path: Path) -> int:
    """Return the number of lines of a file without comments, docstrings and blank lines."""
    text = path.read_text(encoding="utf-8")
    layout = (
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in layout:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                lines.difference_update(range(node.lineno, (node.end_lineno or 0) + 1))
    return len(lines)


@contextmanager
def recorded_files(files: set[str]) -> Iterator[None]:
    """Within a ``with`` block, add the product files whose functions run, in any thread."""
    folders = tuple(f"{ROOT}/{package}/" for package in PACKAGES)

    def record(frame: FrameType, event: str, _argument: Any) -> None:
        name = str(Path(frame.f_code.co_filename).resolve()) if event == "call" else ""
        if name.startswith(folders):
            files.add(name)

    threading.setprofile(record)
    sys.setprofile(record)
    try:
        yield
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]


def drag_files() -> set[str]:
    """Return the product files whose functions run from a mouse press on a decal to the finished frame."""
    import decals
    from blobtree import Point
    from decals.window import EditWindow

    files: set[str] = set()
    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=60, images=["scale"])
    with EditWindow(decals.editing.EditSession(scene), off_screen=True, size=(240, 180)) as window:
        window.show()
        window.frames.budget.target = 60.0  # of one size on slow machines too: a new one compiles again
        interactor = window.plotter.iren.interactor

        def send(name: str, x: int, y: int) -> None:
            interactor.SetEventInformation(x, y, 0, 0, "\0", 0, None)
            getattr(interactor, name)()

        def drag(x: int, y: int) -> None:
            send("LeftButtonPressEvent", x, y)
            send("MouseMoveEvent", x + 8, y)
            window.tick()
            window.plotter.render()
            send("LeftButtonReleaseEvent", x + 8, y)

        send("LeftButtonPressEvent", 120, 90)
        send("LeftButtonReleaseEvent", 120, 90)
        drag(120, 90)  # compiles and uploads
        with recorded_files(files):
            drag(128, 90)
    return files


def scatter_files() -> set[str]:
    """Return the product files whose functions run from a mesh file to scattered decals."""
    import decals
    from blobtree import Point

    files: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "ball.ply")
        Point((0, 0, 0), radius=1.0).to_pyvista(resolution=12).save(path)
        decals.scatter(path, count=40)  # compiles
        with recorded_files(files):
            decals.scatter(path, count=40)
    return files


def figures() -> dict[str, str]:
    """Return the figures of the page."""
    from tests.import_graph import cycles, module_graph

    lengths = [lines_of(path) for path in product_files(ROOT)]
    found = cycles(module_graph())
    return {
        "Python product files": f"{len(lengths):,}",
        "lines in them": f"{sum(lengths):,}",
        "median lines of a file": f"{statistics.median(lengths):.0f}",
        "import cycles between modules": str(len(found)),
        "files in the largest cycle": str(max(map(len, found), default=0)),
        "files whose functions run from click to pixel of a drag": str(len(drag_files())),
    }


def chapter_table() -> str:
    """Return the table of contents of the book, with files and code lines of each chapter."""
    from tests.chapters import chapter_pages, chapters_of, title_of

    sizes: dict[str, list[int]] = {}
    for file, chapters in chapters_of().items():
        for chapter in chapters:
            sizes.setdefault(chapter, []).append(code_lines(ROOT / file))
    links = {page.stem: f"[{title_of(page)}](architecture/{page.name})" for page in chapter_pages()}
    links["trust"] = "taken on trust"
    rows = [f"| {link} | {len(sizes[name])} | {sum(sizes[name]):,} |" for name, link in links.items()]
    return "\n".join(["| chapter | files | code lines |", "|---|---:|---:|", *rows])


def with_part(text: str, name: str, part: str) -> str:
    """Return a page with other text between two marks."""
    marks = rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)"
    return re.sub(marks, lambda found: f"{found[1]}{part}\n{found[2]}", text, flags=re.DOTALL)


def more_figures() -> dict[str, int]:
    """Return all figures that `--json` prints."""
    import blobtree
    from tests.core_and_extras import core_to_extras
    from tests.import_graph import cycles, module_graph

    lines = sum(map(code_lines, product_files(ROOT)))
    circles = cycles(module_graph())
    public = [getattr(blobtree, name) for name in blobtree.__all__]
    kinds = [each for each in public if isinstance(each, type) and hasattr(each, "file_tag")]
    return {
        "product_files": len(product_files(ROOT)),
        "product_code_lines": lines,
        "product_code_lines_saved": CODE_LINES_BEFORE - lines,
        "test_code_lines": sum(map(code_lines, (ROOT / "tests").rglob("*.py"))),
        "core_to_extras_imports": len(core_to_extras()),
        "import_circles": len(circles),
        "files_in_import_circles": sum(map(len, circles)),
        "public_names": len(public) - len(kinds),
        "files_of_a_drag": len(drag_files()),
        "files_of_a_scatter": len(scatter_files()),
    }


def main() -> None:
    """Print the figures, or write them into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--print", action="store_true", help="print the values and leave the page as it is")
    parser.add_argument("--json", action="store_true", help="print more values as JSON")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    if options.json:
        print(json.dumps(more_figures(), indent=1))
        return
    values = figures()
    if options.print:
        print("\n".join(f"{name}: {value}" for name, value in values.items()))
        return
    rows = [f"| {name} | {BEFORE[name]} | {value} |" for name, value in values.items()]
    table = "\n".join(["| figure | before | now |", "|---|---:|---:|", *rows])
    page = ROOT / "docs" / "architecture.md"
    text = page.read_text(encoding="utf-8")
    text = with_part(text, "figures", table)
    text = with_part(text, "chapters", chapter_table())
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
