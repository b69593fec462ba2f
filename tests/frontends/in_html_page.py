"""Pages of `save_html` in a real browser, as a program: ``python -m tests.frontends.in_html_page NAME``."""

import asyncio
import re
import sys
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from playwright.async_api import Page, async_playwright

import decals
from blobtree import Point, Segment, polygonize
from decals.rendering.lights import Lighting
from decals.scenes.scene import Scene
from tests.frontends.browsing import ERRORS, browser_path

SIZE = 400, 300
TOLERANCE = 2
"""Levels of 255 by which a page may differ from a picture."""
EQUAL = 0.995
"""Least share of surface pixels that are equal within the tolerance."""
UNLIT = Lighting(())
CELLS = 48
ARGUMENTS = ["--no-sandbox", "--ignore-gpu-blocklist"]
MESA = "--use-angle=gl-egl"
"""Draws by Mesa, which our pictures use too: SwiftShader places vertices at sixteenths of pixels."""
SOFTWARE = "--use-angle=swiftshader"

PIXELS = """() => {
  const { canvas, painter } = viewer;
  viewer.lit = false;
  painter.draw(viewer);
  const bytes = new Uint8Array(4 * canvas.width * canvas.height);
  painter.gl.readPixels(0, 0, canvas.width, canvas.height, painter.gl.RGBA, painter.gl.UNSIGNED_BYTE, bytes);
  return { width: canvas.width, height: canvas.height, bytes: Array.from(bytes) };
}"""


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


SCENES = {"tree": tree_scene, "layered": layered_scene}


