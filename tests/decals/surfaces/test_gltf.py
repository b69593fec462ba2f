"""glTF files: what the specification says they show, in float64, and what is refused or left out by name."""

import base64
import io
import json
import logging
import math
import random
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree

from decals.errors import InvalidMesh
from decals.surfaces import read_mesh
from decals.surfaces.base_color import CLAY
from decals.surfaces.files import gltf, pieces
from decals.surfaces.mesh_file import read_mesh_data
from tests.decals.meshes import icosphere
from tests.structured.placed_files import GltfWriter, SceneFile, broken_gltf, glb, random_gltf

QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
"""Quaternion of a quarter turn about z."""


def shapes(triangles: Any) -> Any:
    """Centres and doubled areas with their normals: equal for triangles that begin at another corner."""
    a, b, c = np.asarray(triangles, np.float64).transpose(1, 0, 2)
    return np.concatenate([(a + b + c) / 3.0, np.cross(b - a, c - a)], axis=1)


def check(path: Path, expected: Any) -> None:
    """Compare the triangles of a file with expected ones in any order."""
    vertices, faces = read_mesh(path)
    found, wanted = shapes(vertices[faces]), shapes(expected)
    assert len(found) == len(wanted)
    size = np.abs(expected).max()
    tolerance = 5e-5 * max(size, size * size)
    for some, others in ((found, wanted), (wanted, found)):
        assert cKDTree(others).query(some)[0].max() < tolerance


