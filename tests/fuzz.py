"""Hostile files, meshes, calls, commands and kills: ``python -m tests.fuzz --files 20000 --calls 10000 ...``.

Each stage runs in a forked child, which writes the number of its case to a file. If the child dies, the case
counts as a crash. If a case takes more processor time than the limit, or waits for long, it counts as a
hang. A new child goes on with the next case. An exception that is not of this project, or a warning, counts
as foreign. A case follows from the seed and its number.
"""

import argparse
import json
import logging
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image

import blobtree
import decals
from blobtree import Point
from blobtree.errors import ImplicitDecalsError
from blobtree.files import PREFIX, write_atomically
from blobtree.pyvista_views import write_polydata
from decals.editing import EditSession
from decals.rendering import Picture
from decals.surfaces import MeshSurface
from tests.bench.trust_windings import is_wrong
from tests.decals.editing.fuzz import RandomCommands
from tests.decals.editing.scenes import digest, scene
from tests.fuzz_calls import call_table, not_called
from tests.oracles.windings import KINDS
from tests.structured.formats import FORMATS, TURNS
from tests.structured.model import check
from tests.test_hostile_calls import CALLS, HUGE, PLY

HANG_SECONDS = 60.0
"""Processor time after which a case counts as hung; a process that reads by VTK has limits before."""

WAITING = 10.0
"""Times this limit on the clock, after which a case that does nothing counts as hung."""

START_SECONDS = 300.0
"""The same for the first case of a child, which may compile kernels."""

Case = Callable[[int], None]
"""Runs the case of a number; raises for a foreign exception or another failure."""


@dataclass
class Outcome:
    """Failed cases of a stage, by their kind."""

    crashes: list[int] = field(default_factory=list)
    hangs: list[int] = field(default_factory=list)
    foreign: list[str] = field(default_factory=list)


# -- files ----------------------------------------------------------------------------------------------

DAMAGED = Path(__file__).parent / "decals" / "surfaces" / "damaged"
TOKENS = [
    b"-1",
    b"0",
    b"1e400",
    b"nan",
    b"99999999999",
    b"4294967296",
    b"[" * 20_000,
    b"\xff\xfe",
    b"\0" * 20,
]


def corpus(folder: Path) -> list[Path]:
    """Write whole files of every kind that is read, and those that once broke a reader; return all."""
    ball = pv.Sphere(theta_resolution=6, phi_resolution=6)
    solid = ball.cast_to_unstructured_grid()
    for name, dataset, binary in (
        ("a.ply", ball, True), ("b.ply", ball, False), ("a.stl", ball, True), ("b.stl", ball, False),
        ("a.obj", ball, True), ("a.vtp", ball, True), ("b.vtp", ball, False), ("a.vtk", ball, True),
        ("b.vtk", ball, False), ("a.vtu", solid, True), ("b.vtu", solid, False),
    ):  # fmt: skip
        dataset.save(folder / name, binary=binary)
    picture = np.random.default_rng(0).integers(0, 255, (6, 5, 3), np.uint8)
    for suffix in ("png", "jpg", "webp", "tif", "bmp", "gif", "ppm", "tga"):
        Image.fromarray(picture).save(folder / f"a.{suffix}")
    tree = (Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=0.5)).rotate((0, 0, 1), 0.3)
    pressed = blobtree.SolidContact(
        (tree, Point((0, 2, 0), radius=1.5)), stiffness=(1.0, 2.0), names=("a", "b")
    )
    blobtree.save(pressed | blobtree.Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.2), folder / "tree.json")
    decals.save_scene(scene(8), folder / "scene.json")
    objects = (decals.MeshObject("ball", ball.points, ball.regular_faces, source=str(folder / "a.ply")),)
    images = (decals.DecalImage.load(str(folder / "a.png")),)
    named = decals.Scene(objects=objects, camera=decals.Camera((0, 0, 4), (0, 0, 0)), images=images)
    decals.save_scene(named, folder / "named.json")
    for number, text in enumerate(PLY.values()):
        (folder / f"odd-{number}.ply").write_text(text, encoding="ascii")
    for path in DAMAGED.iterdir():
        shutil.copy(path, folder / f"broke-{path.name}")
    (folder / "deep.json").write_bytes(b'{"format": "implicit-decals-scene", "objects": ' + b"[" * 100_000)
    return sorted(folder.iterdir())


