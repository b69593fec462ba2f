"""A shader of decals in three.js, by `onBeforeCompile`, in a browser without a screen."""

import base64
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, Route, sync_playwright

from decals import Scene
from decals.hosts import Shader
from decals.surfaces.normals import vertex_normals
from tests.decals.hosts.moderngl_host import linear
from tests.frontends.browsing import browser_path

PACKAGE = "three@0.187.0"
PAGE = Path(__file__).with_name("three_host.html")
ADDRESS = "http://three.test/"
ARGUMENTS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]
PATIENCE = 240_000
"""Milliseconds: the browser compiles shaders on the processor."""


def missing(folder: Path) -> str | None:
    """Install three.js in a folder; what is missing to show the page with it, or None."""
    if browser_path() is None:
        return "no Chromium here (on Debian: apt-get install --no-install-recommends chromium)"
    npm = shutil.which("npm")
    if npm is None:
        return "npm is not installed, which installs three.js"
    ran = subprocess.run([npm, "install", "--silent", "--prefix", folder, PACKAGE], capture_output=True)
    return f"npm could not install {PACKAGE}" if ran.returncode else None


@contextmanager
def three_page(folder: Path) -> Iterator[Page]:
    """The page in Chromium, with three.js from a folder of `missing`; it must write no error."""
    written: list[str] = []

    def answer(route: Route) -> None:
        name = route.request.url.removeprefix(ADDRESS)
        build = folder / "node_modules" / "three" / "build"
        route.fulfill(path=PAGE if not name else build / name)

    with sync_playwright() as player:
        browser = player.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        page = browser.new_page()
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: written.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: written.append(str(error)))
        page.route(f"{ADDRESS}**", answer)
        page.goto(ADDRESS)
        page.wait_for_function("window.ready")
        yield page
        assert written == [], written[0][:2000]
        browser.close()


def picture(
    page: Page, shader: Shader, scene: Scene, size: tuple[int, int], *, lit: bool = False
) -> np.ndarray:
    """The meshes of a scene, without light or under lights of three.js; see `moderngl_host.picture`."""
    assert shader.version == "300 es"
    view = scene.camera.view()
    projection = scene.camera.clip_matrix(size, scene.bounds) @ np.linalg.inv(view)
    given: dict[str, Any] = {
        "prefix": shader.prefix,
        "code": shader.code,
        "uniforms": shader.uniforms,
        "size": size,
        "view": view.T.ravel().tolist(),
        "projection": projection.T.ravel().tolist(),
        "textures": [
            {
                "name": texture.name,
                "kind": texture.kind,
                "format": texture.format,
                "size": texture.size,
                "filter": texture.filter,
                "mips": texture.mips,
                "array": encoded(texture.array),
            }
            for texture in shader.textures
        ],
        "objects": [object_of(item, shader) for item in scene.objects],
    }
    pixels = page.evaluate("([given, lit]) => draw(given, lit)", [given, lit])
    return np.array(pixels, np.uint8).reshape(size[1], size[0], 4)[::-1]


def object_of(item: Any, shader: Shader) -> dict[str, Any]:
    """A mesh of a scene for the page."""
    return {
        "position": encoded(item.vertices.astype(np.float32)),
        "normal": encoded(vertex_normals(item.vertices, item.faces)),
        "faces": encoded(item.faces.astype(np.uint32)),
        "color": linear(np.asarray(item.color)).tolist(),
        "receivers": shader.receivers(item),
    }


def encoded(array: np.ndarray) -> str:
    """The bytes of an array as text."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
