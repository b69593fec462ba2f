from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image

import decals
from blobtree._typing import Float64Array
from decals import load_image
from decals.errors import InvalidImage, InvalidScene
from decals.images import (
    BUILTIN_IMAGES,
    MAX_IMAGE_EDGE,
    builtin,
    canvas,
    generate_image,
    image_pixels,
    read_image,
)
from decals.images import load as load_module
from decals.images.load import each_image, embedded_image, is_embedded
from decals.images.texels import as_bytes, linear_premultiplied

FULL = ("rock", "scale", "tile")
CUT_OUT = ("eye", "rivet")


def _rho(size: int) -> NDArray[np.float64]:
    ticks = (np.arange(size) + 0.5) * 2 / size - 1
    return np.hypot(*np.meshgrid(ticks, ticks))


def test_the_names_are_the_six() -> None:
    assert BUILTIN_IMAGES == ("eye", "rivet", "rock", "scale", "spatter", "tile")


@pytest.mark.slow_cases("256-rock", "256-spatter", "256-tile", "256-eye", "256-rivet", "256-scale")
@pytest.mark.parametrize("name", BUILTIN_IMAGES)
@pytest.mark.parametrize("size", [1, 33, 256])
def test_any_size_is_rgba_and_repeats(name: str, size: int) -> None:
    image = generate_image(name, size)
    assert image.shape == (size, size, 4)
    assert image.dtype == np.uint8
    builtin._drawn.cache_clear()
    assert np.array_equal(image, generate_image(name, size))


@pytest.mark.parametrize("name", BUILTIN_IMAGES)
def test_images_drawn_in_bands_are_those_drawn_at_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canvas, "WORK_SIZE", 99)
    images = []
    for samples in (1, 5000, 1 << 20):  # bands of one row, of many, and all rows at once
        monkeypatch.setattr(canvas, "BAND_SAMPLES", samples)
        builtin._drawn.cache_clear()
        images.append(generate_image(name, 33))
    builtin._drawn.cache_clear()
    assert np.array_equal(images[0], images[2])
    assert np.array_equal(images[1], images[2])


@pytest.mark.parametrize("name", FULL)
def test_contact_ring_is_dark_opaque_and_reaches_the_corners(name: str) -> None:
    image, rho = generate_image(name, 256), _rho(256)
    assert (image[..., 3] == 255).all()
    assert image[rho > 0.97, :3].max() < 24
    assert image[rho < 0.85, :3].mean() > 70
    # The ring is a few percent wide, no more: colour comes back soon behind it.
    assert image[(rho > 0.90) & (rho < 0.91), :3].mean() > 40


@pytest.mark.parametrize("name", CUT_OUT)
def test_cut_outs_have_a_smooth_edge_inside_the_rim(name: str) -> None:
    alpha, rho = generate_image(name, 256)[..., 3], _rho(256)
    assert (alpha[rho < 0.8] == 255).all()
    assert (alpha[rho > 0.97] == 0).all()
    soft = (alpha > 0) & (alpha < 255)
    assert soft.any()
    assert np.ptp(rho[soft]) < 6 / 256


def test_a_spatter_is_one_colour_within_its_rim() -> None:
    image, rho = generate_image("spatter", 256).astype(int), _rho(256)
    opaque = image[..., 3] == 255
    assert (image[..., 3][rho > 0.99] == 0).all()
    assert 0.15 < opaque.mean() < 0.6
    assert opaque[rho < 0.2].all()
    assert (image[opaque, 0] > image[opaque, 1]).all()


@pytest.mark.parametrize("name", CUT_OUT)
def test_transparent_pixels_carry_the_edge_colour(name: str) -> None:
    """Straight alpha must hold no foreign colour behind the edge, or filters would show a fringe."""
    image = generate_image(name, 128).astype(int)
    edge = (image[..., 3] > 0) & (image[..., 3] < 128)
    inner = (image[..., 3] == 255) & (_rho(128) > 0.84)
    assert np.abs(image[edge, :3].mean(axis=0) - image[inner, :3].mean(axis=0)).max() < 60


def test_the_scale_is_alike_on_both_sides_of_its_keel_and_points_along_u() -> None:
    image = generate_image("scale", 200)[..., :3].astype(float)
    assert np.abs(image - image[::-1]).mean() < 6
    root, tip = image[60:140, 30:70], image[60:140, 130:170]
    assert tip.mean() > 1.3 * root.mean()


