"""A user's own kinds of nodes for the command line: modules whose import defines them."""

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from ..errors import UsageError


def import_definitions(modules: Sequence[str] | None) -> None:
    """Import what ``--define`` names: files of Python, or modules by their dotted names.

    Modules are found as from a script in the working folder, what a file imports as from one beside it.

    Raises
    ------
    UsageError
        If there is none such, or it fails; the message names file and line.
    """
    for module in modules or ():
        try:
            _imported(module)
        except UsageError:
            raise
        except (Exception, SystemExit) as error:
            raise UsageError(f"--define {module}: {_place(error)}{type(error).__name__}: {error}") from error


def _imported(module: str) -> ModuleType:
    path = Path(module)
    if path.suffix != ".py":
        _look_in(Path.cwd())
        return importlib.import_module(module)
    if not path.is_file():
        raise UsageError(f"--define: expected a file of Python or the name of a module, found no {module!r}")
    _look_in(path.resolve().parent)
    name = path.stem if path.stem not in sys.modules else f"defined_by_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None
    assert spec.loader is not None
    made = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(made)
    except BaseException:
        del sys.modules[name]
        raise
    return made


def _look_in(folder: Path) -> None:
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _place(error: BaseException) -> str:
    """Where the module stands that failed, unless the error says so or nothing of it was run."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.name == "<module>"]
    known = not frames or frames[-1].filename in str(error)
    return "" if known else f"{frames[-1].filename}:{frames[-1].lineno}: "