def damage(content: bytes, other: bytes, chance: random.Random) -> bytes:
    """Cut, flip, remove, insert, renumber or splice bytes, up to three times."""
    data = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        place = chance.randrange(len(data) + 1)
        match chance.randrange(7):
            case 0:
                del data[place:]
            case 1:
                for _ in range(chance.randrange(1, 9)):
                    if data:
                        data[chance.randrange(len(data))] = chance.randrange(256)
            case 2:
                del data[place : place + chance.randrange(1, 80)]
            case 3:
                data[place:place] = chance.choice(TOKENS)
            case 4:
                numbers = list(re.finditer(rb"-?\d+(\.\d+)?", bytes(data[:100_000])))
                if numbers:
                    found = chance.choice(numbers)
                    data[found.start() : found.end()] = chance.choice(TOKENS)
            case 5:
                data[place:] = other[chance.randrange(len(other) + 1) :]
            case 6:
                header = bytes(data[:400]).lower()
                data[: len(header)] = header if chance.random() < 0.5 else header[::-1]
    return bytes(data)


def file_case(folder: Path, files: Sequence[Path], seed: int) -> Case:
    """Return the stage of files: whole ones first, then damaged ones, some under a wrong name."""
    contents = [path.read_bytes() for path in files]

    def run(number: int) -> None:
        chance = random.Random(f"{seed}:file:{number}")
        source = number if number < len(files) else chance.randrange(len(files))
        content = contents[source]
        suffix = files[source].suffix
        if number >= len(files):
            content = damage(content, chance.choice(contents), chance)
            if chance.random() < 0.03:
                suffix = chance.choice(files).suffix
        path = folder / f"case{suffix}"
        path.write_bytes(content)
        readers: list[Callable[[Path], object]] = [decals.load_model]
        if suffix == ".json":
            readers = [decals.load_model, decals.load_scene, blobtree.load]
        elif suffix in (".png", ".jpg", ".webp", ".tif", ".bmp", ".gif", ".ppm", ".tga"):
            readers = [lambda path: decals.load_image(str(path))]
        for read in readers:
            with suppress(ImplicitDecalsError):
                read(path)

    return run


def format_of(number: int) -> str:
    """Return the format of the generated file of a number."""
    return TURNS[number % len(TURNS)]


def structured_case(folder: Path, seed: int) -> Case:
    """Return the stage of generated files of all formats in turn; a misread one raises MisreadError."""
    logging.disable(logging.WARNING)  # of faces that are left out

    def run(number: int) -> None:
        name = format_of(number)
        check(FORMATS[name](random.Random(f"{seed}:{name}:{number}")), folder)

    return run


# -- windings -------------------------------------------------------------------------------------------


