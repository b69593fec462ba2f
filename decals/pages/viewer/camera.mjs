// A perspective camera that turns about its target.
import { add, cross, dot, length, scaled, subtract, tangential, turned, unit } from "./vectors.mjs";

const NEAREST = 1e-4; // least distance of the near plane over that of the far one
const STEEPEST = 0.98; // cosine between view and up, at most
const CLOSEST = 1e-3; // least distance from the target, in sizes of the model

export class Camera {
  constructor({ position, target, up, fov }, bounds, referenceAspect) {
    Object.assign(this, { position, target, up: unit(up), fov, bounds, referenceAspect });
    this.size = length(subtract(bounds[1], bounds[0])) || 1;
  }

  // The same camera at a later time, or as a link has it.
  place({ position, target }) {
    Object.assign(this, { position, target });
  }

  get pose() {
    return { position: this.position, target: this.target };
  }

  // Unit vectors to the right, up, and along the view.
  get axes() {
    const ahead = unit(subtract(this.target, this.position));
    const right = unit(cross(ahead, this.up));
    return [right, cross(right, ahead), ahead];
  }

  // Tangent of half the vertical angle of view; narrow pictures show as much from left to right as wide ones.
  half(aspect) {
    const half = Math.tan((this.fov * Math.PI) / 360);
    return half * Math.max(1, this.referenceAspect / aspect);
  }

  // From the middle of the picture to its right and its upper edge at distance 1, and along the view.
  frame(aspect) {
    const [right, up, ahead] = this.axes;
    return [scaled(right, this.half(aspect) * aspect), scaled(up, this.half(aspect)), ahead];
  }

  // Distances of the near and the far plane, which enclose the model.
  range(ahead) {
    const [low, high] = this.bounds;
    const middle = dot(ahead, subtract(scaled(add(low, high), 0.5), this.position));
    const reach = 0.5 * dot(ahead.map(Math.abs), subtract(high, low));
    const far = middle + reach > 0 ? 1.01 * (middle + reach) : this.size;
    return [Math.max(0.99 * (middle - reach), far * NEAREST), far];
  }

  // The uniform block of camera.glsl for a picture of some pixels that is shifted by parts of one.
  block(width, height, [x, y] = [0, 0]) {
    const [right, up, ahead] = this.frame(width / height);
    const [near, far] = this.range(ahead);
    const rows = [scaled(right, 1 / dot(right, right)), scaled(up, 1 / dot(up, up)), ahead].map((axis) => [
      ...axis,
      -dot(axis, this.position),
    ]);
    const columns = [0, 1, 2, 3].flatMap((i) => {
      const [across, upward, depth] = rows.map((row) => row[i]);
      const z = ((far + near) * depth - (i === 3 ? 2 * far * near : 0)) / (far - near);
      return [across - (2 * x * depth) / width, upward - (2 * y * depth) / height, z, depth];
    });
    const [column, row] = [scaled(right, 2 / width), scaled(up, 2 / height)];
    const edge = subtract(subtract(ahead, right), up);
    const corner = add(edge, add(scaled(column, x), scaled(row, y)));
    return new Float32Array([...columns, ...this.position, 1, ...corner, 0, ...column, 0, ...row, 0]);
  }

  // The direction from the eye through a place of the picture, from −1 to 1 to the right and upward.
  direction(x, y, aspect) {
    const [right, up, ahead] = this.frame(aspect);
    return unit(add(ahead, add(scaled(right, x), scaled(up, y))));
  }

  // Where a point is seen, from −1 to 1; null behind the eye.
  seen(point, aspect) {
    const [right, up, ahead] = this.frame(aspect);
    const from = subtract(point, this.position);
    const depth = dot(from, ahead);
    return depth <= 0 ? null : [right, up].map((edge) => dot(from, edge) / (dot(edge, edge) * depth));
  }

  // Turn about the target, by angles to the right and upward.
  orbit(right, up) {
    const offset = turned(subtract(this.position, this.target), this.up, -right);
    const raised = turned(offset, unit(cross(this.up, offset)), -up);
    const isSteep = Math.abs(dot(unit(raised), this.up)) > STEEPEST;
    this.position = add(this.target, isSteep ? offset : raised);
  }

  // Move the picture by parts of its height.
  pan(x, y) {
    const [right, up] = this.axes;
    const step = 2 * this.half(this.referenceAspect) * length(subtract(this.position, this.target));
    const move = add(scaled(right, -x * step), scaled(up, -y * step));
    this.place({ position: add(this.position, move), target: add(this.target, move) });
  }

  zoom(factor) {
    const offset = subtract(this.position, this.target);
    const distance = Math.min(Math.max(length(offset) * factor, CLOSEST * this.size), 100 * this.size);
    this.position = add(this.target, scaled(unit(offset), distance));
  }

  // The direction that is upward in the picture, along a surface.
  upAlong(normal) {
    const [right, up] = this.axes;
    return tangential(Math.abs(dot(up, normal)) < STEEPEST ? up : right, normal);
  }
}