def test_the_ring_looks_the_same_from_every_side() -> None:
    for name in FULL:
        image = generate_image(name, 64).astype(int)
        ring = (_rho(64) > 0.95)[..., None]
        assert np.abs((image - np.rot90(image)) * ring).max() <= 8


def test_small_image_is_the_large_one_averaged() -> None:
    large = generate_image("tile", 512)[..., :3].astype(float)
    small = generate_image("tile", 128)[..., :3].astype(float)
    assert np.abs(large.reshape(128, 4, 128, 4, 3).mean(axis=(1, 3)) - small).mean() < 1.5


def test_a_colour_tints() -> None:
    red, blue = generate_image("scale#c03020", 64), generate_image("scale#2030c0", 64)
    assert red[..., 0].mean() > 1.5 * red[..., 2].mean()
    assert blue[..., 2].mean() > 1.5 * blue[..., 0].mean()


@pytest.mark.parametrize("reference", ["", "scales", "scale#", "scale#12345", "SCALE", "scale#12345g"])
def test_unknown_names_say_what_there_is(reference: str) -> None:
    with pytest.raises(InvalidImage, match=r"eye, rivet, rock, scale, spatter, tile"):
        generate_image(reference)


@pytest.mark.parametrize("color", ["red", "12345", "1234567", "ggbb00", "", "b0413e "])
def test_a_wrong_colour_of_a_generated_image_is_named(color: str) -> None:
    for make in (load_image, generate_image):
        with pytest.raises(
            InvalidImage, match=r"colour of six hexadecimal digits.*'tile#b0413e', got 'tile#"
        ):
            make(f"tile#{color}")


def test_a_file_may_be_named_like_an_image_with_a_wrong_colour(tmp_path: Path) -> None:
    Image.new("RGB", (2, 3)).save(tmp_path / "tile#1", format="PNG")
    assert load_image("tile#1", folder=tmp_path).shape == (3, 2, 4)


@pytest.mark.parametrize("size", [0, -1, 5000, 2.5, "64", None, True])
def test_absurd_sizes_are_refused(size: Any) -> None:
    with pytest.raises(InvalidImage, match="1 to 4096"):
        generate_image("tile", size)


@pytest.mark.parametrize("name", [b"scale", 3, None, ["tile"]])
def test_names_that_are_no_texts_are_refused(name: Any) -> None:
    with pytest.raises(InvalidImage, match=r"image: expected a str, got .*; such as 'eye'"):
        generate_image(name)


def test_generated_pixels_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        generate_image("tile", 8)[0, 0, 0] = 1


def _save(path: Path, array: NDArray[np.generic], mode: str | None = None) -> Path:
    picture = Image.fromarray(array)
    (picture.convert(mode) if mode else picture).save(path)
    return path


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA"])
def test_every_mode_becomes_rgba(tmp_path: Path, mode: str) -> None:
    grey = np.zeros((3, 5), np.uint8)
    grey[1, 2] = 255
    pixels = read_image(_save(tmp_path / "a.png", grey, mode))
    assert pixels.shape == (3, 5, 4)
    assert pixels.dtype == np.uint8
    assert (pixels[..., 3] == 255).all()
    assert pixels[1, 2, :3].tolist() == [255, 255, 255]
    assert pixels[0, 0, :3].tolist() == [0, 0, 0]


def test_alpha_survives(tmp_path: Path) -> None:
    array = np.dstack([np.full((4, 4), level, np.uint8) for level in (10, 20, 30, 77)])
    assert np.array_equal(read_image(_save(tmp_path / "a.png", array)), array)


def test_palette_with_a_transparent_entry(tmp_path: Path) -> None:
    picture = Image.fromarray(np.array([[0, 1]], np.uint8), mode=None).convert("P")
    picture.save(tmp_path / "a.png", transparency=0)
    assert read_image(tmp_path / "a.png")[0, :, 3].tolist() == [0, 255]


