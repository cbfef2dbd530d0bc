// A small renderer in software: convex polygons with a depth buffer.
// It needs no graphics card, and hides things correctly in every pixel.
//
// Points are triples x, y (samples, y downwards) and w, flat in an array. Nearer points have a larger
// w, which is linear on the picture: 1 / depth, or a linear function of it, so that w is metres
// towards the viewer around the middle of the picture.

import { mixed, shaded } from "./colours.js";

const NOWHERE = Math.fround(-1e30); // depth of empty samples
export const LINE = 0.25; // share of a hatched area that is lines

export class Raster {
  // `through`: how visible moving things are through solid ones.
  constructor(through) {
    this.through = through;
    this.canvas = document.createElement("canvas");
    this.width = this.height = 0;
    this.line = new Float64Array(12);
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return false;
    [this.width, this.height] = [this.canvas.width, this.canvas.height] = [width, height];
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.image = this.context.createImageData(width, height);
    this.out = new Uint32Array(this.image.data.buffer);
    const size = width * height;
    const layer = () => ({ colour: new Uint32Array(size), depth: new Float32Array(size).fill(NOWHERE) });
    [this.still, this.moving] = [layer(), layer()];
    this.touched = new Int32Array(size); // samples at which something moving is
    this.count = 0;
    this.left = new Float64Array(height);
    this.right = new Float64Array(height);
    return true;
  }

  // The smallest and the largest w; not needed here.
  reach() {}

  // Remove static things.
  clear(colour) {
    this.still.colour.fill(colour);
    this.still.depth.fill(NOWHERE);
  }

  // Fill the background, behind all static things, with a colour for each row.
  backdrop(colourOf) {
    const { width, height, still: { colour } } = this;
    for (let y = 0; y < height; y++) colour.fill(colourOf(y), y * width, (y + 1) * width);
  }

  // Start a picture with only the static things.
  begin() {
    for (let i = 0; i < this.count; i++) this.moving.depth[this.touched[i]] = NOWHERE;
    this.count = 0;
  }

  // Find the rows of a convex polygon of n points, and its plane; return false if it is edge-on.
  scan(p, n) {
    let nx = 0, ny = 0, nw = 0, low = Infinity, high = -Infinity;
    for (let i = 0, j = 3 * (n - 1); i < 3 * n; j = i, i += 3) {
      const dx = p[i] - p[0], dy = p[i + 1] - p[1], dw = p[i + 2] - p[2];
      const ex = p[j] - p[0], ey = p[j + 1] - p[1], ew = p[j + 2] - p[2];
      nx += ey * dw - ew * dy;
      ny += ew * dx - ex * dw;
      nw += ex * dy - ey * dx;
      low = Math.min(low, p[i + 1]);
      high = Math.max(high, p[i + 1]);
    }
    if (!(Math.abs(nw) > 1e-6)) return false; // edge-on, or without any area
    const top = Math.max(Math.ceil(low - 0.5), 0);
    const bottom = Math.min(Math.ceil(high - 0.5), this.height) - 1;
    if (top > bottom) return false;
    [this.top, this.bottom] = [top, bottom];
    this.alongX = -nx / nw;
    this.alongY = -ny / nw;
    this.atOrigin = p[2] - this.alongX * p[0] - this.alongY * p[1];
    this.left.fill(Infinity, top, bottom + 1);
    this.right.fill(-Infinity, top, bottom + 1);
    for (let i = 0, j = 3 * (n - 1); i < 3 * n; j = i, i += 3) this.edge(p, i, j);
    return true;
  }

  // Computed the same way from both sides, so that neighbours neither overlap nor leave a gap.
  edge(p, i, j) {
    if (p[i + 1] > p[j + 1]) [i, j] = [j, i];
    const first = Math.max(Math.ceil(p[i + 1] - 0.5), 0);
    const end = Math.min(Math.ceil(p[j + 1] - 0.5), this.height);
    if (first >= end) return;
    const slope = (p[j] - p[i]) / (p[j + 1] - p[i + 1]);
    const { left, right } = this;
    for (let y = first; y < end; y++) {
      const x = p[i] + (y + 0.5 - p[i + 1]) * slope;
      if (x < left[y]) left[y] = x;
      if (x > right[y]) right[y] = x;
    }
  }

  begins(y) {
    return Math.max(Math.ceil(this.left[y] - 0.5), 0);
  }

  ends(y) {
    return Math.min(Math.ceil(this.right[y] - 0.5), this.width);
  }

  // A static polygon, optionally with shade.
  fillStill(p, n, colour, shade) {
    if (!this.scan(p, n)) return;
    const { colour: colours, depth: depths } = this.still;
    for (let y = this.top; y <= this.bottom; y++) {
      let x = this.begins(y);
      const end = y * this.width + this.ends(y);
      let w = this.atOrigin + this.alongX * (x + 0.5) + this.alongY * (y + 0.5);
      for (let at = y * this.width + x; at < end; at++, x++, w += this.alongX) {
        if (w <= depths[at]) continue;
        depths[at] = w;
        colours[at] = shade ? shaded(colour, shade.at(x, y, w)) : colour;
      }
    }
  }

