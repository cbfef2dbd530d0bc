// Sunlight on the ground: shadows, darker corners beside walls, and a grid of round lengths for
// judging distances. On walls, the light fades towards their feet.

import { unit } from "./geometry.js";
import { rounded } from "./numbers.js";
import { groundAt } from "./rays.js";

export const SUN = unit([0.42, -0.5, 0.85]); // direction of the sun
const MOST_TEXELS = 700; // along an edge of the lit part of the map
// How far the lit part extends beyond the action, as a share of its size
const BEYOND = 0.8;
// Shares of light that shadows, corners and the grid remove
const SHADE = 0.07, CORNER = 0.32, GRID = 0.07;
const FADE = 0.06; // width of the faded edges, as a share of the lit part
const NOOK = 0.8; // m, width of dark corners beside walls

export const WALL_STEPS = 64; // steps of light from the foot of a wall to its top
export const WALL = {
  map: Uint8Array.from({ length: WALL_STEPS }, (_, k) => 190 + 65 * Math.min(1, k / 48)), columns: 1, rows: WALL_STEPS,
};

// The light at samples of a polygon: a map of light (of 256), and the place of a sample x, y, w in
// it: u = (a x + b y + c) / (w + shift) + d, and likewise v.
export class Shade {
  constructor({ map, columns, rows }, u, v, shift) {
    Object.assign(this, { map, columns, rows, shift });
    [this.ua, this.ub, this.uc, this.ud] = u;
    [this.va, this.vb, this.vc, this.vd] = v;
  }

  // Writes a x + b y + c for u and v, and d for both, to an array.
  parts(into, at, x, y) {
    into[at] = this.ua * x + this.ub * y + this.uc;
    into[at + 1] = this.va * x + this.vb * y + this.vc;
    into[at + 2] = this.ud;
    into[at + 3] = this.vd;
  }

  at(x, y, w) {
    const scale = 1 / (w + this.shift);
    const u = ((this.ua * x + this.ub * y + this.uc) * scale + this.ud) | 0;
    const v = ((this.va * x + this.vb * y + this.vc) * scale + this.vd) | 0;
    const column = u < 0 ? 0 : u < this.columns ? u : this.columns - 1;
    const row = v < 0 ? 0 : v < this.rows ? v : this.rows - 1;
    return this.map[row * this.columns + column];
  }
}

export class GroundLight {
  constructor({ terrain, scope: [low, high] }, obstacles) {
    const size = Math.max(high[0] - low[0], high[1] - low[1]);
    this.from = [0, 1].map((k) => Math.max(low[k] - BEYOND * size, 0));
    const ends = [0, 1].map((k) => Math.min(high[k] + BEYOND * size, terrain.size[k]));
    const to = ends.map((end, k) => Math.max(end, this.from[k] + terrain.cell));
    this.texel = Math.max(to[0] - this.from[0], to[1] - this.from[1]) / MOST_TEXELS;
    [this.columns, this.rows] = to.map((v, k) => Math.ceil((v - this.from[k]) / this.texel));
    const shadows = this.painted((context) => this.shadows(context, terrain, obstacles));
    const plans = this.painted((context) => this.plans(context, obstacles));
    const around = this.blurred(plans, Math.max(Math.round(NOOK / this.texel), 1)), soft = this.blurred(shadows, 1);
    const corner = (k) => CORNER * Math.max(around[k] - plans[k], 0);
    this.map = Uint8Array.from(soft, (shadow, k) => 255 * (1 - SHADE * shadow) * (1 - corner(k)));
    this.grid();
    this.fade();
  }

  // The painted share (0..1) of each texel.
  painted(draw) {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [this.columns, this.rows];
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.scale(1 / this.texel, 1 / this.texel);
    context.translate(-this.from[0], -this.from[1]);
    draw(context);
    const { data } = context.getImageData(0, 0, this.columns, this.rows);
    return Float32Array.from({ length: this.columns * this.rows }, (_, k) => data[4 * k + 3] / 255);
  }

  // The shadows on the ground.
  shadows(context, terrain, { corners }) {
    for (let i = 0; i < corners.length; i += 12) {
      const foot = groundAt(terrain, corners[i], corners[i + 1], terrain.grounds);
      context.beginPath();
      for (let k = i; k < i + 12; k += 3) {
        const far = Math.max(corners[k + 2] - foot, 0) / SUN[2];
        context.lineTo(corners[k] - SUN[0] * far, corners[k + 1] - SUN[1] * far);
      }
      context.fill();
    }
  }

  plans(context, { corners, normals }) {
    for (let i = 0, n = 0; i < corners.length; i += 12, n += 3) {
      if (normals[n + 2] !== 1) continue;
      context.beginPath();
      for (let k = i; k < i + 12; k += 3) context.lineTo(corners[k], corners[k + 1]);
      context.fill();
    }
  }

  // Means over squares, row by row and then column by column, twice.
  blurred(values, radius) {
    const [X, Y] = [this.columns, this.rows];
    for (let turn = 0; turn < 2; turn++) {
      values = boxBlurred(values, Y, X, X, 1, radius);
      values = boxBlurred(values, X, Y, 1, X, radius);
    }
    return values;
  }

  grid() {
    const apart = rounded((Math.max(this.columns, this.rows) * this.texel) / 12);
    const lines = (axis, count) => {
      const first = Math.ceil(this.from[axis] / apart) * apart - this.from[axis], found = [];
      for (let at = first; at < count * this.texel; at += apart) if (at > 0) found.push(Math.floor(at / this.texel));
      return found;
    };
    const darken = (k) => (this.map[k] *= 1 - GRID);
    for (const i of lines(0, this.columns)) for (let j = 0; j < this.rows; j++) darken(j * this.columns + i);
    for (const j of lines(1, this.rows)) for (let i = 0; i < this.columns; i++) darken(j * this.columns + i);
  }

  // Full light at the edges, as there is beyond them.
  fade() {
    const wide = Math.min(this.columns, this.rows) * FADE;
    for (let j = 0; j < this.rows; j++) {
      for (let i = 0; i < this.columns; i++) {
        const inside = Math.min(i, j, this.columns - 1 - i, this.rows - 1 - j) / wide;
        if (inside < 1) this.map[j * this.columns + i] = 255 + inside * (this.map[j * this.columns + i] - 255);
      }
    }
  }
}

// Running means along lines of n values that are `step` apart; the lines' starts are `next` apart.
function boxBlurred(values, lines, n, next, step, radius) {
  const result = new Float32Array(values.length), wide = 2 * radius + 1;
  for (let line = 0; line < lines; line++) {
    const at = (k) => values[line * next + Math.min(Math.max(k, 0), n - 1) * step];
    let sum = 0;
    for (let k = -radius; k <= radius; k++) sum += at(k);
    for (let k = 0; k < n; k++) {
      result[line * next + k * step] = sum / wide;
      sum += at(k + radius + 1) - at(k - radius);
    }
  }
  return result;
}

// The brightness of a surface, 0.62 in shadow and 1 if it is horizontal, from the cosine between its normal and the sun's direction.
export const brightness = (cosine) => 0.62 + (0.38 * Math.max(0, cosine)) / SUN[2];
