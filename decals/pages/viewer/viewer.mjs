// A page's viewer: the model with its decals, which are picked, dragged, turned, scaled, added and deleted.
import { Camera } from "./camera.mjs";
import { Controls } from "./controls.mjs";
import { DecalSet, History, isDecal } from "./decals.mjs";
import { read, written } from "./link.mjs";
import { Mesh, firstHit } from "./meshes.mjs";
import { toBase64, unpacked } from "./packing.mjs";
import { Painter } from "./painter.mjs";
import { Pointer } from "./pointer.mjs";
import { add, carried, cross, length, scaled, subtract, tangential, turned, unit } from "./vectors.mjs";

const TURN = Math.PI / 12; // of a decal, at a press
const SCALE = 1.1;
const ORBIT = Math.PI / 24; // of the model, at a press
const RIM_POINTS = 48;
const STIFF = "elastic"; // the contact mode that has a stiffness
const OWN_SIZE = 0.05; // radius of the first decal, in sizes of the model

class Viewer {
  constructor(root, { header, arrays }, options) {
    Object.assign(this, { header, arrays, listeners: new Map(), selected: -1, waiting: false });
    const modes = Object.keys(header.shaders.modes);
    this.controls = new Controls(root, { ...header, modes, ...options }, this);
    this.canvas = this.controls.canvas;
    this.painter = new Painter(this.canvas, header, arrays);
    this.meshes = header.meshes.map(
      (mesh, i) => new Mesh(mesh, arrays[`vertices ${i}`], arrays[`faces ${i}`], arrays[`normals ${i}`]),
    );
    this.decals = new DecalSet(header.scene.decals, header.rules);
    this.originals = this.decals.rows.slice();
    this.history = new History(this.decals, () => this.changed("decals"));
    this.camera = new Camera(header.camera, header.bounds, header.aspect);
    this.home = this.camera.pose;
    Object.assign(this, { mode: header.mode, stiffness: header.stiffness, lit: true });
    this.pointer = new Pointer(this);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.canvas);
  }

  // -- the five functions ---------------------------------------------------------------------------------

  get() {
    const { camera, mode, stiffness, selected, decals } = this;
    return { camera: camera.pose, mode, stiffness, selected, decals: decals.rows.slice(), link: this.link() };
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
    setTimeout(() => this.painter.programOf(this.mode, "pick", this.decals.full)); // so that the first click does not wait
  }

  get aspect() {
    return this.canvas.width / this.canvas.height;
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    this.canvas.width = Math.max(1, Math.round(clientWidth * devicePixelRatio));
    this.canvas.height = Math.max(1, Math.round(clientHeight * devicePixelRatio));
    this.changed("view");
  }

  changed(event) {
    for (const call of this.listeners.get(event) ?? []) call(this.get());
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.waiting = false;
    if (!this.decals.rows[this.selected]) this.selected = -1;
    this.painter.draw(this);
    const { mode, stiffness, selected, history } = this;
    const [canUndo, canRedo] = [history.done.length > 0, history.undone.length > 0];
    this.controls.show({ mode, stiffness, selected, canUndo, canRedo, stiff: mode === STIFF }, this.rim());
  }

  // The rim of the selected decal, in pixels of the page.
  rim() {
    const row = this.decals.rows[this.selected];
    if (!row) return [];
    const [u, v] = [row.tangent, cross(row.normal, row.tangent)];
    const points = [];
    for (let i = 0; i < RIM_POINTS; i++) {
      const angle = (2 * Math.PI * i) / RIM_POINTS;
      const out = add(scaled(u, row.radius * Math.cos(angle)), scaled(v, row.radius * Math.sin(angle)));
      const seen = this.camera.seen(add(row.position, out), this.aspect);
      if (!seen) return [];
      const { clientWidth, clientHeight } = this.canvas;
      points.push([((1 + seen[0]) * clientWidth) / 2, ((1 - seen[1]) * clientHeight) / 2]);
    }
    return points;
  }

  // -- what lies at a place of the picture, from −1 to 1 ---------------------------------------------------

  surfaceAt(x, y) {
    return firstHit(this.meshes, this.camera.position, this.camera.direction(x, y, this.aspect));
  }

  decalAt(x, y) {
    const { width, height } = this.canvas;
    const column = Math.min(Math.floor(((1 + x) * width) / 2), width - 1);
    return this.painter.owner(this, column, Math.min(Math.floor(((1 + y) * height) / 2), height - 1));
  }

  // -- edits ----------------------------------------------------------------------------------------------

  // Change decals, with normals and tangents made perpendicular and of length 1; others than valid ones stay.
  edit(pairs, options) {
    const framed = (row) => {
      const normal = unit(row.normal);
      return { ...row, normal, tangent: tangential(row.tangent, normal) };
    };
    const isValid = (row) => !row || isDecal(row, this.header.rules, this.header.images.count);
    const changes = pairs
      .map(([number, row]) => [number, row && framed(row)])
      .filter(([, row]) => isValid(row));
    if (changes.length) this.history.change(changes, options);
  }

  editSelected(change, options) {
    const row = this.decals.rows[this.selected];
    if (row) this.edit([[this.selected, { ...row, ...change(row) }]], options);
  }

  // Move the selected decal to a point of the surface; its image is carried along.
  moveTo({ position, normal }, options) {
    this.editSelected(
      (row) => ({ position, normal, tangent: carried(row.tangent, row.normal, normal) }),
      options,
    );
  }

  // Move the selected decal along the surface, by parts of its radius as seen.
  nudge(right, up) {
    const row = this.decals.rows[this.selected];
    const along = this.camera.upAlong(row.normal);
    const step = add(scaled(cross(along, row.normal), right * row.radius), scaled(along, up * row.radius));
    const start = add(add(row.position, step), scaled(row.normal, row.radius));
    const hit = firstHit(this.meshes, start, scaled(row.normal, -1));
    if (hit && length(subtract(hit.position, row.position)) < 3 * row.radius) this.moveTo(hit);
  }

  turn(angle) {
    this.editSelected((row) => ({ tangent: turned(row.tangent, row.normal, angle) }));
  }

  scale(factor) {
    this.editSelected((row) => ({ radius: row.radius * factor }));
  }

  addAt(x, y) {
    const hit = this.surfaceAt(x, y);
    if (!hit) return this.controls.say("There is no surface: turn the model so that some is in the middle.");
    const like = this.decals.rows[this.selected] ?? this.decals.rows[this.decals.numbers[0]];
    const row = like ?? { radius: OWN_SIZE * this.camera.size, image: this.header.images.count ? 0 : -1 };
    const number = this.decals.rows.length;
    const { position, normal } = hit;
    this.edit([[number, { ...row, position, normal, tangent: this.camera.upAlong(normal) }]]);
    this.set({ selected: number });
  }

  select(step) {
    const { numbers } = this.decals;
    if (!numbers.length) return;
    const at = numbers.indexOf(this.selected);
    const next = at < 0 ? (step > 0 ? 0 : numbers.length - 1) : at + step;
    this.set({ selected: numbers[(next + numbers.length) % numbers.length] });
    this.controls.say(`Decal ${this.selected} is selected.`);
  }

  // Arrow keys: move the selected decal, or turn the model.
  arrow(right, up) {
    if (this.selected >= 0) return this.nudge(0.25 * right, 0.25 * up);
    this.camera.orbit(ORBIT * right, ORBIT * up);
    this.changed("view");
  }

  run(command) {
    const commands = {
      undo: () => this.history.undo(),
      redo: () => this.history.redo(),
      add: () => this.addAt(0, 0),
      remove: () => this.selected >= 0 && this.edit([[this.selected, null]]),
      left: () => this.turn(TURN),
      right: () => this.turn(-TURN),
      smaller: () => this.scale(1 / SCALE),
      larger: () => this.scale(SCALE),
      home: () => this.set({ camera: this.home }),
      link: () => this.copyLink(),
      save: () => this.save(),
    };
    commands[command]();
  }

  // -- links and files --------------------------------------------------------------------------------------

  // The fragment of this state; null if it is too long for a link.
  link() {
    return written(this, this.originals);
  }

  copyLink() {
    const link = this.link();
    if (link === null) {
      this.controls.say("So many decals have changed that no link can hold them: save a scene file.");
      return;
    }
    try {
      history.replaceState(null, "", `#${link}`);
    } catch {
      this.controls.say("A page inside a notebook has no link of its own: save a scene file.");
      return;
    }
    const done = () =>
      this.controls.say("The link of this state is in the address bar and in the clipboard.");
    const refused = () => this.controls.say("The link of this state is in the address bar.");
    (navigator.clipboard?.writeText(location.href) ?? Promise.reject()).then(done, refused);
  }

  // The scene as a file that `decals.load_scene` takes.
  sceneText() {
    const { scene } = this.header;
    const objects = scene.objects.map((object, i) => {
      if (object.type !== "mesh") return object;
      const data = {};
      for (const name of ["vertices", "faces"])
        data[name] = toBase64(new Uint8Array(this.arrays[`${name} of ${i}`].buffer));
      return { ...object, data };
    });
    const drawing = { ...scene.drawing, contact: this.mode, stiffness: this.stiffness };
    const moved = this.camera.position !== this.home.position;
    const camera = moved ? { ...scene.camera, ...this.camera.pose, fit: undefined } : scene.camera;
    const decals = this.decals.rows.filter((row) => row);
    return JSON.stringify({ ...scene, objects, drawing, camera, decals });
  }

  save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([this.sceneText()], { type: "application/json" }));
    link.download = "scene.json";
    link.click();
    URL.revokeObjectURL(link.href);
    this.controls.say("The scene is saved as scene.json.");
  }
}

// Show a scene in an element, and return its viewer, which has `set`, `get`, `on` and `dispose`.
export async function mount(root, data, options = {}) {
  const viewer = new Viewer(root, await unpacked(data), options);
  if (options.link) viewer.set({ link: options.link });
  viewer.start();
  return viewer;
}
