// What is written on a picture: numbers of people and drones, names, conflicts, a scale, and where x leads.

import { AMBER, hex, inkOn, RED, words } from "./colours.js";
import { TAU } from "./geometry.js";
import { rounded } from "./numbers.js";
import { conflictsAt, isCrowd, isThere, nearAt } from "./plans.js";

export const FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif";
const LONGEST = 18, LONGEST_TAKE = 12; // characters of a person's name, and of a take's
const HIGHER = 8; // places above each other for the number of a person
const ROOMY = 14, FAR = 36; // px between numbers, and from where a number should be
const DISC = 7.5; // px, radius of a number

export class Labels {
  constructor(view) {
    this.view = view;
  }

  write(context, time, width, height, options) {
    this.context = context;
    context.textAlign = "center";
    context.textBaseline = "middle";
    this.scale(height);
    this.axes(width, height);
    this.people(time, options);
    this.land();
    this.near(time);
    this.drones(time, options);
    this.conflicts(time);
  }

  // Names of the land, where neither something hides the ground nor the tag of a person would be.
  land() {
    const { context, view } = this;
    context.font = `italic 600 11px ${FONT}`;
    for (const { name, at } of view.data.terrain.land?.names ?? []) {
      const [x, y] = view.at(at), wide = context.measureText(name).width;
      const isWhole = x >= wide / 2 && x + wide / 2 <= view.canvas.clientWidth && this.isInside(x, y);
      if (isWhole && !view.isHidden(at) && isClear({ x, y, wide, high: 13 }, this.tags)) this.haloed(name, x, y);
    }
  }

  // Above each person the name, the number and the take, where they cover nobody else's; else the
  // number alone, a little higher where there is room, and under the names. The border has the
  // colour of the person's take.
  people(time, options) {
    const { context, view } = this;
    context.font = `600 10px ${FONT}`;
    this.tags = [];
    view.data.people.forEach((person, j) => {
      if (isCrowd(view.data.people) && !this.isAskedFor(j, time, options)) return;
      const [x, y, z] = view.bodies.person(j, time), [px, py] = view.at([x, y, z + person.height]);
      const tagOf = (label, up = 0) =>
        ({ label, person, x: px, y: py - 12.5 - up, wide: context.measureText(label).width + 7, high: 13 });
      const full = { ...tagOf(labelOf(person, j)), isFull: true }, short = String(j);
      const higher = Array.from({ length: HIGHER }, (_, k) => tagOf(short, 14 * k));
      this.tags.push(isClear(full, this.tags) ? full : higher.find((tag) => isClear(tag, this.tags)) ?? tagOf(short));
    });
    for (const isFull of [undefined, true]) this.tags.filter((tag) => tag.isFull === isFull).forEach((tag) => this.tag(tag));
  }

  // In a crowd only some people have labels: whom the pointer or the strip picks, and whom the
  // picked drone films.
  isAskedFor(j, time, { hovered, person, picked }) {
    const { films, filmed } = this.view.plan;
    return hovered?.person === j || (person !== undefined && filmed?.rows[person]?.person === j)
      || (picked !== undefined && films[picked][Math.round(time)] === j);
  }

  // And so with drones: whom the pointer or a press picks, and those in conflict or close to others.
  isNamed(i, time, { hovered, picked }) {
    const { plan } = this.view;
    return !isCrowd(plan.paths) || i === picked || hovered?.drone === i
      || [...conflictsAt(plan, time), ...nearAt(plan, time)].some(({ robots }) => robots.includes(i));
  }

  tag({ label, person, x, y, wide }) {
    const { context } = this;
    context.fillStyle = words.halo;
    context.strokeStyle = person.take ?? words.soft;
    context.lineWidth = person.take ? 2 : 1;
    context.beginPath();
    context.roundRect(x - wide / 2, y - 6.5, wide, 13, 3);
    context.fill();
    context.stroke();
    context.fillStyle = words.ink;
    context.fillText(label, x, y + 0.5);
  }

  // Numbers in discs above the drones, or near there, where there is room for them. They cover
  // people's labels only where there is no room elsewhere.
  drones(time, options) {
    const { context, view } = this, put = [], { picked, alone } = options;
    const order = view.plan.paths.map((_, i) => i).filter((i) => isThere(view.plan, i)).sort((a, b) => (b === picked) - (a === picked));
    this.places = [];
    for (const i of order) {
      const pose = view.bodies.drone(i, time), [x, y] = view.at(pose), colour = hex(view.bodies.colour(i, picked));
      this.places.push([i, x, y]);
      if (i === picked) circle(context, x, y, 15, words.ink, 1.6);
      if ((alone && i !== picked) || !this.isInside(x, y) || !this.isNamed(i, time, options)) continue;
      const place = freePlace(x, y - 18, put, this.tags) ?? freePlace(x, y - 18, put, []);
      if (!place) continue;
      put.push(place);
      this.places.push([i, ...place]);
      context.globalAlpha = view.isHidden(pose.slice(0, 3)) ? 0.65 : 1;
      if (Math.hypot(place[0] - x, place[1] - y + 18) > 1) leader(context, place, [x, y], colour);
      this.number(i, place, colour, i === picked);
    }
    context.globalAlpha = 1;
  }

