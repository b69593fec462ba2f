"""three.js shows decals as `render` does: run by name, ``pytest -m browser``."""

from collections.abc import Iterator
from typing import Any

import pytest

from decals import Contact, shader
from decals.rendering.decal_library import Form
from tests.decals.hosts.agreement import equal_pixels
from tests.decals.hosts.form_scenes import name_of, scene_of
from tests.frontends.test_browser import require

pytestmark = pytest.mark.browser

SIZE = (160, 120)
FORMS = [Form(contact) for contact in Contact] + [
    Form(contact, True, True, True, True) for contact in Contact
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    require("playwright")
    from tests.decals.hosts.three_host import missing, three_page

    folder = tmp_path_factory.mktemp("three")
    if reason := missing(folder):
        pytest.skip(reason)
    with three_page(folder) as page:
        yield page


@pytest.mark.parametrize("form", FORMS, ids=name_of)
def test_pictures_equal_those_of_render(page: Any, form: Form) -> None:
    from tests.decals.hosts.three_host import picture

    scene = scene_of(form)
    shown = picture(page, shader(scene, version="300 es"), scene, SIZE)
    assert equal_pixels(shown, scene) >= 0.995


def test_lights_of_three_shine_on_decals(page: Any) -> None:
    """A standard material compiles with the decals before its lights, in spite of its macros and names."""
    from tests.decals.hosts.three_host import picture

    scene = scene_of(FORMS[-1])
    plain, lit = (
        picture(page, shader(scene, version="300 es"), scene, SIZE, lit=lit) for lit in (False, True)
    )
    seen = plain[..., 3] > 0
    assert (seen == (lit[..., 3] > 0)).all()
    assert lit[seen][:, :3].std(axis=0).min() > 10
    assert abs(lit[seen].astype(int) - plain[seen]).mean() > 5
