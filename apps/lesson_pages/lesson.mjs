// A lesson: its guess, sliders, tasks, probe and plots beside the viewer.
import { add, scaled, unit } from "../../decals/pages/viewer/vectors.mjs";
import { mountOver } from "../../decals/pages/viewer/viewer.mjs";
import { copy } from "../sandbox/scores.mjs";
import { compared, draw, keep } from "../sandbox/sketch.mjs";
import { send } from "./answers.mjs";
import { Measures } from "./measures.mjs";
import { drawCurves, drawMap } from "./plots.mjs";
import { puzzleOf, share, showScores } from "./puzzles.mjs";

const CALM = 60; // milliseconds without a change, after which the whole map is read

// What buttons do when they are pressed, and forms when they are filled, by their names.
const ACTIONS = {
  again: (page) => page.begin(),
  back: ({ viewer }) => viewer.history.go(-1),
  check: (page) => page.changed((page.tried = true)),
  copy: (page, { previousElementSibling: element }) => {
    getSelection().selectAllChildren(element); // it can be copied from there, too
    copy(element.textContent);
  },
  guessed: (page, form) => {
    keep(form);
    page.see(form.guess.valueAsNumber);
  },
  sent: send,
  share,
  skip: (page) => page.see(null),
};

class LessonPage {
  // `live` holds functions of the measures and a point: formulas, texts of HTML, and what sliders read and write.
  constructor(root, viewer, lesson, live) {
    Object.assign(this, { root, viewer, lesson, live, measures: new Measures(viewer, lesson) });
    this.sliders = this.all("[data-path]");
    viewer.header.shaders.ends.measure = lesson.shader;
    this.sliders.forEach((input, number) => Object.assign(input, live.sliders[number]));
    live.plots.forEach((plot, number) => (plot.element = this.all(".plot")[number]));
    const listen = (element, names, call) => names.forEach((name) => element?.addEventListener(name, call));
    listen(root, ["click", "submit"], ({ target }) => ACTIONS[target.name]?.(this, target));
    listen(root.querySelector(".sliders"), ["input"], ({ target }) => this.slide(target));
    listen(root.querySelector(".sliders"), ["change"], () => (this.step = null));
    listen(root.querySelector(".pad"), ["pointerdown", "pointermove"], draw);
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
    Object.assign(this, { probe: lesson.probe, tried: false, guess: null, step: null });
    this.puzzle = puzzleOf(location.hash, lesson);
    this.map(lesson.mapping);
    this.sliders.forEach((input) => (input.value = input.dataset.value));
    this.wait(lesson.guess);
    viewer.set({ ...lesson.drawing, selected: -1, camera: viewer.camera.home });
    this.show();
  }

  // Show images by a mapping.
  map(mapping) {
    this.viewer.header.uniforms.decal_mapping = ["1i", this.lesson.mappings.indexOf(mapping)];
  }

  // Wait for a guess, with decals apart, or show those of the lesson, in the sizes of the puzzle. Undo leads back to here.
  wait(waits) {
    const { viewer, lesson, puzzle } = this;
    this.waits = this.root.dataset.waits = waits;
    const given = waits ? lesson.apart : lesson.rows;
    const rows = given.map((row, number) => ({ ...row, radius: puzzle.radii[number] }));
    Object.assign(viewer.history, { states: [rows], at: 0 }).go(0);
  }

  // Take a guess, null for none, and switch contact on; go to what it makes of the guess, below the model.
  async see(guess) {
    this.guess = guess;
    this.wait(false);
    this.root.querySelector(".question").focus({ preventScroll: true });
    await this.show();
    this.root.querySelector(".seen").scrollIntoView();
  }

  // Change what a slider or a choice, which has a text, stands for; a drag of a slider is one step of undo.
  slide(input) {
    this.step = input.write(this, input.valueAsNumber ?? input.value);
    this.viewer.set({});
    this.changed();
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

  // Let the state be shown in the next frame.
  changed() {
    delete this.root.dataset.shown;
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.show());
  }

