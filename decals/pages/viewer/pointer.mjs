// Mouse, touch and keys of a viewer.
import { subtract, add } from "./vectors.mjs";

const ZOOM = 1.1; // of the camera, at a press
const KEYS = {
  n: (viewer) => viewer.select(1),
  p: (viewer) => viewer.select(-1),
  a: (viewer) => viewer.run("add"),
  q: (viewer) => viewer.run("left"),
  e: (viewer) => viewer.run("right"),
  l: (viewer) => viewer.run("link"),
  s: (viewer) => viewer.run("save"),
  delete: (viewer) => viewer.run("remove"),
  backspace: (viewer) => viewer.run("remove"),
  home: (viewer) => viewer.run("home"),
  escape: (viewer) => viewer.set({ selected: -1 }),
  arrowleft: (viewer) => viewer.arrow(-1, 0),
  arrowright: (viewer) => viewer.arrow(1, 0),
  arrowup: (viewer) => viewer.arrow(0, 1),
  arrowdown: (viewer) => viewer.arrow(0, -1),
  "+": (viewer) => grow(viewer, "larger", 1 / ZOOM),
  "=": (viewer) => grow(viewer, "larger", 1 / ZOOM),
  "-": (viewer) => grow(viewer, "smaller", ZOOM),
};
const COMMANDS = { z: "undo", y: "redo" };

// Scale the selected decal by a command, or the distance of the camera by a factor.
function grow(viewer, command, factor) {
  if (viewer.selected >= 0) return viewer.run(command);
  viewer.camera.zoom(factor);
  viewer.changed("view");
}

export class Pointer {
  constructor(viewer) {
    Object.assign(this, { viewer, canvas: viewer.canvas, fingers: new Map(), drag: null });
    const handlers = {
      pointerdown: (event) => this.down(event),
      pointermove: (event) => this.move(event),
      pointerup: (event) => this.up(event),
      pointercancel: (event) => this.up(event),
      wheel: (event) => this.wheel(event),
      contextmenu: (event) => event.preventDefault(),
    };
    for (const [name, call] of Object.entries(handlers)) {
      this.canvas.addEventListener(name, call, { passive: false });
    }
    viewer.controls.root.addEventListener("keydown", (event) => this.key(event));
  }

  // The place of an event in the picture, from −1 to 1.
  place({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return [(2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height];
  }

  down(event) {
    event.preventDefault();
    this.canvas.focus();
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, this.place(event));
    if (this.fingers.size > 1) {
      this.drag = { kind: "pinch" };
    } else if (event.button > 0 || event.shiftKey) {
      this.drag = { kind: "pan" };
    } else {
      this.drag = this.grab(...this.place(event));
    }
  }

  // Take hold of the decal at a place, or of the model.
  grab(x, y) {
    const { viewer } = this;
    const number = viewer.decalAt(x, y);
    const hit = number < 0 ? null : viewer.surfaceAt(x, y);
    if (!hit) return { kind: "orbit", moved: false };
    viewer.set({ selected: number });
    return {
      kind: "decal",
      offset: subtract(viewer.decals.rows[number].position, hit.position),
      open: false,
    };
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before || !this.drag) return;
    const now = this.place(event);
    const [x, y] = [now[0] - before[0], now[1] - before[1]];
    if (!x && !y) return;
    const { camera } = this.viewer;
    if (this.drag.kind === "decal") this.dragDecal(now);
    if (this.drag.kind === "orbit") camera.orbit(0.5 * Math.PI * x, 0.5 * Math.PI * y);
    if (this.drag.kind === "pan") camera.pan(0.5 * x * this.viewer.aspect, 0.5 * y);
    if (this.drag.kind === "pinch") this.pinch(event.pointerId, before, now);
    this.drag.moved = true;
    this.fingers.set(event.pointerId, now);
    this.viewer.changed("view");
  }

  // Move the decal so that the point that was taken hold of stays under the pointer.
  dragDecal([x, y]) {
    const { viewer } = this;
    const seen = viewer.surfaceAt(x, y);
    if (!seen) return;
    const middle = viewer.camera.seen(add(seen.position, this.drag.offset), viewer.aspect);
    const hit = (middle && viewer.surfaceAt(...middle)) ?? seen;
    viewer.moveTo(hit, { open: this.drag.open });
    this.drag.open = true;
  }

  // Zoom by the distance of two fingers, and move the picture with their middle.
  pinch(id, before, now) {
    const other = [...this.fingers].find(([finger]) => finger !== id)?.[1];
    if (!other) return;
    const apart = ([x, y]) => Math.hypot((x - other[0]) * this.viewer.aspect, y - other[1]);
    const { camera } = this.viewer;
    camera.zoom(apart(before) / Math.max(apart(now), 1e-3));
    camera.pan(0.25 * (now[0] - before[0]) * this.viewer.aspect, 0.25 * (now[1] - before[1]));
  }

  up(event) {
    this.fingers.delete(event.pointerId);
    if (this.drag?.kind === "orbit" && !this.drag.moved) this.viewer.set({ selected: -1 });
    if (this.fingers.size) return; // the finger that stays does nothing
    this.drag = null;
  }

  wheel(event) {
    event.preventDefault();
    this.viewer.camera.zoom(Math.exp(0.0015 * event.deltaY));
    this.viewer.changed("view");
  }

  key(event) {
    const name = event.key.toLowerCase();
    if (event.target.matches("select, input")) return; // these have keys of their own
    const command = event.ctrlKey || event.metaKey ? COMMANDS[name] : null;
    const redo = command === "undo" && event.shiftKey;
    const call = command ? () => this.viewer.run(redo ? "redo" : command) : !event.ctrlKey && KEYS[name];
    if (!call) return;
    event.preventDefault();
    call(this.viewer);
  }
}
