// The free length of a ray, up to the ground, a wall or a mesh.

import { cross, dot, minus } from "./geometry.js";

const NOTHING = [];
const GRAZE = 0.1; // m by which a ray may pass below a cell of the ground

// The height (m) in the height map at a point; 0 off the map.
export function groundAt(terrain, x, y, heights = terrain.heights) {
  const i = Math.floor(x / terrain.cell), j = Math.floor(y / terrain.cell);
  const inside = i >= 0 && j >= 0 && i < terrain.cells[0] && j < terrain.cells[1];
  return inside ? heights[i * terrain.cells[1] + j] : 0;
}

export class Rays {
  constructor({ terrain, meshes, boxes }, blocks = null) {
    Object.assign(this, { terrain, blocks, met: new Uint8Array(blocks?.count ?? 0) });
    this.triangles = new Map(); // triangles by the number of a cell
    this.boxes = new Map();
    meshes.forEach((mesh, k) => this.takeMesh(mesh, blocks?.ofTriangle[k]));
    boxes.forEach(([i, j, low, high], k) => this.keep(this.boxes, i, j, { low, high, block: blocks?.ofBox[k] }));
  }

  keep(kind, i, j, what) {
    const key = i * this.terrain.cells[1] + j;
    if (!kind.has(key)) kind.set(key, []);
    kind.get(key).push(what);
  }

  takeMesh({ vertices, triangles }, blocks = []) {
    const at = (k) => vertices.slice(3 * k, 3 * k + 3), { cell, cells } = this.terrain;
    for (let t = 0; t < triangles.length; t += 3) {
      const corners = triangles.slice(t, t + 3).map(at);
      const [[i0, i1], [j0, j1]] = [0, 1].map((axis) => {
        const along = corners.map((p) => Math.floor(p[axis] / cell));
        return [Math.max(Math.min(...along), 0), Math.min(Math.max(...along), cells[axis] - 1)];
      });
      for (let i = i0; i <= i1; i++) for (let j = j0; j <= j1; j++) {
        this.keep(this.triangles, i, j, { corners, block: blocks[t / 3] });
      }
    }
  }

  // Length (m) of a ray from a point along a unit vector until it meets something, at most `most`.
  length(from, way, most) {
    let met = most;
    this.walk(from, way, most, (cell, begin, end) => {
      const here = this.meets(cell, from, way, begin, end);
      if (here < end) met = here;
      return here < end;
    });
    return met;
  }

  // Visit the cells that a ray passes (-1: off the map), with the lengths at which it enters and
  // leaves them, until `visit` returns true.
  walk(from, way, most, visit) {
    const { terrain: { cell, cells } } = this;
    const at = [0, 1].map((k) => Math.floor(from[k] / cell)), step = way.map(Math.sign);
    const next = [0, 1].map((k) => (way[k] ? ((at[k] + (step[k] > 0)) * cell - from[k]) / way[k] : Infinity));
    for (let begin = 0; begin < most; ) {
      const axis = next[0] < next[1] ? 0 : 1, end = Math.min(next[axis], most);
      const inside = at[0] >= 0 && at[1] >= 0 && at[0] < cells[0] && at[1] < cells[1];
      if (visit(inside ? at[0] * cells[1] + at[1] : -1, begin, end)) return;
      at[axis] += step[axis];
      next[axis] += cell / Math.abs(way[axis]);
      begin = end;
    }
  }

  // Mark, in an array, the blocks that a ray meets within so many metres.
  mark(from, way, most, marked) {
    const { terrain: { heights, grounds }, blocks: { ofCell } } = this, height = (far) => from[2] + far * way[2];
    this.walk(from, way, most, (cell, begin, end) => {
      if (cell < 0) return false;
      const a = height(begin), b = height(end), low = Math.min(a, b), high = Math.max(a, b);
      if (ofCell[cell] >= 0 && low < heights[cell] && high > grounds[cell]) marked[ofCell[cell]] = 1;
      for (const box of this.boxes.get(cell) ?? NOTHING) if (low < box.high && high > box.low) marked[box.block] = 1;
      for (const { corners, block } of this.triangles.get(cell) ?? NOTHING) {
        if (!marked[block] && crossing(from, way, corners) < most) marked[block] = 1;
      }
      return false;
    });
  }

  // True if the ground, or a block that is not opened, blocks a ray within so many metres.
  isBlocked(from, way, most, opened) {
    const { terrain: { grounds } } = this, met = this.met.fill(0), height = (far) => from[2] + far * way[2];
    let isGround = false;
    this.walk(from, way, most, (cell, begin, end) => {
      isGround = cell >= 0 && Math.min(height(begin), height(end)) < grounds[cell] - GRAZE;
      return isGround;
    });
    if (isGround) return true;
    this.mark(from, way, most, met);
    return met.some((isMet, block) => isMet && !opened[block]);
  }

  // The length at which a ray meets something in a cell (-1: off the map), between two lengths, or
  // Infinity.
  meets(cell, from, way, begin, end) {
    const top = cell < 0 ? 0 : this.terrain.heights[cell], height = (far) => from[2] + far * way[2];
    let met = Infinity;
    if (height(begin) < top - 1e-6) met = begin;
    else if (height(end) < top) met = (top - from[2]) / way[2];
    for (const { low, high } of this.boxes.get(cell) ?? []) {
      const far = height(begin) > high ? (high - from[2]) / way[2] : height(begin) < low ? (low - from[2]) / way[2] : begin;
      if (far >= begin && far <= end) met = Math.min(met, far);
    }
    for (const { corners } of this.triangles.get(cell) ?? []) met = Math.min(met, crossing(from, way, corners));
    return met;
  }
}

// Length of a ray until it meets a triangle, or Infinity.
function crossing(from, way, [a, b, c]) {
  const u = minus(b, a), v = minus(c, a), p = cross(way, v), scale = dot(u, p);
  if (Math.abs(scale) < 1e-12) return Infinity;
  const s = minus(from, a), along = dot(s, p) / scale, q = cross(s, u), across = dot(way, q) / scale;
  const far = dot(v, q) / scale;
  return along >= 0 && across >= 0 && along + across <= 1 && far > 0 ? far : Infinity;
}