  // Show the state: its sliders and what is at the probe, and what follows from the whole map once nothing moves.
  async show() {
    const { root, viewer, lesson, live, measures, frame } = this;
    if (viewer.painter.gl.isContextLost()) return;
    cancelAnimationFrame(frame); // of a state that is shown at once
    const place = ({ value, min, step }) => Math.round((value - min) / step);
    const state = this.sliders.reduce((all, input) => all * Number(input.dataset.count) + place(input), 0);
    Object.assign(measures, { state, guess: this.guess, known: {} });
    if (lesson.states) this.showState(this.waits ? lesson.states : state);
    this.sliders.forEach((input) => this.showSlider(input));
    if (this.waits) return;
    const problem = root.querySelector(".problem");
    problem.textContent = "";
    try {
      this.point = lesson.states ? {} : measures.above({ position: this.probe, normal: lesson.up });
      if (!lesson.states) this.showReadings(root.querySelector(".readings tbody"));
      live.plots.filter(({ map }) => !map).forEach((plot) => this.showPlot(plot));
      await new Promise((calm) => setTimeout(calm, CALM));
      if (frame !== this.frame) return; // the verdict that was asked for is that of the new state
      this.showValues();
      live.plots.filter(({ map }) => map).forEach((plot) => this.showPlot(plot));
      root.dataset.shown = performance.now();
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
    const failed = live.checks[done.indexOf(false)];
    showScores(this, !failed);
    const verdict = root.querySelector(".verdict");
    verdict.dataset.right = !failed;
    const said = value(!failed ? live.right : this.tried ? failed.otherwise : () => "");
    if (verdict.innerHTML !== said) verdict.innerHTML = said;
    this.tried = false; // another state has another answer
    root.querySelector(".seen").innerHTML = this.guess === null ? "" : value(live.seen) + this.sketched();
  }

  // The part below guess and truth: the outline that was drawn, above the true area, and their difference.
  sketched() {
    const { live, lesson, measures: m, root } = this;
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
    const field = (number) => (number === q.owner ? Infinity : m.f(q, number));
    const pair = viewer.decals.numbers.sort((a, b) => field(b) - field(a)).slice(0, 2);
    const [own, other] = pair.map((number) => m.row(number));
    const isPush = [own, other].every((row) => row?.interaction === "push" && row.layer === own.layer);
    const isKnown = other && ["product", "min"].includes(viewer.mode);
    const names = ["radius", "influence", "d", "f"];
    const columns = pair.map((number) => [number, ...names.map((name) => m[name](q, number))]);
    columns[0]?.push(isKnown ? (isPush ? m.h(q, pair[1], pair[0]) : 1) : NaN, m.F(q), q.stretch);
    const line = (values) => `<tr><td>${values.map(m.say).join("</td><td>")}</td></tr>`;
    body.innerHTML = columns.map(line).join("");
  }

  showPlot(plot) {
    const { lesson, measures: m, point, value } = this;
    const chart = plot.element.querySelector(".chart");
    const formula = plot.formula.find(({ when }) => value(when));
    plot.element.querySelector(".formula").innerHTML = formula ? value(formula.text) : "";
    const marks = plot.marks.map((pair) => pair.map(value));
    const look = { ends: plot.values, marks, say: m.say };
    const points = plot.points(m);
    const valuesOf = (of) => points.map((at) => (plot.map && at.exists === 0 ? NaN : Number(of(m, at))));
    if (!plot.map) {
      const [acts, curves] = [plot.acts, plot.curves].map((lines) =>
        lines.map((line) => ({ ...line, values: valuesOf(line.formula) })),
      );
      const here = plot.x || lesson.states ? NaN : m.onLine(point.position);
      return drawCurves(chart, { ...look, x: points.map(({ x }) => x), curves, acts, here });
    }
    const side = [-lesson.size / 2, lesson.size / 2];
    const { x = side, y = side } = plot;
    if (!plot.x) marks.push(m.onPlane(point.position));
    const values = valuesOf(plot.map);
    const regions = plot.x ? values.map((shade) => shade >= 0.5) : points.map(({ owner }) => owner);
    const red = plot.red ? valuesOf(plot.red) : [];
    drawMap(chart, { ...look, x, y, values, red, regions, colors: lesson.colors });
  }

  // Show the task of the address, "task=2"; contact is on then.
  async goTo() {
    const task = this.all("[data-task]").find(({ id }) => location.hash === `#${id}`); // :target may follow later
    if (task && this.waits) await this.see(null);
    task?.scrollIntoView({ block: "center" });
  }
}

// Show the lesson of a page in its element, and return it, or say why its picture stays.
export async function begin(root, data, lesson, live) {
  const prepare = (viewer) => (viewer.page = new LessonPage(root, viewer, lesson, live));
  const options = { prepare, reason: lesson.words.still };
  const viewer = await mountOver(root.querySelector("#viewer"), data, options);
  return viewer?.page;
}
