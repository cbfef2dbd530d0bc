// What moves: people, drones with their tracks and what their cameras take in, at any time.

const TAU = 2 * Math.PI;
const UNSEEN = "#565c66", WALK = rgb("#c2364a"), SHADOW = rgb("#8d8a82");
const SCALE = ["#472a78", "#8e2f8e", "#cc4778", "#f0804e", "#fdc328", "#fcf6a4"]; // little to much

const SIDES = 28; // of a cylinder

// Colour of px/m2: even steps of its root, which is what J sums.
function seenColour(pixels, most) {
  if (!(pixels > 0)) return UNSEEN;
  const at = Math.min(Math.sqrt(pixels / most), 1) * (SCALE.length - 1);
  const k = Math.min(Math.floor(at), SCALE.length - 2);
  const n = mixed(rgb(SCALE[k]), rgb(SCALE[k + 1]), at - k);
  return "#" + [n & 255, (n >> 8) & 255, (n >> 16) & 255].map((v) => v.toString(16).padStart(2, "0")).join("");
}

// A row between two steps; `turning` are columns that are angles.
function between(rows, time, turning) {
  const t = Math.min(Math.floor(time), rows.length - 1), share = time - t;
  if (!share) return rows[t];
  return rows[t].map((a, i) => {
    const way = rows[t + 1][i] - a;
    return a + share * (turning.includes(i) ? way - TAU * Math.round(way / TAU) : way);
  });
}

const placed = ([x, y, z], [px, py, pz, yaw]) => {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  return [px + x * c - y * s, py + x * s + y * c, pz + z];
};

const ring = (n, radius, x = 0, y = 0, z = 0) =>
  Array.from({ length: n }, (_, k) => [
    x + radius * Math.cos((TAU * k) / n), y + radius * Math.sin((TAU * k) / n), z,
  ]);

// Polygons of a drone of radius 1 that looks along x.
const ROTORS = [[0.7, 0.7], [-0.7, 0.7], [-0.7, -0.7], [0.7, -0.7]].map(([x, y]) => ring(10, 0.46, x, y, 0.16));
const HULL = [ring(8, 0.42, 0, 0, 0.3), ...ring(8, 0.42).map((p, k, all) => {
  const q = all[(k + 1) % 8];
  return [[p[0], p[1], -0.1], [q[0], q[1], -0.1], [q[0], q[1], 0.3], [p[0], p[1], 0.3]];
})];
const NOSE = [[[0.3, -0.26, 0.31], [0.95, 0, 0.31], [0.3, 0.26, 0.31]]];

// Corners of what a camera takes in, as far as it is drawn, around the way it looks.
function sight(drone, [x, y, z, yaw, tilt], length) {
  const towards = (angle, along, up) => {
    const c = Math.cos(yaw), s = Math.sin(yaw), ahead = Math.cos(tilt) + up * Math.sin(tilt);
    const d = drone.rise === null
      ? [Math.cos(yaw + angle), Math.sin(yaw + angle), 0]
      : [c * ahead + s * along, s * ahead - c * along, up * Math.cos(tilt) - Math.sin(tilt)];
    const scale = length / Math.hypot(...d);
    return [x + d[0] * scale, y + d[1] * scale, z + d[2] * scale];
  };
  if (drone.rise === null) { // level, of any opening
    const parts = Math.max(4, Math.ceil(drone.half / 0.2));
    return Array.from({ length: parts + 1 }, (_, k) => towards(drone.half * ((2 * k) / parts - 1), 0, 0));
  }
  const wide = Math.tan(drone.half), high = Math.tan(drone.rise);
  const corners = [[-wide, -high], [wide, -high], [wide, high], [-wide, high]];
  const around = corners.map(([along, up]) => towards(0, along, up));
  return [...around, around[0]];
}

// Draws one plan at one time.
class Bodies {
  constructor(data, plan) {
    this.data = data;
    this.plan = plan;
    this.owners = data.people.flatMap((person, j) => person.faces.map((_, f) => [j, f]));
    this.colours = data.drones.map((drone) => rgb(drone.colour));
  }

  person(j, time) {
    return between(this.data.people[j].poses, time, [3]);
  }

  drone(i, time) {
    return between(this.plan.paths[i], time, [3]);
  }

