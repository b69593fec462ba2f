"""The folder of an experiment: rows in a journal and in shards, a lock, and what the experiment is.

A row is appended to the journal as soon as its trial has ended. Once the journal is long, and at the end of a
run, its rows become a shard: a Parquet file, or a CSV file where pyarrow is not installed. Shards are written
atomically. A kill loses at most the rows of trials that had not ended.
"""

import csv
import errno
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import msgspec

from blobtree.errors import UnusableFile
from blobtree.file_lock import FileLock
from blobtree.files import PREFIX, read_file, replacing, write_atomically
from decals.errors import InvalidInput
from decals.experiments.outcome import Row

FORMAT = 1
"""Format of the folder; a higher one belongs to a newer version."""

SHARD_ROWS = 1000
"""Rows of the journal that become a shard."""

AS_JSON = b"implicit-decals json"
"""Mark of columns in Parquet whose cells are JSON."""

EXPERIMENT, JOURNAL, RUNNING, LOCK, SHARDS = (
    "experiment.json",
    "journal.jsonl",
    "running.json",
    "lock",
    "rows",
)


def described(folder: Path) -> dict[str, Any]:
    """Return what the experiment of a folder is.

    Raises
    ------
    InvalidInput
        The folder holds no experiment, or one of a newer version.
    """
    try:
        about: dict[str, Any] = json.loads(read_file(folder / EXPERIMENT))
        newer = about["format"] > FORMAT
        if not newer:
            about = msgspec.to_builtins(msgspec.convert(about, _About))
    except FileNotFoundError:
        raise InvalidInput(
            f"{folder}: expected the folder of an experiment, but it has no {EXPERIMENT}"
        ) from None
    except OSError as error:
        raise UnusableFile.of(error, folder / EXPERIMENT, "read") from error
    except (ValueError, KeyError, TypeError) as error:  # errors of msgspec are ValueError
        raise InvalidInput(f"{folder / EXPERIMENT}: damaged ({error}); choose another folder") from error
    if newer:
        raise InvalidInput(f"{folder}: written by a newer version of implicit-decals; install that version")
    return about


def rows_in(folder: Path) -> Iterator[Row]:
    """Yield the rows of a folder, the oldest first; a trial that ran several times has several."""
    for shard in _shards(folder):
        yield from _checked(shard, _parquet_rows if shard.suffix == ".parquet" else _csv_rows)
    yield from _checked(folder / JOURNAL, _journal_rows)


class _About(msgspec.Struct, rename={"format_": "format"}):
    """What the file of an experiment holds."""

    format_: int
    name: str
    function: str
    parameters: list[str]


def _shards(folder: Path) -> list[Path]:
    """Return the shards, the oldest first; what a killed writer left has another name."""
    return sorted((folder / SHARDS).glob("[0-9]*.*"))


def _checked(path: Path, read: Callable[[Path], Iterable[Row]]) -> Iterator[Row]:
    """Yield the rows of a file; none if there is no file.

    Raises
    ------
    InvalidInput
        The file is damaged.
    """
    try:
        yield from map(_checked_row, read(path))
    except FileNotFoundError:
        return
    except (ValueError, OSError, csv.Error) as error:  # errors of pyarrow are ValueError or OSError
        raise InvalidInput(f"{path}: damaged ({error}); remove the file, and run its trials again") from error


def _checked_row(row: Any) -> Row:
    if not (isinstance(row, dict) and isinstance(row.get("trial"), str) and "status" in row):
        raise ValueError("a row lacks its trial or its status")
    return row


