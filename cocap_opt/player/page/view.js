// One plan in a canvas, seen from outside.

const FINE = 2, COARSE = 1, ROUGH = 0.7; // samples per pixel of the page along x and y
const MOST_SAMPLES = 3.2e6;
const THROUGH = 0.3; // how much is seen of what moves through what is solid
const HATCH = 9; // px from line to line
const AROUND_PEOPLE = 2.4, AROUND_DRONES = 1.5; // m, in which obstacles before them are glass
const SPARE = 0.15; // of a picture that follows a drone, drawn beyond each of its sides
const MOST_OPEN = 110; // px, radius of such a disc

class View {
  constructor(data, plan, scene, camera, canvas) {
    Object.assign(this, { data, plan, scene, camera, canvas });
    this.raster = new Raster(THROUGH);
    this.bodies = new Bodies(data, plan);
    this.sights = new Sights(data, scene.rays, this.bodies);
    this.labels = new Labels(this);
    this.pen = new Pen(this.raster, (x, y, z, into, at) => this.put(x, y, z, into, at));
    this.corners = new Float64Array(12);
    this.stamp = "";
  }

  // Put a point of the world as x, y in samples and w in m towards the viewer.
  put(px, py, pz, into, at) {
    const { right, up, ahead } = this.camera, k = this.pen.metre, c = this.centre;
    const x = px - c[0], y = py - c[1], z = pz - c[2];
    into[at] = this.raster.width / 2 + k * (x * right[0] + y * right[1]);
    into[at + 1] = this.raster.height / 2 - k * (x * up[0] + y * up[1] + z * up[2]);
    into[at + 2] = -(x * ahead[0] + y * ahead[1] + z * ahead[2]);
    return true;
  }

  // How a coordinate (0: x) of a point, in units of a size (m), grows along x, y and w of a sample.
  slopes(axis, size, from = 0) {
    const { right, up, ahead } = this.camera, { width, height } = this.raster, k = this.pen.metre;
    const [a, b] = [right[axis] / k, -up[axis] / k], begin = this.centre[axis] - (a * width + b * height) / 2;
    return [a / size, b / size, -ahead[axis] / size, (begin - from) / size, 0];
  }

  // Radius of a drone (m): its own, but never so small that nobody sees it.
  droneSize() {
    return Math.max(0.35, (8 * this.pen.fine) / this.pen.metre);
  }

  draw(time, options) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    if (!this.camera.fitted) this.camera.fit(width, height);
    this.camera.update();
    const follows = options.follow && options.picked !== undefined;
    const middle = follows ? this.bodies.drone(options.picked, time).slice(0, 3) : this.camera.centre;
    this.prepare(middle, follows ? SPARE : 0, width, height, options);
    this.paint(time, options);
    const context = this.canvas.getContext("2d");
    this.raster.finish(context, this.window);
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

  // Where drones may not fly: see-through, so that it hides nothing. From above the ceiling is all
  // over the picture.
  closed(time) {
    const { zones, lid } = this.scene.world;
    this.see(zones, 0.34, Math.round(HATCH * this.pen.fine));
    this.see(lid, this.camera.isAbove ? 0 : 0.05);
    this.bodies.keptFrom(this.pen, time);
  }

  // Polygons of what is closed to drones; people and drones stay as they are.
  see({ corners, edges }, share, hatch) {
    const at = (array, k) => [array[k], array[k + 1], array[k + 2]];
    for (let i = 0; i < corners.length; i += 12) {
      this.pen.veil([0, 3, 6, 9].map((k) => at(corners, i + k)), CLOSED, share, { aside: true, hatch });
    }
    for (let i = 0; i < edges.length; i += 6) this.pen.ray(at(edges, i), at(edges, i + 3), CLOSED, 0.5, { aside: true });
  }