def square(writer: GltfWriter, **options: Any) -> dict[str, Any]:
    """Return the attributes of a unit square's four corners, for a strip."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    return {"attributes": {"POSITION": writer.accessor(points)}, "mode": 5, **options}


def saved(folder: Path, writer: GltfWriter, form: str = "glb") -> Path:
    return SceneFile(writer.files(form), None, form).write(folder)


def ball(writer: GltfWriter, level: int = 2) -> int:
    """Append a mesh of the unit ball."""
    points, faces = icosphere(level)
    attributes = {"POSITION": writer.accessor(points.astype("<f4"))}
    indices = writer.accessor(faces.astype("<u2").reshape(-1, 1))
    return writer.add("meshes", primitives=[{"attributes": attributes, "indices": indices}])


@pytest.mark.parametrize("block", range(8))
def test_random_forms_show_the_triangles_of_the_specification(tmp_path: Path, block: int) -> None:
    for number in range(block * 10, block * 10 + 10):
        file = random_gltf(random.Random(f"gltf:{number}"))
        check(file.write(tmp_path), file.triangles)


def check_broken(folder: Path, broken: Callable[[random.Random], SceneFile], count: int) -> None:
    """Read broken files: more than half are refused, by one line that names the file."""
    messages = []
    for number in range(count):
        path = broken(random.Random(f"broken:{number}")).write(folder)
        try:
            read_mesh(path)
        except InvalidMesh as error:
            messages.append((str(path), str(error)))
    assert count / 2 < len(messages) < count
    assert all(path in message and "\n" not in message for path, message in messages)


def test_broken_forms_are_one_error_or_a_mesh(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    check_broken(tmp_path, broken_gltf, 50)
    assert capfd.readouterr().out == ""


def test_a_mirrored_ball_keeps_its_outward_normals(tmp_path: Path) -> None:
    writer = GltfWriter()
    writer.add("nodes", mesh=ball(writer), scale=[1, 1, -1], translation=[3, 0, 0])
    vertices, faces = read_mesh(saved(tmp_path, writer))
    found = shapes(vertices[faces])
    outward = ((found[:, :3] - (3.0, 0.0, 0.0)) * found[:, 3:]).sum(axis=1)
    assert len(faces) == 320
    assert (outward > 0.0).all()


def test_instances_keep_float64_until_the_end(tmp_path: Path) -> None:
    """A ball of radius 1 at 2**26: its parent moves it back to zero, which float32 in between would spoil."""
    writer = GltfWriter()
    inner = writer.add("nodes", mesh=ball(writer), translation=[2.0**26, 0, 0])
    writer.add("nodes", children=[inner], translation=[-(2.0**26), 0, 0])
    vertices, _ = read_mesh(saved(tmp_path, writer))
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(1.0, abs=1e-7)


def test_a_skin_moves_by_its_joints_alone(tmp_path: Path) -> None:
    """The joint turns by a quarter about z and lifts by 2; the root has half of the weight of two corners."""
    writer = GltfWriter()
    primitive = square(writer)
    joints = np.array([[1, 0, 0, 0]] * 2 + [[0, 1, 9, 0]] * 2, np.uint8)
    weights = np.array([[1, 0, 0, 0]] * 2 + [[2, 2, 0, 0]] * 2, "<f4")  # of sum 4, and joint 9 has no weight
    primitive["attributes"] |= {"JOINTS_0": writer.accessor(joints), "WEIGHTS_0": writer.accessor(weights)}
    tip = writer.add("nodes", rotation=QUARTER, translation=[0, 0, 2])
    root = writer.add("nodes", children=[tip], matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1])
    skin = writer.add("skins", joints=[root, tip])
    mesh = writer.add("meshes", primitives=[primitive])
    writer.add("nodes", mesh=mesh, skin=skin, scale=[-7, 1, 1])
    vertices, faces = read_mesh(saved(tmp_path, writer))
    assert vertices.tolist() == pytest.approx(
        np.array([[0, 0, 7], [0, 1, 7], [-0.5, 0.5, 6], [0, 1, 6]]), abs=1e-6
    )
    assert faces.tolist() == [[0, 1, 2], [1, 3, 2]]


def test_a_mirrored_skeleton_turns_the_faces(tmp_path: Path) -> None:
    writer = GltfWriter()
    mesh = ball(writer)
    count = len(icosphere(2)[0])
    weights = np.tile(np.array([1, 0, 0, 0], "<f4"), (count, 1))
    primitive = writer.document["meshes"][mesh]["primitives"][0]
    primitive["attributes"]["JOINTS_0"] = writer.accessor(np.zeros((count, 4), "<u2"))
    primitive["attributes"]["WEIGHTS_0"] = writer.accessor(weights)
    joint = writer.add("nodes", scale=[-1, 2, 1])
    writer.add("nodes", mesh=mesh, skin=writer.add("skins", joints=[joint]))
    vertices, faces = read_mesh(saved(tmp_path, writer))
    volume = np.linalg.det(vertices[faces].astype(float)).sum() / 6.0
    assert volume == pytest.approx(2 * np.linalg.det(np.array(icosphere(2)[0])[icosphere(2)[1]]).sum() / 6.0)


def test_joints_of_a_node_without_a_skin_are_not_read(tmp_path: Path) -> None:
    writer = GltfWriter()
    primitive = square(writer)
    primitive["attributes"] |= {"JOINTS_0": 77, "WEIGHTS_0": 77}
    writer.add("nodes", mesh=writer.add("meshes", primitives=[primitive]))
    assert len(read_mesh(saved(tmp_path, writer))[1]) == 2


@pytest.mark.parametrize(
    ("mesh_weights", "node_weights", "height"),
    [([1.0, 0.25], None, 2.5), ([1, 1], [0.0, 0.5], 3.0), (None, None, 0.0)],
)
def test_morph_weights_of_a_node_replace_those_of_its_mesh(
    tmp_path: Path, mesh_weights: Any, node_weights: Any, height: float
) -> None:
    writer = GltfWriter()
    primitive = square(writer)
    lifts = [np.full((4, 3), (0, 0, z), "<f4") for z in (1, 6)]
    primitive["targets"] = [{"POSITION": writer.accessor(lifts[0])}, {"POSITION": writer.sparse(lifts[1])}]
    mesh = writer.add("meshes", primitives=[primitive], **({"weights": mesh_weights} if mesh_weights else {}))
    writer.add("nodes", mesh=mesh, **({"weights": node_weights} if node_weights else {}))
    vertices, _ = read_mesh(saved(tmp_path, writer))
    assert (vertices[:, 2] == height).all()


def test_what_has_no_faces_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    writer = GltfWriter()
    shapes_of_modes = [square(writer, mode=mode) for mode in range(4)]
    writer.add(
        "meshes", primitives=[*shapes_of_modes, square(writer), square(writer, mode=4), {"attributes": {}}]
    )
    writer.add("meshes", primitives=[square(writer)])
    writer.add("nodes", mesh=0)
    writer.add("nodes", mesh=1, extensions={"KHR_node_visibility": {"visible": False}})
    with caplog.at_level(logging.WARNING):
        assert len(read_mesh(saved(tmp_path, writer))[1]) == 3
    text = caplog.text
    assert (
        "points and lines are left out: mesh 0 primitive 0, mesh 0 primitive 1, mesh 0 primitive 2 and 1 more"
        in text
    )
    assert "fewer than three corners are left out: mesh 0 primitive 5" in text
    assert "without positions are left out: mesh 0 primitive 6" in text
    assert "hidden nodes are left out: node 1" in text
    assert "meshes that the scene does not show are left out: mesh 1" in text


@pytest.mark.parametrize(
    "extension", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"]
)
@pytest.mark.parametrize("fallback", [False, True])
def test_compression_is_named_unless_there_is_a_fallback(
    tmp_path: Path, extension: str, fallback: bool
) -> None:
    writer = GltfWriter()
    primitive = square(writer)
    if "draco" in extension:
        primitive["extensions"] = {extension: {"bufferView": 0, "attributes": {"POSITION": 0}}}
        if not fallback:
            del writer.document["accessors"][0]["bufferView"]
    else:
        writer.document["bufferViews"][0] |= {
            "extensions": {extension: {"buffer": 0}},
            "buffer": 0 if fallback else 1,
        }
    writer.add("nodes", mesh=writer.add("meshes", primitives=[primitive]))
    name, content = next(iter(writer.files("glb").items()))
    size = struct.unpack_from("<I", content, 12)[0]
    document = json.loads(content[20 : 20 + size])
    document["buffers"].append({"byteLength": 48})
    (tmp_path / name).write_bytes(glb(json.dumps(document).encode(), bytes(writer.content)))
    if fallback:
        assert len(read_mesh(tmp_path / name)[1]) == 2
        return
    with pytest.raises(InvalidMesh, match=rf"compressed by the extension {extension}, which is not read"):
        read_mesh(tmp_path / name)


def _accessor(**values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["accessors"][0].update(values)


def _node(index: int, **values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["nodes"][index].update(values)


HUGE: dict[str, Any] = {"scale": [1e300] * 3}

BROKEN: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "huge count": (_accessor(count=10**15), "accessor 0 needs"),
    "count without bytes": (_accessor(count=10**15, bufferView=None), "accessor 0 has 10{15} elements"),
    "offset": (_accessor(byteOffset=4), "accessor 0 needs 52 bytes of buffer view 0, which has 48"),
    "view": (_accessor(bufferView=9), "accessor 0 asks for buffer view 9, but there are 1"),
    "component": (_accessor(componentType=5124), "unknown type 5124"),
    "type": (_accessor(type="VEC2"), "expects VEC3, but accessor 0 has 'VEC2'"),
    "stride": (lambda d: d["bufferViews"][0].update(byteStride=4), "stride of 4 bytes for elements of 12"),
    "buffer": (lambda d: d["bufferViews"][0].update(byteOffset=8), "56 bytes of buffer 0, which has 48"),
    "cycle": (_node(0, children=[0]), "own descendants"),
    "ring": (lambda d: d.update(nodes=[{"children": [1]}, {"children": [0]}]), "own descendants"),
    "parents": (lambda d: d["nodes"].extend([{"children": [0]}] * 2), "node 0 is a child of node 1 and"),
    "child": (_node(0, children=[7]), "node 0 asks for node 7"),
    "mesh": (_node(0, mesh=7), "node 0 asks for mesh 7"),
    "skin": (_node(0, skin=7), "node 0 asks for skin 7"),
    "huge matrix": (_node(0, matrix=[1e200] * 12 + [0, 0, 0, 1]), "no affine map"),
    "huge scales": (lambda d: d.update(nodes=[{"children": [1], **HUGE}, {"mesh": 0, **HUGE}]),
                    "node 1 has a matrix with numbers that are not finite"),
    "scene": (lambda d: d.update(scenes=[{}], scene=1), "the file asks for scene 1"),
    "mode": (lambda d: d["meshes"][0]["primitives"][0].update(mode=7), "unknown mode 7"),
    "version": (lambda d: d["asset"].update(version="1.0"), "version 1.0 of glTF.*convert it"),
    "future": (lambda d: d["asset"].update(version="2.1", minVersion="2.1"), "version 2.1 of glTF"),
    "no asset": (lambda d: d.pop("asset"), "names no version"),
    "wrong kind": (lambda d: d.update(nodes={}), r"Expected `array`, got `object` - at `\$.nodes`"),
    "address": (lambda d: d["buffers"][0].update(uri="https://a.b/c.bin"), "addresses are not read"),
    "outside": (lambda d: d["buffers"][0].update(uri="..%2Fc.bin"), "outside of the model's folder"),
    "root": (lambda d: d["buffers"][0].update(uri="/etc/passwd"), "is missing|outside of the model's folder"),
    "missing": (lambda d: d["buffers"][0].update(uri="c%20d.bin"), "'c%20d.bin', is missing"),
    "null": (lambda d: d["buffers"][0].update(uri="a%00b.bin"), "is missing"),
    "no data": (lambda d: d["buffers"][0].update(uri="data:x"), "data URI without data"),
    "base64": (lambda d: d["buffers"][0].update(uri="data:;base64,AAAAA"), "no base64"),
}  # fmt: skip


@pytest.mark.parametrize("fault", BROKEN)
def test_each_fault_is_named(tmp_path: Path, fault: str) -> None:
    change, message = BROKEN[fault]
    writer = GltfWriter()
    writer.add("nodes", mesh=writer.add("meshes", primitives=[square(writer)]))
    document = {**writer.document, "buffers": [{"byteLength": 48}]}
    change(document)
    document["accessors"] = [{k: v for k, v in row.items() if v is not None} for row in document["accessors"]]
    (tmp_path / "model.glb").write_bytes(glb(json.dumps(document).encode(), bytes(writer.content)))
    with pytest.raises(InvalidMesh, match=rf"model\.glb.*{message}"):
        read_mesh(tmp_path / "model.glb")


def test_indices_beyond_the_points_are_refused(tmp_path: Path) -> None:
    writer = GltfWriter()
    indices = writer.accessor(np.array([[0], [1], [4]], np.uint8))
    writer.add("nodes", mesh=writer.add("meshes", primitives=[square(writer, mode=4, indices=indices)]))
    with pytest.raises(InvalidMesh, match="4 points but a face asks for number 4"):
        read_mesh(saved(tmp_path, writer))


def test_primitives_share_points_of_which_each_uses_some(tmp_path: Path) -> None:
    writer = GltfWriter()
    points = np.random.default_rng(0).normal(size=(100, 3)).astype("<f4")
    position = {"POSITION": writer.accessor(points)}
    faces = [np.array(rows, "<u2") for rows in ([[7, 3, 99]], [[0, 1, 2], [98, 97, 96]])]
    indices = [writer.accessor(rows.reshape(-1, 1)) for rows in faces]
    primitives = [{"attributes": position, "indices": index} for index in indices]
    writer.add("nodes", mesh=writer.add("meshes", primitives=primitives))
    vertices, found = read_mesh(saved(tmp_path, writer))
    assert len(vertices) == 9
    assert np.array_equal(vertices[found], points[np.concatenate(faces)])


def limited(monkeypatch: pytest.MonkeyPatch, elements: int, work: int) -> None:
    monkeypatch.setattr(pieces, "MAX_ELEMENTS", elements)
    monkeypatch.setattr(pieces, "MAX_WORK", work)


def test_copies_are_counted_before_memory_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = GltfWriter()
    shifts = writer.accessor(np.zeros((400, 3), "<f4"))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shifts}}}
    writer.add("nodes", mesh=ball(writer), extensions=extension)
    path = saved(tmp_path, writer)
    assert len(read_mesh(path)[1]) == 400 * 320
    limited(monkeypatch, 30_000, 10_000)
    with pytest.raises(
        InvalidMesh, match=r"more than 3\d,\d+ vertices with all copies, counted up to node 0"
    ):
        read_mesh(path)


@pytest.mark.parametrize(
    ("elements", "work", "message"),
    [
        (50_000, 10**6, "triangles, counted up to mesh 0 primitive"),
        (10**6, 50_000, "elements to read, counted up to"),
    ],
)
def test_parts_that_share_points_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elements: int, work: int, message: str
) -> None:
    writer = GltfWriter()
    mesh = ball(writer)
    writer.document["meshes"][mesh]["primitives"] *= 2_000
    writer.add("nodes", mesh=mesh)
    limited(monkeypatch, elements, work)
    with pytest.raises(InvalidMesh, match=message):
        read_mesh(saved(tmp_path, writer))


def test_a_chunk_with_a_wrong_length(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    writer = GltfWriter()
    writer.add("nodes", mesh=writer.add("meshes", primitives=[square(writer)]))
    content = writer.files("glb")["model.glb"]
    path = tmp_path / "model.glb"
    path.write_bytes(content[:8] + struct.pack("<I", len(content) + 4) + content[12:])
    assert len(read_mesh(path)[1]) == 2
    assert "the file ends early, but behind its mesh" in caplog.text
    path.write_bytes(content + b"more")
    assert len(read_mesh(path)[1]) == 2
    path.write_bytes(content[:-4])
    with pytest.raises(InvalidMesh, match="its binary chunk has 48 bytes, but only 44 follow"):
        read_mesh(path)
    path.write_bytes(content[:4] + struct.pack("<I", 1) + content[8:])
    with pytest.raises(InvalidMesh, match="version 1 of glTF"):
        read_mesh(path)


def test_links_do_not_lead_out_of_the_folder(tmp_path: Path) -> None:
    writer = GltfWriter()
    writer.add("nodes", mesh=writer.add("meshes", primitives=[square(writer)]))
    folder = tmp_path / "model"
    folder.mkdir()
    path = saved(folder, writer, "bin")
    binary = next(file for file in folder.iterdir() if file.suffix == ".bin")
    outside = binary.rename(tmp_path / "outside.bin")
    binary.symlink_to(outside)
    with pytest.raises(InvalidMesh, match="outside of the model's folder"):
        read_mesh(path)


def picture(pixels: Any) -> str:
    """Return a picture as a data URI."""
    buffer = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(buffer, "PNG")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def linear(levels: Any) -> Any:
    """Return linear light of sRGB bytes, by the formula of IEC 61966-2-1."""
    part = np.asarray(levels) / 255.0
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [200, 100, 50]]])
"""Upper left, upper right; lower left, lower right."""


def textured(writer: GltfWriter, coordinates: Any, **material: Any) -> dict[str, Any]:
    """Return a square with coordinates, whose material has a texture of four pixels."""
    primitive = square(writer, material=0)
    primitive["attributes"]["TEXCOORD_0"] = writer.accessor(np.asarray(coordinates, "<f4"))
    writer.add("nodes", mesh=writer.add("meshes", primitives=[primitive]))
    info = {"index": 0, **material.pop("info", {})}
    writer.document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info, **material}}]
    writer.document["textures"] = [{"source": 0, "sampler": 0}]
    writer.document["images"] = [{"uri": picture(PIXELS)}]
    writer.document["samplers"] = [{"wrapS": 33071, "wrapT": 33648}]
    return primitive


def light_at_corners(path: Path) -> tuple[Any, Any]:
    """Return the positions of a file's corners and the linear light there."""
    data = read_mesh_data(path)
    assert data.color is not None
    numbers = np.repeat(np.arange(len(data.faces)), 3)
    light = data.color.light_at(data.faces, numbers, np.tile(np.eye(3), (len(data.faces), 1)))
    return data.vertices[data.faces].reshape(-1, 3), light


