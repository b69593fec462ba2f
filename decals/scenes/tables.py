"""Tables of decals, one row each: files in CSV and Parquet, and frames of pandas, Arrow and polars.

Columns are those of `COLUMNS`. A file has the first ones and, of the others, those with a value other than
their default. Its column ``image_source`` says where the pictures come from, in the first row of each image.
Other columns are kept as they are.
"""

import csv
import io
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from decimal import Context, Decimal, InvalidOperation, localcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float64Array
from blobtree.files import no_file, read_file, replacing, write_atomically
from blobtree.validation import describe, finite_vector, items, truth
from decals.errors import InvalidDecals, InvalidInput
from decals.images.load import AnyImage
from decals.model import Decals, Interaction
from decals.receivers import TEXT
from decals.scenes.files import image_record, images_of
from decals.scenes.material_record import MaterialRecord, sources_of
from decals.scenes.origin import WORLD, Origin
from decals.scenes.parquet import read_parquet
from decals.scenes.records import check_inside, decimals
from decals.scenes.scene import DecalImage, as_images
from decals.validation import as_path, checked_path, instance, optional_package

if TYPE_CHECKING:
    import pandas
    import pyarrow

SUFFIXES = (".csv", ".parquet")

IMAGE_SOURCE = "image_source"
"""Column of the names, paths or contents of images."""

MAX_IMAGE_NUMBER = 1 << 16
"""Bound on the numbers of images in a file; a list of images as long as the largest number is made."""

SEPARATORS = ",;\t|"

EXACT = Context(prec=80)
"""Sums of a float32 and an origin have no more digits in the range of models."""


@dataclass(frozen=True)
class _Column:
    """A column of a table: array of `Decals` and its component, kind, and default if it has one."""

    array: str
    component: int | None = None
    kind: str = "number"
    default: Any = None


def _vector(array: str, names: Iterable[str], default: Any = None) -> dict[str, _Column]:
    return {name: _Column(array, place, default=default) for place, name in enumerate(names)}


COLUMNS: dict[str, _Column] = {
    **_vector("positions", "xyz"),
    **_vector("normals", ("nx", "ny", "nz")),
    **_vector("tangents", ("tx", "ty", "tz")),
    "radius": _Column("radii"),
    "image": _Column("images", None, "whole", 0),
    "spill": _Column("spill", None, "truth", False),
    "interaction": _Column("interactions", None, "interaction", Interaction.PUSH),
    "layer": _Column("layers", None, "whole", 0),
    **_vector("tints", ("tint_r", "tint_g", "tint_b"), 1.0),
    "opacity": _Column("opacities", default=1.0),
    "receivers": _Column("receivers", None, "text", ""),
    "fade_angle": _Column("fade_angles", default=0.0),
    "fade_depth": _Column("fade_depths", default=0.0),
    "single_sheet": _Column("single_sheets", None, "truth", False),
}
"""Columns of a table by name; those without a default are required."""

ALWAYS = 11
"""Number of columns that every file has, whatever their values."""

_NAMES = [kind.name.lower() for kind in Interaction]
_TRUTHS = {"true": True, "1": True, "false": False, "0": False}


@dataclass(frozen=True, eq=False)
class DecalTable:
    """What a file of a table has.

    Attributes
    ----------
    decals
        A decal for each row.
    images
        Their images, if the file says where they come from; else none.
    extra
        Other columns by name: texts of a CSV file, values of any kind of a Parquet file.
    """

    decals: Decals
    images: tuple[DecalImage, ...] = ()
    extra: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def to_pandas(decals: Decals) -> "pandas.DataFrame":
    """Return decals as a pandas frame, a row for each.

    Parameters
    ----------
    decals : Decals
        The decals.

    Returns
    -------
    pandas.DataFrame
        Columns x, y, z, nx, ny, nz, tx, ty, tz, radius, image, spill, interaction, layer, tint_r, tint_g,
        tint_b, opacity, receivers, fade_angle, fade_depth and single_sheet, of the types of the arrays.

    Raises
    ------
    MissingPackage
        pandas is not installed; the extra ``experiments`` has it.

    See Also
    --------
    from_table : the other direction.

    Examples
    --------
    >>> import decals
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.5)
    >>> decals.to_pandas(disk)[["radius", "interaction"]].to_dict("list")
    {'radius': [0.5], 'interaction': ['push']}
    """
    frame: pandas.DataFrame = optional_package("pandas", "experiments").DataFrame(_columns_of(decals))
    return frame


