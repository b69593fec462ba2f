"""Parquet files of strangers: damaged, lying, endless and deeply nested ones are read whole or refused."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import decals
from decals.errors import InvalidDecals
from decals.scenes import parquet, parquet_child
from decals.scenes.tables import ALWAYS, COLUMNS
from tests.decals.scenes.test_tables import random_decals
from tests.endurance import resident_megabytes

arrow: Any = pytest.importorskip("pyarrow", reason="pyarrow, of the extra experiments, is not installed")
write_table: Callable[..., None] = pytest.importorskip("pyarrow.parquet").write_table

EXTRAS: dict[str, Callable[[int], Any]] = {
    "texts": lambda count: arrow.array([f"é{row % 3}" for row in range(count)]),
    "words": lambda count: arrow.array(["a", None] * (count // 2) + ["a"] * (count % 2)).dictionary_encode(),
    "bytes": lambda count: arrow.array([b"\xff\0"] * count),
    "lists": lambda count: arrow.array([[1, 2], []] * (count // 2) + [None] * (count % 2)),
    "records": lambda count: arrow.array([{"a": row, "b": [str(row)]} for row in range(count)]),
    "maps": lambda count: arrow.array([[("a", 1)]] * count, arrow.map_(arrow.string(), arrow.int8())),
    "times": lambda count: arrow.array(range(count), arrow.timestamp("us", tz="UTC")),
    "decimals": lambda count: arrow.array(range(count)).cast(arrow.decimal128(30, 9)),
    "nothing": arrow.nulls,
    "pairs": lambda count: arrow.array([[0.5, 1.0]] * count, arrow.list_(arrow.float32(), 2)),
}
"""Columns of other kinds than those of decals."""


def table_of(chance: random.Random) -> Any:
    """Return a table of random decals with other columns."""
    table = decals.to_arrow(random_decals(chance.randrange(100), chance.randrange(1, 300)))
    for name in chance.sample([*EXTRAS], 3):
        table = table.append_column(name, EXTRAS[name](table.num_rows))
    return table


def written(chance: random.Random, path: Path) -> bytes:
    """Write a random table in a random form, and return the file's bytes."""
    write_table(
        table_of(chance),
        path,
        compression=chance.choice(["none", "snappy", "zstd", "gzip"]),
        use_dictionary=chance.random() < 0.5,
        data_page_version=chance.choice(["1.0", "2.0"]),
        row_group_size=chance.choice([7, 1000]),
        store_schema=chance.random() < 0.8,
    )
    return path.read_bytes()


def cut(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randrange(len(content))]


def footer_cut(content: bytes, chance: random.Random) -> bytes:
    """Leave bytes of the footer out, and name its length anew."""
    length = int.from_bytes(content[-8:-4], "little")
    kept = chance.randrange(length)
    return content[: -8 - length + kept] + kept.to_bytes(4, "little") + b"PAR1"


def wrong_length(content: bytes, chance: random.Random) -> bytes:
    return content[:-8] + chance.choice([0, 1, 2**31 - 1, 2**32 - 1]).to_bytes(4, "little") + b"PAR1"


def flipped(content: bytes, chance: random.Random, first: int, last: int) -> bytes:
    wrong = bytearray(content)
    for _ in range(chance.randrange(1, 9)):
        wrong[chance.randrange(first, last)] ^= 1 << chance.randrange(8)
    return bytes(wrong)


def pages_flipped(content: bytes, chance: random.Random) -> bytes:
    return flipped(content, chance, 4, len(content) - 8 - int.from_bytes(content[-8:-4], "little"))


def footer_flipped(content: bytes, chance: random.Random) -> bytes:
    return flipped(
        content, chance, len(content) - 8 - int.from_bytes(content[-8:-4], "little"), len(content) - 8
    )


def moved(content: bytes, chance: random.Random) -> bytes:
    """Copy a piece over another one."""
    size = chance.randrange(1, 200)
    begin, end = (chance.randrange(4, max(5, len(content) - size - 8)) for _ in range(2))
    return content[:begin] + content[end : end + size] + content[begin + size :]


DAMAGES = (cut, footer_cut, wrong_length, pages_flipped, footer_flipped, moved)


def is_read_or_refused(path: Path) -> bool:
    """Return True if a file is read; an error of another kind, or a crash, fails the test."""
    try:
        content = decals.load_table(path)
    except InvalidDecals as error:
        text = str(error)
        assert text.startswith(repr(str(path)))
        assert "\n" not in text
        assert len(text) < 400 + len(str(path))
        return False
    assert len(content.decals) < 1000
    return True


