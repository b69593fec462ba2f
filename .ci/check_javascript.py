"""Check the format and the quality of all JavaScript by prettier and eslint.

Their versions stand in ``.ci/javascript``. ``check_javascript.py`` fails on any finding, and with ``--fix``
formats the files first. Without Node.js nothing is checked, and a line says so.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TOOLS = ROOT / ".ci" / "javascript"
INSTALLED = TOOLS / "node_modules" / ".package-lock.json"
SCRIPTS = "*.js", "*.mjs"
PAGES = ("*.html",)
TEMPLATES = ("decals/pages/viewer/*.html", "apps/lesson_pages/*.html")
"""Pages whose scripts are files of their own."""


def files(patterns: tuple[str, ...], without: tuple[str, ...] = ()) -> list[str]:
    """Return tracked and new files."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *patterns]
    found = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    paths = [Path(name) for name in found if (ROOT / name).is_file()]
    return [str(path) for path in paths if not any(path.match(pattern) for pattern in without)]


def missing() -> str | None:
    """Install the tools; return what is missing for them, or None."""
    npm = shutil.which("npm")
    if shutil.which("node") is None or npm is None:
        return "Node.js is not installed"
    lock = TOOLS / "package-lock.json"
    if INSTALLED.exists() and INSTALLED.stat().st_mtime >= lock.stat().st_mtime:
        return None
    ran = subprocess.run([npm, "ci", "--silent", "--ignore-scripts"], cwd=TOOLS, check=False)
    return "npm could not install the tools" if ran.returncode else None


def main() -> int:
    """Check all files; return the exit status."""
    if reason := missing():
        print(f"JavaScript was not checked: {reason}")
        return 1 if "GITHUB_ACTIONS" in os.environ else 0
    bin_ = TOOLS / "node_modules" / ".bin"
    mode, fix = ("--write", ["--fix"]) if "--fix" in sys.argv else ("--check", [])
    scripts, pages = files(SCRIPTS), files(PAGES, TEMPLATES)
    commands = (
        [
            bin_ / "eslint",
            "--config",
            TOOLS / "eslint.config.mjs",
            "--max-warnings",
            "0",
            *fix,
            *scripts,
            *pages,
        ],
        [bin_ / "prettier", "--config", TOOLS / "prettier.json", "--log-level", "warn", mode, *scripts],
    )
    return max(subprocess.run(command, cwd=ROOT, check=False).returncode for command in commands)


if __name__ == "__main__":
    sys.exit(main())
