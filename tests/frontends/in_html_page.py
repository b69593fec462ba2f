"""Pages of `save_html` in a real browser, as a program.

    python -m tests.frontends.in_html_page CHECK [chromium|firefox]

The checks are picture, sizes, use, touch, mounts, address, losses, drags and refusals.
Firefox needs a display, such as that of ``xvfb-run -a``, and a version of playwright that knows it: Debian's
Firefox 153 is driven by playwright 1.60, but not by 1.65. Touch is for Chromium alone.
"""

import asyncio
import math
import re
import sys
import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from playwright.async_api import CDPSession, Page, Playwright, async_playwright

import decals
from blobtree import Mirror, Point, Segment, polygonize
from decals import Scene
from decals.apps.gallery.environments import bodies, evening
from decals.apps.gallery.materials import lacquer, rivets
from decals.editing import Actions, EditSession, PointerTools
from decals.rendering import Environment, Light, Lighting
from decals.scenes.objects import SceneObject
from decals.surfaces import BaseColor, BaseTexture
from tests.frontends.browsing import ERRORS, browser_path, firefox_path, pull, violations

SIZE = 400, 300
TOLERANCE = 2
"""Levels of 255 by which a page may differ from a picture."""
EQUAL = 0.995
"""Least share of surface pixels that are equal within the tolerance."""
CELLS = 48
CLOSE = 0.02
"""Largest distance of decals that were dragged alike, in radii."""
TURNED = 0.12
"""Largest difference of their frames: the editor has normals of faces, the page smooth ones."""
ARGUMENTS = ["--no-sandbox", "--ignore-gpu-blocklist"]
MESA = "--use-angle=gl-egl"
"""Draws by Mesa, which our pictures use too: SwiftShader places vertices at sixteenths of pixels."""
SOFTWARE = "--use-angle=swiftshader"
FIREFOX = {"webgl.force-enabled": True}
"""Settings without which Firefox leaves WebGL out where there is no graphics card."""

STARTED = (
    """() => viewer?.set || document.querySelector("main").textContent.includes("cannot be turned here")"""
)
"""True once a page is ready or says why it is not; its script, outside `main`, has these words too."""
PIXELS = """() => {
  const { canvas, painter } = viewer;
  painter.draw({ ...viewer, selected: -1 });
  const bytes = new Uint8Array(4 * canvas.width * canvas.height);
  painter.gl.readPixels(0, 0, canvas.width, canvas.height, painter.gl.RGBA, painter.gl.UNSIGNED_BYTE, bytes);
  return { width: canvas.width, height: canvas.height, bytes: Array.from(bytes) };
}"""

PLACES = [[0.0, 0.0], [0.0513, -0.1027], [-0.1311, 0.0519], [0.1003, 0.1507]]
"""Places on the model, of which most are between the middles of pixels."""
SEEN_AGAIN = """(places) =>
  places.map(([x, y]) => viewer.camera.seen(viewer.pick(x, y).surface.position, viewer.aspect))"""


@dataclass(frozen=True)
class Case:
    """A scene that a page must show as a picture does.

    Attributes
    ----------
    make
        Returns the scene.
    traced
        True for trees that the page traces, False for those that it has as meshes.
    modes
        Contact modes that are compared.
    """

    make: Callable[[], Scene]
    traced: bool = False
    modes: tuple[decals.Contact, ...] = tuple(decals.Contact)[:1]

    def options(self) -> dict[str, Any]:
        """Return options of the page."""
        return {"surface": "traced" if self.traced else "mesh", "controls": False}


def tree_scene() -> Scene:
    """Return scales on a tree."""
    return decals.cover(
        Point((0, 0, 0), radius=1) | Segment((0.5, 0, 0), (2, 0, 0), radius=0.4), count=60, images=["scale"]
    )


def layered_scene() -> Scene:
    """Return two objects with decals in layers, with tints, opacities, spill, receivers and fades."""
    scene = decals.cover(
        [Point((0, 0, 0), radius=1), Point((2.2, 0, 0), radius=0.8)], count=80, images=["scale", "tile"]
    )
    random = np.random.default_rng(4)
    count = len(scene.decals)
    changed = scene.decals.replace(
        images=random.integers(0, 2, count),
        layers=random.integers(0, 2, count),
        interactions=random.integers(0, 3, count),
        tints=random.random((count, 3)),
        opacities=random.uniform(0.4, 1.0, count),
        spill=random.random(count) < 0.3,
        fade_angles=np.where(random.random(count) < 0.3, 70.0, 0.0),
        receivers=[scene.objects[0].name if chance < 0.3 else "" for chance in random.random(count)],
        radii=scene.decals.radii * random.uniform(0.8, 1.4, count),
    )
    return scene.replace(decals=changed)


