"""The command ``implicit-decals``: argument parsing, and errors as one line each.

Nothing heavy is imported here, so that ``--help`` and ``--version`` answer at once.
"""

import sys
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import App, CycloptsError
from rich.console import Console
from rich.markup import escape

from .commands.help_texts import BENCH_TABLE, HELP
from .errors import UsageError

BAD_INPUT = 2
INTERRUPTED = 130

app = App(
    name="implicit-decals",
    help="Cover meshes and implicit models with decals that touch, push and deform each other.",
    version=lambda: version("implicit-decals"),
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
for _name, _help in HELP.items():
    app.command(f"implicit_decals.apps.commands.{_name}:{_name}", name=_name, help=_help)

_bench = App(name="bench", help="Measure this machine.", help_format="plaintext")
_bench.command("implicit_decals.apps.commands.bench:table", name="table", help=BENCH_TABLE)
app.command(_bench)


def run(tokens: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    tokens : sequence of str, optional
        The arguments; those of the process if not given.

    Returns
    -------
    int
        0 if all went well, 2 for input that cannot be used, 130 if interrupted, else the command's own code.
    """
    try:
        result = app(tokens, print_error=False, exit_on_error=False, result_action="return_value")
    except KeyboardInterrupt:
        Console(stderr=True).print("interrupted")
        return INTERRUPTED
    except OSError as error:
        return _complain(f"{error.strerror or error}: {error.filename or 'a file'}")
    except Exception as error:  # which kinds are bad input is asked only now: their imports take a second
        if not isinstance(error, _bad_input()):
            raise  # a bug: its traceback is what we want to see
        return _complain(str(error))
    return result if isinstance(result, int) else 0


def _bad_input() -> tuple[type[Exception], ...]:
    """Give the errors that mean bad input; their packages are loaded by now, or failed to."""
    from blobtree import BlobTreeError
    from decals.errors import DecalsError

    return CycloptsError, UsageError, DecalsError, BlobTreeError


def _complain(message: str) -> int:
    line = " ".join(message.split())
    Console(stderr=True, soft_wrap=True).print(f"[bold red]error:[/] {escape(line)}", highlight=False)
    return BAD_INPUT


def main() -> None:
    """Entry point of the command."""
    sys.exit(run())
