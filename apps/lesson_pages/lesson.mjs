// A lesson: its guess, sliders, tasks, probe and plots beside the viewer.
import { Camera } from "../../decals/pages/viewer/camera.mjs";
import { History } from "../../decals/pages/viewer/history.mjs";
import { unpacked } from "../../decals/pages/viewer/packing.mjs";
import { add, scaled } from "../../decals/pages/viewer/vectors.mjs";
import { Viewer } from "../../decals/pages/viewer/viewer.mjs";
import { send } from "./answers.mjs";
import { Measures, numbersOver } from "./measures.mjs";
import { drawCurves, drawMap } from "./plots.mjs";
import { puzzleOf, share, showScores } from "./puzzles.mjs";

const AXES = ["x", "y", "z"];
const LEAST = 1e-6; // that is not shown as 0: fields have the precision of float32
const RAY = 1; // angle of view, in degrees, of a look along one ray
const REST = 60; // milliseconds without a change, after which the whole map is read

// A value as a text: three digits, yes or no.
export function shown(value, words) {
  if (typeof value === "boolean") return value ? words.yes : words.no;
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) < LEAST) return "0";
  const digits = Math.abs(value) >= 100 ? value.toFixed(0) : String(Number(value.toPrecision(3)));
  return digits.replace(".", words.point);
}

class LessonPage {
  constructor(root, viewer, lesson, formulas) {
    Object.assign(this, { root, viewer, lesson, formulas, tried: false, probe: lesson.probe });
    this.measures = new Measures(viewer, lesson);
    this.sliders = [...root.querySelectorAll("[data-path]")];
    this.positions = this.sliders.map(() => 0);
    this.canvases = [...root.querySelectorAll(".plot canvas")];
    viewer.header.shaders.ends.measure = lesson.shader;
    for (const [number, input] of this.sliders.entries()) {
      input.addEventListener("input", () => this.slide(number, input.value));
      input.addEventListener("change", () => (this.step = null));
    }
    root.querySelector("[name=again]").addEventListener("click", () => this.begin());
    root.querySelector("[name=check]").addEventListener("click", () => this.check());
    root.querySelector("[name=share]")?.addEventListener("click", () => share(this));
    root.querySelector("[name=skip]")?.addEventListener("click", () => this.see(null));
    root.querySelector(".send")?.addEventListener("submit", (event) => {
      event.preventDefault();
      send(this, event.target);
    });
    root.querySelector("form.guess")?.addEventListener("submit", (event) => {
      event.preventDefault();
      this.see(Number(event.target.guess.value));
    });
    this.addProbe();
    for (const event of ["view", "decals"]) viewer.on(event, () => this.changed(event === "decals"));
    addEventListener("hashchange", () => {
      if (location.hash.startsWith("#puzzle=")) this.begin();
      this.goTo(location.hash);
    });
    this.begin();
    this.goTo(location.hash);
  }

  say(value) {
    return shown(value, this.lesson.words);
  }

  // The value of a formula at a point, or a text of HTML and formulas in turns.
  value(text, point = this.point) {
    return this.formulas[text](this.measures, point);
  }

  filled(parts) {
    return parts.map((part, i) => (i % 2 ? this.say(this.value(part)) : part)).join("");
  }

  // -- state ------------------------------------------------------------------------------------------------

  // Start the lesson, without contact if it asks for a guess.
  begin() {
    const { viewer, lesson } = this;
    for (const name of ["mode", "stiffness"]) viewer.set({ [name]: lesson[name] });
    viewer.header.uniforms.decal_mapping = ["1i", lesson.mappings.indexOf(lesson.mapping)];
    this.sliders.forEach((input) => (input.value = input.dataset.value));
    this.positions = this.sliders.map((input) => Number(input.dataset.place ?? 0));
    Object.assign(this, {
      probe: lesson.probe,
      tried: false,
      guess: undefined,
      step: null,
      waits: !!lesson.guess,
      puzzle: puzzleOf(location.hash, lesson),
    });
    this.history(this.waits ? viewer.originals : lesson.rows);
    viewer.set({ selected: -1, camera: viewer.camera.home });
    this.changed(true);
  }

  // Make these rows, in the sizes of the puzzle, the first ones: undo leads back to them.
  history(given) {
    const { viewer } = this;
    const rows = given.map((row, number) => ({ ...row, radius: this.puzzle.radii[number] }));
    viewer.history.change([...viewer.decals.rows.keys()].map((number) => [number, null]));
    viewer.history.change(rows.map((row, number) => [number, row]));
    viewer.history = new History(viewer.decals, () => viewer.changed("decals"));
  }

