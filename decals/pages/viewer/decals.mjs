// Decals as a scene file has them, and the records that shaders read (Decals.packed, Decals.limits).
import { DecalIndex } from "./index.mjs";
import { Texels } from "./texels.mjs";
import { length, subtract, tangential, unit } from "./vectors.mjs";

const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);

// A decal with a normal and a tangent that are perpendicular and of length 1; they are no numbers if that cannot be.
export function framed({ normal = [], tangent = [], ...row }) {
  const up = unit(normal);
  return { ...row, normal: up, tangent: tangential(tangent, up) };
}

// The name of the first value of a decal, with a frame, that a scene file cannot have; undefined if there is none.
export function wrongValue(row, { values, choices }) {
  const isRight = (name, value) => {
    if (Object.hasOwn(choices, name)) return choices[name].includes(value);
    const { test, count, low, high, zero } = values[name] ?? {};
    const isWithin = (x) => Number[test]?.(x) && ((low <= x && x <= high) || (zero && x === 0));
    return count ? Array.isArray(value) && value.length === count && value.every(isWithin) : isWithin(value);
  };
  return Object.keys({ position: 0, radius: 0, ...row }).find((name) => !isRight(name, row[name]));
}

export class DecalSet {
  constructor(rows, rules) {
    // `full`: an edit made decals for which the plain shaders are wrong
    Object.assign(this, { rules, rows: rows.slice(), full: false });
    this.records = new Texels(Float32Array, 4, 4 * rows.length);
    this.limits = new Texels(Float32Array, 4, rows.length);
    this.rows.forEach((row, number) => row && this.pack(row, number));
    this.index = new DecalIndex(rules.index, this.records, this.numbers);
  }

  get numbers() {
    return [...this.rows.keys()].filter((number) => this.rows[number]);
  }

  // What shaders read, by the names of its textures without their prefix.
  get texels() {
    const { records, limits, index } = this;
    return { records, limits, index_levels: index.levels, index_table: index.table, index_ids: index.ids };
  }

  pack(row, number) {
    const { rim, layerLimit, receivers, interactions } = this.rules;
    const { layer = 0, interaction = "push", spill, image = 0, tint = [1, 1, 1], opacity = 1 } = row;
    const rank = 4 * (layer + layerLimit) + interactions[interaction] + (spill ? 0.5 : 0);
    const place = [...row.position, Math.fround(row.radius) / rim, ...row.normal, rank];
    this.records.set(4 * number, [...place, ...row.tangent, image, ...tint.map(linear), opacity]);
    const angle = ((row.fade_angle ?? 0) * Math.PI) / 180;
    const fade = angle > 0 ? [Math.cos(angle / 2), Math.cos(angle)] : [0, 0];
    const receiver = Math.max(receivers.indexOf(row.receivers ?? ""), 0) + (row.single_sheet ? 0.5 : 0);
    this.limits.set(number, [...fade, row.fade_depth ?? 0, receiver]);
  }

  // Give a number another row, or none: the only way in which decals change.
  set(number, row) {
    if (this.rows[number]) this.index.remove(number);
    this.rows[number] = row;
    if (!row) return;
    this.pack(row, number);
    this.index.insert(number);
    this.full ||= this.needsFull(number);
  }

  // True if the plain form of the shaders, which is right for the first decals, is wrong for a changed one.
  needsFull(number) {
    const { layered, limited, nested } = this.rules.plain;
    if (!limited && this.limits.at(number).some((value) => value)) return true;
    const isLayered = (other) => this.index.rank(number) !== this.index.rank(other);
    const isWrong = (other) => (!layered && isLayered(other)) || (!nested && this.areNested(number, other));
    return this.numbers.some(isWrong);
  }

  // As `are_nested_contact` of decals/index/lookup.py.
  areNested(decal, other) {
    const { interactions, rim, nestingSlack, keptRadius } = this.rules;
    const rank = this.index.rank(decal);
    if (decal === other || rank % 4 !== interactions.push || this.index.rank(other) !== rank) return false;
    const balls = [decal, other].map((number) => this.index.ball(number));
    const [smaller, larger] = balls.map(({ influence }) => rim * influence).sort((a, b) => a - b);
    const outer = larger * (1 + nestingSlack);
    const apart = length(subtract(balls[0].centre, balls[1].centre));
    const difference = (outer - smaller) * (outer + smaller);
    const [near, far] = [apart ** 2 - difference, apart ** 2 + difference];
    const least = 2 * keptRadius * apart;
    return near <= 0 || near <= least * smaller || far <= least * outer;
  }
}
