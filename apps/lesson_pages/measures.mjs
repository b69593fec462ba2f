// The measures of formulas: numbers of the scene, fields at points, and what the shader knows there.
import { Camera } from "../../decals/pages/viewer/camera.mjs";
import { makeTarget } from "../../decals/pages/viewer/graphics.mjs";
import { add, cross, dot, length, scaled } from "../../decals/pages/viewer/vectors.mjs";
import { subtract, tangential, unit } from "../../decals/pages/viewer/vectors.mjs";

const SIDE = 120; // pixels of a map
const SAMPLES = 201; // of a curve
const FINE = 1e-3; // between the points of `jump`, in model units
const MOST = 4001; // of these points
const ANGLE = Math.PI / 360; // half of that at which maps and lines are seen: nearly from one side
const DIFFERENCE = 1e-3; // of differences, in radii of the smallest decal

const discOf = ({ radius }) => Math.PI * radius ** 2;
export const falloff = (d) => (d < 1 ? (1 - d * d) ** 3 : 0);

// The factor h of equation 5, of the owner's field and a neighbour's lower one.
export function factor(own, other) {
  if (own + other <= 1 || own >= 1) return 1;
  const u = Math.min(Math.max((own + other - 1) / (2 * own - 1), 0), 1);
  return 1 - u ** (1 / (1 - own));
}

export class Measures {
  // `lesson` has the camera, the size of maps, the ends of the line, and the words for a lost decal.
  constructor(viewer, lesson) {
    Object.assign(this, { viewer, lesson, known: new Map(), eyes: {} });
  }

  // The result of a call, until the state changes (`known.clear()`).
  once(name, call) {
    if (!this.known.has(name)) this.known.set(name, call());
    return this.known.get(name);
  }

  // -- what the shader knows ------------------------------------------------------------------------------

  // A painter of its own size that shares programs and textures with the viewer's.
  eye(width, height) {
    const { painter } = this.viewer;
    if (this.painter !== painter) Object.assign(this, { painter, eyes: {} });
    const { gl, header } = painter;
    return (this.eyes[`${width} ${height}`] ??= Object.assign(Object.create(painter), {
      canvas: { width, height },
      textures: Object.create(painter.textures),
      seen: undefined,
      view: "",
      buffer: gl.createBuffer(),
      target: makeTarget(gl, [width, height], Array(3).fill(header.targets.picked)),
    }));
  }

