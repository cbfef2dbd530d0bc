// Pointers on a picture: one turns it (or moves it, with Shift or another button), two zoom and move
// it; the wheel zooms. Pressing picks a drone, and a hint describes what is under the pointer. Arrow
// keys turn a picture that has the focus, or move it with Shift.

import { put } from "./dom.js";
import { density, percent, reward } from "./numbers.js";
import { tipAt } from "./panel.js";
import { heightOf } from "./plans.js";

const STILL = 5; // px that a pointer may move during a press
const KEYED = 24; // px that an arrow key turns or moves
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Steering {
  // `actions`: moved(), pick(drone), hover({ drone, person }), fit(); `now` returns the time shown.
  constructor(panel, camera, now, actions) {
    Object.assign(this, { panel, camera, now, actions, canvas: panel.canvas, pointers: new Map(), far: 0 });
    const on = (name, act, how) => this.canvas.addEventListener(name, act, how);
    on("pointerdown", (event) => this.down(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.up(event));
    on("pointercancel", (event) => this.pointers.delete(event.pointerId));
    on("pointerleave", ({ pointerType }) => {
      if (pointerType === "touch") return; // a hint by a press stays until the next press
      panel.tip.classList.remove("on");
      actions.hover(undefined);
    });
    on("wheel", (event) => this.wheel(event), { passive: false });
    on("keydown", (event) => this.key(event));
    on("mousedown", (event) => event.preventDefault()); // after turning by pointer, arrow keys still change the step
    on("contextmenu", (event) => event.preventDefault());
    on("dblclick", () => actions.fit());
  }

  middle() {
    const all = [...this.pointers.values()];
    const [x, y] = [0, 1].map((k) => all.reduce((sum, p) => sum + p[k], 0) / all.length);
    return [x, y, Math.hypot(all[0][0] - x, all[0][1] - y)];
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.far = this.pointers.size > 1 ? Infinity : 0;
    this.wasPressed = true;
  }

  up(event) {
    this.pointers.delete(event.pointerId);
    if (this.far > STILL) return;
    const drone = this.panel.view.labels.droneAt(event.offsetX, event.offsetY);
    if (drone !== undefined) this.actions.pick(drone);
    if (event.pointerType === "touch") this.tell(event);
  }

  key(event) {
    const way = ARROWS[event.key];
    if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.camera[event.shiftKey ? "pan" : "orbit"](...way.map((v) => v * KEYED));
    this.actions.moved();
  }

  move(event) {
    if (!this.pointers.has(event.pointerId)) return this.tell(event);
    this.panel.tip.classList.remove("on");
    const [x, y, apart] = this.middle();
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    const [nx, ny, nowApart] = this.middle();
    this.far += Math.hypot(nx - x, ny - y);
    if (this.pointers.size > 1 && apart > 0) {
      this.camera.pan(nx - x, ny - y);
      this.zoom(nowApart / apart, nx, ny);
    } else if (event.shiftKey || event.buttons > 1) this.camera.pan(nx - x, ny - y);
    else if (this.far > STILL) this.camera.orbit(nx - x, ny - y);
    this.actions.moved();
  }

  // In a frame of another page, which the wheel may scroll, it zooms only after a press.
  wheel(event) {
    if (window.parent !== window && !this.wasPressed) return;
    event.preventDefault();
    this.zoom(1.0015 ** -event.deltaY, event.offsetX, event.offsetY);
    this.actions.moved();
  }

  zoom(factor, x, y) {
    this.camera.zoom(factor, x - this.canvas.clientWidth / 2, y - this.canvas.clientHeight / 2);
  }

  // Shows a hint on the drone or the face under the pointer.
  tell({ offsetX: x, offsetY: y }) {
    const { tip, view } = this.panel, words = this.known(x, y);
    this.actions.hover({ drone: view.labels.droneAt(x, y), person: view.faceAt(x, y, this.now())?.[0] });
    tip.classList.toggle("on", words !== undefined);
    if (words === undefined) return;
    put(tip, words);
    tipAt(tip, view.canvas, [x, y]);
  }

  known(x, y) {
    const { view, plan, data } = this.panel, step = Math.round(this.now());
    const found = view.faceAt(x, y, this.now());
    if (found) {
      const [j, f, face] = found, pixels = plan.seen[step][face];
      const seen = pixels > 0 ? `${density(pixels)} ${data.unit}` : "not seen";
      return `${data.people[j].called}, ${data.people[j].names[f]}: ${seen}${overpaid(plan.gap, step, face)}`;
    }
    const drone = view.labels.droneAt(x, y);
    if (drone === undefined) return undefined;
    const adds = plan.adds.length ? `, adds ${reward(plan.adds[drone][step])} to J` : "";
    const whom = plan.films[drone][step], films = whom === null ? "" : `, films ${data.people[whom].called}`;
    return `drone ${drone}${films}, ${heightOf(plan, drone, step)} m ${data.over}${adds}`;
  }
}

// The bound's overestimate of a face's reward.
function overpaid(gap, step, face) {
  const share = gap ? gap.faces[Math.min(step, gap.faces.length - 1)][face] : 0;
  return share < 5e-6 ? "" : `; the bound allows ${percent(share)} more`;
}
