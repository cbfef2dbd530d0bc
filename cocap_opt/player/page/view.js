// One plan in a canvas, seen from outside.

import { lookouts } from "./blocks.js";
import { Bodies } from "./bodies.js";
import { CLOSED, palette } from "./colours.js";
import { area, clipped, inside, minus, placed } from "./geometry.js";
import { Labels } from "./labels.js";
import { Shade, WALL, WALL_STEPS } from "./light.js";
import { NEAR, Pen } from "./pen.js";
import { newRaster } from "./renderers.js";
import { Sights } from "./sights.js";

const MOST_SAMPLES = 3.2e6;
const THROUGH = 0.3; // how visible moving things are through solid ones
const SMALLEST_DRONE = 8; // px, smallest radius of a drone as drawn
// px between people and drones if they were spread evenly; with less, they are drawn smaller
const UNCROWDED = 60;
const HATCH = 9; // px between lines
// Share of the camera's distance to the middle; nothing nearer is drawn
const CLOSEST = 0.02;
const FARTHEST = 1.01; // end of the range of depths, as a multiple of the largest depth
const OUTLINE = 0.55; // opacity of the outlines of cut blocks
const LAYERS = 256; // layers of polygons, from near to far

export class View {
  constructor(data, plan, scene, camera, canvas) {
    Object.assign(this, { data, plan, scene, camera, canvas });
    this.bodies = new Bodies(data, plan);
    this.sights = new Sights(data, scene.rays, this.bodies);
    this.labels = new Labels(this);
    this.moving = Math.max(data.people.length + plan.paths.length, 1);
    this.lookouts = lookouts(data.people, plan.paths);
    this.opened = new Uint8Array(scene.blocks.count); // 1 for blocks that are only outlined
    this.corners = new Float64Array(12);
    this.begin();
  }

  // Start with an empty picture.
  begin() {
    this.stamp = "";
    this.raster = newRaster(THROUGH);
    this.pen = new Pen(this.raster, (x, y, z, into, at) => this.put(x, y, z, into, at), {
      cut: (points) => this.cut(points), metreAt: (w) => this.pen.metre * (1 + w / this.away),
    });
  }

  depth(x, y, z) {
    const { away, centre: c, camera: { ahead } } = this;
    return away + (x - c[0]) * ahead[0] + (y - c[1]) * ahead[1] + (z - c[2]) * ahead[2];
  }

  // Put a point of the world as x, y in samples and w, which is m towards the viewer around the
  // middle; return true if it is in front of the camera.
  put(px, py, pz, into, at) {
    const { camera: { right, up, ahead }, centre: c, away, raster } = this;
    const x = px - c[0], y = py - c[1], z = pz - c[2], depth = away + x * ahead[0] + y * ahead[1] + z * ahead[2];
    const k = (this.pen.metre * away) / depth;
    into[at] = raster.width / 2 + k * (x * right[0] + y * right[1]);
    into[at + 1] = raster.height / 2 - k * (x * up[0] + y * up[1] + z * up[2]);
    into[at + 2] = (away * (away - depth)) / depth;
    return depth > this.closest;
  }

  cut(points) {
    const depths = points.map(([x, y, z]) => this.depth(x, y, z));
    return depths.every((depth) => depth > this.closest) ? points : clipped(points, depths, this.closest);
  }

  // The increase of a point's coordinate (0: x), in units of a size (m), along x and y of a sample,
  // each times the depth, which is away² / (w + away).
  slopes(axis, size, from = 0) {
    const { away, camera: { right, up, ahead } } = this, { width, height } = this.raster, k = this.pen.metre * away;
    const [a, b] = [right[axis] / k, -up[axis] / k], begin = ahead[axis] - (a * width + b * height) / 2;
    return [...[a, b, begin].map((v) => (v * away ** 2) / size), (this.eye[axis] - from) / size];
  }

  // Radius of a drone (m): its real one, or larger so that it remains visible.
  droneSize() {
    return Math.max(0.35, (SMALLEST_DRONE * this.pen.crowding * this.pen.fine) / this.pen.metre);
  }

