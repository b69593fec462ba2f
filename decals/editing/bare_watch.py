"""Bare places that the last edit of a shape opened: a thread counts them, and one action fills them."""

from collections.abc import Callable

from blobtree.progress import Cancel, Progress
from decals.editing.background import Job, Worker
from decals.editing.document import Edit
from decals.editing.filling import (
    STREAM,
    FillBarePlaces,
    OpenedBy,
    Skin,
    bare_samples,
    stretched_objects,
)
from decals.editing.session import EditSession
from decals.errors import ImplicitDecalsError
from decals.scattering.domain import Domain


class BareWatch:
    """Counts the places that the last entry of a session's history opened, if it changed a shape.

    Parameters
    ----------
    session
        The edited session.

    Attributes
    ----------
    places
        Number of the places; 0 while they are being counted.
    busy
        True while places are being counted.
    """

    def __init__(self, session: EditSession) -> None:
        self._session, self._worker = session, Worker()
        self._seen: object = None
        self._offer: FillBarePlaces | None = None
        self.places, self.busy = 0, False

    @property
    def offer(self) -> FillBarePlaces | None:
        """The command that fills the places; None without any."""
        return self._offer if self.places and self._seen is self._session.position else None

    def filling(self, pick: Callable[[], int]) -> FillBarePlaces:
        """Return the offer, else the command that fills all bare places of the object that `pick` returns."""
        return self.offer or FillBarePlaces((pick(),))

    def forget(self) -> None:
        """Stop counting, and forget the count."""
        self._worker.cancel()
        self._seen, self.places, self.busy, self._offer = None, 0, False, None

    def update(self, *, resting: bool) -> bool:
        """Begin to count after an edit, or take the count; return True if it changed.

        Parameters
        ----------
        resting
            False while another edit goes on, whose result is counted after it.
        """
        session, before = self._session, self.places
        if self._seen is not session.position or session.stroke_open:
            self.forget()
        if resting and not session.stroke_open and self._seen is None:
            self._seen = session.position
            if session.next_undo is not None:
                self._begin(session.next_undo.edit)
        try:
            complete = self._worker.poll()
        except ImplicitDecalsError:  # such as an object without a visible surface
            complete = None
        if complete is not None:
            complete()
        self.busy = self._worker.busy
        return self.places != before

    def _begin(self, edit: Edit) -> None:
        """Count in a thread what an edit opened."""
        document = self._session.document
        objects = () if edit.parts_after.objects is None else stretched_objects(document, edit)
        if not objects:
            return
        fork = document.fork()

        def work(_progress: Progress, _cancel: Cancel) -> Callable[[], None]:
            domain = Domain([item.surface for item in fork.objects], 0)
            bare = bare_samples(Skin.of(fork), domain, objects, STREAM, OpenedBy(edit, fork))
            places = bare.places

            def complete() -> None:
                self.places, self._offer = places, FillBarePlaces(objects, edit)

            return complete

        self._worker.start(Job("count bare places", work))

    def close(self) -> None:
        """Stop counting."""
        self._worker.cancel()