def textured_scene() -> Scene:
    """Return two planes with textures whose coordinates go beyond 1, and a ball with one, under decals."""
    random = np.random.default_rng(2)
    image = np.kron(random.integers(0, 256, (8, 8, 3), np.uint8), np.ones((8, 8, 1), np.uint8))
    objects = []
    wraps: tuple[tuple[str, str], ...] = ("repeat", "repeat"), ("mirror", "clamp")
    for number, wrap in enumerate(wraps):
        plane = pv.Plane(center=(2.2 * number, 0, 0), i_resolution=4, j_resolution=4).triangulate()
        uv = 3 * np.asarray(plane.active_texture_coordinates) - 1
        texture = BaseTexture(image, wrap=wrap)
        faces = plane.regular_faces
        of_face = np.where(np.arange(len(faces)) % 5 == 0, -1, 0) if number else None
        light = random.random((len(uv), 3))
        color = BaseColor(light if number else None, uv, (texture,), of_face)
        objects.append(decals.MeshObject(f"plane {number}", plane.points, faces, color=color))
    ball = pv.Sphere(radius=0.5, center=(1.1, 0, 0.4))
    ball.texture_map_to_sphere(inplace=True)
    coordinates = np.asarray(ball.active_texture_coordinates)
    color = BaseColor(None, coordinates, (BaseTexture(image),))
    objects.append(decals.MeshObject("ball", ball.points, ball.regular_faces, color=color))
    return decals.cover(objects, count=30, images=["scale"])


def shiny_scene() -> Scene:
    """Return materials without relief on two objects."""
    scene = decals.cover([Point((0, 0, 0), radius=1), Point((1.6, 0.3, 0), radius=0.8)], count=60)
    images = rivets(), lacquer()
    flat = tuple(replace(image, relief=0.0) for image in images)
    numbers = np.arange(len(scene.decals)) % 2
    return scene.replace(decals=scene.decals.replace(images=numbers), images=flat)


def warped_scene() -> Scene:
    """Return a tree with operators, a warp and a colour of its own, beside another tree and a mesh."""
    tree = (Point((0, 0, 0), radius=1, color=(0.7, 0.2, 0.2)) + Point((1, 0.2, 0), radius=0.7)).twist(30)
    tree = tree - Segment((0, -2, 0.9), (0, 2, 0.9), radius=0.3)
    box = decals.MeshObject("box", *_box((-1.8, 0, 0)))
    return decals.cover([tree, Mirror(Point((0.5, 1.6, 0), radius=0.4)), box], count=90, images=["scale"])


def _box(center: tuple[float, float, float]) -> tuple[NDArray[Any], NDArray[Any]]:
    box = pv.Cube(center=center).triangulate()
    return box.points, box.regular_faces


def lit(make: Callable[[], Scene], **light: Any) -> Callable[[], Scene]:
    """Return a function that makes a scene with other light."""

    def made() -> Scene:
        scene = make()
        return scene.replace(drawing=scene.drawing.overridden(**light))

    return made


LIGHTS = Lighting(
    (Light("white", (0, 0, -1)), Light((0.3, 0.2, 0.5), (1, 0, 0), position=(-3, 0, 1), cone=40))
)
ALL = tuple(decals.Contact)
CASES = {
    "tree": Case(tree_scene, modes=ALL),
    "layered": Case(layered_scene, modes=ALL),
    "textured": Case(textured_scene),
    "shiny": Case(shiny_scene),
    "lights": Case(lit(shiny_scene, lights=LIGHTS)),
    "environment": Case(lambda: bodies_in(Environment(evening(), visible=True))),
    "traced tree": Case(tree_scene, traced=True, modes=ALL),
    "traced layers": Case(layered_scene, traced=True),
    "traced warps": Case(warped_scene, traced=True),
    "traced materials": Case(shiny_scene, traced=True),
}
"""Scenes of the check of pictures."""


def bodies_in(environment: Environment) -> Scene:
    """Return the bodies of the gallery, without relief, in an environment."""
    scene = bodies()
    flat = tuple(
        replace(image, relief=0.0) for image in scene.images if isinstance(image, decals.DecalMaterial)
    )
    return scene.replace(images=flat, drawing=scene.drawing.overridden(environment=environment))


