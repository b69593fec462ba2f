// Edits that can be undone. A step is a list of [number, row before, row after].

export class History {
  constructor(decals, onChange) {
    Object.assign(this, { decals, onChange, done: [], undone: [] });
  }

  // Change decals at once; `open` continues the last step, as a drag does.
  change(pairs, { open = false } = {}) {
    const before = new Map(open ? this.done.pop() : []);
    const rowBefore = (number) =>
      before.has(number) ? before.get(number) : (this.decals.rows[number] ?? null);
    this.undone = [pairs.map(([number, row]) => [number, rowBefore(number), row])];
    this.redo();
    this.undone = [];
  }

  undo() {
    this.move(this.done, this.undone, 1);
  }

  redo() {
    this.move(this.undone, this.done, 2);
  }

  move(from, to, place) {
    const steps = from.pop();
    if (!steps) return;
    for (const step of steps) this.decals.set(step[0], step[place]);
    to.push(steps);
    this.onChange();
  }
}
