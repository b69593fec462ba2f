"""Arrays and images on the graphics card come back as they went."""

from typing import Any

import moderngl
import numpy as np
import pytest

from decals.errors import InvalidImage, TooMuchData
from decals.images.texels import linear_premultiplied
from decals.rendering import Context
from decals.rendering.data_texture import ROW_TEXELS, DataTexture
from decals.rendering.image_array import ImageArray, common_shape, resized
from decals.rendering.pixel_pass import supports_compute
from decals.shaders import Source, compose

SIZES = [0, 1, 4095, 4096, 4097, 1024 * 1024 + 7]

FETCH = """
uniform {kind} data;
out {result} value;
void main() {{
    int i = int(gl_FragCoord.x) + {width} * int(gl_FragCoord.y);
    value = {result}(texelFetch(data, ivec2(i & 4095, i >> 12), 0){swizzle});
}}
"""

COPY = """#version 430 core
layout(local_size_x = 1) in;
layout(std430, binding = 1) readonly buffer From {{ {kind} from[]; }};
layout(std430, binding = 5) writeonly buffer To {{ {kind} to[]; }};
void main() {{ to[gl_WorkGroupID.x] = from[gl_WorkGroupID.x]; }}
"""


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize(("kind", "row"), [(np.float32, (4,)), (np.int32, ()), (np.int32, (4,))])
def test_round_trip_is_exact(context: Context, count: int, kind: type, row: tuple[int, ...]) -> None:
    rng = np.random.default_rng(count)
    shape = (count, *row)
    array = rng.integers(-(2**31), 2**31, shape, dtype=np.int64).astype(np.int32)
    if kind is np.float32:
        array = (array * rng.random(shape)).astype(np.float32)
    texture = DataTexture(context, array)
    width, rows = texture.texture.size
    assert width == ROW_TEXELS
    assert 0 <= rows - max(1, -(-count // ROW_TEXELS)) <= 2
    assert rows & (rows - 1)  # else a software rasteriser would compile programs for it
    np.testing.assert_array_equal(texture.read(), array)
    texture.release()


@pytest.mark.parametrize(("kind", "result"), [("sampler2D", "vec4"), ("isampler2D", "int")])
def test_a_shader_reads_element_i(context: Context, kind: str, result: str) -> None:
    width, height, count = 50, 41, 2050
    array = np.arange(count, dtype=np.int32) * 3 - 5000
    if result == "vec4":
        array = np.stack([array, array + 0.25, array * 2, -array], axis=1).astype(np.float32)
    texture = DataTexture(context, array)
    swizzle = "" if result == "vec4" else ".x"
    text = FETCH.format(kind=kind, result=result, width=width, swizzle=swizzle)
    program = context.program(compose("screen.vert"), Source.named("t", "#version 330 core\n" + text))
    target = context.gl.texture(
        (width, height), 4 if swizzle == "" else 1, dtype="f4" if swizzle == "" else "i4"
    )
    framebuffer = context.gl.framebuffer([target])
    framebuffer.use()
    texture.use(0)
    context.gl.enable_only(moderngl.NOTHING)
    context.gl.vertex_array(program, []).render(vertices=3)
    read = np.frombuffer(target.read(), array.dtype).reshape(width * height, -1)
    np.testing.assert_array_equal(read, array.reshape(count, -1))


@pytest.mark.parametrize("row", [(4,), ()])
def test_storage_buffers_hold_what_was_written(context: Context, row: tuple[int, ...]) -> None:
    if not supports_compute(context.gl):
        pytest.skip("this context has no compute shaders, which alone read storage buffers")
    kind = "vec4" if row else "int"
    array = np.arange(4100 * (4 if row else 1)).reshape(4100, *row)
    array = array.astype(np.float32 if row else np.int32)
    data = DataTexture(context, array)
    data.store(1)  # before the write
    array[4090:4100] = -array[:10]
    data.write(4090, array[4090:4100])
    copy = context.gl.buffer(reserve=array.nbytes)
    copy.bind_to_storage_buffer(5)
    data.store(1)
    program = context.gl.compute_shader(COPY.format(kind=kind))
    program.run(len(array))
    context.gl.memory_barrier()
    np.testing.assert_array_equal(np.frombuffer(copy.read(), array.dtype).reshape(array.shape), array)
    for resource in (program, copy, data):
        resource.release()


@pytest.mark.parametrize("array", [np.zeros(3), np.zeros((3, 3), np.float32), np.zeros((3, 1), np.int32)])
def test_other_arrays_are_refused(context: Context, array: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"expected float32\[n, 4\], int32\[n\] or int32\[n, 4\], got"):
        DataTexture(context, array)


def test_too_many_elements_say_how_many_fit(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(context, "max_texture_size", 2)
    with pytest.raises(TooMuchData, match=r"8,193 elements do not fit .* 8,192; take fewer decals"):
        DataTexture(context, np.zeros(8193, np.int32))


def decoded(level: int) -> float:
    x = level / 255
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


def test_images_become_linear_and_premultiplied() -> None:
    image = np.array([[[255, 188, 10, 255], [200, 0, 255, 51]]], np.uint8)
    linear = linear_premultiplied(image)
    expected = [[1, decoded(188), decoded(10), 1], [decoded(200) / 5, 0, 0.2, 0.2]]
    np.testing.assert_allclose(linear[0], expected, atol=1e-6)


def test_bright_images_keep_their_light(context: Context) -> None:
    bright = np.full((4, 4, 4), 1.0, np.float32)
    bright[..., 0] = 30.0
    array = ImageArray(context, [bright, np.full((8, 8, 4), 65535, np.uint16)])
    texels = np.frombuffer(array.texture.read(), np.float16).reshape(2, 8, 8, 4)
    assert (texels[0] == [30, 1, 1, 1]).all()
    assert (texels[1] == 1).all()
    array.release()


def test_image_layers_rows_and_mip_levels(context: Context) -> None:
    images = [np.full((8, 8, 4), 255, np.uint8), np.zeros((8, 8, 4), np.uint8)]
    images[1][:4] = 255  # upper half
    array = ImageArray(context, images)
    texels = np.frombuffer(array.texture.read(), np.float16).reshape(2, 8, 8, 4)
    assert (texels[0] == 1).all()
    assert (texels[1, 4:] == 1).all()  # v up
    assert (texels[1, :4] == 0).all()
    array.release()


def test_wide_images_keep_their_width(context: Context) -> None:
    image = np.zeros((2, 4096, 4), np.uint8)
    image[:, ::2] = 255
    array = ImageArray(context, [image, np.zeros((3, 5, 4), np.uint8)])
    assert (array.height, array.width) == (4, 4096)
    texels = np.frombuffer(array.texture.read(), np.float16).reshape(2, 4, 4096, 4)
    assert (texels[0, :, ::2] == 1).all()
    assert (texels[0, :, 1::2] == 0).all()
    assert (texels[1] == 0).all()
    array.release()


def test_no_images(context: Context) -> None:
    array = ImageArray(context, [])
    assert (array.height, array.width) == (1, 1)
    assert not np.frombuffer(array.texture.read(), np.float16).any()
    array.release()


@pytest.mark.parametrize(
    "bad", [np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4, 4)), np.zeros((0, 4, 4), np.uint8)]
)
def test_bad_images(context: Context, bad: Any) -> None:
    with pytest.raises(InvalidImage, match="image 0: expected uint8, uint16 or float32 pixels"):
        ImageArray(context, [bad])


@pytest.mark.parametrize(
    ("shapes", "common"),
    [
        ([], (1, 1)),
        ([(1, 1)], (1, 1)),
        ([(100, 3)], (128, 4)),
        ([(64, 64), (65, 2)], (128, 64)),
        ([(40000, 8)], (16384, 8)),
        ([(8192, 8192)], (8192, 8192)),
        ([(2048, 2048)] * 17, (1024, 2048)),
        ([(4096, 256)] * 100, (2048, 256)),
    ],
)
def test_the_common_shape(shapes: list[tuple[int, int]], common: tuple[int, int]) -> None:
    assert common_shape(shapes, limit=16384) == common


def test_resizing_does_not_bleed_hidden_colours() -> None:
    image = np.zeros((6, 6, 4), np.uint8)
    image[..., 0] = 255  # red, hidden
    image[:, 3:] = [0, 255, 0, 255]
    wide = resized(image, (16, 16))
    assert wide.shape == (16, 16, 4)
    assert wide[wide[..., 3] > 0][:, 0].max() == 0
