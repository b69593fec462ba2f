"""The page on architecture names every room, and every file of the rooms whose files it lists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "architecture.md"


def rows(package: str) -> dict[str, set[str]]:
    """Files by room, as the table of a package has them."""
    section = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (table,) = (part for part in section if part.startswith(f"{package}:"))
    found: dict[str, set[str]] = {}
    room = ""
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|") or cells[0] in ("room", "---"):
            continue
        room = cells[0].strip("`") or room
        found.setdefault(room, set()).update(re.findall(r"`(\w+)`", cells[1]))
    return found


@pytest.mark.parametrize("package", ["blobtree", "decals", "apps"])
def test_rooms_and_their_files_are_named(package: str) -> None:
    named = rows(package)
    folders = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert named.keys() - {"(top)"} == folders
    for room in named:
        folder = ROOT / package / ("" if room == "(top)" else room)
        files = {path.stem for path in folder.glob("*.py")} - {"__init__", "errors"}
        assert named[room] - {"errors"} in (files, set()), room
