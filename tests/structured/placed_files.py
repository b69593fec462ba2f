"""glTF and 3MF files in many written forms, with the triangles that they show; and damaged ones.

A form of a file is drawn at random. The triangles follow from float64 matrices here, not from the product.
"""

import base64
import io
import json
import random
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from tests.decals.meshes import icosphere
from tests.structured.model import PolygonMesh, StructuredFile

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

_NUMBERS = [-1, 0, 1, 7, 255, 10**6, 2**31, 2**32 - 1, 2**63, 10**30, 0.5, -1e308, 1e308, 1e-320]
HOSTILE: list[Any] = [
    *_NUMBERS,
    True,
    None,
    "",
    "x",
    "../a.bin",
    "data:,",
    "data:;base64,!",
    [],
    {},
    [0],
    [[]],
]
"""Values in place of one of a file."""


@dataclass(frozen=True)
class SceneFile:
    """A model with the files beside it, by their names, and its triangles, ``[m, 3, 3]``, in any order."""

    files: dict[str, bytes]
    triangles: Any
    form: str

    @property
    def name(self) -> str:
        """Name of the model's file, which is the first."""
        return next(iter(self.files))

    def write(self, folder: Path) -> Path:
        """Write the files into a folder, and return the path of the model."""
        for name, content in self.files.items():
            (folder / name).write_bytes(content)
        return folder / self.name

    def structured(self) -> StructuredFile:
        """Return the same with polygons in place of triangles."""
        mesh = None
        if self.triangles is not None:
            points = np.asarray(self.triangles, np.float64).reshape(-1, 3)
            mesh = PolygonMesh(points, np.arange(len(points)).reshape(-1, 3).tolist())
        (name, content), *others = self.files.items()
        return StructuredFile(Path(name).suffix, content, mesh, dict(others))


BROKEN = 0.45
"""Share of broken files."""


def gltf(chance: random.Random) -> StructuredFile:
    """Return a glTF or GLB file: accessors, nodes, skins and copies of all forms, or broken ones."""
    return (broken_gltf if chance.random() < BROKEN else random_gltf)(chance).structured()


def threemf(chance: random.Random) -> StructuredFile:
    """Return a 3MF file: objects, components and parts of all forms, or broken ones."""
    return (broken_3mf if chance.random() < BROKEN else random_3mf)(chance).structured()


# -- glTF -------------------------------------------------------------------------------------------------


@dataclass
class GltfWriter:
    """A glTF document whose accessors are written one after the other."""

    document: dict[str, Any] = field(default_factory=lambda: {"asset": {"version": "2.0"}})
    content: bytearray = field(default_factory=bytearray)

    def add(self, kind: str, **record: Any) -> int:
        """Append a record to one of the lists, and return its index."""
        self.document.setdefault(kind, []).append(record)
        return len(self.document[kind]) - 1

    def view(self, data: bytes, **options: Any) -> int:
        """Append bytes as a buffer view."""
        self.content += bytes(-len(self.content) % 4)
        start = len(self.content)
        self.content += data
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(data), **options)

    def accessor(self, array: Any, gap: int = 0, **options: Any) -> int:
        """Append rows of an array as an accessor, with bytes between them if there should be a gap."""
        rows = np.ascontiguousarray(array)
        rows = rows.reshape(len(rows), -1)
        size = rows.itemsize * rows.shape[1]
        table = np.zeros((len(rows), size + gap), np.uint8)
        table[:, :size] = rows.view(np.uint8).reshape(len(rows), size)
        view = self.view(table.tobytes(), **({"byteStride": size + gap} if gap else {}))
        return self.described(rows, bufferView=view, **options)

    def described(self, rows: Any, **options: Any) -> int:
        """Append an accessor for rows that are elsewhere."""
        kind = COMPONENTS[rows.dtype.str[1:]]
        return self.add(
            "accessors", componentType=kind, count=len(rows), type=KINDS[rows.shape[1]], **options
        )

    def sparse(self, array: Any) -> int:
        """Append rows as an accessor that is zero but for those rows."""
        rows = np.ascontiguousarray(array)
        numbers = np.flatnonzero((rows != 0).any(axis=1)).astype(np.uint16)
        if not len(numbers):
            return self.described(rows)
        indices = {"bufferView": self.view(numbers.tobytes()), "componentType": COMPONENTS["u2"]}
        values = {"bufferView": self.view(rows[numbers].tobytes())}
        return self.described(rows, sparse={"count": len(numbers), "indices": indices, "values": values})

    def files(self, form: str, encoding: str = "utf-8") -> dict[str, bytes]:
        """Return the files in a form: "glb", "data" or "bin"."""
        buffer: dict[str, Any] = {"byteLength": len(self.content)}
        name = "points & 100 %.bin"
        if form == "data":
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.content).decode()
        elif form == "bin":
            buffer["uri"] = quote(name)
        text = json.dumps({**self.document, "buffers": [buffer]}).encode(encoding)
        if form == "glb":
            return {"model.glb": glb(text, bytes(self.content))}
        return {"model.gltf": text} | ({name: bytes(self.content)} if form == "bin" else {})


