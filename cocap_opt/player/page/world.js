// Static things as polygons: the terrain's columns, merged where they are alike, and meshes.

import { CLOSED, landed, mixed, palette, shaded, startable } from "./colours.js";
import { dot } from "./geometry.js";
import { brightness, GroundLight, SUN } from "./light.js";

// In cells; steps of the terrain of at least this height get a line
const LEAST_EDGE = 0.8;
const SLOPE = 1.2; // weight of the light from above on the sides of the ground's steps
const MOST_EDGES = 6000;
// Between triangles with a smaller angle, there is no line
const STRAIGHT = Math.cos(Math.PI / 7);

const lit = (colour, normal) => shaded(colour, 256 * brightness(dot(normal, SUN)));

// Polygons of 4 corners (triangles repeat one) with colour, normal and block, and lines: edges, and
// lines that only outlines have. The outlines of a block consist of both.
class Polygons {
  constructor() {
    this.corners = []; // 12 numbers each
    this.normals = []; // 3 numbers each; all 0: visible from both sides
    this.colours = [];
    this.feet = []; // altitudes of the foot and the top of a wall; NaN if it is not a wall
    this.blocks = []; // -1 for none
    this.edges = []; // 6 numbers each
    this.outlines = []; // 6 numbers each
    [this.edgeBlocks, this.outlineBlocks] = [[], []];
  }

  add(points, normal, colour, block = -1, foot = NaN, top = NaN) {
    for (const point of points) this.corners.push(...point);
    this.normals.push(...normal);
    this.colours.push(colour);
    this.blocks.push(block);
    this.feet.push([foot, top]);
  }

  edge(p, q, block = -1) {
    this.edges.push(...p, ...q);
    this.edgeBlocks.push(block);
  }

  outline(p, q, block) {
    this.outlines.push(...p, ...q);
    this.outlineBlocks.push(block);
  }

  done() {
    for (const lines of [this.edges, this.outlines]) if (lines.length > 6 * MOST_EDGES) lines.length = 0;
    this.corners = new Float64Array(this.corners);
    this.edges = new Float64Array(this.edges);
    this.outlines = new Float64Array(this.outlines);
  }
}

// The bare ground, with the ground plans of buildings, and the buildings and meshes on it.
export class World {
  constructor(data, blocks) {
    const { terrain } = data, { heights, grounds, kinds } = terrain;
    const highest = grounds.reduce((a, b) => Math.max(a, b), 0);
    const bare = (k) => mixed(palette.ground, palette.high, highest > 1 ? grounds[k] / highest : 0);
    const ground = (k) => landed(bare(k), terrain.land?.colours[terrain.land.cells[k]]);
    const colours = { 1: [palette.lowPlan, palette.low], 2: [palette.wallPlan, palette.wall] };
    this.ground = new Polygons();
    const plan = (k) => colours[kinds[k]]?.[0] ?? ground(k);
    const isOpen = (k) => data.starts?.cells[k] === "1";
    new Columns(terrain, grounds, null, (k) => (isOpen(k) ? startable(plan(k), data.starts) : plan(k)), this.ground);
    this.things = new Polygons();
    new Columns(terrain, heights, grounds, (k) => colours[kinds[k]]?.[1] ?? ground(k), this.things, blocks.ofCell);
    addSolids(this.things, terrain, data, palette.mesh, blocks);
    // Zones closed to drones: no-fly zones, and the ceiling.
    this.zones = new Polygons();
    this.lid = new Polygons();
    if (data.airspace) addSolids(this.zones, terrain, data.airspace.zones, CLOSED);
    if (data.airspace?.lid.length) new Lid(terrain, data.airspace.lid, null, () => CLOSED, this.lid);
    for (const some of [this.ground, this.things, this.zones, this.lid]) some.done();
    this.light = new GroundLight(data, this.things);
  }
}

// Adds meshes and boxes, with the numbers of their blocks, if any.
function addSolids(into, terrain, { meshes, boxes }, colour, blocks) {
  meshes.forEach((mesh, k) => addMesh(into, mesh, colour, blocks?.ofTriangle[k]));
  boxes.forEach((box, k) => addBox(into, terrain, box, colour, blocks?.ofBox[k]));
}