@asynccontextmanager
async def shown(
    scene: Scene, size: tuple[int, int] = SIZE, *, software: bool = False, **options: Any
) -> AsyncIterator[Page]:
    """A page of a scene in a browser, which asks for nothing but its file; ``software``: by SwiftShader."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.html"
        decals.save_html(scene, path, resolution=CELLS, **options)
        async with async_playwright() as player:
            browser = await player.chromium.launch(
                executable_path=browser_path(), args=[*ARGUMENTS, SOFTWARE if software else MESA]
            )
            page = await browser.new_page(viewport={"width": size[0], "height": size[1]})
            requests: list[str] = []
            page.on("request", lambda request: requests.append(request.url))
            await page.add_init_script(ERRORS)
            await page.goto(path.as_uri())
            await page.wait_for_function("globalThis.viewer !== undefined", timeout=120_000)
            yield page
            assert await page.evaluate("window.pageErrors") == []
            assert requests == [path.as_uri()], requests
            await browser.close()


async def pixels(page: Page) -> NDArray[np.uint8]:
    """Return the unlit picture of a page, ``uint8[h, w, 4]``, row 0 at the top."""
    found = await page.evaluate(PIXELS)
    return np.array(found["bytes"], np.uint8).reshape(found["height"], found["width"], 4)[::-1]


def share_of_equal(page: NDArray[np.uint8], scene: Scene) -> float:
    """Return the share of surface pixels that a page and a picture have alike, silhouettes left out."""
    size = page.shape[1], page.shape[0]
    picture = scene.render(size=size, samples=1, lights=UNLIT, background="transparent").pixels
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


async def shares(modes: int | None = None) -> AsyncIterator[float]:
    """Yield the share of equal pixels of each scene in some contact modes; by default in all."""
    for make in SCENES.values():
        scene = meshed(make())
        async with shown(scene, controls=False) as page:
            for contact in list(decals.Contact)[:modes]:
                await page.evaluate(f"viewer.set({{ mode: '{contact.name.lower()}' }})")
                drawn = scene.replace(drawing=scene.drawing.overridden(contact=contact))
                yield share_of_equal(await pixels(page), drawn)


async def picture() -> None:
    """Pages equal pictures, in all contact modes."""
    found = [share async for share in shares()]
    assert min(found) >= EQUAL, found


async def use() -> None:
    """A decal is dragged, turned, scaled, added and deleted; links, files and undo hold what happened."""
    scene = meshed(tree_scene())
    async with shown(scene, (700, 600)) as page:
        await page.evaluate("viewer.set({ link: 'mode=toString&d=0:1e300,0,0,0,0,0,0,0,0,1e300' })")
        before = await state(page)
        assert before["mode"] == scene.drawing.contact.name.lower()
        assert len(before["decals"]) == len(scene.decals)
        number = await page.evaluate("viewer.decalAt(0, 0)")
        assert number >= 0
        box = await page.locator("canvas").bounding_box()
        assert box is not None
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await drag(page, middle, (middle[0] + 40, middle[1] - 30))
        dragged = (await state(page))["decals"][number]
        place = await page.evaluate(
            "([x, y]) => viewer.surfaceAt(x, y)", [80 / box["width"], 60 / box["height"]]
        )
        offset = np.subtract(before["decals"][number]["position"], await hit(page, 0, 0))
        assert (
            np.linalg.norm(np.subtract(dragged["position"], place["position"]))
            < 1.5 * np.linalg.norm(offset) + 0.02
        )
        on_surface = scene.objects[0].surface.project([dragged["position"]])[0][0]
        assert np.linalg.norm(on_surface - dragged["position"]) < 1e-3
        assert abs(np.dot(dragged["normal"], dragged["tangent"])) < 1e-6
        moved = with_rows(scene, (await state(page))["decals"])
        assert share_of_equal(await pixels(page), moved) >= EQUAL
        for key in ("e", "e", "+", "n", "a", "Delete"):
            await page.keyboard.press(key)
        link = (await state(page))["link"]
        changed = (await state(page))["decals"]
        saved = await saved_scene(page)
        assert len(saved.decals) == sum(row is not None for row in changed)
        assert np.allclose(saved.decals.positions[number], dragged["position"], atol=1e-6)
        assert [item.name for item in saved.objects] == [item.name for item in scene.objects]
        for one, other in zip(saved.objects, scene.objects, strict=True):
            assert isinstance(one, decals.MeshObject)
            assert isinstance(other, decals.MeshObject)
            assert np.array_equal(one.vertices, other.vertices)
        for _ in range(20):
            await page.keyboard.press("Control+z")
        assert (await state(page))["decals"][: len(scene.decals)] == before["decals"]
        await page.evaluate("(link) => viewer.set({ link })", link)
        again = (await state(page))["decals"]
        assert np.allclose(again[number]["position"], dragged["position"], rtol=1e-4, atol=1e-5)
        await accessible(page)


async def state(page: Page) -> dict[str, Any]:
    """Return what the viewer says of itself, after the next frame."""
    await page.evaluate("new Promise(requestAnimationFrame)")
    found: dict[str, Any] = await page.evaluate("viewer.get()")
    return found


async def hit(page: Page, x: float, y: float) -> Any:
    """Return the point of the surface at a place of the picture."""
    return await page.evaluate("([x, y]) => viewer.surfaceAt(x, y).position", [x, y])


async def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag the mouse in several steps."""
    await page.mouse.move(*start)
    await page.mouse.down()
    await page.mouse.move(*end, steps=5)
    await page.mouse.up()


async def saved_scene(page: Page) -> Scene:
    """Return the scene that the page saves."""
    async with page.expect_download() as download:
        await page.get_by_role("button", name=re.compile("Save")).click()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.json"
        await (await download.value).save_as(path)
        return decals.load_scene(path)


def with_rows(scene: Scene, rows: list[Any]) -> Scene:
    """Return a scene with the places, frames and radii of the decals of a page."""
    columns = {"positions": "position", "normals": "normal", "tangents": "tangent", "radii": "radius"}
    arrays = {name: np.array([row[key] for row in rows]) for name, key in columns.items()}
    return scene.replace(decals=scene.decals.replace(**arrays))


async def accessible(page: Page) -> None:
    """Make sure that axe-core finds nothing serious in the page."""
    found = find_spec("axe_playwright_python")
    assert found is not None
    assert found.origin is not None, "pip install axe-playwright-python"
    await page.evaluate((Path(found.origin).parent / "axe.min.js").read_text(encoding="utf-8"))
    violations = await page.evaluate("axe.run().then(result => result.violations)")
    serious = [item["id"] for item in violations if item["impact"] in ("serious", "critical")]
    assert serious == [], serious


CHECKS = {"picture": picture, "use": use}


if __name__ == "__main__":
    asyncio.run(CHECKS[sys.argv[1]]())
    print("done")
