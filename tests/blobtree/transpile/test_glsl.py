"""Typed functions → GLSL: what is translated and how; everything else is refused by file and line."""

import re
from pathlib import Path
from typing import Any

import pytest
import warp as wp

import blobtree
from blobtree.errors import UntranslatableFunction
from blobtree.transpile.builtins import BUILTINS, RESERVED_WORDS
from blobtree.transpile.glsl import TEXTURE_WIDTH_BITS, translate_library, uniform_struct
from tests.blobtree.transpile import glsl_samples as samples

glsl_samples: Any = samples  # to mypy, whatever Warp has decorated is still a plain function

REFUSED = {
    "returns_a_tuple": ("return x, x", "it returns float, float, not float"),
    "unpacks": ("a, b = x, x", "Tuple"),
    "unpacks_too_few": ("a, b, c = two_results(x)", "2 values assigned to "),
    "unpacks_into_another_type": ("a, b = two_results(x)", "'b' changes its type to vec3"),
    "uses_a_tuple": ("return two_results(x) * 2.0", "2 values of two_results"),
    "has_a_string": ('name = "x"', r"'x' is no number"),
    "names_a_string": ("name = NAME", "NAME is no number"),
    "has_a_list": ("values = [x, x]", "List expression"),
    "names_a_list": ("return TABLE[0]", "TABLE is no number"),
    "calls_the_unknown": ("return math.sqrt(x)", "math.sqrt is not a typed function"),
    "calls_without_a_twin": ("return wp.erf(x)", "wp.erf has no equivalent in GLSL"),
    "names_the_unknown": ("return x + unheard_of", "unheard_of is not known"),
    "names_an_unknown_member": ("return x + math.phi", "math.phi is not known"),
    "chains_comparisons": ("if 0.0 < x < 1.0:", "0.0 < x < 1.0 joins comparisons; join them with `and`"),
    "asks_for_identity": ("if x is None:", "Compare expression"),
    "uses_keywords": ("return wp.max(a=x, b=1.0)", "keyword arguments"),
    "changes_a_type": ("y = x", "'y' changes its type from int to float"),
    "multiplies_vectors": ("return v * v", "Mult of vec3 and vec3"),
    "divides_vectors": ("return v / v", "Div of vec3 and vec3"),
    "mixes_int_and_float": ("return x + n", "float and int do not mix"),
    "mixes_vectors": ("return v + w", "vec3 and vec2 do not mix"),
    "raises_to_a_power": ("return x**2.0", "Pow of float and float"),
    "divides_whole": ("return n // 2", "FloorDiv of int and int"),
    "loops_over_a_list": ("for y in TABLE:", "For statement"),
    "asserts": ("assert x > 0.0", "Assert statement"),
    "has_a_lambda": ("f = lambda y: y", "Lambda expression"),
    "chains_assignments": ("a = b = x", "Assign statement"),
    "indexes_a_scalar": ("return x[0]", "float has no elements"),
    "lacks_a_type": ("def lacks_a_type", "a parameter lacks its type"),
    "takes_a_matrix": ("def takes_a_matrix", "parameter 'm' has no type that GLSL knows"),
    "takes_a_strange_array": ("def takes_a_strange_array", "parameter 'm' has no type that GLSL knows"),
    "lacks_a_return_type": ("def lacks_a_return_type", "does not say what it returns"),
    "calls_what_lacks_a_return_type": ("return lacks_a_return_type(x)", "does not say what it returns"),
    "has_a_loop_with_an_else": ("while x > 1.0:", "While statement"),
    "inverts_bits": ("return ~n", "UnaryOp expression"),
    "declares_only": ("y: wp.float32", "AnnAssign statement"),
    "returns_another_type": ("return n", "it returns int, not float"),
    "chooses_between_types": ("y = x if n > 0 else n", "float and int do not mix"),
    "passes_the_wrong_type": ("return doubled(n)", "doubled takes float, got int"),
    "takes_an_unknown_struct": ("def takes_an_unknown_struct", "parameter 's' has no type that GLSL knows"),
    "reads_an_unknown_field": ("return index.length", "index.length is not known; fields are table, mask"),
    "assigns_a_struct": ("other = index", "struct 'index' as a value; read one of its fields"),
    "assigns_a_field": ("index.mask = 1", "assignment to index.mask, which is read-only"),
    "assigns_an_element": ("index.table[0] =", r"assignment to index.table\[0\], which is read-only"),
    "assigns_an_element_of_an_array": ("ids[0] = 1", r"assignment to ids\[0\], which is read-only"),
    "passes_another_struct": ("return from_uniforms", "other is not the struct of uniforms expected"),
    "passes_a_number_for_a_struct": ("return from_uniforms", "x is not the struct of uniforms expected"),
    "passes_a_struct_for_a_number": ("return doubled(index)", "struct 'index' as a value"),
    "passes_too_few": ("return entry_of", "entry_of takes int, float, got int"),
}


def line_of(name: str, code: str) -> int:
    """Line of `code` in the function `name` of the glsl_samples."""
    lines = Path(glsl_samples.__file__).read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"def {name}("))
    return next(i + 1 for i in range(start, len(lines)) if lines[i].strip().startswith(code))


