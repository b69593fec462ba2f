"""Files are whole or absent: full disks, kills, links, permissions, and what killed processes leave."""

import errno
import os
import pickle
import re
import signal
import stat
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

import blobtree
from blobtree.files import PREFIX, exists, is_file, is_folder, is_too_long, replacing, write_atomically
from tests.programs import output_of

posix = pytest.mark.skipif(os.name != "posix", reason="permissions and signals of POSIX")


def files_of(folder: Path) -> set[str]:
    return {entry.name for entry in folder.iterdir()}


def test_a_file_is_written_and_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_atomically(path, b"old")
    write_atomically(str(path), b"new")
    assert path.read_bytes() == b"new"
    assert files_of(tmp_path) == {"a.txt"}


def test_an_error_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")

    def interrupted() -> None:
        with replacing(path) as temporary:
            assert temporary.parent == tmp_path
            assert temporary.suffix == ".txt"
            temporary.write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_bytes() == b"old"
    assert files_of(tmp_path) == {"a.txt"}


@posix
def test_links_and_permissions_stay(tmp_path: Path) -> None:
    target, link = tmp_path / "deep" / "target.txt", tmp_path / "link.txt"
    target.parent.mkdir()
    target.write_bytes(b"old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert files_of(target.parent) == {"target.txt"}


@posix
def test_a_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a.txt", b"")
    (tmp_path / "b.txt").write_bytes(b"")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


@posix
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("none/a.txt", "No such file or directory"),
        ("folder", "Is a directory"),
        ("pipe", "a device or pipe"),
        ("x" * 300, "File name too long"),
        ("nul\0", "not a possible path"),
        ("\ud800", "not a possible path"),
        ("a.txt/b.txt", "Not a directory"),
    ],
    ids=["no folder", "folder", "pipe", "long", "nul", "surrogate", "file as folder"],
)
def test_an_error_names_the_path(tmp_path: Path, name: str, reason: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.txt").write_bytes(b"")
    os.mkfifo(tmp_path / "pipe")
    before = files_of(tmp_path)
    path = os.path.join(tmp_path, name)  # noqa: PTH118 - a Path refuses some of the names
    with pytest.raises(OSError, match=re.escape(reason)) as raised:
        write_atomically(path, b"new")
    assert raised.value.filename == path
    assert files_of(tmp_path) == before


def test_temporary_files_of_ended_processes_are_removed(tmp_path: Path) -> None:
    output_of(
        "import os, sys\nfrom blobtree.files import replacing\n"
        "with replacing(sys.argv[1]) as temporary:\n    temporary.write_bytes(b'half')\n    os._exit(0)",
        str(tmp_path / "a.txt"),
    )
    (left,) = files_of(tmp_path)
    assert left.startswith(PREFIX)
    foreign = tmp_path / f"{PREFIX}00000000-1-0123456789ab.txt"
    ancient = tmp_path / f"{PREFIX}00000000-1-0123456789ac.txt"
    mine = tmp_path / f"{PREFIX}notes.txt"
    for path in (foreign, ancient, mine):
        path.write_bytes(b"")
    yesterday = time.time() - 90_000
    os.utime(ancient, (yesterday, yesterday))
    with replacing(tmp_path / "b.txt") as temporary:
        temporary.write_bytes(b"whole")
        write_atomically(tmp_path / "c.txt", b"")  # keeps the file of this process
    assert files_of(tmp_path) == {"b.txt", "c.txt", foreign.name, mine.name}


KILLED = """
    import sys

    import blobtree
    from blobtree.pyvista_views import write_polydata

    surfaces = [
        blobtree.Point((0, 0, 0), radius=1.0).to_pyvista(resolution=resolution) for resolution in (24, 48)
    ]
    trees = [blobtree.Point((0, 0, 0), radius=radius) for radius in (1.0, 2.0)]
    print("ready", flush=True)
    while True:
        for tree, surface in zip(trees, surfaces):
            blobtree.save(tree, sys.argv[1] + "/a.json")
            write_polydata(sys.argv[1] + "/a.ply", surface)
"""


@pytest.mark.slow
@posix
def test_a_kill_while_saving_leaves_one_of_the_files(tmp_path: Path) -> None:
    import pyvista as pv

    import blobtree

    sizes: set[int] = set()
    for delay in (0.0, 0.011):
        command = [sys.executable, "-c", textwrap.dedent(KILLED), str(tmp_path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            assert child.stdout.readline() == "ready\n"
            while not (tmp_path / "a.ply").exists():
                time.sleep(0.001)
            time.sleep(delay)
            child.send_signal(signal.SIGKILL)
        assert blobtree.load(tmp_path / "a.json").radius in (1.0, 2.0)  # type: ignore[attr-defined]
        sizes.add(pv.read(tmp_path / "a.ply").n_cells)
    expected = {blobtree.Point((0, 0, 0), radius=1.0).to_pyvista(resolution=n).n_cells for n in (24, 48)}
    assert sizes <= expected
    write_atomically(tmp_path / "b.txt", b"")
    assert files_of(tmp_path) == {"a.json", "a.ply", "b.txt"}


def test_an_error_of_the_system_is_one_of_ours(tmp_path: Path) -> None:
    """It still is the error of the system that programs catch."""
    tree = blobtree.Point((0, 0, 0), radius=1.0)
    with pytest.raises(
        blobtree.errors.UnusableFile, match=r"could not write .* too long.*; choose a shorter name"
    ):
        blobtree.save(tree, tmp_path / f"{'x' * 300}.json")
    with pytest.raises(
        blobtree.errors.MissingFile, match=r"could not write .*; create its folder first"
    ) as raised:
        blobtree.save(tree, tmp_path / "none" / "tree.json")
    assert isinstance(raised.value, FileNotFoundError)
    assert raised.value.errno == errno.ENOENT
    for name in (f"{'x' * 300}.json", "none.json", "."):
        with pytest.raises(blobtree.errors.UnusableFile, match="could not read") as unreadable:
            blobtree.load(tmp_path / name)
        copy = pickle.loads(pickle.dumps(unreadable.value))
        assert (type(copy), str(copy)) == (type(unreadable.value), str(unreadable.value))


@pytest.mark.parametrize("name", ["x" * 300, "nul\0", "\ud800", "a.txt/b.txt"])
def test_impossible_paths_are_no_files(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.txt").write_bytes(b"")
    path = os.path.join(tmp_path, name)  # noqa: PTH118 - a Path refuses some of the names
    assert not exists(path)
    assert not is_file(path)
    assert not is_folder(path)
    assert is_too_long(path) == (len(name) == 300)
