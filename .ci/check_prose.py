"""Find words and docstrings that the style rules of CONTRIBUTING.md exclude.

Run it as ``check_prose.py`` to fail on the first finding, or as ``check_prose.py --report`` to list and pass.
"""

import argparse
import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SUFFIXES = {
    ".py",
    ".pyi",
    ".md",
    ".rst",
    ".glsl",
    ".vert",
    ".frag",
    ".comp",
    ".toml",
    ".yml",
    ".yaml",
    ".cff",
    ".sh",
}
NAMES = {"Makefile", "run", "apt-install", "install-gl", "make-venv"}
INDEFINITE_PERSON = re.compile(r"\b(?:some|no|every)body\b|\bwho(?:so)?ever\b", re.IGNORECASE)
UNNAMED = re.compile(
    r"\b(?:none|ones?) such\b(?! as)|\bsuch a one\b|\bthe (?:latter|former ones?)\b", re.IGNORECASE
)
QUOTED = re.compile(r"`[^`]*`")


def source_files() -> list[Path]:
    """Return every tracked or new file of code, documentation or configuration."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [ROOT / name for name in listing.splitlines()]
    return [path for path in paths if (path.suffix in SUFFIXES or path.name in NAMES) and path.is_file()]


def indefinite_persons(path: Path, text: str) -> Iterator[str]:
    """Yield a message for each indefinite person; Markdown may quote the words as code."""
    for number, line in enumerate(text.splitlines(), 1):
        prose = QUOTED.sub("", line) if path.suffix in {".md", ".rst"} else line
        for match in INDEFINITE_PERSON.finditer(prose):
            yield f"{path.relative_to(ROOT)}:{number}: {match.group()!r}; name the subject"


def unnamed_things(path: Path, text: str) -> Iterator[str]:
    """Yield a message for each word that stands for a noun of another sentence."""
    for number, line in enumerate(text.splitlines(), 1):
        prose = QUOTED.sub("", line) if path.suffix in {".md", ".rst"} else line
        for match in UNNAMED.finditer(prose):
            yield f"{path.relative_to(ROOT)}:{number}: {match.group()!r}; repeat the noun"


def whether_docstrings(path: Path, text: str) -> Iterator[str]:
    """Yield a message for each docstring, of an attribute too, that begins with "Whether"."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            value = node.value.value
            if isinstance(value, str) and value.lstrip().startswith("Whether"):
                yield f'{path.relative_to(ROOT)}:{node.lineno}: "Whether ..."; write "Return True if ..."'


def findings() -> list[str]:
    """Return one message per finding in the whole checkout."""
    messages = []
    for path in source_files():
        text = path.read_text(encoding="utf-8")
        messages += indefinite_persons(path, text)
        messages += unnamed_things(path, text)
        if path.suffix in {".py", ".pyi"}:
            messages += whether_docstrings(path, text)
    return messages


def main() -> None:
    """Print the findings; exit with 1 if there are any and this is no report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--report", action="store_true", help="list the findings and exit with 0")
    report = parser.parse_args().report
    messages = findings()
    print("\n".join([*messages, f"{len(messages)} findings in prose"]))
    sys.exit(bool(messages) and not report)


if __name__ == "__main__":
    main()