  // The points that pixels show, row by row from the lowest of `rows`.
  read(camera, width, height, rows = [0, height]) {
    const { viewer } = this;
    const { gl } = viewer.painter;
    const eye = this.eye(width, height);
    const smallest = Math.min(...viewer.decals.numbers.map((number) => viewer.decals.rows[number].radius));
    viewer.header.uniforms.measure_step = ["1f", DIFFERENCE * smallest];
    const before = gl.getParameter(gl.UNIFORM_BUFFER_BINDING);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, eye.buffer);
    eye.look(camera);
    eye.paint("measure", eye.target, viewer);
    const [points, normals, images] = [0, 1, 2].map((number) => {
      const texels = new Float32Array(4 * width * rows[1]);
      gl.readBuffer(gl.COLOR_ATTACHMENT0 + number);
      gl.readPixels(0, rows[0], width, rows[1], gl.RGBA, gl.FLOAT, texels);
      return texels;
    });
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, before);
    return Array.from({ length: width * rows[1] }, (_, i) => {
      const owner = points[4 * i + 3];
      return {
        position: [points[4 * i], points[4 * i + 1], points[4 * i + 2]],
        exists: normals[4 * i + 3] > 0,
        owner,
        field: images[4 * i],
        stretch: owner < 0 ? NaN : images[4 * i + 1],
        folded: images[4 * i + 2],
      };
    });
  }

  // The points that pixels of a map show, row by row from the lowest.
  get map() {
    const { camera, size } = this.lesson;
    const back = unit(subtract(camera.position, camera.target));
    const position = add(camera.target, scaled(back, size / 2 / Math.tan(ANGLE)));
    const seen = { ...camera, position, fov: (ANGLE * 360) / Math.PI };
    return this.once("map", () => this.read(new Camera(seen, this.viewer.header.bounds), SIDE, SIDE));
  }

  // The ends of the line, its direction, and the least and the greatest distance along it.
  get line() {
    const { lesson } = this;
    const isPair = typeof lesson.line[0] === "number";
    const [first, last] = lesson.line.map((end) => (isPair ? this.row(end).position : end));
    const way = subtract(last, first);
    const [apart, direction] = [length(way), unit(way)];
    const [reach, other] = isPair ? lesson.line.map((end) => this.influence(null, end)) : [0, 0];
    return { first, direction, low: Math.min(-reach, apart - other), high: Math.max(apart + other, reach) };
  }

  // Points along the line, with "x".
  along(count) {
    const { first, direction, low, high } = this.line;
    const { camera } = this.lesson;
    const target = add(first, scaled(direction, (low + high) / 2));
    const back = unit(subtract(camera.position, camera.target));
    const half = (high - low) / 2;
    const far = half / Math.tan(ANGLE);
    const fov = (360 / Math.PI) * Math.atan((3 * half) / count / far);
    const seen = { position: add(target, scaled(back, far)), target, up: cross(back, direction), fov };
    const points = this.read(new Camera(seen, this.viewer.header.bounds), count, 3, [1, 1]);
    return points.map((point, i) => {
      const x = low + ((i + 0.5) / count) * (high - low);
      return { ...point, x, position: point.exists ? point.position : add(first, scaled(direction, x)) };
    });
  }

  // The point of the surface that is seen from above a place.
  above({ position, normal }) {
    const up = tangential(Math.abs(normal[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0], normal);
    const seen = { position: add(position, scaled(normal, 0.1 * this.lesson.size)), target: position, up };
    const [, point] = this.read(new Camera({ ...seen, fov: 0.1 }, this.viewer.header.bounds), 3, 3, [1, 1]);
    return point.exists ? point : { ...point, position };
  }

  // -- numbers of the scene -------------------------------------------------------------------------------

  row(number) {
    const row = this.viewer.decals.rows[number];
    if (!row) throw new Error(this.lesson.words.lost);
    return row;
  }

  count = () => this.viewer.decals.numbers.length;
  distance = (q, i, k) => length(subtract(this.row(i).position, this.row(k).position));
  radius = (q, i) => Math.fround(this.row(i).radius);
  influence = (q, i) => this.radius(q, i) / this.viewer.header.rules.rim;
  layer = (q, i) => this.row(i).layer ?? 0;
  interaction = (q, i) => this.row(i).interaction ?? "push";
  contact = () => this.viewer.mode;
  stiffness = () => this.viewer.stiffness;

  // -- at points ------------------------------------------------------------------------------------------

  abs = (q, a) => Math.abs(a);
  max = (q, a, b) => (a > b ? a : b + 0 * a);
  where = (q, condition, a, b) => (condition ? a : b);
  g = (q, d) => falloff(d);
  d = (q, i) => length(subtract(q.position, this.row(i).position)) / this.influence(q, i);
  f = (q, i) => falloff(this.d(q, i));
  owner = (q) => q.owner;
  stretch = (q) => q.stretch;
  folded = (q) => q.folded;
  F = (q) => (q.owner >= 0 ? q.field : Math.min(this.top(q), 0.5));
  top = (q) => Math.max(0, ...this.viewer.decals.numbers.map((number) => this.f(q, number)));

  h(q, i, k) {
    const [own, other] = [this.f(q, k), this.f(q, i)];
    return own >= 0.5 && own >= other ? factor(own, other) : NaN;
  }

  pushed(q, ...fields) {
    const [own, other] = fields.map((field) => Math.min(Math.max(field, 0), 1));
    if (other > own) return NaN;
    return own >= 0.5 ? 0.5 + (own - 0.5) * factor(own, other) : own;
  }

  // The points of the map that the surface has.
  get surface() {
    return this.once("surface", () => this.map.filter((point) => point.exists));
  }

  // -- formulas at other points ---------------------------------------------------------------------------

  // The numbers of a formula on the map.
  onMap = (formula) => this.surface.map((point) => Number(formula(point)));
  most = (q, formula) => this.onMap(formula).reduce((a, b) => (b > a ? b : a), -Infinity);
  least = (q, formula) => this.onMap(formula).reduce((a, b) => (b < a ? b : a), Infinity);

  share(q, formula) {
    const values = this.onMap(formula);
    return values.filter((value) => value > 0).length / values.length;
  }

  // The part of the image of a decal that shows, of those that lie on others, and of all that do not show.
  kept = (q, i) => this.areaOf((point) => point.owner === i) / discOf(this.row(i));
  lost = () => 1 - this.areaOf(({ owner }) => owner >= 0) / this.discs;

  overlapped() {
    const { numbers } = this.viewer.decals;
    const over = (point) => Math.max(numbers.filter((number) => this.f(point, number) >= 0.5).length - 1, 0);
    return this.areaOf(over) / this.discs;
  }

  areaOf = (formula) => this.onMap(formula).reduce((a, b) => a + b, 0) * (this.lesson.size / SIDE) ** 2;

  get discs() {
    return this.viewer.decals.numbers.reduce((sum, number) => sum + discOf(this.row(number)), 0);
  }

  at = (q, i, formula) => formula(this.above(this.row(i)));

  between(q, i, k, formula) {
    const [first, last] = [this.row(i), this.row(k)];
    const [reach, other] = [i, k].map((number) => this.influence(q, number));
    const way = scaled(subtract(last.position, first.position), reach / (reach + other));
    return formula(this.above({ ...first, position: add(first.position, way) }));
  }

  jump(q, formula) {
    const { low, high } = this.line;
    const count = Math.min(Math.ceil((high - low) / FINE), MOST);
    const points = this.once("fine", () => this.along(count));
    const values = points.map((point) => Number(formula(point)));
    const isOne = (i) => i > 0 && points[i].owner === points[i - 1].owner;
    const changes = values.map((value, i) => (isOne(i) ? Math.abs(value - values[i - 1]) : 0));
    return changes.reduce((a, b) => (b > a ? b : a), 0);
  }

  // Where a position is on the line, and on a map from −½ to ½ of its size.
  onLine = (position) => dot(subtract(position, this.line.first), this.line.direction);

  onPlane(position) {
    const { camera } = this.lesson;
    const ahead = unit(subtract(camera.target, camera.position));
    const right = unit(cross(ahead, camera.up));
    const offset = subtract(position, camera.target);
    return [dot(offset, right), dot(offset, cross(right, ahead))];
  }

  get curve() {
    return this.once("curve", () => this.along(SAMPLES));
  }
}

// Points of a plot over numbers, which has no place in the scene: along one range, or row by row over two.
export function numbersOver(x, y) {
  const steps = ([low, high], count) =>
    Array.from(
      { length: count },
      (_, i) => low + ((i + (y ? 0.5 : 0)) / (count - (y ? 0 : 1))) * (high - low),
    );
  if (!y) return steps(x, SAMPLES).map((value) => ({ x: value }));
  return steps(y, SIDE).flatMap((up) => steps(x, SIDE).map((right) => ({ x: right, y: up, exists: true })));
}
