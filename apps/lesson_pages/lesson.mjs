// A lesson: its guess, sliders, tasks, probe and plots beside the viewer.
import { History } from "../../decals/pages/viewer/history.mjs";
import { add, scaled, unit } from "../../decals/pages/viewer/vectors.mjs";
import { mountOver } from "../../decals/pages/viewer/viewer.mjs";
import { compared, draw, keep } from "../sandbox/sketch.mjs";
import { send } from "./answers.mjs";
import { Measures } from "./measures.mjs";
import { drawCurves, drawMap } from "./plots.mjs";
import { puzzleOf, share, showScores } from "./puzzles.mjs";

const CALM = 60; // milliseconds without a change, after which the whole map is read

// Select the text of an element, and copy it where the browser lets a page do that.
function copy(element) {
  getSelection().selectAllChildren(element);
  navigator.clipboard?.writeText(element.textContent);
}

class LessonPage {
  // `live` holds functions of the measures and a point: formulas, texts of HTML, and what sliders read and write.
  constructor(root, viewer, lesson, live) {
    Object.assign(this, { root, viewer, lesson, live, measures: new Measures(viewer, lesson) });
    this.sliders = this.all("[data-path]");
    viewer.header.shaders.ends.measure = lesson.shader;
    this.sliders.forEach((input, number) => {
      Object.assign(input, live.sliders[number]);
      input.addEventListener("input", () => this.slide(input));
      input.addEventListener("change", () => (this.step = null));
    });
    const on = (selector, event, call) =>
      root.querySelector(selector)?.addEventListener(event, (given) => {
        given.preventDefault(); // no form asks the server
        call(given.target);
      });
    on("[name=again]", "click", () => this.begin());
    on("[name=back]", "click", () => viewer.history.go(-1));
    on("[name=check]", "click", () => this.changed((this.tried = true)));
    on("[name=share]", "click", () => share(this));
    this.all("[name=copy]").forEach((one) =>
      one.addEventListener("click", () => copy(one.previousElementSibling)),
    );
    on("[name=skip]", "click", () => this.see(null));
    on(".send", "submit", (form) => send(this, form));
    on("form.guess", "submit", (form) => {
      keep(form);
      this.see(Number(form.guess.value));
    });
    ["pointerdown", "pointermove"].forEach((name) =>
      root.querySelector(".pad")?.addEventListener(name, draw),
    );
    this.listenToProbe();
    viewer.on("view", () => this.showProbe());
    viewer.on("decals", () => this.changed());
    addEventListener("hashchange", () => (location.hash.startsWith("#puzzle") ? this.begin() : this.goTo()));
    this.begin();
    this.goTo();
  }

  all = (selector) => [...this.root.querySelectorAll(selector)];

  // The value of a live function at the probe.
  value = (of) => of(this.measures, this.point);

  // -- state ------------------------------------------------------------------------------------------------

  // Start the lesson, without contact if it asks for a guess.
  begin() {
    const { viewer, lesson } = this;
    const { mode, stiffness, mapping, probe } = lesson;
    Object.assign(this, { probe, tried: false, guess: null, step: null, waits: !!lesson.guess });
    this.puzzle = puzzleOf(location.hash, lesson);
    this.map(mapping);
    this.sliders.forEach((input) => (input.value = input.dataset.value));
    this.history(this.waits ? lesson.apart : lesson.rows);
    viewer.set({ mode, stiffness, selected: -1, camera: viewer.camera.home });
    this.show();
  }

  // Show images by a mapping.
  map(mapping) {
    this.mapping = mapping;
    this.viewer.header.uniforms.decal_mapping = ["1i", this.lesson.mappings.indexOf(mapping)];
  }

  // Make these rows, in the sizes of the puzzle, the first ones: undo leads back to them.
  history(given) {
    const { viewer, puzzle } = this;
    const rows = given.map((row, number) => ({ ...row, radius: puzzle.radii[number] }));
    viewer.history.change([...viewer.decals.rows.keys()].map((number) => [number, rows[number] ?? null]));
    viewer.history = new History(viewer.decals, () => viewer.changed("decals"));
  }

  // Take a guess, null for none, and switch contact on.
  see(guess) {
    Object.assign(this, { guess, waits: false });
    this.history(this.lesson.rows);
    this.changed();
    this.root.querySelector(".question").focus();
  }

