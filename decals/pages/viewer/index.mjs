// The index of decals, as decals/index/index.py describes it: a hash grid of several levels in three arrays.
// Lists have room at their ends, so that one decal moves without the others.

export const RECORD = 16; // numbers of a record
const MIN_ROOM = 4;
const MAX_LEVELS = 128;
const FIRST_SIZE = 1024; // slots of an empty table

const EMPTY = -1;

// The smallest e with x < 2^e.
export function exponentAbove(x) {
  if (!(x > 0)) return 0;
  let e = Math.floor(Math.log2(x)) + 1;
  while (2 ** e <= x) e += 1;
  while (2 ** (e - 1) > x) e -= 1;
  return e;
}

export class DecalIndex {
  // `rules` holds constants of the index (reach, finest, halfRange, levelShift, mix) and its parity and floor.
  constructor(rules, records) {
    this.rules = rules;
    this.records = records;
    this.levels = new Float32Array(4 * MAX_LEVELS);
  }

  rank(number) {
    return Math.floor(this.records[RECORD * number + 7]);
  }

  before(a, b) {
    return this.rank(a) - this.rank(b) || a - b;
  }

  reach(number) {
    return this.records[RECORD * number + 3] * this.rules.reach;
  }

  // The exponent of a decal's cells, as `cell_exponent` of decals/index/decal_cells.py.
  exponent(number) {
    const { parity, floor, finest } = this.rules;
    const reach = this.reach(number);
    const own = exponentAbove(reach);
    const joins = parity !== null && ((own % 2) + 2) % 2 !== parity ? 1 : 0;
    let farthest = 0;
    for (let axis = 0; axis < 3; axis++) {
      farthest = Math.max(farthest, Math.abs(this.records[RECORD * number + axis]));
    }
    const least = exponentAbove(farthest + reach) - finest;
    return Math.max(own - joins, least, floor ?? -Infinity);
  }

  // Call a function with the three coordinates of each cell that the ball of a decal touches.
  eachCell(number, exponent, call) {
    const width = 2 ** exponent;
    const reach = this.reach(number);
    const centre = this.records.subarray(RECORD * number, RECORD * number + 3);
    const low = [0, 1, 2].map((axis) => Math.floor((centre[axis] - reach) / width));
    const high = [0, 1, 2].map((axis) => Math.floor((centre[axis] + reach) / width));
    const outside = (axis, cell) =>
      Math.max(cell * width - centre[axis], centre[axis] - (cell + 1) * width, 0) ** 2;
    for (let x = low[0]; x <= high[0]; x++) {
      for (let y = low[1]; y <= high[1]; y++) {
        for (let z = low[2]; z <= high[2]; z++) {
          if (outside(0, x) + outside(1, y) + outside(2, z) <= reach * reach) call(x, y, z);
        }
      }
    }
  }

  // Build all arrays for decals of these numbers.
  build(numbers) {
    const ordered = Array.from(numbers).sort((a, b) => this.before(a, b));
    const exponents = new Set(ordered.map((number) => this.exponent(number)));
    this.levels.fill(0);
    this.levelOf = new Map([...exponents].sort((a, b) => a - b).map((e, level) => [e, level]));
    this.table = new Int32Array(4 * FIRST_SIZE).fill(EMPTY);
    this.rooms = new Int32Array(FIRST_SIZE);
    this.ids = new Int32Array(FIRST_SIZE);
    this.used = this.end = 0;
    this.changes = null; // all of it
    for (const number of ordered) this.insert(number);
  }

  get levelCount() {
    return this.levelOf.size;
  }

  get mask() {
    return this.table.length / 4 - 1;
  }

  // Include a rank in the level of an exponent, which is added if it is missing.
  widen(exponent, rank) {
    let level = this.levelOf.get(exponent);
    if (level === undefined) this.levelOf.set(exponent, (level = this.levelOf.size));
    const row = this.levels.subarray(4 * level, 4 * level + 4);
    const known = row[1] > 0;
    row.set([
      2 ** -exponent,
      2 ** exponent,
      known ? Math.min(row[2], rank) : rank,
      known ? Math.max(row[3], rank) : rank,
    ]);
    return level;
  }

