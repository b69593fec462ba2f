"""Files of other programs as trees: their fields beside NumPy, their surfaces, and hostile files."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Expression, Node, from_json, polygonize, save, to_json
from blobtree.errors import InvalidFile, UnusableFile
from blobtree.foreign import read_lipschitz, read_program, read_three_js, read_tree
from blobtree.foreign.json_values import parsed_json
from blobtree.foreign.programs import ORDERED, PACKED
from tests.blobtree.expressions import letters, program
from tests.blobtree.foreign_files import archive, distance_root, lipschitz_scene, root, scalis
from tests.oracles import foreign
from tests.oracles.expressions import distances, values

FOREIGN_MODELS = os.environ.get("FOREIGN_MODELS")
ARC_BESIDE_PARABOLA = 0.06
"""Distance of a blend from that of its file over `blendRadius`: 0.043 at right angles, more at sharp ones."""


def written(folder: Path, content: Any, name: str = "tree.json") -> Path:
    """A file of these bytes, lines or values."""
    path = folder / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_text(json.dumps(content) if name.endswith("json") else "\n".join(content))
    return path


@pytest.mark.parametrize("seed", range(8))
def test_scenes_of_distances_have_their_surface(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = lipschitz_scene(rng, 4, blend=0.0)
    tree = read_tree(written(tmp_path, scene))
    points = rng.uniform(-1.2, 1.2, (4000, 3))
    distance = foreign.lipschitz(scene, points)
    away = np.abs(distance) > 1e-4
    assert ((tree(points) > 0.5) == (distance < 0.0))[away].all()
    assert from_json(to_json(tree)) == tree


def test_blends_of_scenes_are_arcs_of_the_same_width(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    beyond = 0
    for _ in range(12):
        scene = lipschitz_scene(rng, 2, blend=0.15)
        tree = read_lipschitz(written(tmp_path, scene))
        points = rng.uniform(-1.2, 1.2, (4000, 3))
        distance = foreign.lipschitz(scene, points)
        wrong = (tree(points) > 0.5) != (distance < 0.0)
        beyond += int((wrong & (np.abs(distance) > ARC_BESIDE_PARABOLA * 0.15)).sum())
    assert beyond <= 4  # where normals are nearly opposite, both are sharp wedges


def test_a_thousand_nested_blends(tmp_path: Path) -> None:
    ball = {
        "nodeType": "primitive", "primitiveType": "sphere", "radius": 0.1, "round_x": 0, "round_y": 0,
        "color": [1, 0, 0],
    }  # fmt: skip
    node: Any = {**ball, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}
    for i in range(1000):
        moved = {**ball, "matrix": [1, 0, 0, -0.1 * i, 0, 1, 0, 0, 0, 0, 1, 0]}
        node = {
            "nodeType": "binaryOperator", "blendMode": "union", "blendRadius": 0.05,
            "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], "leftChild": node, "rightChild": moved,
        }  # fmt: skip
    text = _nested_text({"aabb_min": [0, 0, 0], "aabb_max": [100, 1, 1], **node})
    tree = read_lipschitz(written(tmp_path, text.encode()))
    inside = tree([[50.05, 0, 0], [50.05, 0.3, 0]]) > 0.5
    assert inside.tolist() == [True, False]


def _nested_text(node: Any) -> str:
    """JSON of operators nested to the left, which the standard library cannot write so deep."""
    head, tail = "", ""
    while "leftChild" in node:
        rest = {name: value for name, value in node.items() if name != "leftChild"}
        head += json.dumps(rest)[:-1] + ', "leftChild": '
        tail += "}"
        node = node["leftChild"]
    return head + json.dumps(node) + tail


SCALIS = [
    ("ScalisPoint", "dist", 1e-5),
    ("ScalisSegment", "dist", 1e-4),
    ("ScalisSegment", "convol", 1e-3),
    ("ScalisTriangle", "dist", 1e-3),
    ("ScalisTriangle", "convol", 5e-3),
]


@pytest.mark.parametrize(("kind", "volume", "tolerance"), SCALIS)
def test_scalis_primitives_have_half_the_value(
    tmp_path: Path, kind: str, volume: str, tolerance: float
) -> None:
    rng = np.random.default_rng(11)
    for _ in range(4):
        values_in_file = scalis(rng, kind, volume, even=kind == "ScalisTriangle")
        tree = read_three_js(written(tmp_path, root(values_in_file)))
        points = rng.uniform(-1.5, 1.5, (150, 3))
        exact = foreign.three_js(values_in_file, points)
        np.testing.assert_allclose(2.0 * tree(points), exact, atol=tolerance * max(exact.max(), 1.0))


def _joined(kind: str, **fields: Any) -> Callable[[Any], Any]:
    def make(rng: np.random.Generator) -> Any:
        children = [scalis(rng, "ScalisPoint"), scalis(rng, "ScalisSegment", even=True)]
        return {"type": kind, "children": children, **fields}

    return make


@pytest.mark.parametrize(
    "make",
    [
        _joined("RicciNode", ricci_n=3.0),
        _joined("RicciNode", ricci_n=1.0),
        _joined("MaxNode"),
        _joined("MinNode"),
        _joined("DifferenceNode", alpha=1.0),
        lambda rng: {"type": "ScaleNode", "scale_x": 1.2, "scale_y": 0.8, "scale_z": 1.5,
                     "children": [scalis(rng, "ScalisSegment")]},
        lambda rng: {"type": "TwistNode", "twist_amout": 1.5, "axis_x": 0.0, "axis_y": 1.0, "axis_z": 0.0,
                     "children": [scalis(rng, "ScalisSegment", even=True)]},
        lambda rng: {"type": "TwistNode", "twist_amout": -0.7, "axis_x": 0.6, "axis_y": 0.0, "axis_z": 0.8,
                     "children": [scalis(rng, "ScalisSegment", even=True)]},
    ],
)  # fmt: skip
def test_nodes_of_three_js_blobtree_have_half_the_value(tmp_path: Path, make: Callable[[Any], Any]) -> None:
    rng = np.random.default_rng(12)
    for _ in range(3):
        node = make(rng)
        tree = read_tree(written(tmp_path, root(node)))
        points = rng.uniform(-1.5, 1.5, (200, 3))
        exact = foreign.three_js(node, points)
        np.testing.assert_allclose(2.0 * np.maximum(tree(points), 0.0), exact, atol=2e-3)
        assert from_json(to_json(tree)) == tree


def _difference(solid: Any, tool: Any) -> Any:
    return {"type": "DifferenceNode", "alpha": 1.0, "children": [solid, tool]}


def test_differences_below_sums_and_differences_end_at_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(14)
    for _ in range(6):
        a, b, c = (scalis(rng, "ScalisPoint") for _ in range(3))
        points = np.concatenate([rng.uniform(-1.5, 1.5, (200, 3)), [list(b["v"][0]["position"].values())]])
        blend = {"type": "RicciNode", "ricci_n": 1.0, "children": [_difference(a, b), c]}
        tree = read_tree(written(tmp_path, root(blend)))
        np.testing.assert_allclose(2.0 * tree(points), foreign.three_js(blend, points), atol=1e-3)
        nested = _difference(a, _difference(c, b))
        whole, carved = (read_tree(written(tmp_path, root(node)))(points) for node in (a, nested))
        assert (carved <= whole + 1e-6).all()


def test_older_files_call_the_exponent_ricci(tmp_path: Path) -> None:
    rng = np.random.default_rng(15)
    blend = _joined("RicciNode", ricci_n=3.0)(rng)
    older = {**blend, "ricci": blend["ricci_n"]}
    del older["ricci_n"]
    assert read_tree(written(tmp_path, root(older))) == read_tree(written(tmp_path, root(blend)))
    del older["ricci"]
    with pytest.raises(InvalidFile, match="node 1, child 0: the field 'ricci_n' is missing"):
        read_tree(written(tmp_path, root(older)))


@pytest.mark.parametrize("radii", [(0.3, 0.3), (0.3, 0.5)])
def test_signed_distances_have_their_surface(tmp_path: Path, radii: tuple[float, float]) -> None:
    rng = np.random.default_rng(13)
    for _ in range(3):
        values_in_file = distance_root(rng, *radii)
        tree = read_three_js(written(tmp_path, root(values_in_file)))
        points = rng.uniform(-1.5, 1.5, (400, 3))
        exact = foreign.three_js(values_in_file, points)
        away = np.abs(exact - 1.0) > 2e-3
        assert ((tree(points) > 0.5) == (exact > 1.0))[away].all()


@pytest.mark.parametrize("operations", [ORDERED, PACKED])
def test_programs_are_the_same_as_text_and_as_archives(tmp_path: Path, operations: Any) -> None:
    lines = [line for line in letters(np.random.default_rng(1), 8) if "hypot" not in line]
    text = read_program(written(tmp_path, lines, "text.vm"))
    packed = read_program(written(tmp_path, archive(lines, operations), "archive.frep"), size=text.size)
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (500, 3)) * (1.0, 1.0, 0.1)
    value, _ = values(lines, points)
    away = np.abs(value) > 1e-5
    for tree in (text, packed):
        assert ((tree(points) > 0.5) == (value < 0.0))[away].all()
    assert read_program(written(tmp_path, program(np.random.default_rng(3), 4), "a.vm")).size == (2, 2, 2)


def test_archives_without_sums_and_products_are_those_of_libfive(tmp_path: Path) -> None:
    box = ["x var-x", "h const 0.5", "low neg x", "a sub x h", "b sub low h", "box max a b"]
    tree = read_program(written(tmp_path, archive(box), "box.frep"), size=(2, 2, 2))
    assert (tree([[0.4, 0, 0], [-0.4, 0, 0], [0.6, 0, 0], [-0.6, 0, 0]]) > 0.5).tolist() == [1, 1, 0, 0]


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b""])
def test_texts_may_have_a_byte_order_mark_and_any_names(tmp_path: Path, mark: bytes) -> None:
    assert read_program(written(tmp_path, mark + b"Tx var-x", "a.vm")).clauses == ("Tx var-x",)
    own = mark + to_json(Expression("x var-x", (0, 0, 0), (1, 1, 1)))
    assert isinstance(read_tree(written(tmp_path, own)), Expression)


def test_foreign_files_may_name_this_package(tmp_path: Path) -> None:
    scene = {"name": "blobtree", **root(scalis(np.random.default_rng(1), "ScalisPoint"))}
    assert read_tree(written(tmp_path, scene)) == read_three_js(written(tmp_path, scene))


def test_meshes_of_scenes_lie_on_their_surface(tmp_path: Path) -> None:
    scene = lipschitz_scene(np.random.default_rng(5), 3, blend=0.0)
    mesh = polygonize(read_tree(written(tmp_path, scene)), resolution=64)
    distance = foreign.lipschitz(scene, mesh.vertices.astype(np.float64))
    assert np.quantile(np.abs(distance), 0.98) < 1e-3  # the others lie beside edges
    assert np.abs(distance).max() < 0.03


def test_models_of_commands_and_scenes_are_read(tmp_path: Path) -> None:
    scene = lipschitz_scene(np.random.default_rng(5), 2)
    for name, content in (("a.vm", letters(np.random.default_rng(1), 2)), ("b.json", scene)):
        loaded: Any = decals.load_model(written(tmp_path, content, name))
        assert isinstance(loaded.tree, Node)
        assert loaded.name == name[0]
    with pytest.raises(InvalidFile, match=r"c\.vm: clauses\[0\]"):
        decals.load_model(written(tmp_path, ["x frob"], "c.vm"))


def test_own_files_are_read_too(tmp_path: Path) -> None:
    tree = Expression("x var-x", (0, 0, 0), (1, 1, 1))
    save(tree, tmp_path / "own.json")
    assert read_tree(tmp_path / "own.json") == tree


_BOX = {
    "nodeType": "primitive", "primitiveType": "box", "sides": [1, 1, 1], "bevel": [0, 0, 0, 0], "round_x": 0,
    "round_y": 0, "color": [1, 0, 0], "matrix": [1e18, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
}  # fmt: skip


def _scene(**fields: Any) -> bytes:
    return _deep_text({"aabb_min": [0, 0, 0], "aabb_max": [1, 1, 1], **_BOX, **fields})


def _point(materials: Any) -> bytes:
    return _deep_text(root({**scalis(np.random.default_rng(1), "ScalisPoint"), "materials": materials}))


def _deep_text(content: Any) -> bytes:
    return json.dumps(content).replace('"DEEP"', "[" * 20_000 + "]" * 20_000).encode()


HOSTILE: list[tuple[str, bytes, str]] = [
    ("a.json", b"", "expected more, the file ends too early"),
    ("a.json", b"{", "expected more, the file ends too early"),
    ("a.json", b"\xff\xfe", "expected JSON in UTF-8"),
    ("a.json", b'{"type": "RootNode", "type" 1}', "no valid JSON in line 1: expected :"),
    ("a.json", b'{"type": 1e999}', "expected type among RootNode"),
    ("a.json", b'{"type": "Blob"}', "expected type among RootNode.*got 'Blob'"),
    ("a.json", b'{"type": "RootNode"}', "the field 'children' is missing"),
    ("a.json", b'{"type": "RootNode", "children": []}', "expected a list of nodes"),
    ("a.json", b'{"type": "RootNode", "iso": 0, "children": [1]}', "iso: expected a number from 1e-06"),
    ("a.json", b'{"type": "RootNode", "children": [1]}', "expected an object in braces, got 1.0"),
    ("a.json", b'{"nodeType": "primitive"}', "the field 'aabb_min' is missing"),
    ("a.json", _point(None), "materials: expected a list, got None"),
    ("a.json", _point([{"color": "DEEP"}]), "color: expected texts such as '#aaaaaa', got a list"),
    ("a.json", _scene(nodeType="DEEP"), "nodeType: expected primitive or binaryOperator, got a list"),
    ("a.json", _scene(sides=[1, 0, 1]), "sides: expected a number from 1e-09"),
    (
        "a.json",
        _scene(nodeType="binaryOperator", leftChild=_BOX, rightChild=_BOX, blendRadius=0),
        "node 1, leftChild: matrix: expected numbers up to 1e.18",
    ),
    ("a.json", b"[1, 2]", "not a BlobTree"),
    ("a.json", b"nul", "expected a value, got 'nul'"),
    ("a.vm", b"", "expected 1 to 200,000 clauses"),
    ("a.vm", b"x var-x\ny frob x", "expected one of var-x"),
    ("a.vm", b"\xff\x00", "expected a text of clauses"),
    ("a.frep", b'T"', "the archive ends too early"),
    ("a.frep", b'T""x', "expected a text in .quotes."),
    ("a.frep", b'T""""\x02', "the archive ends too early"),
    ("a.frep", b'T""""\x07\x05\0\0\0\xff', "expected earlier clauses as operands, got 5"),
    ("a.frep", b'T""""\x20\xff', "oracle has no counterpart"),
    ("a.frep", b'T""""\xc8\xff', "the code 200 has no counterpart"),
    ("a.frep", b'T""""\xff', "expected 1 to 200,000 clauses"),
]