class Store:
    """Writes the rows of an experiment; one process at a time has the folder.

    Parameters
    ----------
    folder
        The folder; it is made.
    about
        Name, parameters and digest of the function.

    Raises
    ------
    InvalidInput
        Another run has the folder, or it holds something else.
    UnusableFile
        The folder cannot be written.
    """

    def __init__(self, folder: Path, about: dict[str, Any]) -> None:
        self._folder = folder
        try:
            (folder / SHARDS).mkdir(parents=True, exist_ok=True)
            lock = FileLock.acquire(folder / LOCK)
        except OSError as error:
            raise UnusableFile.of(error, folder, "write") from error
        if lock is None:
            raise InvalidInput(
                f"{folder}: another run writes into this folder; wait for it, or choose another folder"
            )
        self._lock = lock
        try:
            self._check(about)
            write_atomically(folder / EXPERIMENT, json.dumps({"format": FORMAT, **about}, indent=1).encode())
            self._pending = _shorn(folder / JOURNAL)
            self._journal = (folder / JOURNAL).open("ab", buffering=0)
        except BaseException:
            lock.release()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        try:
            with suppress(OSError):
                (self._folder / RUNNING).unlink(missing_ok=True)
            self._make_shard()
        finally:
            self._journal.close()
            self._lock.release()

    def _check(self, about: dict[str, Any]) -> None:
        """Raise an error unless the folder is new, or holds this experiment."""
        if (self._folder / EXPERIMENT).exists():
            found = described(self._folder)
            if (found.get("name"), found.get("parameters")) != (about["name"], about["parameters"]):
                raise InvalidInput(
                    f"{self._folder}: holds the experiment {found.get('name')} of {found.get('parameters')}, "
                    f"not {about['name']} of {about['parameters']}; choose another folder"
                )
            return
        for path in self._folder.iterdir():
            if path.name not in (SHARDS, LOCK) and not path.name.startswith(PREFIX):
                raise InvalidInput(
                    f"{self._folder}: expected an empty folder, but it holds {path.name}; choose another"
                )

    def begin(self, row: Row) -> None:
        """Note the trial that starts in this process; if the process ends, `interrupted` returns it."""
        self._guarded(lambda: (self._folder / RUNNING).write_text(json.dumps(row)))

    def interrupted(self, rows: Sequence[Row]) -> int | None:
        """Return the number of the row that ran in the process of the last run when that process ended."""
        with suppress(FileNotFoundError, ValueError):
            found: Row = json.loads((self._folder / RUNNING).read_text())
            keys = [(row["trial"], row["function"]) for row in rows]
            return keys.index((found.get("trial"), found.get("function")))
        return None

    def add(self, row: Row) -> None:
        """Append a row."""
        line = json.dumps(row).encode() + b"\n"
        self._guarded(lambda: self._write(line))
        with suppress(FileNotFoundError):
            (self._folder / RUNNING).unlink()
        self._pending += 1
        if self._pending >= SHARD_ROWS:
            self._make_shard()

    def _write(self, line: bytes) -> None:
        """Append a line; a disk that becomes full takes a part of it without an error."""
        if self._journal.write(line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _guarded(self, write: Callable[[], object]) -> None:
        try:
            write()
        except OSError as error:
            raise UnusableFile.of(error, self._folder, "write") from error

    def _make_shard(self) -> None:
        """Move the rows of the journal into a shard; after a kill in between they are in both."""
        rows = list(_checked(self._folder / JOURNAL, _journal_rows))
        if rows:
            number = 1 + max((int(path.stem) for path in _shards(self._folder)), default=-1)
            _write_shard(self._folder / SHARDS / f"{number:06}", rows)
            self._journal.truncate(0)
        self._pending = 0


# -- journals and shards --------------------------------------------------------------------------------


def _journal_rows(path: Path) -> Iterator[Row]:
    """Yield the rows of a journal; a kill can have cut the last line."""
    with path.open("rb") as lines:
        for line in lines:
            if line.endswith(b"\n"):
                yield json.loads(line)


def _shorn(path: Path) -> int:
    """Remove a last line that is not whole; return the number of rows."""
    if not path.exists():
        return 0
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if whole != content:
        write_atomically(path, whole)
    return whole.count(b"\n")


def _names(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row))


def _write_shard(stem: Path, rows: list[Row]) -> None:
    try:
        import pyarrow as pa
        import pyarrow.parquet as parquet
    except ImportError:
        text = io.StringIO()
        table = csv.writer(text)
        table.writerow(_names(rows))
        table.writerows([[_cell(row.get(name)) for name in _names(rows)] for row in rows])
        write_atomically(stem.with_suffix(".csv"), text.getvalue().encode())
        return

    def column(name: str) -> tuple[Any, Any]:
        values = [row.get(name) for row in rows]
        try:
            array, metadata = pa.array(values), None
        except (ValueError, TypeError, OverflowError):  # numbers and texts in one column, or huge numbers
            array, metadata = pa.array([json.dumps(value) for value in values]), {AS_JSON: b""}
        return array, pa.field(name, array.type, metadata=metadata)

    arrays, fields = zip(*map(column, _names(rows)), strict=True)
    with replacing(stem.with_suffix(".parquet")) as temporary:
        parquet.write_table(pa.table(list(arrays), schema=pa.schema(fields)), temporary)


def _parquet_rows(path: Path) -> list[Row]:
    try:
        import pyarrow.parquet as parquet
    except ImportError:
        raise InvalidInput(
            f"{path}: reading Parquet needs pyarrow; install implicit-decals[experiments]"
        ) from None
    table = parquet.read_table(path)
    rows: list[Row] = table.to_pylist()
    for name in [field.name for field in table.schema if AS_JSON in (field.metadata or {})]:
        for row in rows:
            row[name] = json.loads(row[name])
    return rows


def _cell(value: Any) -> str:
    """Return a value of a CSV file; texts that look like other values are in quotes."""
    if isinstance(value, str) and value and _value(value) == value:
        return value
    return "" if value is None else json.dumps(value)


def _value(cell: str) -> Any:
    """Return the value of a cell."""
    try:
        return json.loads(cell)
    except ValueError:
        return cell


def _csv_rows(path: Path) -> Iterator[Row]:
    with path.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            yield {name: _value(cell) if cell else None for name, cell in row.items()}