CENTRES = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
"""Centres of the four pixels, in the order of `PIXELS`; v points downward in glTF."""


@pytest.mark.parametrize("form", ["plain", "transform", "wrapped", "view"])
def test_factor_vertex_colours_and_texture_are_multiplied_in_linear_light(tmp_path: Path, form: str) -> None:
    writer = GltfWriter()
    coordinates, info = np.array(CENTRES), {}
    if form == "transform":
        turn, scale, offset = 0.3, np.array([2.0, 0.5]), np.array([0.1, 0.2])
        transform = {"rotation": turn, "scale": scale.tolist(), "offset": offset.tolist()}
        info = {"extensions": {"KHR_texture_transform": transform}}
        # The coordinates that an image turned clockwise, scaled and moved takes back to the pixels' centres.
        cos, sin = math.cos(turn), math.sin(turn)
        coordinates = (coordinates - offset) @ np.array([[cos, sin], [-sin, cos]]) / scale
    if form == "wrapped":
        coordinates = coordinates * [1, -1] + [
            [-9, 0],
            [9, 0],
            [-9, 0],
            [9, 0],
        ]  # clamp along u, mirror along v
    primitive = textured(writer, coordinates, baseColorFactor=[0.5, 1.0, 0.25, 0.3], info=info)
    shades = np.array([[255, 255, 255, 0], [51, 255, 0, 9], [255, 102, 255, 0], [0, 255, 255, 0]], np.uint8)
    primitive["attributes"]["COLOR_0"] = writer.accessor(shades, normalized=True)
    if form == "view":
        content = base64.b64decode(picture(PIXELS).partition(",")[2])
        writer.document["images"] = [{"bufferView": writer.view(content), "mimeType": "image/png"}]
    positions, light = light_at_corners(saved(tmp_path, writer))
    corners = (positions[:, 0] + 2 * positions[:, 1]).astype(int)
    expected = linear(PIXELS.reshape(4, 3)) * [0.5, 1.0, 0.25] * (shades[:, :3] / 255.0)
    assert light == pytest.approx(expected[corners], abs=1e-5)


