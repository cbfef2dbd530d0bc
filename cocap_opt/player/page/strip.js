// The number of drones that see each person: a strip of people and steps below the chart, with a
// description of a person at a step. Pressing goes to the step.

import { fitMargin, fitsMargin, MARGIN } from "./chart.js";
import { words } from "./colours.js";
import { make, PHONE, put } from "./dom.js";
import { FONT } from "./labels.js";
import { inOrder } from "./letters.js";
import { digits, percent } from "./numbers.js";

const SEEN_BY = [ // none, one, two, three or more drones
  { fill: "#b0122b", ink: "#ffffff", name: "0" },
  { fill: "#f2a233", ink: "#20252d", name: "1" },
  { fill: "#a5d3ea", ink: "#20252d", name: "2" },
  { fill: "#1c5c9e", ink: "#ffffff", name: "3+" },
];
const ROWS_HIGH = [3, 14]; // px, smallest and largest height of a row
const STRIP_HIGH = 84, PHONE_HIGH = 56; // px of all rows together, unless rows would be lower than above
const LETTER = 9; // px, smallest size of a cell with room for a number
const NAME_HIGH = 13; // px, height of a name above its row

export class Strip {
  // A press calls `go(step, person)`.
  constructor(data, plan, go) {
    Object.assign(this, { data, plan, rows: plan.filmed?.rows ?? [] });
    this.root = make("div", "filmed");
    this.root.hidden = !this.rows.length;
    if (this.root.hidden) return;
    this.canvas = make("canvas", "strip");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `cameras that see ${this.enough} of each person: ${plan.filmed.line}`);
    this.told = make("span", "told");
    this.told.setAttribute("aria-live", "polite");
    this.root.append(this.head(), this.canvas);
    const press = (event) => {
      if (event.buttons & 1) go(...this.cellAt(event));
    };
    const on = (name, act) => this.canvas.addEventListener(name, act);
    on("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      press(event);
    });
    on("pointermove", (event) => {
      this.under = this.cellAt(event);
      this.tell();
      press(event);
    });
    on("pointerleave", () => {
      this.under = undefined;
      this.tell();
    });
  }

  // The part of a person that a camera must see to count, in words.
  get enough() {
    return `${percent(this.plan.filmed.atLeast)} or more`;
  }

  head() {
    const head = make("div", "about"), keys = make("span", "keys", `cameras that see ${this.enough} of a person`);
    keys.title = `of the solid angle that the person would have with nothing in the way; a camera that sees less does not count. `
      + "P and O pick a person, W goes to the next bad moment";
    for (const { fill, ink, name } of SEEN_BY) {
      const box = make("b", "", name);
      box.style.cssText = `background: ${fill}; color: ${ink}`;
      keys.append(box);
    }
    head.append(keys, this.told);
    return head;
  }

  get width() {
    return this.canvas.clientWidth - MARGIN.left - MARGIN.right;
  }

  get high() {
    const all = window.innerWidth < PHONE ? PHONE_HIGH : STRIP_HIGH;
    return Math.min(Math.max(Math.floor(all / this.rows.length), ROWS_HIGH[0]), ROWS_HIGH[1]);
  }

  // The distance between rows; names that are too long to be beside their rows are above them.
  get pitch() {
    return this.high + (this.isAbove ? NAME_HIGH : 0);
  }

  // The top of a row's cells.
  top(k) {
    return (k + 1) * this.pitch - this.high;
  }

  x(step) {
    return MARGIN.left + (step / (this.data.steps + 1)) * this.width;
  }

  // The step and the row under a pointer.
  cellAt({ offsetX, offsetY }) {
    const step = Math.floor(((offsetX - MARGIN.left) / this.width) * (this.data.steps + 1));
    const row = Math.floor(offsetY / this.pitch);
    return [Math.min(Math.max(step, 0), this.data.steps), Math.min(Math.max(row, 0), this.rows.length - 1)];
  }

  // Make room for names beside the rows, in the strip and in the chart.
  fit() {
    const context = this.canvas?.getContext("2d");
    if (!context) return;
    context.font = `700 10px ${FONT}`;
    const wide = Math.max(...this.rows.map((row) => context.measureText(this.nameOf(row)).width));
    this.isAbove = this.high >= LETTER && !fitsMargin(wide); // if rows are lower, only the picked one has a name
    fitMargin(this.isAbove ? 0 : wide);
  }

  nameOf({ person }) {
    const { name } = this.data.people[person];
    return name === null ? String(person) : `${name} (${person})`;
  }

  draw(time, picked) {
    if (this.root.hidden) return;
    Object.assign(this, { step: Math.round(time), picked: Math.min(picked ?? 0, this.rows.length - 1) });
    const tall = this.pitch * this.rows.length, stamp = [this.step, this.picked, this.width, tall, words.version].join();
    if (stamp !== this.stamp) this.paint(tall);
    this.stamp = stamp;
    this.tell();
  }

  paint(tall) {
    this.canvas.style.height = `${tall}px`;
    const pixels = window.devicePixelRatio || 1, wide = this.canvas.clientWidth;
    [this.canvas.width, this.canvas.height] = [Math.round(wide * pixels), Math.round(tall * pixels)];
    const context = this.canvas.getContext("2d");
    context.setTransform(pixels, 0, 0, pixels, 0, 0);
    this.rows.forEach((row, k) => this.paintRow(context, row, k));
    context.strokeStyle = words.ink;
    context.lineWidth = 1.5;
    const [tops, high] = this.isAbove ? [this.rows.map((_, k) => this.top(k)), this.high] : [[0], tall];
    for (const y of tops) context.strokeRect(this.x(this.step) + 0.5, y + 0.75, Math.max(this.x(1) - this.x(0) - 1, 1), high - 1.5);
  }

  paintRow(context, row, k) {
    const y = this.top(k), gap = this.high > 5 ? 1 : 0;
    this.paintName(context, row, k);
    row.views.forEach((views, step) => {
      const kind = Math.min(views, 3), left = this.x(step), wide = this.x(step + 1) - left;
      context.globalAlpha = row.counts[step] ? 1 : 0.25;
      context.fillStyle = SEEN_BY[kind].fill;
      context.fillRect(left, y, Math.max(wide - (wide > 4 ? 1 : 0), 1), this.high - gap);
      if (wide >= LETTER && this.high >= LETTER) this.paintNumber(context, views, row.counts[step], left + (wide - 1) / 2, y);
      else if (kind < 2) this.hatch(context, kind, [left, y, wide, this.high - gap]);
    });
    context.globalAlpha = 1;
  }

  // On pale cells, numbers are as dark as other text, so that they can be read, and thinner.
  paintNumber(context, views, counts, middle, y) {
    context.globalAlpha = 1;
    context.font = `${counts ? 600 : 400} ${Math.min(this.high - 3, 10)}px ${FONT}`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = counts ? SEEN_BY[Math.min(views, 3)].ink : words.ink;
    context.fillText(String(views), middle, y + this.high / 2);
  }

  // Without room for numbers, cells for no drone have dark strokes, cells for one a light line.
  hatch(context, kind, [left, y, wide, high]) {
    context.fillStyle = kind ? "#ffffff" : "#20000a";
    if (kind) context.fillRect(left, y + (high - 1) / 2, wide, 1);
    else for (let x = left; x < left + wide; x += 3) context.fillRect(x, y, 1, high);
  }

  // The number, and as much of the name as there is room for; the row's description has its take.
  paintName(context, row, k) {
    if (this.high < LETTER && k !== this.picked) return;
    const letters = [...(this.data.people[row.person].name ?? "")];
    const room = this.isAbove ? this.canvas.clientWidth - 2 * MARGIN.right : MARGIN.left - 10;
    context.font = `${k === this.picked ? "700 " : ""}10px ${FONT}`;
    context.textAlign = this.isAbove ? "left" : "right";
    context.textBaseline = "middle";
    context.fillStyle = k === this.picked ? words.ink : words.soft;
    let text = this.nameOf(row);
    while (letters.length > 1 && context.measureText(text).width > room) text = `${(letters.pop(), letters.join(""))}… (${row.person})`;
    if (this.isAbove) return context.fillText(inOrder(text), MARGIN.right, k * this.pitch + NAME_HIGH / 2 + 1);
    const half = Math.max(5 - this.high / 2, 0), middle = (k + 0.5) * this.high;
    context.fillText(inOrder(text), MARGIN.left - 6, Math.min(Math.max(middle, half + 5), this.high * this.rows.length - 5));
  }

  // Describe the cell under the pointer, or the picked person at the present step.
  tell() {
    const [step, k] = this.under ?? [this.step, this.picked];
    put(this.told, filmedWords(this.rows[k], step, this.plan.filmed.atLeast));
  }
}

