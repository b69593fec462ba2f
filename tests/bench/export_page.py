"""Pages of scenes: their size, the first frame, a step of a drag, and their pixels beside pictures.

Needs Chromium and playwright, as ``tests/frontends`` does.
"""

import asyncio
from typing import Any

import numpy as np
import pyvista as pv

import decals
from decals import Scene
from decals.pages import page
from tests.decals.pages.viewer_scripts import VIEWER
from tests.frontends import in_html_page as browser

TARGETS = {
    "html_pixels_equal": 0.995,
    "html_mb": 3.0,
    "html_first_s": 2.0,
    "html_drag_ms": 8.0,
    "html_lines": 900,
}
"""Least share of equal pixels; most of the others."""

SIZE = 800, 600
STEPS = 50

FIRST_FRAME = """() => performance.getEntriesByName("first frame")[0].startTime / 1000"""

FINISH = """const { gl } = viewer.painter;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));"""
"""Wait until the picture that a viewer drew last is there."""

DRAG = """(steps) => {
  const times = [], draws = [];
  viewer.set({ selected: 0 });
  for (let i = 0; i < steps; i++) {
    const start = performance.now();
    const hit = viewer.pick(0.3 * Math.sin(i), 0.3 * Math.cos(i)).surface;
    if (hit) viewer.moveTo(hit, { open: i > 0 });
    times.push(performance.now() - start);
    const drawn = performance.now();
    viewer.draw();
    FINISH
    draws.push(performance.now() - drawn);
  }
  const median = (values) => values.sort((a, b) => a - b)[Math.floor(values.length / 2)];
  return [median(times), median(draws)];
}""".replace("FINISH", FINISH)


def sphere_scene(count: int, *, faces: int) -> Scene:
    """Return decals on a bumpy ball of some triangles."""
    side = round((faces / 2) ** 0.5)
    ball = pv.Sphere(theta_resolution=side, phi_resolution=side)
    ball.points *= 1 + 0.05 * np.sin(9 * ball.points)
    return decals.cover(decals.MeshObject("ball", ball.points, ball.regular_faces), count=count)


def measure(*, quick: bool) -> dict[str, float]:
    """Measure pages; ``quick`` takes fewer decals and triangles."""
    return asyncio.run(_measured(quick=quick))


async def _measured(*, quick: bool) -> dict[str, float]:
    shares = [share async for _, share in browser.shares("chromium", quick=quick)]
    small = sphere_scene(100 if quick else 1000, faces=10_000 if quick else 100_000)
    many = sphere_scene(500 if quick else 10_000, faces=10_000 if quick else 100_000)
    figures: dict[str, float] = {"html_pixels_equal": min(shares), "html_pixel_cases": len(shares)}
    images = len(page(small.replace(images=small.images[:1]), resolution=None).text)
    figures["html_mb"] = images / 1e6
    async with browser.shown(small, SIZE, software=True) as shown:
        figures["html_first_s"] = await shown.evaluate(FIRST_FRAME)
    async with browser.shown(many, SIZE, software=True) as shown:
        drag: Any = await shown.evaluate(DRAG, STEPS)
        figures["html_drag_ms"], figures["html_drag_draw_ms"] = drag
    figures["html_lines"] = viewer_lines()
    return figures


def viewer_lines() -> int:
    """Number of lines of the viewer's JavaScript, without empty ones and comments."""
    texts = [path.read_text(encoding="utf-8") for end in ("mjs", "js") for path in VIEWER.glob(f"*.{end}")]
    lines = [line.strip() for text in texts for line in text.splitlines()]
    return sum(bool(line) and not line.startswith("//") for line in lines)
