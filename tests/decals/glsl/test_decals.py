"""The decal functions as GLSL: the same numbers as through Warp, on fragments."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree.transpile.glsl import translate_library
from decals.field.contact import contact_complement, contact_push, contact_uv, rim_distance
from decals.field.mapping import tangent_coordinates, unroll
from decals.index import DecalIndex
from decals.index.lookup import cell_hash, cell_range
from decals.record import field_complement
from tests.decals.glsl.kernels import contacts, lookups, offsets
from tests.vectors import random_units, unit

AGREEMENT = 1e-5
WIDTH = 4096

VERTEX = """#version 330
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
FRAGMENT = """#version 330
uniform sampler2D a; uniform sampler2D b; uniform sampler2D c;
uniform sampler2D decal_records; const bool decal_layered = true;
uniform int index_level_count; uniform int index_mask;
uniform sampler2D index_levels; uniform isampler2D index_table; uniform isampler2D index_ids;
out vec4 result;
{functions}
void main() {{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 x = texelFetch(a, at, 0), y = texelFetch(b, at, 0), z = texelFetch(c, at, 0);
    {body}
}}
"""


@pytest.fixture
def through_glsl(context: Any) -> Callable[..., np.ndarray]:
    """Run GLSL statements over rows x, y, z (float32[n, 4] each) that set `result`."""
    gl = context.gl

    def run(functions: Any, body: Any, *rows: Any, index: Any = None) -> Any:
        source = FRAGMENT.format(functions=translate_library(functions), body=body)
        program = gl.program(vertex_shader=VERTEX, fragment_shader=source)
        count = len(rows[0])
        images = dict(zip("abc", rows, strict=False))
        if index is not None:
            images |= {
                "index_levels": index.levels,
                "index_table": index.table,
                "index_ids": index.ids[:, None],
            }
            if "index_mask" in program:
                program["index_mask"] = index.mask
        made = [program, gl.texture((WIDTH, height(count)), 4, dtype="f4")]
        for place, (name, values) in enumerate(images.items()):
            if name in program:
                made.append(texture(gl, values))
                made[-1].use(place)
                program[name] = place
        target = gl.framebuffer([made[1]])
        target.use()
        vertices = gl.vertex_array(program, [])
        vertices.render(vertices=3)
        seen = np.frombuffer(target.read(components=4, dtype="f4"), np.float32).reshape(-1, 4)[:count].copy()
        for thing in (vertices, target, *made):
            thing.release()
        return seen

    return run


