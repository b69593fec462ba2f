// Edits that can be undone: the rows of all decals after each, which no edit changes.

export class History {
  constructor(decals, onChange) {
    Object.assign(this, { decals, onChange, states: [decals.rows.slice()], at: 0 });
  }

  // Change decals at once, and return the step; one that is given goes on, as in a drag, unless another came between.
  change(pairs, last) {
    const rows = Object.assign(this.decals.rows.slice(), Object.fromEntries(pairs));
    const steps = last && last === this.states[this.at] ? 0 : 1;
    this.states.splice(this.at + steps, Infinity, rows);
    this.go(steps);
    return rows;
  }

  // Undo steps, below 0, or do them again, as far as there are any.
  go(steps) {
    const [{ decals }, rows] = [this, this.states[this.at + steps]];
    if (!rows) return;
    this.at += steps;
    for (let number = 0; number < Math.max(rows.length, decals.rows.length); number++)
      if (rows[number] !== decals.rows[number]) decals.set(number, rows[number] ?? null);
    this.onChange();
  }
}
