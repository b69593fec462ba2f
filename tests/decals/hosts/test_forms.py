"""Each form of the exported shader, in each version, finds what the oracle and `evaluate` find."""

import pytest

from decals import shader
from decals.hosts.code import VERSIONS
from decals.rendering import Context
from decals.rendering.decal_library import Form
from tests.decals.hosts.agreement import wrong_values
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
