// Plots of lessons as SVG: curves with axes, and maps of colours.

const [LEFT, RIGHT, TOP, BOTTOM] = [40, 10, 8, 22]; // margins
const [WIDTH, HEIGHT, MAP] = [330, 140, 220]; // of a plot; a map is square
const [RED, WHITE] = [[213, 0, 0], [255, 255, 255]]; // prettier-ignore

// Up to six round numbers from low to high.
function ticks(low, high) {
  const power = 10 ** Math.floor(Math.log10(high - low));
  const step = [0.2, 0.5, 1, 2].map((part) => part * power).find((size) => (high - low) / size < 6);
  const [first, last] = [Math.ceil(low / step), Math.floor(high / step + 1e-9)];
  return Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(6)));
}

function range(values) {
  const finite = values.filter(Number.isFinite);
  const [low, high] = [Math.min(...finite), Math.max(...finite)];
  const margin = high > low ? 0.05 * (high - low) : 0.5;
  return finite.length ? [low - margin, high + margin] : [0, 1];
}

const lettering = (text, [x, y], [right, down], anchor = "start") =>
  `<text x="${x}" y="${y}" dx="${right}" dy="${down}" text-anchor="${anchor}">${text}</text>`;

// A line through points of the picture, interrupted where one is no number.
function stroke(look, points) {
  const isDown = (i) => points[i]?.every(Number.isFinite);
  const step = ([x, y], i) => `${isDown(i - 1) ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`;
  return `<path d="${points.map((place, i) => (isDown(i) ? step(place, i) : "")).join("")}" ${look}/>`;
}

// Show a plot in an element: axes with a grid over `parts` of the picture and `lines`, [{look, points}], and marks.
function show(element, { x, y, across, inner, marks, say, parts = [], lines = [] }) {
  const part = (value, [low, high]) => (value - low) / (high - low);
  const at = ([right, up]) => [LEFT + part(right, x) * across, TOP + (1 - part(up, y)) * inner];
  const look = 'class="grid"';
  const columns = ticks(...x).map((value) => ({ look, value, points: y.map((up) => [value, up]) }));
  const rows = ticks(...y).map((value) => ({ look, value, points: x.map((right) => [right, value]) }));
  const dots = marks.filter((mark) => mark.every(Number.isFinite)).map(at);
  element.innerHTML = `<svg viewBox="0 0 ${WIDTH} ${TOP + inner + BOTTOM}" aria-hidden="true">${[
    ...parts,
    ...[...lines, ...columns, ...rows].map((line) => stroke(line.look, line.points.map(at))),
    ...columns.map(({ value, points }) => lettering(say(value), at(points[0]), [0, 14], "middle")),
    ...rows.map(({ value, points }) => lettering(say(value), at(points[0]), [-5, 4], "end")),
    ...dots.map(([right, down]) => `<circle cx="${right}" cy="${down}" r="4"/>`),
  ].join("")}</svg>`;
}

// Curves, [{look, values}], over x; `here` is the x of the probe, `marks` are points, and `acts` says where symbols act.
export function drawCurves(element, { x, curves, acts, ends, here, ...rest }) {
  const y = ends ?? range(curves.flatMap(({ values }) => values));
  const [across, inner] = [WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM];
  const within = (value) => Math.min(Math.max(value, y[0]), y[1]);
  const middle = (isActing) => (isActing ? (y[0] + y[1]) / 2 : NaN);
  const line = (look, values) => ({ look, points: values.map((value, i) => [x[i], value]) });
  const lines = [
    ...acts.map(({ look, values }) => line(`${look} stroke-width="${inner}"`, values.map(middle))),
    ...curves.map(({ look, values }) => line(look, values.map(within))),
    { look: 'class="here"', points: y.map((up) => [here, up]) },
  ];
  show(element, { ...rest, x: [x[0], x.at(-1)], y, across, inner, lines });
}

// A map of a square of values, from the highest row down; red where `red` is above 0, and white between regions.
export function drawMap(element, { values, ends, red, regions, colors, ...rest }) {
  const [low, high] = ends ?? range(values);
  const side = Math.sqrt(values.length);
  const isBorder = (i) =>
    ((i + 1) % side && regions[i] !== regions[i + 1]) || regions[i] !== (regions[i + side] ?? regions[i]);
  const step = (value) => Math.round(((value - low) / (high - low)) * (colors.length - 1)) || 0;
  const colorOf = (value) => colors[Math.min(Math.max(step(value), 0), colors.length - 1)];
  const picture = new ImageData(side, side);
  values.forEach((value, i) => {
    const color = red[i] > 0 ? RED : isBorder(i) ? WHITE : colorOf(value);
    if (Number.isFinite(value)) picture.data.set([...color, 255], 4 * i);
  });
  const canvas = Object.assign(document.createElement("canvas"), { width: side, height: side });
  canvas.getContext("2d").putImageData(picture, 0, 0);
  const [inner, bar] = [MAP - TOP - BOTTOM, MAP - TOP - BOTTOM + LEFT + 14];
  const parts = [
    `<image href="${canvas.toDataURL()}" x="${LEFT}" y="${TOP}" width="${inner}" height="${inner}"/>`,
    `<rect x="${bar}" y="${TOP}" width="12" height="${inner}" fill="url(#colors)"/>`,
    lettering(rest.say(high), [bar, TOP], [16, 10]),
    lettering(rest.say(low), [bar, TOP], [16, inner]),
  ];
  show(element, { ...rest, across: inner, inner, parts });
}
