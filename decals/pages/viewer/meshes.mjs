// Triangles of the drawn objects, and the first one on a ray.
import { add, scaled, unit } from "./vectors.mjs";

const CHUNK = 64; // triangles of one box

export class Mesh {
  constructor({ mask }, vertices, faces, normals) {
    Object.assign(this, { mask, vertices, faces, normals, boxes: null });
  }

  // Boxes around runs of triangles, six numbers each: made at the first ray.
  chunkBoxes() {
    const { vertices, faces } = this;
    const boxes = new Float32Array(6 * Math.ceil(faces.length / (3 * CHUNK)));
    for (let i = 0; i < boxes.length; i++) boxes[i] = i % 6 < 3 ? Infinity : -Infinity;
    for (let corner = 0; corner < faces.length; corner++) {
      const box = 6 * Math.floor(corner / (3 * CHUNK));
      for (let axis = 0; axis < 3; axis++) {
        const x = vertices[3 * faces[corner] + axis];
        if (x < boxes[box + axis]) boxes[box + axis] = x;
        if (x > boxes[box + 3 + axis]) boxes[box + 3 + axis] = x;
      }
    }
    return boxes;
  }

  meetsBox(box, origin, direction, limit) {
    let near = 0;
    let far = limit;
    for (let axis = 0; axis < 3; axis++) {
      const inverse = 1 / direction[axis];
      const a = (this.boxes[box + axis] - origin[axis]) * inverse;
      const b = (this.boxes[box + 3 + axis] - origin[axis]) * inverse;
      near = Math.max(near, Math.min(a, b));
      far = Math.min(far, Math.max(a, b));
    }
    return near <= far * (1 + 1e-6) + 1e-30;
  }

  // The first triangle on a ray closer than `limit`, as {face, distance, u, v}; null if there is none.
  hit(origin, direction, limit) {
    this.boxes ??= this.chunkBoxes();
    let found = null;
    for (let chunk = 0; 6 * chunk < this.boxes.length; chunk++) {
      if (!this.meetsBox(6 * chunk, origin, direction, limit)) continue;
      const end = Math.min((chunk + 1) * CHUNK, this.faces.length / 3);
      for (let face = chunk * CHUNK; face < end; face++) {
        const met = this.hitFace(face, origin, direction);
        if (met && met.distance > 0 && met.distance < limit) {
          limit = met.distance;
          found = { face, ...met };
        }
      }
    }
    return found;
  }

  // Möller and Trumbore 1997.
  hitFace(face, [ox, oy, oz], [dx, dy, dz]) {
    const { vertices: p, faces } = this;
    const [a, b, c] = [3 * faces[3 * face], 3 * faces[3 * face + 1], 3 * faces[3 * face + 2]];
    const [ax, ay, az] = [p[a], p[a + 1], p[a + 2]];
    const [bx, by, bz] = [p[b] - ax, p[b + 1] - ay, p[b + 2] - az];
    const [cx, cy, cz] = [p[c] - ax, p[c + 1] - ay, p[c + 2] - az];
    const [hx, hy, hz] = [dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx];
    const determinant = bx * hx + by * hy + bz * hz;
    if (determinant === 0) return null;
    const [sx, sy, sz] = [ox - ax, oy - ay, oz - az];
    const u = (sx * hx + sy * hy + sz * hz) / determinant;
    if (!(u >= 0 && u <= 1)) return null;
    const [qx, qy, qz] = [sy * bz - sz * by, sz * bx - sx * bz, sx * by - sy * bx];
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (!(v >= 0 && u + v <= 1)) return null;
    return { distance: (cx * qx + cy * qy + cz * qz) / determinant, u, v };
  }

  normalAt({ face, u, v }) {
    const sum = [0, 0, 0];
    [1 - u - v, u, v].forEach((weight, corner) => {
      const first = 3 * this.faces[3 * face + corner];
      for (let axis = 0; axis < 3; axis++) sum[axis] += weight * this.normals[first + axis];
    });
    return unit(sum);
  }
}

// The first point of several meshes on a ray, with its smooth normal on the outside; null if there is none.
export function firstHit(meshes, origin, direction) {
  let best = null;
  for (const mesh of meshes) {
    const met = mesh.hit(origin, direction, best?.distance ?? Infinity);
    if (met) best = { ...met, mesh };
  }
  if (!best) return null;
  const position = add(origin, scaled(direction, best.distance));
  return { position, normal: best.mesh.normalAt(best) };
}