def height(count: int) -> Any:
    return max(1, -(-count // WIDTH))


def texture(gl: Any, values: Any) -> Any:
    padded = np.zeros((height(len(values)) * WIDTH, values.shape[1]), values.dtype)
    padded[: len(values)] = values
    dtype = "i4" if values.dtype == np.int32 else "f4"
    made = gl.texture((WIDTH, height(len(values))), values.shape[1], padded.tobytes(), dtype=dtype)
    made.filter = (gl.NEAREST, gl.NEAREST)
    return made


def rows(*columns: Any) -> Any:
    """float32[n, 4] of up to four columns."""
    table = np.column_stack(columns).astype(np.float32)
    return np.pad(table, ((0, 0), (0, 4 - table.shape[1])))


CONTACTS = """
    float e_k = field_complement(x[0]);
    float complement = contact_complement(e_k, contact_push(field_complement(x[1]), e_k));
    vec2 uv = contact_uv(x.zw, rim_distance(complement));
    result = vec4(complement, rim_distance(complement), uv);
"""


OFFSETS = """
    vec4 m = unroll(x.xyz, y.xyz, z.xyz);
    result = vec4(tangent_coordinates(m.xyz, y.xyz, x.xyz), m.zw);
"""


def through_warp(kernel: Any, *inputs: Any) -> Any:
    result = wp.zeros(len(inputs[0]), dtype=wp.vec4, device="cpu")
    wp.launch(
        kernel,
        len(result),
        [wp.array(i, dtype=wp.vec4, device="cpu") for i in inputs] + [result],
        device="cpu",
    )
    return result.numpy()


def adversarial_contacts(rng: np.random.Generator, n: int) -> Any:
    """Squared relative distances of an owner and a neighbour: anywhere, near centre, tie and rim."""
    rim = 1 - 2 ** (-1 / 3)
    least = np.concatenate(
        [rng.uniform(0, rim, n), 10.0 ** rng.uniform(-20, -1, n), rim * (1 - 10.0 ** rng.uniform(-8, 0, n))]
    )
    ratio = np.where(rng.random(3 * n) < 0.5, 1 + 10.0 ** rng.uniform(-8, 1, 3 * n), rng.uniform(1, 9, 3 * n))
    direction = rng.normal(size=(3 * n, 2)) * 10.0 ** rng.uniform(-9, 9, (3 * n, 1))
    exact = [[0, 0, 1, 0], [0, 0.1, 0, 1], [rim, rim, 1, 1], [1e-20, 1e-20, 0, 0], [0, 1, -1, 0]]
    return np.concatenate([rows(least, least * ratio, direction), np.array(exact, np.float32)])


def test_contact(through_glsl: Any) -> None:
    x = adversarial_contacts(np.random.default_rng(0), 100_000)
    functions = [field_complement, contact_complement, contact_push, contact_uv, rim_distance]
    seen, expected = through_glsl(functions, CONTACTS, x), through_warp(contacts, x)
    worst = np.abs(seen - expected).max(axis=0)
    print("complement, rim, u, v:", worst)
    assert worst.max() <= AGREEMENT


def test_mapping(through_glsl: Any) -> None:
    rng = np.random.default_rng(1)
    n = 100_000
    n_p = random_units(rng, n)
    n_q = unit(n_p + 10.0 ** rng.uniform(-9, 1, (n, 1)) * rng.normal(size=(n, 3)))
    keep = (n_p * n_q).sum(axis=1) > -0.9  # beyond, float32 hardly tells the axis
    w = rng.uniform(-1, 1, (n, 3))
    inputs = [a[keep] for a in (rows(w), rows(n_p), rows(n_q))]
    seen = through_glsl([unroll, tangent_coordinates], OFFSETS, *inputs)
    worst = np.abs(seen - through_warp(offsets, *inputs)).max()
    print(worst)
    assert worst <= AGREEMENT


LOOKUP = """
    uint h = cell_hash(int(y.x), int(y.y), int(y.z)) & 65535u;
    result = vec4(cell_range(x.xyz, int(x.w)), h, 0.0);
"""


def test_index(through_glsl: Any) -> None:
    """The same lists and the same hash, bit for bit, far from the origin and over six decades of size."""
    rng = np.random.default_rng(2)
    positions = (rng.normal(size=(400, 3)) * 10.0 ** rng.uniform(-3, 6, (400, 1))).astype(np.float32)
    influence = (10.0 ** rng.uniform(-3, 3, 400)).astype(np.float32)
    index = DecalIndex.build(positions, influence)
    where = positions + rng.normal(size=(400, 3)) * influence[:, None] * 0.2
    cells = rng.integers(0, 2**24, (400, 3))
    every_level = [rows(where, np.full(400, level)) for level in range(index.level_count)]
    for x in every_level:
        seen = through_glsl([cell_range, cell_hash], LOOKUP, x, rows(cells), index=index)
        expected = through_warp_lookup(index, x, cells)
        assert np.array_equal(seen[:, :3], expected)


def through_warp_lookup(index: DecalIndex, x: Any, cells: Any) -> Any:
    result = wp.zeros(len(x), dtype=wp.vec3, device="cpu")
    inputs: list[Any] = [
        wp.array(x, dtype=wp.vec4, device="cpu"),
        wp.array(cells, dtype=wp.vec3i, device="cpu"),
    ]
    indexed = index.on("cpu", records=np.zeros((0, 4), np.float32), layered=True)
    wp.launch(lookups, len(x), [*inputs, indexed, result], device="cpu")
    return result.numpy()
