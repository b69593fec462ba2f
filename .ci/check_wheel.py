"""Build the wheel, look into it, and use it from an environment and a folder outside the checkout."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
import zipfile
from pathlib import Path

from build_distributions import COMPILED, ROOT, build_sdist, build_wheel
from check_installed import PACKAGES

PATTERNS = (
    *("*.py", "*.glsl", "*.vert", "*.frag", "*.comp", "*.css", "*.html", "*.js", "*.mjs"),
    *("languages/*", "lessons/*", "thumbnails/*"),
)
"""Files of the packages that the wheel holds."""

MAX_BYTES = 30_000_000


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
    if not any(name.startswith(COMPILED.as_posix()) for name in names):
        sys.exit("the wheel holds no compiled kernels")
    if (size := wheel.stat().st_size) > MAX_BYTES:
        sys.exit(f"the wheel has {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:.0f} MB")
    tops = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    if tops != {"blobtree", "decals"}:
        sys.exit(f"the wheel has {sorted(tops)} at its top level")


def check_use(wheel: Path, folder: Path) -> None:
    """Install the wheel into a fresh environment, and check it outside the checkout."""
    home = folder / "venv"
    venv.create(home, symlinks=os.name != "nt")
    paths = sysconfig.get_paths(vars={"base": str(home), "platbase": str(home)})
    # The dependencies come from this environment; its own editable copy of us does not, as a path
    # that a .pth file names has its .pth files ignored.
    dependencies = Path(paths["purelib"]) / "dependencies.pth"
    dependencies.write_text(sysconfig.get_path("purelib") + "\n")
    python = Path(paths["scripts"]) / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, wheel], check=True)
    script = ROOT / ".ci" / "check_installed.py"
    subprocess.run([python, script, "--kernels", "--drawing"], check=True, cwd=folder)


def keep_kernels(wheel: Path) -> None:
    """Leave the wheel's compiled kernels in the checkout: tests of the same sources compile few others."""
    shutil.rmtree(ROOT / COMPILED, ignore_errors=True)
    with zipfile.ZipFile(wheel) as archive:
        compiled = [name for name in archive.namelist() if name.startswith(COMPILED.as_posix())]
        archive.extractall(ROOT, compiled)


def main() -> None:
    """Build and check the wheel."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel = build_wheel(build_sdist(folder), folder, kernels=True)
        check_content(wheel)
        check_use(wheel, folder)
        keep_kernels(wheel)
    print(f"{wheel.name}: complete, and works outside the checkout")


if __name__ == "__main__":
    main()
