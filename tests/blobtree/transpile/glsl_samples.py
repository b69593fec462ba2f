"""Functions for the translator to GLSL: some in its subset, the others each one step outside of it.

They are only translated: no test runs them.
"""

# mypy: disable-error-code="attr-defined, call-arg, call-overload, name-defined"
# mypy: disable-error-code="misc, no-untyped-call, no-untyped-def"
# ruff: noqa: A001, A002, E731, F821, F841, F842, RET504, RET507, RUF059
# (kernel code is Python only in form: its names have Warp types)

import math

import warp as wp

from blobtree.transpile.glsl import uniform_struct

wp.set_module_options({"enable_backward": False})

SCALE = 2.5
COUNT = 3
NAME = "a name"
TABLE = [1.0, 2.0]
TINT = wp.constant(wp.uint32(7))


@uniform_struct(table="index_table", mask="index_mask")
class Index:
    """Struct whose fields are uniforms."""

    table: wp.array(dtype=wp.vec4i)
    mask: wp.int32


@uniform_struct(x="other_x")
class Other:
    """Another such struct."""

    x: wp.float32


@wp.struct
class Unknown:
    """Struct without uniforms."""

    x: wp.float32


# -- in the subset --------------------------------------------------------------------------------------


@wp.func
def from_uniforms(i: wp.int32, index: Index) -> wp.int32:
    return index.table[i & index.mask][3] + entry_of(i + 1, index, 2.0)


@wp.func
def entry_of(i: wp.int32, index: Index, x: wp.float32) -> wp.int32:
    return index.table[i][0] * int(x)


@wp.func
def doubled(x: wp.float32) -> wp.float32:
    """A docstring is no statement."""
    return 2.0 * x


@wp.func
def quadrupled(x: wp.float32) -> wp.float32:
    return doubled(doubled(x))


@wp.func
def texel(data: wp.array(dtype=wp.vec4), i: wp.int32) -> wp.vec4:
    return data[i + 1]


@wp.func
def entry(ids: wp.array(dtype=wp.int32), i: wp.int32) -> wp.int32:
    return ids[2 * i]


@wp.func
def slot(table: wp.array(dtype=wp.vec4i), i: wp.int32) -> wp.int32:
    key = table[i]
    return key[3] + table[i + 1][0]


@wp.func
def reserved(sample: wp.float32, input: wp.vec3) -> wp.float32:
    filter = sample * 2.0
    half = filter + input[1]
    return half


@wp.func
def everything(x: wp.float32, n: wp.int32, v: wp.vec3) -> wp.float32:
    total = float(0.0)
    for i in range(n):
        if i == COUNT:
            continue
        elif i > 7 and not (x < 0.0 or x > 9.0):
            break
        else:
            total += wp.max(x, SCALE) * float(i)
    while total > 100.0:
        total = total * 0.5
    for j in range(n, 0, -1):
        total -= 0.25 if j > 2 else 0.5
    w = v / 2.0 + wp.cw_mul(v, wp.vec3(1.0, 2.0, 3.0)) - wp.normalize(v)
    w[2] = total
    bits = (wp.uint32(n) * TINT) >> wp.uint32(1)
    return wp.dot(w, v) + w.y + x % 0.75 + float(int(bits) & 3) - math.pi


# -- outside of it --------------------------------------------------------------------------------------


@wp.func
def returns_a_tuple(x: wp.float32) -> wp.float32:
    return x, x


@wp.func
def two_results(x: wp.float32) -> tuple[wp.float32, wp.vec3]:
    return x * 2.0, wp.vec3(x)


@wp.func
def uses_two_results(x: wp.float32) -> wp.float32:
    a, v = two_results(x)
    return a + v[1]


@wp.func
def unpacks_too_few(x: wp.float32) -> wp.float32:
    a, b, c = two_results(x)
    return a


@wp.func
def unpacks_into_another_type(x: wp.float32) -> wp.float32:
    b = 1.0
    a, b = two_results(x)
    return a


@wp.func
def uses_a_tuple(x: wp.float32) -> wp.float32:
    return two_results(x) * 2.0


@wp.func
def unpacks(x: wp.float32) -> wp.float32:
    a, b = x, x
    return a + b


@wp.func
def has_a_string(x: wp.float32) -> wp.float32:
    name = "x"
    return x


@wp.func
def names_a_string(x: wp.float32) -> wp.float32:
    name = NAME
    return x


@wp.func
def has_a_list(x: wp.float32) -> wp.float32:
    values = [x, x]
    return x


@wp.func
def names_a_list(x: wp.float32) -> wp.float32:
    return TABLE[0]


