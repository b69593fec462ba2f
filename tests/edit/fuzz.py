"""Commands at random, sensible ones and others."""

import numpy as np

from blobtree import Point
from decals.edit import (
    Add,
    AddImage,
    AddObject,
    AddPrimitive,
    Alter,
    Carry,
    ChangeImage,
    Coat,
    Delete,
    Duplicate,
    DuplicatePrimitive,
    Join,
    JoinPrimitive,
    Look,
    MovePrimitive,
    PaintPrimitive,
    Relax,
    RemoveImage,
    RemoveObject,
    RemovePrimitive,
    ResizePrimitive,
    Scale,
    Turn,
)
from decals.edit.trees import primitive_paths
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, MeshObject, TreeObject
from tests.edit.scenes import TREE, box, one

OBJECTS = (
    TreeObject("more", TREE.translate((0, 3, 0))),
    MeshObject("crate", *box((-1, -4, -1), (1, -2, 1))),
    MeshObject("chest", *box((2, -1, -1), (3, 1, 1))),
)
PICTURES = (DecalImage.load("rivet"), DecalImage.load("tile"))


class Monkey:
    """Makes commands for a document; about one in ten makes no sense."""

    def __init__(self, seed, document, coat):
        self.rng = np.random.default_rng(seed)
        self.document = document
        self.coat = coat
        self.makers = (
            self.add, self.delete, self.alter, self.scale, self.turn, self.carry, self.duplicate,
            self.add_image, self.change_image, self.remove_image, self.look, self.primitive,
            self.primitive, self.shape, self.relax, self.scatter, self.add_object, self.remove_object,
        )  # fmt: skip

    def command(self):
        return self.makers[self.rng.integers(len(self.makers))]()

    def nonsense(self):
        return self.rng.random() < 0.1

    def numbers(self):
        if self.nonsense():
            return self.rng.integers(-2, self.document.decals.next_number + 3, 2)
        there = self.document.decals.numbers
        return self.rng.permutation(there)[: self.rng.integers(1, 5)]

    def place(self):
        if not self.document.objects:
            return self.rng.normal(size=(2, 3)).astype(np.float32)
        item = self.document.objects[self.rng.integers(len(self.document.objects))]
        positions, normals = item.surface.sample(1, int(self.rng.integers(1 << 30)))
        return positions[0], normals[0]

    def add(self):
        position, normal = self.place()
        image = int(self.rng.integers(-1, len(self.document.images) + self.nonsense()))
        return Add(one().replace(positions=[position], normals=[normal], tangents=[normal[[1, 2, 0]] + 0.1],
                                 radii=[self.rng.uniform(0.05, 0.4)], images=[image]))  # fmt: skip

    def delete(self):
        return Delete(self.numbers())

    def alter(self):
        values = (
            {"tints": self.rng.uniform(0, 1.05, 3)},
            {"opacities": self.rng.uniform(-0.05, 1)},
            {"layers": int(self.rng.integers(-2, 3))},
            {"interactions": int(self.rng.integers(0, 4))},
            {"images": int(self.rng.integers(-1, len(self.document.images) + 1))},
            {"spill": bool(self.rng.integers(2))},
            {"colour": 1},
        )
        return Alter.each(self.numbers(), **values[self.rng.integers(len(values))])

    def scale(self):
        return Scale(self.numbers(), -1.0 if self.nonsense() else float(self.rng.uniform(0.7, 1.4)))

    def turn(self):
        return Turn(self.numbers(), np.nan if self.nonsense() else float(self.rng.uniform(-180, 180)))

    def carry(self):
        position, normal = self.place()
        return Carry(self.numbers(), position * (np.nan if self.nonsense() else 1), normal)

    def duplicate(self):
        return Duplicate(self.numbers()[:2])

    def add_image(self):
        return AddImage(PICTURES[self.rng.integers(2)])

    def change_image(self):
        return ChangeImage(int(self.rng.integers(-1, 4)), PICTURES[self.rng.integers(2)])

    def remove_image(self):
        return RemoveImage(int(self.rng.integers(-1, 6)))

    def look(self):
        return Look(Camera(tuple(self.rng.normal(size=3) + 5)))

    def path(self):
        """Of a primitive, and how many its tree has."""
        number = int(self.rng.integers(len(self.document.objects) + 1))
        paths = [(0, 9)]
        if number < len(self.document.objects) and isinstance(self.document.objects[number], TreeObject):
            paths = primitive_paths(self.document.objects[number].tree)
        return number, paths[self.rng.integers(len(paths))], len(paths)

    def shape(self):
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

    def primitive(self):
        number, path, _ = self.path()
        kind = self.rng.integers(3)
        if kind == 0:
            return PaintPrimitive(number, path, self.rng.uniform(0, 1.05, 3))
        if kind == 1:
            return ResizePrimitive(
                number, path, 0.0 if self.nonsense() else float(self.rng.uniform(0.9, 1.1))
            )
        return MovePrimitive(number, path, self.rng.normal(0, 0.05, 3) * (np.nan if self.nonsense() else 1))

    def add_object(self):
        return AddObject("none" if self.nonsense() else OBJECTS[self.rng.integers(len(OBJECTS))])

    def remove_object(self):
        return RemoveObject(int(self.rng.integers(-1, 4)))

    def relax(self):
        return Relax(self.place()[0] * (np.nan if self.nonsense() else 1))

    def scatter(self):
        few = self.rng.permutation(len(self.coat))[: self.rng.integers(0, 80)]
        return Coat((int(self.rng.integers(2 + self.nonsense())),), self.coat[few])
