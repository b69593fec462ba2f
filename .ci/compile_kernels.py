"""Compile all kernels for processors ahead of time into `blobtree/compiled`, from where the wheel takes them.

    python .ci/compile_kernels.py [FOLDER]

The folder holds the sources, by default those of the checkout.

They fit the architecture and the system of this machine. Kernels that the kernel cache has are not compiled
again, and the others stay there. Run it right before the wheel is built: kernels whose sources have changed
since are carried along, but never loaded.
"""

import importlib
import shutil
import sys
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


def compile_all(source: Path) -> list[Path]:
    """Compile every kernel; return their folders in the kernel cache."""
    import warp as wp

    from blobtree import GradientBlend
    from blobtree.device import start_warp
    from blobtree.kernels import kernel_cache, load_together
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
    every = [*kernels, *instances]
    load_together(every, "cpu")
    names = {kernel.module.get_module_identifier(1): None for kernel in every}  # blocks of one thread
    return [kernel_cache() / name for name in names]


def main() -> None:
    """Replace `blobtree/compiled` by the kernels of the present sources."""
    source = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT
    sys.path.insert(0, str(source))
    target = source / "blobtree" / "compiled"
    folders = compile_all(source)
    shutil.rmtree(target, ignore_errors=True)
    for folder in folders:
        shutil.copytree(folder, target / folder.parent.name / folder.name, ignore=_left_out)
    files = [file for file in target.rglob("*") if file.is_file()]
    size = sum(file.stat().st_size for file in files)
    print(f"{len(files)} files, {size / 1e6:.1f} MB in {target}")


def _left_out(folder: str, names: list[str]) -> list[str]:
    return [name for name in names if (Path(folder) / name).is_file() and not name.endswith(KEPT)]


if __name__ == "__main__":
    main()
