"""Everything that writes a file, and what must happen where that is not possible.

    python -m tests.writers

tries each writer on a full disk, without permission, with a folder in the place of the file, a file in the
place of the folder, a missing folder and a name that is too long. A writer raises an exception of ours,
leaves the old file as it was, and leaves nothing else behind. `test_writers.py` has the same as tests.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, redirect_stderr, suppress
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

import blobtree
import decals
from blobtree.pyvista_views import write_polydata
from blobtree.sampling import FieldGrid
from decals.apps import cli
from decals.errors import ImplicitDecalsError, InvalidInput
from decals.rendering import Picture
from decals.scenes.script import write_script

Writer = Callable[[Path], object]
Fault = Callable[[Path, str], AbstractContextManager[Path]]

UNPRIVILEGED = 65534
"""User without permissions."""

DISK_BYTES = 1 << 20
"""Size of the file system of `full_file_system`."""


@cache
def scene() -> decals.Scene:
    """A ball under few decals, with an image of its own that scripts keep in a second file."""
    image = decals.DecalImage.load(np.random.default_rng(0).random((24, 24, 3)), name="noise")
    ball = blobtree.Point((0, 0, 0), radius=1.0).to_pyvista(resolution=8)
    return decals.cover(ball, count=12, images=[image])


@cache
def relief_scene() -> decals.Scene:
    """The same with heights."""
    heights = np.random.default_rng(0).random((8, 8))
    material = decals.DecalMaterial("bumps", np.full((8, 8, 3), 0.5), height=heights, relief=0.1)
    return scene().replace(images=[material])


@cache
def picture() -> Picture:
    """Noise, which no format makes small."""
    return Picture(np.random.default_rng(0).integers(0, 256, (48, 64, 4), np.uint8))


@cache
def surface() -> Any:
    """A surface of pyvista."""
    return blobtree.Point((0, 0, 0), radius=1.0).to_pyvista(resolution=10)


@cache
def grid() -> FieldGrid:
    """A field on a grid."""
    return blobtree.field_grid(blobtree.Point((0, 0, 0), radius=1.0), resolution=10)


def command(*words: str) -> Writer:
    """A command of the command line, whose last option is the output; its message becomes an exception."""

    def run(path: Path) -> None:
        messages = StringIO()
        with redirect_stderr(messages):
            code = cli.run([*words, "-o", str(path)])
        if code:
            raise InvalidInput(" ".join(messages.getvalue().split()))

    return run


WRITERS: dict[str, Writer] = {
    "tree.json": lambda path: blobtree.save(blobtree.Point((0, 0, 0), radius=1.0), path),
    **{
        f"picture{end}": lambda path: picture().save(path)
        for end in (".png", ".jpg", ".webp", ".tif", ".bmp")
    },
    **{
        f"surface{end}": lambda path: write_polydata(path, surface())
        for end in (".ply", ".obj", ".stl", ".vtp")
    },
    **{f"grid{end}": lambda path: grid().save(path) for end in (".vti", ".nrrd", ".npz", ".npy")},
    "mesh.ply": lambda path: blobtree.polygonize(blobtree.Point((0, 0, 0), radius=1.0), resolution=8).save(
        path
    ),
    "scene.json": lambda path: decals.save_scene(scene(), path),
    "script.py": lambda path: write_script(scene(), path),
    "baked.glb": lambda path: decals.bake(scene(), path, size=64),
    "colored.glb": lambda path: decals.bake(scene(), path, vertex_colors=True),
    **{f"exported{end}": lambda path: decals.export(scene(), path, size=64) for end in (".obj", ".gltf")},
    **{f"plain{end}": lambda path: decals.export(scene(), path) for end in (".ply", ".stl", ".vtp", ".3mf")},
    "page.html": lambda path: decals.save_html(scene(), path, resolution=8),
    "displaced.ply": lambda path: decals.displace(relief_scene()).save(path),
    "turn.gif": lambda path: decals.animate(decals.turntable(scene(), 2), path, size=(32, 24), samples=1),
    "table.parquet": lambda path: decals.save_table(scene().decals, path),
    "table.csv": lambda path: decals.save_table(scene().decals, path),
    "commanded.ply": command("export", "spheres", "--resolution", "8"),
    "polygonized.obj": command("polygonize", "spheres", "--resolution", "8"),
    "rendered.png": command("render", "spheres", "--size", "32x24"),
    "scattered.json": command("scatter", "spheres", "--count", "12"),
}
"""Writers by the names of their files. Editors save, keep for recovery and export through the same ones."""


def outcome(write: Writer, path: Path) -> str:
    """Write, and return "written", "refused" with a message that names the path, or what else happened."""
    try:
        write(path)
    except ImplicitDecalsError as error:
        text = " ".join(str(error).split())
        known = path.name[:40] in text.replace(" ", "") or path.parent.name in text.replace(" ", "")
        return "refused" if known else f"refused without a name: {text}"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    return "written"


def content(folder: Path) -> dict[str, bytes | None]:
    """The files of a folder with what they hold; None for folders."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


# -- what makes writing impossible ------------------------------------------------------------------------


