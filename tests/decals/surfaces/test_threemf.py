"""3MF files: what they build, in float64, and what is refused or left out by name."""

import io
import logging
import os
import random
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from decals.errors import InvalidMesh
from decals.surfaces import read_mesh
from decals.surfaces.base_color import CLAY
from decals.surfaces.files import threemf
from decals.surfaces.mesh_file import read_mesh_data
from tests.decals.meshes import icosphere
from tests.decals.surfaces.test_gltf import PIXELS, check, check_broken, light_at_corners, linear, shapes
from tests.structured.placed_files import (
    CORE,
    broken_3mf,
    mesh_xml,
    package,
    random_3mf,
    relationships,
    transform_text,
)

TETRAHEDRON = mesh_xml(
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
)


def model(resources: str, build: str = '<item objectid="1"/>', head: str = "") -> str:
    return f'{head}<model xmlns="{CORE}"><resources>{resources}</resources><build>{build}</build></model>'


def saved(folder: Path, text: str | bytes, **parts: str | bytes) -> Path:
    path = folder / "model.3mf"
    path.write_bytes(package({"_rels/.rels": relationships("/3D/a.model"), "3D/a.model": text, **parts}))
    return path


@pytest.mark.parametrize("block", range(6))
def test_random_forms_build_the_triangles_of_the_specification(tmp_path: Path, block: int) -> None:
    for number in range(block * 10, block * 10 + 10):
        file = random_3mf(random.Random(f"3mf:{number}"))
        check(file.write(tmp_path), file.triangles)


def test_broken_forms_are_one_error_or_a_mesh(tmp_path: Path) -> None:
    check_broken(tmp_path, broken_3mf, 60)


def test_mirrored_components_keep_their_outward_normals(tmp_path: Path) -> None:
    """A ball that its component mirrors, and one that component and item mirror, so not at all."""
    points, faces = icosphere(2)
    mirror, shift = np.diag([-1.0, 1, 1, 1]), np.eye(4)
    shift[0, 3] = 5.0
    ball = f'<object id="1">{mesh_xml(points, faces)}</object>'
    uses = f'<component objectid="1" transform="{transform_text(mirror)}"/>'
    pair = f'<object id="2"><components>{uses}</components></object>'
    items = [
        f'<item objectid="2" transform="{transform_text(matrix)}"/>' for matrix in (shift, shift @ mirror)
    ]
    vertices, triangles = read_mesh(saved(tmp_path, model(ball + pair, "".join(items))))
    found = shapes(vertices[triangles])
    assert len(found) == 2 * len(faces)
    assert (((found[:, :3] - (5.0, 0.0, 0.0)) * found[:, 3:]).sum(axis=1) > 0.0).all()


def test_without_build_items_all_objects_that_are_no_components_are_read(tmp_path: Path) -> None:
    inner = f'<object id="1">{TETRAHEDRON}</object>'
    outer = '<object id="2"><components><component objectid="1"/></components></object>'
    path = saved(tmp_path, model(inner + outer + f'<object id="3">{TETRAHEDRON}</object>', build=""))
    assert len(read_mesh(path)[1]) == 8


def test_what_has_no_triangles_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lattice = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"'
    beams = f'<beamlattice {lattice}><beams><beam v1="0" v2="1"/><beam v1="1" v2="2"/></beams></beamlattice>'
    mesh = TETRAHEDRON.replace("</mesh>", f"{beams}</mesh>")
    text = model(
        f'<object id="1">{mesh}</object><object id="2"/>', '<item objectid="1"/><item objectid="2"/>'
    )
    with caplog.at_level(logging.INFO):
        read_mesh(saved(tmp_path, text.replace("<model ", '<model unit="inch" ')))
    assert "beams are left out: object 1" in caplog.text
    assert "objects without triangles are left out: object 2" in caplog.text
    assert "the unit is 1 inch" in caplog.text


def test_a_vertex_of_another_namespace_is_no_point(tmp_path: Path) -> None:
    """Slices have vertices of two coordinates beside those of meshes."""
    space = "http://schemas.microsoft.com/3dmanufacturing/slice/2015/07"
    slices = f'<s:slice xmlns:s="{space}"><s:vertex x="1" y="2"/></s:slice>'
    path = saved(tmp_path, model(slices + f'<object id="1">{TETRAHEDRON}</object>'))
    assert read_mesh(path)[0].shape == (4, 3)


