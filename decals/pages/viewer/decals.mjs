// Decals as a scene file has them, and the records that shaders read (Decals.packed, Decals.limits).
import { DecalIndex } from "./index.mjs";
import { Texels } from "./texels.mjs";
import { length, subtract, tangential, unit } from "./vectors.mjs";

const INTERACTIONS = { independent: 0, push: 1, contact: 1, overlap: 2 };

const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);

// A decal with a normal and a tangent that are perpendicular and of length 1.
export function framed(row) {
  const normal = unit(row.normal);
  return { ...row, normal, tangent: tangential(row.tangent, normal) };
}

// True for a decal that a scene file may have, with a frame of unit vectors.
export function isDecal({ position, normal, tangent, radius, image = 0 }, rules, images) {
  const { maxCoordinate, minRadius } = rules;
  const isVector = (v) => v.length === 3 && v.every((x) => Math.abs(x) <= maxCoordinate);
  const isUnit = (v) => isVector(v) && Math.abs(length(v) - 1) < 1e-6;
  const isImage = Number.isInteger(image) && image >= -1 && image < images;
  const isRadius = radius >= minRadius && radius <= maxCoordinate;
  return isVector(position) && isUnit(normal) && isUnit(tangent) && isRadius && isImage;
}

export class DecalSet {
  constructor(rows, rules) {
    Object.assign(this, { rules, rows: rows.slice() });
    this.records = new Texels("RGBA32F", 4 * rows.length);
    this.limits = new Texels("RGBA32F", rows.length);
    this.rows.forEach((row, number) => row && this.pack(row, number));
    this.index = new DecalIndex(rules.index, this.records, this.numbers);
    this.rank = this.numbers.length ? this.index.rank(this.numbers[0]) : null; // of all, without layers
    this.full = false; // an edit made decals for which the plain shaders are wrong
  }

  get numbers() {
    return [...this.rows.keys()].filter((number) => this.rows[number]);
  }

  // What shaders read, by the names of its textures.
  get texels() {
    const { levels, table, ids } = this.index;
    return {
      decal_records: this.records,
      decal_limits: this.limits,
      decal_index_levels: levels,
      decal_index_table: table,
      decal_index_ids: ids,
    };
  }

  pack(row, number) {
    const { rim, layerLimit, receivers } = this.rules;
    const interaction = INTERACTIONS[row.interaction ?? "push"];
    const rank = 4 * ((row.layer ?? 0) + layerLimit) + interaction + (row.spill ? 0.5 : 0);
    const place = [...row.position, Math.fround(row.radius) / rim];
    const frame = [...row.normal, rank, ...row.tangent, row.image ?? 0];
    const color = [...(row.tint ?? [1, 1, 1]).map(linear), row.opacity ?? 1];
    this.records.set(4 * number, [...place, ...frame, ...color]);
    const angle = ((row.fade_angle ?? 0) * Math.PI) / 180;
    const fade = angle > 0 ? [Math.cos(angle / 2), Math.cos(angle)] : [0, 0];
    const receiver = Math.max(receivers.indexOf(row.receivers ?? ""), 0);
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
    this.rank ??= this.index.rank(number);
    if (!layered && this.index.rank(number) !== this.rank) return true;
    if (!limited && this.limits.at(number).some((value) => value)) return true;
    return !nested && this.numbers.some((other) => this.areNested(number, other));
  }

  // As `are_nested_contact` of decals/index/lookup.py.
  areNested(decal, other) {
    const rank = this.index.rank(decal);
    if (decal === other || rank % 4 !== INTERACTIONS.push || this.index.rank(other) !== rank) return false;
    const balls = [decal, other].map((number) => this.index.ball(number));
    const [smaller, larger] = balls.map(({ influence }) => this.rules.rim * influence).sort((a, b) => a - b);
    const outer = larger * (1 + this.rules.nestingSlack);
    const squared = length(subtract(balls[0].centre, balls[1].centre)) ** 2;
    const difference = (outer - smaller) * (outer + smaller);
    const least = (2 * this.rules.keptRadius) ** 2 * squared;
    const [near, far] = [squared - difference, squared + difference];
    return near <= 0 || near ** 2 <= least * smaller ** 2 || far ** 2 <= least * outer ** 2;
  }
}
