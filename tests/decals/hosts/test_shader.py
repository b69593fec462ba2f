"""`decals.shader`: what it promises beside values; its refusals, its names, its edits."""

import pickle
import shutil
import subprocess
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

import decals
from decals.editing import Document
from decals.errors import InvalidScene, TooMuchData
from decals.hosts.code import STAGES, VERSIONS, code_of
from decals.hosts.textures import MAX_ROWS, data_size
from decals.hosts.unsupported import UNSUPPORTED
from decals.index import DecalEditor
from decals.rendering import Context, Drawing
from decals.rendering.decal_library import Form
from decals.shaders import ComposeError
from decals.shaders.isolate import declarations, prefixed, preprocessed, reachable
from tests.decals.hosts.agreement import equal_pixels
from tests.decals.hosts.form_scenes import material, name_of, points_on, scene_of
from tests.decals.hosts.glsl_names import global_names
from tests.decals.hosts.moderngl_host import at_points, picture
from tests.decals.shapes import torus

PAGE = Path(__file__).parents[3] / "docs" / "shader.md"
FULL = Form(decals.Contact.ELASTIC, layered=True, limited=True, nested=True, materials=True)
PLAIN = Form(decals.Contact.PRODUCT)


# -- names ----------------------------------------------------------------------------------------------


@pytest.mark.ordinary_cases("elastic-layered-limited-nested-materials")
@pytest.mark.parametrize("form", Form.all(), ids=name_of)
def test_all_names_begin_with_the_prefix(form: Form) -> None:
    for version in VERSIONS:
        for stage in VERSIONS[version].stages:
            names = global_names(code_of(form, version, stage, "my").text)
            assert {"mycolor", "myowner", "mymaterial", "myrecords", "myMaterial", "myOPAQUE"} < names
            assert [name for name in names if not name.startswith("my")] == []


def test_the_names_are_found_in_all_kinds_of_declarations() -> None:
    text = """#define A 1
    #ifndef B
    #define B(x) x
    #endif
    precision highp float;
    struct C { int a; vec2 b[2]; };  // int d;
    layout(std140, binding = 0) uniform D { int e; mat4 f; };
    uniform J { int k; } l;
    uniform highp sampler2D g;
    const float h[2] = float[2](1.0, 2.0);
    int i;
    vec4 m(int n, out float o) { int p = 1; { int q; } return vec4(p); }
    void r();
    """
    assert global_names(text) == set("ABCDefJlghimr")


def test_two_scenes_share_a_shader(context: Context) -> None:
    scene = scene_of(PLAIN)
    first, second = (decals.shader(scene, prefix=prefix) for prefix in ("one_", "two_"))
    points, normals = points_on(scene, 10)
    both = replace(first, code=first.code + second.code)
    values = at_points(context.gl, both, points, normals)  # compiles both
    assert values["found"].shape == (10, 4)


@pytest.mark.parametrize(
    "prefix", ["", "gl_", "gl_x", "webgl_", "a__b", "1a", "a b", "ä", "a-", "x" * 65, None, 3, "a\n"]
)
def test_prefixes_that_glsl_forbids(prefix: Any) -> None:
    with pytest.raises(InvalidScene, match="prefix: expected"):
        decals.shader(scene_of(PLAIN), prefix=prefix)


@pytest.mark.parametrize("prefix", ["contact_", "image_", "tangent_", "rank_", "sampler2D", "x_"])
def test_a_prefix_makes_no_name_twice(context: Context, prefix: str) -> None:
    """A word that is a local name too is refused, or it compiles."""
    scene = scene_of(PLAIN)
    refused = None
    try:
        exported = decals.shader(scene, prefix=prefix)
    except InvalidScene as error:
        refused = str(error)
    if refused is None:
        points, normals = points_on(scene, 10)
        at_points(context.gl, exported, points, normals)
    else:
        assert "makes no name twice" in refused


def test_names_that_would_be_the_same_are_refused() -> None:
    parts = declarations("int decal_a;\nint b() { int x_c; return decal_a; }\nint c;\nint a;\n")
    with pytest.raises(ComposeError, match="x_a"):
        prefixed(parts, "x_")
    with pytest.raises(ComposeError, match="x_c"):
        prefixed(parts[1:3], "x_")
    with pytest.raises(ComposeError, match="int"):
        prefixed(declarations("float nt;"), "i", ["int"])