def glb(text: bytes, binary: bytes) -> bytes:
    """Return a GLB file of a JSON text and a binary chunk."""
    chunks = b""
    for kind, data, fill in ((b"JSON", text, b" "), (b"BIN\0", binary, b"\0")):
        data += fill * (-len(data) % 4)
        chunks += struct.pack("<I", len(data)) + kind + data
    return b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks


def matrix_of(translation: Any, rotation: Any, scale: Any) -> Any:
    """Return the matrix of a translation, a unit quaternion and scales: the rows of Rodrigues' formula."""
    axis, real = np.asarray(rotation[:3], float), rotation[3]
    matrix = np.eye(4)
    turn = np.stack(
        [unit + 2 * np.cross(axis, np.cross(axis, unit) + real * unit) for unit in np.eye(3)], axis=1
    )
    matrix[:3, :3] = turn * np.asarray(scale, float)
    matrix[:3, 3] = translation
    return matrix


def moved(triangles: Any, matrix: Any) -> Any:
    """Return triangles that a matrix moves, turned if it mirrors them."""
    found = triangles @ matrix[:3, :3].T + matrix[:3, 3]
    return found[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else found


def random_place(chance: random.Random) -> tuple[dict[str, Any], Any]:
    """Return the record of a node's place, as three parts or as a matrix, and the matrix."""
    rotation = np.array([chance.gauss(0, 1) for _ in range(4)])
    rotation /= np.linalg.norm(rotation)
    scale = [chance.uniform(0.5, 2) * chance.choice((1, 1, -1)) for _ in range(3)]
    translation = [chance.uniform(-5, 5) for _ in range(3)]
    matrix = matrix_of(translation, rotation, scale)
    if chance.random() < 0.4:
        return {"matrix": matrix.T.ravel().tolist()}, matrix
    return {"translation": translation, "rotation": rotation.tolist(), "scale": scale}, matrix


class _GltfModel:
    """Draws the parts of a model, and writes them."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.writer = GltfWriter()
        self.form: list[str] = []

    def pick(self, *names: str) -> str:
        """Return one of the names, and note it as part of the form."""
        name = self.chance.choice(names)
        self.form.append(name)
        return name

    def mesh(self) -> tuple[int, Any, bool]:
        """Append a mesh; return its index, its triangles, and whether a skin moves it."""
        writer, chance = self.writer, self.chance
        mode = self.pick("triangles", "triangles", "strip", "fan")
        points, corners = self._shape(mode)
        attributes, points = self._positions(points)
        primitive: dict[str, Any] = {"attributes": attributes}
        if mode != "triangles" or chance.random() < 0.5:
            primitive["mode"] = {"triangles": 4, "strip": 5, "fan": 6}[mode]
        index_type = self.pick("none", "u1", "u2", "u4")
        if index_type == "none":
            primitive["attributes"], points = self._positions(points[corners], again=attributes)
            corners = np.arange(len(corners))
        else:
            primitive["indices"] = writer.accessor(corners.astype(f"<{index_type}")[:, None])
        mesh: dict[str, Any] = {"primitives": [primitive]}
        if self.pick("plain", "plain", "morphed") == "morphed":
            points = self._morph(mesh, points)
        skinned = self.pick("rigid", "rigid", "skinned") == "skinned"
        if skinned:
            count = len(points)
            joints, weights = np.zeros((count, 4), np.uint8), np.zeros((count, 4), np.float32)
            joints[:, 0], weights[:, 0] = 1, 1.0
            primitive["attributes"] |= {
                "JOINTS_0": writer.accessor(joints),
                "WEIGHTS_0": writer.accessor(weights),
            }
        if chance.random() < 0.3:
            primitive["material"] = chance.choice((0, 99))
            self.form.append("material missing")
        if chance.random() < 0.2:
            mesh["primitives"].append({"attributes": primitive["attributes"], "mode": chance.randrange(4)})
        return writer.add("meshes", **mesh), points[triangle_corners(corners, mode)], skinned

    def _shape(self, mode: str) -> tuple[Any, Any]:
        """Return points and corners; those of strips and fans follow each other."""
        if mode == "triangles":
            points, faces = icosphere(self.chance.randrange(2))
            return points * self.chance.uniform(0.5, 3), faces.ravel()
        count = self.chance.randrange(3, 12)
        generator = np.random.default_rng(self.chance.randrange(2**32))
        return generator.normal(size=(count, 3)), np.arange(count)

    def _positions(self, points: Any, again: Any = None) -> tuple[dict[str, int], Any]:
        """Append positions; return the attributes, and the points as they are stored."""
        kind = "f4" if again else self.pick("f4", "f4", "i1", "u1", "i2", "u2")
        gap = self.chance.choice((0, 0, 4, 12))
        options: dict[str, Any] = {}
        if kind == "f4":
            stored = values = points.astype("<f4")
        else:
            limit = np.iinfo(kind).max
            shifted = points / np.abs(points).max() + (1 if kind[0] == "u" else 0)
            stored = np.rint(shifted / (2 if kind[0] == "u" else 1) * limit).astype(f"<{kind}")
            values = stored.astype(float)
            if self.chance.random() < 0.5:
                options["normalized"] = True
                values = values / limit
            width = -3 * stored.itemsize % 4
            gap = gap + width if gap or width else 0
        if kind == "f4" and self.chance.random() < 0.15:
            self.form.append("sparse")
            return {"POSITION": self.writer.sparse(stored)}, values.astype(float)
        return {"POSITION": self.writer.accessor(stored, gap, **options)}, values.astype(float)

    def _morph(self, mesh: dict[str, Any], points: Any) -> Any:
        """Append two morph targets with weights; return the points that these move."""
        shifts = np.random.default_rng(self.chance.randrange(2**32)).normal(size=(2, *points.shape))
        shifts = shifts.astype("<f4")
        shifts[1, ::2] = 0.0
        weights = [self.chance.uniform(-1, 1), self.chance.choice((0.0, 0.5))]
        targets = [{"POSITION": self.writer.accessor(shifts[0])}, {"POSITION": self.writer.sparse(shifts[1])}]
        mesh["primitives"][0]["targets"] = targets
        mesh["weights"] = weights
        return points + np.tensordot(weights, shifts.astype(float), axes=1)

    def skin(self) -> tuple[int, Any, list[int]]:
        """Append a skin whose second joint moves all; return its map too, and the root of its nodes."""
        place, outer = random_place(self.chance)
        bone, inner = random_place(self.chance)
        tip = self.writer.add("nodes", **bone)
        root = self.writer.add("nodes", children=[tip], **place)
        inverse = np.stack([np.eye(4), np.linalg.inv(random_place(self.chance)[1])]).astype("<f4")
        matrices = self.writer.accessor(inverse.swapaxes(1, 2).reshape(2, 16))
        skin = self.writer.add("skins", joints=[root, tip], inverseBindMatrices=matrices)
        return skin, outer @ inner @ inverse[1].astype(float), [root]


def triangle_corners(corners: Any, mode: str) -> Any:
    """Return the triangles of corners, as the specification counts them."""
    if mode == "triangles":
        return corners.reshape(-1, 3)
    rows = []
    for i in range(len(corners) - 2):
        if mode == "fan":
            rows.append((corners[i + 1], corners[i + 2], corners[0]))
        else:
            rows.append((corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]))
    return np.array(rows)


def random_gltf(chance: random.Random) -> SceneFile:
    """Return a valid glTF file of random form, with the triangles that it shows in turn."""
    model = _GltfModel(chance)
    nodes = [_random_node(model) for _ in range(chance.randrange(1, 4))]
    roots, shown = [root for roots, _ in nodes for root in roots], [triangles for _, triangles in nodes]
    writer = model.writer
    match model.pick("scene", "first scene", "default scene", "no scene"):
        case "first scene":
            writer.document["scenes"] = [{"nodes": roots}, {"nodes": []}]
        case "scene":
            writer.document |= {"scenes": [{"nodes": roots}], "scene": 0}
        case "default scene":
            writer.document |= {"scenes": [{"name": "empty"}, {"nodes": roots}], "scene": 1}
    container = model.pick("glb", "data", "bin")
    encoding = "utf-8" if container == "glb" else model.pick("utf-8", "utf-8", "utf-8-sig", "utf-16")
    writer.document |= {"extensionsUsed": ["VENDOR_unknown"], "extras": {"matrix": "none"}}
    return SceneFile(writer.files(container, encoding), np.concatenate(shown), " ".join(model.form))


def _random_node(model: _GltfModel) -> tuple[list[int], Any]:
    """Append a mesh below one to three nodes; return their root and the triangles that they show."""
    chance, writer = model.chance, model.writer
    mesh, triangles, skinned = model.mesh()
    places = [random_place(chance) for _ in range(chance.randrange(1, 4))]
    world = np.eye(4)
    for _, matrix in places:
        world = matrix @ world
    node: dict[str, Any] = {"mesh": mesh}
    roots: list[int] = []
    copies = [np.eye(4)]
    if skinned:
        node["skin"], world, roots = model.skin()
    elif model.pick("one", "one", "copies") == "copies":
        shape = chance.randrange(1, 4), 3
        shifts, scales = (
            [[chance.uniform(-2, 2) for _ in range(3)] for _ in range(shape[0])] for _ in range(2)
        )
        rows = {name: np.array(rows, "<f4") for name, rows in (("TRANSLATION", shifts), ("SCALE", scales))}
        attributes = {name: writer.accessor(values) for name, values in rows.items()}
        node["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
        pairs = zip(rows["TRANSLATION"], rows["SCALE"], strict=True)
        copies = [matrix_of(shift, (0, 0, 0, 1), scale) for shift, scale in pairs]
    index = writer.add("nodes", **node, **places[0][0])
    for record, _ in places[1:]:
        index = writer.add("nodes", children=[index], **record)
    return [*roots, index], np.concatenate([moved(triangles, world @ copy) for copy in copies])


def broken_gltf(chance: random.Random) -> SceneFile:
    """Return a glTF file with a wrong value, record, chunk or length; it may still be readable."""
    whole = random_gltf(chance)
    files = dict(whole.files)
    content = files[whole.name]
    if whole.name.endswith(".glb"):
        size = struct.unpack_from("<I", content, 12)[0]
        text, rest = content[20 : 20 + size], content[20 + size :]
        match chance.randrange(4):
            case 0:
                content = content[: chance.randrange(len(content))]
            case 1:
                place = chance.choice((4, 8, 12, 16, 20 + size, 24 + size))
                number = chance.choice((0, 1, 3, size + 4, 2**31, 2**32 - 1))
                content = content[:place] + struct.pack("<I", number) + content[place + 4 :]
            case _:
                content = glb(_broken_json(text, chance), rest[8:])
    else:
        encoding = json.detect_encoding(content)
        content = _broken_json(content.decode(encoding).encode(), chance)
        if chance.random() < 0.2:
            content = content[: chance.randrange(len(content))]
        for name in list(files)[1:]:
            if chance.random() < 0.2:
                files[name] = files[name][: chance.randrange(len(files[name]) + 1)]
    return SceneFile({**files, whole.name: content}, None, "broken " + whole.form)


def _broken_json(text: bytes, chance: random.Random) -> bytes:
    """Return a JSON text with one to three values that are replaced, removed, or copied from elsewhere."""
    document = json.loads(text)
    for _ in range(chance.choice((1, 1, 2, 3))):
        places = list(_places(document))
        owner, key = chance.choice(places)
        match chance.randrange(5):
            case 0 if isinstance(owner, dict):
                del owner[key]
            case 1:
                other, at = chance.choice(places)
                owner[key] = json.loads(
                    json.dumps(other[at] if not isinstance(other, dict) or at in other else 0)
                )
            case 2 if isinstance(owner[key], int):
                owner[key] += chance.choice((-1, 1, 2, 100))
            case _:
                owner[key] = chance.choice(HOSTILE)
    return json.dumps(document).encode()


def _places(value: Any) -> Any:
    """Yield each owner and key of a value inside a JSON document."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in list(pairs):
        yield value, key
        if isinstance(inner, dict | list):
            yield from _places(inner)


# -- 3MF --------------------------------------------------------------------------------------------------

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONSHIPS = "http://schemas.openxmlformats.org/package/2006/relationships"
MODEL_TYPE = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"


def package(parts: dict[str, str | bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return a ZIP archive of parts by their names."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as archive:
        for name, part in parts.items():
            archive.writestr(zipfile.ZipInfo(name), part, method)  # without the time of day
    return content.getvalue()


def relationships(part: str) -> str:
    """Return the package's relationships to the part that holds the model."""
    link = f'<Relationship Id="r" Type="{MODEL_TYPE}" Target="{part}"/>'
    return f'<Relationships xmlns="{RELATIONSHIPS}">{link}</Relationships>'


def mesh_xml(points: Any, faces: Any, prefix: str = "", extra: Callable[[int], str] = lambda _: "") -> str:
    """Return the element of a mesh, with more attributes of its triangles."""
    vertices = [f'<{prefix}vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in points.tolist()]
    rows = enumerate(np.asarray(faces).tolist())
    triangles = [f'<{prefix}triangle v1="{a}" v2="{b}" v3="{c}"{extra(i)}/>' for i, (a, b, c) in rows]
    inside = f"<{prefix}vertices>{''.join(vertices)}</{prefix}vertices>"
    return f"<{prefix}mesh>{inside}<{prefix}triangles>{''.join(triangles)}</{prefix}triangles></{prefix}mesh>"


def transform_text(matrix: Any) -> str:
    """Return a matrix as 3MF writes it: four rows of three numbers, for row vectors."""
    return " ".join(map(repr, matrix[:3].T.ravel().tolist()))


def random_3mf(chance: random.Random) -> SceneFile:
    """Return a valid 3MF file of random form, with the triangles that it builds."""
    form: list[str] = []

    def pick(*names: str) -> str:
        form.append(chance.choice(names))
        return form[-1]

    prefix = pick("", "m3:")
    split = pick("one part", "parts") == "parts"
    root, other = pick("/3D/3dmodel.model", "3D/Main%20Model.model"), "/3D/Objects/object 1.model"
    meshes: list[str] = []
    objects: list[Any] = []
    texts: list[str] = []
    for number in range(1, chance.randrange(2, 4)):
        points, faces = icosphere(chance.randrange(2))
        points = points * chance.uniform(0.5, 3)
        objects.append(points[faces])
        meshes.append(f'<{prefix}object id="{number}">{mesh_xml(points, faces, prefix)}</{prefix}object>')
    for number in range(len(objects) + 1, len(objects) + chance.randrange(1, 4)):
        uses, shown = [], []
        for _ in range(chance.randrange(1, 3)):
            used = chance.randrange(1, number)
            path = f' p:path="{other}"' if split and used <= len(meshes) else ""
            text, matrix = _random_transform(chance)
            uses.append(f'<{prefix}component objectid="{used}"{path}{text}/>')
            shown.append(moved(objects[used - 1], matrix))
        objects.append(np.concatenate(shown))
        inside = f"<{prefix}components>{''.join(uses)}</{prefix}components>"
        texts.append(f'<{prefix}object id="{number}">{inside}</{prefix}object>')
    items, built = [], []
    for _ in range(chance.randrange(1, 4)):
        used = chance.randrange(1, len(objects) + 1)
        path = f' p:path="{other}"' if split and used <= len(meshes) else ""
        text, matrix = _random_transform(chance)
        items.append(f'<{prefix}item objectid="{used}"{path}{text}/>')
        built.append(moved(objects[used - 1], matrix))
    space = f'xmlns{":" + prefix[:-1] if prefix else ""}="{CORE}" xmlns:p="{PRODUCTION}"'
    unit = pick("", ' unit="inch"', ' unit="micron"')

    def model(resources: list[str], build: list[str]) -> bytes:
        inside = f"<{prefix}resources>{''.join(resources)}</{prefix}resources>"
        inside += f"<{prefix}build>{''.join(build)}</{prefix}build>"
        encoding = pick("UTF-8", "UTF-8", "UTF-16")
        text = f'<?xml version="1.0" encoding="{encoding}"?><{prefix}model {space}{unit}>'
        return (text + f"{inside}</{prefix}model>").encode(encoding)

    parts: dict[str, str | bytes] = {"_rels/.rels": relationships(root)}
    parts[root.lstrip("/").replace("%20", " ")] = model(texts if split else meshes + texts, items)
    if split:
        parts[other.lstrip("/")] = model(meshes, [])
    method = chance.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED))
    return SceneFile({"model.3mf": package(parts, method)}, np.concatenate(built), " ".join(form))


def _random_transform(chance: random.Random) -> tuple[str, Any]:
    """Return the attribute of a place, or none, and the matrix."""
    if chance.random() < 0.2:
        return "", np.eye(4)
    matrix = random_place(chance)[1]
    return f' transform="{transform_text(matrix)}"', matrix


def broken_3mf(chance: random.Random) -> SceneFile:
    """Return a 3MF file with a wrong attribute, element, part or byte; it may still be readable."""
    whole = random_3mf(chance)
    content = whole.files["model.3mf"]
    if chance.random() < 0.3:
        data = bytearray(content)
        for _ in range(chance.randrange(1, 5)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        content = bytes(data[: chance.randrange(len(data))] if chance.random() < 0.3 else data)
        return SceneFile({"model.3mf": content}, None, "broken bytes " + whole.form)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts: dict[str, str | bytes] = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(list(parts))
    encoding = "utf-16" if bytes(parts[name][:2]) in (b"\xff\xfe", b"\xfe\xff") else "utf-8"  # type: ignore[arg-type]
    pieces = bytes(parts[name]).decode(encoding).split('"')  # type: ignore[arg-type]
    for _ in range(chance.choice((1, 1, 2))):
        at = chance.randrange(len(pieces))
        pieces[at] = chance.choice(
            [str(value) for value in HOSTILE] + ["nan", "1 " * 12, "", "<", pieces[-1]]
        )
    parts[name] = '"'.join(pieces).encode(encoding, "replace")
    if chance.random() < 0.1:
        del parts[chance.choice(list(parts))]
    return SceneFile({"model.3mf": package(parts)}, None, "broken " + whole.form)
