"""Forty decals by hand
====================

Figure 9 of the paper: a recorded session, replayed by the events of the window. It is shown after 12, 26 and
40 decals. Each decal is one click; a few keys change its size and image, and a last drag moves one among the
others.
"""

from collections.abc import Sequence

from blobtree import Ellipsoid
from decals import Contact, DecalImage, Scene, TreeObject
from decals.apps.gallery import SIDE
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, main
from decals.editing import Actions, EditSession, PointerTools

CLICKS = (
    *((156, 152, "++"), (140, 165, "i"), (149, 130, ""), (166, 174, ""), (114, 147, ""), (181, 137, "i")),
    *((140, 190, ""), (127, 120, "-"), (189, 169, ""), (104, 168, ""), (170, 107, ""), (167, 200, "")),
    *((105, 122, "+"), (207, 138, ""), (117, 195, "i"), (141, 94, ""), (196, 193, ""), (84, 157, "")),
    *((200, 104, ""), (145, 218, "-"), (105, 101, ""), (222, 160, ""), (87, 192, ""), (166, 80, "+")),
    *((193, 216, ""), (73, 130, ""), (222, 119, "i"), (118, 227, ""), (119, 79, ""), (226, 191, "")),
    *((67, 175, ""), (200, 81, "+"), (165, 238, ""), (75, 101, ""), (242, 142, ""), (90, 218, "")),
    *((148, 64, "-"), (215, 223, ""), (50, 143, ""), (226, 91, "")),
)
"""Pixel of each click from the lower left corner, and the keys that follow."""

DRAG = (156, 152), (160, 147), (166, 141)
"""Pixels of a press on a decal and of the moves that follow; the button is released at the last one."""

SHOWN = (12, 26, 40)
KEYS = {"+": "plus", "-": "minus", "i": "i"}
IMAGES = ("eye", "scale#4d8a57", "scale#2f7f95", "scale#c9a227", "scale#b5533c")


def panels() -> Sequence[Panel]:
    """Replay the session, and keep the scenes between its events."""
    camera = camera_at((1.3, -3.6, 2.2), fov=30.0)
    egg = TreeObject("egg", Ellipsoid((0, 0, 0), (1.0, 0.85, 0.8), color=CLAY))
    session = EditSession(
        Scene(objects=(egg,), camera=camera, images=tuple(DecalImage.load(name) for name in IMAGES))
    )
    rays = camera.rays(SIDE, SIDE)
    tools = PointerTools(Actions(session), lambda x, y: (rays.origin, rays.directions(x, y)))
    scenes = []
    tools.key("s", *DRAG[0], shift=True)
    for number, (x, y, keys) in enumerate(CLICKS, start=1):
        tools.press(x, y)
        tools.release(x, y)
        for key in keys:
            tools.key(KEYS[key], x, y)
        if number in SHOWN:
            scenes.append(session.document.scene)
    scenes.append(_dragged(tools, session))
    return [Panel(scene, contact=Contact.PRODUCT) for scene in scenes]


def _dragged(tools: PointerTools, session: EditSession) -> Scene:
    """Select a decal and drag it."""
    start, *moves = DRAG
    tools.key("w", *start)
    tools.press(*start)
    tools.release(*start)
    tools.press(*start)
    for position in moves:
        tools.move(*position)
    tools.release(*moves[-1])
    return session.document.scene


if __name__ == "__main__":
    main(panels)
