// The measures of formulas: numbers of the scene, fields at points, and what the shader knows there.
import { Camera } from "../../decals/pages/viewer/camera.mjs";
import { makeTarget } from "../../decals/pages/viewer/graphics.mjs";
import { add, cross, dot, length, scaled } from "../../decals/pages/viewer/vectors.mjs";
import { subtract, tangential, unit } from "../../decals/pages/viewer/vectors.mjs";

const SIDE = 120; // pixels of a map
const SAMPLES = 201; // of a curve
const FINE = 1e-3; // between the points of `jump`, in model units
const MOST = 4001; // of these points
const ANGLE = Math.PI / 360; // half of that at which pictures are seen
const NEAR = 1e-3; // half the width of the picture of one point, in sizes of the map
const LEAST = 1e-6; // that is not shown as 0: fields have the precision of float32
const DIFFERENCE = 1e-3; // of differences, in radii of the smallest decal

const sum = (values) => values.reduce((a, b) => a + b, 0);
const greatest = (values) => values.reduce((a, b) => (b > a ? b : a), -Infinity); // numbers alone count
const discOf = ({ radius }) => Math.PI * radius ** 2;

// Numbers in the middles of equal parts of a range.
const spread = (low, high, count) =>
  Array.from({ length: count }, (_, i) => low + ((i + 0.5) / count) * (high - low));

// A point, which is at a place of its own if the surface has none there.
const placed = (point, place) => (point.exists ? point : { ...point, ...place });

// The factor h of equation 5, of an owner's field and a neighbour's lower one.
function factor(own, other) {
  if (own < 0.5 || own < other) return NaN;
  if (own + other <= 1 || own >= 1) return 1;
  const u = Math.min(Math.max((own + other - 1) / (2 * own - 1), 0), 1);
  return 1 - u ** (1 / (1 - own));
}

// A value as a text: three digits, yes or no.
export function shown(value, words) {
  if (typeof value === "boolean") return value ? words.yes : words.no;
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) < LEAST) return "0";
  const digits = Math.abs(value) >= 100 ? value.toFixed(0) : String(Number(value.toPrecision(3)));
  return digits.replace(".", words.point);
}

export class Measures {
  // `lesson` has the camera, the size of maps, the ends of the line, and words; `known` is valid until the state changes.
  constructor(viewer, lesson) {
    Object.assign(this, { viewer, lesson, known: {} });
  }

  say = (value) => shown(value, this.lesson.words);

  // -- what the shader knows ------------------------------------------------------------------------------

  // A painter of its own size that shares programs and textures with the viewer's.
  eye(width, height) {
    const { painter } = this.viewer;
    painter.eyes ??= {};
    return (painter.eyes[`${width} ${height}`] ??= Object.assign(Object.create(painter), {
      canvas: { width, height },
      textures: Object.create(painter.textures),
      seen: undefined,
      target: makeTarget(painter.gl, [width, height], Array(3).fill(painter.header.targets.picked)),
    }));
  }

