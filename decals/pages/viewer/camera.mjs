// A perspective camera that turns about its target.
import { add, cross, dot, length, scaled, subtract, tangential, turned, unit } from "./vectors.mjs";

const NEAREST = 1e-4; // least distance of the near plane over that of the far one
const STEEPEST = 0.98; // cosine between view and up, at most
const CLOSEST = 1e-3; // least distance from the target, in sizes of the model

export class Camera {
  // A pose has the eye, the target, and the aspect ratio below which pictures keep their width in place of their height.
  constructor({ position, target, aspect = 0, up, fov, fit }, bounds, usualAspect) {
    const pose = { position, target, aspect };
    Object.assign(this, { pose, start: pose, home: pose, up: unit(up), fov, fit, bounds, usualAspect });
    this.size = length(subtract(bounds[1], bounds[0])) || 1;
  }

  // Move to a pose, unless the eye is at the target, straight above or below it, or too far away.
  place({ position = this.pose.position, target = this.pose.target, aspect }) {
    const across = length(cross(subtract(target, position), this.up));
    const kept = aspect >= 0 && aspect < 1 / CLOSEST ? aspect : this.usualAspect;
    if (across > 0 && across < this.size / CLOSEST) this.pose = { position, target, aspect: kept };
  }

  // Find the home of pictures of an aspect ratio, as `Camera.at` of decals/scenes/camera.py does, and stay there.
  fitTo(aspect) {
    const isHome = this.pose.position === this.home.position;
    const { kept, points, slope, nearest, middle, right, back } = this.fit;
    const reach = (side) => Math.max(...points.map(([x, z]) => side * x + slope * aspect * z));
    const target = add(middle, scaled(right, (reach(1) - reach(-1)) / 2));
    const distance = Math.max(nearest, (reach(1) + reach(-1)) / (2 * slope * aspect));
    const fitted = { position: add(target, scaled(back, distance)), target, aspect: 0 };
    this.home = kept[0] <= aspect && aspect <= kept[1] ? this.start : fitted;
    if (isHome) this.pose = this.home;
  }

  // From the middle of the picture to its right and its upper edge at distance 1, and along the view.
  frame(aspect) {
    const ahead = unit(subtract(this.pose.target, this.pose.position));
    const right = unit(cross(ahead, this.up));
    const half = Math.tan((this.fov * Math.PI) / 360) * Math.max(1, this.pose.aspect / aspect);
    return [scaled(right, half * aspect), scaled(cross(right, ahead), half), ahead];
  }

  // A vector in that frame.
  within(vector, aspect) {
    return this.frame(aspect).map((axis) => dot(vector, axis) / dot(axis, axis));
  }

  // Distances of the near and the far plane, which enclose the model.
  range(ahead) {
    const [low, high] = this.bounds;
    const middle = dot(ahead, subtract(scaled(add(low, high), 0.5), this.pose.position));
    const reach = 0.5 * dot(ahead.map(Math.abs), subtract(high, low));
    const far = middle + reach > 0 ? 1.01 * (middle + reach) : this.size;
    return [Math.max(0.99 * (middle - reach), far * NEAREST), far];
  }

  // The uniform block of camera.glsl for a picture of some pixels that is shifted by parts of one.
  block(width, height, [x, y] = [0, 0]) {
    const [{ position }, [right, up, ahead]] = [this.pose, this.frame(width / height)];
    const [near, far] = this.range(ahead);
    const [shiftX, shiftY] = [(2 * x) / width, (2 * y) / height];
    const clip = (vector, w) => {
      const [across, upward, depth] = this.within(vector, width / height);
      const z = ((far + near) * depth - 2 * w * far * near) / (far - near);
      return [across - shiftX * depth, upward - shiftY * depth, z, depth];
    };
    const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1], scaled(position, -1)].flatMap((v, i) => clip(v, i > 2));
    const corner = subtract(ahead, add(scaled(right, 1 - shiftX), scaled(up, 1 - shiftY)));
    const steps = [...scaled(right, 2 / width), 0, ...scaled(up, 2 / height), 0];
    return new Float32Array([...columns, ...position, 1, ...corner, 0, ...steps]);
  }

  // Where a point is seen, from −1 to 1 to the right and upward; null behind the eye.
  seen(point, aspect) {
    const [x, y, depth] = this.within(subtract(point, this.pose.position), aspect);
    return depth <= 0 ? null : [x / depth, y / depth];
  }

  // A pose after a turn about its target, by angles to the right and upward.
  orbit({ position, target }, right, up) {
    const offset = turned(subtract(position, target), this.up, -right);
    const raised = turned(offset, unit(cross(this.up, offset)), -up);
    return { position: add(target, Math.abs(dot(unit(raised), this.up)) > STEEPEST ? offset : raised) };
  }

  // A pose whose picture is moved by parts of half its sides.
  pan({ position, target }, x, y, aspect) {
    const [right, up] = this.frame(aspect);
    const move = scaled(add(scaled(right, x), scaled(up, y)), -length(subtract(position, target)));
    return { position: add(position, move), target: add(target, move) };
  }

  zoom({ position, target }, factor) {
    const offset = subtract(position, target);
    const distance = Math.min(Math.max(length(offset) * factor, CLOSEST * this.size), 100 * this.size);
    return { position: add(target, scaled(unit(offset), distance)) };
  }

  // The direction that is upward in the picture, along a surface.
  upAlong(normal) {
    const [right, up] = this.frame(1).map(unit);
    return tangential(Math.abs(dot(up, normal)) < STEEPEST ? up : right, normal);
  }
}