def test_sixteen_bits_are_scaled_not_clipped(tmp_path: Path) -> None:
    array = np.array([[0, 257, 32896, 65535]], np.uint16)
    pixels = read_image(_save(tmp_path / "a.png", array))
    assert pixels[0, :, 0].tolist() == array[0].tolist()
    assert as_bytes(pixels)[0, :, 0].tolist() == [0, 1, 128, 255]


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_sixteen_bits_of_colours_survive(tmp_path: Path, channels: int) -> None:
    values = np.random.default_rng(1).integers(0, 65536, (4, 6, channels)).astype(np.uint16)
    image: Any = pv.ImageData(dimensions=(6, 4, 1))
    image.point_data["colors"] = values[::-1].reshape(-1, channels)
    image.set_active_scalars("colors")
    image.save(tmp_path / "a.png")
    pixels = read_image(tmp_path / "a.png")
    assert pixels.dtype == np.uint16
    expected = np.broadcast_to(values[..., :1], (4, 6, 3)) if channels == 2 else values[..., :3]
    np.testing.assert_array_equal(pixels[..., :3], expected)
    np.testing.assert_array_equal(pixels[..., 3], 65535 if channels == 3 else values[..., -1])


def radiance_file(light: Float64Array, *, runs: bool) -> bytes:
    """A Radiance picture of positive light ``[h, w, 3]``."""
    height, width = light.shape[:2]
    exponent = np.ceil(np.log2(light.max(axis=-1, keepdims=True) * 256 / 255))
    mantissa = np.rint(light * 2.0 ** (8 - exponent))
    texels = np.concatenate([mantissa, exponent + 128], axis=-1).astype(np.uint8)
    rows = texels.tobytes()
    if runs:
        rows = b""
        for row in texels:
            rows += bytes((2, 2, width >> 8, width & 255))
            for channel in row.T.tolist():
                start, count = channel[0], width - 3  # one run, then three numbers
                assert channel[:count] == [start] * count
                rows += bytes((128 + count, start, 3, *channel[count:]))
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + rows


@pytest.mark.parametrize("runs", [False, True])
def test_radiance_files_are_linear_light(tmp_path: Path, runs: bool) -> None:
    light = np.ones((3, 20, 3)) * [[[40.0]], [[0.002]], [[900.0]]] * [1.0, 0.5, 0.3]
    light[:, -2:] *= 0.25
    path = tmp_path / "sky.hdr"
    path.write_bytes(radiance_file(light, runs=runs))
    image = decals.DecalImage.load(path)
    assert image.pixels.dtype == np.float32
    np.testing.assert_allclose(image.pixels[..., :3], light, rtol=0.02)
    assert (image.pixels[..., 3] == 1).all()


@pytest.mark.parametrize("size", [b"-Y 2 +X 99999", b"+Y 2 +X 9", b"-Y 0 +X 9", b"-Y 4 +X 9", b""])
@pytest.mark.parametrize("runs", [False, True])
def test_damaged_radiance_files(tmp_path: Path, size: bytes, runs: bool) -> None:
    content = radiance_file(np.full((2, 9, 3), 0.5), runs=runs)
    path = tmp_path / "sky.hdr"
    path.write_bytes(content.replace(b"-Y 2 +X 9", size))
    with pytest.raises(InvalidImage, match=r"sky\.hdr"):
        read_image(path)
    path.write_bytes(content[:-3])
    with pytest.raises(InvalidImage, match="cut off"):
        read_image(path)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
def test_pixels_within_a_file_are_kept(kind: str) -> None:
    pixels = np.random.default_rng(3).integers(0, 256, (3, 5, 4)).astype(kind)
    if kind == "float32":
        pixels[..., :3] *= np.float32(11.3)
        pixels[..., 3] /= 256
    text = embedded_image(pixels)
    assert is_embedded(text)
    found = load_image(text)
    assert found.dtype == kind
    np.testing.assert_array_equal(found, pixels)


def test_bright_and_fine_pixels_become_linear_light() -> None:
    fine = np.array([[[65535, 32896, 300, 65535]]], np.uint16)
    bright = np.array([[[20.0, 1.0, 0.25, 0.5]]], np.float32)
    linear = [linear_premultiplied(image)[0, 0] for image in (fine, bright)]
    expected = [1.0, ((32896 / 65535 + 0.055) / 1.055) ** 2.4, 300 / 65535 / 12.92, 1.0]
    np.testing.assert_allclose(linear[0], expected, rtol=1e-5)
    assert linear[1].tolist() == [10.0, 0.5, 0.125, 0.5]
    assert as_bytes(bright)[0, 0].tolist() == [255, 255, 137, 128]


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf, 1e5])
def test_impossible_light_is_refused(value: float) -> None:
    pixels = np.ones((2, 2, 4), np.float32)
    pixels[0, 1, 2] = value
    with pytest.raises(InvalidScene, match=r"expected linear light from 0 to 65504"):
        decals.DecalImage("lamp", pixels)


