// What stands still, as polygons: the terrain's columns, merged where they are alike, and meshes.

const LEAST_EDGE = 0.8; // of a cell, steps in the terrain that get an outline
const SLOPE = 1.2; // how much of the light from above the sides of the ground's steps take
const MOST_EDGES = 6000;
const STRAIGHT = Math.cos(Math.PI / 7); // of triangles that bend less

const lit = (colour, normal) => shaded(colour, 256 * brightness(dot(normal, SUN)));

// Polygons of 4 corners (triangles repeat one) with colour and normal, and edges to be outlined.
class Polygons {
  constructor() {
    this.corners = []; // 12 numbers each
    this.normals = []; // 3 numbers each; all 0: seen from both sides
    this.colours = [];
    this.feet = []; // altitudes of the foot and the top of a wall; NaN: it is none
    this.edges = []; // 6 numbers each
  }

  add(points, normal, colour, foot = NaN, top = NaN) {
    for (const point of points) this.corners.push(...point);
    this.normals.push(...normal);
    this.colours.push(colour);
    this.feet.push([foot, top]);
  }

  done() {
    if (this.edges.length > 6 * MOST_EDGES) this.edges.length = 0;
    this.corners = new Float64Array(this.corners);
    this.edges = new Float64Array(this.edges);
  }
}

// The bare ground, with the plans of what stands on it, and what stands there.
class World {
  constructor(data) {
    const { terrain } = data, { heights, grounds, kinds } = terrain;
    const highest = grounds.reduce((a, b) => Math.max(a, b), 0);
    const ground = (k) => mixed(palette.ground, palette.high, highest > 1 ? grounds[k] / highest : 0);
    const colours = { 1: [palette.lowPlan, palette.low], 2: [palette.wallPlan, palette.wall] };
    this.ground = new Polygons();
    const plan = (k) => colours[kinds[k]]?.[0] ?? ground(k);
    const isOpen = (k) => data.starts?.cells[k] === "1";
    new Columns(terrain, grounds, null, (k) => (isOpen(k) ? startable(plan(k), data.starts) : plan(k)), this.ground);
    this.things = new Polygons();
    new Columns(terrain, heights, grounds, (k) => colours[kinds[k]]?.[1] ?? ground(k), this.things);
    addSolids(this.things, terrain, data, palette.mesh);
    // What is closed to drones: no-fly zones, and the ceiling.
    this.zones = new Polygons();
    this.lid = new Polygons();
    if (data.airspace) addSolids(this.zones, terrain, data.airspace.zones, CLOSED);
    if (data.airspace?.lid.length) new Lid(terrain, data.airspace.lid, null, () => CLOSED, this.lid);
    for (const some of [this.ground, this.things, this.zones, this.lid]) some.done();
    this.light = new GroundLight(data, this.things);
  }
}

function addSolids(into, terrain, { meshes, boxes }, colour) {
  for (const mesh of meshes) addMesh(into, mesh, colour);
  for (const box of boxes) addBox(into, terrain, box, colour);
}

// Edges of cells along an axis, in m; the last cell may be cut.
const edgeOf = (terrain, axis, k) => Math.min(k * terrain.cell, terrain.size[axis]);

// Adds columns with these tops; only what rises above `floors`, if there are any.
class Columns {
  constructor(terrain, heights, floors, colour, into) {
    Object.assign(this, { terrain, heights, floors, colour, into });
    this.tops();
    this.sides();
  }

  sides() {
    this.walls(0);
    this.walls(1);
  }

  rises(cell) {
    return !this.floors || this.heights[cell] > this.floors[cell];
  }

