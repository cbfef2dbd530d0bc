// Reward per step as bars; a press or a drag on them goes to the step.

const DONE = "#30638e", AHEAD = "#c9d6df", OTHER = "#1d2530";
const MARGIN = { left: 46, right: 10, top: 14, bottom: 20 };

class Chart {
  constructor(data, plan, other, canvas, go) {
    Object.assign(this, { data, plan, other, canvas });
    const press = (event) => {
      if (event.buttons & 1) go(this.stepAt(event.offsetX));
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      press(event);
    });
    canvas.addEventListener("pointermove", press);
  }

  get width() {
    return this.canvas.clientWidth - MARGIN.left - MARGIN.right;
  }

  // Middle of a step's bar.
  x(step) {
    return MARGIN.left + ((step + 0.5) / (this.data.steps + 1)) * this.width;
  }

  stepAt(x) {
    const step = Math.floor(((x - MARGIN.left) / this.width) * (this.data.steps + 1));
    return Math.min(Math.max(step, 0), this.data.steps);
  }

  draw(time) {
    const pixels = window.devicePixelRatio || 1, { clientWidth: w, clientHeight: h } = this.canvas;
    [this.canvas.width, this.canvas.height] = [Math.round(w * pixels), Math.round(h * pixels)];
    const context = this.canvas.getContext("2d");
    context.scale(pixels, pixels);
    context.font = "11px system-ui, sans-serif";
    const long = h - MARGIN.top - MARGIN.bottom, most = this.data.mostReward || 1;
    const y = (reward) => MARGIN.top + long * (1 - reward / most);
    this.ticks(context, y, most, w);
    this.bars(context, y, Math.round(time));
    if (this.other) this.outline(context, y);
    if (this.plan.gap) this.losses(context, h - MARGIN.bottom + 1);
    this.conflicts(context);
    context.strokeStyle = OTHER;
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(this.x(time), MARGIN.top - 6);
    context.lineTo(this.x(time), h - MARGIN.bottom);
    context.stroke();
  }

  ticks(context, y, most, w) {
    context.fillStyle = "#5b616b";
    context.textAlign = "right";
    context.textBaseline = "middle";
    const gap = this.data.mostReward ? rounded(most / 1.9) : Infinity;
    for (let value = 0; value <= most; value += gap) {
      context.fillStyle = "#e4e4e0";
      context.fillRect(MARGIN.left, Math.round(y(value)), w - MARGIN.left - MARGIN.right, 1);
      context.fillStyle = "#5b616b";
      context.fillText(short(value), MARGIN.left - 6, y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    const every = Math.max(1, rounded(Math.max(1, (34 * this.data.steps) / this.width) * 1.99));
    for (let step = 0; step <= this.data.steps; step += every) {
      context.fillText(String(step), this.x(step), this.canvas.clientHeight - MARGIN.bottom + 5);
    }
  }

  bars(context, y, now) {
    const wide = Math.max((this.width / (this.data.steps + 1)) * 0.78, 1);
    this.plan.rewards.forEach((reward, step) => {
      context.fillStyle = step <= now ? DONE : AHEAD;
      context.fillRect(this.x(step) - wide / 2, y(reward), wide, y(0) - y(reward));
    });
  }

  // The other plan's rewards, as steps.
  outline(context, y) {
    const half = this.width / (this.data.steps + 1) / 2;
    context.strokeStyle = "#b3541e";
    context.lineWidth = 1.3;
    context.beginPath();
    this.other.rewards.forEach((reward, step) => {
      if (step < this.data.first) return;
      context.lineTo(this.x(step) - half, y(reward));
      context.lineTo(this.x(step) + half, y(reward));
    });
    context.stroke();
  }

  // A strip below the bars: the redder, the more is lost by leaving a step.
  losses(context, y) {
    const { losses } = this.plan.gap, steps = losses[0].map((_, t) => losses.reduce((sum, row) => sum + row[t], 0));
    const most = Math.max(...steps), wide = this.width / (this.data.steps + 1);
    if (most < 5e-6) return;
    context.fillStyle = RED;
    steps.forEach((lost, step) => {
      context.globalAlpha = Math.max(lost, 0) / most;
      context.fillRect(this.x(step) - wide / 2, y, wide, 4);
    });
    context.globalAlpha = 1;
  }

  conflicts(context) {
    for (const step of new Set(this.plan.conflicts.map((c) => c.step))) {
      context.beginPath();
      context.arc(this.x(step), MARGIN.top - 7, 3, 0, TAU);
      context.fillStyle = RED;
      context.fill();
    }
  }
}

const digits = (value, most, least = 0) =>
  value.toLocaleString("en-US", { maximumFractionDigits: most, minimumFractionDigits: least });
const short = (value) => {
  const [unit, size] = value >= 1e6 ? ["M", 1e6] : value >= 1e4 ? ["k", 1e3] : ["", 1];
  return Number((value / size).toPrecision(3)).toLocaleString("en-US", { maximumFractionDigits: 8 }) + unit;
};
const reward = (value) => (Math.abs(value) < 100 ? digits(value, 4) : digits(value, 2, 2));
const density = (value) => (value >= 100 ? digits(Math.round(value), 0) : String(Number(value.toPrecision(3))));