OBJECT = f'<object id="1">{TETRAHEDRON}</object>'
DTD = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>'
BROKEN: dict[str, tuple[str, str]] = {
    "document type": (model(OBJECT, head=DTD), "declares a document type"),
    "no object": (model(""), "object 1 of '/3D/a.model' is missing"),
    "cycle": (model('<object id="1"><components><component objectid="1"/></components></object>'),
              "object 1 is a component of itself"),
    "index": (model(OBJECT.replace('v3="3"', 'v3="4"')), "4 points but a face asks for number 4"),
    "negative index": (model(OBJECT.replace('v3="3"', 'v3="-1"')), "asks for number -1"),
    "huge index": (model(OBJECT.replace('v3="3"', f'v3="{10**30}"')), "should have a triangle"),
    "no index": (model(OBJECT.replace('v3="3"', "")), "should have a triangle with three vertices"),
    "no coordinate": (model(OBJECT.replace('z="1"', "")), "should have a vertex with three numbers"),
    "nan": (model(OBJECT.replace('z="1"', 'z="nan"')), "no finite numbers"),
    "transform": (model(OBJECT, '<item objectid="1" transform="1 0 0"/>'), "'1 0 0', not 12 numbers"),
    "infinite transform": (model(OBJECT, f'<item objectid="1" transform="{"inf " * 12}"/>'), "not finite"),
    "two objects": (model(OBJECT * 2), "object 1 is there twice"),
    "no number": (model(OBJECT, '<item objectid="x"/>'), "the build has 'x' in place of a number 'objectid'"),
    "other XML": ("<html/>", "a part of it holds no model"),
    "cut": (model(OBJECT)[:-9], "its XML is wrong"),
    "faceless": (model('<object id="1"><mesh><vertices/></mesh></object>'), "no points and no faces"),
}  # fmt: skip


@pytest.mark.parametrize("fault", BROKEN)
def test_each_fault_is_named(tmp_path: Path, fault: str) -> None:
    text, message = BROKEN[fault]
    with pytest.raises(InvalidMesh, match=rf"model\.3mf.*{message}"):
        read_mesh(saved(tmp_path, text))


def test_a_long_name_is_cut_in_the_message(tmp_path: Path) -> None:
    path = saved(tmp_path, model(OBJECT, f'<item objectid="{"7" * 5000}"/>'))
    with pytest.raises(InvalidMesh) as info:
        read_mesh(path)
    assert len(str(info.value)) < len(str(path)) + 500


def test_components_of_components_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threemf, "MAX_PLACES", 5_000)
    twice = '<object id="{}"><components>{}</components></object>'
    objects = [twice.format(k, f'<component objectid="{k - 1}"/>' * 2) for k in range(2, 60)]
    with pytest.raises(InvalidMesh, match="it places more than 5,000 objects"):
        read_mesh(saved(tmp_path, model(OBJECT + "".join(objects), '<item objectid="59"/>')))


