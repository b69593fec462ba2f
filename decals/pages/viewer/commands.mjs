// What buttons and keys do, by the names of the buttons and of the keys without one.
import { copyLink, save } from "./files.mjs";
import { turned } from "./vectors.mjs";

const TURN = Math.PI / 12; // of a decal, at a press
const SCALE = 1.1;
const ZOOM = 1.1; // of the camera, at a press

export const COMMANDS = {
  undo: (viewer) => viewer.history.undo(),
  redo: (viewer) => viewer.history.redo(),
  add: (viewer) => viewer.addAt(0, 0),
  remove: (viewer) => viewer.edit([[viewer.selected, null]]),
  left: (viewer) => viewer.editSelected((row) => ({ tangent: turned(row.tangent, row.normal, TURN) })),
  right: (viewer) => viewer.editSelected((row) => ({ tangent: turned(row.tangent, row.normal, -TURN) })),
  smaller: (viewer) => viewer.editSelected(({ radius }) => ({ radius: radius / SCALE })),
  larger: (viewer) => viewer.editSelected(({ radius }) => ({ radius: radius * SCALE })),
  home: (viewer) => viewer.set({ camera: viewer.home }),
  link: copyLink,
  save,
  n: (viewer) => viewer.select(1),
  p: (viewer) => viewer.select(-1),
  escape: (viewer) => viewer.set({ selected: -1 }),
  arrowleft: (viewer) => viewer.arrow(-1, 0),
  arrowright: (viewer) => viewer.arrow(1, 0),
  arrowup: (viewer) => viewer.arrow(0, 1),
  arrowdown: (viewer) => viewer.arrow(0, -1),
  "+": (viewer) => viewer.moveCamera("zoom", 1 / ZOOM),
  "=": (viewer) => viewer.moveCamera("zoom", 1 / ZOOM),
  "-": (viewer) => viewer.moveCamera("zoom", ZOOM),
};
