// A lesson: its guess, sliders, tasks, probe and plots beside the viewer.
import { History } from "../../decals/pages/viewer/history.mjs";
import { add, scaled } from "../../decals/pages/viewer/vectors.mjs";
import { mount } from "../../decals/pages/viewer/viewer.mjs";
import { send } from "./answers.mjs";
import { Measures, numbersOver } from "./measures.mjs";
import { drawCurves, drawMap } from "./plots.mjs";
import { puzzleOf, share, showScores } from "./puzzles.mjs";

const AXES = ["x", "y", "z"];
const USUAL = { interaction: "push", layer: 0, opacity: 1 }; // what rows leave out
const LEAST = 1e-6; // that is not shown as 0: fields have the precision of float32
const CALM = 60; // milliseconds without a change, after which the whole map is read

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
    this.charts = [...root.querySelectorAll(".chart")];
    viewer.header.shaders.ends.measure = lesson.shader;
    for (const input of this.sliders) {
      input.addEventListener("input", () => this.slide(input));
      input.addEventListener("change", () => (this.step = null));
    }
    const on = (selector, event, call) =>
      root.querySelector(selector)?.addEventListener(event, (given) => {
        given.preventDefault(); // no form asks the server
        call(given.target);
      });
    on("[name=again]", "click", () => this.begin());
    on("[name=check]", "click", () => this.check());
    on("[name=share]", "click", () => share(this));
    on("[name=skip]", "click", () => this.see(null));
    on(".send", "submit", (form) => send(this, form));
    on("form.guess", "submit", (form) => this.see(Number(form.guess.value)));
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
    Object.assign(this, { probe: lesson.probe, tried: false, guess: undefined, step: null });
    Object.assign(this, { waits: !!lesson.guess, puzzle: puzzleOf(location.hash, lesson) });
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

  // What a slider moves: its value, and the function that sets it.
  parameter({ dataset }) {
    const { viewer, lesson } = this;
    const { uniforms } = viewer.header;
    const [first, which, name] = dataset.path.split(".");
    const row = viewer.decals.rows[which === "*" ? 0 : which];
    const axis = AXES.indexOf(which);
    const setMapping = (kind) => (uniforms.decal_mapping = ["1i", lesson.mappings.indexOf(kind)]);
    const parameters = {
      contact: [viewer.mode, (mode) => viewer.set({ mode })],
      stiffness: [viewer.stiffness, (stiffness) => viewer.set({ stiffness })],
      mapping: [lesson.mappings[uniforms.decal_mapping[1]], setMapping],
      probe: [
        this.probe[axis],
        (value) => (this.probe = this.probe.map((old, i) => (i === axis ? value : old))),
      ],
      decals: [
        row?.position[AXES.indexOf(name)] ?? row?.[name] ?? USUAL[name],
        (value) => this.edit(which, name, value),
      ],
    };
    return parameters[first] ?? []; // the sliders of a table are read when its state is shown
  }

  slide(input) {
    this.parameter(input)[1]?.(input.type === "range" ? Number(input.value) : input.value);
    this.viewer.set({});
    this.changed(true);
  }

  edit(which, name, value) {
    const { viewer } = this;
    const numbers = which === "*" ? viewer.decals.numbers : [Number(which)];
    const moved = (row) =>
      viewer.under(row, row.position.map((old, axis) => (AXES[axis] === name ? value : old)), row.tangent); // prettier-ignore
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
      this.slide(input);
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
    const place = ({ value, min, step }) => Math.round((value - min) / step);
    const state = this.sliders.reduce((all, input) => all * Number(input.dataset.count) + place(input), 0);
    this.measures.state = state;
    if (lesson.states) this.showState(this.waits ? lesson.states : state);
    root.dataset.waits = this.waits;
    this.sliders.forEach((input) => this.showSlider(input));
    if (this.waits) return;
    this.attempt(() => {
      this.point = lesson.states ? {} : this.measures.above({ position: this.probe, normal: lesson.up });
      if (!lesson.states) root.querySelector(".readings").replaceChildren(this.readings());
      this.showPlots(false);
    });
    clearTimeout(this.rest);
    const showWhole = () => {
      this.showValues();
      this.showPlots(true);
      root.dataset.shown = performance.now();
    };
    this.rest = setTimeout(() => this.attempt(showWhole), CALM); // what follows from the whole map, once nothing moves
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
    const [value = Number(input.value)] = this.parameter(input);
    if (document.activeElement !== input) input.value = value;
    if (input.type === "range") input.nextElementSibling.textContent = this.say(Number(value));
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
    const { words } = this.lesson;
    const sorted = viewer.decals.numbers.sort((a, b) => measures.f(point, b) - measures.f(point, a));
    const own = point.owner >= 0 ? point.owner : sorted[0];
    const other = sorted.find((number) => number !== own);
    const pair = [own, other].filter((number) => number !== undefined).sort((a, b) => a - b);
    const kind = (number) => `${measures.layer(point, number)} ${measures.interaction(point, number)}`;
    const isPush = pair.every((number) => kind(number) === kind(own) && kind(own).endsWith("push"));
    const known = pair.length > 1 && ["product", "min"].includes(viewer.mode);
    const h = known ? (isPush ? measures.h(point, other, own) : 1) : NaN;
    const columns = { [words.decal]: (q, number) => number, r: measures.radius, s: measures.influence, d: measures.d, f: measures.f }; // prettier-ignore
    const ofPoint = { h, F: measures.F(point), [words.stretch]: point.stretch };
    const cell = (tag, text) => `<${tag}>${text}</${tag.slice(0, 2)}>`;
    const names = [...Object.keys(columns), ...Object.keys(ofPoint)];
    const both = Object.values(ofPoint).map((value) => cell(`td rowspan="${pair.length}"`, this.say(value)));
    const ofDecal = (number) => Object.values(columns).map((of) => cell("td", this.say(of(point, number))));
    const rows = [names.map((name) => cell('th scope="col"', name)), ...pair.map(ofDecal)];
    rows[1]?.push(...both);
    const table = document.createElement("table");
    table.innerHTML = rows.map((cells) => cell("tr", cells.join(""))).join("");
    return table;
  }

  // Show the maps, or the curves.
  showPlots(areMaps) {
    const { lesson, measures, root } = this;
    lesson.plots.forEach((plot, number) => {
      if (Boolean(plot.map) !== areMaps) return;
      const chart = this.charts[number];
      const formula = plot.formula.find(({ when }) => this.value(when));
      root.querySelectorAll(".plot .formula")[number].innerHTML = formula ? this.filled(formula.text) : "";
      const marks = plot.marks.map((pair) => pair.map((text) => this.value(text)));
      const look = { ends: plot.values, marks, say: (value) => this.say(value) };
      const ofScene = () => (plot.map ? measures.map : measures.curve);
      const points = lesson.states ? plot.at.map((x) => ({ x })) : plot.x ? numbersOver(plot.x, plot.y) : ofScene(); // prettier-ignore
      const at = (text) => (point) => plot.map && !point.exists ? NaN : Number(this.value(text, point)); // prettier-ignore
      const values = (text) => (lesson.states ? this.value(text) : points.map(at(text)));
      if (plot.map) {
        const side = [-lesson.size / 2, lesson.size / 2];
        if (!plot.x) marks.push(measures.onPlane(this.point.position));
        const shades = values(plot.map);
        const regions = plot.x ? shades.map((value) => value >= 0.5) : points.map(({ owner }) => owner);
        const red = plot.red && values(plot.red).map((value) => value > 0);
        const [x, y] = [plot.x ?? side, plot.y ?? side];
        drawMap(chart, { ...look, x, y, values: shades, red, redLabel: plot.redLabel, regions });
      } else {
        const curves = plot.curves.map(({ label, formula: text }) => ({ label, values: values(text) }));
        const here = plot.x || lesson.states ? NaN : measures.onLine(this.point.position);
        drawCurves(chart, { ...look, x: points.map(({ x }) => x), curves, here });
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
  let page;
  const prepare = (viewer) => {
    page = new LessonPage(root, viewer, lesson, formulas);
    if (lesson.states) page.showState(lesson.states);
  };
  try {
    await mount(place, data, { prepare });
    page.show();
    root.dataset.ready = true;
    return page;
  } catch (error) {
    place.className = "";
    place.replaceChildren(still);
    still.lastElementChild.textContent = `${lesson.words.still} ${error.message}`;
    return null;
  }
}