@wp.func
def calls_the_unknown(x: wp.float32) -> wp.float32:
    return math.sqrt(x)


@wp.func
def calls_without_a_twin(x: wp.float32) -> wp.float32:
    return wp.erf(x)


@wp.func
def names_the_unknown(x: wp.float32) -> wp.float32:
    return x + unheard_of


@wp.func
def names_an_unknown_member(x: wp.float32) -> wp.float32:
    return x + math.phi


@wp.func
def chains_comparisons(x: wp.float32) -> wp.float32:
    if 0.0 < x < 1.0:
        return x
    return 0.0


@wp.func
def asks_for_identity(x: wp.float32) -> wp.float32:
    if x is None:
        return 0.0
    return x


@wp.func
def uses_keywords(x: wp.float32) -> wp.float32:
    return wp.max(a=x, b=1.0)


@wp.func
def changes_a_type(x: wp.float32) -> wp.float32:
    y = 1
    y = x
    return y


@wp.func
def multiplies_vectors(v: wp.vec3) -> wp.vec3:
    return v * v


@wp.func
def divides_vectors(v: wp.vec3) -> wp.vec3:
    return v / v


@wp.func
def mixes_int_and_float(x: wp.float32, n: wp.int32) -> wp.float32:
    return x + n


@wp.func
def mixes_vectors(v: wp.vec3, w: wp.vec2) -> wp.vec3:
    return v + w


@wp.func
def raises_to_a_power(x: wp.float32) -> wp.float32:
    return x**2.0


@wp.func
def divides_whole(n: wp.int32) -> wp.int32:
    return n // 2


@wp.func
def loops_over_a_list(x: wp.float32) -> wp.float32:
    total = float(0.0)
    for y in TABLE:
        total += y
    return total


@wp.func
def asserts(x: wp.float32) -> wp.float32:
    assert x > 0.0
    return x


@wp.func
def has_a_lambda(x: wp.float32) -> wp.float32:
    f = lambda y: y
    return f(x)


@wp.func
def chains_assignments(x: wp.float32) -> wp.float32:
    a = b = x
    return a + b


@wp.func
def indexes_a_scalar(x: wp.float32) -> wp.float32:
    return x[0]


@wp.func
def lacks_a_type(x) -> wp.float32:
    return x


@wp.func
def takes_a_matrix(m: wp.mat33) -> wp.float32:
    return 1.0


@wp.func
def takes_a_strange_array(m: wp.array(dtype=wp.float64)) -> wp.float32:
    return 1.0


@wp.func
def takes_an_unknown_struct(s: Unknown) -> wp.float32:
    return s.x


@wp.func
def reads_an_unknown_field(index: Index) -> wp.int32:
    return index.length


@wp.func
def assigns_a_struct(index: Index) -> wp.int32:
    other = index
    return other.mask


@wp.func
def assigns_a_field(index: Index) -> wp.int32:
    index.mask = 1
    return index.mask


@wp.func
def assigns_an_element(index: Index) -> wp.int32:
    index.table[0] = wp.vec4i(1, 2, 3, 4)
    return index.mask


@wp.func
def assigns_an_element_of_an_array(ids: wp.array(dtype=wp.int32)) -> wp.int32:
    ids[0] = 1
    return 0


@wp.func
def passes_another_struct(other: Other) -> wp.int32:
    return from_uniforms(1, other)


@wp.func
def passes_a_number_for_a_struct(x: wp.float32) -> wp.int32:
    return from_uniforms(1, x)


@wp.func
def passes_a_struct_for_a_number(index: Index) -> wp.float32:
    return doubled(index)


@wp.func
def passes_too_few(index: Index) -> wp.int32:
    return entry_of(1, index)


@wp.func
def lacks_a_return_type(x: wp.float32):
    return x


@wp.func
def calls_what_lacks_a_return_type(x: wp.float32) -> wp.float32:
    return lacks_a_return_type(x)


@wp.func
def has_a_loop_with_an_else(x: wp.float32) -> wp.float32:
    while x > 1.0:
        x = x * 0.5
    else:
        x = 0.0
    return x


@wp.func
def inverts_bits(n: wp.int32) -> wp.int32:
    return ~n


@wp.func
def declares_only(x: wp.float32) -> wp.float32:
    y: wp.float32
    return x


@wp.func
def returns_another_type(x: wp.float32, n: wp.int32) -> wp.float32:
    return n


@wp.func
def chooses_between_types(x: wp.float32, n: wp.int32) -> wp.float32:
    y = x if n > 0 else n
    return y


@wp.func
def passes_the_wrong_type(n: wp.int32) -> wp.float32:
    return doubled(n)
