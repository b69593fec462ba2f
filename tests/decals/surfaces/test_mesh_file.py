from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from decals.errors import InvalidMesh
from decals.surfaces import read_mesh
from decals.surfaces.mesh_file import dataset_triangles, read_dataset
from decals.surfaces.triangulate import polygon_triangles

HEADER = """ply
format {form} 1.0
comment made by hand
element vertex {vertices}
property float x
property double y
property float z
property uchar red
element face {faces}
property list uchar int vertex_indices
end_header
"""
SIGNALLING = np.array([0x7FF4000000000001], np.uint64).view(np.float64)[0]
"""A NaN that raises a flag of the processor wherever it is used."""

SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]


def _ascii_ply(points: list[tuple[float, float, float]], polygons: list[list[int]]) -> bytes:
    rows = [f"{x} {y} {z} 255" for x, y, z in points] + [
        f"{len(p)} {' '.join(map(str, p))}" for p in polygons
    ]
    return (
        HEADER.format(form="ascii", vertices=len(points), faces=len(polygons)) + "\n".join(rows) + "\n"
    ).encode()


def _binary_ply(points: list[tuple[float, float, float]], polygons: list[list[int]], order: str) -> bytes:
    form = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    body = b""
    for point in points:
        row = np.zeros(1, [("x", order + "f4"), ("y", order + "f8"), ("z", order + "f4"), ("red", "u1")])
        row["x"], row["y"], row["z"] = point
        body += row.tobytes()
    for polygon in polygons:
        body += bytes([len(polygon)]) + np.array(polygon, order + "i4").tobytes()
    return HEADER.format(form=form, vertices=len(points), faces=len(polygons)).encode() + body


def _area(path: Path) -> float:
    vertices, faces = read_mesh(path)
    assert vertices.dtype == np.float32
    assert faces.dtype == np.int32
    a, b, c = vertices[faces].transpose(1, 0, 2).astype(np.float64)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl", "vtp", "vtk"])
def test_every_common_format_gives_the_same_sphere(tmp_path: Path, suffix: str) -> None:
    sphere = pv.Sphere(theta_resolution=12, phi_resolution=9)
    path = tmp_path / f"sphere.{suffix}"
    sphere.save(path)
    vertices, faces = read_mesh(path)
    assert len(faces) == sphere.n_cells
    assert np.allclose(
        vertices[faces].mean(axis=(0, 1)),
        np.asarray(sphere.points)[sphere.regular_faces].mean(axis=(0, 1)),
        atol=1e-5,
    )
    assert _area(path) == pytest.approx(sphere.area, rel=1e-5)


@pytest.mark.parametrize(
    "polygons", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]], [[0, 1, 2], [0, 2, 3, 0]], [[0, 1], [0, 1, 2, 3]]]
)
@pytest.mark.parametrize("order", ["", "<", ">"])
def test_ply_polygons_of_any_size(tmp_path: Path, polygons: list[list[int]], order: str) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(_binary_ply(SQUARE, polygons, order) if order else _ascii_ply(SQUARE, polygons))
    assert np.array_equal(read_mesh(path)[0], np.array(SQUARE, np.float32))
    assert _area(path) == pytest.approx(1.0)


def test_ply_agrees_with_vtk(tmp_path: Path) -> None:
    sphere = pv.Sphere()
    for binary in (True, False):
        sphere.save(tmp_path / "a.ply", binary=binary)
        vertices, faces = read_mesh(tmp_path / "a.ply")
        reference = pv.read(tmp_path / "a.ply")
        assert np.array_equal(vertices, reference.points)
        assert np.array_equal(faces, reference.regular_faces)


def test_a_concave_polygon_keeps_its_area(tmp_path: Path) -> None:
    arrow = [(0.0, 0.0, 0.0), (2.0, 1.0, 0.0), (0.0, 2.0, 0.0), (1.5, 1.0, 0.0)]
    path = tmp_path / "a.ply"
    path.write_bytes(_ascii_ply(arrow, [[0, 1, 2, 3]]))
    assert _area(path) == pytest.approx(0.5)


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_ply_cut_anywhere_is_refused_not_crashed_on(tmp_path: Path, order: str) -> None:
    polygons = [[0, 1, 2], [0, 2, 3, 1]]
    whole = _binary_ply(SQUARE, polygons, order) if order else _ascii_ply(SQUARE, polygons)
    path = tmp_path / "a.ply"
    for end in range(0, len(whole) - 2, 3):
        path.write_bytes(whole[:end])
        with pytest.raises(InvalidMesh, match=r"a\.ply"):
            read_mesh(path)


