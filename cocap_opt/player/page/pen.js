// Draws moving things into a raster, through a camera's projection, which puts a point x, y, z into
// an array and returns true if it is in front of the camera.
// Thickness is in px of the page, each of which is `fine` samples of the raster; `crowding` is the
// factor by which bodies are smaller than usual.

import { shaded } from "./colours.js";
import { area } from "./geometry.js";
import { brightness, SUN } from "./light.js";

export const FINE = 2; // samples per pixel of the page along x and y
export const COARSE = 1;
export const ROUGH = 0.7;
export const NEAR = 0.15; // m; nothing nearer is drawn
const MOST_CORNERS = 32; // corners of a polygon of a body

export class Pen {
  // `cut` returns the part of a polygon that is in front of the camera, `metreAt` the samples of a
  // metre at w.
  constructor(raster, put, { cut = (points) => points, metreAt = () => this.metre } = {}) {
    Object.assign(this, { raster, put, cut, metreAt, fine: 1, crowding: 1, place: new Float64Array(3) });
    this.corners = Array.from({ length: MOST_CORNERS + 1 }, (_, n) => new Float64Array(3 * n));
  }

  project(points) {
    const kept = this.cut(points), flat = new Float64Array(3 * kept.length);
    kept.forEach(([x, y, z], i) => this.put(x, y, z, flat, 3 * i));
    return flat;
  }

  // The samples of a metre at a point; 0 if everything within a radius (m) is outside the picture.
  metreAround([x, y, z], radius) {
    const { place, raster: { width, height } } = this;
    if (!this.put(x, y, z, place, 0)) return 0;
    const [px, py, w] = place, metre = this.metreAt(w), far = radius * metre;
    return px > -far && py > -far && px < width + far && py < height + far ? metre : 0;
  }

  fill(points, colour) {
    const flat = this.project(points);
    this.raster.fillMoving(flat, flat.length / 3, colour);
  }

  // A polygon of a closed body, visible only from its front.
  face(points, colour, border) {
    const flat = this.project(points);
    if (area(flat) <= 0) return;
    this.raster.fillMoving(flat, flat.length / 3, colour);
    this.outline(flat, border, 0.8);
  }

  outline(flat, colour, thickness) {
    for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
      this.raster.fillMoving(this.raster.stroke(flat, j, i, thickness * this.fine, 0.02), 4, colour);
    }
  }

  // A body of some size that stands at x, y, z and faces along yaw; `colourOf` returns the colour of
  // its polygon k, which the sun lights. Polygons partly behind the camera are left out.
  body(body, [x, y, z, yaw], size, colourOf) {
    const c = Math.cos(yaw) * size, s = Math.sin(yaw) * size, { corners, normals, hollow } = body;
    for (let k = 0; k < corners.length; k++) {
      const own = corners[k], flat = this.corners[own.length / 3];
      let isBefore = true;
      for (let i = 0; i < own.length; i += 3) {
        const px = own[i], py = own[i + 1];
        isBefore = this.put(x + px * c - py * s, y + px * s + py * c, z + own[i + 2] * size, flat, i) && isBefore;
      }
      if (!isBefore || (!hollow[k] && area(flat) <= 0)) continue;
      const [nx, ny, nz] = normals[k], sun = SUN[0] * (nx * c - ny * s) + SUN[1] * (nx * s + ny * c) + SUN[2] * nz * size;
      this.raster.fillMoving(flat, flat.length / 3, shaded(colourOf(k), 256 * brightness(sun / size)));
    }
  }

  line(a, b, colour, thickness) {
    const flat = this.project([a, b]);
    this.raster.fillMoving(this.raster.stroke(flat, 0, 3, thickness * this.fine, 0.03), 4, colour);
  }

  // Translucent things, once all others are composed.
  veil(points, colour, share, how) {
    const flat = this.project(points);
    this.raster.blend(flat, flat.length / 3, colour, share, how);
  }

  ray(a, b, colour, share, how) {
    this.raster.blend(this.raster.stroke(this.project([a, b]), 0, 3, 0.8 * this.fine, 0), 4, colour, share, how);
  }
}
