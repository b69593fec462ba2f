"""Command lines of benchmarks: their common options, and figures as a table and as JSON."""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def bench_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """Return the parser of ``python -m tests.bench.NAME``, with the option ``--json``."""
    parser = argparse.ArgumentParser(
        prog=f"python -m tests.bench.{name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", type=Path, help="also write one flat object {figure: number}")
    return parser


def show(figures: Mapping[str, float]) -> None:
    """Print figures as a table."""
    for name, number in figures.items():
        print(f"  {name:28} {number:12.6g}", flush=True)


def write(path: Path | None, figures: Mapping[str, Any]) -> None:
    """Write figures as JSON, if a file is given."""
    if path is not None:
        path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
