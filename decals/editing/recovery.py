"""The recovery file: unsaved changes beside the scene's file, for the next window after a crash."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import datetime
from itertools import count
from os import PathLike
from pathlib import Path

from blobtree.file_lock import FileLock
from blobtree.files import exists, is_file
from decals.editing.background import BackgroundJobs
from decals.editing.commands import ReplaceScene
from decals.editing.session import EditSession
from decals.errors import ImplicitDecalsError, InvalidScene
from decals.scenes.camera import Camera
from decals.scenes.scene import Scene
from decals.validation import as_path

AUTOSAVE_SECONDS = 5.0
"""Time between two writes of the recovery file while a scene changes, and that after which a stroke ends."""

MAX_WRITING_SHARE = 0.1
"""Part of the time that may pass with writing, at most."""

SUFFIX = ".recovery.json"
"""End of the name of a recovery file."""


MAX_WINDOWS = 100
"""Number of windows that may edit one file at the same time."""


def recovery_path(path: str | PathLike[str], *, number: int = 1) -> Path:
    """Return the path of the recovery file of a scene file, in the same folder.

    Parameters
    ----------
    path
        The scene file.
    number
        Number of the window, where several edit the same file.

    Raises
    ------
    InvalidScene
        `path` is not the path of a file.

    Examples
    --------
    >>> from decals.editing import recovery_path
    >>> recovery_path("scenes/knot.json").name
    'knot.recovery.json'
    >>> recovery_path("scenes/knot.json", number=2).name
    'knot-2.recovery.json'
    """
    ending = "" if number == 1 else f"-{number}"
    scene = as_path(path)
    if not scene.name:
        raise InvalidScene(f"path: expected the path of a scene, got {str(path)!r}")
    return scene.with_name(f"{scene.stem}{ending}{SUFFIX}")


def numbered_paths(path: Path) -> Iterator[Path]:
    """Yield a path, then those with a number behind the name: NAME-2, NAME-3, ..."""
    yield path
    for number in count(2):
        yield path.with_stem(f"{path.stem}-{number}")


def in_use(path: Path) -> bool:
    """Return True if a window has a recovery file."""
    try:
        lock = FileLock.acquire(_lock_path(path))
    except OSError:
        return False
    if lock is not None:
        lock.release()
    return lock is None


def _lock_path(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


class RecoveryFile:
    """Keeps a recovery file while a session has unsaved changes; each window of a scene has its own.

    Parameters
    ----------
    session
        The edited session.
    background
        Writes the file.
    camera
        Returns the camera to store; None for the document's.
    end_stroke
        Ends the open stroke.

    Attributes
    ----------
    path
        Path of the recovery file; None if the scene has no file.
    exists
        True while the session has a recovery file.
    """

    def __init__(
        self,
        session: EditSession,
        background: BackgroundJobs,
        camera: Callable[[], Camera | None],
        end_stroke: Callable[[], None],
    ) -> None:
        self._session, self._background = session, background
        self._camera, self._end_stroke = camera, end_stroke
        self._scene_path: Path | None = None
        self.path: Path | None = None
        self._lock: FileLock | None = None
        self.exists = False
        self._written: object = None
        self._changed_at: float | None = None
        self._written_at = -math.inf
        self._wait = AUTOSAVE_SECONDS

    def belong_to(self, scene_path: str | PathLike[str] | None) -> None:
        """Remove the recovery file, and keep the next one beside this scene file."""
        self.remove()
        self._scene_path = None if scene_path is None else Path(scene_path)
        self.path = None if scene_path is None else recovery_path(scene_path)

    def _candidates(self) -> Iterator[Path]:
        """Yield the paths of the recovery files of all windows."""
        assert self._scene_path is not None
        for number in range(1, MAX_WINDOWS + 1):
            yield recovery_path(self._scene_path, number=number)

    def _acquire(self, path: Path) -> bool:
        """Take a recovery file for this window, unless another one has it."""
        try:
            self._lock = FileLock.acquire(_lock_path(path))
        except OSError:  # nor can the recovery file be written there
            self.path = path
            return True
        if self._lock is not None:
            self.path = path
        return self._lock is not None

    def _acquire_new(self) -> None:
        """Take the first recovery file that no window has, before it is written for the first time."""
        if self._lock is None:
            next((path for path in self._candidates() if not exists(path) and self._acquire(path)), None)

    def recover(self, load: Callable[[Path], Scene]) -> str:
        """Take over the recovery file of an earlier window, as one entry that undo takes back.

        Parameters
        ----------
        load
            Reads the file.

        Returns
        -------
        str
            What was recovered; empty without a recovery file.

        Raises
        ------
        InvalidScene
            The file cannot be read.
        """
        if self._scene_path is None or self.exists:
            return ""
        path = next((path for path in self._candidates() if is_file(path) and self._acquire(path)), None)
        if path is None:
            return ""
        when = datetime.fromtimestamp(path.stat().st_mtime).astimezone()
        try:
            scene = load(path)
        except ImplicitDecalsError as error:
            self.release()
            raise InvalidScene(
                f"could not read the unsaved changes in {str(path)!r} ({error}); move or delete this file"
            ) from error
        self._session.do(ReplaceScene(scene, "recover unsaved changes"))
        self.exists, self._written = True, self._session.position
        return (
            f"recovered unsaved changes of {when:%Y-%m-%d %H:%M} from {path.name}; "
            "Ctrl + S keeps them, Ctrl + Z goes back to the saved scene"
        )

    @property
    def pending(self) -> bool:
        """True if there are changes that are not in the recovery file, or the file is to be removed."""
        if self._scene_path is None:
            return False
        session = self._session
        return (
            self.exists
            if not session.modified
            else session.stroke_open or session.position is not self._written
        )

    def update(self) -> None:
        """Write or remove the file if it is time to; the owner calls this regularly, but not in a drag."""
        if self.path is None or not self.pending:
            self._changed_at = None
            return
        if self._background.writing:
            return
        if not self._session.modified:
            self.remove()
            return
        now = time.monotonic()
        self._changed_at = now if self._changed_at is None else self._changed_at
        waits_since = self._changed_at if self._session.stroke_open else self._written_at
        if now - waits_since < self._wait:
            return
        self._end_stroke()
        if self._session.stroke_open:  # steps of the last drag are not adopted yet
            return

        def written() -> None:
            self._wait = max(AUTOSAVE_SECONDS, (time.monotonic() - now) / MAX_WRITING_SHARE)

        self._acquire_new()
        self._written, self.exists, self._changed_at = self._session.position, True, None
        self._written_at = now
        self._background.write_copy(self.path, self._camera(), written)

    def keep(self) -> Path | None:
        """Write all unsaved changes now, and return the file; None if there are none, or no path."""
        if self.path is None or not self._session.modified:
            return None
        self._acquire_new()
        self._session.begin_save(self.path, camera=self._camera()).write()
        self.exists = True
        return self.path

    def remove(self) -> None:
        """Remove the file, if this session wrote or recovered it."""
        path = self.path
        if self.exists and path is not None:
            with suppress(OSError):
                path.unlink(missing_ok=True)
        self.release()
        self.exists, self._written, self._changed_at = False, None, None

    def release(self) -> None:
        """Leave the recovery file to the next window."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None