@pytest.mark.parametrize("corner", [4, -1, 99_999_999])
def test_wrong_indices_are_refused_not_crashed_on(tmp_path: Path, corner: int) -> None:
    for polygons in ([[0, 1, corner]], [[0, 1, 2, corner]]):
        (tmp_path / "a.ply").write_bytes(_ascii_ply(SQUARE, polygons))
        with pytest.raises(InvalidMesh, match="asks for number"):
            read_mesh(tmp_path / "a.ply")
    rows = "POINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 5\n"
    (tmp_path / "a.vtk").write_text(
        f"# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n{rows}4 0 1 2 {corner}\n"
    )
    with pytest.raises(InvalidMesh, match="asks for number"):
        read_mesh(tmp_path / "a.vtk")


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl", "vtp", "vtk", "off", "gltf", "xyz", "json", ""])
@pytest.mark.parametrize("content", [b"", b"hello world\n" * 30, b"\x00\xff" * 200])
def test_junk_is_one_quiet_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], suffix: str, content: bytes
) -> None:
    path = tmp_path / f"junk.{suffix}"
    path.write_bytes(content)
    with pytest.raises(InvalidMesh, match="junk") as caught:
        read_mesh(path)
    message = str(caught.value)
    assert "\n" not in message
    assert "pyvista" not in message
    assert "vtk" not in message.replace(".vtk", "")
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


def test_truncated_files_of_other_formats(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for suffix in ("obj", "stl", "vtp", "vtk"):
        path = tmp_path / f"cut.{suffix}"
        pv.Sphere().save(path)
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 3])
        with pytest.raises(InvalidMesh, match="cut"):
            read_mesh(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", ["surface", "grid", "structured"])
@pytest.mark.parametrize("suffix", ["binary.vtk", "text.vtk", "xml"])
def test_a_vtk_file_cut_anywhere_has_no_other_faces(tmp_path: Path, kind: str, suffix: str) -> None:
    """Without a check the reader leaves arrays unfilled: here they hold points far away."""
    sphere = pv.Sphere(theta_resolution=8, phi_resolution=6)
    corners = np.meshgrid(np.arange(3.0), np.arange(4.0), np.arange(2.0), indexing="ij")
    dataset, xml = {
        "surface": (sphere, "vtp"),
        "grid": (sphere.cast_to_unstructured_grid(), "vtu"),
        "structured": (pv.StructuredGrid(*corners), "vts"),
    }[kind]
    path = tmp_path / (f"cut.{xml}" if suffix == "xml" else f"cut.{suffix.removeprefix('text.')}")
    dataset.save(path, binary=suffix != "text.vtk")
    vertices, faces = dataset_triangles(read_dataset(path), name="cut")
    whole = path.read_bytes()
    read = 0
    for end in np.linspace(120, len(whole) - 40, 20).astype(int):  # shorter ones may crash this process
        path.write_bytes(whole[:end])
        try:
            found = dataset_triangles(read_dataset(path), name="cut")
        except InvalidMesh:
            continue
        read += 1
        assert np.array_equal(found[0], vertices)
        assert np.array_equal(found[1], faces)
    assert read <= 3, "nearly all cuts lose declared numbers"


def test_text_cut_behind_a_number_is_refused(tmp_path: Path) -> None:
    rows = "DATASET STRUCTURED_GRID\nDIMENSIONS 2 2 2\nPOINTS 8 float\n"
    path = tmp_path / "a.vtk"
    for count in (1, 5, 12, 23):
        path.write_text(
            "# vtk DataFile Version 3.0\nx\nASCII\n" + rows + " ".join("0.5" for _ in range(count))
        )
        with pytest.raises(InvalidMesh, match=r"a\.vtk"):
            read_mesh(path)
    numbers = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float).ravel()
    path.write_text(f"# vtk DataFile Version 3.0\nx\nASCII\n{rows}{' '.join(map(str, numbers))}")
    assert _area(path) == pytest.approx(6.0)


@pytest.mark.parametrize(
    "offsets", [[0, 4, 3], [0, 3, 99], [0, -5, 6]], ids=["backward", "beyond", "negative"]
)
@pytest.mark.parametrize("kind", ["surface", "grid"])
def test_cells_that_do_not_follow_each_other_are_refused(offsets: list[int], kind: str) -> None:
    cells = pv.CellArray.from_arrays(np.array([0, 3, 6]), np.array([0, 1, 2, 0, 2, 3]))
    pv.convert_array(cells.GetOffsetsArray())[:] = offsets
    points = pv.PolyData(np.array(SQUARE)).points
    dataset: pv.PolyData | pv.UnstructuredGrid
    if kind == "surface":
        dataset = pv.PolyData()
        dataset.points = points
        dataset.SetPolys(cells)
    else:
        dataset = pv.UnstructuredGrid()
        dataset.points = points
        dataset.SetCells(5, cells)
    with pytest.raises(InvalidMesh, match="follow each other"):
        dataset_triangles(pv.MultiBlock([dataset]), name="a")