def to_arrow(decals: Decals) -> "pyarrow.Table":
    """Return decals as an Arrow table, a row for each; columns are those of `to_pandas`.

    Parameters
    ----------
    decals : Decals
        The decals.

    Returns
    -------
    pyarrow.Table

    Raises
    ------
    MissingPackage
        pyarrow is not installed; the extra ``experiments`` has it.

    See Also
    --------
    from_table : the other direction.

    Examples
    --------
    >>> import decals
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.5)
    >>> table = decals.to_arrow(disk)
    >>> table.num_rows, str(table.schema.field("radius").type)
    (1, 'float')
    >>> decals.from_table(table) == disk
    True
    """
    arrow = optional_package("pyarrow", "experiments")
    arrays = {
        name: values.tolist() if values.dtype.kind in "OUT" else values
        for name, values in _columns_of(decals).items()
    }
    types = {name: arrow.string() if isinstance(values, list) else None for name, values in arrays.items()}
    columns = {name: arrow.array(values, type=types[name]) for name, values in arrays.items()}
    return cast("pyarrow.Table", arrow.table(columns))


def from_table(table: object) -> Decals:
    """Return the decals of a table: the other direction of `to_pandas` and `to_arrow`.

    Parameters
    ----------
    table : pandas.DataFrame, pyarrow.Table, polars.DataFrame or mapping
        Columns by name. Those from x to tz, and radius, are required. Others have defaults, and columns of
        other names do not count. Numbers of other types are rounded to float32.

    Returns
    -------
    Decals

    Raises
    ------
    InvalidDecals
        No table, a missing column, a column of another type, an empty cell, or values that make no decals.

    Examples
    --------
    >>> import decals
    >>> disks = decals.Decals([[0, 0, 0], [1, 0, 0]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2, 0.5, layers=[0, 3])
    >>> decals.from_table(decals.to_pandas(disks)) == disks
    True
    """
    return _decals_of(_arrays_of(table), lambda name, row: f"column {name!r}, row {row}")


def save_table(
    decals: Decals,
    path: str | os.PathLike[str],
    *,
    images: AnyImage | Iterable[AnyImage] = (),
    origin: Origin = WORLD,
) -> None:
    """Write decals as a table, whole or not at all; `load_table` reads the same bits.

    Parameters
    ----------
    decals : Decals
        The decals.
    path : str or path
        The file, named ``.csv`` or ``.parquet``. Parquet needs the extra ``experiments``.
    images : sequence of images, optional
        Images of the decals, as a scene takes them. The file names them, or has them in full if they have
        neither name nor path.
    origin : (x, y, z), optional
        Added to the positions in CSV: the origin of the objects, as coordinates in their files have it.

    Raises
    ------
    InvalidDecals
        No decals, or an origin of other than three finite numbers.
    InvalidScene
        Another suffix, or a folder that cannot be written.
    InvalidImage
        Images that are none.
    MissingPackage
        pyarrow is not installed.

    Examples
    --------
    >>> import pathlib, decals
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.1)
    >>> decals.save_table(disk, "disk.csv")
    >>> pathlib.Path("disk.csv").read_text().split()
    ['x,y,z,nx,ny,nz,tx,ty,tz,radius,image', '0.0,0.0,0.0,0.0,0.0,1.0,1.0,0.0,0.0,0.1,0']
    """
    instance("decals", decals, Decals, InvalidDecals, "a scene has .decals")
    target, shift = checked_path(path, SUFFIXES), finite_vector("origin", origin, InvalidDecals)
    columns = _columns_of(decals)
    names = [
        name
        for place, (name, column) in enumerate(COLUMNS.items())
        if place < ALWAYS or (getattr(decals, column.array) != column.default).any()
    ]
    sources = _image_sources(decals, images, target.parent)
    if target.suffix.lower() == ".parquet":
        arrow, parquet = (optional_package(name, "experiments") for name in ("pyarrow", "pyarrow.parquet"))
        table = to_arrow(decals).select(names)
        if sources:
            table = table.append_column(IMAGE_SOURCE, arrow.array(sources, arrow.string()))
        with replacing(target) as temporary:
            parquet.write_table(table, temporary)
        return
    texts = [_texts(name, columns[name], shift) for name in names]
    if sources:
        names, texts = [*names, IMAGE_SOURCE], [*texts, sources]
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*texts, strict=True))
    write_atomically(target, lines.getvalue().encode())


