"""Pages of lessons in a browser beside the lab, as a program.

    python -m tests.frontends.in_lesson_page [firefox] [NUMBER ...]
    python -m tests.frontends.in_lesson_page class

Each page shows the numbers of the lab, judges answers as it does, and asks no server. Without ``firefox`` it
runs in Chromium, where fingers use it and it is printed; see `in_html_page` for what Firefox needs.
"""

import asyncio
import os
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Browser, Error, Locator, Page, async_playwright, expect

from decals.apps.lab.experiment import Scope
from decals.apps.lab.lesson import LESSONS, Lesson, load_lessons
from decals.apps.lesson_pages.classroom import Classroom
from decals.apps.lesson_pages.page import lesson_page, no_page
from tests.apps.lab.answers import ANSWERS, SOLVED, Attempt
from tests.apps.lesson_pages.test_classroom import serve, students
from tests.apps.sandbox.test_sessions import TOKEN
from tests.frontends.browsing import ERRORS, pull, trace
from tests.frontends.in_html_page import Fingers, accessible, launched
from tests.oracles.contact import pressed_away

SIZE = {"width": 1280, "height": 800}
SIZES = (390, 844), (820, 1180), (1280, 800)
"""Windows of a phone, of a tablet and of a laptop."""

CUT = """() => [...document.querySelectorAll("#lesson :is(button, input, select, a, td, th, svg, canvas)")]
  .filter((e) => e.checkVisibility())
  .filter((e) => e.getBoundingClientRect().left < 0 || e.getBoundingClientRect().right > innerWidth)
  .map((e) => e.outerHTML.slice(0, 80))"""
"""Parts of a page that its window cuts."""

UNPRINTED = """() => [".body", "canvas", ".question", ".tasks", ".values", ".chart svg", "output"].filter(
  (name) => document.querySelector(`#lesson ${name}`)?.checkVisibility() === false)"""
"""Names of parts that a print lacks; not all lessons have all of them."""

CONTROLS = "#lesson :is(button:not(.probe), input:not([type=checkbox]), nav):visible"
"""Parts that a print does not have."""
PATIENCE = 120_000
"""Milliseconds for a page to start, or to show the values of a state, without a graphics card."""

CLOSE = 0.02
"""Relative difference of values: of shares of the map, some of its points lie on a rim."""

SET = """(input, value) => {
  input.value = value;
  for (const name of ["input", "change"]) input.dispatchEvent(new Event(name, { bubbles: true }));
}"""


EXPLAINED = """() => {
  const { content } = getComputedStyle(document.activeElement, "::after");
  return content === "attr(title)" ? document.activeElement.title : content;
}"""
"""The definition that a page shows of the symbol with the focus; Firefox names the attribute."""

IN_SIGHT = """() => {
  const question = document.querySelector(".question");
  const { left, top } = question.getBoundingClientRect();
  return question.contains(document.elementFromPoint(left + 5, top + 5));
}"""
"""True if the question is in the window, and not below the model, which stays in sight on a phone."""

LOOK = "(line, name) => getComputedStyle(line)[name]"

PLACES = """places => places.map((place, i) => {
  const { left, top, width, height } = document.querySelector("#viewer canvas").getBoundingClientRect();
  return [page.viewer.decals.rows[i].position, [...place, 0]].map((at) => {
    const [x, y] = page.viewer.camera.seen(at, width / height);
    return [left + (0.5 + x / 2) * width, top + (0.5 - y / 2) * height];
  });
})"""
"""Where the images of a puzzle are in the window, and where they shall be."""

MOVE = """places => page.viewer.edit(
  places.map((p, i) => [i, {...page.viewer.decals.rows[i], position: [...p, 0]}]))"""


def truths(lesson: Lesson, *formulas: str) -> list[float]:
    """Return the values that the lab shows at the beginning of a lesson."""
    scope = Scope.at_probe(lesson.experiment())
    return [float(np.ravel(lesson.formulas[text].evaluate(scope))[0]) for text in formulas]


