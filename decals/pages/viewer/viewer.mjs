// A page's viewer: the model with its decals, which are picked, dragged, turned, scaled, added and deleted.
import { Camera } from "./camera.mjs";
import { COMMANDS } from "./commands.mjs";
import { Controls } from "./controls.mjs";
import { DecalSet, framed, isDecal } from "./decals.mjs";
import { History } from "./history.mjs";
import { read, written } from "./link.mjs";
import { unpacked } from "./packing.mjs";
import { Painter } from "./painter.mjs";
import { Pointer } from "./pointer.mjs";
import { add, carried, cross, dot, length, scaled, subtract } from "./vectors.mjs";

const OWN_SIZE = 0.05; // radius of the first decal, in sizes of the model
const GRAZING = 0.05; // cosine between ray and normal below which a place within a pixel is not sought
const ROUNDS = 4; // in which the closest surface is found
const NARROW = 1; // angle of view, in degrees, of a look along one ray
const STEP = 0.25; // of a decal, in radii, at a press
const ORBIT = Math.PI / 24; // of the model, at a press

class Viewer {
  constructor(root, { header, arrays }, options) {
    Object.assign(this, { header, arrays, listeners: new Map(), selected: -1, waiting: false, sample: 0 });
    this.controls = new Controls(root, { ...header, ...options }, this);
    this.canvas = this.controls.canvas;
    this.painter = new Painter(this.canvas, header, arrays);
    this.decals = new DecalSet(header.scene.decals, header.rules);
    this.originals = this.decals.rows.slice();
    this.history = new History(this.decals, () => this.changed("decals"));
    this.camera = new Camera(header.camera, header.bounds, header.aspect);
    this.home = this.camera.pose;
    Object.assign(this, { mode: header.mode, stiffness: header.stiffness });
    this.pointer = new Pointer(this);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.canvas);
  }

  // -- the five functions ---------------------------------------------------------------------------------

  get() {
    const { mode, stiffness, selected } = this;
    const [camera, decals] = [this.camera.pose, this.decals.rows.slice()];
    return { camera, mode, stiffness, selected, decals, link: written(this) };
  }

  // Change the camera, the contact mode, the stiffness, decals ({number: row or null}), or the state of a link.
  set({ link, camera, mode, stiffness, decals, selected }) {
    if (link !== undefined) {
      const { changes, ...state } = read(link, this.originals);
      if (changes.length) this.edit(changes);
      this.set(state);
    }
    if (camera) this.camera.place(camera);
    if (Object.hasOwn(this.header.shaders.modes, mode ?? "")) this.mode = mode;
    if (stiffness >= 1) this.stiffness = stiffness;
    if (decals) this.edit(Object.entries(decals).map(([number, row]) => [Number(number), row]));
    if (selected !== undefined) this.selected = this.decals.rows[selected] ? selected : -1;
    this.changed("view");
  }

  on(event, call) {
    this.listeners.set(event, [...(this.listeners.get(event) ?? []), call]);
  }

  dispose() {
    this.observer.disconnect();
    this.painter.gl.getExtension("WEBGL_lose_context")?.loseContext();
    this.controls.root.replaceChildren();
  }

  // -- the picture ----------------------------------------------------------------------------------------

  start() {
    this.resize();
    this.draw();
    this.painter.finish();
    performance.mark("first frame");
    setTimeout(() => this.painter.decalProgram("pick", this)); // so that the first click does not wait
  }

  get aspect() {
    return this.canvas.width / this.canvas.height;
  }

  resize() {
    const { canvas } = this;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * devicePixelRatio));
    this.changed("view");
  }

  changed(event) {
    for (const call of this.listeners.get(event) ?? []) call(this.get());
    this.sample = 0;
    this.request();
  }

  request() {
    if (!this.waiting) requestAnimationFrame(() => this.refine());
    this.waiting = true;
  }

  // Draw the next sample of the picture; further ones follow, each after the one before it, until it changes.
  refine() {
    this.waiting = false;
    if (this.sample > 0 && this.painter.isBusy) this.request();
    else this.draw();
  }

  draw() {
    if (!this.decals.rows[this.selected]) this.selected = -1;
    this.painter.draw(this, this.sample);
    this.controls.show(this);
    this.sample += 1;
    if (this.sample < this.header.samples.length) this.request();
  }

  // -- what lies at a place of the picture, from −1 to 1 ---------------------------------------------------

  pixel(...place) {
    const { width, height } = this.canvas;
    return [width, height].map((side, axis) =>
      Math.min(Math.max(Math.floor(((1 + place[axis]) * side) / 2), 0), side - 1),
    );
  }

  decalAt(x, y) {
    return this.painter.owner(this, this.pixel(x, y));
  }

  // The surface at a place: that in the middle of the pixel, moved along its tangent plane.
  surfaceAt(x, y) {
    const hit = this.painter.surface(this.camera, this.pixel(x, y));
    if (!hit) return null;
    const eye = this.camera.position;
    const ray = this.camera.direction(x, y, this.aspect);
    const facing = dot(ray, hit.normal);
    if (Math.abs(facing) < GRAZING) return hit;
    const distance = dot(subtract(hit.position, eye), hit.normal) / facing;
    return { position: add(eye, scaled(ray, distance)), normal: hit.normal };
  }

  // The visible surface that is closest to a point beside it: it lies there along the normal.
  closestTo(point) {
    let [found, place] = [null, point];
    for (let round = 0; round < ROUNDS; round++) {
      const seen = this.camera.seen(place, this.aspect);
      const hit = seen && this.surfaceAt(...seen);
      if (!hit) break;
      found = hit;
      place = add(point, scaled(hit.normal, dot(subtract(hit.position, point), hit.normal)));
    }
    return found;
  }

  // -- edits ----------------------------------------------------------------------------------------------

  // Change decals, with normals and tangents made perpendicular and of length 1; others than valid ones stay.
  edit(pairs, options) {
    const { rules, images } = this.header;
    const changes = pairs
      .map(([number, row]) => [number, row && framed(row)])
      .filter(([, row]) => !row || isDecal(row, rules, images));
    if (changes.length) this.history.change(changes, options);
  }

  editSelected(change, options) {
    const row = this.decals.rows[this.selected];
    if (row) this.edit([[this.selected, { ...row, ...change(row) }]], options);
  }

  // Move the selected decal to a point of the surface; its image is carried along.
  moveTo(hit, options) {
    this.editSelected((row) => ({ ...hit, tangent: carried(row.tangent, row.normal, hit.normal) }), options);
  }

  // Move the selected decal along the surface, by parts of its radius as seen: to where a look from above ends.
  nudge(right, up) {
    const { position, normal, radius } = this.decals.rows[this.selected];
    const along = this.camera.upAlong(normal);
    const step = add(scaled(cross(along, normal), right * radius), scaled(along, up * radius));
    const target = add(position, step);
    const above = { position: add(target, scaled(normal, radius)), target, up: along, fov: NARROW };
    const { bounds, aspect } = this.header;
    const hit = this.painter.surface(new Camera(above, bounds, aspect), this.pixel(0, 0));
    if (hit && length(subtract(hit.position, position)) < 3 * radius) this.moveTo(hit);
  }

  addAt(x, y) {
    const hit = this.surfaceAt(x, y);
    if (!hit) return this.controls.say("There is no surface: turn the model so that some is in the middle.");
    const like = this.decals.rows[this.selected] ?? this.decals.rows[this.decals.numbers[0]];
    const row = like ?? { radius: OWN_SIZE * this.camera.size, image: this.header.images ? 0 : -1 };
    const number = this.decals.rows.length;
    this.edit([[number, { ...row, ...hit, tangent: this.camera.upAlong(hit.normal) }]]);
    this.set({ selected: number });
  }

  // Select the next decal, or with −1 the one before.
  select(step) {
    const { numbers } = this.decals;
    const at = this.selected < 0 && step < 0 ? 0 : numbers.indexOf(this.selected);
    if (numbers.length) this.set({ selected: numbers.at((at + step) % numbers.length) });
    if (numbers.length) this.controls.say(`Decal ${this.selected} is selected.`);
  }

  // Move the selected decal, or turn the model.
  arrow(right, up) {
    if (this.selected >= 0) this.nudge(STEP * right, STEP * up);
    else this.moveCamera("orbit", ORBIT * right, ORBIT * up);
  }

  // Move the camera by a function of its own.
  moveCamera(how, ...amounts) {
    this.camera[how](...amounts);
    this.changed("view");
  }

  // Run a command of a button or a key; false if there is none.
  run(name) {
    if (!Object.hasOwn(COMMANDS, name)) return false;
    COMMANDS[name](this);
    return true;
  }
}

// Show a scene in an element, and return its viewer, which has `set`, `get`, `on` and `dispose`.
export async function mount(root, data, options = {}) {
  const viewer = new Viewer(root, await unpacked(data), options);
  if (options.link) viewer.set({ link: options.link });
  viewer.start();
  return viewer;
}