@contextmanager
def too_long(folder: Path, name: str) -> Iterator[Path]:
    """A name that no file system takes."""
    yield folder / f"{'x' * 300}{Path(name).suffix}"


@contextmanager
def folder_in_place(folder: Path, name: str) -> Iterator[Path]:
    """A folder that has the name of the file."""
    (folder / name).mkdir()
    yield folder / name


@contextmanager
def file_as_folder(folder: Path, name: str) -> Iterator[Path]:
    """A file in the place of the folder."""
    (folder / "file").write_bytes(b"old")
    yield folder / "file" / name


@contextmanager
def missing_folder(folder: Path, name: str) -> Iterator[Path]:
    """No folder."""
    yield folder / "missing" / name


@contextmanager
def read_only_folder(folder: Path, name: str) -> Iterator[Path]:
    """A folder, with an old file, in which the user may not write."""
    inner = folder / "kept"
    inner.mkdir()
    (inner / name).write_bytes(b"old")
    inner.chmod(0o555)
    with without_rights():
        yield inner / name
    inner.chmod(0o755)


@contextmanager
def read_only_file(folder: Path, name: str) -> Iterator[Path]:
    """An old file that the user may not write."""
    (folder / name).write_bytes(b"old")
    (folder / name).chmod(0o444)
    with without_rights():
        yield folder / name


FAULTS: dict[str, Fault] = {
    "a name that is too long": too_long,
    "a folder in its place": folder_in_place,
    "a file as the folder": file_as_folder,
    "a missing folder": missing_folder,
    "a read-only folder": read_only_folder,
    "a read-only file": read_only_file,
}


@contextmanager
def without_rights() -> Iterator[None]:
    """As a user without special rights: root may write everywhere."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        yield
        return
    os.seteuid(UNPRIVILEGED)
    try:
        yield
    finally:
        os.seteuid(0)


def failure(name: str, fault: str) -> str:
    """Try a writer under a fault; return what is wrong, or nothing."""
    with tempfile.TemporaryDirectory() as text, ExitStack() as stack:
        folder = Path(text)
        folder.chmod(0o777)
        path = stack.enter_context(FAULTS[fault](folder, name))
        before = content(folder)
        seen = outcome(WRITERS[name], path)
        stack.close()
        if seen != "refused":
            return seen
        return "" if content(folder) == before else f"left behind: {sorted(content(folder))}"


def cases() -> list[tuple[str, str]]:
    """All pairs of a writer and a fault, but for an animation, whose pictures go into an existing folder."""
    pairs = [(name, fault) for name in WRITERS for fault in FAULTS]
    pairs.remove(("turn.gif", "a folder in its place"))
    return pairs


# -- full disks -------------------------------------------------------------------------------------------


@contextmanager
def full_file_system() -> Iterator[Path]:
    """A small file system without any space but for what is there; OSError if none can be mounted."""
    with tempfile.TemporaryDirectory() as text:
        mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "tmpfs", text]
        try:
            subprocess.run(mount, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise OSError("no file system can be mounted") from error
        try:
            yield Path(text)
        finally:
            subprocess.run(["umount", "--lazy", text], check=True, capture_output=True)


def fill(folder: Path) -> None:
    """Write a file into a folder until the disk is full."""
    with suppress(OSError), (folder / "filler").open("wb", buffering=0) as file:
        while True:
            file.write(b"x" * 4096)


def failure_on_full_disk(name: str) -> str:
    """Let a writer replace a file on a full disk; return what is wrong, or nothing."""
    with full_file_system() as folder:
        path = folder / name
        path.write_bytes(b"old")
        fill(folder)
        before = content(folder)
        seen = outcome(WRITERS[name], path)
        if seen != "refused":
            return seen
        return "" if content(folder) == before else f"left behind: {sorted(content(folder))}"


@contextmanager
def short_files(limit: int) -> Iterator[None]:
    """Let no file grow beyond a number of bytes, as if the disk were full by then."""
    import resource  # Unix alone has it

    most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


def failure_in_short_files(name: str) -> str:
    """Let a writer replace its own file without room for all of it; return what is wrong, or nothing."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        path = folder / name
        WRITERS[name](path)
        before, size = content(folder), path.stat().st_size
        for limit in {0, 1, 100, 4096, size // 2, size - 1} & set(range(size)):
            with short_files(limit):
                seen = outcome(WRITERS[name], path)
            if seen != "refused":
                return f"{limit} bytes: {seen}"
            if content(folder) != before:
                return f"{limit} bytes: torn, or left behind: {sorted(content(folder))}"
        return ""


def main() -> int:
    """Try everything, print what is wrong, and return the exit code."""
    wrong = 0
    for name, fault in cases():
        if text := failure(name, fault):
            wrong += 1
            print(f"{name}, {fault}: {text}")
    for name in WRITERS:
        try:
            text = failure_on_full_disk(name)
        except OSError as error:
            text = ""
            print(f"{name}: not tried on a full disk, as {error}")
        if text:
            wrong += 1
            print(f"{name}, a full disk: {text}")
    print(f"{len(cases())} cases and {len(WRITERS)} full disks: {wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
