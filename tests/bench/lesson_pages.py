"""Pages of lessons in headless Chromium, which draws by Mesa, in ``tests.bench.sandbox``."""

import tempfile
from pathlib import Path

import numpy as np
from playwright.async_api import async_playwright

from decals.apps.lab.lesson import LESSONS, load_lessons
from decals.apps.lesson_pages.page import lesson_page, no_page
from tests.bench.export_page import FINISH, FIRST_FRAME
from tests.frontends.in_html_page import launched

SIZE = {"width": 1280, "height": 800}

SLIDES = """(steps) => {
  const { viewer } = page, times = [];
  const slider = page.sliders.find(({ type }) => type === "range");
  const { min, max } = slider;
  for (let i = 0; i < steps; i++) {
    FINISH
    const began = performance.now();
    slider.value = Number(min) + (0.2 + (0.6 * i) / steps) * (max - min);
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    page.show();
    times.push(performance.now() - began);
  }
  return times;
}""".replace("FINISH", FINISH)
"""Drag the first slider of a lesson; each step begins once the first picture is there."""


async def measured_lessons(steps: int) -> dict[str, float]:
    """Return the figures of the pages of lessons."""
    firsts, drags = [], []
    with tempfile.TemporaryDirectory() as folder:
        async with async_playwright() as player:
            browser = await launched(player, "chromium")
            for lesson in load_lessons(LESSONS):
                if no_page(lesson):
                    continue
                path = Path(folder) / f"{lesson.name}.html"
                lesson_page(lesson).save(path)
                page = await browser.new_page(viewport=SIZE)
                await page.goto(path.as_uri())
                await page.wait_for_function("globalThis.page?.root")
                firsts.append(await page.evaluate(FIRST_FRAME))
                await page.get_by_role("button", name="Skip the guess").click()
                await page.wait_for_function("page.root.dataset.shown")
                drags.append(np.median(await page.evaluate(SLIDES, steps)))
                await page.close()
            await browser.close()
    return {"lesson_first_s": max(firsts), "lesson_drag_ms": float(max(drags))}
