// Decals as a scene file has them, and the records that shaders read (Decals.packed, Decals.limits).
import { DecalIndex, RECORD } from "./index.mjs";
import { length } from "./vectors.mjs";

const INTERACTIONS = { independent: 0, push: 1, contact: 1, overlap: 2 };

const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);

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
    this.rules = rules;
    this.rows = rows.slice();
    this.records = new Float32Array(RECORD * this.capacity);
    this.limits = new Float32Array(4 * this.capacity);
    this.rows.forEach((row, number) => row && this.pack(row, number));
    this.index = new DecalIndex(rules.index, this.records);
    this.index.build(this.numbers);
    this.rank = this.numbers.length ? this.index.rank(this.numbers[0]) : null; // of all, without layers
    this.full = false; // an edit made decals for which the plain shaders are wrong
    this.changed = null; // all rows
  }

  get capacity() {
    return Math.ceil(1.5 * this.rows.length) + 64;
  }

  get numbers() {
    return [...this.rows.keys()].filter((number) => this.rows[number]);
  }

  pack(row, number) {
    const { rim, layerLimit, receivers } = this.rules;
    const interaction = INTERACTIONS[row.interaction ?? "push"];
    const rank = 4 * ((row.layer ?? 0) + layerLimit) + interaction + (row.spill ? 0.5 : 0);
    this.records.set(
      [
        ...row.position,
        Math.fround(row.radius) / rim,
        ...row.normal,
        rank,
        ...row.tangent,
        row.image ?? 0,
        ...(row.tint ?? [1, 1, 1]).map(linear),
        row.opacity ?? 1,
      ],
      RECORD * number,
    );
    const angle = ((row.fade_angle ?? 0) * Math.PI) / 180;
    const fade = angle > 0 ? [Math.cos(angle / 2), Math.cos(angle)] : [0, 0];
    const place = Math.max(receivers.indexOf(row.receivers ?? ""), 0);
    this.limits.set([...fade, row.fade_depth ?? 0, place], 4 * number);
  }

  // Give a number another row, or none: the only way in which decals change.
  set(number, row) {
    if (this.rows[number]) this.index.remove(number);
    this.rows[number] = row;
    if (4 * number >= this.limits.length) this.grow();
    if (row) {
      this.pack(row, number);
      this.index.insert(number);
      this.full ||= this.needsFull(number);
    }
    this.changed?.add(number);
  }

  // True if the plain form of the shaders, which is right for the first decals, is wrong for a changed one.
  needsFull(number) {
    const { layered, limited, nested } = this.rules.plain;
    this.rank ??= this.index.rank(number);
    if (!layered && this.index.rank(number) !== this.rank) return true;
    if (!limited && this.limits.subarray(4 * number, 4 * number + 4).some((value) => value)) return true;
    return !nested && this.numbers.some((other) => this.areNested(number, other));
  }

  // As `are_nested_contact` of decals/index/lookup.py.
  areNested(decal, other) {
    const rank = this.index.rank(decal);
    if (decal === other || rank % 4 !== INTERACTIONS.push || this.index.rank(other) !== rank) return false;
    const [a, b] = [RECORD * decal, RECORD * other];
    const sizes = [this.records[a + 3], this.records[b + 3]].map((size) => this.rules.rim * size);
    const [smaller, larger] = [Math.min(...sizes), Math.max(...sizes) * (1 + this.rules.nestingSlack)];
    let squared = 0;
    for (let axis = 0; axis < 3; axis++) squared += (this.records[a + axis] - this.records[b + axis]) ** 2;
    const difference = (larger - smaller) * (larger + smaller);
    const least = (2 * this.rules.keptRadius) ** 2 * squared;
    const [near, far] = [squared - difference, squared + difference];
    return near <= 0 || near ** 2 <= least * smaller ** 2 || far ** 2 <= least * larger ** 2;
  }

  grow() {
    const records = new Float32Array(RECORD * this.capacity);
    const limits = new Float32Array(4 * this.capacity);
    records.set(this.records);
    limits.set(this.limits);
    Object.assign(this, { records, limits, changed: null });
    this.index.records = records;
  }

  // Return the numbers of the decals that changed since the last call; null for all.
  takeChanges() {
    const { changed } = this;
    this.changed = new Set();
    return changed;
  }
}

// Edits that can be undone. A step is a list of [number, row before, row after].
export class History {
  constructor(decals, onChange) {
    Object.assign(this, { decals, onChange, done: [], undone: [] });
  }

  // Change decals at once; `open` continues the last step, as a drag does.
  change(pairs, { open = false } = {}) {
    const steps = pairs.map(([number, row]) => [number, this.decals.rows[number] ?? null, row]);
    for (const [number, , row] of steps) this.decals.set(number, row);
    const last = this.done.at(-1);
    if (open && last) {
      for (const step of steps) {
        const known = last.find(([number]) => number === step[0]);
        if (known) known[2] = step[2];
        else last.push(step);
      }
    } else {
      this.done.push(steps);
    }
    this.undone = [];
    this.onChange();
  }

  undo() {
    this.move(this.done, this.undone, (step) => step[1]);
  }

  redo() {
    this.move(this.undone, this.done, (step) => step[2]);
  }

  move(from, to, rowOf) {
    const steps = from.pop();
    if (!steps) return;
    for (const step of steps) this.decals.set(step[0], rowOf(step));
    to.push(steps);
    this.onChange();
  }
}
