"""The shader composer: text, slots, origins, and drivers' complaints mapped back to files."""

import ast
import re
from pathlib import Path

import pytest

from decals.shaders import CompileError, ComposeError, Origin, Source, compile_error, compose
from decals.shaders.compose import DIRECTORY, constants
from tests.import_graph import modules

COINCIDENCES = {
    ("FOOT_STEPS", "FOOT_STEPS"),  # of thin parts of meshes; of rays to relief
    ("MAX_KEPT", "KEPT"),  # both the components of two vectors
    ("ROUNDING", "NORMAL_ROUNDING"),
    ("STEPS", "SEED_STEPS"),
}
"""Constants of equal values and similar names that do not depend on each other."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "main.frag").write_text("//@ include lib.glsl\n//@ slot body\nvoid main() {}\n")
    (tmp_path / "lib.glsl").write_text("float one() { return 1.0; }\n//@ slot extra optional\n")
    return tmp_path


def test_version_and_defines_come_first(folder: Path) -> None:
    source = compose(
        "main.frag", slots={"body": ""}, defines={"N": 3, "ON": True, "OFF": False}, directory=folder
    )
    assert source.text.splitlines()[:3] == ["#version 330 core", "#define N 3", "#define ON"]
    assert "OFF" not in source.text


def test_version_is_the_callers(folder: Path) -> None:
    assert (
        compose("main.frag", slots={"body": ""}, version="430", directory=folder).lines[0] == "#version 430"
    )
    piece = compose("main.frag", slots={"body": ""}, version=None, directory=folder)
    assert "#version" not in piece.text


def test_every_line_knows_its_origin(folder: Path) -> None:
    source = compose("main.frag", slots={"body": "int a;\nint b;", "extra": "int c;"}, directory=folder)
    expected = [
        ("float one() { return 1.0; }", Origin("lib.glsl", 1)),
        ("int c;", Origin("<slot extra>", 1)),
        ("int a;", Origin("<slot body>", 1)),
        ("int b;", Origin("<slot body>", 2)),
        ("void main() {}", Origin("main.frag", 3)),
    ]
    assert list(zip(source.lines, source.origins, strict=True))[1:] == expected
    assert [source.origin(i + 2) for i in range(5)] == [origin for _, origin in expected]
    assert source.origin(99) is None


def test_a_source_in_a_slot_keeps_its_origins(folder: Path) -> None:
    library = Source.named("contact.py", "int a;\nint b;")
    source = compose("main.frag", slots={"body": library}, directory=folder)
    assert source.origins[source.lines.index("int b;")] == Origin("contact.py", 2)


def test_a_filling_may_include_and_a_file_comes_once(folder: Path) -> None:
    source = compose("main.frag", slots={"body": "//@ include lib.glsl\nint a;"}, directory=folder)
    assert source.text.count("float one()") == 1
    (folder / "loop.glsl").write_text("//@ include loop.glsl\nint x;\n")
    assert compose("loop.glsl", directory=folder).text.count("int x;") == 1


@pytest.mark.parametrize(
    ("slots", "message"),
    [
        ({}, r"main.frag:2: nothing was given for slot 'body'"),
        ({"body": "", "bodi": ""}, r"main.frag has no slot 'bodi'; its slots are 'body', 'extra'"),
        ({"body": "//@ slot body"}, r"<slot body>:1: the filling of slot 'body' holds that slot itself"),
        ({"body": "//@ slut body"}, r"<slot body>:1: expected"),
        ({"body": "\n//@ include none.glsl"}, r"<slot body>:2: no shader file 'none.glsl'"),
        ({"body": "#version 150"}, r"<slot body>:1: a shader file carries no #version"),
    ],
)
def test_bad_compositions_say_where_and_why(folder: Path, slots: dict[str, str], message: str) -> None:
    with pytest.raises(ComposeError, match=message):
        compose("main.frag", slots=slots, directory=folder)


def test_missing_file_and_bad_define(folder: Path) -> None:
    with pytest.raises(ComposeError, match=r"no shader file 'gone.frag'"):
        compose("gone.frag", directory=folder)
    with pytest.raises(ComposeError, match="identifier"):
        compose("lib.glsl", defines={"a b": 1}, directory=folder)


@pytest.mark.parametrize(
    "complaint",
    ["0:3(5): error: `x' undeclared", "0(3) : error C1503: undefined `x'", "ERROR: 0:3: 'x' : undeclared"],
    ids=["mesa", "nvidia", "apple"],
)
def test_a_drivers_complaint_names_file_and_line(folder: Path, complaint: str) -> None:
    source = compose("main.frag", slots={"body": "int a = x;"}, directory=folder)
    vertex = Source.named("v.vert", "a\nb\nc\n")
    log = f"GLSL Compiler failed\n\nfragment_shader\n===============\n{complaint}\n"
    error = compile_error(log, {"vertex_shader": vertex, "fragment_shader": source})
    assert isinstance(error, CompileError)
    message = str(error)
    assert "<slot body>:1: error" in message
    assert "int a = x;" in message
    assert "v.vert" not in message


def test_what_cannot_be_mapped_stays(folder: Path) -> None:
    source = Source.named("a.frag", "x")
    log = "GLSL Linker failed\nerror: unresolved reference to function `bar'\n0:77(1): error: beyond\n"
    message = str(compile_error(log, {"fragment_shader": source}))
    assert "unresolved reference" in message
    assert "0:77(1): error: beyond" in message


def test_shader_files_carry_no_version() -> None:
    files = [path for path in DIRECTORY.iterdir() if path.suffix in {".glsl", ".vert", ".frag", ".comp"}]
    for path in files:
        assert "#version" not in path.read_text(encoding="utf-8"), path.name


def python_constants(text: str) -> list[tuple[str, object]]:
    """Return the constants and members of enumerations of a Python file: names and literal values."""
    found = []
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                found += list(zip(names, values, strict=False))
            case ast.Assign(targets=[target], value=value):
                found.append((target, value))
    return [
        (name.id, value.value)
        for name, value in found
        if isinstance(name, ast.Name) and isinstance(value, ast.Constant) and name.id.isupper()
    ]


def repeated(python: str, glsl: str) -> set[tuple[str, str]]:
    """Return the pairs of constants of the same value of which one's name ends with the other's."""
    declared = re.findall(r"const (?:int|uint|float) (\w+) = ([-+.\de]+)u?;", glsl)
    declared += re.findall(r"^#define (\w+) ([-+.\de]+)$", glsl, re.MULTILINE)
    return {
        (name, other)
        for name, value in python_constants(python)
        for other, literal in declared
        if value == float(literal) and (f"_{name}".endswith(f"_{other}") or f"_{other}".endswith(f"_{name}"))
    }


def test_constants_of_python_are_not_repeated_in_shaders() -> None:
    python = [path.read_text(encoding="utf-8") for name, path in modules().items() if "apps" not in name]
    shaders = (path for path in DIRECTORY.iterdir() if path.suffix in (".glsl", ".frag", ".vert", ".comp"))
    glsl = "\n".join(path.read_text(encoding="utf-8") for path in shaders)
    pairs = set().union(*(repeated(text, glsl) for text in python))
    assert pairs == COINCIDENCES
    example = "class Mode:\n    SOFT = 3\nNEAR_REACH, STEPS = 0.575, 4\n"
    found = repeated(example, "const float REACH = 5.75e-1;\nconst int SOFT = 3;\n#define STEPS 5\n")
    assert found == {("NEAR_REACH", "REACH"), ("SOFT", "SOFT")}


def test_python_reads_constants_of_shaders() -> None:
    assert constants("light_rows.glsl") == {"MAX_LIGHTS": 32}
    assert constants("material.glsl")["MIN_FACING"] == 1e-3
