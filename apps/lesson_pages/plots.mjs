// Plots of lessons as SVG: curves with axes, and maps of colours.

const [LEFT, RIGHT, TOP, BOTTOM] = [40, 10, 8, 22]; // margins
const [WIDTH, HEIGHT, MAP] = [330, 140, 220]; // of a plot; a map is square
const [RED, WHITE] = [[213, 0, 0], [255, 255, 255]]; // prettier-ignore
const FAINT = 'stroke="#1d2126" stroke-opacity="0.15"';

// Up to six round numbers from low to high.
function ticks(low, high) {
  const power = 10 ** Math.floor(Math.log10(high - low));
  const step = [0.2, 0.5, 1, 2].map((part) => part * power).find((size) => (high - low) / size < 6);
  const first = Math.ceil(low / step);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toPrecision(6)));
}

function range(values) {
  const finite = values.filter(Number.isFinite);
  const [low, high] = [Math.min(...finite), Math.max(...finite)];
  const margin = high > low ? 0.05 * (high - low) : 0.5;
  return finite.length ? [low - margin, high + margin] : [0, 1];
}

const lettering = (text, x, y, anchor = "start") =>
  `<text x="${x}" y="${y}" text-anchor="${anchor}">${text}</text>`;

// A line through points of the picture, interrupted where one is no number.
function stroke(points, look) {
  const isDown = (i) => i >= 0 && Number.isFinite(points[i][1]);
  const steps = points.map(([x, y], i) => isDown(i) && `${isDown(i - 1) ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`); // prettier-ignore
  return `<path d="${steps.filter(Boolean).join("")}" fill="none" ${look}/>`;
}

// Show a plot in an element: axes with a grid around `draw`, which is given the place of a point in the picture.
function show(element, { x, y, across, inner, marks, say }, draw) {
  const part = (value, [low, high]) => (value - low) / (high - low);
  const at = (right, up) => [LEFT + part(right, x) * across, TOP + (1 - part(up, y)) * inner];
  const columns = ticks(...x).map((value) => [value, at(value, y[0])[0]]);
  const rows = ticks(...y).map((value) => [value, at(x[0], value)[1]]);
  const dots = marks.filter((mark) => mark.every(Number.isFinite)).map((mark) => at(...mark));
  element.innerHTML = `<svg viewBox="0 0 ${WIDTH} ${TOP + inner + BOTTOM}" aria-hidden="true">${[
    ...draw(at),
    ...columns.map(([, right]) => stroke([[right, TOP], [right, TOP + inner]], FAINT)),
    ...rows.map(([, down]) => stroke([[LEFT, down], [LEFT + across, down]], FAINT)),
    ...columns.map(([value, right]) => lettering(say(value), right, TOP + inner + 14, "middle")),
    ...rows.map(([value, down]) => lettering(say(value), LEFT - 5, down + 4, "end")),
    ...dots.map(([right, down]) => `<circle cx="${right}" cy="${down}" r="4" fill="#fff" stroke="#000" stroke-width="1.5"/>`),
  ].join("")}</svg>`; // prettier-ignore
}

// Curves, [{look, values}], over x; `here` is the x of the probe, `marks` are points, and `acts` says where symbols act.
export function drawCurves(element, { x, curves, acts, ends, here, marks, say }) {
  const y = ends ?? range(curves.flatMap(({ values }) => values));
  const [across, inner] = [WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM];
  const within = (value) => Math.min(Math.max(value, y[0]), y[1]);
  const probe = Number.isFinite(here) ? y.map((up) => [here, up]) : [];
  show(element, { x: [x[0], x.at(-1)], y, across, inner, marks, say }, (at) => [
    ...acts.map(({ symbol, values }) => stroke(values.map((isActing, i) => at(x[i], isActing ? (y[0] + y[1]) / 2 : NaN)), `data-region="${symbol}" stroke-width="${inner}"`)), // prettier-ignore
    ...curves.map(({ look, values }) => stroke(values.map((value, i) => at(x[i], within(value))), look)), // prettier-ignore
    stroke(probe.map((place) => at(...place)), 'stroke="#000" stroke-dasharray="3 3"'), // prettier-ignore
  ]);
}

// A map of a square of values, from the lowest row up; red where `red`, and white between regions.
export function drawMap(element, { x, y, values, ends, red, regions, colors, marks, say }) {
  const [low, high] = ends ?? range(values);
  const side = Math.sqrt(values.length);
  const isBorder = (i) =>
    ((i + 1) % side && regions[i] !== regions[i + 1]) || (i >= side && regions[i] !== regions[i - side]);
  const step = (value) => Math.round(((value - low) / (high - low)) * (colors.length - 1)) || 0;
  const colorOf = (value) => colors[Math.min(Math.max(step(value), 0), colors.length - 1)];
  const picture = new ImageData(side, side);
  values.forEach((value, i) => {
    const color = red[i] ? RED : isBorder(i) ? WHITE : colorOf(value);
    const row = side - 1 - Math.floor(i / side);
    if (Number.isFinite(value)) picture.data.set([...color, 255], 4 * (row * side + (i % side)));
  });
  const canvas = Object.assign(document.createElement("canvas"), { width: side, height: side });
  canvas.getContext("2d").putImageData(picture, 0, 0);
  const [inner, bar] = [MAP - TOP - BOTTOM, MAP - TOP - BOTTOM + LEFT + 14];
  const square = `x="${LEFT}" y="${TOP}" width="${inner}" height="${inner}"`;
  show(element, { x, y, across: inner, inner, marks, say }, () => [
    `<image href="${canvas.toDataURL()}" ${square} image-rendering="pixelated"/>`,
    `<rect x="${bar}" y="${TOP}" width="12" height="${inner}" fill="url(#colors)"/>`,
    lettering(say(high), bar + 16, TOP + 10),
    lettering(say(low), bar + 16, TOP + inner),
  ]);
}
