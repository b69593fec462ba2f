"""The process in which `parquet` reads files: pyarrow may crash on damaged ones, and unpack rows without end.

It answers with a line of JSON, and after that with the table as a stream of Arrow.
"""

import json
import math
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pyarrow

if sys.platform != "win32":
    import resource

STATM = Path("/proc/self/statm")
"""The size of this process, to which the memory for reading is added; macOS has no such file."""

MAX_DEPTH = 8
"""Depth of lists and records within each other in a column."""

CELL = 8
"""Bytes that one cell counts for at least: an array of objects takes as many."""

WORKING_COPIES = 4
"""Memory for reading over that of the table."""


def main(path: str, budget: int, seconds: float) -> None:
    """Read a file, whose name is in hexadecimal digits, and write the answer to the standard output."""
    with os.fdopen(os.dup(1), "wb") as answers, Path(os.devnull).open("r+b") as nothing:
        os.dup2(nothing.fileno(), 1)  # libraries may print
        import pyarrow.parquet

        pyarrow.set_memory_pool(pyarrow.system_memory_pool())  # others reserve more than they use
        _limit(WORKING_COPIES * budget, seconds)
        try:
            table = checked_table(os.fsdecode(bytes.fromhex(path)), budget)
        except MemoryError:
            answers.write(_line({"error": "it would take too much memory"}))
        except Exception as error:  # pyarrow has errors of many kinds
            answers.write(_line({"error": str(error)}))
        else:
            answers.write(_line({}))
            with pyarrow.ipc.new_stream(answers, table.schema) as stream:
                stream.write_table(table)


def checked_table(path: str, budget: int) -> "pyarrow.Table":
    """Return the table of a Parquet file; its claims are checked first, and all its values after that.

    Raises
    ------
    ValueError
        The table would have more bytes than the budget, or columns that are nested deeper than `MAX_DEPTH`.
    """
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(path, memory_map=False, pre_buffer=False) as file:
        claims = file.metadata
        groups = sum(claims.row_group(number).total_byte_size for number in range(claims.num_row_groups))
        _check_size(max(CELL * claims.num_rows * max(claims.num_columns, 1), groups), budget)
        for field in file.schema_arrow:
            if _is_deep(field.type):
                raise ValueError(f"column {field.name!r:.60} is nested deeper than {MAX_DEPTH} times")
        table = file.read(use_threads=False)
    cells = sum(_cells(chunk) for column in table.columns for chunk in column.chunks)
    _check_size(max(CELL * cells, table.nbytes), budget)
    table.validate(full=True)
    return table


def _check_size(size: int, budget: int) -> None:
    if not 0 <= size <= budget:
        raise ValueError(f"it unpacks to {size:,} bytes, and {budget:,} are the most for its size")


def _is_deep(kind: "pyarrow.DataType") -> bool:
    """Return True if a type has parts within parts, deeper than `MAX_DEPTH`."""
    level = [kind]
    for _ in range(MAX_DEPTH):
        level = [kind.field(number).type for kind in level for number in range(kind.num_fields)]
    return bool(level)


def _cells(array: Any) -> int:
    """Return the number of values in an array and in the arrays within it."""
    import pyarrow

    kind = array.type
    if isinstance(array, pyarrow.ExtensionArray):
        return _cells(array.storage)
    if isinstance(array, pyarrow.MapArray):
        inner = [array.keys, array.items]
    elif isinstance(array, pyarrow.DictionaryArray):
        inner = [array.dictionary]
    elif isinstance(array, pyarrow.StructArray):
        inner = [array.field(number) for number in range(kind.num_fields)]
    else:
        inner = [array.values] if kind.num_fields else []
    return len(array) + sum(map(_cells, inner))


def _limit(memory: int, seconds: float) -> None:
    """Limit memory and processor time of this process where the system can, and let it write no core file."""
    if sys.platform == "win32":
        return
    if STATM.exists():
        pages = int(STATM.read_text(encoding="ascii").split()[0])
        total = pages * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (total, total))
    most = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + seconds), most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _line(header: dict[str, Any]) -> bytes:
    return json.dumps(header).encode() + b"\n"


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))
