// Everything that moves: people, and drones with their tracks, at any time.

import { CLOSED, mixed, palette, rgb, seenColour } from "./colours.js";
import { ellipse, PERSONS, PHASES, QUADROTORS } from "./figures.js";
import { Flight } from "./flights.js";
import { dot, normalOf, placed, ring } from "./geometry.js";
import { between, colourOf, isCrowd, isThere } from "./plans.js";
import { groundAt } from "./rays.js";

const SIDES = 28; // sides of a cylinder
const SMALLEST = 17; // px, height of a person as it is drawn
// Of a disc: radius as a share of a person's height, and corners
const RING = 0.3, RING_SIDES = 12;
const TRAIL = 5; // number of steps of a track that are drawn in a crowd
const FINE_BODY = 38; // px; bodies of at least this size are drawn in detail

// Draws one plan at one time.
export class Bodies {
  constructor(data, plan) {
    Object.assign(this, { data, plan });
    this.owners = data.people.flatMap((person, j) => person.faces.map((_, f) => [j, f]));
    this.first = data.people.map((_, j) => this.owners.findIndex(([owner]) => owner === j));
    this.walked = data.people.map(({ poses }) => {
      let sum = 0;
      return poses.map(([x, y], t) => (sum += t ? Math.hypot(x - poses[t - 1][0], y - poses[t - 1][1]) : 0));
    });
    this.flights = plan.paths.map((_, i) => new Flight(plan, i));
    this.colours = data.drones.map((_, i) => rgb(colourOf(data, plan, i)));
    this.rings = data.people.map((_, j) => rgb(data.tasks.find(({ people }) => people.includes(j)).colour));
    this.towards = data.people.map(facesTowards);
  }

  person(j, time) {
    return between(this.data.people[j].poses, time);
  }

  drone(i, time) {
    if (time !== this.time) [this.time, this.poses] = [time, []];
    return (this.poses[i] ??= this.flights[i].at(time));
  }

  // Where all drones and people are.
  all(time) {
    const people = this.data.people.map((_, j) => this.person(j, time));
    return [...this.plan.paths.flatMap((path, i) => (path.length ? [this.drone(i, time)] : [])), ...people];
  }

  faceColour(j, f, time) {
    return seenColour(this.plan.seen[Math.round(time)][this.first[j] + f], this.data.most);
  }

  // People, as figures or as the faces that count, in the colours of px/m2 at the step. If there is
  // a crowd of drones, people stand on discs in the colour of their group.
  people(pen, time, { faces }) {
    this.data.people.forEach((_, j) => {
      const pose = this.person(j, time);
      if (this.isCrowd) pen.fill(ring(RING_SIDES, RING * this.tall(pen, j), pose[0], pose[1], pose[2] + 0.01), this.rings[j]);
      if (faces) this.faces(pen, j, pose, time);
      else this.figure(pen, j, pose, time);
    });
  }

  faces(pen, j, pose, time) {
    this.data.people[j].faces.forEach((corners, f) => {
      pen.face(corners.map((p) => placed(p, pose)), this.faceColour(j, f, time), palette.dark);
    });
  }

  // A person's height (m) as drawn.
  tall(pen, j) {
    return Math.max(this.data.people[j].height, (SMALLEST * pen.crowding * pen.fine) / pen.metre);
  }

  // A person whose shirt has, on each side, the colour of the face with the same direction.
  figure(pen, j, pose, time) {
    const size = this.tall(pen, j);
    if (!pen.metreAround(pose, 1.5 * size)) return;
    const isFine = (size * pen.metre) / pen.fine > FINE_BODY, fine = Number(isFine), phase = this.phase(j, time);
    const body = PERSONS[fine][phase], towards = this.towards[j][fine][phase];
    const colours = this.data.people[j].faces.map((_, f) => this.faceColour(j, f, time));
    const colourOf = (k) => (body.parts[k] === "shirt" ? colours[towards[k]] : palette[body.parts[k]]);
    pen.fill(ellipse(8, 0.16 * size, 0.2 * size, 0.02).map((p) => placed(p, pose)), palette.shadow);
    pen.body(body, pose, size, colourOf);
  }

  // The phase of a person's walk cycle.
  phase(j, time) {
    const walked = this.walked[j], t = Math.floor(time), next = walked[Math.min(t + 1, walked.length - 1)];
    if (next === walked[t]) return 0;
    const paces = (0.75 * (walked[t] + (time - t) * (next - walked[t]))) / this.data.people[j].height;
    return Math.floor((paces % 1) * PHASES);
  }

