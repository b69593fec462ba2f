// The teacher's page of a class: all answers, and a plot of two of their numbers.
import { drawCurves, range } from "./plots.mjs";

const [lesson, x, y] = ["lesson", "x", "y"].map((name) => document.querySelector(`[name=${name}]`));
const element = (tag, text) => Object.assign(document.createElement(tag), { textContent: text });
const say = (value) => (value === null ? "–" : String(Number(value.toPrecision(3))));
const fill = (select, texts) =>
  select.replaceChildren(...texts.map((text, i) => Object.assign(element("option", text), { value: i })));
let known = { lessons: {}, answers: [] };

function show() {
  const [name, { labels }] = Object.entries(known.lessons)[lesson.value];
  const answers = known.answers.filter((answer) => answer.lesson === name);
  const row = (tag, texts) => {
    const line = document.createElement("tr");
    line.append(...texts.map((text) => element(tag, text)));
    return line;
  };
  const cells = ({ student, name: person, right, numbers }) => [person || `student ${student}`, right ? "✓" : "–", ...numbers.map(say)]; // prettier-ignore
  document.querySelector("thead").replaceChildren(row("th", ["student", "done", ...labels]));
  document.querySelector("tbody").replaceChildren(...answers.map((answer) => row("td", cells(answer))));
  document.querySelector("#csv").href = `class/${name}.csv`;
  document.querySelector("#count").textContent = `answers: ${answers.length}`;
  const marks = answers.map(({ numbers }) => [numbers[x.value], numbers[y.value]]);
  const ends = [0, 1].map((axis) => range(marks.map((mark) => mark[axis])));
  drawCurves(document.querySelector(".chart"), { x: ends[0], curves: [], ends: ends[1], marks, say });
}

function choose() {
  const { labels } = Object.values(known.lessons)[lesson.value];
  for (const [select, at] of [
    [x, 1],
    [y, labels.length - 1],
  ]) {
    // prettier-ignore
    fill(select, labels);
    select.value = at;
  }
  show();
}

async function look() {
  const answer = await fetch("class/answers").catch(() => null);
  if (answer?.ok) {
    known = await answer.json();
    if (!lesson.options.length) {
      fill(lesson, Object.values(known.lessons).map(({ title }) => title)); // prettier-ignore
      choose();
    } else show();
  }
  setTimeout(look, 1000);
}

lesson.addEventListener("change", choose);
for (const select of [x, y]) select.addEventListener("change", show);
look();
