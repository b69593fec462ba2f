"""Reader of glTF 2.0 and GLB files (Khronos 2021): the default scene as one mesh in its rest pose."""

from collections.abc import Iterator
from pathlib import Path

from blobtree.files import read_file
from decals.surfaces.files.faults import Notes, reading
from decals.surfaces.files.gltf_accessors import Accessors
from decals.surfaces.files.gltf_buffers import Buffers
from decals.surfaces.files.gltf_document import Document, parse
from decals.surfaces.files.gltf_materials import Materials
from decals.surfaces.files.gltf_nodes import Placement, placements
from decals.surfaces.files.gltf_primitives import Skinned, posed, read_primitive
from decals.surfaces.files.pieces import Budget, Piece, mesh_of, placed
from decals.surfaces.mesh_data import MeshData


def read_gltf(path: Path) -> MeshData:
    """Read the default scene of a glTF or GLB file, at rest: morph targets and skins as the file has them.

    Vertices are float64. The colours are those of the vertices and of the materials' base colours.

    Raises
    ------
    InvalidMesh
        If the file is damaged, refers to what it does not have, or is compressed.
    """
    return mesh_of([piece for _, pieces in _nodes(path) for piece in pieces])


def gltf_objects(path: Path) -> dict[str, MeshData]:
    """Return the meshes of the nodes of a glTF or GLB file by the names of the nodes; see `read_gltf`."""
    return {name: mesh_of(pieces) for name, pieces in _nodes(path) if pieces}


def _nodes(path: Path) -> list[tuple[str, list[Piece]]]:
    """Return the pieces of each node of the default scene that has a mesh."""
    with reading(path, "glTF") as notes:
        content = read_file(path)
        budget = Budget()
        budget.grow(len(content))
        document, binary = parse(content, notes)
        buffers = Buffers(document.buffers, binary, path.parent, budget)
        accessors = Accessors(document, buffers, budget)
        materials = Materials(document, buffers, path.parent, notes)
        scene = _Scene(document, accessors, materials, budget, notes)
        found = [(place.name, scene.pieces(place)) for place in placements(document, accessors, notes)]
        scene.note_others()
        return found


_Key = tuple[int, tuple[float, ...], bool]
"""A mesh, the weights of its morph targets, and whether a skin moves it."""


class _Scene:
    """Reads each mesh once, and places it as often as the scene does."""

    def __init__(
        self, document: Document, accessors: Accessors, materials: Materials, budget: Budget, notes: Notes
    ) -> None:
        self._document = document
        self._accessors = accessors
        self._materials = materials
        self._budget = budget
        self._notes = notes
        self._meshes: dict[_Key, list[tuple[Piece, Skinned | None]]] = {}

    def pieces(self, place: Placement) -> list[Piece]:
        """Return the pieces of a mesh at a node, in the scene."""
        self._budget.work(len(place.matrices), place.name)
        found = []
        for piece, skinned in self._mesh(place):
            if place.joints is not None and skinned is not None:
                self._budget.place(1, piece, place.name)
                found.append(posed(piece, skinned, place.joints, f"mesh {place.mesh}"))
            else:
                self._budget.place(len(place.matrices), piece, place.name)
                found.append(placed(piece, place.matrices))
        return found

    def note_others(self) -> None:
        """Note the meshes that the scene does not show."""
        shown = {mesh for mesh, _, _ in self._meshes}
        for index, mesh in enumerate(self._document.meshes):
            if mesh.primitives and index not in shown:
                self._notes.add("meshes that the scene does not show are left out", f"mesh {index}")

    def _mesh(self, place: Placement) -> list[tuple[Piece, Skinned | None]]:
        """Return the pieces of a mesh at the origin, with their skins."""
        key = place.mesh, place.weights, place.joints is not None
        if key not in self._meshes:
            self._meshes[key] = list(self._read(place))
        return self._meshes[key]

    def _read(self, place: Placement) -> Iterator[tuple[Piece, Skinned | None]]:
        for index, primitive in enumerate(self._document.meshes[place.mesh].primitives):
            name = f"mesh {place.mesh} primitive {index}"
            skinned = place.joints is not None
            part = read_primitive(
                primitive, place.weights, self._accessors, self._materials, self._notes, name, skinned=skinned
            )
            if part is not None:
                yield part
