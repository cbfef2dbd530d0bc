// The position of a plan's drone at any time: on its smooth flight, if there is one, else on straight
// lines from step to step. Rows of a flight are the step, the pose, its rates and its accelerations.

import { dot, minus } from "./geometry.js";
import { between } from "./plans.js";

const POSE = 5; // numbers of a pose: x, y, z, yaw and tilt
// Largest number of lines for the curve of a step
const MOST = 6;
// m, largest distance of the lines from the curve
const NEAR = 0.02;

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
    let k = Math.max(Math.min(Math.floor(time), path.length - 2), 0); // the first row that is possible
    while (k + 2 < rows.length && rows[k + 1][0] <= time) k++;
    const [begin, end] = [rows[k], rows[k + 1]], long = end[0] - begin[0], share = (time - begin[0]) / long;
    return Array.from({ length: POSE }, (_, n) => quintic(begin, end, n + 1, long, share));
  }

  // Points of the way from a step to the next, as many as its curve needs.
  way(step) {
    return (this.ways[step] ??= this.points(step, Math.min(Math.max(Math.ceil(Math.sqrt(this.bend(step) / NEAR)), 1), MOST)));
  }

  points(step, lines) {
    const inner = Array.from({ length: lines - 1 }, (_, k) => this.at(step + (k + 1) / lines));
    return [this.path[step], ...inner, this.path[step + 1]];
  }

  // The largest distance (m) of a step's way from the straight line.
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

// The value, at a share u of the time between two rows, of the polynomial of fifth degree that has
// the values, rates and accelerations of column n of both rows.
function quintic(begin, end, n, long, u) {
  const v = 1 - u, rate = (row) => (row[n + POSE] * long) / 5, bend = (row) => (row[n + 2 * POSE] * long ** 2) / 20;
  const a = begin[n], b = a + rate(begin), c = 2 * b - a + bend(begin);
  const f = end[n], e = f - rate(end), d = 2 * e - f + bend(end);
  return v ** 3 * (v * v * a + 5 * u * v * b + 10 * u * u * c) + u ** 3 * (10 * v * v * d + 5 * u * v * e + u * u * f);
}