  tops() {
    const { heights, terrain: { cells: [X, Y] } } = this;
    const done = new Uint8Array(X * Y), colours = Array.from({ length: X * Y }, (_, k) => this.colour(k));
    const alike = (a, b) => !done[b] && this.rises(b) && heights[a] === heights[b] && colours[a] === colours[b];
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
        this.top([i, x], [j, y], heights[cell], colours[cell]);
      }
    }
  }

  top(xs, ys, z, colour) {
    const [a, b] = xs.map((k) => edgeOf(this.terrain, 0, k)), [c, d] = ys.map((k) => edgeOf(this.terrain, 1, k));
    this.into.add([[a, c, z], [b, c, z], [b, d, z], [a, d, z]], [0, 0, 1], lit(colour, [0, 0, 1]));
  }

  // Height of a cell; beyond the map, that of the foot of the slab on which all stands.
  height(cell) {
    return cell < 0 ? -this.terrain.slab : this.heights[cell];
  }

  // Where the wall of a cell towards a lower neighbour begins.
  foot(cell, neighbour) {
    return this.floors ? Math.max(this.height(neighbour), this.floors[cell]) : this.height(neighbour);
  }

  // Walls between neighbours along an axis (0: x), runs of equal ones merged.
  walls(axis) {
    const { cells } = this.terrain, [N, M] = [cells[axis], cells[1 - axis]];
    const number = (n, m) => (n < 0 || n >= N ? -1 : axis === 0 ? n * cells[1] + m : m * cells[1] + n);
    for (let n = 0; n <= N; n++) {
      let last = null;
      for (let m = 0; m < M; m++) {
        const wall = this.between(number(n - 1, m), number(n, m));
        const same = wall && last && wall.every((value, k) => value === last.wall[k]);
        if (same) last.end = m + 1;
        else {
          if (last) this.wall(axis, n, last);
          last = wall && { wall, begin: m, end: m + 1 };
        }
      }
      if (last) this.wall(axis, n, last);
    }
  }

  // Foot, top, colour and side of the wall between two cells, if there is one.
  between(before, after) {
    const [a, b] = [this.height(before), this.height(after)];
    if (a === b) return null;
    const [upper, lower, side] = a > b ? [before, after, 1] : [after, before, -1];
    const foot = this.foot(upper, lower), top = Math.max(a, b);
    return foot < top ? [foot, top, this.colour(upper), side] : null;
  }

  wall(axis, n, { wall: [low, high, colour, side], begin, end }) {
    const at = (k, z) => {
      const [u, v] = [edgeOf(this.terrain, axis, n), edgeOf(this.terrain, 1 - axis, k)];
      return axis === 0 ? [u, v, z] : [v, u, z];
    };
    const normal = [0, 0, 0];
    normal[axis] = side;
    // A slope is a staircase here: as one of sharp edges it would look like a building.
    const soft = normal.map((v, k) => (this.floors ? v : (v + (k === 2 ? SLOPE : 0)) / Math.hypot(1, SLOPE)));
    this.into.add([at(begin, low), at(end, low), at(end, high), at(begin, high)], normal, lit(colour, soft), low, high);
    if (high - low > LEAST_EDGE * this.terrain.cell) this.into.edges.push(...at(begin, high), ...at(end, high));
  }
}

// Tops of columns that have no sides, with an edge where the map ends.
class Lid extends Columns {
  sides() {}

  top(xs, ys, z, colour) {
    super.top(xs, ys, z, colour);
    const { cells } = this.terrain, at = (i, j) => [edgeOf(this.terrain, 0, i), edgeOf(this.terrain, 1, j), z];
    const edge = (p, q) => this.into.edges.push(...p, ...q);
    for (const i of xs) if (i === 0 || i === cells[0]) edge(at(i, ys[0]), at(i, ys[1]));
    for (const j of ys) if (j === 0 || j === cells[1]) edge(at(xs[0], j), at(xs[1], j));
  }
}

// Triangles, and the edges at which they bend or end.
function addMesh(into, { vertices, triangles }, colour) {
  const at = (k) => vertices.slice(3 * k, 3 * k + 3), sides = new Map();
  for (let t = 0; t < triangles.length; t += 3) {
    const numbers = triangles.slice(t, t + 3), [a, b, c] = numbers.map(at);
    const u = b.map((v, i) => v - a[i]), v = c.map((w, i) => w - a[i]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...n) || 1, normal = n.map((w) => w / length);
    into.add([a, b, c, c], [0, 0, 0], lit(colour, normal));
    numbers.forEach((k, i) => {
      const key = [k, numbers[(i + 1) % 3]].sort((p, q) => p - q).join();
      sides.set(key, [...(sides.get(key) ?? []), normal]);
    });
  }
  for (const [key, normals] of sides) {
    const flat = normals.length === 2 && normals[0].reduce((sum, w, i) => sum + w * normals[1][i], 0) > STRAIGHT;
    if (!flat) into.edges.push(...key.split(",").flatMap((k) => at(Number(k))));
  }
}

// A part of a column: what a mesh too fine to be drawn fills of a cell.
function addBox(into, terrain, [i, j, low, high], colour) {
  const [a, b] = [i, i + 1].map((k) => edgeOf(terrain, 0, k)), [c, d] = [j, j + 1].map((k) => edgeOf(terrain, 1, k));
  const side = (normal, ...points) => into.add(points, normal, lit(colour, normal));
  side([0, 0, 1], [a, c, high], [b, c, high], [b, d, high], [a, d, high]);
  side([0, 0, -1], [a, c, low], [b, c, low], [b, d, low], [a, d, low]);
  side([-1, 0, 0], [a, c, low], [a, d, low], [a, d, high], [a, c, high]);
  side([1, 0, 0], [b, c, low], [b, d, low], [b, d, high], [b, c, high]);
  side([0, -1, 0], [a, c, low], [b, c, low], [b, c, high], [a, c, high]);
  side([0, 1, 0], [a, d, low], [b, d, low], [b, d, high], [a, d, high]);
}
