// Points, angles and polygons. Points are [x, y, z] in m; flat polygons are x, y, w in turns.

const TAU = 2 * Math.PI, DEGREE = Math.PI / 180;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];

function unit(v) {
  const length = Math.hypot(...v) || 1;
  return v.map((x) => x / length);
}

// Outward normal of a polygon whose corners go counter-clockwise.
const normalOf = ([a, b, c]) => unit(cross(minus(b, a), minus(c, a)));

// A row between two steps; column 3 is an angle.
function between(rows, time) {
  const t = Math.min(Math.floor(time), rows.length - 1), share = t < rows.length - 1 ? time - t : 0;
  if (!share) return rows[t];
  return rows[t].map((a, i) => {
    const way = rows[t + 1][i] - a;
    return a + share * (i === 3 ? way - TAU * Math.round(way / TAU) : way);
  });
}

// Whether no drone of a plan leaves its place.
const isStill = ({ paths }) => paths.every(([start, ...rest]) =>
  rest.every((pose) => [0, 1, 2].every((k) => pose[k] === start[k])));

// True if a drone is there: one whose start is still to be chosen has no path.
const isThere = ({ paths }, drone) => paths[drone].length > 0;

// True of so many drones, or people, that they cannot all have a colour and a number in pictures.
const CROWD = 14;
const isCrowd = (some) => some.length > CROWD;

// The numbers of the drones that are there.
const present = (plan) => plan.paths.map((_, i) => i).filter((i) => isThere(plan, i));

// True if some drone moves, or turns its camera.
const turns = ({ paths }) => paths.some(([start, ...rest]) => rest.some((pose) => pose.some((value, k) => value !== start[k])));

// A point of a body that stands at x, y, z and looks along yaw.
const placed = ([x, y, z], [px, py, pz, yaw]) => {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  return [px + x * c - y * s, py + x * s + y * c, pz + z];
};

const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => flat.slice(3 * k, 3 * k + 3));

const ring = (n, radius, x = 0, y = 0, z = 0) =>
  Array.from({ length: n }, (_, k) => [
    x + radius * Math.cos((TAU * k) / n), y + radius * Math.sin((TAU * k) / n), z,
  ]);

// Twice the area of a flat polygon; positive if its corners go counter-clockwise for the viewer.
function area(flat) {
  let sum = 0;
  for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
    sum += flat[i] * flat[j + 1] - flat[j] * flat[i + 1];
  }
  return sum;
}

// Whether a point is inside a convex polygon that goes counter-clockwise for the viewer.
function inside(flat, x, y) {
  for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
    const side = (flat[i] - flat[j]) * (y - flat[j + 1]) - (flat[i + 1] - flat[j + 1]) * (x - flat[j]);
    if (side > 0) return false;
  }
  return true;
}

// The part of a convex polygon that is at least so deep, by the depths of its corners.
function clipped(points, depths, least) {
  const kept = [];
  points.forEach((p, i) => {
    const j = (i + 1) % points.length, q = points[j], a = depths[i] - least, b = depths[j] - least;
    if (a >= 0) kept.push(p);
    if (a * b < 0) kept.push(p.map((v, k) => v + (a / (a - b)) * (q[k] - v)));
  });
  return kept;
}