@pytest.mark.parametrize("name", REFUSED)
def test_code_outside_the_subset_is_refused_with_file_and_line(name: str) -> None:
    code, reason = REFUSED[name]
    with pytest.raises(UntranslatableFunction) as refusal:
        translate_library([getattr(glsl_samples, name)])
    message = str(refusal.value)
    assert message.startswith(f"{glsl_samples.__file__}:{line_of(name, code)}: ")
    assert re.search(reason, message), message
    assert message.endswith("use what the guide 'Custom nodes' lists under 'Language of typed functions'")


def test_each_sample_is_accepted_or_refused() -> None:
    accepted = {"doubled", "quadrupled", "texel", "entry", "slot", "reserved", "everything"}
    accepted |= {"from_uniforms", "entry_of", "two_results", "uses_two_results"}
    samples = {name for name, value in vars(glsl_samples).items() if isinstance(value, wp.Function)}
    assert samples == accepted | set(REFUSED)


def test_several_results_are_out_parameters() -> None:
    text = translate_library([glsl_samples.uses_two_results])
    assert "void two_results(float x, out float returned_0, out vec3 returned_1) {" in text
    assert "    returned_0 = (x * 2.0);\n    returned_1 = vec3(x);\n    return;" in text
    assert "    two_results(x, a, v);" in text


def test_callees_come_first_and_once() -> None:
    text = translate_library([glsl_samples.quadrupled, glsl_samples.doubled])
    assert text.count("float doubled(float x) {") == 1
    assert text.index("float doubled(") < text.index("float quadrupled(")
    assert "return doubled(doubled(x));" in text


def test_provided_functions_are_only_declared() -> None:
    text = translate_library([glsl_samples.quadrupled], provided=[glsl_samples.doubled])
    assert "float doubled(float x);" in text
    assert "float doubled(float x) {" not in text


def test_arrays_become_textures_of_4096_texels_a_row() -> None:
    assert TEXTURE_WIDTH_BITS == 12
    text = translate_library([glsl_samples.texel, glsl_samples.entry, glsl_samples.slot])
    assert "vec4 texel(sampler2D data, int i) {" in text
    assert "texelFetch(data, ivec2((i + 1) & 4095, (i + 1) >> 12), 0);" in text
    assert "int entry(isampler2D ids, int i) {" in text
    assert "texelFetch(ids, ivec2((2 * i) & 4095, (2 * i) >> 12), 0).x;" in text
    assert "#define ivec4_sampler isampler2D\n" in text
    assert "int slot(ivec4_sampler table, int i) {" in text
    assert "key = texelFetch(table, ivec2(i & 4095, i >> 12), 0);" in text


def test_structs_become_uniforms() -> None:
    text = translate_library([glsl_samples.from_uniforms])
    assert "int entry_of(int i, float x) {" in text
    assert "int from_uniforms(int i) {" in text
    assert "texelFetch(index_table, ivec2((i & index_mask) & 4095, (i & index_mask) >> 12), 0)[3]" in text
    assert "entry_of((i + 1), 2.0)" in text


def test_a_struct_names_a_uniform_for_each_field_of_a_known_type() -> None:
    with pytest.raises(UntranslatableFunction, match="Pair: expected a uniform for each of the fields a, b"):

        @uniform_struct(a="pair_a")
        class Pair:
            a: wp.float32
            b: wp.float32

    with pytest.raises(UntranslatableFunction, match="Matrix: field 'm' has no type that GLSL knows"):

        @uniform_struct(m="matrix")
        class Matrix:
            m: wp.mat33


def test_reserved_words_are_renamed() -> None:
    text = translate_library([glsl_samples.reserved])
    assert "float reserved(float sample_, vec3 input_) {" in text
    for name in ("filter", "half"):
        assert f"    float {name}_;" in text
        assert not re.search(rf"\b{name}\b", text)
    assert {"sample", "filter", "input", "texture", "smooth", "flat", "half"} <= RESERVED_WORDS


def test_the_whole_subset() -> None:
    text = translate_library([glsl_samples.everything])
    for piece in (
        "float everything(float x, int n, vec3 v) {",
        "for (i = 0; i < n; i += 1) {",
        "for (j = n; j > 0; j += (-1)) {",
        "if ((i == 3)) {",
        "((i > 7) && (!((x < 0.0) || (x > 9.0))))",
        "while ((total > 100.0)) {",
        "total = (total + (max(x, 2.5) * float(i)));",
        "((j > 2) ? 0.25 : 0.5)",
        "(v * vec3(1.0, 2.0, 3.0))",
        "wp_normalize(v)",
        "w[2] = total;",
        "((uint(n) * 7u) >> uint(1))",
        "(x - 0.75 * trunc(x / 0.75))",
        "3.141592653589793",
        "continue;",
        "break;",
    ):
        assert piece in text, text


def test_built_in_functions_exist_in_warp_and_the_error_is_public() -> None:
    for name in BUILTINS:
        assert hasattr(wp, name), name
    assert blobtree.errors.UntranslatableFunction is UntranslatableFunction