  // The points that pixels show, row by row from the highest, nearly straight from the side of `back`. The picture is
  // twice as wide as `half`.
  read({ target, back, up, half }, width, height) {
    const { viewer } = this;
    const { gl } = viewer.painter;
    const eye = this.eye(width, height);
    const smallest = Math.min(...viewer.decals.numbers.map((number) => viewer.decals.rows[number].radius));
    viewer.header.uniforms.measure_step = ["1f", DIFFERENCE * smallest];
    const from = add(target, scaled(back, half / Math.tan(ANGLE)));
    const fov = (360 / Math.PI) * Math.atan((Math.tan(ANGLE) * height) / width);
    eye.view = viewer.painter.view = ""; // they share the block of the camera
    eye.look(new Camera({ position: from, target, up, fov }, viewer.header.bounds));
    eye.paint("measure", eye.target, viewer);
    const targets = [0, 1, 2].map((number) => {
      const texels = new Float32Array(4 * width * height);
      gl.readBuffer(gl.COLOR_ATTACHMENT0 + number);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, texels);
      return texels;
    });
    return Array.from({ length: width * height }, (_, i) => {
      const first = 4 * ((height - 1 - Math.floor(i / width)) * width + (i % width)); // the lowest row comes first
      const [position, normal, image] = targets.map((texels) => [...texels.subarray(first, first + 4)]);
      const [owner, exists, [field, stretch, folded]] = [position.pop(), normal.pop(), image];
      return { position, normal, owner, exists, field, stretch: owner < 0 ? NaN : stretch, folded };
    });
  }

  // The picture of a map.
  view() {
    const { camera, size } = this.lesson;
    return { ...camera, back: unit(subtract(camera.position, camera.target)), half: size / 2 };
  }

  // The points that pixels of a map show, and of a part around its middle; those that the surface has; points of the line.
  map = () => (this.known.map ??= this.read(this.view(), SIDE, SIDE));
  onPad = (half) => this.read({ ...this.view(), half }, SIDE, SIDE);
  surface = () => (this.known.surface ??= this.map().filter((point) => point.exists));
  curve = () => (this.known.curve ??= this.along(SAMPLES));

  // Points of a plot over numbers, which has no place in the scene: along one range, or row by row over two.
  numbersAlong = (x) => spread(...x, SAMPLES).map((right) => ({ x: right }));
  numbersOver = (x, y) =>
    spread(...y, SIDE)
      .reverse()
      .flatMap((up) => spread(...x, SIDE).map((at) => ({ x: at, y: up })));

  // The ends of the line, its direction, and the least and the greatest distance along it.
  line() {
    const ends = this.lesson.line.map((end) => (end.length ? { position: end, radius: 0 } : this.row(end)));
    const [first, last] = ends.map(({ position }) => position);
    const [reach, other] = ends.map(({ radius }) => radius / this.viewer.header.rules.rim);
    const way = subtract(last, first);
    const [low, high] = [Math.min(-reach, length(way) - other), Math.max(length(way) + other, reach)];
    return { first, direction: unit(way), low, high };
  }

  // Points along the line, with "x".
  along(count) {
    const { first, direction, low, high } = this.line();
    const placeOf = (x) => add(first, scaled(direction, x));
    const [half, { back }] = [(high - low) / 2, this.view()];
    const seen = { target: placeOf(low + half), back, up: cross(back, direction), half };
    const points = this.read(seen, count, 1);
    return spread(low, high, count).map((x, i) => ({ ...placed(points[i], { position: placeOf(x) }), x }));
  }

  // The point of the surface that is seen from above a place.
  above({ position, normal }) {
    const up = tangential(Math.abs(normal[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0], normal);
    const seen = { target: position, back: normal, up, half: NEAR * this.lesson.size };
    return placed(this.read(seen, 1, 1)[0], { position, normal });
  }

  // -- numbers of the scene, and at points -----------------------------------------------------------------

  row(number) {
    const row = this.viewer.decals.rows[number];
    if (!row) throw new Error(this.lesson.words.lost);
    return row;
  }

  distance = (q, i, k) => length(subtract(this.row(i).position, this.row(k).position));
  radius = (q, i) => Math.fround(this.row(i).radius);
  influence = (q, i) => this.radius(q, i) / this.viewer.header.rules.rim;
  g = (q, d) => (d < 1 ? (1 - d * d) ** 3 : 0);
  d = (q, i) => length(subtract(q.position, this.row(i).position)) / this.influence(q, i);
  f = (q, i) => this.g(q, this.d(q, i));
  numbers = () => (this.known.numbers ??= this.viewer.decals.numbers); // listed once, not at each point
  top = (q) => Math.max(0, ...this.numbers().map((number) => this.f(q, number)));
  F = (q) => (q.owner >= 0 ? q.field : Math.min(this.top(q), 0.5));
  h = (q, i, k) => factor(this.f(q, k), this.f(q, i));

  pushed(q, ...fields) {
    const [own, other] = fields.map((field) => Math.min(Math.max(field, 0), 1));
    return own < 0.5 && own >= other ? own : 0.5 + (own - 0.5) * factor(own, other);
  }

  // -- formulas at other points ---------------------------------------------------------------------------

  // The numbers of a formula on the map.
  onMap = (formula) => this.surface().map((point) => Number(formula(point)));
  most = (q, formula) => greatest(this.onMap(formula));
  least = (q, formula) => -greatest(this.onMap((point) => -formula(point)));
  share = (q, formula) => sum(this.onMap((point) => formula(point) > 0)) / this.surface().length;

  // The part of the image of a decal that shows, of those that lie on others, and of all that do not show.
  kept = (q, i) => this.areaOf((point) => point.owner === i) / discOf(this.row(i));
  lost = () => 1 - this.areaOf(({ owner }) => owner >= 0) / this.discs();

  overlapped = () => this.areaOf((point) => Math.max(this.over(point).length - 1, 0)) / this.discs();
  over = (point) => this.numbers().filter((number) => this.f(point, number) >= 0.5);
  areaOf = (formula) => sum(this.onMap(formula)) * (this.lesson.size / SIDE) ** 2;
  discs = () => sum(this.viewer.decals.numbers.map((number) => discOf(this.row(number))));

  at = (q, i, formula) => formula(this.above(this.row(i)));

  between(q, i, k, formula) {
    const [first, last] = [this.row(i), this.row(k)];
    const [reach, other] = [i, k].map((number) => this.influence(q, number));
    const way = scaled(subtract(last.position, first.position), reach / (reach + other));
    return formula(this.above({ ...first, position: add(first.position, way) }));
  }

  jump(q, formula) {
    const { low, high } = this.line();
    const points = (this.known.fine ??= this.along(Math.min(Math.ceil((high - low) / FINE), MOST)));
    const values = points.map((point) => Number(formula(point)));
    const isOne = (i) => i > 0 && points[i].owner === points[i - 1].owner;
    return greatest(values.map((value, i) => (isOne(i) ? Math.abs(value - values[i - 1]) : 0)));
  }

  // Where a position is on the line, and on a map from −½ to ½ of its size.
  onLine = (position) => dot(subtract(position, this.line().first), this.line().direction);

  onPlane(position) {
    const { back, target, up } = this.view();
    const [right, offset] = [unit(cross(up, back)), subtract(position, target)];
    return [dot(offset, right), dot(offset, cross(back, right))];
  }
}
