"""Tables of decals: exact round trips through frames and files, and files that are no tables."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import decals
from decals.errors import ImplicitDecalsError, InvalidDecals, InvalidScene
from decals.scenes.tables import ALWAYS, COLUMNS

HEADER = ",".join(list(COLUMNS)[:ALWAYS])
ROW = "0,0,0,0,0,1,1,0,0,0.5,0"


def random_decals(seed: int, count: int = 60) -> decals.Decals:
    rng = np.random.default_rng(seed)
    return decals.Decals(
        rng.normal(size=(count, 3)) * 10 ** rng.uniform(-9, 9, (count, 1)),
        rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3)),
        10 ** rng.uniform(-9, 9, count),
        images=rng.integers(-1, 3, count),
        spill=rng.random(count) < 0.5,
        interactions=rng.integers(0, 3, count),
        layers=rng.integers(-9, 9, count),
        tints=rng.random((count, 3)),
        opacities=rng.random(count),
        receivers=rng.choice(["", "a", 'b, "c"', "é;\t|"], count),
        fade_angles=np.where(rng.random(count) < 0.5, rng.uniform(1, 180, count), 0),
        fade_depths=np.where(rng.random(count) < 0.5, rng.uniform(1e-6, 9, count), 0),
        single_sheets=rng.random(count) < 0.5,
    )


def same(one: decals.Decals, other: decals.Decals) -> bool:
    return one == other and one.content_hash == other.content_hash


def as_polars(layout: decals.Decals) -> Any:
    polars: Any = pytest.importorskip("polars", reason="polars, of the extra experiments, is not installed")
    return polars.from_arrow(decals.to_arrow(layout))


FRAMES: dict[str, Any] = {
    "pandas": decals.to_pandas,
    "arrow": decals.to_arrow,
    "polars": as_polars,
    "dict": lambda layout: decals.to_pandas(layout).to_dict("list"),
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", FRAMES)
def test_frames_give_the_same_decals(kind: str, seed: int) -> None:
    for layout in (random_decals(seed), random_decals(seed, 1), decals.Decals.empty()):
        assert same(decals.from_table(FRAMES[kind](layout)), layout)


def test_columns_have_the_types_of_the_arrays() -> None:
    frame, table = decals.to_pandas(random_decals(0)), decals.to_arrow(random_decals(0))
    assert list(frame.columns) == table.column_names == list(COLUMNS)
    assert [str(frame[name].dtype) for name in ("x", "image", "spill")] == ["float32", "int32", "bool"]
    types = [
        str(table.schema.field(name).type) for name in ("x", "image", "spill", "interaction", "receivers")
    ]
    assert types == ["float", "int32", "bool", "string", "string"]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_files_give_the_same_decals(suffix: str, seed: int, tmp_path: Path) -> None:
    for layout in (random_decals(seed), decals.Decals.empty()):
        decals.save_table(layout, tmp_path / f"table.{suffix}")
        content = decals.load_table(tmp_path / f"table.{suffix}")
        assert same(content.decals, layout)
        assert (content.images, dict(content.extra)) == ((), {})


def test_usual_decals_have_the_first_columns_only(tmp_path: Path) -> None:
    usual = random_decals(1)
    usual = decals.Decals(usual.positions, usual.normals, usual.tangents, usual.radii)
    decals.save_table(usual, tmp_path / "usual.csv")
    decals.save_table(usual.replace(layers=3), tmp_path / "layers.csv")
    first = [(tmp_path / name).read_text().partition("\n")[0] for name in ("usual.csv", "layers.csv")]
    assert first == [HEADER, f"{HEADER},layer"]


@pytest.mark.parametrize("origin", [(1e6, -3.7e5, 0.1), (1e-9, 2.0**40, 0.0)])
def test_far_origins_cost_no_bit(origin: Any, tmp_path: Path) -> None:
    layout = random_decals(2)
    decals.save_table(layout, tmp_path / "far.csv", origin=origin)
    assert same(decals.load_table(tmp_path / "far.csv", origin=origin).decals, layout)
    shifted = decals.load_table(tmp_path / "far.csv").decals.positions
    np.testing.assert_allclose(shifted, layout.positions + np.array(origin), rtol=1e-6)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_images_travel_by_name_path_or_content(suffix: str, tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (200, 200, 4), np.uint8)
    from PIL import Image

    Image.fromarray(pixels).save(tmp_path / "mine.png")
    images = (
        decals.DecalImage.load("eye#336699"),
        decals.DecalImage.load(tmp_path / "mine.png"),
        decals.DecalImage("drawn", pixels[::-1]),
    )
    layout = random_decals(3)
    decals.save_table(layout, tmp_path / f"images.{suffix}", images=images)
    content = decals.load_table(tmp_path / f"images.{suffix}")
    assert content.decals == layout
    assert content.images == images
    with pytest.raises(InvalidDecals, match="images: expected 3 or more, got 1"):
        decals.save_table(layout, tmp_path / f"few.{suffix}", images=images[:1])


def test_pictures_outside_the_folder_need_trust(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    path = tmp_path / "inner" / "table.csv"
    path.write_text(f"{HEADER},image_source\n{ROW},../secret.png\n")
    with pytest.raises(InvalidScene, match="expected files in the folder"):
        decals.load_table(path)
    with pytest.raises(ImplicitDecalsError, match=r"secret\.png"):
        decals.load_table(path, trust=True)


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_files_of_other_programs(separator: str, encoding: str, end: str, tmp_path: Path) -> None:
    layout = random_decals(4).replace(receivers=None)
    frame = decals.to_pandas(layout)
    frame["species"] = [f"kind {number}" for number in range(len(layout))]
    shuffled = frame[sorted(frame.columns)]
    path = tmp_path / "other.csv"
    shuffled.to_csv(path, sep=separator, encoding=encoding, lineterminator=end, index=False)
    content = decals.load_table(path)
    assert same(content.decals, layout)
    assert content.extra["species"].tolist() == frame["species"].tolist()


def test_extra_columns_of_parquet_keep_their_types(tmp_path: Path) -> None:
    frame = decals.to_pandas(random_decals(5))
    frame["weight"] = np.arange(len(frame))
    frame.to_parquet(tmp_path / "weights.parquet")
    assert decals.load_table(tmp_path / "weights.parquet").extra["weight"].tolist() == list(range(len(frame)))


WRONG = {
    "": "expected a first line with columns x, y, z",
    "a,b\n1,2\n": "expected a first line with columns x, y, z",
    HEADER.replace("tz,", "") + "\n": "expected the columns tz too",
    f"{HEADER}\n{ROW.replace('0.5', 'nan')}\n": "line 2, column 'radius': expected a finite number",
    f"{HEADER}\n{ROW}\n{ROW.replace('0.5', 'inf')}\n": "line 3, column 'radius': expected a finite number",
    f"{HEADER}\n\n\n{ROW.replace('0.5', '')}\n": "line 4, column 'radius': expected a finite number, got",
    f"{HEADER}\n{ROW.replace('0.5', 'wide')}\n": "column 'radius': expected a finite number, got 'wide'",
    f"{HEADER.replace(',', ';')}\n{ROW.replace(',', ';').replace('0.5', '0,5')}\n": "write a decimal point",
    f"{HEADER}\n{ROW[:-1]}1.5\n": "column 'image': expected a whole number, got '1.5'",
    f"{HEADER}\n{ROW[:-1]}-2\n": "images: expected",
    f"{HEADER}\n{ROW[:-1]}1e300\n": "images: expected",
    f"{HEADER}\n{ROW.replace('0.5', '-1')}\n": "radii: expected",
    f"{HEADER}\n{ROW.replace('0.5', '1e99')}\n": "radii: expected",
    f"{HEADER}\n{ROW},7\n": "line 2: expected 11 cells, got 12",
    f"{HEADER}\n{ROW}\n0,0\n": "line 3: expected 11 cells, got 2",
    f"{HEADER},x\n{ROW},1\n": "expected one column 'x', got several",
    f"{HEADER},interaction\n{ROW},shove\n": "expected independent, push, overlap, got 'shove'",
    f"{HEADER},spill\n{ROW},perhaps\n": "expected true or false, got 'perhaps'",
    f"{HEADER},opacity\n{ROW},2\n": "opacities: expected",
    f'{HEADER}\n"{ROW}\n': "mend the quotes",
    f"{HEADER}\n{ROW.replace('0,0,1,', '0,0,0,', 1)}\n": "normals: expected",
    f"{HEADER},image_source\n{ROW},{{broken\n": "image 0",
    f"{HEADER},image_source\n{ROW[:-1]}1,eye\n{ROW},\n": "expected the source of image 0",
    f"{HEADER},image_source\n{ROW[:-1]}16000000,eye\n": "image: expected numbers below 65536",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_files_get_one_clear_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidDecals) as caught:
        decals.load_table(path)
    message = str(caught.value)
    assert WRONG[text] in message
    assert message.startswith(repr(str(path)))
    assert "\n" not in message


def test_files_that_are_no_text_or_not_there(tmp_path: Path) -> None:
    for name in ("binary.csv", "binary.parquet"):
        (tmp_path / name).write_bytes(os.urandom(300) + b"\xff\xfe")
        with pytest.raises(InvalidDecals, match="expected a"):
            decals.load_table(tmp_path / name)
    for path in (tmp_path / "none.csv", tmp_path, 7):
        with pytest.raises(InvalidDecals):
            decals.load_table(path)  # type: ignore[arg-type]  # no path
    with pytest.raises(InvalidScene, match=r"\.csv or \.parquet"):
        decals.save_table(decals.Decals.empty(), tmp_path / "table.xlsx")
    with pytest.raises(InvalidDecals, match="decals: expected"):
        decals.save_table(5, tmp_path / "table.csv")  # type: ignore[arg-type]  # no decals


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"radius": None}, "expected the columns radius too"),
        ({"x": ["a", "b"]}, "column 'x', row 0: expected a finite number, got 'a'"),
        ({"x": [1.0]}, "columns of the same length"),
        ({"x": [[1.0, 2.0], [3.0, 4.0]]}, "columns of the same length"),
        ({"y": [0.0, float("nan")]}, "column 'y', row 1: expected a finite number, got 'nan'"),
        ({"y": [True, object()]}, "column 'y', row 0: expected a finite number"),
        ({"image": [0, 0.5]}, "column 'image', row 1: expected a whole number, got '0.5'"),
        ({"image": [0, None]}, "column 'image', row 1: expected a whole number"),
        ({"spill": [True, "x"]}, "column 'spill', row 1: expected true or false"),
    ],
)
def test_wrong_frames(change: dict[str, Any], says: str) -> None:
    layout = decals.Decals([[0, 0, 0]] * 2, [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, 0.5)
    columns = decals.to_pandas(layout).to_dict("list") | change
    columns = {name: values for name, values in columns.items() if values is not None}
    with pytest.raises(InvalidDecals, match=says):
        decals.from_table(columns)


@pytest.mark.parametrize("wrong", [None, 5, "x,y,z", [1, 2], np.zeros((3, 3))])
def test_refuses_what_is_no_table(wrong: Any) -> None:
    with pytest.raises(InvalidDecals, match="table: expected a frame"):
        decals.from_table(wrong)
