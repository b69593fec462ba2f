// What buttons and keys do, by the names of the buttons and of the keys without one.
import { copyLink, save } from "./files.mjs";

const TURN = Math.PI / 12; // of a decal, at a press
const SCALE = 1.1;
const STEP = 0.25; // of a decal, in radii
const ORBIT = Math.PI / 24; // of the model, at a press
const ZOOM = 1.1; // of the camera, at a press

export const COMMANDS = {
  undo: (viewer) => viewer.history.undo(),
  redo: (viewer) => viewer.history.redo(),
  add: (viewer) => viewer.addAt(0, 0),
  remove: (viewer) => viewer.edit([[viewer.selected, null]]),
  left: (viewer) => viewer.turn(TURN),
  right: (viewer) => viewer.turn(-TURN),
  smaller: (viewer) => viewer.scale(1 / SCALE),
  larger: (viewer) => viewer.scale(SCALE),
  home: (viewer) => viewer.set({ camera: viewer.home }),
  link: copyLink,
  save,
  n: (viewer) => viewer.select(1),
  p: (viewer) => viewer.select(-1),
  escape: (viewer) => viewer.set({ selected: -1 }),
  arrowleft: (viewer) => arrow(viewer, -1, 0),
  arrowright: (viewer) => arrow(viewer, 1, 0),
  arrowup: (viewer) => arrow(viewer, 0, 1),
  arrowdown: (viewer) => arrow(viewer, 0, -1),
  "+": (viewer) => zoom(viewer, 1 / ZOOM),
  "=": (viewer) => zoom(viewer, 1 / ZOOM),
  "-": (viewer) => zoom(viewer, ZOOM),
};

// Move the selected decal, or turn the model.
function arrow(viewer, right, up) {
  if (viewer.selected >= 0) return viewer.nudge(STEP * right, STEP * up);
  viewer.camera.orbit(ORBIT * right, ORBIT * up);
  viewer.changed("view");
}

function zoom(viewer, factor) {
  viewer.camera.zoom(factor);
  viewer.changed("view");
}
