"""Reader of 3MF files (3MF Consortium, core specification 1.3): all objects that are built, as one mesh."""

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from blobtree._typing import Float64Array
from decals.surfaces.files.faults import Notes, Unreadable, reading
from decals.surfaces.files.pieces import Budget, Piece, mesh_of, placed
from decals.surfaces.files.threemf_colors import Colors
from decals.surfaces.files.threemf_model import Model, Object, Use, parse_model
from decals.surfaces.files.threemf_package import Package, open_package
from decals.surfaces.mesh_data import MeshData

_logger = logging.getLogger(__name__)

MAX_PLACES = 1 << 20
"""Most objects that a file places; components of components may be very many."""

_Key = tuple[str, int]
"""The part of a package and the number of an object in it."""


def read_3mf(path: Path) -> MeshData:
    """Read the objects that a 3MF file builds. The unit of the file stays, and the log names it.

    Vertices are float64.

    Raises
    ------
    InvalidMesh
        If the file is damaged, or refers to what it does not have.
    """
    return mesh_of(list(_objects(path).values()))


def threemf_objects(path: Path) -> dict[str, MeshData]:
    """Return the meshes of the objects of a 3MF file by their numbers, each with all its copies."""
    return {name: mesh_of([piece]) for name, piece in _objects(path).items()}


def _objects(path: Path) -> dict[str, Piece]:
    """Return the objects that a file builds, each with all its copies."""
    with reading(path, "3MF") as notes, open_package(path) as package:
        build = _Build(package, notes)
        _logger.info("%s: the unit is 1 %s", path, build.unit)
        budget, pieces = Budget(), {}
        budget.grow(path.stat().st_size)
        for key, matrices in build.places().items():
            mesh = build.mesh(key)
            if mesh is not None:
                name = f"object {key[1]}" if key[0] == package.model_part else f"object {key[1]} of {key[0]}"
                budget.place(len(matrices), mesh, name)
                pieces[name] = placed(mesh, np.array(matrices))
        return pieces


def _key_of(use: Use, part: str) -> _Key:
    """Return the key of an object that a part uses."""
    return use.part or part, use.number


class _Build:
    """The objects of a package, and where they are built."""

    def __init__(self, package: Package, notes: Notes) -> None:
        self._package = package
        self._notes = notes
        self._models: dict[str, Model] = {}
        self._colors = Colors(package, notes)

    def object(self, key: _Key) -> Object:
        """Return an object."""
        part, number = key
        model = self._model(part)
        if number not in model.objects:
            raise Unreadable(f"object {number} of {part!r} is missing")
        return model.objects[number]

    def _parts(self, key: _Key) -> Iterator[_Key]:
        """Yield the components of an object."""
        return (_key_of(component, key[0]) for component in self.object(key).components)

    @property
    def unit(self) -> str:
        """Unit of the numbers."""
        return self._model(self._package.model_part).unit

    def mesh(self, key: _Key) -> Piece | None:
        """Return the mesh of an object with its colours; None if it has none."""
        item = self.object(key)
        if item.mesh is None or item.properties is None:
            return item.mesh
        color = self._colors.of(self._model(key[0]), item.properties, f"object {key[1]}")
        return replace(item.mesh, color=color)

    def places(self) -> dict[_Key, list[Float64Array]]:
        """Return the maps of each object's copies to the build."""
        main = self._package.model_part
        uses = [*self._uses()]
        if sum(self._counts([_key_of(use, main) for use in uses])) > MAX_PLACES:
            raise Unreadable(f"it places more than {MAX_PLACES:,} objects")
        found: dict[_Key, list[Float64Array]] = {}
        rest = [(use, main, np.eye(4)) for use in uses]
        while rest:
            use, part, parent = rest.pop()
            key = _key_of(use, part)
            item = self.object(key)
            with np.errstate(over="ignore", invalid="ignore"):
                matrix = parent @ use.matrix
            if not np.isfinite(matrix).all():
                raise Unreadable(f"object {use.number} lies at a place that is no finite number")
            if item.mesh is None and not item.components:
                self._notes.add("objects without triangles are left out", f"object {use.number}")
            found.setdefault(key, []).append(matrix)
            rest.extend((component, key[0], matrix) for component in reversed(item.components))
        return found

    def _counts(self, keys: list[_Key]) -> list[int]:
        """Return how many objects each of some objects places, itself included."""
        counts: dict[_Key, int] = {}
        for first in keys:
            path = {first: self._parts(first)}  # from the object to the one that is counted
            while path:
                key, parts = next(reversed(path.items()))
                part = next((part for part in parts if part not in counts), None)
                if part is None:
                    counts[key] = 1 + sum(counts[part] for part in self._parts(key))
                    del path[key]
                elif part in path:
                    raise Unreadable(f"object {key[1]} is a component of itself")
                else:
                    path[part] = self._parts(part)
        return [counts[key] for key in keys]

    def _uses(self) -> Iterator[Use]:
        """Yield what is built, the last first; all objects that are no components if that is nothing."""
        model = self._model(self._package.model_part)
        if model.items:
            return reversed(model.items)
        parts = {use.number for item in model.objects.values() for use in item.components if not use.part}
        return (Use(number, None, np.eye(4)) for number in reversed(model.objects) if number not in parts)

    def _model(self, part: str) -> Model:
        if part not in self._models:
            self._models[part] = parse_model(self._package.chunks(part), self._notes)
        return self._models[part]