export function filmedWords(row, step, atLeast) {
  const views = row.views[step], [angle, error] = [row.angles[step], row.errors[step]];
  const count = views ? `${views} camera${views === 1 ? "" : "s"}` : noneWords(row.best[step], row.most[step], atLeast);
  const who = `${row.name}, step ${step}: ${count}`;
  const apart = angle === null ? "" : `, ${digits(angle, 0)}° apart`;
  const within = error === null ? (views < 2 ? "" : ": not measurable") : `, ${digits(error, error < 10 ? 1 : 0)} mm`;
  return `${who}${apart}${within}${row.counts[step] ? "" : ", not counted"}`;
}

// States that no camera sees enough, and what the best one sees.
function noneWords(drone, share, atLeast) {
  if (!share) return "no camera sees them";
  // Rounded down, so that it never looks like enough
  const seen = share < 0.01 ? "less than 1 %" : `${Math.floor(100 * share + 1e-6)} %`;
  return `no camera sees as much as ${percent(atLeast)}; drone ${drone} sees the most, ${seen}`;
}

// Steps at which fewer than two drones see a person who counts.
export const badSteps = ({ filmed }) => (filmed?.rows ?? []).flatMap((row) =>
  row.views.flatMap((views, step) => (views < 2 && row.counts[step] ? [step] : [])));
