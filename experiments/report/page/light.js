// Sunlight on the ground: shadows of what stands there, darker corners beside walls, and a grid of
// round lengths to judge distances by. On walls it fades towards their feet.

const SUN = unit([0.42, -0.5, 0.85]); // where it is
const MOST_TEXELS = 640; // along an edge of the map
const SHADE = 0.26, CORNER = 0.34, GRID = 0.07; // how much light they take
const NOOK = 0.8; // m, how far from walls corners are dark

const WALL_LIGHT = Uint8Array.from({ length: 65 }, (_, k) => 190 + 65 * Math.min(1, k / 48));

class GroundLight {
  constructor(terrain, obstacles) {
    this.texel = Math.max(...terrain.size) / MOST_TEXELS;
    this.columns = Math.ceil(terrain.size[0] / this.texel);
    this.rows = Math.ceil(terrain.size[1] / this.texel);
    const shadows = this.painted((context) => this.shadows(context, terrain, obstacles));
    const plans = this.painted((context) => this.plans(context, obstacles));
    const around = this.blurred(plans, Math.max(Math.round(NOOK / this.texel), 1)), soft = this.blurred(shadows, 1);
    this.map = soft.map((shadow, k) => 255 * (1 - SHADE * shadow) * (1 - CORNER * Math.max(around[k] - plans[k], 0)));
    this.grid(terrain);
  }

  // Light of 256 at a point of the map.
  at(x, y) {
    const i = Math.min(Math.max(Math.floor(x / this.texel), 0), this.columns - 1);
    const j = Math.min(Math.max(Math.floor(y / this.texel), 0), this.rows - 1);
    return this.map[j * this.columns + i];
  }

  // Shares 0..1 of texels that are painted.
  painted(draw) {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [this.columns, this.rows];
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.scale(1 / this.texel, 1 / this.texel);
    draw(context);
    const { data } = context.getImageData(0, 0, this.columns, this.rows);
    return Float32Array.from({ length: this.columns * this.rows }, (_, k) => data[4 * k + 3] / 255);
  }

  // What stands on the ground, as the sun throws it there.
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

  grid(terrain) {
    const lines = rounded(Math.max(...terrain.size) / 12) / this.texel;
    const darken = (k) => (this.map[k] *= 1 - GRID);
    for (let n = lines; n < this.columns; n += lines) {
      for (let j = 0; j < this.rows; j++) darken(j * this.columns + Math.floor(n));
    }
    for (let n = lines; n < this.rows; n += lines) {
      for (let i = 0; i < this.columns; i++) darken(Math.floor(n) * this.columns + i);
    }
  }
}

// Running means along lines of n values that are `step` apart; lines begin `next` apart.
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

// How bright a surface is, of 1, by the cosine between its normal and the way to the sun.
const brightness = (cosine) => 0.62 + (0.38 * Math.max(0, cosine)) / SUN[2];
