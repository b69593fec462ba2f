// Mouse and touch: decals are dragged, the model is turned, and the picture is moved and zoomed.
import { add, carried, subtract } from "./vectors.mjs";

export class Pointer {
  constructor(viewer) {
    Object.assign(this, { viewer, canvas: viewer.canvas, fingers: new Map(), drag: null });
    for (const name of ["pointerdown", "pointermove", "pointerup", "wheel"])
      this.canvas.addEventListener(name, (event) => this[name](event));
    this.canvas.addEventListener("pointercancel", (event) => this.pointerup(event));
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  // The place of an event in the picture, from −1 to 1.
  place({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return [(2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height];
  }

  pointerdown(event) {
    event.preventDefault();
    this.canvas.focus();
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, this.place(event));
    if (this.fingers.size > 1) this.drag = { move: this.pinch };
    else if (event.button > 0 || event.shiftKey) this.drag = { move: this.pan };
    else this.drag = this.grab(...this.place(event));
  }

  // Take hold of the decal at a place, or of the model.
  grab(x, y) {
    const { viewer } = this;
    const number = viewer.decalAt(x, y);
    const hit = number < 0 ? null : viewer.surfaceAt(x, y);
    if (!hit) return { move: this.orbit, click: { selected: -1 } };
    viewer.set({ selected: number });
    const offset = subtract(viewer.decals.rows[number].position, hit.position);
    return { move: this.dragDecal, offset, normal: hit.normal };
  }

  pointermove(event) {
    const before = this.fingers.get(event.pointerId);
    const now = this.place(event);
    if (!before || !this.drag || `${now}` === `${before}`) return;
    this.drag.move.call(this, now, subtract([...now, 0], [...before, 0]), event.pointerId);
    this.drag.moved = true;
    this.fingers.set(event.pointerId, now);
  }

  // Move the decal so that the point that was taken hold of stays under the pointer, as `DecalDrag` of the editor.
  dragDecal([x, y]) {
    const { viewer, drag } = this;
    const hit = viewer.surfaceAt(x, y);
    if (!hit) return;
    const middle = add(hit.position, carried(drag.offset, drag.normal, hit.normal));
    viewer.moveTo(viewer.closestTo(middle) ?? hit, { open: drag.moved });
  }

  orbit(now, [x, y]) {
    this.viewer.moveCamera("orbit", 0.5 * Math.PI * x, 0.5 * Math.PI * y);
  }

  pan(now, [x, y]) {
    const share = 0.5 / this.fingers.size;
    this.viewer.moveCamera("pan", share * x * this.viewer.aspect, share * y);
  }

  // Zoom by the distance of two fingers, and move the picture with their middle.
  pinch(now, step, id) {
    const other = [...this.fingers].find(([finger]) => finger !== id)?.[1];
    if (!other) return;
    const apart = ([x, y]) => Math.hypot((x - other[0]) * this.viewer.aspect, y - other[1]);
    this.viewer.moveCamera("zoom", apart(this.fingers.get(id)) / Math.max(apart(now), 1e-3));
    this.pan(now, step);
  }

  pointerup(event) {
    this.fingers.delete(event.pointerId);
    if (this.drag?.click && !this.drag.moved) this.viewer.set(this.drag.click);
    if (!this.fingers.size) this.drag = null; // a finger that stays goes on with the same drag
  }

  wheel(event) {
    event.preventDefault();
    this.viewer.moveCamera("zoom", Math.exp(0.0015 * event.deltaY));
  }
}