  // Upright cylinders around people, which drones must not enter.
  keptFrom(pen, time) {
    const { aside, above, sky } = this.data.airspace, how = { aside: true };
    if (aside === null) return;
    this.data.people.forEach((person, j) => {
      const [x, y, z] = this.person(j, time), top = above === null ? sky : z + person.height + above;
      const wide = aside + person.swerve;
      const low = ring(SIDES, wide, x, y, z + 0.05), high = ring(SIDES, wide, x, y, Math.max(top, z));
      pen.veil(high, CLOSED, 0.09, how);
      low.forEach((p, k) => {
        const next = (k + 1) % SIDES;
        pen.veil([p, low[next], high[next], high[k]], CLOSED, 0.09, how);
        for (const end of [low, high]) pen.ray(end[k], end[next], CLOSED, 0.5, how);
      });
    });
  }

  // People's walks, in the colours of their takes.
  walks(pen, time) {
    this.data.people.forEach((person, j) => {
      const done = person.poses.slice(this.isCrowd ? Math.max(Math.floor(time) - TRAIL, 0) : 0, Math.floor(time) + 1);
      const points = [...done, this.person(j, time)].map(([x, y, z]) => [x, y, z + 0.05]);
      for (let t = 1; t < points.length; t++) {
        const [a, b] = [points[t - 1], points[t]];
        pen.line(a, a.map((v, i) => (v + b[i]) / 2), person.take ?? palette.walk, 1.3); // dashes
      }
    });
  }

  get isCrowd() {
    return isCrowd(this.plan.paths);
  }

  // Drones' tracks: past, and thinner, future; in a crowd only the most recent steps.
  tracks(pen, time, { picked, alone }) {
    this.plan.paths.forEach((path, i) => {
      if (!path.length || (alone && i !== picked)) return;
      const some = this.isCrowd && i !== picked, now = this.drone(i, time), done = Math.floor(time);
      const colour = this.colours[i], faint = mixed(palette.ground, colour, 0.5);
      const [begin, end] = some ? [Math.max(done - TRAIL, 0), Math.min(done + 1, path.length - 1)] : [0, path.length - 1];
      for (let t = begin; t < end; t++) {
        const way = this.flights[i].way(t), at = t === done ? (time - done) * (way.length - 1) : t < done ? Infinity : 0;
        for (let k = 1; k < way.length; k++) {
          const [a, b] = [way[k - 1], way[k]];
          if (k <= at) pen.line(a, b, colour, 2);
          else if (k - 1 >= at) pen.line(a, b, faint, 1);
          else {
            pen.line(a, now, colour, 2);
            pen.line(now, b, faint, 1);
          }
        }
      }
    });
  }

  // Drones, each with a line to the ground below; if one is shown `alone`, all others are grey.
  drones(pen, time, size, { picked, alone, own = false }) {
    this.plan.paths.forEach((_, i) => {
      if (!isThere(this.plan, i) || (own && i === picked)) return; // a drone does not see itself
      const pose = this.drone(i, time);
      const colour = alone && i !== picked ? mixed(palette.ground, palette.unseen, 0.6) : this.colours[i];
      if (!own) this.thread(pen, pose, size);
      this.quadrotor(pen, pose, size, colour);
    });
  }

  thread(pen, pose, size) {
    const ground = groundAt(this.data.terrain, pose[0], pose[1]);
    if (ground >= pose[2]) return;
    pen.line(pose, [pose[0], pose[1], ground], palette.shadow, 0.8);
    pen.fill(ring(10, size * 0.6, pose[0], pose[1], ground + 0.03), palette.shadow);
  }

  quadrotor(pen, pose, size, colour) {
    const metre = pen.metreAround(pose, 2 * size);
    if (!metre) return;
    const body = QUADROTORS[Number((2 * size * metre) / pen.fine > FINE_BODY)];
    const colours = {
      hull: colour, arm: mixed(palette.dark, colour, 0.45), rotor: mixed(palette.rotor, colour, 0.35), lens: palette.dark,
    };
    pen.body(body, pose, size, (k) => colours[body.parts[k]]);
  }
}

// For simple and fine figures in each phase: for each polygon, the face with the same direction.
function facesTowards({ faces }) {
  const normals = faces.map(normalOf);
  const nearest = (normal) => {
    let best = 0;
    normals.forEach((other, f) => {
      if (dot(normal, other) > dot(normal, normals[best]) + 1e-9) best = f;
    });
    return best;
  };
  return PERSONS.map((bodies) => bodies.map((body) => body.normals.map(nearest)));
}
