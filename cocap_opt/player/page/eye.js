// What one drone's camera sees, in perspective; people are drawn as the faces that count.

import { mixed, palette, shaded } from "./colours.js";
import { clipped, DEGREE } from "./geometry.js";
import { Shade } from "./light.js";
import { FINE, NEAR, Pen } from "./pen.js";
import { newRaster } from "./renderers.js";

const NEAREST = 1.1 / NEAR; // 1 / m, for the nearest things that are drawn
const EYE_FINE = 1.5; // samples per pixel of the page while nothing moves
const WIDEST = 55 * DEGREE; // largest half angle that is shown of a cone, which may be wider
const CONE_SHAPE = 0.62; // height of its picture, as a share of its width

export class Eye {
  constructor(data, plan, scene, bodies, canvas) {
    Object.assign(this, { data, plan, scene, bodies, canvas });
    this.begin();
  }

  // Start with an empty picture.
  begin() {
    this.raster = newRaster(0);
    this.raster.reach(0, NEAREST);
    this.pen = new Pen(this.raster, (x, y, z, into, at) => this.put(x, y, z, into, at), {
      cut: (points) => this.cut(points), metreAt: (w) => this.focal * w,
    });
    this.stamp = "";
  }

  draw(time, drone, quality) {
    const { clientWidth: width } = this.canvas;
    if (!width) return;
    if (this.raster.isLost) this.begin();
    this.look(drone, this.bodies.drone(drone, time));
    this.resize(width, quality === FINE ? EYE_FINE : Math.min(quality, 1));
    this.still();
    this.raster.begin();
    this.people(time);
    this.bodies.drones(this.pen, time, 0.35, { picked: drone, own: true });
    this.raster.compose();
    this.raster.finish(this.canvas.getContext("2d"));
  }

  // The people who are not behind the camera.
  people(time) {
    this.data.people.forEach(({ height }, j) => {
      const pose = this.bodies.person(j, time);
      if (this.depth(...pose) > -height) this.bodies.faces(this.pen, j, pose, time);
    });
  }

  look(number, [x, y, z, yaw, tilt]) {
    const { half, rise } = this.data.drones[number], isCone = rise === null, down = isCone ? 0 : tilt;
    const [c, s, ct, st] = [Math.cos(yaw), Math.sin(yaw), Math.cos(down), Math.sin(down)];
    this.from = [x, y, z];
    [this.ahead, this.right, this.up] = [[c * ct, s * ct, -st], [s, -c, 0], [c * st, s * st, ct]];
    this.wide = Math.tan(Math.min(half, WIDEST));
    this.shape = isCone ? CONE_SHAPE : Math.tan(rise) / this.wide;
    this.down = down;
  }

  resize(width, fine) {
    const height = Math.round(width * this.shape), pixels = window.devicePixelRatio || 1;
    this.pen.fine = fine;
    this.raster.resize(Math.round(width * fine), Math.max(Math.round(height * fine), 1));
    this.focal = this.raster.width / 2 / this.wide;
    const size = [Math.round(width * pixels), Math.round(height * pixels)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    this.canvas.style.height = `${height}px`;
  }

  depth(x, y, z) {
    const { ahead, from } = this;
    return (x - from[0]) * ahead[0] + (y - from[1]) * ahead[1] + (z - from[2]) * ahead[2];
  }

  // Put a point of the world as x, y (samples) and 1 / depth; return true if it is in front of the camera.
  put(px, py, pz, into, at) {
    const { right, up, from, raster: { width, height } } = this, scale = 1 / this.depth(px, py, pz);
    const x = px - from[0], y = py - from[1], z = pz - from[2];
    into[at] = width / 2 + this.focal * scale * (x * right[0] + y * right[1]);
    into[at + 1] = height / 2 - this.focal * scale * (x * up[0] + y * up[1] + z * up[2]);
    into[at + 2] = scale;
    return scale > 0 && scale < 1 / NEAR;
  }

  cut(points) {
    const depths = points.map(([x, y, z]) => this.depth(x, y, z));
    return depths.every((depth) => depth >= NEAR) ? points : clipped(points, depths, NEAR);
  }

  // Draw static things again, but only if the camera has moved.
  still() {
    const { from, ahead, raster: { width, height }, scene: { world } } = this;
    const stamp = [...from, ...ahead, this.wide, width, height].join();
    if (stamp === this.stamp && world === this.world) return;
    [this.stamp, this.world] = [stamp, world];
    this.raster.clear(palette.paper);
    this.sky();
    this.polygons(this.scene.world.ground, this.sunlight());
    this.polygons(this.scene.world.things);
  }

  // The light on the ground.
  sunlight() {
    const { from, ahead, right, up, focal, raster: { width, height } } = this, { light } = this.scene.world;
    const slopes = (axis) => {
      const [a, b] = [right[axis] / focal, -up[axis] / focal], begin = ahead[axis] - (a * width + b * height) / 2;
      return [a, b, begin, from[axis] - light.from[axis]].map((v) => v / light.texel);
    };
    return new Shade(light, slopes(0), slopes(1), 0);
  }

  // The sky down to the horizon, and endless land below it.
  sky() {
    const { height } = this.raster;
    const horizon = height / 2 - this.focal * Math.tan(this.down);
    this.raster.backdrop((y) => (y < horizon
      ? mixed(palette.skyLow, palette.skyTop, Math.min(Math.max((horizon - y) / height, 0), 1))
      : shaded(palette.ground, 226)));
  }

  isTurnedAway(corners, at, normals, n) {
    const { from } = this;
    const towards = (k) => normals[n + k] * (corners[at + k] - from[k]);
    return towards(0) + towards(1) + towards(2) > 0;
  }

  polygons({ corners, normals, colours }, level) {
    for (let i = 0; i < colours.length; i++) {
      if (this.isTurnedAway(corners, 12 * i, normals, 3 * i)) continue;
      const points = [0, 3, 6, 9].map((k) => corners.subarray(12 * i + k, 12 * i + k + 3));
      const flat = this.pen.project(points);
      if (flat.length) this.raster.fillStill(flat, flat.length / 3, colours[i], normals[3 * i + 2] === 1 ? level : undefined);
    }
  }
}
