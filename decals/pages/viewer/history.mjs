// Edits that can be undone: the rows of all decals before each, which no edit changes.

export class History {
  constructor(decals, onChange) {
    Object.assign(this, { decals, onChange, done: [], undone: [] });
  }

  // Change decals at once; `open` continues the last step, as a drag does.
  change(pairs, { open = false } = {}) {
    if (!open) this.done.push(this.decals.rows.slice());
    this.undone = [];
    for (const [number, row] of pairs) this.decals.set(number, row);
    this.onChange();
  }

  undo() {
    this.move(this.done, this.undone);
  }

  redo() {
    this.move(this.undone, this.done);
  }

  move(from, to) {
    if (!from.length) return;
    const [rows, before] = [from.pop(), this.decals.rows.slice()];
    to.push(before);
    for (let number = 0; number < Math.max(rows.length, before.length); number++) {
      if (rows[number] !== before[number]) this.decals.set(number, rows[number] ?? null);
    }
    this.onChange();
  }
}
