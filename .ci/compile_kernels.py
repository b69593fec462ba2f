"""Compile all kernels for processors ahead of time into `blobtree/compiled`, from where the wheel takes them.

    python .ci/compile_kernels.py [FOLDER]

The folder holds the sources, by default those of the checkout.

They fit the architecture and the system of this machine. Run it right before the wheel is built: kernels
whose sources have changed since are carried along, but never loaded.
"""

import importlib
import os
import shutil
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = (".o", ".meta")

WITHOUT_GRADIENT_BLENDS = ("blobtree.derivatives.", "blobtree.meshing.crease")
"""Modules whose kernels are left out for gradient blends: they are large, or never used there."""


def kernel_files(source: Path) -> list[str]:
    """Name the Python modules that define kernels."""
    files = [file for package in ("blobtree", "decals") for file in sorted((source / package).rglob("*.py"))]
    return [
        ".".join(file.relative_to(source).with_suffix("").parts)
        for file in files
        if "\n@wp.kernel" in file.read_text(encoding="utf-8")
    ]


def compile_all(source: Path, cache: Path) -> None:
    """Compile every kernel into an empty kernel cache."""
    os.environ["WARP_CACHE_PATH"] = str(cache)
    import warp as wp

    from blobtree import GradientBlend
    from blobtree.device import start_warp
    from blobtree.tape.instruction_set import core, instruction_set_for, library

    start_warp()
    kernels = [
        value
        for name in kernel_files(source)
        for value in vars(importlib.import_module(name)).values()
        if isinstance(value, wp.Kernel) and value.module.name == name
    ]
    with_gradients = [
        instruction_set_for((*base.rows, GradientBlend.operator)) for base in (core(), library())
    ]
    instances = [library().kernel_for(kernel) for kernel in kernels]
    instances += [
        blends.kernel_for(kernel)
        for blends in with_gradients
        for kernel in kernels
        if not kernel.module.name.startswith(WITHOUT_GRADIENT_BLENDS)
    ]
    modules = list({kernel.module.name: kernel.module for kernel in (*kernels, *instances)}.values())
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        list(threads.map(lambda module: wp.load_module(module, device="cpu"), modules))


def main() -> None:
    """Replace `blobtree/compiled` by the kernels of the present sources."""
    source = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT
    sys.path.insert(0, str(source))
    target = source / "blobtree" / "compiled"
    with tempfile.TemporaryDirectory() as folder:
        compile_all(source, Path(folder))
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(folder, target, ignore=_left_out)
    files = [file for file in target.rglob("*") if file.is_file()]
    size = sum(file.stat().st_size for file in files)
    print(f"{len(files)} files, {size / 1e6:.1f} MB in {target}")


def _left_out(folder: str, names: list[str]) -> list[str]:
    return [name for name in names if (Path(folder) / name).is_file() and not name.endswith(KEPT)]


if __name__ == "__main__":
    main()