  // Take a guess, null for none, and switch contact on.
  see(guess) {
    Object.assign(this, { guess, waits: false });
    this.history(this.lesson.rows);
    this.viewer.set({});
    this.changed(true);
    this.root.querySelector(".question").focus();
  }

  slide(number, value) {
    const input = this.sliders[number];
    const { path } = input.dataset;
    const { viewer, lesson } = this;
    const amount = input.type === "range" ? Number(value) : value;
    const [first, which, name] = path.split(".");
    if (path === "contact") viewer.set({ mode: value });
    else if (path === "stiffness") viewer.set({ stiffness: amount });
    else if (path === "mapping")
      viewer.header.uniforms.decal_mapping = ["1i", lesson.mappings.indexOf(value)];
    else if (first === "probe")
      this.probe = this.probe.map((old, axis) => (AXES[axis] === which ? amount : old));
    else if (first === "decals") this.edit(which, name, amount);
    else this.positions[number] = input.selectedIndex ?? Math.round((amount - input.min) / input.step);
    viewer.set({});
    this.changed(true);
  }

  edit(which, name, value) {
    const { viewer } = this;
    const numbers = which === "*" ? viewer.decals.numbers : [Number(which)];
    const moved = (row) => {
      const position = row.position.map((old, axis) => (AXES[axis] === name ? value : old));
      const above = {
        position: add(position, scaled(row.normal, row.radius)),
        target: position,
        up: row.tangent,
      };
      const seen = new Camera({ ...above, fov: RAY }, viewer.header.bounds);
      return viewer.pick(0, 0, seen).surface ?? {};
    };
    const change = (row) => (AXES.includes(name) ? moved(row) : { [name]: value });
    const rows = numbers.map((number) => [number, viewer.decals.rows[number]]).filter(([, row]) => row);
    this.step = viewer.edit(rows.map(([number, row]) => [number, { ...row, ...change(row) }]), this.step); // prettier-ignore
  }

  // -- the probe --------------------------------------------------------------------------------------------