# -- the text -------------------------------------------------------------------------------------------


def test_directives_are_resolved() -> None:
    text = "#define A\n#define N 3\n#ifdef A\nint x = N; // N\n#ifndef A\nint y;\n#endif\n"
    text += "#else\nint z;\n#endif\n"
    assert preprocessed(text) == "int x = 3; // N\n"
    for wrong in ("#if 1\n#endif\n", "#define F(x) x\n", "#ifdef A\n", "#endif\n", "#else\n"):
        with pytest.raises(ComposeError):
            preprocessed(wrong)


def test_only_what_is_used_stays_with_its_comments() -> None:
    text = """// of the file

// of a
int a = 1;  // behind a
int b;  // behind b
// of S
struct S {
    int a;  // a field
};
float f(S s) { return float(s.b + a); }
void g() { S s; f(s); }
"""
    kept = reachable(declarations(text), ["g"])
    assert [part.name for part in kept] == ["a", "S", "f", "g"]
    assert kept[0].text == "// of a\nint a = 1;  // behind a"
    assert [part.text.replace("\n", " ") for part in prefixed(kept, "p_")[1:3]] == [
        "// of S struct p_S {     int a;  // a field };",
        "float p_f(p_S s) { return float(s.b + p_a); }",
    ]


def test_code_has_no_version_and_no_main() -> None:
    for version in VERSIONS:
        exported = decals.shader(scene_of(FULL), version=version)
        assert exported.header.startswith(f"#version {version}\n")
        assert "#version" not in exported.code
        assert "main" not in exported.code
        assert ("dFdx" in exported.code) == (exported.stage == "fragment")
        assert "dFdx" not in decals.shader(scene_of(FULL), version=version, stage="vertex").code


def test_textures_and_uniforms_are_those_that_the_code_declares() -> None:
    for form in (PLAIN, FULL):
        exported = decals.shader(scene_of(form))
        words = [line.split() for line in exported.code.splitlines() if line.startswith("uniform ")]
        declared = {line[2].rstrip(";"): line[1] for line in words}
        kinds = {"2d": ("sampler2D", "isampler2D"), "2d-array": ("sampler2DArray",)}
        for texture in exported.textures:
            assert declared.pop(texture.name) in kinds[texture.kind]
            width, height, *layers = texture.size
            assert texture.array.shape[: 2 + len(layers)] == (*layers, height, width)
        assert {
            name: "float" if isinstance(v, float) else "int" for name, v in exported.uniforms.items()
        } == declared


CALL = """
{inputs}
void main() {{
    float field;
    vec2 uv;
    int owner = decal_owner({q}, {q}, field, uv);
    vec4 color = decal_color({q}, {q}, vec3(0.0), vec3(0.0));
    color += decal_material({q}, {q}, vec3(0.0), vec3(0.0)).color;
    {output} = color + vec4(float(owner), field, uv);
}}
"""


@pytest.mark.parametrize("version", ["330 core", "300 es"])
def test_vertex_shaders_have_the_functions(context: Context, version: str) -> None:
    exported = decals.shader(scene_of(PLAIN), version=version, stage="vertex")
    vertex = CALL.format(inputs="in vec3 q;", q="q", output="gl_Position")
    fragment = "precision highp float;\nout vec4 shown;\nvoid main() { shown = vec4(1.0); }\n"
    context.gl.program(
        vertex_shader=exported.header + exported.code + vertex, fragment_shader=exported.header + fragment
    ).release()


@pytest.mark.parametrize("stage", ["vertex", "compute"])
def test_stages_of_spirv_have_the_functions(stage: str, tmp_path: Path) -> None:
    if shutil.which("glslangValidator") is None:
        pytest.skip("glslangValidator is not installed (on Debian: apt-get install glslang-tools)")
    exported = decals.shader(scene_of(FULL), version="450", stage=stage)
    if stage == "vertex":
        call = CALL.format(inputs="layout(location = 0) in vec3 q;", q="q", output="gl_Position")
    else:
        inputs = "layout(local_size_x = 8) in;\nlayout(set = 1, binding = 0) buffer Result { vec4 rows[]; };"
        place = "vec3(gl_GlobalInvocationID)"
        call = CALL.format(inputs=inputs, q=place, output="rows[gl_GlobalInvocationID.x]")
    source = tmp_path / f"decals.{stage[:4]}"
    source.write_text(exported.header + exported.code + call, encoding="utf-8")
    command = ["glslangValidator", "-V", str(source), "-o", str(tmp_path / "decals.spv")]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout


# -- the object -----------------------------------------------------------------------------------------


def test_a_shader_is_frozen_and_survives_a_pickle() -> None:
    exported = decals.shader(scene_of(FULL), version="450")
    again = pickle.loads(pickle.dumps(exported))
    assert (again.code, again.header, again.uniforms) == (exported.code, exported.header, exported.uniforms)
    for one, other in zip(again.textures, exported.textures, strict=True):
        np.testing.assert_array_equal(one.array, other.array)
        assert not one.array.flags.writeable
    assert [texture.binding for texture in exported.textures] == list(range(2, 2 + len(exported.textures)))
    with pytest.raises(FrozenInstanceError):
        exported.code = ""  # type: ignore[misc]


def test_the_block_of_uniforms_holds_their_values() -> None:
    exported = decals.shader(scene_of(FULL), version="450", stiffness=2.5)
    kinds = {
        name: np.float32 if isinstance(value, float) else np.int32
        for name, value in exported.uniforms.items()
    }
    for receivers, expected in ((None, -1), (6, 6)):
        block = np.frombuffer(exported.uniform_block(receivers), np.dtype([*kinds.items(), ("rest", "V12")]))
        assert block["decal_surface_receivers"] == expected
        assert block["decal_stiffness"] == 2.5
    assert decals.shader(scene_of(PLAIN), version="450").uniform_block(6)


def test_levels_are_means_of_light() -> None:
    texture = decals.shader(scene_of(PLAIN)).textures[-1]
    levels = texture.levels()
    assert [level.shape[1:3] for level in levels] == [(64 >> i, 64 >> i) for i in range(7)]
    light = texture.linear().array.astype(np.float64)
    smallest = replace(texture, array=levels[-1]).linear().array.astype(np.float64)
    np.testing.assert_allclose(smallest[:, 0, 0], light.mean(axis=(1, 2)), atol=0.02)
    wide = replace(texture, array=np.ascontiguousarray(texture.array[:, :2]), size=(64, 2, 2))
    assert [level.shape[1:3] for level in wide.levels()][:3] == [(2, 64), (1, 32), (1, 16)]
    assert len(decals.shader(scene_of(PLAIN)).textures[0].levels()) == 1


def test_images_with_more_than_bytes_are_half_floats() -> None:
    bright = decals.DecalImage("light", np.array([[[3.0, 2.0, 1.0, 1.0]]], np.float32))
    scene = scene_of(PLAIN)
    exported = decals.shader(scene.replace(images=[bright, scene.images[1]]))
    assert (exported.textures[-1].format, exported.textures[-1].array.max()) == ("rgba16f", 3.0)


def test_a_scene_without_decals_has_none(context: Context) -> None:
    scene = scene_of(PLAIN).replace(decals=decals.Decals.empty(), images=[])
    points, normals = points_on(scene, 100)
    values = at_points(context.gl, decals.shader(scene), points, normals)
    assert (values["found"][:, 0] == -1).all()
    assert not values["color"].any()


def test_more_rows_than_a_texture_has_are_refused() -> None:
    with pytest.raises(TooMuchData, match="67,108,865 elements do not fit"):
        data_size(np.zeros((MAX_ROWS * 4096 + 1, 0), np.float32))


def test_receivers_are_those_of_evaluate(context: Context) -> None:
    scene = scene_of(Form(decals.Contact.ELASTIC, limited=True))
    exported = decals.shader(scene)
    points, normals = points_on(scene, 500)
    for on in (scene.objects[0], scene.objects[1], "lid", ["ring", "lid"], None):
        exported.uniforms["decal_surface_receivers"] = exported.receivers(on)
        found = at_points(context.gl, exported, points, normals)["found"][:, 0]
        known = decals.evaluate(scene.decals, points, normals, on=on).owner
        assert (found == known).mean() > 0.995
    with pytest.raises(InvalidScene, match="on: expected"):
        exported.receivers(3)


# -- refusals -------------------------------------------------------------------------------------------


