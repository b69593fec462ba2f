"""Custom nodes on the command line: modules whose import defines them."""

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from decals.apps.errors import UsageError


def import_definitions(modules: Sequence[str] | None) -> None:
    """Import the modules of ``--define``: Python files, or dotted names of modules.

    Dotted names are searched in the working folder too, imports of a file in its own folder too.

    Raises
    ------
    UsageError
        If a module is missing or raises an error; the message names file and line.
    """
    for module in modules or ():
        try:
            _imported(module)
        except UsageError:
            raise
        except (Exception, SystemExit) as error:
            raise UsageError(
                f"--define {module}: {_location(error)}{type(error).__name__}: {error}"
            ) from error


def _imported(module: str) -> ModuleType:
    path = Path(module)
    if path.suffix != ".py":
        _add_search_path(Path.cwd())
        return importlib.import_module(module)
    if not path.is_file():
        raise UsageError(
            f"--define: expected a Python file or the name of a module, found no file {module!r}"
        )
    _add_search_path(path.resolve().parent)
    name = path.stem if path.stem not in sys.modules else f"defined_by_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None
    assert spec.loader is not None
    definitions = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(definitions)
    except BaseException:
        del sys.modules[name]
        raise
    return definitions


def _add_search_path(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _location(error: BaseException) -> str:
    """Return "file:line: " of the failed statement, or "" if the message names it or no statement ran."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.name == "<module>"]
    known = not frames or frames[-1].filename in str(error)
    return "" if known else f"{frames[-1].filename}:{frames[-1].lineno}: "
