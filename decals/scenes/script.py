"""Scenes as Python scripts that rebuild them with the public API."""

import io
import os
import sys
from dataclasses import fields
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import blobtree
from blobtree import Node, Outline
from blobtree.declare.parameters import Quantity, fields_of, parameters_of
from blobtree.files import replacing, write_atomically
from blobtree.nodes.values import left_out
from decals.errors import InvalidScene
from decals.model import COLUMNS, Decals
from decals.rendering.environment import Environment
from decals.rendering.lights import Lighting
from decals.rendering.options import Background, Drawing
from decals.scenes.material import MAP_NAMES, DecalMaterial
from decals.scenes.objects import MeshObject, SceneObject
from decals.scenes.origin import WORLD
from decals.scenes.scene import DecalImage, Scene, require_scene
from decals.surfaces.base_color import COLOR_ARRAYS, BaseColor
from decals.surfaces.windings import MeshOrientation

MAX_ROWS = 2000
"""Decals that a script lists as text; more stand in the file of arrays."""

LIMITS = COLUMNS[-3:]
"""Columns that are written if some decals have them."""


def write_script(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a Python script whose ``scene`` equals a scene: nodes and decals one by one, with their values.

    Meshes, pictures of files, and more than 2,000 decals stand beside it, in a file of arrays with the suffix
    ".npz".

    Parameters
    ----------
    scene : Scene
        The scene.
    path : str or path
        The script, which ends in ".py".

    Raises
    ------
    InvalidScene
        The scene holds a `Volume`, whose samples are no text; or the file cannot be written.

    Examples
    --------
    >>> import pathlib, runpy, tempfile, decals
    >>> from blobtree import Point
    >>> from decals.scenes.script import write_script
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"])
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "ball.py"
    >>> write_script(scene, path)
    >>> rebuilt = runpy.run_path(path)["scene"]
    >>> bool((rebuilt.decals.positions == scene.decals.positions).all())
    True
    """
    require_scene("scene", scene, "write the scene that was posed, and a call of decals.pose")
    path = Path(path)
    script = _Script(path.with_suffix(".npz").name)
    text = script.text_of(scene)
    try:
        with replacing(path) as temporary:  # which refuses a bad path before the arrays are written
            temporary.write_bytes(text.encode())
            if script.arrays:
                buffer = io.BytesIO()
                np.savez_compressed(buffer, **script.arrays)  # type: ignore[arg-type]  # arrays by name
                write_atomically(path.with_suffix(".npz"), buffer.getvalue())
    except OSError as error:
        raise InvalidScene(f"could not write {str(path)!r}: {error}") from error


class _Script:
    """The lines of a script, the modules that it imports, and its arrays."""

    def __init__(self, arrays_file: str) -> None:
        self.arrays: dict[str, NDArray[Any]] = {}
        self._file = arrays_file
        self._lines: list[str] = []
        self._imports: set[str] = set()
        self._names: dict[int, str] = {}

    def text_of(self, scene: Scene) -> str:
        """Return the text of the script."""
        objects = [self._object(item) for item in scene.objects]
        images = [self._image(image) for image in scene.images]
        decals = self._decals("decals", scene.decals)
        camera, drawing = scene.camera, self._drawing(scene.drawing)
        view = ", ".join(repr(getattr(camera, name)) for name in ("position", "target", "up", "fov"))
        if camera.fit is not None and camera.fit.points:
            fit = f".fitted_to({list(camera.fit.points)!r}, margin={camera.fit.margin!r})"
        else:
            fit = ""
        head = ['"""A scene of Implicit Decals; run this file to see it, or import ``scene``."""', ""]
        if self.arrays:
            head += ["from pathlib import Path", ""]
        if self.arrays or len(scene.decals):
            head += ["import numpy as np", ""]
        head += ["import blobtree", "import decals", *sorted(self._imports), ""]
        if self.arrays:
            head.append(f"arrays = np.load(Path(__file__).with_name({self._file!r}))")
        body = [
            *self._lines,
            "",
            f"camera = decals.Camera({view}){fit}",
            "scene = decals.Scene(",
            f"    objects=[{', '.join(objects)}],",
            f"    images=[{', '.join(images)}],",
            "    camera=camera,",
            f"    decals={decals},",
            *([] if scene.drawing == Drawing() else [f"    drawing={drawing},"]),
            *(
                [f"    hidden_decals={self._decals('hidden', scene.hidden_decals)},"]
                if len(scene.hidden_decals)
                else []
            ),
            *(
                f"    {name}={value!r},"
                for name in ("locked_layers", "layer_names")
                if (value := getattr(scene, name))
            ),
            ")",
            "",
            'if __name__ == "__main__":',
            "    decals.show(scene)",
            "",
        ]
        return "\n".join(head + body)

    def _array(self, name: str, array: NDArray[Any]) -> str:
        """Put an array into the file of arrays, and return the expression that reads it."""
        self.arrays[name] = array
        return f"arrays[{name!r}]"

    def _object(self, item: SceneObject) -> str:
        number = len(self._names)
        if isinstance(item, MeshObject):
            vertices = self._array(f"vertices_{number}_{item.name}", item.vertices)
            faces = self._array(f"faces_{number}_{item.name}", item.faces)
            self._names[id(item)] = item.name
            placed = ""
            if item.coordinates is not None:
                placed = f", coordinates={self._array(f'places_{number}_{item.name}', item.coordinates)}"
            return (
                f"decals.MeshObject({item.name!r}, {vertices}, {faces}, {self._color(item)}, "
                f"source={item.source!r}, crease_angle={item.crease_angle!r}{_more(item)}{placed})"
            )
        return f"decals.TreeObject({item.name!r}, {self._tree(item.tree)}{_more(item)})"

    def _color(self, item: MeshObject) -> str:
        """Return the expression of a mesh's colour; arrays of colours go into the file of arrays."""
        color = item.color
        if not isinstance(color, BaseColor):
            return repr(color)
        number = len(self.arrays)
        values = {name: getattr(color, name) for name in COLOR_ARRAYS}
        given = [
            f"{name}={self._array(f'{name}_{number}_{item.name}', values[name])}"
            for name in COLOR_ARRAYS
            if values[name] is not None
        ]
        textures = [
            f"decals.surfaces.BaseTexture({self._array(f'texture_{number}_{place}', texture.pixels)}, "
            f"{tuple(mode.value for mode in texture.wrap)!r})"
            for place, texture in enumerate(color.textures)
        ]
        given += [f"textures=[{', '.join(textures)}]"] * bool(textures)
        given += [f"source={color.source!r}"] * (color.source is not None)
        return f"decals.surfaces.BaseColor({', '.join(given)})"

    def _tree(self, tree: Node) -> str:
        """Write one line for each node, operands first, and return the name of the last one."""
        pending: list[tuple[Node, bool]] = [(tree, False)]
        while pending:
            node, operands_written = pending.pop()
            if id(node) in self._names:
                continue
            if not operands_written:
                pending += [(node, True), *((child, False) for child in reversed(node.children))]
                continue
            name = f"{type(node).__name__.lower()}_{len(self._names) + 1}"
            self._names[id(node)] = name
            self._lines.append(f"{name} = {self._node(node)}")
        return self._names[id(tree)]

    def _node(self, node: Node) -> str:
        kind, declared = type(node), parameters_of(type(node))
        if any(parameter.quantity is Quantity.SAMPLES for parameter in declared.values()):
            raise InvalidScene(
                f"a {kind.__name__} holds samples, which no script lists; save the scene as JSON"
            )
        values = []
        for field in fields_of(kind):
            value = getattr(node, field.name)
            if not left_out(field, value):
                text = repr(value) if field.name in declared else self._operands(value)
                if isinstance(value, Outline):
                    text = f"blobtree.{text}"
                values.append(f"{field.name}={text}")
        if getattr(blobtree, kind.__name__, None) is kind:
            return f"blobtree.{kind.__name__}({', '.join(values)})"
        self._imports.add(f"from {_module_of(kind)} import {kind.__name__}")
        return f"{kind.__name__}({', '.join(values)})"

    def _operands(self, value: Any) -> str:
        if isinstance(value, tuple):
            names = [self._names[id(node)] for node in value]
            return f"({', '.join(names)}{',' if len(names) == 1 else ''})"
        return self._names[id(value)]

    def _image(self, image: DecalImage) -> str:
        if image.is_generated:
            return repr(image.source)
        if isinstance(image, DecalMaterial):
            number = len(self.arrays)
            maps = {name: getattr(image, name) for name in MAP_NAMES}
            given = [
                f"{name}={self._array(f'material_{number}_{name}', map_)}"
                for name, map_ in maps.items()
                if map_ is not None
            ]
            given += [f"relief={image.relief!r}"] if image.relief else []
            return f"decals.DecalMaterial({image.source!r}, {', '.join(given)})"
        pixels = self._array(f"image_{len(self.arrays)}", image.pixels)
        return f"decals.DecalImage({image.source!r}, {pixels})"

    def _drawing(self, drawing: Drawing) -> str:
        """Return the expression of how a scene is drawn; options with their default are left out."""
        given = {field.name: getattr(drawing, field.name) for field in fields(Drawing)}
        standard = Drawing()
        texts = [
            f"{name}=decals.{type(value).__name__}.{value.name}"
            if isinstance(value, Enum)
            else f"{name}={self._value(value)}"
            for name, value in given.items()
            if value != getattr(standard, name)
        ]
        return f"decals.rendering.Drawing({', '.join(texts)})"

    def _value(self, value: Any) -> str:
        """Return the text of a number, of a background, of lights or of an environment."""
        if isinstance(value, Lighting):
            lights = "".join(f"decals.rendering.{light!r}, " for light in value.lights)
            return f"decals.rendering.Lighting(({lights}), {value.frame!r})"
        if isinstance(value, Environment):
            light = self._array("environment", value.picture.light)
            others = (f", {field.name}={getattr(value, field.name)!r}" for field in fields(value)[1:])
            return f"decals.rendering.Environment({light}{''.join(others)})"
        return f"decals.rendering.{value!r}" if isinstance(value, Background) else repr(value)

    def _decals(self, part: str, decals: Decals) -> str:
        if not len(decals):
            return "decals.Decals.empty()"
        lines = ["decals.Decals("]
        for name in COLUMNS:
            column = getattr(decals, name)
            if name in LIMITS and not column.astype(np.bool_).any():
                continue
            if name == "receivers":
                column = np.array(column.tolist(), np.str_)
            if len(decals) > MAX_ROWS:
                value = self._array(f"{part}_{name}", column)
            elif (column == column[:1]).all() and name not in COLUMNS[:4]:
                value = f"np.full({column.shape!r}, {_number_text(column[0])}, {_type_name(column)!r})"
            else:
                rows = ",\n".join(f"            {_number_text(row)}" for row in column)
                listed = f"            [\n{rows},\n            ],"
                value = f"np.array(\n{listed}\n            {_type_name(column)!r},\n        )"
            lines.append(f"        {name}={value},")
        return "\n".join([*lines, "    )"])


def _module_of(kind: type[Node]) -> str:
    """Return the name of a module that has a custom class, or raise `InvalidScene`."""
    modules = {name: module for name, module in [*sys.modules.items()] if name != "__main__"}
    found = [name for name, module in modules.items() if vars(module).get(kind.__name__) is kind]
    if not found:
        raise InvalidScene(
            f"a script can import {kind.__name__} from no module; define it in a file that is imported, "
            f"as a variable of that name: {kind.__name__} = ..."
        )
    return min(found, key=len)


def _type_name(column: NDArray[Any]) -> str:
    """Return the name of the type of an array, as `numpy.array` takes it."""
    return "str" if column.dtype.kind == "U" else column.dtype.name


def _number_text(values: Any) -> str:
    """Return numbers as text that reads back to the same bits; float32 needs at most nine digits."""
    array = np.asarray(values)
    if array.ndim:
        return f"[{', '.join(map(_number_text, array))}]"
    return repr(float(str(array[()]))) if array.dtype == np.float32 else repr(array.item())


def _more(item: SceneObject) -> str:
    """Return the arguments of an object's origin, flags, labels and names of nodes, unless default."""
    standard = {"origin": WORLD, "hidden": (), "locked": (), "labels": (), "named_only": False, "names": {}}
    if getattr(item, "orientation", None) is MeshOrientation.KEEP:
        return _given(item, standard) + ', orientation="keep"'
    return _given(item, standard)


def _given(item: SceneObject, standard: dict[str, Any]) -> str:
    """Return the arguments that differ from the standard ones."""
    given = {name: getattr(item, name, standard[name]) for name in standard}
    return "".join(f", {name}={value!r}" for name, value in given.items() if value != standard[name])