def scene_with(feature: str) -> Any:
    """A scene that uses an unsupported feature."""
    scene = scene_of(PLAIN)
    match feature:
        case "the walked mapping":
            return scene.replace(drawing=Drawing(mapping="walked"))
        case "relief of materials":
            raised = replace(material(1), height=np.ones((64, 64), np.float32), relief=0.1)
            return scene.replace(images=[raised, scene.images[1]])
        case "the filter of decals over samples":
            return scene.replace(drawing=Drawing(filtered=True))
        case "poses":
            ring: Any = scene.objects[0]
            return decals.pose(scene, {"ring": ring.vertices * 1.1})
        case "contact laws of your own":
            return scene.replace(drawing=Drawing(contact=decals.define_contact(falling)))
    raise AssertionError(feature)


def falling(d: wp.float32) -> wp.float32:
    return (1.0 - d * d) * (1.0 - d * d)  # type: ignore[no-any-return]


@pytest.mark.parametrize("feature", [row.feature for row in UNSUPPORTED])
def test_unsupported_features_are_refused_by_name(feature: str) -> None:
    with pytest.raises(InvalidScene, match=feature):
        decals.shader(scene_with(feature))


def test_the_page_lists_all_unsupported_features() -> None:
    rows = "".join(f"| {feature} | {advice} |\n" for feature, advice, _ in UNSUPPORTED)
    table = f"<!-- unsupported -->\n| Feature | Instead |\n|---|---|\n{rows}<!-- /unsupported -->"
    assert table in PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"version": "330"}, "version: expected one of"),
        ({"version": 330}, "version: expected one of"),
        ({"stage": "geometry"}, "stage: expected one of"),
        ({"stage": "compute"}, "stage: expected one of fragment, vertex"),
        ({"contact": "soft"}, "contact: expected"),
        ({"mapping": "walked"}, "walked mapping"),
        ({"stiffness": 0}, "stiffness: expected"),
        ({"editable": 1}, "editable: expected"),
    ],
)
def test_wrong_options(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidScene, match=message):
        decals.shader(scene_of(PLAIN), **options)
    with pytest.raises(InvalidScene, match="scene: expected"):
        decals.shader(3)  # type: ignore[arg-type]


def test_options_of_the_drawing_are_overridden() -> None:
    exported = decals.shader(scene_of(PLAIN), contact="min", mapping="chord", stiffness=3)
    assert exported.form.contact is decals.Contact.MIN
    assert exported.uniforms["decal_mapping"] == 0


def test_every_stage_has_a_version() -> None:
    assert {stage for version in VERSIONS.values() for stage in version.stages} == set(STAGES)


# -- edits ----------------------------------------------------------------------------------------------


def test_uploads_make_the_textures_of_the_edited_decals() -> None:
    """Applied to old textures, in place or anew, they give those of a new shader of the editor."""
    rng = np.random.default_rng(0)
    scene = scene_of(PLAIN)
    editor = DecalEditor(scene.decals)
    exported = decals.shader(scene, editable=True)
    held = {texture.name: texture.array.copy() for texture in exported.textures}
    version = 0
    for step in range(12):
        for _ in range(rng.integers(0, 5)):
            edit(editor, rng)
        if step == 8:  # more than a row of the texture
            editor.assign(np.arange(4000) + editor.next_number, editor.decals[rng.integers(0, 20, 4000)])
        changes = exported.changes(editor, version)
        assert changes is not None
        for upload in changes.uploads:
            if held[upload.texture].shape[1::-1] != upload.size:
                held[upload.texture] = np.zeros(
                    (*upload.size[::-1], *upload.array.shape[2:]), upload.array.dtype
                )
            height, width = upload.array.shape[:2]
            held[upload.texture][upload.y : upload.y + height, upload.x : upload.x + width] = upload.array
        version = changes.version
        arrays = editor.arrays
        for name, array in (
            ("decal_records", "decal_records"),
            ("decal_index_ids", "index_ids"),
            ("decal_index_table", "index_table"),
            ("decal_limits", "decal_limits"),
        ):
            flat = held[name].reshape(-1, *arrays[array].shape[1:])
            np.testing.assert_array_equal(flat[: len(arrays[array])], arrays[array])
        assert changes.uniforms["decal_index_mask"] == len(arrays["index_table"]) - 1


