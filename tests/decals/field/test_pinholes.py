"""Points that an image reaches, in the rim of a nearer decal whose image ends before them, stay bare."""

import pytest

from decals import Contact
from tests.decals.placed_by_hand import FAMILIES, MODELS, pinholes, placed


@pytest.mark.parametrize("contact", [mode.name.lower() for mode in Contact])
@pytest.mark.parametrize("family", FAMILIES)
def test_decals_placed_by_hand_have_few_pinholes(family: str, contact: str) -> None:
    for model in MODELS.values():
        mesh = model()
        assert pinholes(placed(mesh, 3, **FAMILIES[family]), mesh, 20_000, contact) < 0.01
