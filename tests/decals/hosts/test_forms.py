"""Each form of the exported shader, in GLSL and WGSL, finds what the oracle and `evaluate` find."""

import pytest

from decals import Contact, shader
from decals.hosts.code import VERSIONS
from decals.rendering import Context
from decals.rendering.decal_library import Form
from tests.decals.hosts import wgpu_host
from tests.decals.hosts.agreement import equal_pixels, wrong_values
from tests.decals.hosts.form_scenes import name_of, points_on, scene_of
from tests.decals.hosts.moderngl_host import at_points

POINTS = 2000


@pytest.mark.ordinary_cases("elastic", "radial-layered-limited-nested-materials")
@pytest.mark.parametrize("form", Form.all(), ids=name_of)
def test_values_of_each_form(context: Context, form: Form) -> None:
    scene = scene_of(form)
    points, normals = points_on(scene, POINTS)
    for version in VERSIONS:
        exported = shader(scene, version=version, prefix="x_")
        assert exported.form == form
        if form.limited:
            exported.uniforms["x_surface_receivers"] = exported.receivers(scene.objects[0])
        values = at_points(context.gl, exported, points, normals)
        assert wrong_values(form, scene, points, normals, values) == [], version


# -- WGSL ----------------------------------------------------------------------------------------------


SIZE = (160, 120)
FORMS = [Form(contact) for contact in Contact] + [
    Form(contact, True, True, True, True) for contact in Contact
]


@pytest.mark.ordinary_cases("radial-layered-limited-nested-materials")
@pytest.mark.parametrize("form", Form.all(), ids=name_of)
def test_naga_takes_each_form(form: Form) -> None:
    if reason := wgpu_host.missing_translator():
        pytest.skip(reason)
    exported = shader(scene_of(form), version="450", prefix="x_")
    text = wgpu_host.wgsl(wgpu_host.fragment_of(exported), "frag")
    assert "textureSampleGrad" in text
    assert text.count("@group(0) @binding(") == 2 + len(exported.textures)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS, ids=name_of)
def test_pictures_equal_those_of_render(form: Form) -> None:
    if reason := wgpu_host.missing_translator() or wgpu_host.missing_adapter():
        pytest.skip(reason)
    scene = scene_of(form)
    shown = wgpu_host.picture(shader(scene, version="450"), scene, SIZE)
    assert equal_pixels(shown, scene) >= 0.995
