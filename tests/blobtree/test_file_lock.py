"""Locks between processes."""

import sys
from pathlib import Path

import pytest

import blobtree.file_lock as file_lock
from blobtree.file_lock import FileLock


def test_a_lock_is_held_once_and_leaves_no_file(tmp_path: Path) -> None:
    file = tmp_path / "lock"
    lock = FileLock.acquire(file)
    assert lock is not None
    assert FileLock.acquire(file) is None
    lock.release()
    assert not file.exists()
    again = FileLock.acquire(file)
    assert again is not None
    again.release()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows removes no open files")
def test_a_lock_whose_file_was_removed_is_taken_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its holder releases it after another process has opened the file."""
    file, locked = tmp_path / "lock", file_lock._locked

    def late(descriptor: int) -> bool:
        monkeypatch.setattr(file_lock, "_locked", locked)
        file.unlink()
        return locked(descriptor)

    monkeypatch.setattr(file_lock, "_locked", late)
    lock = FileLock.acquire(file)
    assert lock is not None
    assert file.exists()
    assert FileLock.acquire(file) is None
    lock.release()