// Edges of cells along an axis, in m; the last cell may be cut.
const edgeOf = (terrain, axis, k) => Math.min(k * terrain.cell, terrain.size[axis]);

// Adds columns with these tops. With `floors`, only the parts above them are added, and each block
// (numbers by cell) has walls all around.
class Columns {
  constructor(terrain, heights, floors, colour, into, blocks = null) {
    Object.assign(this, { terrain, heights, floors, colour, into, blocks });
    this.tops();
    this.sides();
  }

  sides() {
    for (const axis of [0, 1]) for (const side of [1, -1]) this.walls(axis, side);
  }

  block(cell) {
    return this.blocks && cell >= 0 ? this.blocks[cell] : -1;
  }

  rises(cell) {
    return !this.floors || this.heights[cell] > this.floors[cell];
  }

  tops() {
    const { heights, terrain: { cells: [X, Y] } } = this;
    const done = new Uint8Array(X * Y), colours = Array.from({ length: X * Y }, (_, k) => this.colour(k));
    const alike = (a, b) => !done[b] && this.rises(b) && heights[a] === heights[b] && colours[a] === colours[b]
      && this.block(a) === this.block(b);
    for (let i = 0; i < X; i++) {
      for (let j = 0; j < Y; j++) {
        const cell = i * Y + j;
        if (done[cell] || !this.rises(cell)) continue;
        let y = j, x = i;
        while (y < Y && alike(cell, i * Y + y)) y++;
        const row = () => {
          for (let k = j; k < y; k++) if (!alike(cell, x * Y + k)) return false;
          return true;
        };
        while (x < X && row()) x++;
        for (let k = i; k < x; k++) done.fill(1, k * Y + j, k * Y + y);
        this.top([i, x], [j, y], heights[cell], colours[cell], this.block(cell));
      }
    }
  }

  top(xs, ys, z, colour, block) {
    const [a, b] = xs.map((k) => edgeOf(this.terrain, 0, k)), [c, d] = ys.map((k) => edgeOf(this.terrain, 1, k));
    this.into.add([[a, c, z], [b, c, z], [b, d, z], [a, d, z]], [0, 0, 1], lit(colour, [0, 0, 1]), block);
  }

  // Height of a cell; off the map, the foot of the slab below everything.
  height(cell) {
    return cell < 0 ? -this.terrain.slab : this.heights[cell];
  }

  // The foot of a cell's wall towards a neighbour; blocks go down to their floors.
  foot(cell, neighbour) {
    if (!this.floors) return this.height(neighbour);
    const isApart = neighbour >= 0 && this.block(neighbour) !== this.block(cell) && this.rises(neighbour);
    return Math.max(isApart ? this.floors[neighbour] : this.height(neighbour), this.floors[cell]);
  }

  // Walls of cells towards their next (side 1) or previous (-1) neighbours along an axis (0: x), with
  // runs of equal walls merged, and the outlines of blocks there.
  walls(axis, side) {
    const { cells } = this.terrain, [N, M] = [cells[axis], cells[1 - axis]];
    const number = (n, m) => (n < 0 || n >= N ? -1 : axis === 0 ? n * cells[1] + m : m * cells[1] + n);
    for (let n = 0; n < N; n++) {
      let last = null, rim = null;
      for (let m = 0; m <= M; m++) {
        const cell = m < M ? number(n, m) : -1, next = number(n + side, m);
        const wall = cell < 0 ? null : this.wallOf(cell, next);
        if (!wall || !last || wall.some((value, k) => value !== last.wall[k])) {
          if (last) this.wall(axis, side, n, last);
          last = wall && { wall, begin: m };
        }
        if (last) last.end = m + 1;
        const around = wall && this.blocks && this.block(next) !== wall[3] ? wall[3] : -1;
        if (around === (rim?.block ?? -1)) {
          if (rim) rim.wall = wall;
          continue;
        }
        if (rim) this.upright(axis, side, n, m, rim.wall);
        rim = around < 0 ? null : { block: around, wall };
        if (rim) this.upright(axis, side, n, m, wall);
      }
    }
  }

  // Foot, top, colour and block of the wall of a cell towards a neighbour, if there is one.
  wallOf(cell, neighbour) {
    const foot = this.foot(cell, neighbour), top = this.height(cell);
    return foot < top ? [foot, top, this.colour(cell), this.block(cell)] : null;
  }

