// The camera that looks at the scene from outside, in perspective. From straight above it is very
// far away, so the picture is a map.

import { DEGREE, dot, minus, triples } from "./geometry.js";
import { groundAt } from "./rays.js";

const AROUND = [62, 118]; // degrees, allowed first directions; north is at the far side
// Factor by which a direction must be better than those tried before it
const FAVOUR = 1.06;
const TILTS = [46, 38, 32, 54]; // degrees, allowed first tilts downwards
// Number, and length (m), of rays that test how much is hidden
const MOST_RAYS = 300, LOOK = 60;
const FOCAL = 1.3; // focal length, as a multiple of the picture's diagonal
// Degrees; above this tilt it moves away, up to so many times as far
const STEEP = 60, FLAT = 60;
const LEAST = 5; // m, smallest extent of the picture along each axis
const PADDING = { side: 34, top: 46, bottom: 40 }; // px around the action; less above and below in low pictures
const LOW = 500; // px, largest height of a low picture
const ROUNDS = 8; // rounds of moving and zooming until the action just fits

export class Camera {
  constructor(data, rays) {
    this.points = happenings(data);
    this.rays = rays;
    this.focal = 1; // px
    this.way = this.leastHidden(surroundings(data));
    this.fitted = false;
    this.space();
  }

  space() {
    [this.elevation] = TILTS;
    this.azimuth = this.way;
    [this.fitted, this.isFree] = [false, true];
  }

  top() {
    [this.azimuth, this.elevation] = [90, 90];
    [this.fitted, this.isFree] = [false, false];
  }

  get isAbove() {
    return this.elevation > 80;
  }

  // Its distance (m) from the middle of the picture, where `scale` px are a metre.
  get away() {
    const steep = Math.max(this.elevation - STEEP, 0) / (90 - STEEP);
    return ((1 + (FLAT - 1) * steep ** 3) * this.focal) / this.scale;
  }

  update() {
    const a = this.azimuth * DEGREE, e = this.elevation * DEGREE;
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    this.right = [sa, -ca, 0];
    this.up = [ca * se, sa * se, ce];
    this.ahead = [ca * ce, sa * ce, -se];
  }

  // The direction in which least is hidden; all pages of a scene use the same one.
  leastHidden(points) {
    [this.elevation] = TILTS;
    const seen = (azimuth) => {
      this.azimuth = azimuth;
      this.update();
      return 0.5 + this.shareSeen(points);
    };
    return AROUND.map((azimuth) => [azimuth, seen(azimuth)]).reduce((a, b) => (b[1] > a[1] * FAVOUR ? b : a))[0];
  }

  // Fit the action into a canvas of this size; unless the user has turned the camera, with the tilt
  // that shows it largest.
  fit(width, height) {
    const scaleAt = (tilt) => {
      this.elevation = tilt;
      this.frame(width, height);
      return this.scale;
    };
    if (this.isFree) {
      this.elevation = TILTS.map((tilt) => [tilt, scaleAt(tilt)]).reduce((a, b) => (b[1] > a[1] * FAVOUR ? b : a))[0];
    }
    this.frame(width, height);
    Object.assign(this, { fitted: true, isOwn: true, size: [width, height] });
  }

  // A canvas now has this size: fit the action again, unless the user has moved the camera.
  settle(width, height) {
    if (this.isOwn && (width !== this.size[0] || height !== this.size[1])) this.fitted = false;
  }

  frame(width, height) {
    this.update();
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const axes = [this.right, this.up, this.ahead];
    for (const point of this.points) {
      axes.forEach((axis, k) => {
        const along = dot(point, axis);
        low[k] = Math.min(low[k], along);
        high[k] = Math.max(high[k], along);
      });
    }
    const wide = Math.max(high[0] - low[0], LEAST), tall = Math.max(high[1] - low[1], LEAST);
    const [top, bottom] = [PADDING.top, PADDING.bottom].map((long) => long * Math.min(height / LOW, 1));
    const free = [Math.max(width - 2 * PADDING.side, 50), Math.max(height - top - bottom, 50)];
    const scale = Math.min(free[0] / wide, free[1] / tall), middle = low.map((v, k) => (v + high[k]) / 2);
    const centre = [0, 1, 2].map((k) => axes.reduce((sum, axis, n) => sum + middle[n] * axis[k], 0));
    Object.assign(this, { scale, centre, focal: FOCAL * Math.hypot(width, height) });
    for (let round = 0; round < ROUNDS; round++) this.adjust(free);
    this.shift(0, (top - bottom) / 2);
    this.whole = this.scale;
  }

