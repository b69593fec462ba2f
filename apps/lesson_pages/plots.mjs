// Plots of lessons on canvases: curves with axes, and maps of colours.

const [LEFT, RIGHT, TOP, BOTTOM, LEGEND] = [40, 10, 8, 22, 17]; // margins, and height of a row of the legend
const [WIDTH, HEIGHT, MAP] = [330, 140, 220]; // of a plot; a map is square
const DENSITY = 2; // pixels of a canvas for one of the page: plots are printed, too
const COLORS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"]; // after Okabe and Ito
const DASHES = [[], [6, 3], [2, 2], [8, 3, 2, 3], [1, 3], [10, 4]];
const VIRIDIS = [[68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37]]; // prettier-ignore
const RED = [213, 0, 0];
const WHITE = [255, 255, 255];

// Up to six round numbers from low to high.
function ticks(low, high) {
  const power = 10 ** Math.floor(Math.log10(high - low));
  const step = [0.2, 0.5, 1, 2].map((part) => part * power).find((size) => (high - low) / size < 6);
  const first = Math.ceil(low / step);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toPrecision(6)));
}

export function range(values) {
  const finite = values.filter(Number.isFinite);
  const [low, high] = [Math.min(...finite), Math.max(...finite)];
  if (!finite.length) return [0, 1];
  const margin = high > low ? 0.05 * (high - low) : 0.5;
  return [low - margin, high + margin];
}

class Axes {
  constructor(canvas, x, y, height, { square = false, top = TOP } = {}) {
    const inner = height - top - BOTTOM;
    Object.assign(this, { x, y, top, inner, across: square ? inner : WIDTH - LEFT - RIGHT });
    Object.assign(canvas, { width: DENSITY * WIDTH, height: DENSITY * height });
    this.pen = canvas.getContext("2d");
    this.pen.scale(DENSITY, DENSITY);
    this.pen.font = "11px system-ui, sans-serif";
    this.pen.fillStyle = "#1d2126";
  }

  at(x, y) {
    const part = (value, [low, high]) => (value - low) / (high - low);
    return [LEFT + part(x, this.x) * this.across, this.top + (1 - part(y, this.y)) * this.inner];
  }

  text(text, x, y, align = "left") {
    this.pen.textAlign = align;
    this.pen.fillText(text, x, y);
  }

  // A line through points of the picture, interrupted where one is no number.
  path(points, { color = "#1d2126", dash = [], width = 2, alpha = 1 } = {}) {
    const { pen } = this;
    pen.save();
    Object.assign(pen, { strokeStyle: color, lineWidth: width, globalAlpha: alpha });
    pen.setLineDash(dash);
    pen.beginPath();
    let isDown = false;
    for (const [x, y] of points) {
      if (isDown && Number.isFinite(y)) pen.lineTo(x, y);
      else pen.moveTo(x, y);
      isDown = Number.isFinite(y);
    }
    pen.stroke();
    pen.restore();
  }

  grid(say) {
    const { pen, top, inner, across } = this;
    const bottom = top + inner;
    for (const value of ticks(...this.x)) {
      const [x] = this.at(value, 0);
      this.path([[x, top], [x, bottom]], { width: 1, alpha: 0.15 }); // prettier-ignore
      this.text(say(value), x, bottom + 14, "center");
    }
    for (const value of ticks(...this.y)) {
      const [, y] = this.at(0, value);
      this.path([[LEFT, y], [LEFT + across, y]], { width: 1, alpha: 0.15 }); // prettier-ignore
      this.text(say(value), LEFT - 5, y + 4, "right");
    }
    pen.fillStyle = "#1d2126";
  }

  mark(x, y) {
    if (!Number.isFinite(x) || !Number.isFinite(y)) return;
    const { pen } = this;
    pen.beginPath();
    pen.arc(...this.at(x, y), 4, 0, 2 * Math.PI);
    Object.assign(pen, { fillStyle: "#fff", strokeStyle: "#000", lineWidth: 1.5 });
    pen.fill();
    pen.stroke();
  }
}

// Curves, [{label, values}], over x; `here` is the x of the probe, and `marks` are points.
export function drawCurves(canvas, { x, curves, ends, here, marks, say }) {
  const rows = Math.ceil(curves.length / 2);
  const top = TOP + LEGEND * rows;
  const vertical = ends ?? range(curves.flatMap(({ values }) => values));
  const axes = new Axes(canvas, [x[0], x.at(-1)], vertical, HEIGHT + LEGEND * rows, { top });
  axes.grid(say);
  curves.forEach(({ label, values }, number) => {
    const look = { color: COLORS[number % 6], dash: DASHES[number % 6] };
    const within = (value) => Math.min(Math.max(value, vertical[0]), vertical[1]);
    axes.path(values.map((value, i) => axes.at(x[i], within(value))), look); // prettier-ignore
    const [left, down] = [LEFT + (number % 2) * 145, TOP + 6 + Math.floor(number / 2) * LEGEND];
    axes.path([[left, down - 4], [left + 22, down - 4]], look); // prettier-ignore
    axes.text(label, left + 27, down);
  });
  if (Number.isFinite(here)) axes.path(vertical.map((y) => axes.at(here, y)), { dash: [3, 3], width: 1 }); // prettier-ignore
  for (const [right, up] of marks) axes.mark(right, up);
}

const colorOf = (part) => {
  const place = Math.min(Math.max(part || 0, 0), 1) * (VIRIDIS.length - 1);
  const [low, share] = [Math.min(Math.floor(place), VIRIDIS.length - 2), place];
  return VIRIDIS[low].map((level, i) => level + (share - low) * (VIRIDIS[low + 1][i] - level));
};

// A map of a square of values, from the lowest row up; red where `red`, and white between regions.
export function drawMap(canvas, { x, y, values, ends, red, redLabel, regions, marks, say }) {
  const axes = new Axes(canvas, x, y, MAP, { square: true });
  const [low, high] = ends ?? range(values);
  const side = Math.sqrt(values.length);
  const picture = new ImageData(side, side);
  values.forEach((value, i) => {
    const [column, row] = [i % side, Math.floor(i / side)];
    const isBorder =
      regions &&
      ((column + 1 < side && regions[i] !== regions[i + 1]) || (row > 0 && regions[i] !== regions[i - side]));
    const color = red?.[i] ? RED : isBorder ? WHITE : colorOf((value - low) / (high - low));
    if (Number.isFinite(value)) picture.data.set([...color, 255], 4 * ((side - 1 - row) * side + column));
  });
  const { pen, top, inner, across } = axes;
  const small = Object.assign(document.createElement("canvas"), { width: side, height: side });
  small.getContext("2d").putImageData(picture, 0, 0);
  pen.imageSmoothingEnabled = false;
  pen.drawImage(small, LEFT, top, across, inner);
  axes.grid(say);
  const bar = LEFT + across + 14;
  for (let i = 0; i < inner; i++) {
    pen.fillStyle = `rgb(${colorOf(1 - i / inner).join(" ")})`;
    pen.fillRect(bar, top + i, 12, 1.5);
  }
  pen.fillStyle = "#1d2126";
  axes.text(say(high), bar + 16, top + 10);
  axes.text(say(low), bar + 16, top + inner);
  if (red) {
    pen.fillStyle = `rgb(${RED.join(" ")})`;
    pen.fillRect(bar + 34, top + 20, 12, 12);
    pen.fillStyle = "#1d2126";
    axes.text(redLabel, bar + 50, top + 30);
  }
  for (const [right, up] of marks) axes.mark(right, up);
}