async def launched(player: Playwright, name: str, *, software: bool = False) -> Any:
    """Return a browser; ``software``: Chromium draws by SwiftShader."""
    if name == "firefox":
        path = firefox_path()
        return await player.firefox.launch(
            channel="moz-firefox", executable_path=path, headless=False, firefox_user_prefs=FIREFOX
        )
    arguments = [*ARGUMENTS, SOFTWARE if software else MESA]
    return await player.chromium.launch(executable_path=browser_path(), args=arguments)


@asynccontextmanager
async def shown(
    scene: Scene,
    size: tuple[int, int] = SIZE,
    *,
    browser: str = "chromium",
    software: bool = False,
    **options: Any,
) -> AsyncIterator[Page]:
    """A page of a scene in a browser, which asks for nothing but its file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.html"
        decals.save_html(scene, path, resolution=CELLS, **options)
        async with async_playwright() as player:
            application = await launched(player, browser, software=software)
            page = await application.new_page(viewport={"width": size[0], "height": size[1]})
            requests: list[str] = []
            page.on("request", lambda request: requests.append(request.url))
            await page.add_init_script(ERRORS)
            await page.goto(path.as_uri())
            await page.wait_for_function(STARTED, timeout=120_000)
            assert await page.evaluate("!!viewer.set"), await page.inner_text("main")
            yield page
            assert await page.evaluate("window.pageErrors") == []
            assert set(requests) <= {path.as_uri()}, requests  # Firefox reports none of files
            await application.close()


async def pixels(page: Page) -> NDArray[np.uint8]:
    """Return one sample of the picture of a page, ``uint8[h, w, 4]``, row 0 at the top."""
    found = await page.evaluate(PIXELS)
    return np.array(found["bytes"], np.uint8).reshape(found["height"], found["width"], 4)[::-1]


def share_of_equal(page: NDArray[np.uint8], scene: Scene) -> float:
    """Return the share of surface pixels that a page and a picture have alike, silhouettes left out."""
    size = page.shape[1], page.shape[0]
    picture = scene.render(size=size, samples=1, background="transparent").pixels
    surface = (page[..., 3] == 255) & (picture[..., 3] == 255)
    inside = surface.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inside &= np.roll(surface, step, axis)
    both = inside.sum() / max((page[..., 3] == 255).sum(), 1)
    assert both > 0.9, both
    apart = np.abs(page[..., :3].astype(int) - picture[..., :3].astype(int)).max(axis=-1)
    return float((apart[inside] <= TOLERANCE).mean())


def meshed(scene: Scene) -> Scene:
    """Return a scene with meshes in place of trees."""
    objects = []
    for item in scene.objects:
        if not hasattr(item, "tree"):
            objects.append(item)
            continue
        mesh = polygonize(item.tree, resolution=CELLS, creases=True)
        objects.append(decals.MeshObject(item.name, mesh.vertices, mesh.faces, labels=item.labels))
    return scene.replace(objects=tuple(objects))


async def shares(browser: str, *, quick: bool = False) -> AsyncIterator[tuple[str, float]]:
    """Yield the share of equal pixels of each case and mode; ``quick``: of one mode."""
    for name, case in CASES.items():
        scene = case.make() if case.traced else meshed(case.make())
        async with shown(scene, browser=browser, **case.options()) as page:
            for contact in case.modes[:1] if quick else case.modes:
                mode = contact.name.lower()
                await page.evaluate(f"viewer.set({{ mode: '{mode}' }})")
                drawn = scene.replace(drawing=scene.drawing.overridden(contact=contact))
                yield f"{name}, {mode}", share_of_equal(await pixels(page), drawn)


async def picture(browser: str) -> None:
    """Pages equal pictures."""
    found = {}
    async for name, share in shares(browser):
        print(f"{name}: {share:.4f}", flush=True)
        found[name] = share
    assert min(found.values()) >= EQUAL, found


SIZES = (400, 300), (320, 640), (700, 300)
"""Sizes of windows; tools below the picture make it wider and lower."""


async def sizes(browser: str) -> None:
    """Pages of several sizes, with tools and without, show models as pictures of these sizes do.

    Their first picture has a third of the pixels along each side, and the next one all of them.
    """
    scene = meshed(tree_scene())
    turned = scene.replace(camera=scene.camera.turned(50))
    for case, controls in ((scene, True), (turned, False)):
        async with shown(case, browser=browser, controls=controls) as page:
            for width, height in SIZES:
                await page.set_viewport_size({"width": width, "height": height})
                await page.wait_for_function(RESIZED, arg=[width, height])
                share = share_of_equal(await pixels(page), case)
                print(f"{width} x {height}, controls {controls}: {share:.4f}", flush=True)
                assert share >= EQUAL, (width, height, controls, share)
            await page.add_init_script(FIRST)
            await page.reload()
            await page.wait_for_function(STARTED, timeout=120_000)
            await page.wait_for_function(RESIZED, arg=[width, height])
            canvas = page.locator("canvas")
            assert await page.evaluate("first") == round(await canvas.evaluate("c => c.width") / 3)


FIRST = """performance.mark = new Proxy(performance.mark, { apply(mark, of, names) {
  window.first = document.querySelector("canvas").width;
  return Reflect.apply(mark, of, names);
} })"""
"""Note the width of the first picture once it is there."""

RESIZED = """([width, height]) =>
  innerWidth === width && innerHeight === height && viewer.canvas.width === viewer.canvas.clientWidth
  && viewer.canvas.height === viewer.canvas.clientHeight"""


async def use(browser: str) -> None:
    """A decal is dragged, turned, scaled, added and deleted; links, files and undo hold what happened."""
    await used(meshed(tree_scene()), browser)
    await used(tree_scene(), browser, surface="traced")


async def used(scene: Scene, browser: str, **options: Any) -> None:
    """Use a page of a scene."""
    async with shown(scene, (700, 600), browser=browser, **options) as page:
        await page.evaluate("viewer.set({ link: 'mode=toString&k=0.5&d=0:1e300,0,0,0,0,0,0,0,0,1e300' })")
        await page.evaluate("viewer.set({ link: 'k=1e999&eye=1,2&at=3' })")
        await page.evaluate("viewer.set({ link: 5, camera: {} })")
        before = await state(page)
        assert before["stiffness"] == scene.drawing.stiffness
        assert before["mode"] == scene.drawing.contact.name.lower()
        assert len(before["decals"]) == len(scene.decals)
        number = await page.evaluate("viewer.pick(0, 0).number")
        assert number >= 0
        assert await page.evaluate("viewer.pick(-0.99, 0.99)") == {"number": -1, "surface": None}
        assert np.allclose(await page.evaluate(SEEN_AGAIN, PLACES), PLACES, atol=1e-5)
        box = await page.locator("canvas").bounding_box()
        assert box is not None
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        held = np.subtract(before["decals"][number]["position"], await hit(page, 0, 0))
        await pull(page, middle, (40, -30))
        dragged = (await state(page))["decals"][number]
        place = await hit(page, 80 / box["width"], 60 / box["height"])
        assert np.linalg.norm(np.subtract(dragged["position"], place)) < 1.5 * np.linalg.norm(held) + 0.02
        on_surface = scene.objects[0].surface.project([dragged["position"]])[0][0]
        assert np.linalg.norm(on_surface - dragged["position"]) < 1e-3
        assert abs(np.dot(dragged["normal"], dragged["tangent"])) < 1e-6
        moved = with_rows(scene, (await state(page))["decals"])
        assert share_of_equal(await pixels(page), moved) >= EQUAL
        await page.keyboard.press("ArrowRight")
        nudged = (await state(page))["decals"][number]
        step = np.linalg.norm(np.subtract(nudged["position"], dragged["position"])) / dragged["radius"]
        assert 0.2 < step < 0.3
        for key in ("e", "e", "+", "n", "a", "Delete"):
            await page.keyboard.press(key)
        link = (await state(page))["link"]
        changed = (await state(page))["decals"]
        saved = await saved_scene(page, browser)
        assert len(saved.decals) == sum(row is not None for row in changed)
        assert np.allclose(saved.decals.positions[number], nudged["position"], atol=1e-6)
        assert [item.name for item in saved.objects] == [item.name for item in scene.objects]
        for one, other in zip(saved.objects, scene.objects, strict=True):
            assert same_surface(one, other)
        for _ in range(20):
            await page.keyboard.press("Control+z")
        assert (await state(page))["decals"][: len(scene.decals)] == before["decals"]
        await keys_reach_the_page(page)
        await page.evaluate("(link) => viewer.set({ link })", link)
        again = (await state(page))["decals"]
        assert np.allclose(again[number]["position"], nudged["position"], rtol=1e-4, atol=1e-5)
        await page.evaluate("viewer.set({ link: 'mode=min' })")
        first = await state(page)
        assert first["decals"][: len(scene.decals)] == before["decals"]
        assert first["decals"][len(scene.decals) :] == [None]
        assert "d=" not in first["link"]
        await page.evaluate("(link) => viewer.set({ link })", link)
        assert np.allclose(numbers((await state(page))["link"]), numbers(link), rtol=1e-4, atol=1e-5)
        await accessible(page)


def numbers(link: str) -> list[float]:
    """Return the numbers of a link."""
    return [float(text) for text in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", link)]


async def keys_reach_the_page(page: Page) -> None:
    """Keys work after a click that disables its button; the browser keeps its own; no line goes stale."""
    before = (await state(page))["decals"]
    await page.keyboard.press("n")
    line = page.locator("[role=status]")
    assert await line.inner_text() == f"Decal {(await state(page))['selected']} is selected."
    await page.locator("[name=remove]").click()
    assert (await state(page))["decals"] != before
    assert await line.inner_text() == ""
    await page.keyboard.press("Control+z")
    assert (await state(page))["decals"] == before
    await page.locator("[name=redo]").click()
    await state(page)
    await page.keyboard.press("Control+z")
    assert (await state(page))["decals"] == before
    camera = (await state(page))["camera"]
    assert not await page.evaluate(ALT_ARROW)
    assert (await state(page))["camera"] == camera


ALT_ARROW = """() => {
  const init = { key: "ArrowLeft", altKey: true, bubbles: true, cancelable: true };
  const event = new KeyboardEvent("keydown", init);
  viewer.canvas.dispatchEvent(event);
  return event.defaultPrevented;
}"""


async def mounts(browser: str) -> None:
    """A viewer that ends leaves nothing behind, and a page shows the link that is pasted into its address."""
    async with shown(meshed(tree_scene()), browser=browser) as page:
        await page.evaluate(REMOUNTED)
        await page.keyboard.press("s")
        assert await page.evaluate("window.saved") == 1
        await page.evaluate("location.hash = '#eye=0,0,9&at=0,0,0&mode=min&k=1000'")
        await page.wait_for_function("() => globalThis.viewer?.get().mode === 'min'")
        found = await state(page)
        assert found["camera"]["position"] == [0, 0, 9]
        assert found["stiffness"] == 2


REMOUNTED = """async () => {
  const root = document.getElementById("viewer");
  const text = document.getElementById("data").textContent;
  viewer.dispose();
  (await mountOver(root, text, { reason: "" })).dispose();
  await new Promise((resolve) => setTimeout(resolve, 200));
  globalThis.viewer = await mountOver(root, text, { reason: "" });
  window.saved = 0;
  URL.createObjectURL = () => `data:,${(window.saved += 1)}`;
  viewer.canvas.focus();
}"""


LOSE = """() => {
  window.lost = viewer.painter.gl.getExtension("WEBGL_lose_context");
  window.lost.loseContext();
  return new Promise((resolve) => setTimeout(resolve, 200));
}"""
"""Takes the graphics card away from a page, as its reset or a full memory does."""


async def address(browser: str) -> None:
    """The address holds each state at rest, of which a page that opens anew begins; it says if that ends."""
    async with shown(meshed(tree_scene()), browser=browser) as page:
        await page.set_viewport_size({"width": 420, "height": 300})
        await page.wait_for_timeout(1000)
        assert await page.evaluate("location.hash") == ""
        entries = await page.evaluate("history.length")
        await page.locator("canvas").focus()
        for key in ("n", "ArrowRight", "e", "Delete", "n", "+"):
            await page.keyboard.press(key)
        line = page.locator("[role=status]")
        link = (await state(page))["link"]
        await page.wait_for_function("(link) => location.hash === `#${link}`", arg=link)
        before = await state(page)
        await page.reload()
        await page.wait_for_function(STARTED)
        again = await state(page)
        assert np.allclose(numbers(again["link"]), numbers(link), rtol=1e-4, atol=1e-5)
        assert [row is None for row in again["decals"]] == [row is None for row in before["decals"]]
        await page.evaluate(MANY_EDITS)
        assert await line.inner_text() == ""
        await line.get_by_text("no link can hold them: save a scene file").wait_for()
        assert await page.evaluate("location.hash") == f"#{link}"
        await page.locator("canvas").press("n")
        await page.wait_for_timeout(1000)
        assert "is selected" in await line.inner_text()
        assert await page.evaluate("history.length") == entries


MANY_EDITS = """viewer.set({ decals: Object.fromEntries(
  viewer.get().decals.map((row, number) => [number, row && { ...row, radius: 0.9 * row.radius }])
) })"""


async def losses(browser: str) -> None:
    """A page goes on without a graphics card, says so, and shows all edits once it is back."""
    scene = meshed(tree_scene())
    async with shown(scene, (700, 600), browser=browser) as page:
        row = (await state(page))["decals"][3] | {"radius": 0.3, "tint": [1, 0, 0]}
        await page.evaluate(LOSE)
        line = page.locator("[role=status]")
        assert "graphics card" in await line.inner_text()
        assert await page.evaluate("viewer.pick(0, 0)") == {"number": -1, "surface": None}
        await page.mouse.move(200, 100)
        await page.mouse.down()
        await page.mouse.up()
        await page.evaluate("(row) => viewer.set({ decals: { 3: row } })", row)
        assert "graphics card" in await line.inner_text()
        await page.evaluate("window.lost.restoreContext()")
        await page.wait_for_function("() => !viewer.painter.gl.isContextLost() && viewer.sample > 0")
        assert await line.inner_text() == ""
        radii, tints = scene.decals.radii.copy(), scene.decals.tints.copy()
        radii[3], tints[3] = row["radius"], row["tint"]
        changed = scene.replace(decals=scene.decals.replace(radii=radii, tints=tints))
        assert share_of_equal(await pixels(page), changed) >= EQUAL
        assert await page.evaluate("viewer.pick(0, 0).number") >= 0

        before = (await state(page))["decals"]
        await page.evaluate("viewer.set({ decals: { 3: { ...viewer.get().decals[3], opacity: 2 } } })")
        assert (await state(page))["decals"] == before
        assert await line.inner_text() == "Decal 3 stays: no scene can have its opacity."
        await page.evaluate("viewer.set({ mode: 'elastic', stiffness: 64 })")
        assert await line.inner_text() == ""
        slider = page.locator("[name=stiffness]")
        await state(page)
        assert await slider.evaluate("input => [input.value, input.max]") == ["6", "6"]
        assert await slider.get_attribute("aria-valuetext") == "64"
        await slider.focus()
        await page.keyboard.press("Home")
        assert (await state(page))["stiffness"] == 1


async def touch(browser: str) -> None:
    """One finger drags a decal or turns the model; two fingers zoom and move the picture."""
    scene = meshed(tree_scene())
    async with shown(scene, (700, 600), browser=browser) as page:
        fingers = Fingers(await page.context.new_cdp_session(page))
        box = await page.locator("canvas").bounding_box()
        assert box is not None
        width, height = box["width"], box["height"]
        middle = complex(box["x"] + width / 2, box["y"] + height / 2)
        corner = complex(box["x"] + 30, box["y"] + 30)
        before = await state(page)
        number = await page.evaluate("viewer.pick(0, 0).number")
        held = np.subtract(before["decals"][number]["position"], await hit(page, 0, 0))
        await fingers.move([middle], [middle + 40 - 30j])
        after = await state(page)
        dragged = after["decals"][number]
        place = await hit(page, 80 / width, 60 / height)
        assert np.linalg.norm(np.subtract(dragged["position"], place)) < 1.5 * np.linalg.norm(held) + 0.02
        assert dragged["position"] != before["decals"][number]["position"]
        assert after["camera"] == before["camera"]
        await page.keyboard.press("Control+z")
        assert (await state(page))["decals"] == before["decals"]

        await fingers.move([corner], [corner + 60 + 25j])
        turned = await state(page)
        assert turned["camera"]["target"] == before["camera"]["target"]
        assert np.isclose(distance(turned), distance(before), rtol=1e-6)
        swing = np.subtract(turned["camera"]["position"], before["camera"]["position"])
        assert np.linalg.norm(swing) > 0.1 * distance(before)
        assert turned["decals"] == before["decals"]

        await fingers.move([middle - 50, middle + 50], [middle - 100, middle + 100])
        nearer = await state(page)
        assert np.isclose(distance(nearer), 0.5 * distance(turned), rtol=1e-2)
        assert np.allclose(
            nearer["camera"]["target"], turned["camera"]["target"], atol=0.02 * distance(turned)
        )

        two = [middle - 60j, middle + 60j]
        await fingers.move(two, [at + 70 - 30j for at in two])
        panned = await state(page)
        assert np.isclose(distance(panned), distance(nearer), rtol=1e-2)
        target = nearer["camera"]["target"]
        seen = await page.evaluate("(point) => viewer.camera.seen(point, viewer.aspect)", target)
        assert np.allclose(seen[:2], [140 / width, 60 / height], atol=0.02)
        assert panned["decals"] == before["decals"]

        await fingers.move(two, [at + 30 for at in two], stays=1)  # a finger that stays goes on panning
        await fingers.move([two[1] + 30], [two[1] + 30 + 50j], down=False)
        assert (await state(page))["decals"] == before["decals"]
        assert await page.evaluate("[scrollX, scrollY, visualViewport.scale]") == [0, 0, 1]


def distance(shown: dict[str, Any]) -> float:
    """Return the distance of the camera from its target."""
    camera = shown["camera"]
    return float(np.linalg.norm(np.subtract(camera["position"], camera["target"])))


class Fingers:
    """Fingers on a page in Chromium, which makes touch and pointer events of them; places are complex."""

    def __init__(self, session: CDPSession) -> None:
        self._session = session

    async def move(
        self, starts: list[complex], ends: list[complex], *, down: bool = True, stays: int = 0
    ) -> None:
        """Put fingers down, unless they are, move them in five steps, and lift all but the last ``stays``."""
        if down:
            for count in range(1, len(starts) + 1):
                await self._send("touchStart", starts[:count])
        for step in range(1, 6):
            await self._send("touchMove", [a + (b - a) * step / 5 for a, b in zip(starts, ends, strict=True)])
        for count in range(len(ends) - 1, stays - 1, -1):
            await self._send("touchEnd", ends[len(ends) - count :], first=len(ends) - count)

    async def _send(self, kind: str, places: list[complex], first: int = 0) -> None:
        points = [{"x": at.real, "y": at.imag, "id": first + n} for n, at in enumerate(places)]
        await self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


async def drags(browser: str) -> None:
    """Drags of a page leave the decals where the same drags of the editor do."""
    for scene, options in (
        (meshed(smooth_scene()), {}),
        (smooth_scene(), {"surface": "traced"}),
        (cube_scene(), {}),
    ):
        await dragged_alike(scene, browser, **options)


def smooth_scene() -> Scene:
    """Return scales on a tree without creases, at which the closest surface is on either side."""
    tree = Point((0, 0, 0), radius=1) + Segment((0.5, 0, 0), (2, 0, 0), radius=0.4)
    return decals.cover(tree, count=60, images=["scale"])


def cube_scene() -> Scene:
    """Return a box with decals that go over its edges."""
    return decals.cover(decals.MeshObject("box", *_box((0, 0, 0))), count=20, images=["tile"])


PATHS = ((-0.1, 0.05), (0.08, -0.12)), ((0.02, -0.25), (0.2, 0.1)), ((-0.25, -0.05), (0.05, 0.1))
"""Starts and ends of drags, in the page from −1 to 1."""
STEPS = 5
INSIDE = 6
"""Pixels by which a drag begins inside the image of its decal, at least."""


async def dragged_alike(scene: Scene, browser: str, **options: Any) -> None:
    """Drag decals in a page and in the editor, and compare the scene that the page saves."""
    async with shown(scene, (700, 600), browser=browser, controls=True, **options) as page:
        box = await page.locator("canvas").bounding_box()
        assert box is not None
        width, height = box["width"], box["height"]
        rays = scene.camera.rays(width, height)
        actions = Actions(EditSession(scene))
        tools = PointerTools(actions, lambda x, y: (rays.origin, rays.directions(x, y)))
        for path in PATHS:
            (x, y), (to_x, to_y) = (((1 + a) * width / 2, (1 + b) * height / 2) for a, b in path)
            x, y = on_a_decal(tools, x, y)
            await pull(page, (box["x"] + x, box["y"] + height - y), (to_x - x, y - to_y))
            number = (await state(page))["selected"]
            tools.press(x, y)
            tools.release(x, y)
            assert list(actions.state.selection) == [number]
            tools.press(x, y)
            for step in np.linspace(0, 1, STEPS + 1)[1:]:
                tools.move(x + step * (to_x - x), y + step * (to_y - y))
            tools.release(to_x, to_y)
        saved = (await saved_scene(page, browser)).decals
        edited = actions.state.session.document.scene.decals
        radii = edited.radii
        assert np.array_equal(saved.radii, radii)
        apart = np.linalg.norm(saved.positions - edited.positions, axis=1) / radii
        turned = np.abs(saved.normals - edited.normals).max(), np.abs(saved.tangents - edited.tangents).max()
        print(
            f"positions {apart.max():.2g} radii apart, normals and tangents {turned[0]:.2g}, {turned[1]:.2g}"
        )
        still = np.linalg.norm(scene.decals.positions - edited.positions, axis=1) / radii
        assert still.max() > 0.5
        assert apart.max() < CLOSE
        assert max(turned) < TURNED


def on_a_decal(tools: PointerTools, x: float, y: float) -> tuple[float, float]:
    """Return the pixel nearest to one at which a decal shows, and some pixels around it the same decal."""
    steps = sorted(product(range(-10, 11), repeat=2), key=lambda step: math.hypot(*step))
    for right, up in steps:
        middle = x + INSIDE * right, y + INSIDE * up
        picks = [tools.at(middle[0] + a, middle[1] + b) for a, b in product((-INSIDE, 0, INSIDE), repeat=2)]
        owners = {-1 if pick is None else pick.owner for pick in picks}
        if len(owners) == 1 and owners != {-1}:
            return middle
    raise AssertionError(f"no decal near {x}, {y}")


def same_surface(one: SceneObject, other: SceneObject) -> bool:
    """Return True for two meshes with the same vertices, or two equal trees."""
    if isinstance(one, decals.MeshObject) and isinstance(other, decals.MeshObject):
        return np.array_equal(one.vertices, other.vertices)
    return (
        isinstance(one, decals.TreeObject) and isinstance(other, decals.TreeObject) and one.tree == other.tree
    )


REFUSALS = {
    "no WebGL 2": "HTMLCanvasElement.prototype.getContext = () => null",
    "cannot draw float textures": "WebGL2RenderingContext.prototype.getExtension = () => null",
    "textures have 7 texels here": "WebGL2RenderingContext.prototype.getParameter = () => 7",
    "refuses a shader": "WebGL2RenderingContext.prototype.getProgramParameter = () => false",
}
"""What devices lack, by the words with which a page says so, and as a script that takes it away."""


async def refusals(browser: str) -> None:
    """A page says in one line what a device lacks, beside its picture."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.html"
        decals.save_html(decals.cover(Point((0, 0, 0), radius=1), count=10), path, resolution=CELLS)
        async with async_playwright() as player:
            application = await launched(player, browser)
            for words, script in REFUSALS.items():
                page = await application.new_page()
                await page.add_init_script(script)
                await page.goto(path.as_uri())
                await page.wait_for_function(STARTED, timeout=120_000)
                (line,) = await page.locator("main p").all_inner_texts()
                assert line.startswith("The model cannot be turned here: "), line
                assert words in line, line
                assert await page.locator("main img").evaluate("image => image.naturalWidth") > 0
                assert await page.locator("canvas").count() == 0
            await application.close()