  addProbe() {
    const { lesson, viewer } = this;
    const probe = Object.assign(document.createElement("button"), { className: "probe", type: "button" });
    probe.ariaLabel = probe.title = lesson.words.probe;
    if (!lesson.states) viewer.controls.root.append(probe);
    this.ball = probe;
    probe.addEventListener("pointerdown", (event) => probe.setPointerCapture(event.pointerId));
    probe.addEventListener("pointermove", (event) => {
      if (!probe.hasPointerCapture(event.pointerId)) return;
      const { surface } = viewer.pick(...viewer.pointer.place(event));
      if (surface) this.moveProbe(surface.position);
    });
    probe.addEventListener("keydown", ({ key }) => {
      const way = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 1], ArrowDown: [1, -1] }[key];
      if (!way) return;
      const frame = viewer.camera.frame(1)[way[0]];
      const move = scaled(frame, (way[1] * lesson.size) / 100 / Math.hypot(...frame));
      this.moveProbe(add(this.probe, move));
    });
  }

  // Move the probe to a place, along the axes of its sliders if there are any.
  moveProbe(place) {
    const own = this.sliders.filter((input) => input.dataset.path.startsWith("probe."));
    if (!own.length) this.probe = place;
    for (const input of own) {
      input.value = place[AXES.indexOf(input.dataset.path.at(-1))];
      this.slide(this.sliders.indexOf(input), input.value);
    }
    this.changed(true);
  }

  showProbe() {
    const place = this.ball.isConnected && this.viewer.camera.seen(this.probe, this.viewer.aspect);
    this.ball.hidden = !place;
    if (!place) return;
    const { offsetLeft, offsetTop, clientWidth, clientHeight } = this.viewer.canvas;
    const [x, y] = [(1 + place[0]) / 2, (1 - place[1]) / 2];
    this.ball.style.left = `${offsetLeft + x * clientWidth}px`;
    this.ball.style.top = `${offsetTop + y * clientHeight}px`;
  }

  // -- what the page shows ----------------------------------------------------------------------------------

  // Show the state in the next frame; what was measured before is known no more, unless the camera alone moved.
  changed(isOther) {
    this.isOther ||= isOther;
    if (isOther) {
      delete this.root.dataset.shown;
      clearTimeout(this.rest); // the verdict that was asked for is that of the new state
    }
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.show());
  }

  show() {
    const { root, viewer, lesson } = this;
    this.showProbe();
    if (!this.isOther || viewer.painter.gl.isContextLost()) return;
    this.isOther = false;
    this.measures.known.clear();
    const state = this.positions.reduce(
      (all, place, i) => all * Number(this.sliders[i].dataset.count ?? 1) + place,
      0,
    );
    this.measures.state = state;
    if (lesson.states) this.showState(this.waits ? lesson.states : state);
    root.dataset.waits = this.waits;
    this.sliders.forEach((input) => this.showSlider(input));
    if (this.waits) return;
    const known = this.probe && !lesson.states;
    this.attempt(() => {
      this.point = known ? this.measures.above({ position: this.probe, normal: lesson.up }) : {};
      if (known) root.querySelector(".readings").replaceChildren(this.readings());
      this.showPlots(false);
    });
    clearTimeout(this.rest);
    this.rest = setTimeout(() => this.attempt(() => this.showWhole()), REST);
  }

  // Show what follows from the whole map, once nothing moves.
  showWhole() {
    this.showValues();
    this.showPlots(true);
    this.root.dataset.shown = performance.now();
  }

  attempt(call) {
    const problem = this.root.querySelector(".problem");
    problem.textContent = "";
    try {
      call();
    } catch (error) {
      problem.textContent = error.message;
    }
  }

  // Show one of the models that were made for the positions of sliders.
  showState(number) {
    const { painter, header } = this.viewer;
    painter.all ??= painter.surfaces;
    this.objects ??= header.scene.objects;
    if (painter.surfaces[0] === painter.all[number]) return;
    painter.surfaces = [painter.all[number]];
    painter.view = "";
    header.scene = { ...header.scene, objects: [this.objects[number]] };
    this.viewer.sample = 0;
    this.viewer.request();
  }

  showSlider(input) {
    const { viewer, lesson } = this;
    const [first, which, name] = input.dataset.path.split(".");
    const row = viewer.decals.rows[which === "*" ? 0 : which];
    const value = {
      contact: () => viewer.mode,
      stiffness: () => viewer.stiffness,
      mapping: () => lesson.mappings[viewer.header.uniforms.decal_mapping[1]],
      probe: () => this.probe[AXES.indexOf(which)],
      decals: () =>
        row?.position[AXES.indexOf(name)] ?? row?.[name] ?? { interaction: "push", layer: 0 }[name],
    }[first]?.();
    if (value !== undefined && document.activeElement !== input) input.value = value;
    if (input.type === "range") input.nextElementSibling.textContent = this.say(Number(value ?? input.value));
  }

  showValues() {
    const { root, lesson } = this;
    const { question, guess } = lesson;
    lesson.values.forEach((text, i) => {
      root.querySelectorAll(".values td:last-child")[i].textContent = this.say(this.value(text));
    });
    const done = question.checks.map(({ holds }) => Boolean(this.value(holds)));
    root.querySelectorAll("[data-task]").forEach((task) => {
      task.dataset.done = done[task.dataset.task];
      task.querySelector(".mark").ariaLabel = done[task.dataset.task] ? lesson.words.done : lesson.words.open;
    });
    const failed = done.indexOf(false);
    showScores(this, failed < 0);
    const verdict = root.querySelector(".verdict");
    const text = failed < 0 ? question.right : this.tried ? question.checks[failed].otherwise : [""];
    verdict.dataset.right = failed < 0;
    const filled = this.filled(text);
    if (verdict.innerHTML !== filled) verdict.innerHTML = filled;
    this.tried = false; // another state has another answer
    const seen = root.querySelector(".seen");
    if (!guess || this.guess === undefined || this.guess === null) return seen?.replaceChildren();
    const [own, truth] = [this.guess, this.value(guess.truth)].map((number) => this.say(number));
    seen.innerHTML =
      guess.compared.replace("{guess}", own).replace("{truth}", truth) + this.filled(guess.why);
  }

  // A table of the symbols at the probe, for the decal that shows and for its strongest neighbour.
  readings() {
    const { measures, point, viewer } = this;
    const field = (number) => measures.f(point, number);
    const sorted = viewer.decals.numbers.sort((a, b) => field(b) - field(a));
    const own = point.owner >= 0 ? point.owner : sorted[0];
    const other = sorted.find((number) => number !== own);
    const pair = [own, other].filter((number) => number !== undefined).sort((a, b) => a - b);
    const kind = (number) => `${measures.layer(point, number)} ${measures.interaction(point, number)}`;
    const isPush =
      pair.length > 1 && pair.every((number) => kind(number) === kind(own) && kind(own).endsWith("push"));
    const known = pair.length > 1 && ["product", "min"].includes(viewer.mode);
    const h = known ? (isPush ? measures.h(point, other, own) : 1) : NaN;
    const ofPoint = { h, F: measures.F(point), [this.lesson.words.stretch]: point.stretch };
    const columns = {
      [this.lesson.words.decal]: (number) => number,
      ...Object.fromEntries(["r", "s", "d", "f"].map((name, i) => [name, (n) => measures[["radius", "influence", "d", "f"][i]](point, n)])), // prettier-ignore
    };
    const table = document.createElement("table");
    const cell = (tag, text) => `<${tag}>${text}</${tag.split(" ")[0]}>`;
    const head = [...Object.keys(columns), ...Object.keys(ofPoint)].map((name) =>
      cell('th scope="col"', name),
    );
    const rows = pair.map((number, i) => [
      ...Object.values(columns).map((of) => cell("td", this.say(of(number)))),
      ...(i
        ? []
        : Object.values(ofPoint).map((value) => cell(`td rowspan="${pair.length}"`, this.say(value)))),
    ]);
    table.innerHTML = [head, ...rows].map((cells) => cell("tr", cells.join(""))).join("");
    return table;
  }

  // Show the maps, or the curves.
  showPlots(areMaps) {
    const { lesson, measures, root } = this;
    const say = (value) => this.say(value);
    lesson.plots.forEach((plot, number) => {
      if (Boolean(plot.map) !== areMaps) return;
      const canvas = this.canvases[number];
      const formula = plot.formula.find(({ when }) => this.value(when));
      root.querySelectorAll(".plot .formula")[number].innerHTML = formula ? this.filled(formula.text) : "";
      const marks = plot.marks.map((pair) => pair.map((text) => this.value(text)));
      const look = { ends: plot.values, marks, say };
      if (plot.map) {
        const points = plot.x ? numbersOver(plot.x, plot.y) : measures.map;
        const values = (text) =>
          points.map((point) => (point.exists ? Number(this.value(text, point)) : NaN));
        const half = lesson.size / 2;
        const ends = plot.x ? { x: plot.x, y: plot.y } : { x: [-half, half], y: [-half, half] };
        if (!plot.x) marks.push(measures.onPlane(this.point.position));
        const regions = plot.x
          ? values(plot.map).map((value) => value >= 0.5)
          : points.map(({ owner }) => owner);
        const red = plot.red && values(plot.red).map((value) => value > 0);
        drawMap(canvas, {
          ...look,
          ...ends,
          values: values(plot.map),
          red,
          redLabel: plot.redLabel,
          regions,
        });
      } else if (lesson.states) {
        const curves = plot.curves.map(({ label, formula: text }) => ({ label, values: this.value(text) }));
        drawCurves(canvas, { ...look, x: plot.at, curves });
      } else {
        const points = plot.x ? numbersOver(plot.x) : measures.curve;
        const values = (text) => points.map((point) => Number(this.value(text, point)));
        const curves = plot.curves.map(({ label, formula: text }) => ({ label, values: values(text) }));
        const here = plot.x ? NaN : measures.onLine(this.point.position);
        drawCurves(canvas, { ...look, x: points.map(({ x }) => x), curves, here });
      }
    });
  }

  check() {
    this.tried = true;
    this.changed(true);
  }

  // Show a task by its number, "task=2"; contact is on then.
  goTo(fragment) {
    const number = Number(new URLSearchParams(fragment.slice(1)).get("task"));
    const task = this.root.querySelectorAll("[data-task]")[number - 1];
    this.root.querySelectorAll("[aria-current]").forEach((other) => other.removeAttribute("aria-current"));
    if (!task) return;
    if (this.waits) this.see(null);
    task.ariaCurrent = "step";
    task.scrollIntoView({ block: "center" });
  }
}

// Show the lesson of a page in its element, and return it, or say why its picture stays.
export async function begin(root, data, lesson, formulas) {
  const place = root.querySelector("#viewer");
  const still = place.firstElementChild;
  try {
    const viewer = new Viewer(place, await unpacked(data), {});
    viewer.resize();
    const page = new LessonPage(root, viewer, lesson, formulas);
    if (lesson.states) page.showState(lesson.states);
    viewer.draw();
    viewer.painter.finish();
    performance.mark("first frame");
    page.show();
    setTimeout(() => viewer.painter.decalProgram("pick", viewer)); // so that the first click does not wait
    root.dataset.ready = true;
    return page;
  } catch (error) {
    place.className = "";
    place.replaceChildren(still);
    still.lastElementChild.textContent = `${lesson.words.still} ${error.message}`;
    return null;
  }
}