async def ready(page: Page) -> None:
    """Wait until the viewer of a page is ready, or raise an error with what the page shows in its place."""
    try:
        await page.wait_for_function("globalThis.page?.root", timeout=PATIENCE)
    except Error as error:
        raise AssertionError(await page.inner_text("#viewer")) from error


async def settled(page: Page) -> None:
    """Wait until the page shows the values of its state."""
    await page.evaluate("() => new Promise(requestAnimationFrame)")
    await page.wait_for_function("page.root.dataset.shown", timeout=PATIENCE)
    assert not await page.inner_text(".problem")


async def answered(page: Page, attempt: Attempt) -> None:
    """Make sure that a page judges an attempt as the lab does."""
    for label, value in attempt.settings:
        slider = page.locator(".sliders label", has_text=label).locator("input, select").first
        await slider.evaluate(SET, str(value) if isinstance(value, str) else f"{value:g}")
    await page.get_by_role("button", name="Check the answer").click()
    await settled(page)
    assert await page.evaluate(CUT) == []  # not even where numbers are longest
    verdict = page.locator(".verdict")
    assert attempt.words in await verdict.inner_text(), await verdict.inner_text()
    assert await verdict.get_attribute("data-right") == str(attempt.right).lower()


async def touched(page: Page) -> None:
    """A finger moves the probe, and beside the model another one turns it."""
    fingers = Fingers(await page.context.new_cdp_session(page))
    probe = page.locator(".probe:visible")
    if await probe.count():
        before = await page.evaluate("page.probe")
        start = await corner_of(probe, 12)
        await fingers.move([start], [start + 25 - 15j])
        await settled(page)
        assert await page.evaluate("page.probe") != before
    eye = await page.evaluate("page.viewer.camera.pose.position")
    start = await corner_of(page.locator("#viewer canvas"), 5)
    await fingers.move([start], [start + 40 + 20j])
    assert await page.evaluate("page.viewer.camera.pose.position") != eye


async def press(page: Page, name: str) -> None:
    """Press a button with a finger, or where the driver sends none with the mouse."""
    button = page.get_by_role("button", name=name)
    await (button.tap if is_chromium(page) else button.click)(timeout=PATIENCE)


def is_chromium(page: Page) -> bool:
    """Return True if the driver sends fingers to the page and prints it: Firefox drops taps and prints."""
    return page.context.browser is not None and page.context.browser.browser_type.name == "chromium"


async def corner_of(part: Locator, inside: float) -> complex:
    """Return a place on the screen, some pixels inside the upper left corner of a part of a page."""
    box = await part.bounding_box()
    assert box is not None
    return complex(box["x"] + inside, box["y"] + inside)


async def learned(browser: Browser, lesson: Lesson, attempts: list[Attempt], path: Path) -> None:
    """Take a lesson by its page, from the guess to the right answer."""
    lesson_page(lesson).save(path)
    page = await browser.new_page(viewport=SIZE, has_touch=True)
    requests: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    await page.add_init_script(ERRORS)
    await page.goto(path.as_uri())
    await ready(page)
    first = await page.evaluate("performance.getEntriesByName('first frame')[0].startTime")
    await accessible(page)
    assert not await page.locator(".after:visible").count()
    await page.locator("[name=guess]").fill("1")
    await page.get_by_role("button", name="See", exact=True).click()
    await expect(page.locator(".question")).to_be_focused()
    await settled(page)
    assert re.match(r"You guessed .*, it is", await page.inner_text(".seen"))
    question, meters = lesson.settings.guess, page.locator(".meter meter")
    assert question is not None
    ends = [1.0, *truths(lesson, question.truth)]
    for meter, end in zip(await meters.all(), np.clip(ends, question.low, question.high), strict=True):
        assert await meter.evaluate("meter => meter.value") == pytest.approx(end, rel=CLOSE, abs=1e-3)
    for text, value in zip(
        await page.locator(".values td:last-child").all_inner_texts(),
        truths(lesson, *(value.formula for value in lesson.settings.values)),
        strict=True,
    ):
        found = text == "yes" if text in ("yes", "no") else float(text)
        assert found == pytest.approx(value, rel=CLOSE, abs=1e-3), (text, value)
    for attempt in attempts:
        await answered(page, attempt)
    assert await page.locator("[data-task] input:not(:checked)").count() == 0
    await accessible(page)
    if is_chromium(page):
        await touched(page)
    await press(page, "Start again")
    await page.wait_for_selector("#lesson[data-waits=true]")
    assert await page.evaluate("page.probe") == [*lesson.settings.probe]
    await page.goto(f"{path.as_uri()}#task=1")
    await page.reload()
    await page.wait_for_selector("[id='task=1']:target", timeout=PATIENCE)
    assert await page.evaluate("window.pageErrors") == []
    asked = {request.split("#")[0] for request in requests if request.startswith(("http", "file"))}
    assert asked <= {path.as_uri()}  # Firefox reports none of files
    await page.close()
    print(f"{lesson.settings.title}: first frame after {first / 1000:.1f} s", flush=True)


