// Vectors of three numbers, as plain arrays.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scaled(a, 1 / length(a)); // no numbers for a vector of length 0
export const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

// A vector turned about a unit axis, counter-clockwise (Rodrigues).
export function turned(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(scaled(v, c), scaled(cross(axis, v), s)), scaled(axis, dot(axis, v) * (1 - c)));
}

// A vector carried along by the smallest turn from one unit normal to another: two reflections.
export function carried(v, from, to) {
  const [sum, share] = [add(from, to), 1 + dot(from, to)];
  if (share < 1e-9) return subtract(v, scaled(to, 2 * dot(v, to))); // opposite normals
  return add(subtract(v, scaled(sum, dot(sum, v) / share)), scaled(to, 2 * dot(from, v)));
}

// The part of a vector across a unit normal, at length 1.
export const tangential = (v, normal) => unit(subtract(v, scaled(normal, dot(v, normal))));
