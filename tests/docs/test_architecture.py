"""Every path that the architecture page or the contributing guide names exists; every package is named."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "docs" / "architecture.md", ROOT / "CONTRIBUTING.md"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_paths_on_the_page_exist(page: Path) -> None:
    code = re.findall(r"`([^`\n]+)`", page.read_text(encoding="utf-8"))
    paths = [
        text for text in code if re.fullmatch(r"(?:blobtree|decals|apps|shaders|tests|docs)/[\w./-]+", text)
    ]
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_the_contributing_guide_names_what_its_files_have() -> None:
    text = PAGES[1].read_text(encoding="utf-8")
    pairs = re.findall(r"`(\w+)` (?:in|of) `(\w+/[\w./]+\.\w+)`", text)
    assert len(pairs) > 12
    assert [
        pair
        for pair in pairs
        if not re.search(rf"\b{pair[0]}\b", (ROOT / pair[1]).read_text(encoding="utf-8"))
    ] == []


def test_every_package_is_named() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    packages = [
        f"{root}/{path.parent.name}"
        for root in ("blobtree", "decals", "apps")
        for path in (ROOT / root).glob("*/__init__.py")
    ]
    assert len(packages) > 20
    assert [package for package in packages if f"`{package}`" not in text] == []
