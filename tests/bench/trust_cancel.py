"""Long work of the sandbox, cancelled at random moments: until the page is free, until the work has ended.

``cancel_max_ms`` is the slowest time from Escape until the page has carried out another edit, while no work
runs any more. ``cancel_stop_max_ms`` is the slowest time until the thread of the work has ended, too.

    python -m tests.bench.trust_cancel
    python -m tests.bench.trust_cancel --quick
    python -m tests.bench.trust_cancel --works mesh,bake --moments 5 --seed 3   # a part of it
"""

import argparse
import asyncio
import json
import random
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

import decals
from blobtree import Point, Progress, Sum, polygonize
from decals import bake
from decals.baking.atlas import unwrap
from decals.baking.meshes import bake_mesh
from decals.editing import RelaxDecals
from decals.window import EditWindow
from tests.apps.sandbox.browsers import Browser, Connect, serve

TARGETS = {"cancel_max_ms": "≤ 500", "cancel_cases": "≥ 450"}

MOMENTS, QUICK_MOMENTS = 50, 2
"""Random moments at which each work is cancelled."""

PATIENCE = 300.0
"""Seconds after which work that does not end is an error."""

CANCELLED = "cancelled"
"""Message of a window that has cancelled work."""

LOOK_SECONDS = 0.002
"""Time between two looks at the session."""

READ_FILE = "large.vtk"
"""A mesh file in the folder, which a child process reads."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of the work."""

    decals: int
    primitives: int
    resolution: int
    texels: int
    grid: int
    picture: str
    video: str


FULL = Sizes(6000, 200, 256, 2048, 400, "1200 x 900", "160 x 120")
QUICK = Sizes(1500, 100, 160, 512, 120, "300 x 200", "40 x 30")


class Work:
    """Starts long work of a page, by its name.

    Parameters
    ----------
    window, page, browser
        The served page, and the connection of its browser.
    folder
        Folder of the page's files.
    sizes
        Sizes of the work.
    """

    def __init__(self, window: EditWindow, page: Any, browser: Browser, folder: Path, sizes: Sizes) -> None:
        self._window, self._page, self._browser = window, page, browser
        self._folder, self._sizes = folder, sizes
        rng = np.random.default_rng(5)
        places = rng.uniform(-1.0, 1.0, (sizes.primitives, 3)).tolist()
        self._tree = Sum(*(Point(place, radius=0.2) for place in places))
        grid = pv.Plane(i_resolution=sizes.grid, j_resolution=sizes.grid).triangulate()
        grid.points[:, 2] = rng.normal(0.0, 0.01, grid.n_points)
        grid.save(folder / READ_FILE, binary=False)
        # The works that open another scene come last.
        self.starts: dict[str, Callable[[], Awaitable[None]]] = {
            "scatter": self._scatter,
            "relax": self._relax,
            "mesh": self._mesh,
            "bake": self._bake,
            "unwrap": self._unwrap,
            "picture": lambda: self._write("picture.png", sizes.picture),
            "video": lambda: self._write("video.gif", sizes.video),
            "reader": lambda: self._trigger(self._page.sandbox.open_file, READ_FILE),
            "cover": lambda: self._trigger(self._page.sandbox.open_sample, "creature"),
        }

    async def _trigger(self, event: Callable[..., Any], *arguments: Any) -> None:
        await self._browser.trigger(event, *arguments)

    async def _scatter(self) -> None:
        await self._trigger(self._page.sandbox.set_control, "scattering", "count", self._sizes.decals)
        await self._trigger(self._page.sandbox.scatter)

    async def _relax(self) -> None:
        command = RelaxDecals((0.0, 0.0, 0.0), radius=100.0)
        self._page.sandbox.attempt(lambda: self._window.actions.state.run(command))

    async def _mesh(self) -> None:
        def mesh(report: Progress) -> None:
            polygonize(self._tree, resolution=self._sizes.resolution, progress=report)

        self._export("mesh", mesh)

    async def _bake(self) -> None:
        scene, path = self._window.document.fork().scene, self._folder / "baked.glb"

        def write(report: Progress) -> None:
            bake(scene, path, size=self._sizes.texels, progress=report)

        self._export("bake", write)

    async def _unwrap(self) -> None:
        ball = pv.Sphere(theta_resolution=self._sizes.grid, phi_resolution=self._sizes.grid)
        item = decals.MeshObject("ball", ball.points, ball.regular_faces)

        def flatten(report: Progress) -> None:
            unwrap([bake_mesh(item, resolution=None, creases=False, report=report)], 1024, report)

        self._export("unwrap", flatten)

    def _export(self, label: str, write: Callable[[Progress], None]) -> None:
        """Do work as an export of the page."""
        self._page.sandbox.attempt(lambda: self._window.background.write(label, write, f"did {label}"))

    async def _write(self, name: str, size: str) -> None:
        await self._trigger(self._page.sandbox.write_file, name, True, size)