def load_table(path: str | os.PathLike[str], *, origin: Origin = WORLD, trust: bool = False) -> DecalTable:
    """Read decals of a file that `save_table`, the command ``scatter`` or another program wrote.

    Parameters
    ----------
    path : str or path
        A Parquet file named ``.parquet``; files of other names are text with separators: commas, semicolons,
        tabs or vertical bars, in UTF-8. Columns are as in `from_table`, in any order.
    origin : (x, y, z), optional
        Subtracted from the positions in CSV, see `save_table`.
    trust : bool, optional
        True lets the table name pictures outside its folder, as for `load_scene`.

    Returns
    -------
    DecalTable

    Raises
    ------
    InvalidDecals
        No such file, no table of decals, or a wrong argument; the message names file, line and column.
    InvalidScene, InvalidImage
        A picture outside the folder, or a missing one.

    Examples
    --------
    >>> import decals
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], 0.1)
    >>> decals.save_table(disk, "disk.csv")
    >>> decals.load_table("disk.csv").decals == disk
    True
    """
    source, shifts = as_path(path, InvalidDecals), finite_vector("origin", origin, InvalidDecals)
    trust = truth("trust", trust, InvalidDecals)
    if reason := no_file(source):
        raise InvalidDecals(f"expected a table of decals, {reason}; check the path")
    if source.suffix.lower() == ".parquet":
        return _loaded(source, _arrays_of(read_parquet(source)), lambda row: f"row {row + 1}", trust)
    columns, lines = _csv_columns(source)
    for name, shift in zip("xyz", shifts, strict=True):
        if shift and name in columns:
            columns[name] = _shifted(columns[name], shift)
    return _loaded(source, columns, lambda row: f"line {lines[row]}", trust)


def _loaded(
    path: Path, columns: dict[str, NDArray[Any]], place: Callable[[int], str], trust: bool
) -> DecalTable:
    """Return the table of columns; errors name the file and the places of its rows."""
    try:
        decals = _decals_of(columns, lambda name, row: f"{place(row)}, column {name!r}")
    except InvalidInput as error:
        raise InvalidDecals(f"{str(path)!r}: {error}") from error
    images: tuple[DecalImage, ...] = ()
    if IMAGE_SOURCE in columns:
        images = _images(columns[IMAGE_SOURCE], decals, path, trust)
    extra = {name: values for name, values in columns.items() if name not in (*COLUMNS, IMAGE_SOURCE)}
    return DecalTable(decals, images, extra)


def _columns_of(decals: Decals) -> dict[str, NDArray[Any]]:
    """Return the arrays of decals as columns."""
    instance("decals", decals, Decals, InvalidDecals, "a scene has .decals")
    columns: dict[str, NDArray[Any]] = {}
    for name, column in COLUMNS.items():
        values = getattr(decals, column.array)
        if column.component is not None:
            values = values[:, column.component]
        elif column.kind == "interaction":
            values = np.array(_NAMES, object)[values]
        elif column.kind == "text":
            values = values.astype(object)
        columns[name] = values
    return columns


def _arrays_of(table: object) -> dict[str, NDArray[Any]]:
    """Return the columns of a frame, a table or a mapping."""
    names = getattr(table, "column_names", None) or getattr(table, "columns", None)
    if names is None and isinstance(table, Mapping):
        names = list(table)
    listed = items(names)
    if listed is None or not hasattr(table, "__getitem__"):
        raise InvalidDecals(
            f"table: expected a frame of pandas or polars, an Arrow table or a mapping, got {describe(table)}"
        )
    if len(set(listed)) < len(listed):
        raise InvalidDecals("table: expected different names of columns, got one twice; rename one")
    columns: dict[str, NDArray[Any]] = {}
    for name in listed:
        values: Any = table[name]
        columns[str(name)] = values.to_numpy() if hasattr(values, "to_numpy") else _array_of(values)
    return columns


def _array_of(values: object) -> NDArray[Any]:
    """Return the values of a column; texts stay objects, as an array of them has the longest in each row."""
    texts = isinstance(values, list | tuple) and any(isinstance(value, str) for value in values)
    return np.asarray(values, object if texts else None)