async def fitted(browser: Browser, lesson: Lesson, path: Path) -> None:
    """Take a lesson by fingers at three sizes, of which none cuts anything, and print it."""
    for width, height in SIZES:
        page = await browser.new_page(viewport={"width": width, "height": height}, has_touch=True)
        await page.goto(path.as_uri())
        await ready(page)
        assert await page.evaluate(CUT) == []
        await press(page, "Skip the guess")
        await settled(page)
        await page.wait_for_function(IN_SIGHT, timeout=PATIENCE)
        await press(page, "Check the answer")
        await settled(page)
        assert await page.inner_text(".verdict")
        assert await page.evaluate("document.documentElement.scrollWidth") <= width
        assert await page.evaluate(CUT) == []
        await accessible(page)
        if is_chromium(page):
            await page.emulate_media(media="print")
            assert await page.evaluate(UNPRINTED) == []
            assert await page.locator(CONTROLS).count() == 0
        await page.close()


async def played(browser: Browser, path: Path, width: int, height: int) -> None:
    """Solve the puzzle by moving decals, find the scores again after a reload, and share other sizes."""
    page = await browser.new_page(viewport={"width": width, "height": height}, has_touch=True)
    await page.add_init_script(ERRORS)
    await page.goto(path.as_uri())
    await press(page, "Skip the guess")
    cells = page.locator(".scores td")
    await settled(page)
    assert (await cells.all_inner_texts())[2::3] == ["–", "–"]  # what overlaps too much does not count
    await packed(page)
    await settled(page)
    scores = await cells.all_inner_texts()
    assert float(scores[0]) <= 1 < 4 >= float(scores[3])
    assert scores[1::3] == ["1", "4"]
    assert scores[2::3] == [f"{scores[0]} ★", f"{scores[3]} ★"]
    await page.reload()
    await press(page, "Skip the guess")
    await settled(page)
    assert (await cells.all_inner_texts())[2::3] == scores[2::3]
    await page.locator(".sliders input").first.evaluate(SET, "0.3")
    await settled(page)
    assert (await cells.all_inner_texts())[1::3] == ["–", "–"]
    await press(page, "Share as a puzzle")
    link = str(await page.locator(".shared a").get_attribute("href"))
    assert "#puzzle=0.3,0.5,0.5,0.42&par=" in link
    await page.goto("about:blank")
    await page.goto(link)
    await press(page, "Skip the guess")
    await settled(page)
    pars = link.split("par=")[1].split(",")
    assert (await cells.all_inner_texts())[1::3] == [f"{float(par):g}" for par in pars]
    assert await page.evaluate("page.viewer.decals.rows[0].radius") == 0.3
    await page.evaluate(MOVE, SOLVED)
    await settled(page)
    moved = await page.evaluate("page.viewer.decals.rows[0].position")
    await press(page, "Undo")
    await settled(page)
    assert await page.evaluate("page.viewer.decals.rows[0].position") != moved
    assert await page.evaluate("window.pageErrors") == []
    await page.close()


