"""``implicit-decals demo``."""

from pathlib import Path

import pytest

from decals.apps.cli import run
from tests.apps.commands.pictures import picture

Capture = pytest.CaptureFixture[str]


@pytest.mark.slow
def test_demo_draws_three_pictures(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr("decals.apps.commands.demo.COUNT", 120)
    assert run(["demo", "--size", "80x60", "--samples", "1"]) == 0
    names = capsys.readouterr().out.split()
    assert names == ["out/hero.png", "out/contact.png", "out/span.png"]
    for name in names:
        assert picture(folder / name).shape == (60, 80, 4)
    assert run(["reproduce", "out/contact.png"]) == 0
    assert "out/contact.png: made again, equal bit for bit" in capsys.readouterr().out
