// The index of decals, as decals/index/index.py describes it: a hash grid of several levels in three arrays.
// Lists have room at their ends, so that one decal moves without the others.
import { Texels } from "./texels.mjs";

const RECORD = 16; // numbers of a record
const MIN_ROOM = 4;
const EMPTY = -1;

// The smallest e with x < 2^e, for x above 0.
export function exponentAbove(x) {
  const e = Math.floor(Math.log2(x)) + 1; // beside a power of two, rounding makes it one too large or too small
  return e + (2 ** e <= x) - (2 ** (e - 1) > x);
}

export class DecalIndex {
  // `rules` holds constants of the index, and its parity and floor; `numbers` are those of the decals in `records`.
  constructor(rules, records, numbers) {
    const [levels, ids] = [new Texels(Float32Array, 4, 1), new Texels(Int32Array, 1, 1)];
    Object.assign(this, { rules, records, levels, ids, end: 0 });
    this.seatAll([], 1);
    this.levelOf = new Map(rules.exponents.map((exponent, level) => [exponent, level]));
    for (const number of numbers) this.insert(number);
  }

  rank(number) {
    return Math.floor(this.records.array[RECORD * number + 7]);
  }

  // The ball that a decal reaches, and the exponent of its cells, as `cell_exponent` of decals/index/decal_cells.py.
  ball(number) {
    const { parity, floor, finest } = this.rules;
    const [x, y, z, influence] = this.records.at(4 * number);
    const reach = influence * this.rules.reach;
    const own = exponentAbove(reach);
    const shared = parity === null || (own & 1) === parity ? own : own - 1;
    const farthest = Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) + reach;
    const exponent = Math.max(shared, exponentAbove(farthest) - finest, floor ?? -Infinity);
    return { centre: [x, y, z], influence, reach, exponent };
  }

  // The cells that the ball of a decal touches.
  *cellsOf(number) {
    const { centre, reach, exponent } = this.ball(number);
    const { halfRange, levelShift } = this.rules;
    const width = 2 ** exponent;
    const first = halfRange + this.levelOf.get(exponent) * 2 ** levelShift;
    const [low, high] = [-reach, reach].map((far) => centre.map((c) => Math.floor((c + far) / width)));
    const away = (cell, c) => Math.max(cell * width - c, c - (cell + 1) * width, 0) ** 2;
    for (let x = low[0]; x <= high[0]; x++)
      for (let y = low[1]; y <= high[1]; y++)
        for (let z = low[2]; z <= high[2]; z++)
          if (away(x, centre[0]) + away(y, centre[1]) + away(z, centre[2]) <= reach * reach)
            yield this.cell([x + first, y + halfRange, z + halfRange]);
  }

  // The cell of a key in the table: the numbers in it, and where their list lies.
  cell(key) {
    return this.cells.get(this.slotOf(key)) ?? this.seat({ key, numbers: [], head: EMPTY, room: 0 });
  }

  // The slot of a key, or the free one where it belongs.
  slotOf([x, y, z]) {
    const [{ mask }, { array }] = [this, this.table];
    const [mixX, mixY, mixZ, mixAll] = this.rules.mix;
    let hash = Math.imul(x, mixX) ^ Math.imul(y, mixY) ^ Math.imul(z, mixZ);
    hash = Math.imul(hash ^ (hash >>> 15), mixAll);
    let slot = (hash ^ (hash >>> 13)) & mask;
    const isOther = (at) => array[at] !== x || array[at + 1] !== y || array[at + 2] !== z;
    while (array[4 * slot] >= 0 && isOther(4 * slot)) slot = (slot + 1) & mask;
    return slot;
  }

  // Write a cell into the table.
  seat(cell) {
    const slot = this.slotOf(cell.key);
    this.cells.set(slot, cell);
    this.table.set(slot, [...cell.key, cell.head]);
    return cell;
  }

  // Make a table of some slots at least, with some cells.
  seatAll(cells, slots) {
    Object.assign(this, { table: new Texels(Int32Array, 4, slots, EMPTY), cells: new Map() });
    this.mask = this.table.array.length / 4 - 1;
    cells.forEach((cell) => this.seat(cell));
  }

  // Write the list of a cell, to another place if it has outgrown its own.
  store(cell) {
    const { length } = cell.numbers;
    if (length > cell.room) {
      Object.assign(cell, { room: Math.max(MIN_ROOM, 2 * length), head: this.end });
      this.end += 1 + cell.room;
      this.seat(cell);
    }
    this.ids.set(cell.head, [length, ...cell.numbers]);
  }

  // Insert a decal, whose record is there, into the lists of its cells, which are sorted by ranks and numbers.
  insert(number) {
    const [rank, { exponent }] = [this.rank(number), this.ball(number)];
    if (!this.levelOf.has(exponent)) this.levelOf.set(exponent, this.levelOf.size);
    const level = this.levelOf.get(exponent);
    const [, width, lowest, highest] = this.levels.at(level);
    const ranks = [rank, ...(width > 0 ? [lowest, highest] : [])];
    this.levels.set(level, [2 ** -exponent, 2 ** exponent, Math.min(...ranks), Math.max(...ranks)]);
    for (const cell of this.cellsOf(number)) {
      const before = cell.numbers.findLastIndex((other) => (this.rank(other) - rank || other - number) < 0);
      cell.numbers.splice(before + 1, 0, number);
      this.store(cell);
    }
    if (4 * this.cells.size > 3 * this.mask) this.seatAll(this.cells, 2 * (this.mask + 1));
  }

  // Remove a decal, whose record is still unchanged, from the lists of its cells.
  remove(number) {
    for (const cell of this.cellsOf(number)) {
      cell.numbers.splice(cell.numbers.indexOf(number), 1);
      this.store(cell);
    }
  }
}
