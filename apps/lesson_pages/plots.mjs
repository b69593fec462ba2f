// Plots of lessons as SVG: curves with axes, and maps of colours.

const [LEFT, RIGHT, TOP, BOTTOM, LEGEND] = [40, 10, 8, 22, 17]; // margins, and height of a row of the legend
const [WIDTH, HEIGHT, MAP] = [330, 140, 220]; // of a plot; a map is square
const COLORS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"]; // after Okabe and Ito
const DASHES = ["", "6 3", "2 2", "8 3 2 3", "1 3", "10 4"];
const VIRIDIS = [[68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37]]; // prettier-ignore
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

export function range(values) {
  const finite = values.filter(Number.isFinite);
  const [low, high] = [Math.min(...finite), Math.max(...finite)];
  if (!finite.length) return [0, 1];
  const margin = high > low ? 0.05 * (high - low) : 0.5;
  return [low - margin, high + margin];
}

const lettering = (text, x, y, anchor = "start") =>
  `<text x="${x}" y="${y}" text-anchor="${anchor}">${text.replace(/[&<]/g, (sign) => `&#${sign.charCodeAt()};`)}</text>`;

// A line through points of the picture, interrupted where one is no number.
function stroke(points, look) {
  const isDown = (i) => i >= 0 && Number.isFinite(points[i][1]);
  const steps = points.map(([x, y], i) => isDown(i) && `${isDown(i - 1) ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`); // prettier-ignore
  return `<path d="${steps.filter(Boolean).join("")}" fill="none" ${look}/>`;
}

// Show a plot in an element: axes with a grid around `draw`, which is given the place of a point in the picture.
function show(element, { x, y, across, top, inner, marks, say }, draw) {
  const part = (value, [low, high]) => (value - low) / (high - low);
  const at = (right, up) => [LEFT + part(right, x) * across, top + (1 - part(up, y)) * inner];
  const columns = ticks(...x).map((value) => [value, at(value, y[0])[0]]);
  const rows = ticks(...y).map((value) => [value, at(x[0], value)[1]]);
  const dots = marks.filter((mark) => mark.every(Number.isFinite)).map((mark) => at(...mark));
  element.innerHTML = `<svg viewBox="0 0 ${WIDTH} ${top + inner + BOTTOM}" aria-hidden="true">${[
    ...draw(at),
    ...columns.map(([, right]) => stroke([[right, top], [right, top + inner]], FAINT)),
    ...rows.map(([, down]) => stroke([[LEFT, down], [LEFT + across, down]], FAINT)),
    ...columns.map(([value, right]) => lettering(say(value), right, top + inner + 14, "middle")),
    ...rows.map(([value, down]) => lettering(say(value), LEFT - 5, down + 4, "end")),
    ...dots.map(([right, down]) => `<circle cx="${right}" cy="${down}" r="4" fill="#fff" stroke="#000" stroke-width="1.5"/>`),
  ].join("")}</svg>`; // prettier-ignore
}

// Curves, [{label, values}], over x; `here` is the x of the probe, and `marks` are points.
export function drawCurves(element, { x, curves, ends, here, marks, say }) {
  const top = TOP + LEGEND * Math.ceil(curves.length / 2);
  const y = ends ?? range(curves.flatMap(({ values }) => values));
  const box = { across: WIDTH - LEFT - RIGHT, top, inner: HEIGHT - TOP - BOTTOM };
  const within = (value) => Math.min(Math.max(value, y[0]), y[1]);
  show(element, { x: [x[0], x.at(-1)], y, ...box, marks, say }, (at) => [
    ...curves.flatMap(({ label, values }, number) => {
      const look = `stroke="${COLORS[number % 6]}" stroke-width="2" stroke-dasharray="${DASHES[number % 6]}"`;
      const [left, down] = [LEFT + (number % 2) * 145, TOP + 6 + Math.floor(number / 2) * LEGEND];
      const key = stroke([[left, down - 4], [left + 22, down - 4]], look); // prettier-ignore
      return [stroke(values.map((value, i) => at(x[i], within(value))), look), key, lettering(label, left + 27, down)]; // prettier-ignore
    }),
    Number.isFinite(here) ? stroke(y.map((up) => at(here, up)), 'stroke="#000" stroke-dasharray="3 3"') : "", // prettier-ignore
  ]);
}

const colorOf = (part) => {
  const place = Math.min(Math.max(part || 0, 0), 1) * (VIRIDIS.length - 1);
  const low = Math.min(Math.floor(place), VIRIDIS.length - 2);
  return VIRIDIS[low].map((level, i) => level + (place - low) * (VIRIDIS[low + 1][i] - level));
};

// A picture of colours, row by row from the lowest; none where there is no colour.
function pixels(colors, columns, [x, y, width, height]) {
  const rows = colors.length / columns;
  const picture = new ImageData(columns, rows);
  colors.forEach((color, i) => {
    const row = rows - 1 - Math.floor(i / columns);
    if (color) picture.data.set([...color, 255], 4 * (row * columns + (i % columns)));
  });
  const canvas = Object.assign(document.createElement("canvas"), { width: columns, height: rows });
  canvas.getContext("2d").putImageData(picture, 0, 0);
  const place = `x="${x}" y="${y}" width="${width}" height="${height}" preserveAspectRatio="none"`;
  return `<image href="${canvas.toDataURL()}" ${place} image-rendering="pixelated"/>`;
}

// A map of a square of values, from the lowest row up; red where `red`, and white between regions.
export function drawMap(element, { x, y, values, ends, red, redLabel, regions, marks, say }) {
  const [low, high] = ends ?? range(values);
  const side = Math.sqrt(values.length);
  const isBorder = (i) =>
    ((i + 1) % side && regions[i] !== regions[i + 1]) || (i >= side && regions[i] !== regions[i - side]);
  const shade = (value, i) => (red?.[i] ? RED : isBorder(i) ? WHITE : colorOf((value - low) / (high - low)));
  const colors = values.map((value, i) => Number.isFinite(value) && shade(value, i));
  const [inner, bar] = [MAP - TOP - BOTTOM, MAP - TOP - BOTTOM + LEFT + 14];
  const steps = Array.from({ length: 64 }, (_, i) => colorOf(i / 63));
  show(element, { x, y, across: inner, top: TOP, inner, marks, say }, () => [
    pixels(colors, side, [LEFT, TOP, inner, inner]),
    pixels(steps, 1, [bar, TOP, 12, inner]),
    lettering(say(high), bar + 16, TOP + 10),
    lettering(say(low), bar + 16, TOP + inner),
    red ? `<path d="M${bar + 34} ${TOP + 20}h12v12h-12z" fill="rgb(${RED})"/>` : "",
    red ? lettering(redLabel, bar + 50, TOP + 30) : "",
  ]);
}