async def packed(page: Page) -> None:
    """Drag the images of the puzzle to a good answer, with a finger or the mouse."""
    await page.evaluate("scrollTo({ top: 0, behavior: 'instant' })")  # else Firefox still moves
    fingers = Fingers(await page.context.new_cdp_session(page)) if is_chromium(page) else None
    for start, end in await page.evaluate(PLACES, SOLVED):
        if fingers:
            await fingers.move([complex(*start)], [complex(*end)])
        else:
            await pull(page, start, (end[0] - start[0], end[1] - start[1]))


async def typed(browser: Browser, path: Path, width: int, height: int) -> None:
    """Take the first lesson by the keyboard alone, from the guess to the right answer and back."""
    page = await browser.new_page(viewport={"width": width, "height": height})
    await page.add_init_script(ERRORS)
    await page.goto(path.as_uri())
    await ready(page)
    await reach(page, "[name=guess]")
    await page.keyboard.type("2.2")
    await page.keyboard.press("Enter")
    await settled(page)
    for part, count in ((".probe", 14), ("[data-path='decals.0.radius']", 62)):
        await reach(page, part)
        if part == ".probe":
            scrolled = await page.evaluate("scrollY")
            await page.keyboard.press("ArrowDown")  # it has no slider up and down
            assert await page.evaluate("scrollY") == scrolled
        for _ in range(count):
            await page.keyboard.press("ArrowRight")
        await settled(page)
    assert await page.get_attribute(".verdict", "data-right") == "true", await page.inner_text(".tasks")
    await reach(page, ".readings abbr[data-symbol='d']")
    assert "over the influence radius" in await page.evaluate(EXPLAINED)
    await reach(page, "[name=again]", "Shift+Tab")
    await page.keyboard.press("Space")
    await page.wait_for_selector("#lesson[data-waits=true]")
    assert await page.evaluate("window.pageErrors") == []
    await page.close()


async def explained(browser: Browser, path: Path, width: int, height: int) -> None:
    """A symbol of lesson 2 says what it means, and lights up; a line that opens the lesson is copied."""
    page = await browser.new_page(viewport={"width": width, "height": height}, has_touch=True)
    await page.goto(path.as_uri())
    await press(page, "Skip the guess")
    await settled(page)
    looks = {"path[data-symbol='h']": "stroke-width", "path[data-region='h']": "opacity"}
    lines = {page.locator(f".chart {part}").first: name for part, name in looks.items()}
    first = [await line.evaluate(LOOK, name) for line, name in lines.items()]
    assert first == ["2px", "0"]
    symbol = page.locator(".readings abbr[data-symbol='h']")
    await (symbol.tap() if is_chromium(page) else symbol.click())
    assert "factor by which a neighbour lowers" in await page.evaluate(EXPLAINED)
    assert [await line.evaluate(LOOK, name) for line, name in lines.items()] == ["5px", "0.5"]
    await page.locator(".question").click()
    await page.locator(".body abbr[data-symbol='F']").first.hover()
    assert [await line.evaluate(LOOK, name) for line, name in lines.items()] == first
    await expect(page.locator(".chart path[data-symbol='F']")).to_have_css("stroke-width", "5px")
    await page.get_by_text("Open in the sandbox").click()
    line = "implicit-decals sandbox --lesson 2-two-decals"
    assert await page.locator(".python[open] pre").inner_text() == line
    await page.locator("[name=copy]:visible").click()
    assert await page.evaluate("String(getSelection()).trim()") == line
    if is_chromium(page):
        await page.context.grant_permissions(["clipboard-read"])
        assert await page.evaluate("navigator.clipboard.readText()") == line
    await page.close()