  // What stands still is drawn again only where the camera has turned, or moved beyond the margin.
  prepare(middle, margin, width, height, { quality, solid }) {
    const pixels = window.devicePixelRatio || 1, whole = 1 + 2 * margin;
    this.pen.fine = Math.max(Math.min(quality, Math.sqrt(MOST_SAMPLES / (width * height)) / whole), 0.5);
    this.pen.metre = this.camera.scale * this.pen.fine;
    const size = [Math.round(width * pixels), Math.round(height * pixels)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    const { azimuth, elevation } = this.camera;
    const stamp = [margin, width, height, azimuth, elevation, this.pen.metre, solid, night.matches].join();
    if (stamp === this.stamp && this.isWithin(middle)) return;
    [this.stamp, this.centre] = [stamp, middle];
    const samples = [width, height].map((long) => Math.round(long * this.pen.fine));
    this.edge = samples.map((long) => Math.round(long * margin));
    this.window = [...this.edge, ...samples];
    this.raster.resize(...samples.map((long, k) => long + 2 * this.edge[k]));
    this.raster.clear(palette.paper);
    if (!solid) this.open();
    const { ground, things } = this.scene.world, { raster, corners } = this;
    this.still(ground, this.sunlight(), (colour, shade) => raster.fillGround(corners, 4, colour, shade));
    this.still(things, undefined, (colour, shade) => raster.fillObstacle(corners, 4, colour, shade));
    this.raster.settle();
  }

  // Move what is shown of the raster to a middle, if it is all drawn.
  isWithin(middle) {
    const way = minus(middle, this.centre), { right, up } = this.camera, { metre } = this.pen;
    const moved = [dot(way, right), -dot(way, up)].map((far) => Math.round(far * metre));
    moved.forEach((far, k) => (this.window[k] = this.edge[k] + far));
    return moved.every((far, k) => Math.abs(far) <= this.edge[k]);
  }

  // Make obstacles glass before people, and unless there are very many, before drones.
  open() {
    const p = new Float64Array(3), { pen, raster: { opening } } = this;
    const add = ([x, y, z], up, around) => {
      this.put(x, y, z + up, p, 0);
      opening.add(p[0], p[1], p[2], Math.min(around * pen.metre, MOST_OPEN * pen.fine));
    };
    const along = (rows, up, around) => {
      for (let t = 0; t < rows.length; t += this.bodies.isCrowd ? 1 : 0.25) add(between(rows, t), up, around);
    };
    for (const { poses, height } of this.data.people) along(poses, height / 2, AROUND_PEOPLE);
    if (!this.bodies.isCrowd) for (const path of this.plan.paths) along(path, 0, AROUND_DRONES);
  }

  still({ corners, normals, colours, feet, edges }, level, fill) {
    const { camera: { ahead } } = this, p = this.corners;
    for (let i = 0; i < colours.length; i++) {
      const towards = normals[3 * i] * ahead[0] + normals[3 * i + 1] * ahead[1] + normals[3 * i + 2] * ahead[2];
      if (towards > 0) continue; // turned away
      for (let k = 0; k < 4; k++) this.take(corners, 12 * i + 3 * k, k);
      fill(colours[i], normals[3 * i + 2] === 1 ? level : this.walllight(feet[i]));
    }
    for (let i = 0; i < edges.length; i += 6) {
      this.take(edges, i, 0);
      this.take(edges, i + 3, 1);
      this.corners.set(this.raster.stroke(p, 0, 3, 0.9 * this.pen.fine, 0.04));
      fill(palette.edge);
    }
  }

  take(array, at, k) {
    this.put(array[at], array[at + 1], array[at + 2], this.corners, 3 * k);
  }

  // The light on the ground.
  sunlight() {
    const { light } = this.scene.world;
    const [u, v] = [0, 1].map((axis) => this.slopes(axis, light.texel, light.from[axis]));
    return new Shade(light, u, v, false);
  }

  // The light on a wall between two altitudes; on other polygons it is even.
  walllight([foot, top]) {
    if (!(top > foot)) return undefined;
    return new Shade(WALL, [0, 0, 0, 0, 0], this.slopes(2, (top - foot) / WALL_STEPS, foot), false);
  }

  // Point of the world in pixels of the page, and whether something stands before it.
  at([x, y, z]) {
    const q = new Float64Array(3);
    this.put(x, y, z, q, 0);
    const hidden = this.raster.hides(q[0], q[1], q[2] + 0.1);
    return [(q[0] - this.window[0]) / this.pen.fine, (q[1] - this.window[1]) / this.pen.fine, hidden];
  }

  // The face under a point of the canvas: [person, face, number over all], or nothing.
  faceAt(x, y, time) {
    let best, nearest = -Infinity;
    const [px, py] = [x, y].map((v, k) => v * this.pen.fine + this.window[k]);
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
