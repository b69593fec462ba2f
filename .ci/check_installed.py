"""Check an installed copy of the package, by the Python that has it and outside of the checkout.

    python check_installed.py [--kernels] [--drawing]

It needs nothing but the installed package: a job without the checkout can run it.
"""

import argparse
import importlib
import os
import pkgutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

PACKAGES = ("blobtree", "decals", "decals.apps", "decals.shaders")
PARTS_OF_SANDBOX = ("connections", "guard", "page", "panels", "sessions", "view")
OF_BROWSER = ("lab.page", "lesson_pages.classroom", *(f"sandbox.{name}" for name in PARTS_OF_SANDBOX))
"""Modules that need the extra `browser`."""

PICTURES = ("hero.png", "contact.png", "span.png")
"""Pictures that the command `demo` draws."""


def module_names() -> Iterator[str]:
    """Yield all modules of the packages that need no extra."""
    for package in map(importlib.import_module, PACKAGES):
        yield package.__name__
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not found.name.endswith(OF_BROWSER):
                yield found.name


def check_imports() -> None:
    """Import every module, and refuse one that comes from elsewhere than the environment."""
    site = Path(sysconfig.get_path("purelib")).resolve()
    for name in module_names():
        file = Path(importlib.import_module(name).__file__ or "").resolve()
        if not file.is_relative_to(site):
            sys.exit(f"{name} comes from {file}, not from {site}")
    import decals

    if decals.__version__ != version("implicit-decals"):
        sys.exit(f"decals has version {decals.__version__}, the package {version('implicit-decals')}")


def check_mesh(*, kernels: bool) -> None:
    """Make meshes, with no kernel to compile if the package should hold them."""
    import blobtree
    import blobtree.kernels

    ball = blobtree.Point((0, 0, 0), radius=1.0)
    blend = blobtree.GradientBlend(ball, ball.translate((1, 0, 0)), start_angle=15, full_angle=75)
    for tree in (ball, blend):
        blobtree.polygonize(tree, resolution=8)
    if kernels and blobtree.kernels._state.compiled:
        sys.exit("kernels were compiled that the wheel should hold")


def run(folder: Path, *arguments: str) -> None:
    """Run the command `implicit-decals` in a folder."""
    scripts = Path(sysconfig.get_path("scripts"))
    print("implicit-decals", *arguments, flush=True)
    subprocess.run([scripts / "implicit-decals", *arguments], check=True, cwd=folder)


def check_commands(folder: Path, *, drawing: bool) -> None:
    """Run commands, and draw pictures if the machine can."""
    run(folder, "--version")
    if not drawing:
        return
    run(folder, "doctor")
    run(folder, "demo", "--size", "160x120", "--samples", "1")
    for picture in PICTURES:
        if (folder / "out" / picture).stat().st_size < 1000:
            sys.exit(f"demo drew nothing in {picture}")
    table = ("--models", "knot,spheres", "--counts", "100", "--size", "160x120")
    run(folder, "bench", "table", *table)


def main() -> None:
    """Check the installed copy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kernels", action="store_true", help="the wheel should hold compiled kernels")
    parser.add_argument("--drawing", action="store_true", help="the machine has OpenGL")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        os.environ["WARP_CACHE_PATH"] = str(Path(name) / "kernels")
        check_imports()
        check_mesh(kernels=given.kernels)
        check_commands(Path(name), drawing=given.drawing)
    print(f"implicit-decals {version('implicit-decals')}: works outside the checkout")


if __name__ == "__main__":
    main()