def test_floats_of_arrays_are_srgb_or_linear_light() -> None:
    rows = [[[0.5, 0.25, 1.0, 0.5], [0.0, 0.0, 0.0, 1.0]]]
    assert image_pixels(rows)[0, 0].tolist() == [128, 64, 255, 128]  # type: ignore[arg-type]
    light = image_pixels(np.array(rows) * 70000, linear=True)
    assert light.dtype == np.float32
    assert light[0].tolist() == [[35000.0, 17500.0, 65504.0, 1.0], [0.0, 0.0, 0.0, 1.0]]
    assert image_pixels(np.array([[3.0]]), linear=True).tolist() == [[[3.0, 3.0, 3.0, 1.0]]]
    assert image_pixels(np.array([[51]], np.uint8), linear=True).tolist() == [[[51, 51, 51, 255]]]
    with pytest.raises(InvalidImage, match="got -1 in row 0, column 1; replace"):
        image_pixels(np.array([[0.0, -1.0]]), linear=True)


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize(
    ("rows", "got"),
    [([["a", "b"]], "got <U1; scale it"), ([[1, None]], "got object; "), ([[3, -1]], "int64 from -1 to 3; ")],
)
def test_values_of_other_types_are_refused(rows: Any, got: str, linear: bool) -> None:
    kinds = "16-bit levels or floats of linear light" if linear else "or floats from 0 to 1"
    with pytest.raises(InvalidImage, match=f"expected bytes, {kinds}, .*{got}"):
        image_pixels(np.array(rows), linear=linear)


def test_the_end_of_messages_about_files_is_an_argument(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no picture")
    for name, says in (("none.png", "found no file"), ("text.png", "is not a picture")):
        with pytest.raises(InvalidImage, match=f"{says}.*; draw one$"):
            read_image(tmp_path / name, advice="draw one")


def test_float_picture(tmp_path: Path) -> None:
    array = np.array([[0.0, 0.5, np.nan, 1.0]], np.float32)
    assert read_image(_save(tmp_path / "a.tiff", array))[0, :, 0].tolist() == [0, 128, 0, 255]


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InvalidImage, match="found no file"):
        load_image(str(tmp_path / "nowhere.png"))


def test_relative_to_a_folder(tmp_path: Path) -> None:
    _save(tmp_path / "a.png", np.zeros((2, 2), np.uint8))
    assert load_image("a.png", folder=tmp_path).shape == (2, 2, 4)


