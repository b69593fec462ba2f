"""`ScatterOnCopies`: a command that scatters the same decals on all copies of a repeat."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from blobtree.progress import Progress
from decals.editing.scatter_commands import MAX_SCATTERED_DECALS, ReplaceDecals, ScatterDecals
from decals.errors import InvalidEdit
from decals.scattering.copies import has_copies, on_all_copies, one_copy
from decals.scenes.objects import SceneObject, TreeObject


class ScatterOnCopies(ScatterDecals):
    """Distribute decals over one copy of a repeat, and put them on all copies.

    The decals that lie on the object are deleted.

    Parameters
    ----------
    objects
        Index of the only object, such as ``(0,)``. The root of its tree is a repeat, or a grid of repeats,
        which may be below transforms.
    count
        Number of decals on all copies together. The copies share it equally, rounded up. Copies that touch
        have fewer, see `decals.scattering.on_copies`.
    seed
        Random seed.
    options
        More arguments of `decals.scatter`, such as ``{"regularity": 0.5}``.
    mask
        None: zones do not lie on all copies.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point, Repeat
    >>> from decals.editing import EditSession, ScatterOnCopies
    >>> row = Repeat(Point((0, 0, 0), radius=1.0), (4, 0, 0), 3)
    >>> session = EditSession(decals.cover(row, count=3, images=["eye"]))
    >>> edit = session.do(ScatterOnCopies((0,), count=30))
    >>> positions = session.document.scene.decals.positions
    >>> (positions[10] - positions[0]).round(3).tolist()
    [4.0, 0.0, 0.0]
    """

    def compute_command(
        self,
        objects: Sequence[SceneObject],
        images: int,
        *,
        progress: Progress | None = None,
        cancel: Callable[[], bool] | None = None,
    ) -> ReplaceDecals:
        """Distribute the decals, in any thread, and return the quick command that adds them.

        The parameters are those of `ScatterDecals`.
        """
        self.check_values()
        if self.mask is not None:
            raise InvalidEdit("mask: expected none for the same decals on all copies; leave it out")
        covered = self.covered(objects)
        item = covered[0] if len(covered) == 1 else None
        if not isinstance(item, TreeObject) or not has_copies(item.tree):
            names = ", ".join(item.name for item in covered) or "none"
            raise InvalidEdit(
                "same decals on all copies: expected one object whose root is a Repeat or a PolarRepeat, got "
                f"{names}; select such an object, or leave this out"
            )
        one, copies = one_copy(item.tree)
        each = math.ceil(self.count / copies)
        if each * copies > MAX_SCATTERED_DECALS:
            raise InvalidEdit(
                f"same decals on all copies: expected at most {MAX_SCATTERED_DECALS:,} together, got "
                f"{each:,} on each of {copies:,} copies; take fewer"
            )
        only = TreeObject(item.name, one, origin=item.origin)
        on_one = ScatterDecals((0,), each, self.seed, self.options)
        made = on_one.compute_command((only,), images, progress=progress, cancel=cancel)
        decals = on_all_copies(made.decals, item.tree)
        assert made.recipe is not None
        parameters = {**made.recipe.parameters, "same_on_copies": True}
        recipe = replace(made.recipe, parameters=parameters).giving(decals, covered)
        return ReplaceDecals(self.objects, decals, covered, recipe)