def attributes(document: dict[str, Any]) -> Any:
    """Return the attributes of a document's first primitive."""
    return document["meshes"][0]["primitives"][0]["attributes"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["images"][0].update(uri="nothing.png"), "image 0, 'nothing.png', is missing"),
        (lambda d: d["images"][0].update(uri="a\0b.png"), "textures are left out: image 0, .*missing"),
        (lambda d: d["images"][0].update(uri="../a.png"), "textures are left out: image 0, .*outside"),
        (lambda d: d["images"][0].update(uri="data:,text"), "textures are left out: .*image 0"),
        (lambda d: d["images"][0].update(uri=[]), "textures are left out: image 0 is wrong: Expected"),
        (lambda d: d["textures"][0].update(source=7), "textures are left out: texture 0 asks for image 7"),
        (lambda d: d["textures"][0].update(sampler=7), "textures are left out: texture 0 asks for sampler 7"),
        (lambda d: d["textures"].__setitem__(0, {"extensions": {"KHR_texture_basisu": {"source": 0}}}),
         "texture 0 has only a KTX2 image, which is not read"),
        (lambda d: d["textures"].__setitem__(0, {}), "texture 0 has no image that is read"),
        (lambda d: d.update(textures={}), "textures are left out: texture 0 is wrong: Expected `array`"),
        (lambda d: d.update(materials=[]), "materials are left out: mesh 0 primitive 0 asks for material 0"),
        (lambda d: d.update(materials=[3]), "materials are left out: material 0 is wrong"),
        (lambda d: attributes(d).pop("TEXCOORD_0"), "textures without coordinates"),
        (lambda d: attributes(d).update(TEXCOORD_0=0), "colours are left out: mesh 0"),
        (lambda d: attributes(d).update(COLOR_0=9), "colours are left out: mesh 0"),
    ],
)  # fmt: skip
def test_a_fault_in_colours_costs_no_face(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, change: Callable[[dict[str, Any]], Any], message: str
) -> None:
    writer = GltfWriter()
    textured(writer, CENTRES)
    change(writer.document)
    assert len(read_mesh(saved(tmp_path, writer))[1]) == 2
    assert re.search(message, caplog.text)


