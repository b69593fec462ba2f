// Arrays that shaders read as textures, in rows of 4,096 texels, of which only what changed is uploaded.

export const ROW = 4096;

export class Texels {
  // `width` is the number of numbers in a texel.
  constructor(kind, width, count, value = 0) {
    Object.assign(this, { width, array: new kind(0), changes: new Set() });
    this.reserve(Math.max(count, 1));
    this.array.fill(value);
  }

  // Make room for a number of texels.
  reserve(count) {
    const { array, width } = this;
    if (count * width <= array.length) return;
    const rows = Math.max(Math.ceil(count / ROW), (2 * array.length) / (ROW * width));
    this.array = new array.constructor(rows * ROW * width);
    this.array.set(array);
  }

  // Write numbers from a texel on.
  set(texel, values) {
    const end = texel + values.length / this.width;
    this.reserve(end);
    this.array.set(values, texel * this.width);
    for (let row = Math.floor(texel / ROW); row * ROW < end; row++) this.changes.add(row);
  }

  // The numbers of a texel.
  at(texel) {
    return this.array.subarray(this.width * texel, this.width * (texel + 1));
  }
}
