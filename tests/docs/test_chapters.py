"""The book of docs/architecture.md: each core file has one place in it, and what a chapter names exists."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.chapters import BOOK, ROOT, chapter_pages, chapters_of, places_of, title_of, trusted_places

IDENTIFIER = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")


@cache
def names_of(path: Path) -> frozenset[str]:
    """Return what a Python file defines: functions, classes, parameters, fields and constants."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name):
                names.add(name)
            case ast.Name(id=name, ctx=ast.Store()):
                names.add(name)
    return frozenset(names)


def names_in(paths: list[Path]) -> set[str]:
    return set().union(*map(names_of, paths))


def files_at(place: str) -> list[Path]:
    path = ROOT / place
    return sorted(path.glob("*.py")) if path.is_dir() else [path]


def test_each_core_file_has_one_place() -> None:
    places = chapters_of()
    assert len(places) > 200
    wrong = {file: names for file, names in places.items() if len(names) != 1}
    assert wrong == {}, "name each file in the table of one chapter, or in the list of docs/architecture.md"


def test_places_are_core_files_or_folders() -> None:
    known = set(chapters_of()) | {file.rpartition("/")[0] for file in chapters_of()}
    listed = [place for page in chapter_pages() for place in places_of(page)] + trusted_places()
    assert [place for place in listed if place not in known] == []
    assert len(listed) == len(set(listed))


@pytest.mark.parametrize("page", chapter_pages(), ids=lambda page: page.stem)
def test_rows_name_what_their_files_define(page: Path) -> None:
    rows = [
        line.split("|")[1:3]
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")
    ]
    assert len(rows) >= 5
    for places, opened in rows:
        paths = [path for place in re.findall(r"`([^`]+)`", places) for path in files_at(place)]
        assert set(re.findall(r"`([^`]+)`", opened)) <= names_in(paths), places


@pytest.mark.parametrize("page", chapter_pages(), ids=lambda page: page.stem)
def test_names_and_paths_on_a_page_exist(page: Path) -> None:
    """Names are those of this chapter's files or of files of earlier ones; the page stays short."""
    text = page.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    earlier = [each for each in chapter_pages() if chapter_pages().index(each) <= chapter_pages().index(page)]
    code = set(re.findall(r"`([^`\n]+)`", text))
    paths = {each for each in code if "/" in each and re.fullmatch(r"[\w./-]+", each)}
    assert [path for path in sorted(paths) if not (ROOT / path).exists()] == []
    mentioned = [path for each in sorted(paths) for path in files_at(each) if path.suffix == ".py"]
    mentioned += [path for each in earlier for place in places_of(each) for path in files_at(place)]
    shaders = "\n".join(
        (ROOT / each).read_text(encoding="utf-8") for each in sorted(paths) if "shaders/" in each
    )
    defined = names_in(mentioned) | set(re.findall(r"\w+", shaders))
    names = {part for each in code if IDENTIFIER.fullmatch(each) for part in each.split(".")}
    assert sorted(names - defined) == []


def test_the_book_links_each_chapter_in_order() -> None:
    text = BOOK.read_text(encoding="utf-8")
    links = re.findall(r"\| \[([^\]]+)\]\(architecture/([\w-]+)\.md\)", text)
    assert links == [(title_of(page), page.stem) for page in chapter_pages()]
    assert [int(title.partition(".")[0]) for title, _ in links] == list(range(1, len(links) + 1))
    assert re.findall(r"^architecture/([\w-]+)$", text, re.MULTILINE) == [stem for _, stem in links]