def test_colours_of_copies_and_of_parts_without_any(tmp_path: Path) -> None:
    """Two mirrored copies keep their colours at their corners; a part without material becomes clay."""
    writer = GltfWriter()
    primitive = square(writer)
    shades = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], "<f4")
    primitive["attributes"]["COLOR_0"] = writer.accessor(shades)
    scales = writer.accessor(np.array([[-1, 1, 1], [1, 1, 1]], "<f4"))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": scales}}}
    writer.add("nodes", mesh=writer.add("meshes", primitives=[primitive]), extensions=extension)
    plain = writer.add("meshes", primitives=[square(writer)])
    writer.add("nodes", mesh=plain, translation=[0, 0, 9])
    positions, light = light_at_corners(saved(tmp_path, writer))
    corners = (np.abs(positions[:, 0]) + 2 * positions[:, 1]).astype(int)
    clay = linear(np.array(CLAY) * 255.0)
    assert light == pytest.approx(np.where(positions[:, 2:] == 9, clay, shades[corners]), abs=1e-6)


def test_it_agrees_with_trimesh(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    place = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (4, 5, 6))
    for index, mesh in enumerate((trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=2))):
        scene.add_geometry(mesh, transform=np.linalg.matrix_power(place, index + 1))
    scene.export(tmp_path / "model.glb")
    check(tmp_path / "model.glb", scene.to_mesh().triangles)


def test_the_file_is_closed_by_its_reader(tmp_path: Path) -> None:
    with pytest.raises(InvalidMesh, match="could not read"):
        gltf.read_gltf(tmp_path / "nothing.glb")
