// Mouse and touch: decals are dragged, the model is turned, and the picture is moved and zoomed.
import { add, carried, subtract } from "./vectors.mjs";

export class Pointer {
  constructor(viewer) {
    Object.assign(this, { viewer, canvas: viewer.canvas, fingers: new Map(), drag: null });
    for (const name of ["pointerdown", "pointermove", "lostpointercapture", "wheel"])
      this.canvas.addEventListener(name, (event) => this[name](event));
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
    const pans = this.fingers.size > 1 || event.button > 0 || event.shiftKey;
    this.drag = pans ? { move: this.pan } : this.grab(...this.place(event));
  }

  // Take hold of the decal at a place, or of the model.
  grab(x, y) {
    const [{ viewer }, { number, surface }] = [this, this.viewer.pick(x, y)];
    if (number < 0) return { move: this.orbit, click: { selected: -1 } };
    viewer.set({ selected: number });
    const offset = subtract(viewer.decals.rows[number].position, surface.position);
    return { move: this.dragDecal, offset, normal: surface.normal };
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
    const [{ viewer, drag }, { surface }] = [this, this.viewer.pick(x, y)];
    if (!surface) return;
    const middle = add(surface.position, carried(drag.offset, drag.normal, surface.normal));
    drag.step = viewer.moveTo(viewer.closestTo(middle) ?? surface, drag.step);
  }

  orbit(now, [x, y]) {
    this.viewer.moveCamera("orbit", 0.5 * Math.PI * x, 0.5 * Math.PI * y);
  }

  // Move the picture with the middle of all fingers, and zoom by the distance of two.
  pan(now, [x, y], id) {
    const { viewer, fingers } = this;
    const other = [...fingers].find(([finger]) => finger !== id)?.[1];
    if (other) {
      const apart = (place) => Math.hypot((place[0] - other[0]) * viewer.aspect, place[1] - other[1]);
      viewer.moveCamera("zoom", apart(fingers.get(id)) / Math.max(apart(now), 1e-3));
    }
    viewer.moveCamera("pan", x / fingers.size, y / fingers.size, viewer.aspect);
  }

  // A pointer is up, or the browser has taken it away.
  lostpointercapture(event) {
    this.fingers.delete(event.pointerId);
    if (this.drag?.click && !this.drag.moved) this.viewer.set(this.drag.click);
    if (!this.fingers.size) this.drag = null; // a finger that stays goes on with the same drag
  }

  wheel(event) {
    event.preventDefault();
    this.viewer.moveCamera("zoom", Math.exp(0.0015 * event.deltaY));
  }
}
