"""The chapters of docs/architecture.md: which file of the core is read in which of them."""

import re
from pathlib import Path

from tests.core_and_extras import is_extra

ROOT = Path(__file__).parents[1]
BOOK = ROOT / "docs" / "architecture.md"


def chapter_pages() -> list[Path]:
    """Return the pages in the order of reading."""
    pages = (ROOT / "docs" / "architecture").glob("*.md")
    return sorted(pages, key=lambda page: int(page.stem.partition("-")[0]))


def title_of(page: Path) -> str:
    """Return the heading of a page."""
    return page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


def core_files() -> list[str]:
    """Return the Python files of the core, relative to the checkout, without those of a package's names."""
    paths = [
        path.relative_to(ROOT)
        for package in ("blobtree", "decals", "shaders")
        for path in sorted((ROOT / package).rglob("*.py"))
    ]
    return [
        path.as_posix()
        for path in paths
        if not path.name.startswith("_") and not is_extra(".".join(path.with_suffix("").parts))
    ]


def places_of(page: Path) -> list[str]:
    """Return the files and folders in the first column of a page's tables."""
    rows = [
        line.split("|")[1] for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| `")
    ]
    return [place for row in rows for place in re.findall(r"`([^`]+)`", row)]


def trusted_places() -> list[str]:
    """Return the files and folders that the book leaves to a reader's trust."""
    text = BOOK.read_text(encoding="utf-8").partition("<!-- trust -->")[2].partition("<!-- /trust -->")[0]
    return re.findall(r"`([^`]+)`", text)


def chapters_of() -> dict[str, list[str]]:
    """Return the stems of pages, and "trust", by core files.

    A folder stands for its files that have no row of their own.
    """
    places = {page.stem: places_of(page) for page in chapter_pages()} | {"trust": trusted_places()}
    found = {}
    for file in core_files():
        own = [name for name, listed in places.items() for place in listed if place == file]
        folder = file.rpartition("/")[0]
        found[file] = own or [name for name, listed in places.items() for place in listed if place == folder]
    return found