def _decals_of(columns: Mapping[str, NDArray[Any]], where: Callable[[str, int], str]) -> Decals:
    """Return the decals of columns; `where` names a cell by its column and row."""
    missing = [name for name, column in COLUMNS.items() if column.default is None and name not in columns]
    if missing:
        raise InvalidDecals(f"expected the columns {', '.join(missing)} too; add them, or rename others")
    lengths = {len(columns[name]) if columns[name].ndim == 1 else -1 for name in COLUMNS if name in columns}
    if len(lengths) > 1 or -1 in lengths:
        raise InvalidDecals("expected columns of the same length; give a value for each row")
    count = lengths.pop()
    parts: dict[str, list[NDArray[Any]]] = {}
    for name, column in COLUMNS.items():
        if name in columns:
            parts.setdefault(column.array, []).append(_values(name, column, columns[name], where))
        elif column.component is not None:
            parts.setdefault(column.array, []).append(np.full(count, column.default, np.float64))
    with np.errstate(over="ignore"):  # what overflows float32 is refused as infinite
        arrays: dict[str, Any] = {
            name: np.stack(several, axis=1) if len(several) > 1 else several[0]
            for name, several in parts.items()
        }
        floats = {
            name: array.astype(np.float32) for name, array in arrays.items() if array.dtype == np.float64
        }
        return Decals(**arrays | floats)


def _values(
    name: str, column: _Column, values: NDArray[Any], where: Callable[[str, int], str]
) -> NDArray[Any]:
    """Return the checked values of a column."""
    if column.kind == "text":
        return np.array(["" if _is_empty(value) else str(value) for value in values.tolist()], TEXT)
    if column.kind in ("interaction", "truth"):
        known: dict[str, Any] = (
            _TRUTHS if column.kind == "truth" else {kind: place for place, kind in enumerate(_NAMES)}
        )
        found = [known.get(str(value).strip().lower()) for value in values.tolist()]
        if None in found:
            row = found.index(None)
            choices = "true or false" if column.kind == "truth" else ", ".join(_NAMES)
            raise InvalidDecals(f"{where(name, row)}: expected {choices}, got {str(values[row])!r}")
        return np.array(found, bool if column.kind == "truth" else np.int32)
    numbers = _numbers(name, values, where)
    whole = column.kind == "whole"
    wrong = ~np.isfinite(numbers) | (
        whole & (numbers != np.round(np.where(np.isfinite(numbers), numbers, 0)))
    )
    if wrong.any():
        row = int(wrong.argmax())
        kind = "whole" if whole else "finite"
        raise InvalidDecals(f"{where(name, row)}: expected a {kind} number, got {str(values[row])!r}")
    return numbers.astype(np.int64) if whole and np.abs(numbers).max(initial=0.0) < 2.0**53 else numbers


def _numbers(name: str, values: NDArray[Any], where: Callable[[str, int], str]) -> Float64Array:
    """Return a column as numbers; texts count if they are decimal numbers."""
    if values.dtype.kind in "iuf":
        return values.astype(np.float64)
    numbers = np.empty(len(values))
    for row, value in enumerate(values.tolist()):
        try:
            given: Any = None if isinstance(value, bool) else value
            numbers[row] = np.nan if value is None else float(given)
        except (TypeError, ValueError):
            advice = "; write a decimal point" if isinstance(value, str) and "," in value else ""
            raise InvalidDecals(
                f"{where(name, row)}: expected a finite number, got {str(value)!r:.60}{advice}"
            ) from None
    return numbers


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, float) and np.isnan(value))


# -- CSV and Parquet -------------------------------------------------------------------------------------


def _texts(name: str, values: NDArray[Any], origin: tuple[float, float, float]) -> list[Any]:
    """Return the cells of a column as text: the shortest decimals that are read as the same float32."""
    if values.dtype == np.float32:
        shift = origin["xyz".index(name)] if name in ("x", "y", "z") else 0.0
        if shift:
            with localcontext(EXACT):
                return [str(Decimal(float(value)) + Decimal(shift)) for value in values]
        return [repr(value) for value in decimals(values).tolist()]
    if values.dtype == bool:
        return [str(value).lower() for value in values.tolist()]
    texts: list[Any] = values.tolist()
    return texts


