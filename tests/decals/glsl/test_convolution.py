"""Formulas of convolution surfaces in GLSL, against the same text run as Python in float32."""

from typing import Any, cast

import numpy as np
import pytest

from blobtree.transpile.glsl import translate_library
from blobtree.transpile.python import plain_python, vector
from decals.rendering import Context
from decals.rendering.data_texture import ROW_TEXELS
from tests.blobtree.nodes.test_convolution import CONVOLUTION_FIELDS, random_texels
from tests.decals.glsl.functions import run_program

COUNT = 300

AGREEMENT = 6e-5
"""Largest relative difference: coordinates are up to 80 kernel radii away from a centre."""

FRAGMENT = """
uniform sampler2D tape, points;
out vec4 result;
void main() {{
    int row = int(gl_FragCoord.y) * {row_texels} + int(gl_FragCoord.x);
    vec4 at = texelFetch(points, ivec2(row & 4095, row >> 12), 0);
    result = {call};
}}
"""


@pytest.mark.parametrize("kind", range(len(CONVOLUTION_FIELDS)))
def test_convolution_surfaces_are_the_same_in_both_languages(context: Context, kind: int) -> None:
    row, rng = CONVOLUTION_FIELDS[kind], np.random.default_rng(kind)
    leaves = [random_texels(kind, rng) for _ in range(COUNT)]
    texels = np.array([texel for leaf, _, _ in leaves for texel in leaf], np.float32)
    radii = [kernel * 10.0 ** rng.uniform(-2.0, 0.2) for _, kernel, _ in leaves]
    points = np.array([[*q, radius] for (_, _, q), radius in zip(leaves, radii, strict=True)], np.float32)
    scales = np.array([[1.0, *[kernel] * 3] for _, kernel, _ in leaves])
    for function, call, scale in (
        (row.value_gradient, f"{row.value_gradient.key}(at.xyz, tape, row * {row.parameters})", scales),
        (row.bounds, f"vec4({row.bounds.key}(at.xyz, at.w, tape, row * {row.parameters}), 0.0)", None),
    ):
        plain = plain_python(cast(Any, function.func), np.float32)
        tape = [vector(*texel, precision=np.float32) for texel in texels]
        rounded = [(vector(*point[:3], precision=np.float32), point[3]) for point in points]
        if scale is not None:
            expected = np.array([plain(q, tape, i * row.parameters) for i, (q, _) in enumerate(rounded)])
        else:
            expected = np.zeros((COUNT, 4), np.float32)
            expected[:, :3] = [plain(q, r, tape, i * row.parameters) for i, (q, r) in enumerate(rounded)]
            scale = scales[:, [0, 0, 1, 1]]
        source = "#version 330 core\n" + translate_library([function])
        source += FRAGMENT.format(call=call, row_texels=ROW_TEXELS)
        seen = run_program(context, source, COUNT, {"tape": texels, "points": points}, {})
        np.testing.assert_allclose(seen * scale, expected * scale, rtol=AGREEMENT, atol=AGREEMENT)
