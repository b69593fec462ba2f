"""The kernels of the first clicks and edits of a session, which a thread loads before they are needed."""

from blobtree import Point
from blobtree.device import core_left_free
from blobtree.progress import reporting
from decals.editing.queries import outlines, pick
from decals.editing.session import EditSession
from decals.scenes.cover import cover


def load_first_kernels() -> None:
    """Load the kernels of meshes, scattering, picks, outlines and changes of decals, on a core less than all.

    Missing kernels are compiled, which takes a minute or more. No progress is reported.
    """
    with core_left_free(), reporting(lambda _stage, _fraction: None):
        document = EditSession(cover(Point((0, 0, 0), radius=1.0), count=3, images=["scale"])).document
        document.prepare_surfaces()
        document.decals.load_kernels()
        pick(document, (0, 0, 5), (0, 0, -1))
        outlines(document, [0])
