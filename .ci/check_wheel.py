"""Build the wheel, look into it, and use it from an environment and a folder outside the checkout."""

import os
import subprocess
import sys
import sysconfig
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("blobtree", "decals", "decals.apps", "decals.shaders")
COMMANDS = (
    ["--help"],
    ["bench", "table", "--models", "knot,spheres", "--counts", "100", "--size", "160x120"],
)
"""Commands that an installed wheel must run without the checkout."""
IMPORT_ALL = """
import importlib, pathlib, pkgutil, sys
for package in map(importlib.import_module, sys.argv[2:]):
    names = [found.name for found in pkgutil.walk_packages(package.__path__, package.__name__ + ".")]
    sandbox = "connections", "guard", "page", "panels", "sessions", "view"
    browser = "lab.page", *(f"sandbox.{name}" for name in sandbox)
    needed = [name for name in names if not name.endswith(browser)]  # those need the extra `browser`
    for module in [package, *map(importlib.import_module, needed)]:
        file = pathlib.Path(module.__file__).resolve()
        assert file.is_relative_to(sys.argv[1]), f"{module.__name__} comes from {file}, not from the wheel"
"""

PATTERNS = (
    *("*.py", "*.glsl", "*.vert", "*.frag", "*.comp", "*.css", "*.html", "*.js"),
    *("lessons/*", "thumbnails/*"),
)
"""Files of the packages that the wheel holds."""

FIRST_MESH = """
import blobtree, blobtree.kernels
ball = blobtree.Point((0, 0, 0), radius=1.0)
for tree in (ball, blobtree.GradientBlend(ball, ball.translate((1, 0, 0)), start_angle=15, full_angle=75)):
    blobtree.polygonize(tree, resolution=8)
assert not blobtree.kernels._state.compiled, "kernels were compiled that the wheel should hold"
"""
MAX_BYTES = 30_000_000


def build(folder: Path) -> Path:
    """Compile the kernels, then build the sdist, and the wheel from it: nothing left over can slip in."""
    subprocess.run([sys.executable, ROOT / ".ci" / "compile_kernels.py"], check=True)
    command = [sys.executable, "-m", "build", "--outdir", folder, ROOT]
    built = subprocess.run(command, check=False, capture_output=True, text=True)
    output = f"{built.stdout}{built.stderr}"
    if built.returncode:
        sys.exit(f"{output}the wheel could not be built")
    if "is absent from the `packages` configuration" in output:
        sys.exit(f"{output}setuptools warns of folders: see packages and package-data in pyproject.toml")
    (wheel,) = folder.glob("*.whl")
    return wheel


def expected_files() -> set[str]:
    """Name every file of the four packages as the wheel should hold it."""
    files = set()
    for package in PACKAGES:
        folder = ROOT / {"decals.apps": "apps", "decals.shaders": "shaders"}.get(package, package)
        inside = package.replace(".", "/")
        found = [path for pattern in PATTERNS for path in folder.rglob(pattern)]
        files.update(f"{inside}/{p.relative_to(folder).as_posix()}" for p in [*found, folder / "py.typed"])
    return files


def check_content(wheel: Path) -> None:
    """Refuse a wheel that lacks one of our files, or that takes a name it should leave to others."""
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    missing = sorted(expected_files() - names)
    if missing:
        sys.exit(f"the wheel lacks {', '.join(missing)}: see packages and package-data in pyproject.toml")
    if (size := wheel.stat().st_size) > MAX_BYTES:
        sys.exit(f"the wheel has {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:.0f} MB")
    tops = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    if tops != {"blobtree", "decals"}:
        sys.exit(f"the wheel has {sorted(tops)} at its top level")


def check_use(wheel: Path, folder: Path) -> None:
    """Import every module from the installed wheel, make a mesh, and run commands outside the checkout."""
    home = folder / "venv"
    venv.create(home, symlinks=os.name != "nt")
    paths = sysconfig.get_paths(vars={"base": str(home), "platbase": str(home)})
    site, scripts = Path(paths["purelib"]), Path(paths["scripts"])
    # The dependencies come from this environment; its own editable copy of us does not, as a path
    # that a .pth file names has its .pth files ignored.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    python = scripts / "python"
    install = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
    ]
    subprocess.run([*install, wheel], check=True)
    subprocess.run([python, "-c", IMPORT_ALL, site.resolve(), *PACKAGES], check=True, cwd=folder)
    fresh = os.environ | {"WARP_CACHE_PATH": str(folder / "kernels")}
    subprocess.run([python, "-c", FIRST_MESH], check=True, cwd=folder, env=fresh)
    for arguments in COMMANDS:
        command = [scripts / "implicit-decals", *arguments]
        subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)


def main() -> None:
    """Build and check the wheel."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel = build(folder / "dist")
        check_content(wheel)
        check_use(wheel, folder)
    print(f"{wheel.name}: complete, and works outside the checkout")


if __name__ == "__main__":
    main()
