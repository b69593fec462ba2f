"""How long commands and scripts of the documentation print nothing, at most, without compiled kernels.

Each runs as a person would run it: in a terminal, in a fresh process, with an empty kernel cache and an empty
shader cache of the graphics driver. The silence counts from the start to the first output, between outputs,
and from the last output to the end. Commands that open a window, or download a model, are left out.

    python -m tests.bench.silence
    python -m tests.bench.silence --only README --compile
"""

import argparse
import compileall
import os
import pty
import re
import select
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

LEFT_OUT = ("edit", "sandbox", "--install-completion", "dragon", "--all", "--define", "--trust", "bench")
"""Words of commands that need a window or a browser, change the home folder, download models, or repeat
others."""

SILENCING = re.compile(r"setLevel\(logging.WARNING\)|displayed\(")
"""Code that turns the output off on purpose, or shows it itself; pages explain how."""

COMPILE = "import pathlib, blobtree.kernels; blobtree.kernels.SHIPPED = pathlib.Path('nowhere')\n"
"""Start of a process that takes no kernels compiled ahead of time."""

COMMAND = "import sys; from decals.apps.cli import main; sys.argv[1:] = {words!r}; main()"
INPUTS = """
import decals, pyvista
from blobtree import Point, save
part = Point((0, 0, 0), radius=1.0) - Point((0.8, 0, 0), radius=0.9)
scene = decals.cover(part, count=100)
scene.save("scene.json")
for name in ("part.json", "blob.json"):
    save(part, name)
pyvista.Sphere().save("bunny.ply")
"""
"""Makes the files that commands on the pages read."""

COLUMNS = "110"


@dataclass(frozen=True)
class Run:
    """A process whose output was watched.

    Attributes
    ----------
    silence
        Longest time without output, in seconds.
    seconds
        Duration of the process.
    before
        Last line before the silence.
    code
        Exit code.
    output
        Everything that was printed.
    """

    silence: float
    seconds: float
    before: str
    code: int
    output: str


def watch(script: str, folder: Path, environment: Mapping[str, str]) -> Run:
    """Run a Python script in a terminal, and measure its longest silence."""
    file = folder / "silent_script.py"
    file.write_text(script, encoding="utf-8")
    here, there = pty.openpty()
    start = last = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, str(file)],
        cwd=folder,
        env=dict(environment) | {"COLUMNS": COLUMNS, "TERM": "xterm"},
        stdin=subprocess.DEVNULL,
        stdout=there,
        stderr=there,
    )
    os.close(there)
    output, silence, before = b"", 0.0, ""
    while True:
        ready, _, _ = select.select([here], [], [], 0.05)
        try:
            text = os.read(here, 1 << 16) if ready else None
        except OSError:  # Linux reports the end of a terminal as an error
            text = b""
        if text is None:
            continue
        now = time.perf_counter()
        if now - last > silence:
            silence, before = now - last, _last_line(output)
        last, output = now, output + text
        if not text:
            break
    os.close(here)
    code = process.wait()
    return Run(silence, time.perf_counter() - start, before, code, output.decode(errors="replace"))


def _last_line(output: bytes) -> str:
    """Return the last printed line without the codes that move the cursor."""
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", output.decode(errors="replace"))
    lines = [line.strip() for line in re.split(r"[\r\n]+", text) if line.strip()]
    return lines[-1] if lines else ""


def page_scripts() -> dict[str, str]:
    """Return the Python code of each page as one script, by the page's name."""
    scripts = {}
    for page in PAGES:
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        if blocks:
            scripts[page.name] = "\n\n".join(block for block in blocks if not SILENCING.search(block))
    return scripts


def page_commands() -> list[str]:
    """Return the commands on all pages that can be measured, each once."""
    lines = [
        line.partition(" #")[0].strip()
        for page in PAGES
        for line in re.findall(r"^implicit-decals .+", page.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    return [line for line in dict.fromkeys(lines) if not set(shlex.split(line)) & set(LEFT_OUT)]


def user_environment() -> dict[str, str]:
    """Return variables for a process that finds this checkout, and its bytecode as an installation leaves it.

    Bytecode is compiled here and kept, also where the variable of Python says otherwise.
    """
    for package in ("blobtree", "decals", "apps", "shaders"):
        compileall.compile_dir(ROOT / package, quiet=2)
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def cold_environment(folder: Path) -> dict[str, str]:
    """Return variables for a process that finds no compiled kernels and shaders of earlier processes."""
    return user_environment() | {
        "WARP_CACHE_PATH": str(folder / "kernels"),
        "MESA_SHADER_CACHE_DIR": str(folder / "shaders"),
        "__GL_SHADER_DISK_CACHE_PATH": str(folder / "shaders"),
        "PYVISTA_OFF_SCREEN": "true",
    }


def cold_runs(start: str, only: Sequence[str] = ()) -> Iterator[tuple[str, Run]]:
    """Run all scripts and commands whose names contain one of some words, and yield each result.

    Parameters
    ----------
    start
        Python code at the beginning of each process.
    only
        The words; none for everything.
    """
    scripts = page_scripts()
    for line in page_commands():
        scripts[line] = COMMAND.format(words=shlex.split(line)[1:])
    with tempfile.TemporaryDirectory() as name:
        inputs = Path(name)
        made = watch(INPUTS, inputs, user_environment())
        assert made.code == 0, made.output
        for name, script in scripts.items():
            if only and not any(word in name for word in only):
                continue
            with tempfile.TemporaryDirectory() as cold:
                folder = Path(cold)
                for file in inputs.iterdir():
                    (folder / file.name).write_bytes(file.read_bytes())
                yield name, watch(start + script, folder, cold_environment(folder))


def main() -> None:
    """Print a table of the longest silences."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--compile", action="store_true", help="do not take kernels compiled ahead of time")
    parser.add_argument("--only", nargs="*", default=(), help="words in names of pages and commands")
    arguments = parser.parse_args()
    for name, run in cold_runs(COMPILE if arguments.compile else "", arguments.only):
        failed = f"  EXIT CODE {run.code}" if run.code else ""
        print(f"{run.silence:6.1f} of {run.seconds:6.1f} s  {name}  after {run.before!r}{failed}", flush=True)


if __name__ == "__main__":
    main()
