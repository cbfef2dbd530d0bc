// Reward per step as bars, with marks above them; pressing goes to the mark or the step.

import { AMBER, OTHER, RED, VIOLET, words } from "./colours.js";
import { TAU } from "./geometry.js";
import { FONT } from "./labels.js";
import { MOST_WORDS, percent, rounded, several, short } from "./numbers.js";
import { colourOf } from "./plans.js";

export const MARGIN = { left: 46, right: 10, top: 26, bottom: 20 };
// Margin: smallest and largest px, and largest share of the window
const LEFT = [46, 150, 0.22];
const MARK_ROW = { conflict: 8, near: 8, costly: 18 }; // px from the top
const TOUCH = 9; // px around a mark
const TICK = 14; // px between two numbers

const widest = () => Math.min(LEFT[1], LEFT[2] * window.innerWidth);

// True if names of a width fit into the margin.
export const fitsMargin = (wide) => wide + 12 <= Math.max(LEFT[0], widest());

// Makes the margin as wide as the names.
export function fitMargin(wide) {
  MARGIN.left = Math.max(LEFT[0], Math.min(wide + 12, widest()));
}

// The distance between numbers on an axis: round, and large enough to read them.
function tickGap(most, long) {
  let gap = rounded(most / 1.9);
  while (gap < most && (long * gap) / most < TICK) gap = rounded(2.5 * gap); // 1, 2, 5, 10, ..
  return gap;
}

export class Chart {
  constructor(data, plan, other, canvas, go) {
    Object.assign(this, { data, plan, other, canvas });
    this.marks = marksOf(plan);
    const press = (event) => {
      if (event.buttons & 1) go(this.timeAt(event));
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      press(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      canvas.title = this.wordsAt(event);
      press(event);
    });
  }

  get width() {
    return this.canvas.clientWidth - MARGIN.left - MARGIN.right;
  }

  // The middle of a step's bar.
  x(step) {
    return MARGIN.left + ((step + 0.5) / (this.data.steps + 1)) * this.width;
  }

  timeAt(event) {
    const step = Math.floor(((event.offsetX - MARGIN.left) / this.width) * (this.data.steps + 1));
    return this.markAt(event)?.time ?? Math.min(Math.max(step, 0), this.data.steps);
  }

  markAt({ offsetX, offsetY }) {
    const far = ({ time, kind }) => Math.hypot(this.x(time) - offsetX, MARK_ROW[kind] - offsetY);
    const nearest = this.marks.reduce((a, b) => (a && far(a) <= far(b) ? a : b), undefined);
    return nearest && far(nearest) <= TOUCH ? nearest : undefined;
  }

  // Explains the marks of a kind at one moment.
  wordsAt(event) {
    const found = this.markAt(event);
    const alike = this.marks.filter(({ kind, time }) => kind === found?.kind && time === found.time);
    return several(alike.map((mark) => mark.words), MOST_WORDS);
  }

  draw(time, picked) {
    const pixels = window.devicePixelRatio || 1, { clientWidth: w, clientHeight: h } = this.canvas;
    const size = [Math.round(w * pixels), Math.round(h * pixels)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) [this.canvas.width, this.canvas.height] = size;
    const context = this.canvas.getContext("2d");
    context.setTransform(pixels, 0, 0, pixels, 0, 0);
    context.clearRect(0, 0, w, h);
    context.font = `11px ${FONT}`;
    const long = h - MARGIN.top - MARGIN.bottom, most = this.data.mostReward || 1;
    const y = (reward) => MARGIN.top + long * (1 - reward / most);
    this.ticks(context, y, most, w);
    this.bars(context, y, Math.round(time));
    if (picked !== undefined) this.added(context, y, picked);
    if (this.other) this.outline(context, y);
    if (this.plan.gap?.losses.length) this.losses(context, h - MARGIN.bottom + 1);
    for (const mark of this.marks) this.mark(context, mark);
    context.fillStyle = words.ink;
    context.fillRect(this.x(time) - 0.75, 3, 1.5, h - MARGIN.bottom - 3);
  }