async def sketched(browser: Browser, path: Path, width: int, height: int) -> None:
    """A student draws the rim of the orange image, and sees how much of it contact presses away.

    On a phone and a tablet a finger draws it, where the driver sends one.
    """
    page = await browser.new_page(viewport={"width": width, "height": height}, has_touch=True)
    await page.add_init_script(ERRORS)
    await page.goto(path.as_uri())
    await ready(page)
    finger = is_chromium(page) and width < SIZE["width"]
    await trace(page, page.locator(".pad circle").first, finger=finger)
    await page.locator("[name=guess]").fill("0.5")
    await press(page, "See")
    await settled(page)
    found = re.findall(r"off by ([\d.]+) %", await page.inner_text("[data-difference]"))
    assert float(found[0]) == pytest.approx(pressed_away(), abs=2.0)
    assert await page.evaluate(CUT) == []
    await accessible(page)
    await press(page, "Start again")
    await press(page, "Skip the guess")
    await settled(page)
    assert not await page.locator("[data-difference]").count()
    assert await page.evaluate("window.pageErrors") == []
    await page.close()


async def reach(page: Page, part: str, key: str = "Tab") -> None:
    """Press Tab until a part of the page has the focus, which can be seen."""
    for _ in range(60):
        await page.keyboard.press(key)
        if await page.evaluate("part => document.activeElement.matches(part)", part):
            assert await page.locator(part).evaluate("e => getComputedStyle(e).outlineStyle") != "none"
            return
    raise AssertionError(f"no focus: {part}")


async def taught(room: Classroom, address: str) -> None:
    """Students with phones send their numbers, and the teacher sees them in a table and a plot."""
    async with async_playwright() as player:
        browser = await launched(player, "chromium")
        for number in range(3):
            page = await browser.new_page(viewport={"width": 390, "height": 844}, has_touch=True)
            await page.add_init_script(ERRORS)
            await page.goto(f"{students(address)}/{room.token}/9-packing.html")
            await ready(page)
            await page.locator("[name=guess]").fill(str(10 + number))
            await page.get_by_role("button", name="See", exact=True).tap()
            await page.wait_for_selector("#lesson[data-shown]", timeout=PATIENCE)
            await page.get_by_label("Name (optional)").fill(f"Anna {number}")
            await page.get_by_role("button", name="Send my numbers").tap()
            await page.get_by_text("Sent to the teacher.").wait_for()
            assert await page.evaluate("window.pageErrors") == []
            await page.close()
        page = await browser.new_page(viewport=SIZE)
        await page.add_init_script(ERRORS)
        await page.goto(f"{address}?token={TOKEN}")
        await page.goto(f"{address}class")
        await page.get_by_role("combobox", name="Lesson").select_option("A puzzle: packing")
        await page.get_by_role("combobox", name="Right").select_option("guess")
        await page.get_by_text("answers: 3").wait_for()
        rows = page.locator("tbody tr")
        assert [await row.locator("td").nth(2).inner_text() for row in await rows.all()] == ["10", "11", "12"]
        assert await page.locator(".chart circle").count() == 3
        await accessible(page)
        assert await page.evaluate("window.pageErrors") == []
        await browser.close()


async def learn(name: str, numbers: set[int]) -> None:
    """Take all lessons that have pages, or those of some numbers, in a browser."""
    with tempfile.TemporaryDirectory() as folder:
        async with async_playwright() as player:
            browser = await launched(player, name)
            for number, lesson in enumerate(load_lessons(LESSONS), 1):
                if not no_page(lesson) and number in (numbers or {number}):
                    path = Path(folder) / f"{lesson.name}.html"
                    await learned(browser, lesson, ANSWERS[number - 1], path)
                    await fitted(browser, lesson, path)
                    if number == 1:
                        for size in SIZES:
                            await typed(browser, path, *size)
                    if number == 2:
                        for size in SIZES:
                            await explained(browser, path, *size)
                            await sketched(browser, path, *size)
                    if lesson.settings.scores:
                        for size in SIZES:
                            await played(browser, path, *size)
            await browser.close()


def main() -> None:
    """Run the checks that the command line names."""
    if sys.argv[1:] == ["class"]:
        os.chdir(tempfile.mkdtemp())  # the session leaves a file where it was started
        serve(taught)
    else:
        named = "firefox" if sys.argv[1:2] == ["firefox"] else "chromium"
        asyncio.run(learn(named, {int(text) for text in sys.argv[1:] if text != named}))
    print("done")


if __name__ == "__main__":
    main()
