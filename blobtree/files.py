"""Files and folders: only regular files are read, and files are written whole or not at all.

A device may never end, and a pipe may never begin. Every writer goes through `replacing`: it fills a
temporary file in the folder of its target, which then takes the target's place. A crash, a kill or a full
disk leaves the old file. The next save into the folder removes what a killed process left.
"""

import errno
import hashlib
import io
import os
import platform
import re
import shutil
import stat
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path

from blobtree.errors import ImplicitDecalsError, UnusableFile

PREFIX = ".implicit-decals-"
"""Start of the name of a temporary file; the machine, the process and a random part follow."""

NAME = re.compile(re.escape(PREFIX) + r"(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-[0-9a-f]{12}(\.\w+)*")

MAX_AGE = 86_400.0
"""Seconds after which a temporary file of another machine counts as left behind."""


def read_file(path: Path) -> bytes:
    """Return the content of a regular file.

    Raises
    ------
    OSError
        There is no file, it is a folder, a device or a pipe, or it cannot be read.
    ValueError
        No file can have this name.
    """
    with open(path, "rb", opener=_open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is a device or a pipe", str(path))
        return file.read()


def read_text(path: Path) -> str:
    """Return the text of a regular file in UTF-8, whose lines end in one letter; errors are those above."""
    return io.StringIO(read_file(path).decode(), newline=None).read()


def _open_at_once(path: str, flags: int) -> int:
    """Open a file without waiting for a program that writes into a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path with the suffix of ``path``; on success, move its file to ``path``.

    The suffix is in lower case, as VTK's writers add their own to any other.
    The file gets the permissions, and where allowed the owner, of the file that it replaces. If ``path`` is a
    symbolic link, its target is replaced. On an error the temporary file is removed.

    Raises
    ------
    UnusableFile
        The file cannot be written; the error names ``path``, not the temporary file.
    """
    name = os.fspath(path)
    temporary: Path | None = None
    try:
        target = Path(os.path.realpath(name))
        _check_target(target)
        _remove_abandoned(target.parent)
        process = f"{_machine()}-{os.getpid()}-{uuid.uuid4().hex[:12]}"
        temporary = target.with_name(f"{PREFIX}{process}{target.suffix.lower()}")
        yield temporary
        _finish(temporary, target)
    except OSError as error:
        foreign = error.filename is not None and str(error.filename) not in (str(temporary), str(target))
        if foreign:  # of another file that the caller used
            raise
        raise UnusableFile.of(error, name, "write") from error
    except ValueError as error:
        if temporary is not None:
            raise
        cause = OSError(errno.EINVAL, f"not a possible path ({error})")
        raise UnusableFile.of(cause, name, "write") from error
    finally:
        if temporary is not None:
            _remove_all_of(temporary)


def write_atomically(path: str | os.PathLike[str], content: bytes) -> None:
    """Write `content` to `path` so that a crash leaves the old file or the new one; see `replacing`."""
    with replacing(path) as temporary, temporary.open("xb") as file:
        file.write(content)


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write several files, all or none, but for a crash between two of them; the first is replaced last."""
    with ExitStack() as stack:
        temporaries = [stack.enter_context(replacing(path)) for path in files]
        for temporary, content in zip(temporaries, files.values(), strict=True):
            with temporary.open("xb") as file:
                file.write(content)


def _check_target(target: Path) -> None:
    """Raise an error unless a regular file can be, or become, the target."""
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, "a device or pipe cannot be replaced by a file", str(target))
    if is_read_only(target):
        raise PermissionError(errno.EACCES, "the file is read-only", str(target))


def _finish(temporary: Path, target: Path) -> None:
    """Move a temporary file to its target once all of it is on the disk."""
    with temporary.open("r+b") as file:
        os.fsync(file.fileno())
    if target.exists():
        known = target.stat()
        if hasattr(os, "chown") and known.st_uid != temporary.stat().st_uid:
            with suppress(PermissionError):
                os.chown(temporary, known.st_uid, known.st_gid)
        shutil.copymode(target, temporary)
    temporary.replace(target)


@cache
def _machine() -> str:
    """Return a digest of the machine, and of the container if it counts its processes by itself."""
    parts = [platform.node()]
    with suppress(OSError):
        parts.append(str(Path("/proc/self/ns/pid").readlink()))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:8]


def _remove_abandoned(folder: Path) -> None:
    """Remove the temporary files of processes that ended before they could."""
    with suppress(OSError):
        for entry in os.scandir(folder):
            match = NAME.fullmatch(entry.name)
            if match is None:
                continue
            with suppress(OSError):
                known = match["machine"] == _machine() and os.name == "posix"
                old = time.time() - entry.stat().st_mtime > MAX_AGE
                if old or (known and not _is_running(int(match["process"]))):
                    Path(entry.path).unlink()


def _remove_all_of(temporary: Path) -> None:
    """Remove a temporary file, and those of a writer that added a suffix to its name."""
    with suppress(OSError):
        for entry in os.scandir(temporary.parent):
            if entry.name.startswith(temporary.name):
                with suppress(OSError):
                    Path(entry.path).unlink()


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)  # signal 0 only asks
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # another user's
        return True
    return True


def make_folder(folder: Path, error: type[ImplicitDecalsError]) -> None:
    """Create a folder for output if it does not exist; raise an error if that fails or it is a file."""
    try:
        folder.mkdir(exist_ok=True)
    except (OSError, ValueError) as cause:
        reason = "it is a file" if isinstance(cause, FileExistsError) else getattr(cause, "strerror", cause)
        raise error(f"could not make the output folder {str(folder)!r} ({reason}); choose another") from cause


def exists(path: str | os.PathLike[str]) -> bool:
    """Return True if there is something at a path; False for an impossible one, too long or with a NUL."""
    return os.path.exists(path)  # noqa: PTH110 - that of `Path` raises errors


def is_file(path: str | os.PathLike[str]) -> bool:
    """Return True for an existing file; False also for an impossible path."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: str | os.PathLike[str]) -> bool:
    """Return True for an existing folder; False also for an impossible path."""
    return os.path.isdir(path)  # noqa: PTH112


def no_file(path: str | os.PathLike[str]) -> str:
    """Return what is at a path instead of a regular file, for a message; "" for a regular file."""
    name = repr(os.fspath(path))
    if is_file(path):
        return ""
    if is_folder(path):
        return f"{name} is a folder"
    return f"{name} is a device or a pipe" if exists(path) else f"found no file {name}"


def is_too_long(path: str | os.PathLike[str]) -> bool:
    """Return True if the file system takes no name of this length."""
    try:
        os.lstat(path)
    except OSError as error:
        return error.errno == errno.ENAMETOOLONG
    except ValueError:
        return False
    return False


def is_read_only(path: str | os.PathLike[str]) -> bool:
    """Return True for an existing file that this user may not write."""
    effective = os.access in os.supports_effective_ids
    return is_file(path) and not os.access(path, os.W_OK, effective_ids=effective)
