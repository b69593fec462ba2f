"""The command ``implicit-decals``: argument parsing and one-line error messages.

This module imports nothing heavy, so ``--help`` and ``--version`` are fast.
"""

import sys
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import App, CycloptsError
from rich.console import Console
from rich.markup import escape

from decals.apps.commands.help_texts import BENCH_TABLE, HELP
from decals.apps.errors import UsageError

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
    app.command(f"decals.apps.commands.{_name}:{_name}", name=_name, help=_help)

_bench = App(name="bench", help="Measure this machine.", help_format="plaintext")
_bench.command("decals.apps.commands.bench:table", name="table", help=BENCH_TABLE)
app.command(_bench)


def run(tokens: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    tokens : sequence of str, optional
        The arguments. Default: those of the process.

    Returns
    -------
    int
        The exit code: 0 for success, 2 for invalid input, 130 for an interrupt, else that of the command.
    """
    try:
        result = app(tokens, print_error=False, exit_on_error=False, result_action="return_value")
    except KeyboardInterrupt:
        Console(stderr=True).print("interrupted")
        return INTERRUPTED
    except OSError as error:
        return _print_error(f"{error.strerror or error}: {error.filename or 'a file'}")
    except Exception as error:  # the errors of invalid input are imported only now, as that takes a second
        if not isinstance(error, _input_errors()):
            raise  # a bug: show its traceback
        return _print_error(str(error))
    return result if isinstance(result, int) else 0


def _input_errors() -> tuple[type[Exception], ...]:
    """Return the exceptions that report invalid input."""
    from blobtree import ImplicitDecalsError

    return CycloptsError, UsageError, ImplicitDecalsError


def _print_error(message: str) -> int:
    """Print a message as one line on stderr; return the exit code."""
    line = " ".join(message.split())
    Console(stderr=True, soft_wrap=True).print(f"[bold red]error:[/] {escape(line)}", highlight=False)
    return BAD_INPUT


def main() -> None:
    """Run the command line and exit with its code."""
    sys.exit(run())
