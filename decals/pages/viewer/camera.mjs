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

  get pose() {
    return { position: this.position, target: this.target };
  }

  // Move to a pose, unless the eye is at the target, straight above or below it, or too far away.
  place({ position, target }) {
    const across = length(cross(subtract(target, position), this.up));
    if (across > 0 && across < this.size / CLOSEST) Object.assign(this, { position, target });
  }

  // From the middle of the picture to its right and its upper edge at distance 1, and along the view: narrow pictures
  // show as much from left to right as wide ones.
  frame(aspect) {
    const ahead = unit(subtract(this.target, this.position));
    const right = unit(cross(ahead, this.up));
    const half = Math.tan((this.fov * Math.PI) / 360) * Math.max(1, this.referenceAspect / aspect);
    return [scaled(right, half * aspect), scaled(cross(right, ahead), half), ahead];
  }

  // A vector in that frame.
  within(vector, aspect) {
    return this.frame(aspect).map((axis) => dot(vector, axis) / dot(axis, axis));
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
    const [shiftX, shiftY] = [(2 * x) / width, (2 * y) / height];
    const clip = (vector, w) => {
      const [across, upward, depth] = this.within(vector, width / height);
      const z = ((far + near) * depth - 2 * w * far * near) / (far - near);
      return [across - shiftX * depth, upward - shiftY * depth, z, depth];
    };
    const axes = [clip([1, 0, 0], 0), clip([0, 1, 0], 0), clip([0, 0, 1], 0)].flat();
    const columns = [...axes, ...clip(scaled(this.position, -1), 1)];
    const corner = subtract(ahead, add(scaled(right, 1 - shiftX), scaled(up, 1 - shiftY)));
    const steps = [...scaled(right, 2 / width), 0, ...scaled(up, 2 / height), 0];
    return new Float32Array([...columns, ...this.position, 1, ...corner, 0, ...steps]);
  }

  // Where a point is seen, from −1 to 1 to the right and upward; null behind the eye.
  seen(point, aspect) {
    const [x, y, depth] = this.within(subtract(point, this.position), aspect);
    return depth <= 0 ? null : [x / depth, y / depth];
  }

  // Turn about the target, by angles to the right and upward.
  orbit(right, up) {
    const offset = turned(subtract(this.position, this.target), this.up, -right);
    const raised = turned(offset, unit(cross(this.up, offset)), -up);
    const isSteep = Math.abs(dot(unit(raised), this.up)) > STEEPEST;
    this.position = add(this.target, isSteep ? offset : raised);
  }

  // Move the picture by parts of half its sides.
  pan(x, y, aspect) {
    const [right, up] = this.frame(aspect);
    const move = scaled(add(scaled(right, x), scaled(up, y)), -length(subtract(this.position, this.target)));
    this.position = add(this.position, move);
    this.target = add(this.target, move);
  }

  zoom(factor) {
    const offset = subtract(this.position, this.target);
    const distance = Math.min(Math.max(length(offset) * factor, CLOSEST * this.size), 100 * this.size);
    this.position = add(this.target, scaled(unit(offset), distance));
  }

  // The direction that is upward in the picture, along a surface.
  upAlong(normal) {
    const [right, up] = this.frame(1).map(unit);
    return tangential(Math.abs(dot(up, normal)) < STEEPEST ? up : right, normal);
  }
}