  draw(time, options) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    if (this.raster.isLost) this.begin();
    if (!this.camera.fitted) this.camera.fit(width, height);
    this.camera.update();
    const follows = options.follow && options.picked !== undefined;
    const middle = follows ? this.bodies.drone(options.picked, time).slice(0, 3) : this.camera.centre;
    this.prepare(middle, follows, width, height, options);
    this.paint(time, options);
    const context = this.canvas.getContext("2d");
    this.raster.finish(context);
    context.setTransform(this.canvas.width / width, 0, 0, this.canvas.height / height, 0, 0);
    this.labels.write(context, time, width, height, options);
  }

  paint(time, options) {
    const { raster, bodies, pen } = this;
    raster.begin();
    if (options.tracks) {
      bodies.walks(pen, time);
      bodies.tracks(pen, time, options);
    }
    bodies.people(pen, time, options);
    bodies.drones(pen, time, this.droneSize(), options);
    raster.compose();
    if (options.closed && this.data.airspace) this.closed(time);
    if (options.sights) this.sights.draw(pen, time, this.data.reach, options);
  }

  // Zones closed to drones, translucent, so that they hide nothing. From above, the ceiling would
  // cover the whole picture.
  closed(time) {
    const { zones, lid } = this.scene.world;
    this.see(zones, 0.34, Math.round(HATCH * this.pen.fine));
    this.see(lid, this.camera.isAbove ? 0 : 0.05);
    this.bodies.keptFrom(this.pen, time);
  }

  // Polygons of closed zones; they do not cover people and drones.
  see({ corners, edges }, share, hatch) {
    const at = (array, k) => [array[k], array[k + 1], array[k + 2]];
    for (let i = 0; i < corners.length; i += 12) {
      this.pen.veil([0, 3, 6, 9].map((k) => at(corners, i + k)), CLOSED, share, { aside: true, hatch });
    }
    for (let i = 0; i < edges.length; i += 6) this.pen.ray(at(edges, i), at(edges, i + 3), CLOSED, 0.5, { aside: true });
  }

  // Draw static things again, but only if the camera has moved.
  prepare(middle, follows, width, height, { quality, solid }) {
    const pixels = window.devicePixelRatio || 1, { camera } = this, { azimuth, elevation, scale, away } = camera;
    this.pen.fine = Math.max(Math.min(quality, Math.sqrt(MOST_SAMPLES / (width * height))), 0.5);
    this.pen.metre = scale * this.pen.fine;
    this.pen.crowding = Math.min(Math.sqrt((width * height) / this.moving) / UNCROWDED, 1);
    const size = [Math.round(width * pixels), Math.round(height * pixels)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    const stamp = [...middle, width, height, azimuth, elevation, away, this.pen.metre, solid].join();
    const { world } = this.scene;
    if (stamp === this.stamp && world === this.world) return;
    Object.assign(this, { stamp, world, centre: middle, away, closest: Math.max(NEAR, CLOSEST * away) });
    this.eye = middle.map((v, k) => v - away * camera.ahead[k]);
    this.raster.resize(...[width, height].map((long) => Math.round(long * this.pen.fine)));
    this.raster.reach(-away * FARTHEST, (away * away * FARTHEST) / this.closest);
    this.raster.clear(palette.paper);
    this.open(follows, solid);
    const { ground, things } = world;
    this.still(things, undefined, nearToFar(things, this.eye, camera.ahead)); // so that less is drawn over
    this.still(ground, this.sunlight(), nearToFar(ground, this.eye, camera.ahead));
    this.outlines(things);
  }

  // Cut off the blocks in front of the action. While the camera follows a drone, these are the blocks
  // in front of it as seen from far away, so that none appears and disappears.
  open(follows, solid) {
    const { azimuth, elevation } = this.camera;
    const stamp = follows ? [azimuth, elevation, this.away, solid].join() : "";
    if (follows && stamp === this.openStamp) return;
    this.openStamp = stamp;
    this.opened.fill(0);
    if (solid) return;
    for (const point of this.lookouts) {
      const way = follows ? this.camera.ahead.map((v) => -v) : minus(this.eye, point);
      const far = follows ? this.away : Math.hypot(...way);
      this.scene.rays.mark(point, follows ? way : way.map((v) => v / far), far, this.opened);
    }
  }

  isTurnedAway(corners, at, normals, n) {
    const { eye } = this, [x, y, z] = eye;
    return normals[n] * (corners[at] - x) + normals[n + 1] * (corners[at + 1] - y) + normals[n + 2] * (corners[at + 2] - z) > 0;
  }

  // Static polygons; of cut blocks, only the part below the cut.
  still({ corners, normals, colours, blocks, feet, edges, edgeBlocks }, level, order) {
    const { raster } = this;
    for (const i of order) {
      if (this.isTurnedAway(corners, 12 * i, normals, 3 * i)) continue;
      const top = this.topOf(blocks[i]), isLevel = normals[3 * i + 2] === 1;
      if (top === -Infinity) continue;
      const light = isLevel ? level : this.walllight(feet[i]), flat = this.polygon(corners, 12 * i, top);
      raster.fillStill(flat, flat.length / 3, isLevel && top < Infinity ? palette.cut : colours[i], light);
    }
    for (let i = 0; i < edgeBlocks.length; i++) {
      const top = this.topOf(edgeBlocks[i]), flat = top === -Infinity ? null : this.edge(edges, 6 * i, top, 0.9);
      if (flat) raster.fillStill(flat, 4, palette.edge);
    }
  }

  // The altitude of a block's cut.
  topOf(block) {
    return block >= 0 && this.opened[block] ? this.scene.blocks.cuts[block] : Infinity;
  }

  // Lines of cut blocks. Those above feet that are outside the picture belong to nothing one sees.
  outlines({ edges, edgeBlocks, outlines, outlineBlocks }) {
    const { raster, opened } = this;
    for (const [lines, of] of [[edges, edgeBlocks], [outlines, outlineBlocks]]) {
      for (let i = 0; i < of.length; i++) {
        const isShown = opened[of[i]] && this.hasFoot(lines, 6 * i, this.topOf(of[i]));
        const flat = isShown ? this.edge(lines, 6 * i, Infinity, 1) : null;
        if (flat) raster.tintStill(flat, 4, palette.outline, OUTLINE);
      }
    }
  }

  // True if an end of a line of a cut block has its foot in the picture, or the block hangs.
  hasFoot(lines, at, cut) {
    const { corners, raster: { width, height } } = this, isIn = (v, most) => v >= 0 && v <= most;
    return cut === -Infinity || [0, 3].some((end) =>
      this.take(lines, at + end, 0, cut) && isIn(corners[0], width) && isIn(corners[1], height));
  }

  // Four corners, none higher than `top`, as a flat polygon of the picture, without any part behind
  // the camera.
  polygon(corners, at, top) {
    let isBefore = true;
    for (let k = 0; k < 4; k++) isBefore = this.take(corners, at + 3 * k, k, top) && isBefore;
    if (isBefore) return this.corners;
    const points = [0, 3, 6, 9].map((k) => [corners[at + k], corners[at + k + 1], Math.min(corners[at + k + 2], top)]);
    return this.pen.project(points);
  }

  // A line of some thickness (px); not drawn if it is partly behind the camera.
  edge(edges, at, top, thickness) {
    if (!this.take(edges, at, 0, top) || !this.take(edges, at + 3, 1, top)) return null;
    return this.raster.stroke(this.corners, 0, 3, thickness * this.pen.fine, 0.04);
  }

  take(array, at, k, top) {
    return this.put(array[at], array[at + 1], Math.min(array[at + 2], top), this.corners, 3 * k);
  }

  // The light on the ground.
  sunlight() {
    const { light } = this.scene.world;
    const [u, v] = [0, 1].map((axis) => this.slopes(axis, light.texel, light.from[axis]));
    return new Shade(light, u, v, this.away);
  }

  // The light on a wall between two altitudes; other polygons have even light.
  walllight([foot, top]) {
    if (!(top > foot)) return undefined;
    return new Shade(WALL, [0, 0, 0, 0], this.slopes(2, (top - foot) / WALL_STEPS, foot), this.away);
  }

  // A point of the world in pixels of the page; far off the picture if it is behind the camera.
  at([x, y, z]) {
    const q = new Float64Array(3), { fine } = this.pen;
    return this.put(x, y, z, q, 0) ? [q[0] / fine, q[1] / fine] : [-1e6, -1e6];
  }

  // True if the ground, or a block that is not cut, hides a point.
  isHidden(point) {
    const way = minus(this.eye, point), far = Math.hypot(...way);
    return this.scene.rays.isBlocked(point, way.map((v) => v / far), far, this.opened);
  }

  // The face under a point of the canvas: [person, face, number over all], or nothing.
  faceAt(x, y, time) {
    let best, nearest = -Infinity;
    const [px, py] = [x, y].map((v) => v * this.pen.fine);
    this.bodies.owners.forEach(([j, f], face) => {
      const pose = this.bodies.person(j, time);
      const flat = this.pen.project(this.data.people[j].faces[f].map((p) => placed(p, pose)));
      const w = (flat[2] + flat[5] + flat[8]) / 3;
      if (area(flat) > 0 && w > nearest && inside(flat, px, py)) {
        [best, nearest] = [[j, f, face], w];
      }
    });
    return best;
  }
}

// The numbers of polygons, roughly from near to far by their first corners.
function nearToFar({ corners }, eye, ahead) {
  const n = corners.length / 12, depths = new Float64Array(n), starts = new Int32Array(LAYERS + 1), order = new Int32Array(n);
  let least = Infinity, most = -Infinity;
  for (let i = 0, at = 0; i < n; i++, at += 12) {
    const depth = (corners[at] - eye[0]) * ahead[0] + (corners[at + 1] - eye[1]) * ahead[1] + (corners[at + 2] - eye[2]) * ahead[2];
    depths[i] = depth;
    if (depth < least) least = depth;
    if (depth > most) most = depth;
  }
  const scale = (LAYERS - 1) / (most - least || 1);
  for (let i = 0; i < n; i++) starts[1 + Math.floor((depths[i] - least) * scale)]++;
  for (let k = 0; k < LAYERS; k++) starts[k + 1] += starts[k];
  for (let i = 0; i < n; i++) order[starts[Math.floor((depths[i] - least) * scale)]++] = i;
  return order;
}
