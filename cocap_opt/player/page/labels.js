// Labels on a picture: numbers of people and drones, names, conflicts, a scale, and the directions of x and y.

import { AMBER, hex, inkOn, RED, words } from "./colours.js";
import { TAU } from "./geometry.js";
import { inOrder } from "./letters.js";
import { rounded } from "./numbers.js";
import { conflictsAt, isCrowd, isThere, nearAt } from "./plans.js";

export const FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif";
const LONGEST = [40, 18], LONGEST_TAKE = 12; // characters of a person's name, with and without room, and of a take's name
const HIGHER = 8; // number of places above each other for a person's label; the first ones are for names
const HIGHER_NAMES = 5;
const ROOMY = 14, FAR = 36; // px between numbers, and largest px of a number from its place
const CORNER = 88; // px, of the corner with the directions of x and y
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
    this.place(time, options);
    this.land();
    this.people();
    this.near(time);
    this.drones(time, options);
    this.conflicts(time);
  }

  // The places of people's and drones' labels, where nothing else may be written.
  place(time, options) {
    this.placePeople(time, options);
    this.placeDrones(time, options);
  }

  // Names of the land, where nothing hides the ground and there is no other label.
  land() {
    const { context, view } = this, discs = this.numbers.map(({ place: [x, y] }) => ({ x, y, wide: 2 * DISC, high: 2 * DISC }));
    const taken = [...this.tags, ...discs];
    context.font = `italic 600 11px ${FONT}`;
    for (const { name, at } of view.data.terrain.land?.names ?? []) {
      const [x, y] = view.at(at), wide = context.measureText(name).width;
      const label = { x, y, wide, high: 13 }, { clientWidth, clientHeight } = view.canvas;
      const isWhole = x >= wide / 2 && x + wide / 2 <= clientWidth && y >= label.high / 2 && y + label.high / 2 <= clientHeight;
      if (!isWhole || view.isHidden(at) || !isClear(label, taken)) continue;
      taken.push(label);
      this.haloed(name, x, y);
    }
  }

  // The name, the number and the take above each person. If another label is there, they are higher
  // or to a side, with a line to the person. Without room for names, only the number is written.
  placePeople(time, options) {
    const { context, view } = this, { clientWidth: width } = view.canvas;
    context.font = `600 10px ${FONT}`;
    this.tags = [];
    view.data.people.forEach((person, j) => {
      if (isCrowd(view.data.people) && !this.isAskedFor(j, time, options)) return;
      const [x, y, z] = view.bodies.person(j, time), [px, py] = view.at([x, y, z + person.height]);
      const tagsOf = (label, levels) => {
        const wide = context.measureText(label).width + 7, room = [wide / 2 + 1, width - wide / 2 - 1];
        const within = (at) => (px > 0 && px < width ? Math.min(Math.max(at, room[0]), room[1]) : at);
        return Array.from({ length: levels }, (_, k) => k).flatMap((k) => [0, 0.5, -0.5].map((side) =>
          ({ label, person, x: within(px + side * wide), y: py - 12.5 - 14 * k, wide, high: 13, to: [px, py], isLed: k > 0 })));
      };
      const labels = LONGEST.map((longest) => labelOf(person, j, longest));
      const names = labels.flatMap((label) => tagsOf(label, HIGHER_NAMES)).map((tag) => ({ ...tag, isFull: true })), numbers = tagsOf(String(j), HIGHER);
      this.tags.push([...names, ...numbers].find((tag) => isClear(tag, this.tags)) ?? numbers[0]);
    });
  }

  // The border has the colour of the person's take; names are above numbers, and lines below both.
  people() {
    for (const { isLed, to, x, y, person } of this.tags) if (isLed) leader(this.context, [x, y], to, person.take ?? words.soft);
    for (const isFull of [undefined, true]) this.tags.filter((tag) => tag.isFull === isFull).forEach((tag) => this.tag(tag));
  }

  // In a crowd, only some people have labels: those picked by the pointer or in the strip, and those
  // whom the picked drone films.
  isAskedFor(j, time, { hovered, person, picked }) {
    const { films, filmed } = this.view.plan;
    return hovered?.person === j || (person !== undefined && filmed?.rows[person]?.person === j)
      || (picked !== undefined && films[picked][Math.round(time)] === j);
  }

  // Likewise only some drones: those at the pointer, picked ones, and those in conflict or close to others.
  isNamed(i, time, { hovered, picked }) {
    const { plan } = this.view;
    return !isCrowd(plan.paths) || i === picked || hovered?.drone === i
      || [...conflictsAt(plan, time), ...nearAt(plan, time)].some(({ robots }) => robots.includes(i));
  }

  tag({ label, person, x, y, wide }) {
    const { context } = this;
    context.font = `600 10px ${FONT}`;
    context.fillStyle = words.halo;
    context.strokeStyle = person.take ?? words.soft;
    context.lineWidth = person.take ? 2 : 1;
    context.beginPath();
    context.roundRect(x - wide / 2, y - 6.5, wide, 13, 3);
    context.fill();
    context.stroke();
    context.fillStyle = words.ink;
    context.fillText(inOrder(label), x, y + 0.5);
  }

  // Numbers in discs above or near the drones, where there is room. They cover people's labels only
  // if there is no room elsewhere.
  placeDrones(time, options) {
    const { view } = this, { picked, alone } = options, { clientWidth: width, clientHeight: height } = view.canvas;
    const order = view.plan.paths.map((_, i) => i).filter((i) => isThere(view.plan, i)).sort((a, b) => (b === picked) - (a === picked));
    this.places = [];
    this.numbers = [];
    for (const i of order) {
      const pose = view.bodies.drone(i, time), [x, y] = view.at(pose);
      this.places.push([i, x, y]);
      if ((alone && i !== picked) || !this.isInside(x, y) || !this.isNamed(i, time, options)) continue;
      const isOn = x > 0 && y > 0 && x < width && y < height, most = [width - DISC - 1, height - DISC - 1];
      const above = isOn ? [x, y - 18].map((at, k) => Math.min(Math.max(at, DISC + 1), most[k])) : [x, y - 18];
      const others = this.numbers.map(({ place }) => place);
      const place = freePlace(...above, others, this.tags) ?? freePlace(...above, others, []);
      if (!place) continue;
      this.places.push([i, ...place]);
      this.numbers.push({ i, at: [x, y], place, isHidden: view.isHidden(pose.slice(0, 3)) });
    }
  }

  drones(time, { picked }) {
    const { context, view } = this;
    if (picked !== undefined && isThere(view.plan, picked)) circle(context, ...view.at(view.bodies.drone(picked, time)), 15, words.ink, 1.6);
    for (const { i, at: [x, y], place, isHidden } of this.numbers) {
      const colour = hex(view.bodies.colours[i]);
      context.globalAlpha = isHidden ? 0.65 : 1;
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
    for (const one of conflictsAt(this.view.plan, time)) this.join(one, time, RED, 2.5);
  }

  near(time) {
    for (const one of nearAt(this.view.plan, time)) this.join(one, time, AMBER, 1.6);
  }

  // A pair of two drones, or of a drone and a person.
  join({ robots, person }, time, colour, thickness) {
    const { context, view } = this, { bodies } = view, who = person === undefined ? [] : [bodies.person(person, time)];
    const [a, b] = [...robots.map((i) => bodies.drone(i, time)), ...who].map((pose) => view.at(pose));
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    context.moveTo(a[0], a[1]);
    context.lineTo(b[0], b[1]);
    context.stroke();
    for (const [x, y] of [a, b]) circle(context, x, y, 13, colour, thickness);
  }

  // A bar for a round number of metres, to the scale of the middle of the picture.
  scale(height) {
    const { context } = this, { scale } = this.view.camera, metres = rounded(80 / scale);
    const [x, y, long] = [14, height - 14, metres * scale];
    context.font = `600 11px ${FONT}`;
    this.haloedLine([[x, y - 4], [x, y], [x + long, y], [x + long, y - 4]]);
    context.textAlign = "left";
    this.haloed(this.view.camera.isAbove ? `${metres} m` : `${metres} m at the centre`, x, y - 14); // clear of the bar's ends
    context.textAlign = "center";
  }

  // The directions of x and y; y is north where the place on the Earth is known.
  axes(width, height) {
    const { right, up } = this.view.camera, foot = [width - 46, this.isLowerFree(width, height) ? height - 40 : 50];
    ["x", this.view.data.isOnEarth ? "y N" : "y"].forEach((name, k) => {
      const along = (far) => [foot[0] + right[k] * far, foot[1] - up[k] * far];
      this.haloedLine([foot, along(24)]);
      this.haloed(name, ...along(36));
    });
  }

  // True if no more happens in the lower right corner of the picture than in the upper one. It is
  // found again only if the camera moves, and not as it follows a drone.
  isLowerFree(width, height) {
    const { camera } = this.view, { azimuth, elevation, scale, centre } = camera;
    const stamp = [azimuth, elevation, scale, ...centre, width, height].join();
    if (stamp !== this.stamp) {
      const aside = camera.points.map((point) => this.view.at(point)).filter(([x]) => x > width - CORNER && x < width);
      const [above, below] = [([, y]) => y > 0 && y < CORNER, ([, y]) => y > height - CORNER && y < height];
      this.isLower = aside.filter(below).length <= aside.filter(above).length;
    }
    this.stamp = stamp;
    return this.isLower;
  }

  // Text and lines that are readable on any ground: dark ones have light edges, and vice versa.
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
export function labelOf({ name, inTake }, number, longest = LONGEST[1]) {
  const more = inTake === null ? "" : cut(inTake, LONGEST_TAKE);
  if (name === null) return more ? `${number} (${more})` : String(number);
  return `${cut(name, longest)} (${more ? `${number}, ${more}` : number})`;
}

const cut = (text, most) => (text.length > most ? `${text.slice(0, most - 1)}…` : text);

// True if a rectangle, given by its middle, overlaps no other one.
function isClear(tag, others) {
  return others.every((other) => 2 * Math.abs(other.x - tag.x) > other.wide + tag.wide
    || 2 * Math.abs(other.y - tag.y) > other.high + tag.high);
}

// The nearest place to (x, y), preferably to the right, that is apart from others and clear of tags;
// nothing if there is none.
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

// A line from a number to its drone, if the number is not above the drone.
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