  ticks(context, y, most, w) {
    context.textAlign = "right";
    context.textBaseline = "middle";
    const gap = this.data.mostReward ? tickGap(most, y(0) - y(most)) : Infinity;
    for (let value = 0; value <= most; value += gap) {
      context.fillStyle = words.line;
      context.fillRect(MARGIN.left, Math.round(y(value)), w - MARGIN.left - MARGIN.right, 1);
      context.fillStyle = words.soft;
      context.fillText(short(value), MARGIN.left - 6, y(value));
    }
    const fits = context.measureText("J per step").width <= MARGIN.left - 2;
    context.fillText(fits ? "J per step" : "J/step", MARGIN.left - 2, 9);
    context.textAlign = "center";
    context.textBaseline = "top";
    const every = Math.max(1, rounded(Math.max(1, (34 * this.data.steps) / this.width) * 1.99));
    for (let step = 0; step <= this.data.steps; step += every) {
      context.fillText(String(step), this.x(step), this.canvas.clientHeight - MARGIN.bottom + 6);
    }
  }

  get barWidth() {
    return Math.max((this.width / (this.data.steps + 1)) * 0.78, 1);
  }

  bars(context, y, now) {
    this.plan.rewards.forEach((reward, step) => {
      context.fillStyle = step <= now ? words.done : words.ahead;
      context.fillRect(this.x(step) - this.barWidth / 2, y(reward), this.barWidth, y(0) - y(reward));
    });
  }

  // The reward that the picked drone adds at a step.
  added(context, y, picked) {
    context.fillStyle = colourOf(this.data, this.plan, picked);
    (this.plan.adds[picked] ?? []).forEach((reward, step) => {
      context.fillRect(this.x(step) - this.barWidth / 2, y(reward), this.barWidth, y(0) - y(reward));
    });
  }

  // The other plan's rewards, as steps.
  outline(context, y) {
    const half = this.width / (this.data.steps + 1) / 2;
    context.strokeStyle = OTHER;
    context.lineWidth = 1.3;
    context.beginPath();
    this.other.rewards.forEach((reward, step) => {
      if (step < this.data.first) return;
      context.lineTo(this.x(step) - half, y(reward));
      context.lineTo(this.x(step) + half, y(reward));
    });
    context.stroke();
  }

  // A strip below the bars: the more violet, the higher the loss by the moves after a step.
  losses(context, y) {
    const { losses } = this.plan.gap, steps = losses[0].map((_, t) => losses.reduce((sum, row) => sum + row[t], 0));
    const most = Math.max(...steps), wide = this.width / (this.data.steps + 1);
    if (most < 5e-6) return;
    context.fillStyle = VIOLET;
    steps.forEach((lost, step) => {
      context.globalAlpha = Math.max(lost, 0) / most;
      context.fillRect(this.x(step) - wide / 2, y, wide, 4);
    });
    context.globalAlpha = 1;
  }

  mark(context, { time, kind }) {
    const [x, y] = [this.x(time), MARK_ROW[kind]];
    context.fillStyle = MARKS[kind].colour;
    context.beginPath();
    if (kind === "conflict") context.arc(x, y, 4, 0, TAU);
    else {
      const corners = kind === "near" ? 4 : 3;
      for (let k = 0; k < corners; k++) {
        const angle = -TAU / 4 + (k * TAU) / corners;
        context.lineTo(x + 4.5 * Math.cos(angle), y + 4.5 * Math.sin(angle));
      }
    }
    context.fill();
  }
}

export const MARKS = {
  conflict: { colour: RED, sign: "●", one: "conflict", many: "conflicts", key: "C" },
  near: { colour: AMBER, sign: "◆", one: "close approach", many: "close approaches", key: "N" },
  costly: { colour: VIOLET, sign: "▲", one: "costly move", many: "costly moves", key: "M" },
};

// Moments of a plan that deserve attention.
export function marksOf(plan) {
  const conflicts = plan.conflicts.map((one) => ({ ...one, kind: "conflict", time: one.step + (one.between ? 0.5 : 0) }));
  const near = plan.near.map((one) => ({ ...one, kind: "near" }));
  const costly = (plan.gap?.costliest ?? []).map(({ step, robot, share }) => ({
    kind: "costly", time: step, words: `the move of drone ${robot} from step ${step} costs ${percent(share)} of the bound`,
  }));
  return [...conflicts, ...near, ...costly];
}