async def state(page: Page) -> dict[str, Any]:
    """Return what the viewer says of itself, after the next frame."""
    await page.evaluate("new Promise(requestAnimationFrame)")
    found: dict[str, Any] = await page.evaluate("viewer.get()")
    return found


async def hit(page: Page, x: float, y: float) -> Any:
    """Return the point of the surface at a place of the picture."""
    return await page.evaluate("([x, y]) => viewer.pick(x, y).surface.position", [x, y])


SAVED = """() => new Promise((resolve) => {
  const make = URL.createObjectURL;
  URL.createObjectURL = (blob) => {
    blob.text().then(resolve);
    return make.call(URL, blob);
  };
  document.querySelector("[name=save]").click();
})"""


async def saved_scene(page: Page, browser: str) -> Scene:
    """Return the scene that the page saves; playwright has no downloads of Firefox, whose text is taken."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.json"
        if browser == "firefox":
            path.write_text(await page.evaluate(SAVED), encoding="utf-8")
            return decals.load_scene(path)
        async with page.expect_download() as download:
            await page.get_by_role("button", name=re.compile("Save")).click()
        await (await download.value).save_as(path)
        return decals.load_scene(path)


def with_rows(scene: Scene, rows: list[Any]) -> Scene:
    """Return a scene with the places, frames and radii of the decals of a page."""
    columns = {"positions": "position", "normals": "normal", "tangents": "tangent", "radii": "radius"}
    arrays = {name: np.array([row[key] for row in rows]) for name, key in columns.items()}
    return scene.replace(decals=scene.decals.replace(**arrays))


async def accessible(page: Page) -> None:
    """Make sure that axe-core finds nothing in the page."""
    assert [item["id"] for item in await violations(page)] == []


CHECKS = {
    "picture": picture,
    "sizes": sizes,
    "use": use,
    "touch": touch,
    "mounts": mounts,
    "address": address,
    "losses": losses,
    "drags": drags,
    "refusals": refusals,
}


if __name__ == "__main__":
    asyncio.run(CHECKS[sys.argv[1]](*(sys.argv[2:] or ["chromium"])))
    print("done")