@pytest.mark.parametrize("seed", [pytest.param(seed, marks=pytest.mark.slow) for seed in range(20)])
def test_damaged_files_are_read_or_refused(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    sound = written(chance, tmp_path / "sound.parquet")
    assert is_read_or_refused(tmp_path / "sound.parquet")
    for damage in DAMAGES:
        path = tmp_path / f"{damage.__name__}.parquet"
        path.write_bytes(damage(sound, chance))
        is_read_or_refused(path)


@pytest.mark.parametrize("damage", [footer_cut, pages_flipped])
def test_one_damaged_file_of_a_kind(damage: Any, tmp_path: Path) -> None:
    path, chance = tmp_path / "table.parquet", random.Random(1)
    write_table(decals.to_arrow(random_decals(1, 300)), path)
    path.write_bytes(damage(path.read_bytes(), chance))
    is_read_or_refused(path)


def nested(levels: int) -> Any:
    kind = arrow.int8()
    for _ in range(levels):
        kind = arrow.struct([("a", kind)])
    return arrow.nulls(1, kind)


def one_list(count: int) -> Any:
    return arrow.ListArray.from_arrays([0, count], arrow.nulls(count))


def one_text(letters: int, *, rows: int) -> Any:
    return arrow.DictionaryArray.from_arrays(arrow.array([0] * rows, arrow.int32()), ["x" * letters])


HOSTILE: dict[str, tuple[Callable[[], Any], str]] = {
    "rows": (lambda: arrow.nulls(40_000_000), "unpacks to .* bytes, and .* are the most for its size"),
    "a list": (lambda: one_list(40_000_000), "unpacks to .* bytes|too much memory"),
    "a text": (lambda: one_text(1_000_000, rows=1000), "unpacks to .* bytes|too much memory"),
    "records": (lambda: nested(9), "column 'x' is nested deeper than 8 times"),
    "deep records": (lambda: nested(3000), "nested deeper|reader crashed|xceed|too deep"),
}
"""Small files that unpack to much, by what they have without end: a column, and what the refusal says."""


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.slow_cases("a list", "deep records")
def test_small_files_that_unpack_to_much_are_refused(name: str, tmp_path: Path) -> None:
    make, says = HOSTILE[name]
    path = tmp_path / "table.parquet"
    write_table(arrow.table({"x": make()}), path, store_schema=False)
    before = resident_megabytes()
    with pytest.raises(InvalidDecals, match=says):
        decals.load_table(path)
    assert resident_megabytes() - before < 100.0


def test_a_reader_that_crashes_or_hangs_ends_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "table.parquet"
    decals.save_table(random_decals(0), path)
    monkeypatch.setattr(parquet, "PATIENCE", 0.0)
    with pytest.raises(InvalidDecals, match="its reader crashed, or was stopped"):
        decals.load_table(path)


def test_a_text_in_each_row_takes_the_memory_of_the_texts(tmp_path: Path) -> None:
    columns = {name: [0.5] * 2000 for name in list(COLUMNS)[:ALWAYS]}
    columns |= {"nz": [1.0] * 2000, "nx": [0.0] * 2000, "ny": [0.0] * 2000, "tx": [1.0] * 2000}
    columns |= {"ty": [0.0] * 2000, "tz": [0.0] * 2000, "image": [0] * 2000}
    before = resident_megabytes()
    made = decals.from_table({**columns, "receivers": ["x" * 1_000_000] + ["y"] * 1999})
    assert resident_megabytes() - before < 100.0
    assert made.receivers[:2].tolist() == ["x" * 1_000_000, "y"]


def test_programs_without_a_python_of_their_own_read_by_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parquet, "can_isolate", lambda: False)
    layout = random_decals(4)
    decals.save_table(layout, tmp_path / "table.parquet")
    assert decals.load_table(tmp_path / "table.parquet").decals == layout
    write_table(arrow.table({"x": nested(9)}), tmp_path / "deep.parquet")
    with pytest.raises(InvalidDecals, match="nested deeper"):
        decals.load_table(tmp_path / "deep.parquet")
    (tmp_path / "cut.parquet").write_bytes(b"PAR1")
    with pytest.raises(InvalidDecals, match="expected a Parquet file"):
        decals.load_table(tmp_path / "cut.parquet")


def test_cells_count_the_values_within_values() -> None:
    for name, make in EXTRAS.items():
        cells = parquet_child._cells(make(10))
        assert cells >= 10, name
    assert parquet_child._cells(one_list(1000)) == 1001
    assert parquet_child._cells(nested(3)) == 4
