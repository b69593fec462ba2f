from pathlib import Path

import pytest

from blobtree.graphics import (
    GL_LIBRARIES,
    Loader,
    install_advice,
    missing_gl_libraries,
    require_gl,
)
from decals.errors import NoGraphics

ROOT = Path(__file__).parents[2]


def loader_without(*absent: str) -> Loader:
    def load(name: str) -> object:
        if name in absent:
            raise OSError(f"{name}: cannot open shared object file: No such file or directory")
        return object()

    return load


@pytest.mark.parametrize("absent", [[], ["libEGL.so.1"], ["libGL.so.1"], ["libEGL.so.1", "libGL.so.1"]])
def test_exactly_the_absent_libraries_are_named(absent: list[str]) -> None:
    assert missing_gl_libraries(load=loader_without(*absent), platform="linux") == absent


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_other_systems_bring_their_own(platform: str) -> None:
    load = loader_without(*GL_LIBRARIES)
    assert missing_gl_libraries(load=load, platform=platform) == []
    require_gl(load=load, platform=platform)


def test_nothing_happens_where_all_is_here() -> None:
    require_gl(load=loader_without(), platform="linux")


def test_the_error_says_what_was_expected_what_came_and_what_to_do() -> None:
    with pytest.raises(NoGraphics) as caught:
        require_gl(load=loader_without("libEGL.so.1"), platform="linux")
    message = str(caught.value)
    assert "needs the system libraries libEGL.so.1 and libGL.so.1" in message
    assert "; libEGL.so.1 cannot be loaded" in message
    assert "apt-get install --no-install-recommends libegl1 (" in message


def test_the_advice_names_every_missing_package() -> None:
    assert "libegl1 libgl1" in install_advice(["libEGL.so.1", "libGL.so.1"])


def test_the_set_up_installs_the_same_libraries() -> None:
    script = (ROOT / ".ci" / "install-gl").read_text(encoding="utf-8")
    for library, package in GL_LIBRARIES.items():
        assert f'"{library}"' in script
        assert f" {package}" in script
