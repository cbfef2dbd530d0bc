// Where a drone of a plan is at any time: on its smooth flight, if there is one, whose rows are the
// step, the pose, its rates and its accelerations; else straight from step to step.

import { dot, minus } from "./geometry.js";
import { between } from "./plans.js";

const POSE = 5; // numbers of a pose: x, y, z, yaw and tilt
const MOST = 6; // lines of a step that bends
const NEAR = 0.02; // m, as they come to it

export class Flight {
  constructor({ paths, knots }, drone) {
    this.path = paths[drone];
    this.rows = knots?.[drone];
    this.ways = [];
  }

  // The pose at a time.
  at(time) {
    const { rows, path } = this;
    if (!rows) return between(path, time);
    let k = Math.max(Math.min(Math.floor(time), path.length - 2), 0); // of all rows the first that it may be
    while (k + 2 < rows.length && rows[k + 1][0] <= time) k++;
    const [begin, end] = [rows[k], rows[k + 1]], long = end[0] - begin[0], share = (time - begin[0]) / long;
    return Array.from({ length: POSE }, (_, n) => quintic(begin, end, n + 1, long, share));
  }

  // Points of the way from a step to the next: as many as it takes to come near to its bends.
  way(step) {
    return (this.ways[step] ??= this.points(step, Math.min(Math.max(Math.ceil(Math.sqrt(this.bend(step) / NEAR)), 1), MOST)));
  }

  points(step, lines) {
    const inner = Array.from({ length: lines - 1 }, (_, k) => this.at(step + (k + 1) / lines));
    return [this.path[step], ...inner, this.path[step + 1]];
  }

  // How far a step's way is off the straight line (m).
  bend(step) {
    if (!this.rows) return 0;
    const [a, b] = [this.path[step], this.path[step + 1]], way = [0, 1, 2].map((k) => b[k] - a[k]);
    const square = dot(way, way);
    return Math.max(...[0.25, 0.5, 0.75].map((share) => {
      const off = minus(this.at(step + share), a), along = square && dot(off, way) / square;
      return Math.hypot(...off.map((v, k) => v - along * way[k]));
    }));
  }
}

// The polynomial of the fifth degree with the values, rates and accelerations of two rows, in column
// n, at a share of the time between them.
function quintic(begin, end, n, long, u) {
  const v = 1 - u, rate = (row) => (row[n + POSE] * long) / 5, bend = (row) => (row[n + 2 * POSE] * long ** 2) / 20;
  const a = begin[n], b = a + rate(begin), c = 2 * b - a + bend(begin);
  const f = end[n], e = f - rate(end), d = 2 * e - f + bend(end);
  return v ** 3 * (v * v * a + 5 * u * v * b + 10 * u * u * c) + u ** 3 * (10 * v * v * d + 5 * u * v * e + u * u * f);
}
