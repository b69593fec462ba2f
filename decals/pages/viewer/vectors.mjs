// Vectors of three numbers, as plain arrays.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scaled(a, 1 / (length(a) || 1));

export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

// A vector turned about a unit axis, counter-clockwise (Rodrigues).
export function turned(v, axis, angle) {
  const c = Math.cos(angle);
  const along = scaled(axis, dot(axis, v) * (1 - c));
  return add(add(scaled(v, c), scaled(cross(axis, v), Math.sin(angle))), along);
}

// A vector carried along by the smallest turn from one unit normal to another.
export function carried(v, from, to) {
  const axis = cross(from, to);
  const sine = length(axis);
  if (sine < 1e-9) {
    return dot(from, to) > 0 ? v : subtract(v, scaled(to, 2 * dot(v, to)));
  }
  return turned(v, scaled(axis, 1 / sine), Math.atan2(sine, dot(from, to)));
}

// The part of a vector across a unit normal, at length 1.
export function tangential(v, normal) {
  return unit(subtract(v, scaled(normal, dot(v, normal))));
}
