"""Tables of measured figures name the command that gives them, and the device."""

import re
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from decals.apps.experiments import SHIPPED

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


def source_of(module: str) -> str:
    """Return the text of a benchmark and of the modules from which it imports."""
    text = Path(find_spec(module).origin).read_text(encoding="utf-8")  # type: ignore[union-attr, arg-type]
    others = re.findall(r"^from ((?:tests\.bench|decals\.apps)[\w.]*) import", text, re.MULTILINE)
    return text + "".join(map(source_of, others))


def unknown_names(text: str) -> list[str]:
    """Return the names after ``sweep`` and ``--only`` in commands that no experiment and no benchmark has."""
    sweeps = re.findall(r"implicit-decals sweep ([\w./-]+)", text)
    unknown = [name for name in sweeps if not name.startswith("-") and not name.endswith(".py")]
    unknown = [f"sweep {name}" for name in unknown if name not in SHIPPED]
    for module, options in re.findall(r"python -m (tests\.bench\.\w+)([^\n`#]*)", text):
        names = re.findall(r"--only ([\w,-]+(?: [a-z][\w,-]*)*)", options)
        source = source_of(module)
        for name in re.findall(r"[\w-]+", " ".join(names)):
            if not re.search(rf"\b{name}\b", source):
                unknown.append(f"{module} --only {name}")
    return unknown


@pytest.mark.parametrize("page", sorted(path.stem for path in DOCS.glob("*.md")))
def test_names_in_commands_exist(page: str) -> None:
    assert unknown_names((DOCS / f"{page}.md").read_text(encoding="utf-8")) == []


def test_an_unknown_name_is_found() -> None:
    text = "implicit-decals sweep blends; `python -m tests.bench.batches --only render --only opaque`"
    assert unknown_names(text) == ["tests.bench.batches --only opaque"]
    assert unknown_names("    implicit-decals sweep nothing --out x") == ["sweep nothing"]


def test_a_table_without_a_command_is_found() -> None:
    table = "| x | ms |\n|---|---|\n| a | 1.5 |\n"
    text = f"# Page\n\non an H100\n\n## One\n\n    python -m tests.bench.x\n\n{table}\n## Two\n\n{table}"
    first, second = (said for _, said in measured_tables(text))
    assert COMMAND.search(first)
    assert not COMMAND.search(second)
    assert DEVICE.search(first)
    assert DEVICE.search(second)
    assert list(measured_tables("# Page\n\n| rule | radius |\n|---|---|\n| a | 1.03 times b |\n")) == []
