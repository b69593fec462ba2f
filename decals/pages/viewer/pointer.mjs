// Mouse and touch: decals are dragged, the model is turned, and the picture is moved and zoomed.
import { add, subtract } from "./vectors.mjs";

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
    for (const [name, call] of Object.entries(handlers))
      this.canvas.addEventListener(name, call, { passive: false });
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
    if (this.fingers.size > 1) this.drag = { move: (now, before, id) => this.pinch(now, before, id) };
    else if (event.button > 0 || event.shiftKey) this.drag = { move: (now, before) => this.pan(now, before) };
    else this.drag = this.grab(...this.place(event));
  }

  // Take hold of the decal at a place, or of the model.
  grab(x, y) {
    const { viewer } = this;
    const number = viewer.decalAt(x, y);
    const hit = number < 0 ? null : viewer.surfaceAt(x, y);
    if (!hit) return { move: (now, before) => this.orbit(now, before), click: { selected: -1 } };
    viewer.set({ selected: number });
    const offset = subtract(viewer.decals.rows[number].position, hit.position);
    return { move: (now) => this.dragDecal(now, offset) };
  }

  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before || !this.drag) return;
    const now = this.place(event);
    if (now[0] === before[0] && now[1] === before[1]) return;
    this.drag.move(now, before, event.pointerId);
    this.drag.moved = true;
    this.fingers.set(event.pointerId, now);
    this.viewer.changed("view");
  }

  // Move the decal so that the point that was taken hold of stays under the pointer.
  dragDecal([x, y], offset) {
    const { viewer, drag } = this;
    const seen = viewer.surfaceAt(x, y);
    if (!seen) return;
    const middle = viewer.camera.seen(add(seen.position, offset), viewer.aspect);
    viewer.moveTo((middle && viewer.surfaceAt(...middle)) ?? seen, { open: drag.open });
    drag.open = true;
  }

  orbit(now, before) {
    this.viewer.camera.orbit(0.5 * Math.PI * (now[0] - before[0]), 0.5 * Math.PI * (now[1] - before[1]));
  }

  pan(now, before, share = 0.5) {
    const { camera, aspect } = this.viewer;
    camera.pan(share * (now[0] - before[0]) * aspect, share * (now[1] - before[1]));
  }

  // Zoom by the distance of two fingers, and move the picture with their middle.
  pinch(now, before, id) {
    const other = [...this.fingers].find(([finger]) => finger !== id)?.[1];
    if (!other) return;
    const apart = ([x, y]) => Math.hypot((x - other[0]) * this.viewer.aspect, y - other[1]);
    this.viewer.camera.zoom(apart(before) / Math.max(apart(now), 1e-3));
    this.pan(now, before, 0.25);
  }

  up(event) {
    this.fingers.delete(event.pointerId);
    if (this.drag?.click && !this.drag.moved) this.viewer.set(this.drag.click);
    if (!this.fingers.size) this.drag = null; // a finger that stays goes on with the same drag
  }

  wheel(event) {
    event.preventDefault();
    this.viewer.camera.zoom(Math.exp(0.0015 * event.deltaY));
    this.viewer.changed("view");
  }
}