  // A point of the side of row n, at the edge k across.
  corner(axis, side, n, k, z) {
    const [u, v] = [edgeOf(this.terrain, axis, side > 0 ? n + 1 : n), edgeOf(this.terrain, 1 - axis, k)];
    return axis === 0 ? [u, v, z] : [v, u, z];
  }

  upright(axis, side, n, k, [low, high, , block]) {
    const at = (z) => this.corner(axis, side, n, k, z);
    this.into.outline(at(low), at(high), block);
  }

  wall(axis, side, n, { wall: [low, high, colour, block], begin, end }) {
    const at = (k, z) => this.corner(axis, side, n, k, z), normal = [0, 0, 0];
    normal[axis] = side;
    // A slope is a staircase here; with sharp edges, it would look like a building.
    const soft = normal.map((v, k) => (this.floors ? v : (v + (k === 2 ? SLOPE : 0)) / Math.hypot(1, SLOPE)));
    const points = [at(begin, low), at(end, low), at(end, high), at(begin, high)];
    this.into.add(points, normal, lit(colour, soft), block, low, high);
    if (high - low > LEAST_EDGE * this.terrain.cell) this.into.edge(at(begin, high), at(end, high), block);
    if (block >= 0) this.into.outline(at(begin, low), at(end, low), block);
  }
}

// Tops of columns without sides, with an edge where the map ends.
class Lid extends Columns {
  sides() {}

  top(xs, ys, z, colour) {
    super.top(xs, ys, z, colour);
    const { cells } = this.terrain, at = (i, j) => [edgeOf(this.terrain, 0, i), edgeOf(this.terrain, 1, j), z];
    const edge = (p, q) => this.into.edge(p, q);
    for (const i of xs) if (i === 0 || i === cells[0]) edge(at(i, ys[0]), at(i, ys[1]));
    for (const j of ys) if (j === 0 || j === cells[1]) edge(at(xs[0], j), at(xs[1], j));
  }
}

// Adds triangles, and the edges at which the surface bends or ends.
function addMesh(into, { vertices, triangles }, colour, blocks = []) {
  const at = (k) => vertices.slice(3 * k, 3 * k + 3), sides = new Map();
  for (let t = 0; t < triangles.length; t += 3) {
    const numbers = triangles.slice(t, t + 3), [a, b, c] = numbers.map(at);
    const u = b.map((v, i) => v - a[i]), v = c.map((w, i) => w - a[i]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...n) || 1, normal = n.map((w) => w / length);
    into.add([a, b, c, c], [0, 0, 0], lit(colour, normal), blocks[t / 3]);
    numbers.forEach((k, i) => {
      const key = [k, numbers[(i + 1) % 3]].sort((p, q) => p - q).join();
      if (!sides.has(key)) sides.set(key, { block: blocks[t / 3], normals: [] });
      sides.get(key).normals.push(normal);
    });
  }
  for (const [key, { block, normals }] of sides) {
    const flat = normals.length === 2 && normals[0].reduce((sum, w, i) => sum + w * normals[1][i], 0) > STRAIGHT;
    if (!flat) into.edge(...key.split(",").map((k) => at(Number(k))), block);
  }
}

// Adds a part of a column; a mesh that is too fine to draw is drawn as the parts that it fills.
function addBox(into, terrain, [i, j, low, high], colour, block = -1) {
  const [a, b] = [i, i + 1].map((k) => edgeOf(terrain, 0, k)), [c, d] = [j, j + 1].map((k) => edgeOf(terrain, 1, k));
  const side = (normal, ...points) => into.add(points, normal, lit(colour, normal), block);
  side([0, 0, 1], [a, c, high], [b, c, high], [b, d, high], [a, d, high]);
  side([0, 0, -1], [a, c, low], [b, c, low], [b, d, low], [a, d, low]);
  side([-1, 0, 0], [a, c, low], [a, d, low], [a, d, high], [a, c, high]);
  side([1, 0, 0], [b, c, low], [b, d, low], [b, d, high], [b, c, high]);
  side([0, -1, 0], [a, c, low], [b, c, low], [b, c, high], [a, c, high]);
  side([0, 1, 0], [a, d, low], [b, d, low], [b, d, high], [a, d, high]);
}
