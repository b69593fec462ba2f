"""The exported shader: values of all its forms, its names, and pictures of other programs with it."""

import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from decals import Contact, Scene, shader
from decals.hosts.code import VERSIONS, code_of
from decals.rendering import Context
from decals.rendering.decal_library import Form
from tests.decals.hosts import moderngl_host, wgpu_host
from tests.decals.hosts.agreement import equal_pixels, wrong_values
from tests.decals.hosts.form_scenes import name_of, points_on, scene_of
from tests.decals.hosts.glsl_names import global_names

TARGETS = {"forms_failed": "0", "forms": "≥ 192", "unprefixed_names": "0", "host_pixels_equal": "≥ 0.995"}

PREFIX = "x_"
POINTS, QUICK_POINTS = 2000, 500
SIZE, QUICK_SIZE = (320, 240), (160, 120)


def measure(*, quick: bool) -> dict[str, float]:
    """Compare all forms, or with ``quick`` every eleventh, and draw pictures of some."""
    forms = Form.all()[:: 11 if quick else 1]
    with Context.standalone() as context, context.current():
        failed = sum(map(len, (failures(context, form, QUICK_POINTS if quick else POINTS) for form in forms)))
        shares = dict(pictures(context, QUICK_SIZE if quick else SIZE))
    shares |= dict(pictures_elsewhere(QUICK_SIZE if quick else SIZE))
    return {
        "forms_failed": failed,
        "forms": len(forms) * len(VERSIONS),
        "unprefixed_names": sum(map(unprefixed_names, forms)),
        "host_pixels_equal": min(shares.values()),
        **shares,
    }


def failures(context: Context, form: Form, count: int) -> list[str]:
    """The versions in which a form does not compile, or finds other values."""
    scene = scene_of(form)
    points, normals = points_on(scene, count)
    failed = []
    for version in VERSIONS:
        exported = shader(scene, version=version, prefix=PREFIX)
        if form.limited:
            exported.uniforms[f"{PREFIX}surface_receivers"] = exported.receivers(scene.objects[0])
        try:
            values = moderngl_host.at_points(context.gl, exported, points, normals)
            wrong = wrong_values(form, scene, points, normals, values)
        except Exception as error:
            wrong = [repr(error)]
        if wrong:
            print(f"{name_of(form)}, {version}: {', '.join(wrong)}")
            failed.append(version)
    return failed


def unprefixed_names(form: Form) -> int:
    """Number of names of a form, over all versions and stages, without the prefix."""
    codes = (
        code_of(form, version, stage, PREFIX)
        for version, language in VERSIONS.items()
        for stage in language.stages
    )
    return sum(not name.startswith(PREFIX) for code in codes for name in global_names(code.text))


def scenes() -> list[Scene]:
    """Scenes of all contact modes, with layers, masks and materials and without."""
    forms = [Form(contact) for contact in Contact]
    forms += [Form(contact, True, True, True, True) for contact in Contact]
    return list(map(scene_of, forms))


def pictures(context: Context, size: tuple[int, int]) -> Iterator[tuple[str, float]]:
    """Yield the least share of equal pixels of moderngl in its versions over some scenes."""
    for version in ("330 core", "300 es"):
        shares = (
            equal_pixels(
                moderngl_host.picture(context.gl, shader(scene, version=version), scene, size), scene
            )
            for scene in scenes()
        )
        yield f"pixels_moderngl_{version.replace(' ', '_')}", min(shares)


def pictures_elsewhere(size: tuple[int, int]) -> Iterator[tuple[str, float]]:
    """Yield the same of three.js and wgpu-py; print why one of them cannot draw here."""
    if reason := wgpu_host.missing_translator() or wgpu_host.missing_adapter():
        print(f"without wgpu-py: {reason}")
    else:
        shares = (
            equal_pixels(wgpu_host.picture(shader(scene, version="450"), scene, size), scene)
            for scene in scenes()
        )
        yield "pixels_wgpu", min(shares)
    if find_spec("playwright") is None:
        print("without three.js: playwright is not installed (pip install playwright)")
        return
    from tests.decals.hosts import three_host

    with tempfile.TemporaryDirectory() as folder:
        if reason := three_host.missing(Path(folder)):
            print(f"without three.js: {reason}")
            return
        with three_host.three_page(Path(folder)) as page:
            shares = (
                equal_pixels(three_host.picture(page, shader(scene, version="300 es"), scene, size), scene)
                for scene in scenes()
            )
            yield "pixels_three", min(shares)