@pytest.mark.parametrize("content", [b"", b"not a picture at all", b"\x89PNG\r\n\x1a\n"])
def test_no_picture(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(content)
    with pytest.raises(InvalidImage, match=r"a\.png"):
        read_image(path)


def test_truncated_picture(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    path = _save(tmp_path / "a.png", noise)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InvalidImage, match=r"could not read .*; it is damaged"):
        read_image(path)


def test_a_damaged_picture_is_one_error_without_log(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = _save(tmp_path / "a.tif", np.zeros((4, 4, 3), np.uint8))
    samples_per_pixel = bytes((0x15, 1, 3, 0, 1, 0, 0, 0))
    content = path.read_bytes()
    assert samples_per_pixel + b"\3\0" in content
    path.write_bytes(content.replace(samples_per_pixel + b"\3\0", samples_per_pixel + b"\3\x7f"))
    with pytest.raises(InvalidImage, match=r"a\.tif"):
        read_image(path)
    assert not caplog.records


@pytest.mark.parametrize("size", [(MAX_IMAGE_EDGE + 1, 1), (8200, 8200)])
def test_too_large(tmp_path: Path, size: tuple[int, int]) -> None:
    path = tmp_path / "a.png"
    Image.new("1", size).save(path)
    with pytest.raises(InvalidImage, match="scale it"):
        read_image(path)


@pytest.mark.parametrize("size", [(MAX_IMAGE_EDGE + 1, 1), (8200, 8200)])
def test_too_large_radiance_files_are_refused_by_their_header(tmp_path: Path, size: tuple[int, int]) -> None:
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % size)
    with pytest.raises(InvalidImage, match=r"a side and 67,108,864 together, .*sky\.hdr' has .*: scale it"):
        read_image(path)


def test_radiance_exponents_are_exact(tmp_path: Path) -> None:
    """Of any size, in files of plain pixels; light beyond the limit counts as that much."""
    exponents = np.arange(256)
    texels = np.column_stack([np.full(256, 1), np.full(256, 3), np.full(256, 255), exponents])
    path = tmp_path / "sky.hdr"
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 4\n"
    path.write_bytes(header + texels.astype(np.uint8).tobytes())
    light = np.where(exponents[:, None] > 0, texels[:, :3] * 2.0 ** (exponents[:, None] - 136), 0.0)
    want = np.column_stack([np.minimum(light, 65504.0), np.ones(256)])
    np.testing.assert_array_equal(read_image(path).reshape(-1, 4), want)


def test_messages_say_an_before_a_vowel() -> None:
    with pytest.raises(InvalidImage, match="got an ellipsis"):
        each_image(...)


def test_a_folder_is_no_image(tmp_path: Path) -> None:
    with pytest.raises(InvalidImage, match="is a folder"):
        read_image(tmp_path)


BYTES = np.random.default_rng(4).integers(0, 256, (6, 5, 3), np.uint8)
ODD_ARRAYS = {
    "a mask": (BYTES[..., 0] > 127, np.where(BYTES[..., :1] > 127, 255, 0).repeat(3, axis=2)),
    "truth in channels": (BYTES > 127, np.where(BYTES > 127, 255, 0)),
    "a list of truth": (
        (BYTES[..., 0] > 127).tolist(),
        np.where(BYTES[..., :1] > 127, 255, 0).repeat(3, axis=2),
    ),
    "big-endian 16 bits": (BYTES.astype(">u2") * 257, BYTES.astype(np.uint16) * 257),
    "big-endian floats": ((BYTES / 255.0).astype(">f4"), BYTES),
    "half floats": ((BYTES / 255.0).astype(np.float16), BYTES),
    "long floats": ((BYTES / 255.0).astype(np.longdouble), BYTES),
    "every second row, backwards": (BYTES.repeat(2, axis=0)[::-2], BYTES[::-1]),
    "columns first": (np.asfortranarray(BYTES), BYTES),
}


@pytest.mark.parametrize("name", ODD_ARRAYS)
def test_arrays_of_odd_types_are_the_picture_that_they_show(name: str) -> None:
    array, expected = ODD_ARRAYS[name]
    pixels = image_pixels(array)
    assert pixels.dtype.isnative
    assert pixels.dtype == (np.uint16 if expected.dtype == np.uint16 else np.uint8)
    np.testing.assert_allclose(
        pixels[..., :3].astype(float), expected, atol=1 if name == "half floats" else 0
    )


@pytest.mark.parametrize("kind", [np.int64, np.uint32, np.int8, complex, object, str])
def test_arrays_of_no_pixels_are_refused(kind: type) -> None:
    with pytest.raises(InvalidImage, match="expected bytes, or floats from 0 to 1"):
        image_pixels((BYTES // 3).astype(kind))


@pytest.mark.parametrize("kind", [">u2", ">f4", "<u2"])
def test_a_decal_image_has_native_pixels(kind: str) -> None:
    pixels = np.ones((2, 2, 4), kind)
    image = decals.DecalImage("one", pixels)
    assert image.pixels.dtype.isnative
    np.testing.assert_array_equal(image.pixels, pixels)


def test_a_pillow_without_avif_reads_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.init()
    monkeypatch.delitem(Image.OPEN, "AVIF", raising=False)
    monkeypatch.setattr(load_module, "find_spec", lambda _name: None)
    Image.new("RGB", (2, 2)).save(tmp_path / "a.png")
    assert read_image(tmp_path / "a.png").shape == (2, 2, 4)
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InvalidImage, match="is not a picture"):
        read_image(tmp_path / "text.png")
