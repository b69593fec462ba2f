"""Locks between processes and threads; the system frees those of a process that ends."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Self


class FileLock:
    """A lock that is held while its file is open; `acquire` makes one.

    Parameters
    ----------
    path
        The lock's file.
    descriptor
        Descriptor of the open file.
    """

    def __init__(self, path: Path, descriptor: int) -> None:
        self._path, self._descriptor = path, descriptor

    @classmethod
    def acquire(cls, path: Path) -> Self | None:
        """Return the lock of a path, or None if another one holds it.

        Raises
        ------
        OSError
            The file cannot be made.

        Examples
        --------
        >>> lock = FileLock.acquire(Path("scene.lock"))
        >>> FileLock.acquire(Path("scene.lock")) is None
        True
        >>> lock.release()
        """
        while True:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            if not _locked(descriptor):
                os.close(descriptor)
                return None
            try:
                current = os.path.samestat(os.fstat(descriptor), path.stat())
            except FileNotFoundError:
                current = False
            if current:
                return cls(path, descriptor)
            os.close(descriptor)  # its holder removed the file in between

    def release(self) -> None:
        """Free the lock, and remove its file."""
        if sys.platform == "win32":  # which removes no open files
            os.close(self._descriptor)
            with suppress(OSError):
                self._path.unlink(missing_ok=True)
            return
        with suppress(OSError):
            self._path.unlink(missing_ok=True)
        os.close(self._descriptor)


def _locked(descriptor: int) -> bool:
    """Lock an open file and return True, or return False if another one has locked it."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:  # a file system without locks
        return True
    return True
