"""Build what a release consists of: an sdist, a wheel for any machine, and a wheel with kernels for this one.

    python .ci/build_distributions.py dist             # all three, from the checkout
    python .ci/build_distributions.py dist --plain     # those without kernels
    python .ci/build_distributions.py dist --sdist F   # the wheel with kernels, from an sdist

Both wheels are made of the sdist, so nothing left over in the checkout can slip in. A wheel without kernels
works everywhere; the kernels of the other fit one system, architecture and version of Warp.
"""

import argparse
import platform
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COMPILED = Path("blobtree") / "compiled"


def platform_tag() -> str:
    """Return the platform of wheels with kernels; that of Linux is the one of Warp's own wheels."""
    if sys.platform == "linux":
        return f"manylinux_2_28_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def run(*command: object) -> str:
    """Run a command; if it fails, show what it wrote and end."""
    done = subprocess.run(list(map(str, command)), check=False, capture_output=True, text=True)
    output = f"{done.stdout}{done.stderr}"
    if done.returncode:
        sys.exit(f"{output}{' '.join(map(str, command))} failed")
    if "is absent from the `packages` configuration" in output:
        sys.exit(f"{output}setuptools warns of folders: see packages and package-data in pyproject.toml")
    return output


def build(source: Path, kind: str, folder: Path, *options: str) -> Path:
    """Build an sdist or a wheel of a source folder."""
    with tempfile.TemporaryDirectory() as name:
        run(sys.executable, "-m", "build", f"--{kind}", "--outdir", name, *options, source)
        (built,) = Path(name).iterdir()
        return Path(shutil.move(built, folder / built.name))


def build_sdist(folder: Path) -> Path:
    """Build the sdist of the checkout, without kernels that were compiled there."""
    with tempfile.TemporaryDirectory() as name:
        kept, compiled = Path(name) / "compiled", ROOT / COMPILED
        if compiled.is_dir():
            shutil.move(compiled, kept)
        try:
            return build(ROOT, "sdist", folder)
        finally:
            if kept.is_dir():
                shutil.move(kept, compiled)


def unpacked(sdist: Path, folder: Path) -> Path:
    """Unpack an sdist and return its folder."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    (source,) = folder.iterdir()
    return source


def build_wheel(sdist: Path, folder: Path, *, kernels: bool) -> Path:
    """Build a wheel of an sdist, with compiled kernels for this machine or without."""
    with tempfile.TemporaryDirectory() as name:
        source = unpacked(sdist, Path(name))
        if not kernels:
            return build(source, "wheel", folder)
        run(sys.executable, ROOT / ".ci" / "compile_kernels.py", source)
        return build(source, "wheel", folder, f"-C--build-option=--plat-name={platform_tag()}")


def main() -> None:
    """Build the distributions into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    only = parser.add_mutually_exclusive_group()
    only.add_argument("--plain", action="store_true", help="leave out the wheel with kernels")
    only.add_argument("--sdist", type=Path, help="build the wheel with kernels of this sdist alone")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.sdist is None:
        sdist = build_sdist(given.folder)
        made = [sdist, build_wheel(sdist, given.folder, kernels=False)]
    else:
        sdist, made = given.sdist, []
    if not given.plain:
        made.append(build_wheel(sdist, given.folder, kernels=True))
    for file in made:
        print(f"{file} ({file.stat().st_size / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