  slide(input) {
    input.write?.(this, input.type === "range" ? Number(input.value) : input.value);
    this.viewer.set({});
    this.changed();
  }

  // Change decals by a function of their rows; drags of one slider are one step.
  edit(numbers, change) {
    const rows = numbers.map((number) => [number, this.viewer.decals.rows[number]]).filter(([, row]) => row);
    const changed = rows.map(([number, row]) => [number, { ...row, ...change(row) }]);
    this.step = this.viewer.edit(changed, this.step);
  }

  // -- the probe --------------------------------------------------------------------------------------------

  listenToProbe() {
    const { ball, lesson, viewer } = Object.assign(this, { ball: this.root.querySelector(".probe") });
    ball.addEventListener("pointerdown", (event) => ball.setPointerCapture(event.pointerId));
    ball.addEventListener("pointermove", (event) => {
      const isHeld = ball.hasPointerCapture(event.pointerId);
      const { surface } = isHeld ? viewer.pick(...viewer.pointer.place(event)) : {};
      if (surface) this.moveProbe(surface.position);
    });
    ball.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 1], ArrowDown: [1, -1] }[event.key];
      if (!way) return;
      event.preventDefault(); // the page does not scroll
      const along = unit(viewer.camera.frame(1)[way[0]]);
      this.moveProbe(add(this.probe, scaled(along, (way[1] * lesson.size) / 100)));
    });
  }

  // Move the probe to a place, along the axes of its sliders if there are any.
  moveProbe(place) {
    this.probe = this.probe.map((old, axis) => (this.lesson.axes.includes(axis) ? place[axis] : old));
    this.showProbe();
    this.changed();
  }

  showProbe() {
    const place = !this.lesson.states && this.viewer.camera.seen(this.probe, this.viewer.aspect);
    this.ball.hidden = !place;
    if (place) this.ball.style.inset = `${50 - 50 * place[1]}% auto auto ${50 + 50 * place[0]}%`;
  }

  // -- what the page shows ----------------------------------------------------------------------------------

  // Show the state in the next frame.
  changed() {
    delete this.root.dataset.shown;
    clearTimeout(this.rest); // the verdict that was asked for is that of the new state
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.show());
  }

  show() {
    const { root, viewer, lesson, measures } = this;
    if (viewer.painter.gl.isContextLost()) return;
    const place = ({ value, min, step }) => Math.round((value - min) / step);
    const state = this.sliders.reduce((all, input) => all * Number(input.dataset.count) + place(input), 0);
    Object.assign(measures, { state, guess: this.guess, known: {} });
    if (lesson.states) this.showState(this.waits ? lesson.states : state);
    root.dataset.waits = this.waits;
    this.sliders.forEach((input) => this.showSlider(input));
    if (this.waits) return;
    this.attempt(() => {
      this.point = lesson.states ? {} : measures.above({ position: this.probe, normal: lesson.up });
      if (!lesson.states) this.showReadings(root.querySelector(".readings tbody"));
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
    painter.surfaces = [painter.all[number]];
    painter.view = "";
    header.scene = { ...header.scene, objects: [this.objects[number]] };
    this.viewer.set({});
  }

  showSlider(input) {
    const value = input.read?.(this) ?? input.value; // that of a table is read when its state is shown
    if (document.activeElement !== input) input.value = value;
    if (input.type === "range") input.nextElementSibling.textContent = this.measures.say(Number(value));
  }

  showValues() {
    const { live, root, value } = this;
    const cells = this.all(".values td:last-child");
    live.values.forEach((of, i) => (cells[i].textContent = this.measures.say(value(of))));
    const done = live.checks.map(({ holds }) => Boolean(value(holds)));
    for (const box of this.all("[data-task] input")) box.checked = done[box.value];
    const failed = done.indexOf(false);
    showScores(this, failed < 0);
    const verdict = root.querySelector(".verdict");
    verdict.dataset.right = failed < 0;
    const said = value(failed < 0 ? live.right : this.tried ? live.checks[failed].otherwise : () => "");
    if (verdict.innerHTML !== said) verdict.innerHTML = said;
    this.tried = false; // another state has another answer
    root.querySelector(".seen").innerHTML = this.guess === null ? "" : value(live.seen) + this.sketched();
  }

  // The part below guess and truth: the outline that was drawn, above the true area, and their difference.
  sketched() {
    const { live, lesson, measures: m, root } = this;
    if (!lesson.half) return "";
    const isTrue = (point) => point.exists > 0 && Boolean(live.outline(m, point));
    const found = compared(() => m.onPad(lesson.half).map(isTrue), lesson.half);
    if (!found) return "";
    const pad = root.querySelector("form .pad svg").outerHTML.replace(/<polygon[^]*/, `${found.parts}</svg>`);
    const said = lesson.words.sketched.replace("{difference}", m.say(100 * found.difference));
    return `<div class="pad" role="img" aria-label="${said}">${pad}</div><p data-difference>${said}</p>`;
  }

  // Show the symbols at the probe, for the decal that shows and for its strongest neighbour.
  showReadings(body) {
    const { measures: m, point: q, viewer } = this;
    const sorted = viewer.decals.numbers.sort((a, b) => m.f(q, b) - m.f(q, a));
    const own = q.owner >= 0 ? q.owner : sorted[0];
    const pair = [own, sorted.find((number) => number !== own)].filter((number) => number !== undefined);
    const rows = pair.map((number) => m.row(number));
    const isPush = rows.every((row) => row.interaction === "push" && row.layer === rows[0].layer);
    const isKnown = pair.length > 1 && ["product", "min"].includes(viewer.mode);
    const ofPoint = [isKnown ? (isPush ? m.h(q, pair[1], own) : 1) : NaN, m.F(q), q.stretch];
    const names = ["radius", "influence", "d", "f"];
    const columns = pair.map((number) => [number, ...names.map((name) => m[name](q, number))]);
    columns[0]?.push(...ofPoint);
    const line = (values) => `<tr><td>${values.map(m.say).join("</td><td>")}</td></tr>`;
    body.innerHTML = columns.map(line).join("");
  }

  // Show the maps, or the curves.
  showPlots(areMaps) {
    this.live.plots.forEach((plot, number) => {
      if (Boolean(plot.map) === areMaps) this.showPlot(plot, this.all(".plot")[number]);
    });
  }

  showPlot(plot, element) {
    const { lesson, measures: m, point, value } = this;
    const chart = element.querySelector(".chart");
    const formula = plot.formula.find(({ when }) => value(when));
    element.querySelector(".formula").innerHTML = formula ? value(formula.text) : "";
    const marks = plot.marks.map((pair) => pair.map(value));
    const look = { ends: plot.values, marks, say: m.say };
    const points = plot.points(m);
    const valuesOf = (of) => points.map((at) => (plot.map && at.exists === 0 ? NaN : Number(of(m, at))));
    if (!plot.map) {
      const curves = plot.curves.map((curve) => ({ ...curve, values: valuesOf(curve.formula) }));
      const here = plot.x || lesson.states ? NaN : m.onLine(point.position);
      const acts = Object.entries(plot.acts).map(([symbol, of]) => ({ symbol, values: valuesOf(of) }));
      return drawCurves(chart, { ...look, x: points.map(({ x }) => x), curves, acts, here });
    }
    const side = [-lesson.size / 2, lesson.size / 2];
    const { x = side, y = side } = plot;
    if (!plot.x) marks.push(m.onPlane(point.position));
    const values = valuesOf(plot.map);
    const regions = plot.x ? values.map((shade) => shade >= 0.5) : points.map(({ owner }) => owner);
    const red = plot.red ? valuesOf(plot.red).map((shade) => shade > 0) : [];
    drawMap(chart, { ...look, x, y, values, red, regions, colors: lesson.colors });
  }

  // Show the task of the address, "task=2"; contact is on then.
  goTo() {
    const task = this.all("[data-task]").find(({ id }) => location.hash === `#${id}`); // :target may follow later
    if (task && this.waits) this.see(null);
    task?.scrollIntoView({ block: "center" });
  }
}

// Show the lesson of a page in its element, and return it, or say why its picture stays.
export async function begin(root, data, lesson, live) {
  const prepare = (viewer) => (viewer.page = new LessonPage(root, viewer, lesson, live));
  const options = { prepare, reason: lesson.words.still };
  const viewer = await mountOver(root.querySelector("#viewer"), data, options);
  if (viewer) root.dataset.ready = true;
  return viewer?.page;
}
