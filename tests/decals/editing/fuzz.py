"""Commands at random, sensible ones and others."""

from typing import Any

import numpy as np

from blobtree import Point
from blobtree.nodes.paths import primitive_paths
from blobtree.nodes.surgery import Join
from decals import Camera, DecalImage, MeshObject, TreeObject
from decals.editing import (
    AddDecals,
    AddImage,
    AddObject,
    AddPrimitive,
    DeleteDecals,
    DuplicateDecals,
    DuplicatePrimitive,
    JoinPrimitive,
    MoveDecals,
    MovePrimitive,
    OrderDecals,
    PaintPrimitive,
    RelaxDecals,
    RemoveImage,
    RemoveObject,
    RemovePrimitive,
    ReplaceDecals,
    ReplaceImage,
    ReplaceNode,
    ResizePrimitive,
    ScaleDecals,
    SetCamera,
    SetParameter,
    SetValues,
    TurnDecals,
)
from tests.decals.editing.scenes import TREE, box, one

OBJECTS = (
    TreeObject("more", TREE.translate((0, 3, 0))),
    MeshObject("crate", *box((-1, -4, -1), (1, -2, 1))),
    MeshObject("chest", *box((2, -1, -1), (3, 1, 1))),
)
PICTURES = (DecalImage.load("rivet"), DecalImage.load("tile"))


class RandomCommands:
    """Makes commands for a document; about one in ten makes no sense."""

    def __init__(self, seed: int, document: Any, spare_decals: Any) -> None:
        self.rng = np.random.default_rng(seed)
        self.document = document
        self.spare_decals = spare_decals
        self.makers = (
            self.add, self.delete, self.alter, self.scale, self.turn, self.carry, self.duplicate, self.order,
            self.add_image, self.change_image, self.remove_image, self.look, self.primitive,
            self.primitive, self.shape, self.relax, self.scatter, self.add_object, self.remove_object,
        )  # fmt: skip

    def command(self) -> Any:
        return self.makers[self.rng.integers(len(self.makers))]()

    def nonsense(self) -> Any:
        return self.rng.random() < 0.1

    def numbers(self) -> Any:
        if self.nonsense():
            return self.rng.integers(-2, self.document.decals.next_number + 3, 2)
        there = self.document.decals.numbers
        return self.rng.permutation(there)[: self.rng.integers(1, 5)]

    def place(self) -> Any:
        if not self.document.objects:
            return self.rng.normal(size=(2, 3)).astype(np.float32)
        item = self.document.objects[self.rng.integers(len(self.document.objects))]
        positions, normals = item.surface.sample(1, int(self.rng.integers(1 << 30)))
        return positions[0], normals[0]

    def add(self) -> Any:
        position, normal = self.place()
        image = int(self.rng.integers(-1, len(self.document.images) + self.nonsense()))
        tangent, radius = normal[[1, 2, 0]] + 0.1, self.rng.uniform(0.05, 0.4)
        frame = {"positions": [position], "normals": [normal], "tangents": [tangent]}
        return AddDecals(one().replace(**frame, radii=[radius], images=[image]))

    def delete(self) -> Any:
        return DeleteDecals(self.numbers())

    def alter(self) -> Any:
        values = (
            {"tints": self.rng.uniform(0, 1.05, 3)},
            {"opacities": self.rng.uniform(-0.05, 1)},
            {"layers": int(self.rng.integers(-2, 3))},
            {"interactions": int(self.rng.integers(0, 4))},
            {"images": int(self.rng.integers(-1, len(self.document.images) + 1))},
            {"spill": bool(self.rng.integers(2))},
            {
                "fade_angles": float(self.rng.uniform(-20, 180)),
                "receivers": str(self.rng.choice(["", "none"])),
            },
            {"colour": 1},
        )
        return SetValues.each(self.numbers(), **values[self.rng.integers(len(values))])

    def scale(self) -> Any:
        return ScaleDecals(self.numbers(), -1.0 if self.nonsense() else float(self.rng.uniform(0.7, 1.4)))

    def turn(self) -> Any:
        return TurnDecals(self.numbers(), np.nan if self.nonsense() else float(self.rng.uniform(-180, 180)))

    def carry(self) -> Any:
        position, normal = self.place()
        return MoveDecals(self.numbers(), position * (np.nan if self.nonsense() else 1), normal)

    def duplicate(self) -> Any:
        return DuplicateDecals(self.numbers()[:2])

    def order(self) -> Any:
        return OrderDecals(self.numbers(), bool(self.rng.integers(2)))

    def add_image(self) -> Any:
        return AddImage(PICTURES[self.rng.integers(2)])

    def change_image(self) -> Any:
        return ReplaceImage(int(self.rng.integers(-1, 4)), PICTURES[self.rng.integers(2)])

    def remove_image(self) -> Any:
        return RemoveImage(int(self.rng.integers(-1, 6)))

    def look(self) -> Any:
        return SetCamera(Camera(tuple(self.rng.normal(size=3) + 5)))

    def path(self) -> Any:
        """Of a primitive, and how many its tree has."""
        number = int(self.rng.integers(len(self.document.objects) + 1))
        paths: list[tuple[int, ...]] = [(0, 9)]
        item = self.document.objects[number] if number < len(self.document.objects) else None
        if isinstance(item, TreeObject):
            paths = primitive_paths(item.tree)
        return number, paths[self.rng.integers(len(paths))], len(paths)

    def shape(self) -> Any:
        number, path, count = self.path()
        kind = self.rng.integers(2, 4) if count > 6 else self.rng.integers(4)
        if kind == 0:
            ball = Point(self.place()[0], radius=float(self.rng.uniform(0.2, 0.5)))
            return AddPrimitive(number, path, ball, list(Join)[self.rng.integers(5)])
        if kind == 1:
            return DuplicatePrimitive(number, path, self.rng.normal(0, 0.5, 3))
        if kind == 2:
            return JoinPrimitive(
                number, path, "weld" if self.nonsense() else list(Join)[self.rng.integers(5)]
            )
        return RemovePrimitive(number, path)

    def primitive(self) -> Any:
        number, path, _ = self.path()
        kind = self.rng.integers(5)
        if kind == 3:
            return SetParameter(number, path, "center" if self.nonsense() else "radius", 0.3)
        if kind == 4:
            return ReplaceNode(number, path, Point(self.place()[0], radius=0.4))
        if kind == 0:
            return PaintPrimitive(number, path, self.rng.uniform(0, 1.05, 3))
        if kind == 1:
            return ResizePrimitive(
                number, path, 0.0 if self.nonsense() else float(self.rng.uniform(0.9, 1.1))
            )
        return MovePrimitive(number, path, self.rng.normal(0, 0.05, 3) * (np.nan if self.nonsense() else 1))

    def add_object(self) -> Any:
        item: Any = "none" if self.nonsense() else OBJECTS[self.rng.integers(len(OBJECTS))]
        return AddObject(item)

    def remove_object(self) -> Any:
        return RemoveObject(int(self.rng.integers(-1, 4)))

    def relax(self) -> Any:
        return RelaxDecals(self.place()[0] * (np.nan if self.nonsense() else 1))

    def scatter(self) -> Any:
        few = self.rng.permutation(len(self.spare_decals))[: self.rng.integers(0, 80)]
        return ReplaceDecals((int(self.rng.integers(2 + self.nonsense())),), self.spare_decals[few])