  // A translucent static polygon, in front of those drawn before; it hides nothing.
  tintStill(p, n, colour, share) {
    if (!this.scan(p, n)) return;
    const { colour: colours, depth: depths } = this.still, k = Math.round(share * 256);
    const redBlue = colour & 0xff00ff, green = (colour >> 8) & 0xff;
    for (let y = this.top; y <= this.bottom; y++) {
      const x = this.begins(y), end = y * this.width + this.ends(y);
      let w = this.atOrigin + this.alongX * (x + 0.5) + this.alongY * (y + 0.5);
      for (let at = y * this.width + x; at < end; at++, w += this.alongX) {
        if (w <= depths[at]) continue;
        const under = colours[at];
        const rb = (((under & 0xff00ff) * (256 - k) + redBlue * k) >>> 8) & 0xff00ff;
        const g = (((under >> 8) & 0xff) * (256 - k) + green * k) & 0xff00;
        colours[at] = (0xff000000 | rb | g) >>> 0;
      }
    }
  }

  // A moving polygon.
  fillMoving(p, n, colour) {
    if (!this.scan(p, n)) return;
    const { colour: colours, depth: depths } = this.moving;
    for (let y = this.top; y <= this.bottom; y++) {
      const x = this.begins(y), end = y * this.width + this.ends(y);
      let w = this.atOrigin + this.alongX * (x + 0.5) + this.alongY * (y + 0.5);
      for (let at = y * this.width + x; at < end; at++, w += this.alongX) {
        if (w > depths[at]) {
          if (depths[at] === NOWHERE) this.touched[this.count++] = at;
          depths[at] = w;
          colours[at] = colour;
        }
      }
    }
  }

  // Put moving things in front of static ones; behind these, they shine through.
  compose() {
    const { still, moving, out, touched, through } = this;
    out.set(still.colour);
    for (let i = 0; i < this.count; i++) {
      const at = touched[i], colour = moving.colour[at];
      out[at] = moving.depth[at] < still.depth[at] ? mixed(out[at], colour, through) : colour;
    }
  }

  // A translucent polygon, once the rest is composed; it hides nothing.
  // `aside`: it does not cover moving things, as their colours have a meaning. `hatch`: it has a line
  // every so many samples, and is faint in between.
  blend(p, n, colour, share, { aside = false, hatch = 0 } = {}) {
    if (!this.scan(p, n)) return;
    const { out, still, moving } = this;
    const front = Math.round(share * 256), line = hatch * LINE;
    const redBlue = colour & 0xff00ff, green = (colour >> 8) & 0xff;
    for (let y = this.top; y <= this.bottom; y++) {
      const x = this.begins(y), end = y * this.width + this.ends(y);
      let w = this.atOrigin + this.alongX * (x + 0.5) + this.alongY * (y + 0.5);
      for (let at = y * this.width + x; at < end; at++, w += this.alongX) {
        if (w <= still.depth[at] || w <= moving.depth[at] || (aside && moving.depth[at] > NOWHERE)) continue;
        let k = front;
        if (hatch && (at - y * this.width + y) % hatch >= line) k >>= 2;
        const under = out[at];
        const rb = (((under & 0xff00ff) * (256 - k) + redBlue * k) >>> 8) & 0xff00ff;
        const g = (((under >> 8) & 0xff) * (256 - k) + green * k) & 0xff00;
        out[at] = (0xff000000 | rb | g) >>> 0;
      }
    }
  }

  stroke(p, i, j, thickness, lift) {
    return lineOf(this.line, p, i, j, thickness, lift);
  }

  // Copy the picture into a canvas of the same or another size.
  finish(context) {
    const { width, height } = context.canvas;
    if (width === this.width && height === this.height) return context.putImageData(this.image, 0, 0);
    this.context.putImageData(this.image, 0, 0);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.canvas, 0, 0, width, height);
  }
}

// Write the corners of a line with a thickness (samples), brought nearer by `lift` (m), to an array.
export function lineOf(q, p, i, j, thickness, lift) {
  const dx = p[j] - p[i], dy = p[j + 1] - p[i + 1], length = Math.hypot(dx, dy) || 1;
  const ox = (-dy / length) * thickness / 2, oy = (dx / length) * thickness / 2;
  q[0] = p[i] + ox; q[1] = p[i + 1] + oy; q[2] = p[i + 2] + lift;
  q[3] = p[j] + ox; q[4] = p[j + 1] + oy; q[5] = p[j + 2] + lift;
  q[6] = p[j] - ox; q[7] = p[j + 1] - oy; q[8] = p[j + 2] + lift;
  q[9] = p[i] - ox; q[10] = p[i + 1] - oy; q[11] = p[i + 2] + lift;
  return q;
}
