"""Run the tests with exactly the oldest dependencies that pyproject.toml allows.

It takes minutes and a download, so CI leaves it out: run it after changing a bound, or how something is used.
"""

import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def oldest(requirement: str) -> str:
    """Turn a lower bound into the version itself: ``numpy>=2.0`` into ``numpy==2.0``."""
    if not re.fullmatch(r"[\w-]+>=[\d.]+", requirement):
        sys.exit(f"expected NAME>=VERSION in pyproject.toml, got {requirement!r}")
    return requirement.replace(">=", "==")


def main() -> None:
    """Install the oldest versions beside the checkout's own code, and test that."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bounds = [oldest(requirement) for requirement in project["dependencies"]]
    print("\n".join(bounds), flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        venv.create(folder / "venv", with_pip=True, symlinks=True)
        python = folder / "venv" / "bin" / "python"
        pip = [python, "-m", "pip", "install", "--quiet", "--editable", ".[dev]", *bounds]
        subprocess.run(pip, check=True, cwd=ROOT)
        tests = [
            python,
            "-m",
            "pytest",
            "-m",
            "not slow and not gpu and not browser",
            "-p",
            "no:cacheprovider",
        ]
        environment = os.environ | {"WARP_CACHE_PATH": str(folder / "warp-cache")}
        ran = subprocess.run([*tests, *sys.argv[1:]], cwd=ROOT, env=environment, check=False)
        if ran.returncode:
            sys.exit(f"pytest ended with {ran.returncode}")


if __name__ == "__main__":
    main()
