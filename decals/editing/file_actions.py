"""Actions on files: save, save as, export, add images, and close without losing work."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from blobtree._typing import UInt8Array
from blobtree.files import exists, is_folder
from blobtree.progress import Cancel, Progress
from decals.editing.action_state import ActionState, Cursor, WindowActions
from decals.editing.commands import AddImage, ReplaceScene
from decals.editing.file_names import name_fault
from decals.editing.formats import (
    EXPORT_FIRST,
    EXPORT_SUFFIXES,
    PICTURE_SUFFIXES,
    WRITTEN_SUFFIXES,
    Video,
    checked_size,
    write_scene,
)
from decals.editing.key_bindings import Group
from decals.editing.prompts import Question, TextPrompt
from decals.editing.recovery import RecoveryFile, numbered_paths
from decals.editing.session import UNTITLED, Command
from decals.errors import InvalidEdit
from decals.images.builtin import BUILTIN_IMAGES, is_builtin
from decals.rendering.options import Size
from decals.rendering.picture import Picture
from decals.scenes.camera import Camera
from decals.scenes.files import load_scene
from decals.scenes.scene import DecalImage, Scene
from decals.validation import member

NOTHING = object()
"""Stands for the state that was discarded or saved last, if there was none."""


class FileActions(WindowActions):
    """Actions on the scene's file.

    Parameters
    ----------
    state
        State of the window.
    path
        File to save to, if any.

    Attributes
    ----------
    path
        File to save to, if any.
    camera
        Returns the camera to save with the scene; None for the document's.
    leave
        Closes the window.
    closable
        False for a page, which is not closed by a key.
    show_view
        Shows the scene from its own camera, after another file was opened.
    screenshot
        Returns the pixels of the view, which a picture without a size shows; None to draw the scene.
    folder
        Files outside this folder are neither read nor written; None for no limit.
    recovery : RecoveryFile
        Unsaved changes for the next window after a crash.
    """

    def __init__(self, state: ActionState, path: str | PathLike[str] | None) -> None:
        super().__init__(state)
        self.path = path
        self.camera: Callable[[], Camera | None] = lambda: None
        self.leave: Callable[[], None] = lambda: None
        self.closable = True
        self.show_view: Callable[[Camera], None] = lambda camera: None
        self.screenshot: Callable[[], UInt8Array] | None = None
        self.folder: Path | None = None
        self.recovery = self._recovery_beside(path)
        self._exists = path is not None and exists(path)
        self._begun: Path | None = None
        self._written: object = NOTHING
        self._aside: tuple[str | PathLike[str] | None, RecoveryFile, bool] | None = None
        self._closing = False
        self._discarded: object = NOTHING

    def _recovery_beside(self, path: str | PathLike[str] | None) -> RecoveryFile:
        state = self._state
        recovery = RecoveryFile(state.session, state.background, lambda: self.camera(), state.end_stroke)
        recovery.belong_to(path)
        return recovery

    # -- saving -----------------------------------------------------------------------------------------

    @Group.SCENE.action("save", "Ctrl+s", summary="save")
    def save(self, cursor: Cursor) -> None:
        """Save the scene; a scene without a file asks for its name.

        If another program has written the file of a new scene meanwhile, the name gets a number.
        """
        if self.path is None:
            self.save_as(cursor)
        else:
            self._save_to(self._own_path(self.path))

    def _own_path(self, path: str | PathLike[str]) -> Path:
        """Return the path of the scene's file, or one with a number if a new scene would replace a file.

        A file that a save of this scene is writing, or has just written, is its own.
        """
        names = numbered_paths(Path(path))
        return next(name for name in names if self._exists or name == self._begun or not exists(name))

    @Group.SCENE.action("save_as", "Ctrl+Shift+s", summary="save to another file")
    def save_as(self, _cursor: Cursor) -> None:
        """Ask for another file, and save the scene to it."""
        self._ask_for_name(self._save_to)

    def _ask_for_name(self, save: Callable[[Path], None]) -> None:
        def accept(text: str, repeated: bool) -> None:
            path = self._checked_path(text, (".json",))
            if self.path is None or path.absolute() != Path(self.path).absolute():
                _refuse_to_replace(path, repeated)
            save(path)

        self._state.prompt.begin(TextPrompt("save as", str(self.path or f"{UNTITLED}.json"), accept))

    def _save_to(self, path: str | PathLike[str]) -> None:
        def saved() -> None:
            self.recovery.belong_to(path)
            self.path, self._exists = path, True

        self._begun = Path(path)
        self._state.background.save(path, self.camera(), saved)
        self._written = self._state.session.position

    # -- other files ------------------------------------------------------------------------------------

    @Group.SCENE.action("export", "Ctrl+e", summary="export the scene for other programs, or as a page")
    def export(self, _cursor: Cursor) -> None:
        """Ask for a file, and write the scene to it with its decals; its suffix is the format."""
        if not self._state.session.document.objects:
            raise InvalidEdit("the scene has no object to export; press N to add one")

        def accept(text: str, repeated: bool) -> None:
            _refuse_to_replace(self._checked_path(text, EXPORT_SUFFIXES), repeated)
            self.write(text, True, suffixes=EXPORT_SUFFIXES)

        first = Path(self.path or UNTITLED).with_suffix(EXPORT_FIRST)
        self._state.prompt.begin(TextPrompt(f"export to ({', '.join(EXPORT_SUFFIXES)})", str(first), accept))

    def write(
        self,
        text: str,
        replace: bool,
        *,
        suffixes: tuple[str, ...] = WRITTEN_SUFFIXES,
        size: Size | None = None,
        video: str = "turntable",
    ) -> None:
        """Write a file whose suffix is the format: a scene, a script, an export, a picture or a video.

        Exports are those of `decals.export`, and pages those of `decals.save_html`.

        Parameters
        ----------
        text
            Name of the file.
        replace
            If False, a file that exists is an error, but for the scene's own.
        suffixes
            Suffixes that are accepted.
        size
            Width and height of pictures and videos, in pixels. A picture without one is a `screenshot`.
        video
            What a video shows; see `Video`.
        """
        path, shows = self._checked_path(text, suffixes), member("video", video, Video, InvalidEdit)
        own = self._exists and self.path is not None and path.absolute() == Path(self.path).absolute()
        if exists(path) and not (own or replace):
            raise InvalidEdit(f"{path} exists; choose to replace it, or give another name")
        suffix = path.suffix.lower()
        if suffix == ".json":
            self._save_to(path)
            return
        if suffix in PICTURE_SUFFIXES and size is None and self.screenshot is not None:
            Picture(self.screenshot()).save(path)
            self._state.show(f"exported to {text}")
            return
        size = checked_size(size)
        session = self._state.session
        scene = session.document.scene
        camera, fork = self.camera() or scene.camera, session.fork()
        shown = scene.replace(camera=camera)

        def history() -> list[Scene]:
            return [state.replace(camera=camera) for state in fork.replay()]

        def write(progress: Progress) -> None:
            write_scene(shown, path, size, shows, history, progress)

        self._state.background.write(f"export to {text}", write, f"exported to {text}")

    def open(
        self,
        load: Callable[[Progress, Cancel], Scene],
        path: str | PathLike[str],
        recover: Callable[[Path], Scene] = load_scene,
        opened: Callable[[], None] = lambda: None,
    ) -> None:
        """Open another scene in the place of the present one, whose unsaved changes are kept for recovery.

        The history begins anew, unless an edit was made while the scene was loaded: then undo leads back.

        Parameters
        ----------
        load
            Returns the scene, ``load(progress, cancel)``; it runs in the background.
        path
            File to save to, which has to be inside `folder`.
        recover
            Reads the unsaved changes that an earlier window of this file left, which are taken over.
        opened
            Called once the scene is there; never if the work is cancelled or fails.
        """
        path = self.inside(path)
        state, session = self._state, self._state.session
        state.background.require_idle(f"open {path.name}")
        state.end_stroke()
        entries = len(session.labels)

        def compute(progress: Progress, cancel: Cancel) -> Command:
            return ReplaceScene(load(progress, cancel), f"open {path.name}")

        def done() -> None:
            if len(session.labels) == entries + 1:
                session.forget_history()
            self.recovery.release()
            self._leave_aside()
            self.path, self._exists = path, exists(path)
            self.recovery = self._recovery_beside(path)
            self.recover(recover)
            self.show_view(session.document.camera)
            opened()

        if session.modified:
            self.recovery.keep()
        state.background.compute(f"open {path.name}", compute, done)

    def set_aside(self) -> None:
        """Keep the scene's file and its unsaved changes as they are while another scene is shown."""
        if self._aside is None:
            self.recovery.keep()
            self._aside = self.path, self.recovery, self._exists
            self.path, self.recovery, self._exists = None, self._recovery_beside(None), False

    @property
    def is_aside(self) -> bool:
        """True while the scene's file is set aside."""
        return self._aside is not None

    def take_back(self) -> None:
        """Continue with the file that was set aside, if one was."""
        if self._aside is not None:
            self.recovery.remove()
            (self.path, self.recovery, self._exists), self._aside = self._aside, None

    def _leave_aside(self) -> None:
        """Leave unsaved changes that were set aside to the next window."""
        if self._aside is not None:
            self._aside[1].release()
            self._aside = None

    @Group.SCENE.action("add_image", "Ctrl+i", summary="add an image for decals")
    def add_image(self, _cursor: Cursor) -> None:
        """Ask for the name of an image, and add it to the scene."""

        def accept(text: str, _repeated: bool) -> None:
            state = self._state
            state.end_stroke()
            if self.folder is not None and not is_builtin(text):
                self.inside(text)
            state.run(AddImage(DecalImage.load(text)))
            count = len(state.session.document.images)
            state.show(f"added {text} as image {count - 1}; press I to show it on the selected decals")

        self._state.prompt.begin(TextPrompt(f"image file, or {', '.join(BUILTIN_IMAGES)}", "", accept))

    def _checked_path(self, text: str, suffixes: tuple[str, ...]) -> Path:
        """Return the path of a file to write, or raise `InvalidEdit`."""
        path = Path(text).expanduser()
        if path.suffix.lower() not in suffixes:
            raise InvalidEdit(f"expected a name that ends in {', '.join(suffixes)}, got {text!r}")
        path = self.inside(path)
        if self.folder is not None and (fault := name_fault(path.relative_to(self.folder))):
            raise InvalidEdit(f"expected {fault}, got {text[:80]!r}")
        if is_folder(path) or not is_folder(path.parent):
            raise InvalidEdit(f"expected a file in an existing folder, got {text!r}")
        return path

    def inside(self, path: str | PathLike[str]) -> Path:
        """Return a path, or raise `InvalidEdit` if it leads out of the folder."""
        path = Path(path)
        if self.folder is None:
            return path
        inside = self.folder / path
        try:
            leads_out = not inside.resolve().is_relative_to(self.folder.resolve())
        except (OSError, RuntimeError, ValueError):  # a name that is too long, links in a circle, a NUL
            leads_out = True
        if leads_out:
            raise InvalidEdit(f"expected a file inside {str(self.folder)!r}, got {str(path)[:80]!r}")
        return inside

    # -- closing ----------------------------------------------------------------------------------------

    def recover(self, load: Callable[[Path], Scene]) -> None:
        """Take over unsaved changes of an earlier window; see `RecoveryFile.recover`."""
        message = self.recovery.recover(load)
        if message:
            self._state.show(message)

    @Group.SCENE.action("close", "q", summary="close the window; it asks if there are unsaved changes")
    def close(self, _cursor: Cursor) -> None:
        """Close the window, or ask if that would lose changes."""
        if not self.closable:
            raise InvalidEdit("a page stays open; close its tab, and unsaved changes are kept")
        if self.may_close():
            self.leave()

    def may_close(self) -> bool:
        """Return True if the window may close; otherwise ask. While the question is open, return True."""
        state = self._state
        if self._discarded is state.session.position:
            return True
        saving = state.background.saving
        if saving and self._written is state.session.position:
            self._closing = True
            state.show("saving; the window closes afterwards")
            return False
        if not (saving or state.session.modified or state.background.busy_editing):
            return True
        if state.prompt.asking:
            self._discard_changes()
            return True
        self._closing = False
        state.prompt.begin(
            Question(
                "unsaved changes.   Q: close without saving   S: save and close   Escape: go on",
                {"q": self._discard, "s": self._save_and_close},
            )
        )
        return False

    def update(self) -> None:
        """Close the window once a save has ended, and keep the recovery file.

        Call this regularly, but not in a drag.
        """
        if self._closing and not self._state.background.saving:
            self._closing = False
            if not self._state.session.modified:
                self.leave()
        self.recovery.update()

    def finish(self) -> None:
        """Keep unsaved changes in the recovery file, unless they were discarded; call this at the end."""
        session = self._state.session
        if self._discarded is session.position or not session.modified:
            self.recovery.remove()
        else:
            self.recovery.keep()
            self.recovery.release()
        self._leave_aside()

    def _discard_changes(self) -> None:
        """Note that the present changes may be lost; later ones count again."""
        self._state.session.end_stroke()
        self._discarded = self._state.session.position

    def _discard(self) -> None:
        self._discard_changes()
        self.leave()

    def _save_and_close(self) -> None:
        self._state.prompt.close()
        if self.path is None:
            self._ask_for_name(self._save_before_closing)
        else:
            self._save_before_closing(self._own_path(self.path))

    def _save_before_closing(self, path: str | PathLike[str]) -> None:
        self._save_to(path)
        self._closing = True
        self.update()


def _refuse_to_replace(path: Path, repeated: bool) -> None:
    """Raise `InvalidEdit` if a file exists, unless the name was accepted a second time."""
    if exists(path) and not repeated:
        raise InvalidEdit(f"{path} exists; press Return again to replace it")
