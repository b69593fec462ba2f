// A perspective camera that turns about its target. Matrices are columns first, as WebGL takes them.
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

  // Unit vectors to the right, up, and toward the eye.
  get axes() {
    const back = unit(subtract(this.position, this.target));
    const right = unit(cross(this.up, back));
    return [right, cross(back, right), back];
  }

  // Tangent of half the vertical angle of view; narrow pictures show as much from left to right as wide ones.
  half(aspect) {
    const half = Math.tan((this.fov * Math.PI) / 360);
    return aspect >= this.referenceAspect ? half : (half * this.referenceAspect) / aspect;
  }

  matrix(aspect) {
    const [right, up, back] = this.axes;
    const [near, far] = this.range();
    const focal = 1 / this.half(aspect);
    const view = [right, up, back].map((axis) => [...axis, -dot(axis, this.position)]);
    const depth = [(far + near) / (near - far), (2 * far * near) / (near - far)];
    const columns = [];
    for (let i = 0; i < 4; i++) {
      const z = view[2][i];
      columns.push((view[0][i] * focal) / aspect, view[1][i] * focal);
      columns.push(z * depth[0] + (i === 3 ? depth[1] : 0), -z);
    }
    return columns;
  }

  // Distances of the near and the far plane, which enclose the model.
  range() {
    const back = this.axes[2];
    const depths = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => {
      const corner = [0, 1, 2].map((axis) => this.bounds[(k >> axis) & 1][axis]);
      return dot(subtract(this.position, corner), back);
    });
    const far = Math.max(...depths) * 1.01;
    if (!(far > 0)) return [NEAREST * this.size, this.size];
    return [Math.max(Math.min(...depths) * 0.99, far * NEAREST), far];
  }

  // The four vectors of the uniform block of camera.glsl behind its matrix, for a picture of some pixels.
  rays(width, height) {
    const [right, up, back] = this.axes;
    const pixel = (2 * this.half(width / height)) / height;
    const corner = subtract(scaled(right, (-pixel * width) / 2), add(back, scaled(up, (pixel * height) / 2)));
    return [this.position, corner, scaled(right, pixel), scaled(up, pixel)];
  }

  // The direction from the eye through a place of the picture, from −1 to 1 to the right and upward.
  direction(x, y, aspect) {
    const [right, up, back] = this.axes;
    const half = this.half(aspect);
    return unit(subtract(add(scaled(right, x * half * aspect), scaled(up, y * half)), back));
  }

  // Where a point is seen, from −1 to 1; null behind the eye.
  seen(point, aspect) {
    const [right, up, back] = this.axes;
    const from = subtract(point, this.position);
    const depth = -dot(from, back);
    const half = this.half(aspect);
    return depth <= 0 ? null : [dot(from, right) / (depth * half * aspect), dot(from, up) / (depth * half)];
  }

  // Turn about the target, by angles to the right and upward.
  orbit(right, up) {
    const offset = turned(subtract(this.position, this.target), this.up, -right);
    const axis = unit(cross(this.up, offset));
    const raised = turned(offset, axis, -up);
    const steep = Math.abs(dot(unit(raised), this.up)) > STEEPEST;
    this.position = add(this.target, steep ? offset : raised);
  }

  // Move the picture by parts of its height.
  pan(x, y) {
    const [right, up] = this.axes;
    const step = 2 * this.half(this.referenceAspect) * length(subtract(this.position, this.target));
    const move = add(scaled(right, -x * step), scaled(up, -y * step));
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
    const [right, up] = this.axes;
    const along = Math.abs(dot(up, normal)) < STEEPEST ? up : right;
    return tangential(along, normal);
  }
}
