"""What every node offers to look at it: its mesh and a slice through its field, as pyvista objects."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, cast

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import pyvista as pv

    from blobtree.nodes.tree import Node
    from blobtree.progress import Cancel, Progress


class Viewing:
    """The part of `Node` that makes pyvista objects; pyvista is imported when it is asked for one."""

    def mesh(
        self,
        *,
        resolution: int | None = None,
        cell_size: float | None = None,
        chord_error: float | None = None,
        creases: bool = False,
        split_normals: bool = False,
        device: str | None = None,
        progress: "Progress | None" = None,
        cancel: "Cancel | None" = None,
    ) -> "pv.PolyData":
        """The surface as a pyvista mesh with normals and, as "RGB", colours.

        Parameters
        ----------
        resolution, cell_size, chord_error, creases, device, progress, cancel
            As for `polygonize`.
        split_normals
            Give each side of a crease vertices and normals of its own; implies `creases`. Creases then look
            sharp, and the mesh is not closed there.

        Raises
        ------
        MissingPackage
            pyvista is not installed.
        """
        from blobtree.meshing.polygonize import polygonize
        from blobtree.meshing.splitting import split_creases
        from blobtree.views.view import to_polydata

        tree = cast("Node", self)
        mesh = polygonize(
            tree,
            resolution=resolution,
            cell_size=cell_size,
            chord_error=chord_error,
            creases=creases or split_normals,
            device=device,
            progress=progress,
            cancel=cancel,
        )
        return to_polydata(split_creases(tree, mesh) if split_normals else mesh)

    def slice(
        self,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        normal: ArrayLike = (0.0, 0.0, 1.0),
        *,
        resolution: int | None = None,
        values: Iterable[float] | None = None,
    ) -> "pv.MultiBlock":
        """The field on the plane through `origin` (3,) across `normal` (3,), with lines of equal field.

        Parameters
        ----------
        resolution
            Squares along the longer side of the plane's part in the tree's box; 256 by default.
        values
            Field values that get lines; by default 0.1, 0.2, …, 1.

        Returns
        -------
        pyvista.MultiBlock
            "plane", coloured by "field"; "lines", at the values; "surface", the line at 0.5. Points of lines
            lie on their level exactly, save in kinks, where they lie between the neighbouring samples.

        Raises
        ------
        InvalidPoints
            The plane misses the model, or has no direction; or a value is not above 0.
        InvalidResolution
            The resolution is no number of squares that a plane can have.
        MissingPackage
            pyvista is not installed.
        """
        from blobtree.views.view import LEVELS, SLICE_RESOLUTION, slice_tree

        return slice_tree(
            cast("Node", self),
            origin,
            normal,
            resolution=SLICE_RESOLUTION if resolution is None else resolution,
            values=LEVELS if values is None else values,
        )
