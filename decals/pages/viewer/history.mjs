// Edits that can be undone: the rows of all decals after each, which no edit changes.

export class History {
  constructor(decals, onChange) {
    Object.assign(this, { decals, onChange, states: [decals.rows.slice()], at: 0 });
  }

  // Change decals at once; `open` continues the last step, as a drag does.
  change(pairs, { open = false } = {}) {
    const rows = this.decals.rows.slice();
    for (const [number, row] of pairs) rows[number] = row;
    this.states.splice(this.at + (open ? 0 : 1), Infinity, rows);
    this.go(open ? 0 : 1);
  }

  // Undo steps, below 0, or do them again, as far as there are any.
  go(steps) {
    const { decals, states } = this;
    const rows = states[this.at + steps];
    if (!rows) return;
    this.at += steps;
    for (let number = 0; number < Math.max(rows.length, decals.rows.length); number++)
      if (rows[number] !== decals.rows[number]) decals.set(number, rows[number] ?? null);
    this.onChange();
  }
}
