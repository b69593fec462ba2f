"""The command ``implicit-decals``: argument parsing and one-line error messages.

This module imports nothing heavy, so ``--help`` and ``--version`` are fast.
"""

import gc
import sys
import warnings
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import App, CycloptsError, MissingArgumentError, UnusedCliTokensError
from rich.console import Console
from rich.markup import escape

from blobtree.errors import UnusableFile
from decals.errors import ImplicitDecalsError

BAD_INPUT = 2
INTERRUPTED = 130

COLLECTED_OBJECTS = 200_000
"""Number of new objects after which Python looks for cycles; with its default, 700, it takes longer."""

HELP = {
    "demo": """Draw three pictures that show the method.

For example:

implicit-decals demo

implicit-decals demo --output pictures
""",
    "render": """Cover models with decals and draw a picture.

All models share one coordinate system. Decals continue from one model to another where they touch.

For example:

implicit-decals render knot --decals 800 -o knot.png

implicit-decals render bunny.ply blob.json --image scale --image rock -o both.png

implicit-decals render dragon --decals 1000 --camera 1,0.4,1 --save dragon.json -o dragon.png

implicit-decals render dragon.json --size 2400x1800 -o large.png
""",
    "animate": """Draw a turntable, or a scene in a sequence of poses.

For example:

implicit-decals animate knot --decals 800 -o turn

implicit-decals animate scene.json --frames 60 -o turn.gif

implicit-decals animate scene.json --poses walk.py -o walk.mp4

implicit-decals animate scene.json --meshes walk_1.ply walk_2.ply walk_3.ply -o walk
""",
    "edit": """Open models or a scene in an editor window.

For example:

implicit-decals edit knot --decals 300 --image scale --image eye --save knot.json

implicit-decals edit knot.json --images moss.png

implicit-decals edit
""",
    "sandbox": """Open models or a scene in the sandbox, a page in the browser.

For example:

implicit-decals sandbox

implicit-decals sandbox knot --decals 300 --save knot.json

implicit-decals sandbox knot.json

implicit-decals sandbox --lab
""",
    "lessons": """Write lessons of the contact lab as HTML pages, which need no server and no network.

For example:

implicit-decals lessons -o pages

implicit-decals lessons -o pages --language en --language de

implicit-decals lessons my-lessons -o pages
""",
    "scatter": """Scatter decals over models and write a scene, or a table of decals.

All models share one coordinate system. Decals of different models push each other where the models touch.

For example:

implicit-decals scatter knot --count 2000 -o scene.json

implicit-decals render scene.json -o picture.png

implicit-decals scatter bunny.ply --spacing 0.02 --sizing touching --along curvature -o decals.csv
""",
    "measure": """Measure how the decals of a saved scene lie: coverage, stretch, folds, contact lines.

For example:

implicit-decals measure scene.json

implicit-decals measure scene.json --contact elastic --json

implicit-decals measure bunny.ply --table decals.csv
""",
    "figure": """Write contact lines, rims and silhouettes of a saved scene in SVG or PDF.

For example:

implicit-decals figure scene.json -o figure.svg

implicit-decals figure scene.json -o figure.pdf --width 240 --height 180 --contact-width 1.2 --picture
""",
    "sweep": """Run an experiment: a function for each trial of a design, with results that resume.

A file defines the function `experiment` and the design `design`; see the page on experiments.
Shipped experiments are found by their names.

For example:

implicit-decals sweep --list

implicit-decals sweep blends --out results

implicit-decals sweep overlap.py --out results --workers 8 --limit 600 --retry

implicit-decals sweep overlap.py --out /shared/results --scheduler tcp://10.0.0.1:8786
""",
    "report": """Write the results of an experiment as a page, or one figure or table of them.

For example:

implicit-decals report results -o report.html

implicit-decals report results -o bulge.svg --measure bulge --by angle,blend

implicit-decals report results -o table.md --by blend
""",
    "reproduce": """Make what a file holds again from its recipe, and say what differs.

For example:

implicit-decals reproduce scene.json

implicit-decals reproduce picture.png --scene scene.json

implicit-decals reproduce model.glb
""",
    "polygonize": """Write the surface of an implicit model as a triangle mesh.

For example:

implicit-decals polygonize spheres -o spheres.ply

implicit-decals polygonize blob.json --cell-size 0.02 -o blob.obj

implicit-decals polygonize part.json --chord-error 0.001 --creases -o part.stl
""",
    "bake": """Write a scene as a GLB file, with the decals in a texture or in vertex colours.

For example:

implicit-decals bake scene.json -o model.glb --size 4096

implicit-decals bake scene.json -o small.glb --vertex-colors
""",
    "export": """Write a scene as a file of another program, or check a mesh file.

For example:

implicit-decals export scene.json -o model.gltf --size 4096

implicit-decals export scene.json -o model.ply --attribute owner --attribute field

implicit-decals export blob.json -o blob.vti --distance

implicit-decals export --check model.ply
""",
    "displace": """Write the surface of a scene, moved by the heights of its decals, as a mesh.

For example:

implicit-decals displace scene.json -o scales.glb

implicit-decals displace scene.json -o scales.ply --edge-length 0.005
""",
    "gallery": """List the examples, or draw their pictures.

For example:

implicit-decals gallery

implicit-decals gallery sphere -o sphere.png

implicit-decals gallery --all -o pictures
""",
    "doctor": "Check the software and hardware of this machine, and print advice.",
}