class Cancelling:
    """Cancels work, and measures what follows.

    Attributes
    ----------
    free, stopped
        Milliseconds until the page was free and until the work had ended, by the name of the work.
    """

    def __init__(self, window: EditWindow, page: Any, browser: Browser, work: Work) -> None:
        self._window, self._page, self._browser, self._work = window, page, browser, work
        self._contacts = 0
        self.free: dict[str, list[float]] = {}
        self.stopped: dict[str, list[float]] = {}

    async def run(self, works: Sequence[str], moments: int, seed: int, report: Callable[[str], None]) -> None:
        """Cancel each of some works at so many random moments."""
        rng = random.Random(seed)
        for name, start in self._work.starts.items():
            if name not in works:
                continue
            began = time.perf_counter()
            await start()
            await self._until(lambda: not self._window.background.busy)
            seconds = time.perf_counter() - began
            refusal = self._window.actions.state.refusal
            if refusal:
                raise RuntimeError(f"{name}: {refusal}")
            self.free[name], self.stopped[name] = [], []
            while len(self.free[name]) < moments:  # work that has ended by itself does not count
                await self._escape()  # nothing is selected
                await start()
                await asyncio.sleep(rng.uniform(0.0, seconds))
                await self._cancel(name)
            worst = round(max(self.free[name])), round(max(self.stopped[name]))
            report(f"{name}: {seconds:.1f} s; at most {worst[0]} ms until free, {worst[1]} ms until it ended")

    async def _escape(self) -> None:
        await self._browser.trigger(self._page.sandbox.perform, "deselect")

    async def _cancel(self, name: str) -> None:
        """Press Escape, make another edit, and wait until the work has ended, unless it had ended before."""
        background, session = self._window.background, self._window.session
        entries = len(session.labels)
        began = time.perf_counter()
        await self._escape()
        if self._window.actions.state.message != CANCELLED:
            await self._until(lambda: not background.busy)
            return
        self._contacts += 1
        contact = ("product", "min")[self._contacts % 2]
        await self._browser.trigger(self._page.sandbox.set_control, "drawing", "contact", contact)
        await self._until(lambda: session.document.drawing.contact.name.lower() == contact)
        await self._until(lambda: not background.busy)
        self.free[name].append(1000.0 * (time.perf_counter() - began))
        await self._until(lambda: not background.stopping)
        self.stopped[name].append(1000.0 * (time.perf_counter() - began))
        after = session.labels[entries:]
        if after not in (("set contact",), ()):  # an entry more would be that of the cancelled work
            raise RuntimeError(f"{name}: cancelled work became {after}")

    @staticmethod
    async def _until(true: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not true():
                await asyncio.sleep(LOOK_SECONDS)


def measure(
    *,
    quick: bool,
    works: Sequence[str] = (),
    moments: int | None = None,
    seed: int = 7,
    report: Callable[[str], None] = lambda _: None,
) -> dict[str, float]:
    """Cancel work at random moments in a served page, and return the figures; all work, if none is named."""
    count, figures = moments or (QUICK_MOMENTS if quick else MOMENTS), dict[str, float]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        async def check(window: EditWindow, page: Any, connect: Connect) -> None:
            browser = await connect()
            work = Work(window, page, browser, folder, QUICK if quick else FULL)
            chosen = works or tuple(work.starts)
            if unknown := set(chosen) - set(work.starts):
                raise SystemExit(f"expected works among {', '.join(work.starts)}, got {', '.join(unknown)}")
            cancelling = Cancelling(window, page, browser, work)
            await cancelling.run(chosen, count, seed, report)
            await browser.close()
            for name in chosen:
                figures[f"cancel_{name}_ms"] = max(cancelling.free[name])
                figures[f"cancel_stop_{name}_ms"] = max(cancelling.stopped[name])
            figures["cancel_cases"] = sum(map(len, cancelling.free.values()))
            figures["cancel_max_ms"] = max(map(max, cancelling.free.values()))
            figures["cancel_stop_max_ms"] = max(map(max, cancelling.stopped.values()))

        serve(check, folder=folder)
    return {name: round(value, 1) for name, value in figures.items()}


def main() -> None:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="small work, cancelled twice")
    parser.add_argument("--works", default="", help="names of works, with commas between them")
    parser.add_argument("--moments", type=int, help=f"moments of each work, {MOMENTS} unless --quick")
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    figures = measure(
        quick=options.quick,
        works=tuple(filter(None, options.works.split(","))),
        moments=options.moments,
        seed=options.seed,
        report=lambda line: print(line, file=sys.stderr),
    )
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