  isInside(x, y) {
    const { clientWidth: width, clientHeight: height } = this.view.canvas;
    return x > -FAR && y > -FAR && x < width + FAR && y < height + FAR;
  }

  number(i, [x, y], colour, isPicked) {
    const { context } = this;
    disc(context, x, y, isPicked ? 10 : DISC, colour, isPicked ? words.ink : "#fff");
    context.font = `600 ${isPicked ? 12 : 10}px ${FONT}`;
    context.fillStyle = inkOn(colour);
    context.fillText(String(i), x, y + 0.5);
  }

  conflicts(time) {
    for (const { robots } of conflictsAt(this.view.plan, time)) this.join(robots, time, RED, 2.5);
  }

  near(time) {
    for (const { robots } of nearAt(this.view.plan, time)) this.join(robots, time, AMBER, 1.6);
  }

  join(robots, time, colour, thickness) {
    const { context, view } = this, [a, b] = robots.map((i) => view.at(view.bodies.drone(i, time)));
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    context.moveTo(a[0], a[1]);
    context.lineTo(b[0], b[1]);
    context.stroke();
    for (const [x, y] of [a, b]) circle(context, x, y, 13, colour, thickness);
  }

  // A bar of a round number of metres, as long as they are in the middle of the picture.
  scale(height) {
    const { context } = this, { scale } = this.view.camera, metres = rounded(80 / scale);
    const [x, y, long] = [14, height - 14, metres * scale];
    context.font = `600 11px ${FONT}`;
    this.haloedLine([[x, y - 4], [x, y], [x + long, y], [x + long, y - 4]]);
    context.textAlign = "left";
    this.haloed(this.view.camera.isAbove ? `${metres} m` : `${metres} m mid-picture`, x, y - 10);
    context.textAlign = "center";
  }

  // Where x and y lead; y is north.
  axes(width, height) {
    const { right, up } = this.view.camera, foot = [width - 46, height - 40];
    ["x", "y N"].forEach((name, k) => {
      const along = (far) => [foot[0] + right[k] * far, foot[1] - up[k] * far];
      this.haloedLine([foot, along(24)]);
      this.haloed(name, ...along(36));
    });
  }

  // Writing and lines can be read on any ground: dark ones stand on light edges, and the reverse.
  haloed(text, x, y) {
    const { context } = this;
    context.strokeStyle = words.halo;
    context.fillStyle = words.ink;
    context.lineWidth = 4;
    context.lineJoin = "round";
    context.strokeText(text, x, y);
    context.fillText(text, x, y);
  }

  haloedLine(points) {
    const { context } = this;
    context.beginPath();
    for (const point of points) context.lineTo(...point);
    for (const [colour, thickness] of [[words.halo, 4.5], [words.ink, 1.5]]) {
      context.strokeStyle = colour;
      context.lineWidth = thickness;
      context.stroke();
    }
  }

  // The drone at a point of the canvas, or nothing.
  droneAt(x, y) {
    const [best] = (this.places ?? []).map(([i, px, py]) => [i, Math.hypot(px - x, py - y)]).sort((a, b) => a[1] - b[1]);
    return best && best[1] < 16 ? best[0] : undefined;
  }
}

// A person's name, if there is one, the number, and the take.
export function labelOf({ name, inTake }, number) {
  const more = inTake === null ? "" : cut(inTake, LONGEST_TAKE);
  if (name === null) return more ? `${number} (${more})` : String(number);
  return `${cut(name, LONGEST)} (${more ? `${number}, ${more}` : number})`;
}

const cut = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);

// True if a rectangle around its middle meets none of others.
function isClear(tag, others) {
  return others.every((other) => 2 * Math.abs(other.x - tag.x) > other.wide + tag.wide
    || 2 * Math.abs(other.y - tag.y) > other.high + tag.high);
}

// The nearest place to (x, y), to the right if it can, that is apart from others and clear of
// tags; or nothing.
export function freePlace(x, y, others, tags) {
  for (let radius = 0; radius <= FAR; radius += 4) {
    for (const turn of [0, 4, 6, 7, 5, 1, 3, 2]) {
      const angle = (turn * Math.PI) / 4;
      const [px, py] = [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
      const isApart = others.every(([qx, qy]) => Math.hypot(qx - px, qy - py) >= ROOMY);
      if (isApart && isClear({ x: px, y: py, wide: 2 * DISC, high: 2 * DISC }, tags)) return [px, py];
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
  circle(context, x, y, radius, border, 1.2);
}

function circle(context, x, y, radius, colour, thickness) {
  context.beginPath();
  context.arc(x, y, radius, 0, TAU);
  context.strokeStyle = colour;
  context.lineWidth = thickness;
  context.stroke();
}
