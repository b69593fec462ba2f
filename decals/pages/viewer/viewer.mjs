// A page's viewer: the model with its decals, which are picked, dragged, turned, scaled, added and deleted.
import { Camera } from "./camera.mjs";
import { Controls } from "./controls.mjs";
import { DecalSet, framed, wrongValue } from "./decals.mjs";
import { keepLink } from "./files.mjs";
import { History } from "./history.mjs";
import { read, written } from "./link.mjs";
import { unpacked } from "./packing.mjs";
import { Painter } from "./painter.mjs";
import { Pointer } from "./pointer.mjs";
import { add, carried, cross, dot, length, scaled, subtract } from "./vectors.mjs";

const OWN_SIZE = 0.05; // radius of the first decal, in sizes of the model
const ROUNDS = 4; // in which the closest surface is found
const NARROW = 1; // angle of view, in degrees, of a look along one ray
const STEP = 0.25; // of a decal, in radii, at a press
const ORBIT = Math.PI / 24; // of the model, at a press
const COARSE = 1 / 3; // side of the first picture, in sides of the next ones: it is there sooner
const KEPT_AFTER = 500; // milliseconds without a change after which the address holds the state
const LOST = "The graphics card has let this picture go. It returns as soon as the browser allows it.";

export class Viewer {
  constructor(root, { header, arrays }, options) {
    const { mode, stiffness, scene, rules } = header;
    Object.assign(this, { header, arrays, mode, stiffness, originals: scene.decals });
    Object.assign(this, { selected: -1, sample: 0, listeners: new Map(), address: options.address });
    this.controls = new Controls(root, { ...header, ...options }, this);
    this.canvas = this.controls.canvas;
    this.painter = new Painter(this.canvas, header, arrays);
    this.decals = new DecalSet(scene.decals, rules);
    this.history = new History(this.decals, () => this.changed("decals"));
    this.camera = new Camera(header.camera, header.bounds, header.aspect);
    this.pointer = new Pointer(this);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.canvas);
    for (const change of ["lost", "restored"])
      this.canvas.addEventListener(`webglcontext${change}`, (event) => this.renew(event));
  }

  // -- the five functions ---------------------------------------------------------------------------------

  get() {
    const { mode, stiffness, selected } = this;
    const [camera, decals] = [this.camera.pose, this.decals.rows.slice()];
    return { camera, mode, stiffness, selected, decals, link: written(this) };
  }

  // Change the camera, the contact mode, the stiffness, decals ({number: row or null}), or the state of a link.
  set({ link, camera, mode, stiffness, decals, selected } = {}) {
    if (link) this.set(read(link, this.originals, this.decals.rows));
    if (camera) this.camera.place(camera);
    if (Object.hasOwn(this.header.shaders.modes, mode ?? "")) this.mode = mode;
    if (stiffness >= 1 && stiffness <= this.header.rules.maxStiffness) this.stiffness = Number(stiffness);
    if (decals) this.edit(Object.entries(decals).map(([number, row]) => [Number(number), row]));
    if (selected !== undefined) this.selected = this.decals.rows[selected] ? selected : -1;
    this.changed("view");
  }

  on(event, call) {
    this.listeners.set(event, [...(this.listeners.get(event) ?? []), call]);
  }

  dispose() {
    cancelAnimationFrame(this.frame);
    this.observer.disconnect();
    this.painter.gl.getExtension("WEBGL_lose_context")?.loseContext();
    this.controls.root.replaceChildren();
  }

  // -- the picture ----------------------------------------------------------------------------------------

  // Let the picture have the pixels of the screen, or for a coarse one only a part of them along each side.
  resize(part = 1) {
    const { canvas } = this;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio * part));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * devicePixelRatio * part));
    this.aspect = canvas.width / canvas.height;
    this.camera.fitTo(this.aspect);
    this.changed("view", false);
  }

  // The browser has taken all textures away, as when the graphics card is reset, or allows new ones.
  renew(event) {
    event.preventDefault(); // without that it never allows any
    if (!this.painter.gl.isContextLost()) this.painter = new Painter(this.canvas, this.header, this.arrays);
    this.changed("view");
  }

  // Tell of a change, and draw; the address keeps changes, but not the size of the window.
  changed(event, keeps = this.address) {
    this.controls.say(this.painter.gl.isContextLost() ? LOST : (this.refused ?? ""));
    if (event === "view") this.refused = "";
    for (const call of this.listeners.get(event) ?? []) call(this.get());
    this.sample = 0;
    this.request();
    if (!keeps) return;
    clearTimeout(this.rest);
    this.rest = setTimeout(() => keepLink(this, this.get()), KEPT_AFTER);
  }

  request() {
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.draw());
  }

  // Draw the next sample of the picture; further ones follow, each after the one before it, until it changes.
  draw() {
    if (this.painter.gl.isContextLost()) return;
    if (this.sample > 0 && this.painter.isBusy()) return this.request();
    if (!this.decals.rows[this.selected]) this.selected = -1;
    this.painter.draw(this, this.sample);
    this.controls.show(this);
    if (++this.sample < this.header.samples.length) this.request();
  }

  // -- what lies at a place of the picture, from −1 to 1 ---------------------------------------------------

  // The number of the decal, −1 for none, and the surface, null for none.
  pick(x, y, camera = this.camera) {
    return this.painter.pick({ ...this, camera }, [x, y]);
  }

  // The visible surface that is closest to a point beside it: it lies there along the normal.
  closestTo(point, place = point, rounds = ROUNDS, found = null) {
    const seen = rounds && this.camera.seen(place, this.aspect);
    const hit = seen && this.pick(...seen).surface;
    if (!hit) return found;
    const above = scaled(hit.normal, dot(subtract(hit.position, point), hit.normal));
    return this.closestTo(point, add(point, above), rounds - 1, hit);
  }

  // -- edits ----------------------------------------------------------------------------------------------

  // Change decals, with normals and tangents made perpendicular and of length 1; decals with a value that a scene cannot
  // have stay, and a line says so. Rows of the scene stay the same objects. What is returned continues the step.
  edit(pairs, step) {
    const isOwn = ([number, row]) => !row || row === this.originals[number];
    const given = pairs.map((pair) => (isOwn(pair) ? pair : [pair[0], framed(pair[1])]));
    const wrong = ([number, row]) => row && wrongValue({ ...row, number }, this.header.rules);
    const refused = given.find(wrong);
    this.refused = refused && `Decal ${refused[0]} stays: no scene can have its ${wrong(refused)}.`;
    const changes = given.filter((pair) => pair[1] !== this.decals.rows[pair[0]] && !wrong(pair));
    return changes.length ? this.history.change(changes, step) : step;
  }

  // Change decals by a function of their rows.
  editRows(numbers, change, step) {
    const rows = numbers.map((number) => [number, this.decals.rows[number]]).filter(([, row]) => row);
    const changed = rows.map(([number, row]) => [number, { ...row, ...change(row) }]);
    return this.edit(changed, step);
  }

  editSelected = (change, step) => this.editRows([this.selected], change, step);

  // Move the selected decal to a point of the surface; its image is carried along.
  moveTo(hit, step) {
    const along = ({ tangent, normal }) => carried(tangent, normal, hit.normal);
    return this.editSelected((row) => ({ ...hit, tangent: along(row) }), step);
  }

  // Move the selected decal along the surface, to where a look from above ends; or turn the model.
  arrow(right, up) {
    if (this.selected < 0) return this.moveCamera("orbit", ORBIT * right, ORBIT * up);
    const row = this.decals.rows[this.selected];
    const along = this.camera.upAlong(row.normal);
    const step = add(scaled(cross(along, row.normal), right), scaled(along, up));
    const hit = this.under(row, add(row.position, scaled(step, STEP * row.radius)), along);
    if (hit && length(subtract(hit.position, row.position)) < 3 * row.radius) this.moveTo(hit);
  }

  // The surface that is seen at a place, from a radius above it along the normal of a decal; null for none.
  under({ normal, radius }, target, up) {
    const above = { position: add(target, scaled(normal, radius)), target, up, fov: NARROW };
    return this.pick(0, 0, new Camera(above, this.header.bounds)).surface;
  }

  addAt(x, y) {
    const hit = this.pick(x, y).surface;
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
    this.set({ selected: numbers.at((at + step) % numbers.length) });
    if (this.selected >= 0) this.controls.say(`Decal ${this.selected} is selected.`);
  }

  // Move the camera by a function of its own; pictures that are narrower from then on show as much from left to right.
  moveCamera(how, ...amounts) {
    const { pose } = this.camera;
    this.camera.pose = { ...pose, aspect: pose.aspect || this.aspect, ...this.camera[how](pose, ...amounts) };
    this.changed("view");
  }
}

// Show a scene in an element, and return its viewer, which has `set`, `get`, `on` and `dispose`.
export async function mount(root, data, options = {}) {
  const viewer = new Viewer(root, await unpacked(data), options);
  if (options.link) viewer.set({ link: options.link });
  viewer.resize(COARSE); // the observer of the canvas calls for a fine picture next
  options.prepare?.(viewer); // of pages that have more than a viewer
  viewer.draw();
  const { gl } = viewer.painter;
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until the picture is there
  performance.mark("first frame");
  setTimeout(() => viewer.painter.decalProgram("pick", viewer)); // so that the first click does not wait
  return viewer;
}

// The same, in place of a picture: it comes back where nothing can be mounted, with the reason, and null is returned.
export function mountOver(root, data, { reason, ...options }) {
  const picture = root.firstElementChild;
  return mount(root, data, options).catch((error) => {
    root.className = "";
    root.replaceChildren(picture);
    picture.lastElementChild.textContent = `${reason} ${error.message}`;
    return null;
  });
}
