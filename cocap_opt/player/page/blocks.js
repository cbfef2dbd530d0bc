// Blocks: whole buildings, walls and meshes. Blocks in front of the action are cut off near their
// feet, and only outlined above the cut.

import { triples } from "./geometry.js";
import { groundAt } from "./rays.js";

const ONE_ROOF = 1; // m, largest difference in height of neighbouring cells in one block
const CUT = 0.4; // m, height of the cut above the highest ground below a block
const HANGS = 1; // m; a cut block whose foot is higher above the ground disappears completely
const MOST_LOOKS = 200; // largest number of rays to the eye
const OVER = 0.1; // m above the ground, where rays from people's feet start

// Disjoint sets of the numbers 0..n-1, which can be joined.
class Sets {
  constructor(n) {
    this.over = Int32Array.from({ length: n }, (_, k) => k);
  }

  of(k) {
    while (this.over[k] !== k) k = this.over[k] = this.over[this.over[k]];
    return k;
  }

  join(a, b) {
    this.over[this.of(a)] = this.of(b);
  }
}

// Numbers of the blocks: for each cell (-1 if nothing stands there), for each triangle of each
// mesh, and for each box.
export class Blocks {
  constructor({ terrain, meshes, boxes }) {
    this.count = 0;
    this.ofCell = this.columns(terrain);
    this.ofTriangle = meshes.map((mesh) => this.parts(mesh));
    this.ofBox = this.stacks(boxes);
    this.cuts = this.altitudes(terrain, meshes, boxes);
  }

  // The altitude of each block's cut; -Infinity if the block hangs above the ground.
  altitudes(terrain, meshes, boxes) {
    const feet = new Float64Array(this.count).fill(Infinity), grounds = new Float64Array(this.count).fill(-Infinity);
    const take = (block, foot, ground) => {
      feet[block] = Math.min(feet[block], foot);
      grounds[block] = Math.max(grounds[block], ground);
    };
    this.ofCell.forEach((block, k) => block >= 0 && take(block, terrain.grounds[k], terrain.grounds[k]));
    meshes.forEach(({ vertices, triangles }, n) => triangles.forEach((k, at) => {
      const [x, y, z] = vertices.slice(3 * k, 3 * k + 3);
      take(this.ofTriangle[n][Math.floor(at / 3)], z, groundAt(terrain, x, y, terrain.grounds));
    }));
    boxes.forEach(([i, j, low], k) => take(this.ofBox[k], low, terrain.grounds[i * terrain.cells[1] + j]));
    return feet.map((foot, block) => (foot > grounds[block] + HANGS ? -Infinity : grounds[block] + CUT));
  }

  // Numbers the sets, starting after the numbers in use.
  numbered(sets, members) {
    const numbers = new Map();
    const number = (k) => {
      const root = sets.of(k);
      if (!numbers.has(root)) numbers.set(root, this.count++);
      return numbers.get(root);
    };
    return members.map((k) => (k < 0 ? -1 : number(k)));
  }

  columns({ cells: [X, Y], heights, grounds }) {
    const sets = new Sets(X * Y), stands = (k) => heights[k] > grounds[k];
    const meet = (a, b) => {
      if (stands(a) && stands(b) && Math.abs(heights[a] - heights[b]) <= ONE_ROOF) sets.join(a, b);
    };
    for (let i = 0; i < X; i++) {
      for (let j = 0; j < Y; j++) {
        const at = i * Y + j;
        if (i + 1 < X) meet(at, at + Y);
        if (j + 1 < Y) meet(at, at + 1);
      }
    }
    return Int32Array.from(this.numbered(sets, heights.map((_, k) => (stands(k) ? k : -1))));
  }

  // Connected triangles; corners at the same place count as one, even if a file repeats them.
  parts({ vertices, triangles }) {
    const first = new Map(), sets = new Sets(vertices.length / 3);
    triples(vertices).forEach((point, k) => {
      const key = point.join();
      if (first.has(key)) sets.join(k, first.get(key));
      else first.set(key, k);
    });
    for (let t = 0; t < triangles.length; t += 3) {
      sets.join(triangles[t], triangles[t + 1]);
      sets.join(triangles[t], triangles[t + 2]);
    }
    return this.numbered(sets, triangles.filter((_, k) => k % 3 === 0));
  }

  // Boxes of neighbouring cells that touch.
  stacks(boxes) {
    const sets = new Sets(boxes.length), inCell = new Map();
    boxes.forEach(([i, j], k) => inCell.set(`${i},${j}`, [...(inCell.get(`${i},${j}`) ?? []), k]));
    boxes.forEach(([i, j, low, high], k) => {
      for (const [di, dj] of [[0, 0], [1, 0], [0, 1]]) {
        for (const n of inCell.get(`${i + di},${j + dj}`) ?? []) {
          if (boxes[n][2] <= high && boxes[n][3] >= low) sets.join(k, n);
        }
      }
    });
    return this.numbered(sets, boxes.map((_, k) => k));
  }
}

// Points of the action, few enough to cast a ray from each: people from feet to head, and drones.
export function lookouts(people, paths) {
  const walks = people.flatMap(({ poses, height }) =>
    poses.flatMap(([x, y, z]) => [OVER, height / 2, height].map((up) => [x, y, z + up])));
  const all = [...walks, ...paths.flat().map(([x, y, z]) => [x, y, z])];
  const every = Math.ceil(all.length / MOST_LOOKS);
  return all.filter((_, k) => k % every === 0);
}