  // Move and zoom so that the projection of the action comes closer to the free part (px).
  adjust(free) {
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity], { away, scale } = this, reach = away * scale;
    for (const point of this.points) {
      const way = minus(point, this.centre), far = Math.max(away + dot(way, this.ahead), away / 4);
      [dot(way, this.right), -dot(way, this.up)].forEach((along, k) => {
        low[k] = Math.min(low[k], (along * reach) / far);
        high[k] = Math.max(high[k], (along * reach) / far);
      });
    }
    this.shift(-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2);
    this.scale *= Math.min(...free.map((long, k) => long / Math.max(high[k] - low[k], LEAST * scale)));
  }

  // Share of points that no obstacle hides.
  shareSeen(points) {
    const every = Math.max(Math.floor(points.length / MOST_RAYS), 1), back = this.ahead.map((v) => -v);
    const some = points.filter((_, k) => k % every === 0);
    return some.filter((point) => this.rays.length(point, back, LOOK) === LOOK).length / some.length;
  }

  orbit(dx, dy) {
    [this.isFree, this.isOwn] = [false, false];
    this.azimuth -= dx * 0.4;
    this.elevation = Math.min(Math.max(this.elevation + dy * 0.3, 8), 90);
  }

  pan(dx, dy) {
    this.isOwn = false;
    this.shift(dx, dy);
  }

  shift(dx, dy) {
    this.centre = this.centre.map((v, k) => v - (dx * this.right[k] - dy * this.up[k]) / this.scale);
  }

  // Zoom about a point of the canvas, given relative to its middle.
  zoom(factor, x, y) {
    this.pan(-x, -y);
    this.scale *= factor;
    this.pan(x, y);
  }
}

// The action: drones and people at the steps of all plans, not too far off the map; or the whole
// map, if drones may choose their starts.
function happenings({ plans, people, terrain, meshes, starts, scope: [low, high] }) {
  const within = (point) => point.map((v, k) => Math.min(Math.max(v, low[k]), k < 2 ? high[k] : Infinity));
  const drones = plans.flatMap((plan) => plan.paths.flat()).map(([x, y, z]) => [x, y, z]);
  const inside = [...drones, ...people.flatMap(walked)].map(within);
  return starts || !inside.length ? [...inside, ...wholeMap(terrain, meshes)] : inside;
}

// Points that are the same for all plans of a scene: starts and people.
function surroundings({ plans: [{ paths }], people, terrain }) {
  return [...paths.flatMap((path) => path.slice(0, 1)).flatMap((start) => aboveGround(terrain, start)), ...people.flatMap(walked)];
}

const aboveGround = (terrain, [x, y, z]) => [[x, y, z], [x, y, groundAt(terrain, x, y)]];

const walked = ({ poses, height }) => poses.flatMap(([x, y, z]) => [[x, y, z], [x, y, z + height]]);

// The corners of a map, the tops of its cells, and the meshes that are on it.
function wholeMap({ size: [width, depth], cell, cells: [, rows], heights }, meshes) {
  const tops = heights.map((z, k) => [(Math.floor(k / rows) + 0.5) * cell, ((k % rows) + 0.5) * cell, z]);
  const solids = meshes.flatMap(({ vertices }) => triples(vertices));
  const onMap = solids.filter(([x, y]) => x >= 0 && y >= 0 && x <= width && y <= depth);
  return [...tops, ...onMap, ...[0, width].flatMap((x) => [0, depth].map((y) => [x, y, 0]))];
}