def test_a_build_of_many_objects_is_refused_before_they_are_placed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A chain of 38 objects, each of which has the one before twice, places 2³⁸ of them."""
    monkeypatch.setattr(threemf, "MAX_PLACES", 10**9)  # placing so many would take hours
    twice = '<object id="{}"><components>{}</components></object>'
    objects = [twice.format(k, f'<component objectid="{k - 1}"/>' * 2) for k in range(2, 40)]
    with pytest.raises(InvalidMesh, match="it places more than 1,000,000,000 objects"):
        read_mesh(saved(tmp_path, model(OBJECT + "".join(objects), '<item objectid="39"/>')))


@pytest.mark.parametrize("order", [(2, 1, 3), (3, 2, 1)])
def test_a_cycle_of_several_objects_is_named(tmp_path: Path, order: tuple[int, ...]) -> None:
    pairs = zip(order, (*order[1:], order[0]), strict=True)
    use = '<object id="{}"><components><component objectid="{}"/></components></object>'
    objects = "".join(use.format(*pair) for pair in pairs)
    with pytest.raises(InvalidMesh, match=r"object \d is a component of itself"):
        read_mesh(saved(tmp_path, model(objects, f'<item objectid="{order[0]}"/>')))


def test_supports_are_kept_and_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    support = OBJECT.replace("<object ", '<object type="support" ')
    assert read_mesh(saved(tmp_path, model(support)))[0].shape == (4, 3)
    assert "supports are kept as parts of the mesh: object 1" in caplog.text


def test_a_part_that_unpacks_to_very_much_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidMesh, match=r"it unpacks to more than 1.,...,... bytes with"):
        read_mesh(saved(tmp_path, model(OBJECT + " " * 20_000_000)))


def test_a_part_that_is_encrypted_or_packed_otherwise_is_refused(tmp_path: Path) -> None:
    content: Any = {"_rels/.rels": relationships("/3D/a.model"), "3D/a.model": model(OBJECT)}
    (tmp_path / "model.3mf").write_bytes(package(content, zipfile.ZIP_BZIP2))
    with pytest.raises(InvalidMesh, match="packed by another method than deflate"):
        read_mesh(tmp_path / "model.3mf")


def test_a_package_without_relationships_has_its_model_where_it_should_be(tmp_path: Path) -> None:
    (tmp_path / "model.3mf").write_bytes(package({"3D/3dmodel.model": model(OBJECT)}))
    assert len(read_mesh(tmp_path / "model.3mf")[1]) == 4
    (tmp_path / "model.3mf").write_bytes(package({"a.txt": "a"}))
    with pytest.raises(InvalidMesh, match="it holds no 3D model"):
        read_mesh(tmp_path / "model.3mf")


def test_a_package_that_is_cut_is_refused(tmp_path: Path) -> None:
    path = saved(tmp_path, model(OBJECT))
    whole = path.read_bytes()
    assert zipfile.is_zipfile(io.BytesIO(whole))
    for end in range(0, len(whole), 37):
        path.write_bytes(whole[:end])
        with pytest.raises(InvalidMesh, match=r"model\.3mf"):
            read_mesh(path)


MATERIALS = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
PALETTES = f"""<m:colorgroup xmlns:m="{MATERIALS}" id="10">
<m:color color="#FF0000"/><m:color color="#00FF0080"/><m:color color="#0000FF"/></m:colorgroup>
<basematerials id="11"><base name="a" displaycolor="#808080FF"/>
<base name="b" displaycolor="none"/></basematerials>
<m:texture2d xmlns:m="{MATERIALS}" id="12" path="/3D/a%20b.png" contenttype="image/png" tilestyleu="clamp"/>
<m:texture2dgroup xmlns:m="{MATERIALS}" id="13" texid="12"><m:tex2coord u="0.25" v="0.75"/>
<m:tex2coord u="9" v="0.25"/><m:tex2coord u="-9" v="0.25"/></m:texture2dgroup>
<m:multiproperties xmlns:m="{MATERIALS}" id="14" pids="10 11"/>"""


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="only Linux lists the open files of a process")
@pytest.mark.parametrize("text", [model("<object"), model('<object id="1"/>', "<!DOCTYPE a>")])
def test_a_file_is_closed_after_a_fault_in_the_middle_of_a_part(tmp_path: Path, text: str) -> None:
    """The error keeps the frames that read the part alive."""
    path = saved(tmp_path, text)
    with pytest.raises(InvalidMesh) as info:
        threemf.read_3mf(path)
    opened = [os.path.realpath(link) for link in Path("/proc/self/fd").iterdir()]
    assert info.value.__cause__ is not None
    assert str(path.resolve()) not in opened


def test_colours_of_corners_objects_and_textures(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Each triangle of a mirrored tetrahedron has colours of another kind; the last one's are not read."""
    extras = [' pid="10" p1="0" p2="1" p3="2"', "", ' pid="13" p1="0" p2="1" p3="2"', ' pid="14" p1="0"']
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = mesh_xml(points, faces, extra=extras.__getitem__)
    text = model(
        PALETTES + f'<object id="1" pid="11" pindex="0">{mesh}</object>',
        '<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>',
    )
    pixels = io.BytesIO()
    Image.fromarray(PIXELS.astype(np.uint8)).save(pixels, "PNG")
    path = saved(tmp_path, text, **{"3D/a b.png": pixels.getvalue()})
    positions, light = light_at_corners(path)
    expected = {
        (0, 0): (255, 0, 0), (0, 2): (0, 255, 0), (0, 1): (0, 0, 255),
        (1, 0): (128, 128, 128), (1, 1): (128, 128, 128), (1, 3): (128, 128, 128),
        (2, 0): PIXELS[0, 0], (2, 3): PIXELS[1, 1], (2, 2): PIXELS[1, 0],
        **{(3, corner): np.array(CLAY) * 255.0 for corner in (1, 2, 3)},
    }  # fmt: skip
    mirrored = points * (-1, 1, 1)
    for index, (position, shade) in enumerate(zip(positions, light, strict=True)):
        corner = int(np.flatnonzero((mirrored == position).all(axis=1))[0])
        assert shade == pytest.approx(linear(expected[index // 3, corner]), abs=1e-5)
    assert "colours of other kinds are left out: palette 14 of object 1" in caplog.text
    assert "colours that are no colours become white: palette 11 ('none')" in caplog.text


def test_a_fault_in_colours_costs_no_face(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    extras = [' pid="10" p1="7"', ' pid="13" p1="0"', ' pid="99" p1="0"', ' pid="x" p1="y"']
    mesh = mesh_xml(np.eye(4, 3), [[0, 1, 2], [0, 1, 3], [0, 3, 2], [1, 2, 3]], extra=extras.__getitem__)
    data = read_mesh_data(saved(tmp_path, model(PALETTES + f'<object id="1">{mesh}</object>')))
    assert len(data.faces) == 4
    for message in (
        "colours that palettes do not have are left out: object 1",
        "textures are left out: the part '/3D/a%20b.png' is missing",
        "colours of other kinds are left out: palette 99 of object 1",
    ):
        assert message in caplog.text