def winding_case(seed: int) -> Case:
    """Return the stage of windings: solids of known windings in turn with damaged ones.

    A damaged one keeps its triangles, and is not turned again once it has been turned.
    """
    kinds = list(KINDS)
    logging.disable(logging.WARNING)  # of faces that are turned

    def run(number: int) -> None:
        rng = np.random.default_rng([seed, number])
        case = KINDS[kinds[number // 2 % len(kinds)]](rng)
        if number % 2 == 0:
            if is_wrong(case):
                raise AssertionError(f"{case.kind}: not the windings of the solid")
            return
        vertices, faces = damaged_solid(*case.arrays(right=False), rng)
        try:
            surface = MeshSurface(vertices, faces)
        except ImplicitDecalsError:
            return
        if not np.array_equal(np.sort(surface.faces, axis=1), np.sort(faces, axis=1)):
            raise AssertionError(f"{case.kind}: other triangles than in the file")
        if not np.array_equal(MeshSurface(surface.vertices, surface.faces).faces, surface.faces):
            raise AssertionError(f"{case.kind}: turned a second time")

    return run


def damaged_solid(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Drop, turn, copy and tear faces, and flatten, scale, move and break vertices, up to three times."""
    vertices, faces = vertices.copy(), faces.copy()
    for _ in range(rng.integers(1, 4)):
        some = rng.random(len(faces)) < rng.choice([0.02, 0.2, 0.5])
        match rng.integers(9):
            case 0:
                faces = faces[~some]
            case 1:
                faces[some] = faces[some, ::-1]
            case 2:
                faces = np.concatenate([faces, faces[some]])
            case 3:
                vertices[:, rng.integers(3)] *= rng.choice([0.0, 1e-6, 1e-3])
            case 4:
                vertices *= 10.0 ** rng.uniform(-15, 15)
            case 5:
                vertices += 10.0 ** rng.uniform(0, 6) * rng.normal(size=3)
            case 6:
                faces[some, 1] = faces[some, 0]
            case 7:
                faces[some, rng.integers(3)] = rng.integers(len(vertices))
            case 8:
                vertices[rng.integers(len(vertices))] = rng.choice([np.nan, np.inf, 1e300, 0.0])
    return vertices, faces


# -- calls ----------------------------------------------------------------------------------------------

ODD: list[Any] = [
    None, True, -1, 0, 1.5, HUGE, -HUGE, 1e308, 5e-324, float("nan"), float("inf"), 1j, "", "x",
    "\ud800", "a\0b", b"\xff", [], [[]], {}, (), set(), object(), int, range(3), np.zeros(0),
    np.zeros((2, 3)), np.zeros((3, 3, 3)), np.full((4, 3), np.nan), np.array("x"), np.array([None]), [0,
    0, np.inf], [0, 0, HUGE], [[0, 0, 0]], [1, "x"], np.zeros(3, complex), np.array([], object),
    "cuda:9", Path("nothing.ply"), lambda: 1, -0.0, [1e30, 0, 0],
]  # fmt: skip
"""Values of no use for most arguments."""


def call_case(seed: int) -> Case:
    """Return the stage of calls: the listed ones, then functions with one or two odd arguments."""
    listed, table = list(CALLS.values()), call_table()
    names = list(table)

    def run(number: int) -> None:
        if number < len(listed):
            with suppress(ImplicitDecalsError):
                listed[number]()
            return
        chance = random.Random(f"{seed}:call:{number}")
        name = chance.choice(names)
        function, arguments = table[name]
        odd = chance.sample(list(arguments), min(len(arguments), chance.choice((1, 1, 2))))
        chosen = {key: chance.choice(ODD) for key in odd}
        try:
            function(**{**arguments, **chosen})
        except ImplicitDecalsError:
            pass
        except BaseException as error:
            error.add_note(f"{name}({', '.join(f'{key}={_short(value)}' for key, value in chosen.items())})")
            raise

    return run


def _short(value: object) -> str:
    try:
        return f"{value!r:.50}"
    except ValueError:
        return "a long number"


# -- commands -------------------------------------------------------------------------------------------


def command_case(seed: int) -> Case:
    """Return the stage of commands: random ones; a refused one leaves the document as it was."""
    start = scene()
    session = EditSession(start)
    state: dict[str, Any] = {"session": session, "monkey": None}

    def run(number: int) -> None:
        if state["monkey"] is None or number % 500 == 0:
            state["session"] = EditSession(start)
            state["monkey"] = RandomCommands(seed + number, state["session"].document, scene(200).decals)
        session, monkey = state["session"], state["monkey"]
        chance = monkey.rng.random()
        if chance < 0.1:
            session.undo()
        elif chance < 0.15:
            session.redo()
        command = monkey.command()
        before = digest(session.document)
        try:
            session.do(command)
        except ImplicitDecalsError:
            if digest(session.document) != before:
                raise AssertionError(f"{command!r:.100} was refused but changed the document") from None

    return run


# -- kills ----------------------------------------------------------------------------------------------


def torn_files(folder: Path, kills: int, seed: int) -> list[str]:
    """Kill children while they save files in turn, or let their disk be full; return what is torn."""
    surfaces = [Point((0, 0, 0), radius=1.0).to_pyvista(resolution=cells) for cells in (24, 40)]
    scenes = [scene(8), scene(60)]
    trees = [Point((0, 0, 0), radius=radius) for radius in (1.0, 2.0)]
    noise = np.random.default_rng(0).integers(0, 255, (2, 64, 64, 4), np.uint8)
    writers: dict[str, Callable[[Path, int], object]] = {
        "scene.json": lambda path, turn: decals.save_scene(scenes[turn], path),
        "tree.json": lambda path, turn: blobtree.save(trees[turn], path),
        "picture.png": lambda path, turn: Picture(noise[turn]).save(path),
        "bytes.bin": lambda path, turn: write_atomically(path, noise[turn].tobytes() * 50),
        **{f"mesh.{suffix}": lambda path, turn: write_polydata(path, surfaces[turn]) for suffix in MESHES},
    }
    for name, write in writers.items():
        for turn in (0, 1):
            write(folder / f"{turn}-{name}", turn)
    whole = {name: {(folder / f"{turn}-{name}").read_bytes() for turn in (0, 1)} for name in writers}
    torn: list[str] = []
    for number in range(kills):
        chance = random.Random(f"{seed}:kill:{number}")
        full = number % 4 == 3
        child = os.fork()
        if child == 0:
            try:
                if full:
                    limit = chance.choice((0, 1, 100, 4096, chance.randrange(60_000)))
                    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
                for turn in range(2 if full else 1_000_000):
                    for name, write in chance.sample(sorted(writers.items()), len(writers)):
                        with suppress(OSError, ImplicitDecalsError):
                            write(folder / name, turn % 2)
            finally:
                os._exit(0)
        if not full:
            time.sleep(chance.uniform(0.0, 0.15))
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if full and status != 0:
            torn.append(f"kill {number}: a full disk ended the process with {status}")
        for name, contents in whole.items():
            path = folder / name
            if path.exists() and path.read_bytes() not in contents:
                torn.append(f"kill {number}: {name}")
    write_atomically(folder / "last.bin", b"")
    torn += [f"left behind: {path.name}" for path in folder.iterdir() if path.name.startswith(PREFIX)]
    return torn


MESHES = ("ply", "obj", "stl", "vtp")

# -- stages ---------------------------------------------------------------------------------------------


def run_stage(make: Callable[[Path], Case], count: int, folder: Path, first: int = 0) -> Outcome:
    """Run the cases from ``first`` to below ``count`` in children, which end at a crash or a hang."""
    outcome = Outcome()
    state, report = folder / "state", folder / "report"
    report.touch()
    while first < count:
        state.write_text("-1", encoding="ascii")
        child = os.fork()
        if child == 0:
            _run_cases(make, first, count, folder, state, report)
        first = _watch(child, state, first, outcome)
    outcome.foreign = report.read_text(encoding="utf-8", errors="replace").splitlines()
    return outcome


def _run_cases(
    make: Callable[[Path], Case], first: int, count: int, folder: Path, state: Path, report: Path
) -> None:
    """Run cases in this child, and end it."""
    status = 1
    try:
        os.setsid()
        warnings.simplefilter("error")
        work = folder / "work"
        work.mkdir(exist_ok=True)
        os.chdir(work)
        case = make(work)
        with state.open("r+b", buffering=0) as file, report.open("a", encoding="utf-8") as lines:
            for number in range(first, count):
                os.pwrite(file.fileno(), b"%-12d" % number, 0)
                try:
                    case(number)
                except BaseException as error:
                    frame = traceback.extract_tb(error.__traceback__)[-1]
                    notes = " ".join(getattr(error, "__notes__", []))
                    text = f"{number}: {type(error).__name__}: {error!s:.150} {notes}".split()
                    lines.write(" ".join(text) + f" [{Path(frame.filename).name}:{frame.lineno}]\n")
                    lines.flush()
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status)


def _busy_seconds(child: int) -> float:
    """Return the processor time of a process (Linux); 0 once it has ended."""
    try:
        fields = Path(f"/proc/{child}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:13])) / float(os.sysconf("SC_CLK_TCK"))


def _watch(child: int, state: Path, first: int, outcome: Outcome) -> int:
    """Wait for a child; return the first case of the next one."""
    number, since, busy = "", time.monotonic(), 0.0
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        text = state.read_text(encoding="ascii").strip()
        if text != number:
            number, since, busy = text, time.monotonic(), _busy_seconds(child)
        if ended and status == 0:
            return sys.maxsize
        case = int(number or -1)
        if ended:
            if case < 0:
                raise RuntimeError("a child of the fuzzer ended before its first case")
            outcome.crashes.append(case)
            return case + 1
        limit = HANG_SECONDS if case > first else START_SECONDS
        if _busy_seconds(child) - busy > limit or time.monotonic() - since > WAITING * limit:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            outcome.hangs.append(case)
            return case + 1
        time.sleep(0.02)


def fuzz(
    *,
    files: int,
    calls: int,
    commands: int,
    kills: int,
    seed: int,
    structured: int = 0,
    windings: int = 0,
) -> dict[str, Any]:
    """Run all stages; return the number of failures of each kind, and their descriptions."""
    stages: dict[str, Outcome] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for stage in ("corpus", "files", "structured", "windings", "calls", "commands", "kills"):
            (folder / stage).mkdir()
        paths = corpus(folder / "corpus")
        stages["files"] = run_stage(lambda work: file_case(work, paths, seed), files, folder / "files")
        stages["structured"] = run_stage(
            lambda work: structured_case(work, seed), structured, folder / "structured"
        )
        stages["windings"] = run_stage(lambda _: winding_case(seed), windings, folder / "windings")
        stages["calls"] = run_stage(lambda _: call_case(seed), calls, folder / "calls")
        stages["commands"] = run_stage(lambda _: command_case(seed), commands, folder / "commands")
        torn = torn_files(folder / "kills", kills, seed) if kills else []
    return {
        "fuzz_crashes": sum(len(outcome.crashes) for outcome in stages.values()),
        "fuzz_hangs": sum(len(outcome.hangs) for outcome in stages.values()),
        "fuzz_foreign": sum(len(outcome.foreign) for outcome in stages.values()),
        "fuzz_torn": len(torn),
        "seeded": seed,
        "cases": {
            "files": files,
            "structured": structured,
            "windings": windings,
            "calls": calls,
            "commands": commands,
            "kills": kills,
        },
        "not_called": not_called() if calls else [],
        "failures": {name: vars(outcome) for name, outcome in stages.items()} | {"torn": torn},
    }


def main() -> int:
    """Run the fuzzer with the budget of the command line; the exit code is 1 after a failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    budget = {"files": 2000, "structured": 2000, "windings": 500, "calls": 2000, "commands": 500, "kills": 20}
    for name, count in budget.items():
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="print the figures and failures as JSON")
    options = parser.parse_args()
    figures = fuzz(
        files=options.files,
        structured=options.structured,
        windings=options.windings,
        calls=options.calls,
        commands=options.commands,
        kills=options.kills,
        seed=options.seed,
    )
    keys = [key for key in figures if key.startswith("fuzz_")]
    if options.json:
        print(json.dumps(figures, indent=1))
    else:
        print("\n".join(f"{key:14} {figures[key]}" for key in [*keys, "not_called"]))
        for name, failures in figures["failures"].items():
            print(f"{name}: {failures}")
    return int(any(figures[key] for key in keys))


if __name__ == "__main__":
    sys.exit(main())