@pytest.mark.parametrize("dimensions", [(1000, 100, 1), (2, 2, 1)])
def test_a_structured_grid_has_the_points_of_its_dimensions(dimensions: tuple[int, int, int]) -> None:
    grid = pv.StructuredGrid()
    grid.points = np.random.default_rng(0).random((12, 3))
    grid.dimensions = dimensions
    with pytest.raises(InvalidMesh, match="12 points but its dimensions"):
        dataset_triangles(grid, name="grid")


@pytest.mark.parametrize(
    ("whole", "pieces", "works"),
    [
        ("0 4 0 3 0 0", ["0 4 0 3 0 0"], True),
        ("1 5 -3 0 2 2", ["1 5 -3 0 2 2"], True),
        ("0 4 0 3 0 0", ["0 4 0 3 0 0", "0 -1 0 -1 0 -1"], True),
        ("0 4 0 3 0 0", ["0 2 0 3 0 0", "2 4 0 3 0 0"], True),
        ("0 4 0 3 0 0", ["0 2 0 3 0 0", "0 2 0 3 0 0"], False),
        ("0 4 0 9 0 0", ["0 4 0 3 0 0"], False),
        ("0 3 0 3 0 0", ["0 4 0 3 0 0"], False),
        ("0 4 0 3 0 0", [], False),
        ("0 4 0 3 0", ["0 4 0 3 0 0"], False),
        ("0 4 0 1000000 0 0", ["0 4 0 3 0 0"], False),
    ],
)
def test_the_pieces_of_a_grid_fill_it(whole: str, pieces: list[str], works: bool, tmp_path: Path) -> None:
    path = tmp_path / "grid.vts"
    text = [f'<VTKFile type="StructuredGrid" version="0.1"><StructuredGrid WholeExtent="{whole}">']
    for extent in pieces:
        x, y, z = [range(low, high + 1) for low, high in np.array(extent.split(), int).reshape(3, 2)]
        points = " ".join(f"{a} {b} {c}" for c in z for b in y for a in x)
        array = f'<DataArray type="Float32" NumberOfComponents="3" format="ascii">{points}</DataArray>'
        text.append(f"<Piece Extent='{extent}'><Points>{array if points else ''}</Points></Piece>")
    path.write_text("\n".join([*text, "</StructuredGrid></VTKFile>"]), encoding="ascii")
    if works:
        vertices, faces = read_mesh(path)
        assert (len(vertices), len(faces)) == (20, 24)
        assert np.ptp(vertices, axis=0).tolist() == [4.0, 3.0, 0.0]
    else:
        with pytest.raises(InvalidMesh, match="whole extent"):
            read_mesh(path)


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, SIGNALLING, 1e308])
def test_points_beyond_numbers_are_refused_without_a_warning(value: float) -> None:
    points = np.array([[value, 0, 0], [value, 1, 0], [value, 1, 1]], np.float64)
    if np.isfinite(value):
        points[1, 0] = -value
    with pytest.raises(InvalidMesh, match="not finite"):
        polygon_triangles(points, [np.arange(3)], name="mesh")


def test_points_without_faces(tmp_path: Path) -> None:
    pv.PolyData(np.random.default_rng(0).random((5, 3))).save(tmp_path / "cloud.vtp")
    with pytest.raises(InvalidMesh, match=r"no faces|cloud"):
        read_mesh(tmp_path / "cloud.vtp")
    (tmp_path / "a.ply").write_bytes(_ascii_ply(SQUARE, []))
    with pytest.raises(InvalidMesh, match="4 points but no faces"):
        read_mesh(tmp_path / "a.ply")


@pytest.mark.parametrize("path", [None, 0, b"a.ply", [], np.zeros(3)])
def test_a_value_that_is_no_path_is_refused(path: Any) -> None:
    with pytest.raises(InvalidMesh, match="expected the path of a file"):
        read_mesh(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere.ply", tmp_path):
        with pytest.raises(InvalidMesh, match="check the path"):
            read_mesh(path)


@pytest.mark.parametrize("name", ["a" * 5000 + ".ply", "a\0b.ply"])
def test_a_path_that_no_file_can_have(name: str) -> None:
    with pytest.raises(InvalidMesh, match="found no file"):
        read_mesh(name)


def test_a_volume_mesh_gives_its_boundary(tmp_path: Path) -> None:
    pv.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid().save(tmp_path / "a.vtu")
    assert _area(tmp_path / "a.vtu") == pytest.approx(24.0)


def test_a_picture_is_no_mesh(tmp_path: Path) -> None:
    pv.ImageData(dimensions=(3, 3, 3)).save(tmp_path / "a.vti")
    with pytest.raises(InvalidMesh, match="ImageData"):
        read_mesh(tmp_path / "a.vti")


def test_strips_are_triangulated() -> None:
    strip = pv.PolyData(np.array(SQUARE, np.float32), strips=[4, 0, 1, 3, 2])
    vertices, faces = dataset_triangles(strip, name="strip")
    assert faces.shape == (2, 3)
    assert len(vertices) == 4
