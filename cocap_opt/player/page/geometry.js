// Points, angles and polygons. Points are [x, y, z] in m; flat polygons are arrays of x, y, w in turn.

export const TAU = 2 * Math.PI;
export const DEGREE = Math.PI / 180;

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];

export function unit(v) {
  const length = Math.hypot(...v) || 1;
  return v.map((x) => x / length);
}

// Outward normal of a polygon whose corners go counter-clockwise.
export const normalOf = ([a, b, c]) => unit(cross(minus(b, a), minus(c, a)));

// A point of a body that stands at x, y, z and faces along yaw.
export const placed = ([x, y, z], [px, py, pz, yaw]) => {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  return [px + x * c - y * s, py + x * s + y * c, pz + z];
};

export const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => flat.slice(3 * k, 3 * k + 3));

export const ring = (n, radius, x = 0, y = 0, z = 0) =>
  Array.from({ length: n }, (_, k) => [
    x + radius * Math.cos((TAU * k) / n), y + radius * Math.sin((TAU * k) / n), z,
  ]);

// Twice the area of a flat polygon; positive if its corners go counter-clockwise for the viewer.
export function area(flat) {
  let sum = 0;
  for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
    sum += flat[i] * flat[j + 1] - flat[j] * flat[i + 1];
  }
  return sum;
}

// True if a point is inside a convex polygon whose corners go counter-clockwise for the viewer.
export function inside(flat, x, y) {
  for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
    const side = (flat[i] - flat[j]) * (y - flat[j + 1]) - (flat[i + 1] - flat[j + 1]) * (x - flat[j]);
    if (side > 0) return false;
  }
  return true;
}

// The part of a convex polygon at or beyond a depth, computed from the depths of its corners.
export function clipped(points, depths, least) {
  const kept = [];
  points.forEach((p, i) => {
    const j = (i + 1) % points.length, q = points[j], a = depths[i] - least, b = depths[j] - least;
    if (a >= 0) kept.push(p);
    if (a * b < 0) kept.push(p.map((v, k) => v + (a / (a - b)) * (q[k] - v)));
  });
  return kept;
}