def _shifted(texts: NDArray[Any], shift: float) -> NDArray[Any]:
    """Return texts of numbers less a shift, without rounding; other texts as they are."""

    def shifted(text: str) -> str:
        try:
            return str(Decimal(text) - Decimal(shift))
        except InvalidOperation:
            return text

    with localcontext(EXACT):
        return np.array([shifted(text) for text in texts.tolist()], object)


def _csv_columns(path: Path) -> tuple[dict[str, NDArray[Any]], list[int]]:
    """Return the columns of a text file as texts, and the lines on which rows end."""
    try:
        text = read_file(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidDecals(f"{str(path)!r}: expected a table in UTF-8 ({error}); save it as such") from error
    header = text.partition("\n")[0].strip()
    counts = {mark: len(set(COLUMNS) & {_name(part) for part in header.split(mark)}) for mark in SEPARATORS}
    separator = max(SEPARATORS, key=lambda mark: counts[mark])
    if not counts[separator]:
        first = ", ".join(list(COLUMNS)[:ALWAYS])
        raise InvalidDecals(f"{str(path)!r}: expected a first line with columns {first}, got {header!r:.60}")
    try:
        with _long_cells():
            reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
            rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise InvalidDecals(f"{str(path)!r}: expected separated values ({error}); mend the quotes") from error
    names = [part.strip() for part in rows[0][1]]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidDecals(f"{str(path)!r}: expected one column {twice!r}, got several; rename one")
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise InvalidDecals(
                f"{str(path)!r}: line {line}: expected {len(names)} cells, got {len(row)}; complete the line"
            )
    columns = {
        name: np.array([row[place] for _, row in rows[1:]], object) for place, name in enumerate(names)
    }
    return columns, [line for line, _ in rows[1:]]


def _name(part: str) -> str:
    return part.strip().strip('"')


@contextmanager
def _long_cells() -> Any:
    """Allow cells of any length, for embedded pictures."""
    before = csv.field_size_limit(min(sys.maxsize, 2**31 - 1))
    try:
        yield
    finally:
        csv.field_size_limit(before)


# -- images ----------------------------------------------------------------------------------------------


def _image_sources(decals: Decals, images: AnyImage | Iterable[AnyImage], folder: Path) -> list[str]:
    """Return a cell for each decal: the record of its image where the image comes first, else empty."""
    records = [image_record(image, folder) for image in as_images(images)]
    if not records:
        return []
    if decals.images.max(initial=-1) >= len(records):
        raise InvalidDecals(
            f"images: expected {decals.images.max() + 1} or more, got {len(records)}; decals refer to them"
        )
    cells = [""] * len(decals)
    for number, row in zip(*np.unique(decals.images, return_index=True), strict=True):
        if number >= 0:
            record = records[number]
            cells[row] = record if isinstance(record, str) else msgspec.json.encode(record).decode()
    return cells


def _images(cells: NDArray[Any], decals: Decals, path: Path, trust: bool) -> tuple[DecalImage, ...]:
    """Return the images that the cells of a table name; the first one also stands for those it lacks."""
    known: dict[int, str | MaterialRecord] = {}
    for number, cell in zip(decals.images.tolist(), cells.tolist(), strict=True):
        if number < 0 or _is_empty(cell) or not str(cell) or number in known:
            continue
        text = str(cell)
        try:
            known[number] = msgspec.json.decode(text, type=MaterialRecord) if text.startswith("{") else text
        except msgspec.MsgspecError as error:
            raise InvalidDecals(f"{str(path)!r}: image {number}: {error}; name a picture") from error
    if not known:
        return ()
    if max(known) >= MAX_IMAGE_NUMBER:
        raise InvalidDecals(
            f"{str(path)!r}: image: expected numbers below {MAX_IMAGE_NUMBER}, got {max(known)}; number anew"
        )
    lost = sorted(set(decals.images[decals.images >= 0].tolist()) - known.keys())
    if lost:
        raise InvalidDecals(
            f"{str(path)!r}: expected the source of image {lost[0]} in {IMAGE_SOURCE!r}, got none"
        )
    records = [known.get(number, known[min(known)]) for number in range(max(known) + 1)]
    if not trust:
        check_inside([source for record in records for source in sources_of(record)], path.parent)
    return images_of(records, path.parent, trust)
