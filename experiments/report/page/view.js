// One plan in a canvas: the camera, the picture, and what is written on it.

const DEGREE = Math.PI / 180;
const FINE = 2, COARSE = 1; // samples per pixel of the page along x and y
const MOST_SAMPLES = 3.2e6;
const RED = "#d0021b";
const HATCH = 9; // px from line to line

class Camera {
  constructor(data) {
    this.data = data;
    this.fitted = false;
    this.space();
  }

  space() {
    [this.azimuth, this.elevation] = [62, 48];
    this.fitted = false;
  }

  top() {
    [this.azimuth, this.elevation] = [90, 90];
    this.fitted = false;
  }

  update() {
    const a = this.azimuth * DEGREE, e = this.elevation * DEGREE;
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    this.right = [sa, -ca, 0];
    this.up = [ca * se, sa * se, ce];
    this.ahead = [ca * ce, sa * ce, -se];
  }

  // Put all that happens into a canvas of this size.
  fit(width, height) {
    this.update();
    const [[x0, y0, z0], [x1, y1, z1]] = this.data.scope;
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const p of [x0, x1].flatMap((x) => [y0, y1].flatMap((y) => [z0, z1].map((z) => [x, y, z])))) {
      [this.right, this.up].forEach((axis, k) => {
        const along = dot(p, axis);
        low[k] = Math.min(low[k], along);
        high[k] = Math.max(high[k], along);
      });
    }
    this.scale = Math.min((width - 36) / (high[0] - low[0]), (height - 44) / (high[1] - low[1]));
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2];
    this.fitted = true;
  }

  orbit(dx, dy) {
    this.azimuth -= dx * 0.4;
    this.elevation = Math.min(Math.max(this.elevation + dy * 0.3, 8), 90);
  }

  pan(dx, dy) {
    this.centre = this.centre.map((v, k) => v - (dx * this.right[k] - dy * this.up[k]) / this.scale);
  }

  // Zoom about a point of the canvas, given from its middle.
  zoom(factor, x, y) {
    this.pan(-x, -y);
    this.scale *= factor;
    this.pan(x, y);
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

class View {
  constructor(data, plan, world, camera, canvas) {
    Object.assign(this, { data, plan, world, camera, canvas });
    this.raster = new Raster();
    this.bodies = new Bodies(data, plan);
    this.corners = new Float64Array(12);
    this.stamp = "";
  }

  // Point of the world as x, y in samples and w in m towards the viewer.
  put(p, into, at) {
    const { right, up, ahead } = this.camera, k = this.scale, c = this.camera.centre;
    const x = p[0] - c[0], y = p[1] - c[1], z = p[2] - c[2];
    into[at] = this.raster.width / 2 + k * (x * right[0] + y * right[1]);
    into[at + 1] = this.raster.height / 2 - k * (x * up[0] + y * up[1] + z * up[2]);
    into[at + 2] = -(x * ahead[0] + y * ahead[1] + z * ahead[2]);
  }

  flat(points) {
    const flat = new Float64Array(3 * points.length);
    points.forEach((p, i) => this.put(p, flat, 3 * i));
    return flat;
  }

  fill(points, colour, border) {
    const flat = this.flat(points);
    this.raster.fillMoving(flat, points.length, colour);
    if (border !== undefined && area(flat) > 0) this.outline(flat, points.length, border, 0.7);
  }

  outline(flat, n, colour, thickness) {
    for (let i = 0, j = n - 1; i < n; j = i++) {
      const q = this.raster.stroke(flat, 3 * j, 3 * i, thickness * this.quality, 0.02);
      this.raster.fillMoving(q, 4, colour);
    }
  }

  track(a, b, colour, thickness) {
    const q = this.raster.stroke(this.flat([a, b]), 0, 3, thickness * this.quality, 0.03);
    this.raster.fillMoving(q, 4, colour);
  }

  ray(a, b, colour, how) {
    const q = this.raster.stroke(this.flat([a, b]), 0, 3, 0.8 * this.quality, 0);
    this.raster.blend(q, 4, colour, 0.5, how);
  }

  // A polygon of what is closed to drones.
  veil(points, share, hatch = 0) {
    this.raster.blend(this.flat(points), points.length, CLOSED, share, { aside: true, hatch });
  }

  rim(a, b) {
    this.ray(a, b, CLOSED, { aside: true });
  }

  // Radius of a drone (m): its own, but never so small that nobody sees it.
  droneSize() {
    return Math.max(0.35, (7 * this.quality) / this.scale);
  }

  draw(time, options) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    if (!this.camera.fitted) this.camera.fit(width, height);
    this.camera.update();
    this.prepare(width, height, options);
    const raster = this.raster;
    raster.begin();
    if (options.tracks) this.bodies.tracks(this, time);
    this.bodies.people(this, time);
    this.bodies.drones(this, time);
    raster.compose();
    if (options.closed && this.data.airspace) this.closed(time);
    if (options.sights) this.bodies.sights(this, time, this.data.reach);
    const context = this.canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(raster.finish(), 0, 0, this.canvas.width, this.canvas.height);
    context.setTransform(this.canvas.width / width, 0, 0, this.canvas.height / height, 0, 0);
    this.write(context, time, width, height);
  }

  // Where drones may not fly: see-through, so that it hides nothing. From above the ceiling is all
  // over the picture.
  closed(time) {
    this.see(this.world.zones, 0.34, Math.round(HATCH * this.quality));
    this.see(this.world.lid, this.camera.elevation < 80 ? 0.05 : 0);
    this.bodies.keptFrom(this, time);
  }

  see({ corners, edges }, share, hatch) {
    const at = (array, k) => [array[k], array[k + 1], array[k + 2]];
    for (let i = 0; i < corners.length; i += 12) this.veil([0, 3, 6, 9].map((k) => at(corners, i + k)), share, hatch);
    for (let i = 0; i < edges.length; i += 6) this.rim(at(edges, i), at(edges, i + 3));
  }

  // What stands still is drawn again only where the camera has moved.
  prepare(width, height, { quality: wanted, solid }) {
    const pixels = window.devicePixelRatio || 1;
    this.quality = Math.max(Math.min(wanted, Math.sqrt(MOST_SAMPLES / (width * height))), 0.5);
    this.scale = this.camera.scale * this.quality;
    const size = [Math.round(width * pixels), Math.round(height * pixels)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    const { azimuth, elevation, centre } = this.camera;
    const stamp = [width, height, azimuth, elevation, this.scale, solid, ...centre].join();
    if (stamp === this.stamp) return;
    this.stamp = stamp;
    this.raster.resize(Math.round(width * this.quality), Math.round(height * this.quality));
    this.raster.clear(PAPER, solid);
    this.still(this.world.ground, this.raster.ground);
    this.still(this.world.things, this.raster.glass);
    this.raster.settle();
  }

  still({ corners, normals, colours, edges }, layer) {
    const { raster, camera: { ahead } } = this, p = this.corners, from = [0, 0, 0];
    const take = (array, at, k) => {
      from[0] = array[at]; from[1] = array[at + 1]; from[2] = array[at + 2];
      this.put(from, p, 3 * k);
    };
    for (let i = 0; i < colours.length; i++) {
      const towards = normals[3 * i] * ahead[0] + normals[3 * i + 1] * ahead[1] + normals[3 * i + 2] * ahead[2];
      if (towards > 0) continue; // turned away
      for (let k = 0; k < 4; k++) take(corners, 12 * i + 3 * k, k);
      raster.fillStill(layer, p, 4, colours[i]);
    }
    for (let i = 0; i < edges.length; i += 6) {
      take(edges, i, 0);
      take(edges, i + 3, 1);
      raster.fillStill(layer, raster.stroke(p, 0, 3, 0.9 * this.quality, 0.04), 4, EDGE);
    }
  }

  // Point of the world in pixels of the page, and whether something stands before it.
  at(p) {
    const q = new Float64Array(3);
    this.put(p, q, 0);
    const hidden = this.raster.hides(q[0], q[1], q[2] + 0.1);
    return [q[0] / this.quality, q[1] / this.quality, hidden];
  }

  write(context, time, width, height) {
    context.textAlign = "center";
    context.textBaseline = "middle";
    this.writeScale(context, width, height);
    this.writePeople(context, time);
    this.writeDrones(context, time);
    this.writeConflicts(context, time);
  }

  writePeople(context, time) {
    context.font = "600 11px system-ui, sans-serif";
    context.lineWidth = 3;
    this.data.people.forEach((person, j) => {
      const [x, y, z] = this.bodies.person(j, time), [px, py] = this.at([x, y, z + person.height]);
      context.strokeStyle = "rgba(255,255,255,.9)";
      context.fillStyle = "#8d1427";
      context.strokeText(String(j), px, py - 8);
      context.fillText(String(j), px, py - 8);
    });
  }

  // Numbers in discs above the drones, or near there, where there is room for them.
  writeDrones(context, time) {
    context.font = "600 10px system-ui, sans-serif";
    const put = [];
    this.plan.paths.forEach((_, i) => {
      const [x, y, hidden] = this.at(this.bodies.drone(i, time)), colour = this.data.drones[i].colour;
      const place = freePlace(x, y - 16, put);
      if (!place) return;
      put.push(place);
      context.globalAlpha = hidden ? 0.6 : 1;
      if (Math.hypot(place[0] - x, place[1] - y + 16) > 1) leader(context, place, [x, y], colour);
      disc(context, ...place, 7.5, colour, "#fff");
      context.fillStyle = "#fff";
      context.fillText(String(i), place[0], place[1] + 0.5);
      context.globalAlpha = 1;
    });
  }

  writeConflicts(context, time) {
    for (const { robots } of conflictsAt(this.plan, time)) {
      const [a, b] = robots.map((i) => this.at(this.bodies.drone(i, time)));
      context.strokeStyle = RED;
      context.lineWidth = 2.5;
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.stroke();
      for (const [x, y] of [a, b]) {
        context.beginPath();
        context.arc(x, y, 13, 0, TAU);
        context.stroke();
      }
    }
  }

  // A bar of a round number of metres, and where x and y lead.
  writeScale(context, width, height) {
    const { scale, right, up } = this.camera, metres = rounded(80 / scale);
    const [x, y, long] = [14, height - 14, metres * scale];
    context.strokeStyle = context.fillStyle = "#5b616b";
    context.lineWidth = 1.5;
    context.font = "11px system-ui, sans-serif";
    context.beginPath();
    context.moveTo(x, y - 4);
    context.lineTo(x, y);
    context.lineTo(x + long, y);
    context.lineTo(x + long, y - 4);
    context.stroke();
    context.fillText(`${metres} m`, x + long / 2, y - 9);
    const foot = [width - 34, height - 26];
    ["x", "y"].forEach((name, k) => {
      const [dx, dy] = [right[k] * 18, -up[k] * 18];
      context.beginPath();
      context.moveTo(...foot);
      context.lineTo(foot[0] + dx, foot[1] + dy);
      context.stroke();
      context.fillText(name, foot[0] + dx * 1.4, foot[1] + dy * 1.4);
    });
  }

  // The face under a point of the canvas: [person, face, number over all], or nothing.
  faceAt(x, y, time) {
    let best, nearest = -Infinity;
    this.bodies.owners.forEach(([j, f], face) => {
      const pose = this.bodies.person(j, time);
      const flat = this.flat(this.data.people[j].faces[f].map((p) => placed(p, pose)));
      const w = (flat[2] + flat[5] + flat[8]) / 3;
      if (area(flat) > 0 && w > nearest && inside(flat, x * this.quality, y * this.quality)) {
        [best, nearest] = [[j, f, face], w];
      }
    });
    return best;
  }
}

const APART = 14, FAR = 36; // px between numbers, and from where a number should be

// The nearest place to (x, y), to the right if it can, that is apart from others; or nothing.
function freePlace(x, y, others) {
  for (let radius = 0; radius <= FAR; radius += 4) {
    for (const turn of [0, 4, 6, 7, 5, 1, 3, 2]) {
      const angle = (turn * Math.PI) / 4;
      const [px, py] = [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
      if (others.every(([qx, qy]) => Math.hypot(qx - px, qy - py) >= APART)) return [px, py];
    }
  }
  return undefined;
}

// From a number to its drone, as it does not stand above it.
function leader(context, from, to, colour) {
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.strokeStyle = colour;
  context.lineWidth = 1.2;
  context.stroke();
}

function disc(context, x, y, radius, colour, border) {
  context.beginPath();
  context.arc(x, y, radius, 0, TAU);
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = border;
  context.lineWidth = 1.2;
  context.stroke();
}

// Whether a point is inside a convex polygon that goes counter-clockwise for the viewer.
function inside(flat, x, y) {
  for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
    const side = (flat[i] - flat[j]) * (y - flat[j + 1]) - (flat[i + 1] - flat[j + 1]) * (x - flat[j]);
    if (side > 0) return false;
  }
  return true;
}

// Conflicts at a time: in a cell around the step, in a swap from one step to the next.
function conflictsAt(plan, time) {
  return plan.conflicts.filter(({ step, between }) =>
    between ? time >= step && time <= step + 1 : Math.round(time) === step);
}

// The largest of 1, 2, 5, 10, .. and 0.5, 0.2, .. that is not larger.
function rounded(value) {
  if (!(value > 0)) return 0;
  const ten = 10 ** Math.floor(Math.log10(value) + 1e-9);
  return Number(([5, 2, 1].find((k) => k * ten <= value * (1 + 1e-9)) * ten).toPrecision(3));
}