@pytest.mark.parametrize(("name", "content", "message"), HOSTILE)
def test_hostile_files_get_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    with pytest.raises(InvalidFile, match=message) as caught:
        read_tree(written(tmp_path, content, name))
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def test_missing_files(tmp_path: Path) -> None:
    for read in (read_tree, read_program, read_lipschitz, read_three_js):
        with pytest.raises(UnusableFile, match=r"nothing.vm"):
            read(tmp_path / "nothing.vm")


def test_deep_json_is_read() -> None:
    depth = 50_000
    value = parsed_json(b"[" * depth + b"]" * depth)
    for _ in range(depth - 1):
        (value,) = value
    assert value == []


def test_damaged_files_raise_no_other_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    lines = letters(rng, 3)
    whole = [
        ("a.vm", "\n".join(lines).encode()),
        ("a.frep", archive(lines)),
        ("a.json", json.dumps(lipschitz_scene(rng, 4)).encode()),
        ("a.json", json.dumps(root(scalis(rng, "ScalisSegment"), distance_root(rng, 0.2, 0.3))).encode()),
    ]
    words = [b"1e300", b"-1", b"null", b"[]", b"{}", b'"x"', b"NaN", b"const", b"\x00", b"\xff"]
    for _ in range(400):
        name, content = whole[rng.integers(len(whole))]
        at, to = sorted(rng.integers(0, len(content), 2))
        damage = [content[:at], content[:at] + words[rng.integers(len(words))] + content[to:],
                  content[:at] + bytes([rng.integers(256)]) + content[at + 1 :]]  # fmt: skip
        path = written(tmp_path, damage[rng.integers(3)], name)
        try:
            tree: Node = read_tree(path)
        except InvalidFile as error:
            message = str(error)
            assert "\n" not in message, message
            assert len(message) < 1000, message
        else:
            assert isinstance(tree, Node)


@pytest.mark.slow
@pytest.mark.skipif(
    FOREIGN_MODELS is None, reason="FOREIGN_MODELS names no folder of files of other programs"
)
def test_files_of_a_folder() -> None:
    paths = [
        path
        for path in sorted(Path(FOREIGN_MODELS or "").iterdir())
        if path.suffix in (".vm", ".frep", ".json")
    ]
    assert paths
    for path in paths:
        tree: Any = read_tree(path)
        lower, upper = tree.support
        points = np.random.default_rng(1).uniform(lower, upper, (100, 3))
        field = tree(points)
        assert np.isfinite(field).all(), path
        if isinstance(tree, Expression):
            value, _ = distances(tree, points)
            away = np.abs(value) > 1e-3
        else:
            scene = parsed_json(path.read_bytes())
            if "nodeType" not in scene:
                continue
            value = foreign.lipschitz(scene, points)
            away = np.abs(value) > 0.01
        alike = 1.0 if isinstance(tree, Expression) else 0.95  # blends overlap in scenes
        assert ((field > 0.5) == (value < 0.0))[away].mean() >= alike, path