BENCH_TABLE = """Measure figure 14 of the paper on this machine, and print it beside the paper's numbers.

For example:

implicit-decals bench table --size 800x600 --counts 100,1000 --models knot,spheres
"""
"""The text for ``implicit-decals bench table``."""

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
app.register_install_completion_command(
    help="Install completion of commands and options for your shell: bash, zsh, fish or PowerShell."
)


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
    except UnusableFile as error:
        return _print_error(str(error))
    except OSError as error:
        return _print_error(f"{error.strerror or error}: {error.filename or 'a file'}")
    except UnusedCliTokensError as error:
        words = " ".join(error.unused_tokens or ())
        return _print_error(
            f"expected one value for each option, such as --size 800x600, got also {words!r}; "
            "leave it out, or put a value with spaces in quotes"
        )
    except MissingArgumentError as error:
        return _print_error(_missing_text(error))
    except (CycloptsError, ImplicitDecalsError) as error:  # any other is a bug: it shows its traceback
        return _print_error(str(error))
    return result if isinstance(result, int) else 0


def _missing_text(error: MissingArgumentError) -> str:
    """Return what to add to a command: its model or scene, an option such as ``-o FILE``, or a value."""
    command = " ".join(error.command_chain or ())
    names = error.argument.names if error.argument is not None else ()
    if error.keyword is not None or not names:
        return f"{command}: missing a value after {error.keyword or 'the last option'}"
    name = min(names, key=len)
    return f"{command}: missing {name}{' FILE' if name == '-o' else ''}; see implicit-decals {command} --help"


def _print_error(message: str) -> int:
    """Print a message as one line on stderr; return the exit code."""
    _print_line("red", "error", message)
    return BAD_INPUT


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning as one line on stderr, without the line of code that it comes from."""
    _print_line("yellow", "warning", str(message))


def _print_line(color: str, kind: str, message: str) -> None:
    line = " ".join(message.split())
    Console(stderr=True, soft_wrap=True).print(f"[bold {color}]{kind}:[/] {escape(line)}", highlight=False)


def main() -> None:
    """Run the command line and exit with its code."""
    gc.set_threshold(COLLECTED_OBJECTS)
    warnings.showwarning = _print_warning
    try:
        sys.exit(run())
    finally:
        gc.freeze()  # else Python looks for cycles among all objects before it ends, which takes a second


if __name__ == "__main__":
    main()