  // People with their walk so far, faces in the colour of their px/m2 at the step.
  people(view, time) {
    const seen = this.plan.seen[Math.round(time)];
    const poses = this.data.people.map((_, j) => this.person(j, time));
    this.data.people.forEach((person, j) => this.walk(view, person, time, poses[j]));
    this.owners.forEach(([j, f], face) => {
      const corners = this.data.people[j].faces[f].map((p) => placed(p, poses[j]));
      const flat = view.flat(corners);
      if (area(flat) <= 0) return; // turned away
      view.raster.fillMoving(flat, corners.length, rgb(seenColour(seen[face], this.data.most)));
      view.outline(flat, corners.length, INK, 0.8);
    });
  }

  // Where drones are too near to people: upright cylinders.
  keptFrom(view, time) {
    const { aside, above, sky } = this.data.airspace;
    if (aside === null) return;
    this.data.people.forEach((person, j) => {
      const [x, y, z] = this.person(j, time), top = above === null ? sky : z + person.height + above;
      const low = ring(SIDES, aside, x, y, z + 0.05), high = ring(SIDES, aside, x, y, Math.max(top, z));
      view.veil(high, 0.09);
      low.forEach((p, k) => {
        const next = (k + 1) % SIDES;
        view.veil([p, low[next], high[next], high[k]], 0.09);
        for (const end of [low, high]) view.rim(end[k], end[next]);
      });
    });
  }

  walk(view, person, time, pose) {
    const points = [...person.poses.slice(0, Math.floor(time) + 1), pose].map(([x, y, z]) => [x, y, z + 0.05]);
    for (let t = 1; t < points.length; t++) {
      const [a, b] = [points[t - 1], points[t]];
      const half = a.map((v, i) => (v + b[i]) / 2); // dashes
      view.track(a, half, WALK, 1.3);
    }
  }

  tracks(view, time) {
    this.plan.paths.forEach((path, i) => {
      const now = this.drone(i, time), done = Math.floor(time);
      const faint = mixed(PAPER, this.colours[i], 0.45);
      for (let t = 0; t < path.length - 1; t++) {
        if (t < done) view.track(path[t], path[t + 1], this.colours[i], 2);
        else if (t > done) view.track(path[t], path[t + 1], faint, 0.9);
        else {
          view.track(path[t], now, this.colours[i], 2);
          view.track(now, path[t + 1], faint, 0.9);
        }
      }
    });
  }

  drones(view, time) {
    const size = view.droneSize();
    this.plan.paths.forEach((_, i) => {
      const pose = this.drone(i, time), colour = this.colours[i];
      const ground = groundAt(this.data.terrain, pose[0], pose[1]);
      if (ground < pose[2] && view.camera.elevation < 80) {
        const foot = [pose[0], pose[1], ground];
        view.track(pose, foot, SHADOW, 0.8);
        view.fill(ring(8, size * 0.5, pose[0], pose[1], ground + 0.04), SHADOW);
      }
      const put = (points) => points.map((p) => placed(p.map((v) => v * size), pose));
      const dark = mixed(INK, colour, 0.55), bright = mixed(PAPER, colour, 0.55);
      for (const disc of ROTORS) view.fill(put(disc), bright, dark);
      for (const side of HULL) view.fill(put(side), colour, dark);
      for (const side of NOSE) view.fill(put(side), INK);
    });
  }

  // What cameras take in: sides of a pyramid, or a sector of a disc.
  sights(view, time, length) {
    this.data.drones.forEach((drone, i) => {
      const pose = this.drone(i, time), corners = sight(drone, pose, length), level = drone.rise === null;
      const rays = level ? [corners[0], corners[corners.length - 1]] : corners.slice(1);
      for (let k = 1; k < corners.length; k++) {
        const flat = view.flat([pose, corners[k - 1], corners[k]]);
        view.raster.blend(flat, 3, this.colours[i], level ? 0.18 : 0.1);
      }
      for (const corner of rays) view.ray(pose, corner, this.colours[i]);
    });
  }
}

// Twice the area of a flat polygon; positive if its corners go counter-clockwise for the viewer.
function area(flat) {
  let sum = 0;
  for (let i = 0, j = flat.length - 3; i < flat.length; j = i, i += 3) {
    sum += flat[i] * flat[j + 1] - flat[j] * flat[i + 1];
  }
  return sum;
}