  hash(x, y, z) {
    const [mixX, mixY, mixZ, mixAll] = this.rules.mix;
    let h = Math.imul(x, mixX) ^ Math.imul(y, mixY) ^ Math.imul(z, mixZ);
    h = Math.imul(h ^ (h >>> 15), mixAll);
    return (h ^ (h >>> 13)) >>> 0;
  }

  // The slot of a key, or the free one where it belongs.
  find(x, y, z) {
    const { table, mask } = this;
    let slot = (this.hash(x, y, z) & mask) >>> 0;
    while (
      table[4 * slot] >= 0 &&
      (table[4 * slot] !== x || table[4 * slot + 1] !== y || table[4 * slot + 2] !== z)
    ) {
      slot = (slot + 1) & mask;
    }
    return slot;
  }

  // The slot of a cell, which gets its key.
  claim(level, x, y, z) {
    const { halfRange, levelShift } = this.rules;
    const key = [x + halfRange + level * 2 ** levelShift, y + halfRange, z + halfRange];
    const slot = this.find(...key);
    if (this.table[4 * slot] < 0) {
      this.table.set([...key, EMPTY], 4 * slot);
      this.used += 1;
    }
    return slot;
  }

  // Give a slot a list of some room at the end of all lists.
  place(slot, room) {
    if (this.end + 1 + room > this.ids.length) {
      const grown = new Int32Array(2 * (this.end + 1 + room));
      grown.set(this.ids);
      this.ids = grown;
      this.changes = null;
    }
    this.table[4 * slot + 3] = this.end;
    this.rooms[slot] = room;
    this.end += 1 + room;
  }

  note(name, first, count) {
    this.changes?.push([name, first, count]);
  }

  // Insert a decal, whose record is there, into the lists of its cells.
  insert(number) {
    const exponent = this.exponent(number);
    const level = this.widen(exponent, this.rank(number));
    this.note("levels", level, 1);
    this.eachCell(number, exponent, (x, y, z) => this.insertInto(this.claim(level, x, y, z), number));
    if (4 * this.used > 3 * this.mask) this.rehash();
  }

  insertInto(slot, number) {
    let head = this.table[4 * slot + 3];
    const length = head < 0 ? 0 : this.ids[head];
    if (head < 0 || length >= this.rooms[slot]) {
      const kept = head < 0 ? [] : this.ids.slice(head + 1, head + 1 + length);
      this.place(slot, Math.max(MIN_ROOM, 2 * length));
      head = this.table[4 * slot + 3];
      this.ids.set(kept, head + 1);
      this.note("table", slot, 1);
    }
    let at = head + 1 + length;
    while (at > head + 1 && this.before(number, this.ids[at - 1]) < 0) {
      this.ids[at] = this.ids[at - 1];
      at -= 1;
    }
    this.ids[at] = number;
    this.ids[head] = length + 1;
    this.note("ids", head, length + 2);
  }

  // Remove a decal, whose record is still unchanged, from the lists of its cells.
  remove(number) {
    const exponent = this.exponent(number);
    const level = this.levelOf.get(exponent);
    this.eachCell(number, exponent, (x, y, z) => {
      const head = this.table[4 * this.claim(level, x, y, z) + 3];
      const length = this.ids[head];
      const at = this.ids.indexOf(number, head + 1);
      this.ids.copyWithin(at, at + 1, head + 1 + length);
      this.ids[head] = length - 1;
      this.note("ids", head, length + 1);
    });
  }

  // Move all cells to a table of twice the size.
  rehash() {
    const { table, rooms } = this;
    this.table = new Int32Array(2 * table.length).fill(EMPTY);
    this.rooms = new Int32Array(2 * rooms.length);
    for (let slot = 0; slot < rooms.length; slot++) {
      if (table[4 * slot] < 0) continue;
      const row = table.subarray(4 * slot, 4 * slot + 4);
      const to = this.find(row[0], row[1], row[2]);
      this.table.set(row, 4 * to);
      this.rooms[to] = rooms[slot];
    }
    this.changes = null;
  }

  // Return what changed since the last call, as [array, first row, rows]; null for all of it.
  takeChanges() {
    const { changes } = this;
    this.changes = [];
    return changes;
  }
}
