"""Tables of measured figures name the command that gives them, and the device."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = ("performance", "theory", "comparison", "contact-modes", "shipped-experiments")

COMMAND = re.compile(r'python (-[mc] "?)?[\w./]+|implicit-decals [a-z]|pytest ')
DEVICE = re.compile(r"\b(two|16|quiet|busy)[\w ]* cores|\bH[12]00\b|llvmpipe|Chromium|SwiftShader")
NUMBER = re.compile(r"[\d.,]+(e-?\d+)?( ?(%|s|ms|µs|ns|MB|KB|GB|dB))?$")


def measured_tables(text: str) -> Iterator[tuple[str, str]]:
    """Yield tables in which more than a third of the rows have numbers, and all that is said about each.

    That is the text of its section up to its end, and the text below each heading above, up to the next one.
    """
    heads: list[tuple[int, str]] = []
    table: list[str] = []
    for line in [*text.splitlines(), ""]:
        if heading := re.match(r"(#+) ", line):
            level = len(heading[1])
            heads = [(depth, said) for depth, said in heads if depth < level]
            heads.append((level, line + "\n"))
        elif heads:
            depth, said = heads[-1]
            heads[-1] = (depth, said + line + "\n")
        if line.startswith("|"):
            table.append(line)
        elif table:
            if sum(map(is_measured, table[2:])) > len(table[2:]) / 3:
                yield "\n".join(table), "".join(said for _, said in heads)
            table = []


def is_measured(row: str) -> bool:
    return any(NUMBER.match(cell.strip()) for cell in row.strip("|").split("|")[1:])


@pytest.mark.parametrize("page", PAGES)
def test_every_table_names_its_command_and_device(page: str) -> None:
    unnamed = []
    for table, said in measured_tables((DOCS / f"{page}.md").read_text(encoding="utf-8")):
        for what, pattern in (("command", COMMAND), ("device", DEVICE)):
            if not pattern.search(said):
                unnamed.append(f"{what}: {table.splitlines()[0]}")
    assert unnamed == []


def test_a_table_without_a_command_is_found() -> None:
    table = "| x | ms |\n|---|---|\n| a | 1.5 |\n"
    text = f"# Page\n\non an H100\n\n## One\n\n    python -m tests.bench.x\n\n{table}\n## Two\n\n{table}"
    first, second = (said for _, said in measured_tables(text))
    assert COMMAND.search(first)
    assert not COMMAND.search(second)
    assert DEVICE.search(first)
    assert DEVICE.search(second)
    assert list(measured_tables("# Page\n\n| rule | radius |\n|---|---|\n| a | 1.03 times b |\n")) == []