def edit(editor: DecalEditor, rng: np.random.Generator) -> None:
    """Move, delete or add a decal, or give it receivers or another layer."""
    number = int(rng.choice(editor.numbers))
    match int(rng.integers(0, 5)):
        case 0:
            editor.change(number, positions=editor[number].positions + rng.normal(0, 0.1, (1, 3)))
        case 1:
            editor.delete([number])
        case 2:
            editor.add(editor[number].replace(radii=rng.uniform(0.1, 0.5, 1)))
        case 3:
            editor.change(number, layers=[int(rng.integers(0, 3))])
        case _:
            editor.change(number, receivers=["lid"], fade_angles=[60.0])


def test_a_document_is_a_scene() -> None:
    """The textures of a document keep their texels when it is edited; its edits are their changes."""
    document = Document.from_scene(scene_of(PLAIN))
    editor = document.decals
    exported, version = decals.shader(document, editable=True), editor.version
    records = exported.textures[0].array
    before = records.copy()
    editor.change(3, radii=[0.25])
    np.testing.assert_array_equal(records, before)
    changes = exported.changes(editor, version)
    assert changes is not None
    after = before.copy()
    for upload in changes.uploads:
        if upload.texture == "decal_records":
            after[upload.y, upload.x : upload.x + upload.array.shape[1]] = upload.array[0]
    assert (after != before).any()
    np.testing.assert_array_equal(after, decals.shader(document, editable=True).textures[0].array)


def test_one_moved_decal_uploads_its_own_bytes() -> None:
    scene = scene_of(PLAIN)
    editor = DecalEditor(scene.decals)
    exported = decals.shader(scene, editable=True)
    first = exported.changes(editor, 0)
    assert first is not None
    editor.change(5, radii=editor[5].radii * 0.9)
    changes = exported.changes(editor, first.version)
    assert changes is not None
    assert 0 < sum(upload.array.nbytes for upload in changes.uploads) < 3000
    nothing = exported.changes(editor, changes.version)
    assert nothing is not None
    assert nothing.uploads == ()


def test_changes_end_where_other_code_is_needed() -> None:
    scene = scene_of(PLAIN)
    for edits in ({"layers": [3]}, {"fade_angles": [50.0]}, {"radii": [3.0]}):
        editor = DecalEditor(scene.decals)
        exported = decals.shader(scene)
        assert exported.changes(editor, 0) is not None
        editor.change(2, **edits)
        assert exported.changes(editor, 0) is None
        assert decals.shader(scene, editable=True).changes(editor, 0) is not None
    with pytest.raises(InvalidScene, match="editor: expected"):
        exported.changes(scene.decals, 0)  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="since: expected"):
        exported.changes(editor, -1)


@pytest.mark.ordinary_cases("plain")
@pytest.mark.parametrize("form", [PLAIN, FULL], ids=["plain", "full"])
def test_editable_code_finds_the_same(context: Context, form: Form) -> None:
    scene = scene_of(form)
    points, normals = points_on(scene, 500)
    short, long = (
        at_points(context.gl, decals.shader(scene, editable=editable), points, normals)
        for editable in (False, True)
    )
    assert (short["found"][:, 0] == long["found"][:, 0]).mean() > 0.997
    same = short["found"][:, 0] == long["found"][:, 0]
    assert np.quantile(np.abs(short["color"] - long["color"])[same], 0.99) < 1e-4


# -- pictures -------------------------------------------------------------------------------------------


@pytest.mark.ordinary_cases("330 core")
@pytest.mark.parametrize("version", ["330 core", "300 es"])
def test_pictures_equal_those_of_render(context: Context, version: str) -> None:
    scene = scene_of(Form(decals.Contact.ELASTIC, layered=True, nested=True))
    shown = picture(context.gl, decals.shader(scene, version=version), scene, (160, 120))
    assert equal_pixels(shown, scene) >= 0.995


def test_another_shape_is_another_picture(context: Context) -> None:
    """The comparison of pictures finds a ring that is a little thicker, and other decals."""
    scene = scene_of(PLAIN)
    shown = picture(context.gl, decals.shader(scene), scene, (160, 120))
    thicker = torus(1.0, 0.46)
    other: Any = decals.MeshObject("ring", thicker.vertices, thicker.faces, (0.6, 0.5, 0.4))
    assert equal_pixels(shown, scene.replace(objects=[other])) == 0.0
    tinted = scene.replace(decals=scene.decals.replace(tints=scene.decals.tints * 0.9))
    assert equal_pixels(shown, tinted) < 0.9
