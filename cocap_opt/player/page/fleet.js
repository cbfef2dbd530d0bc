// The list of a plan's drones: whom each films, what it adds to the reward, and, on request, what
// its camera sees. Pressing picks a drone.

import { inkOn, words } from "./colours.js";
import { button, make, put } from "./dom.js";
import { Eye } from "./eye.js";
import { labelOf } from "./labels.js";
import { short } from "./numbers.js";
import { COARSE, FINE } from "./pen.js";
import { colourOf, heightOf, isCrowd, isThere, present } from "./plans.js";

const SPENT = 9; // ms per frame that drones' pictures may take while something moves
export const ROOM = 900; // px; panels of at least this width show drones' pictures at first

export class Fleet {
  // `actions`: pick(drone), refresh().
  constructor(data, plan, scene, bodies, { pick, refresh }) {
    Object.assign(this, { data, plan });
    this.root = make("div", "fleet");
    this.root.setAttribute("role", "group");
    this.root.setAttribute("aria-label", "drones");
    this.root.classList.toggle("crowd", isCrowd(data.drones));
    const head = make("div", "listed");
    head.append(make("span", "", "drone films"), make("span", "", plan.adds.length ? "adds to J" : ""));
    head.title = "the person whom the drone's camera sees best now, and how much J would drop at this step without the drone";
    this.root.append(head);
    this.rows = data.drones.map((_, i) => this.row(i, pick));
    this.root.append(...present(plan).map((i) => this.rows[i].chip));
    this.root.hidden = !present(plan).length;
    this.root.style.setProperty("--drones", present(plan).length || 1);
    this.eye = new Eye(data, plan, scene, bodies, null);
    this.visible = new Set();
    this.watcher = new IntersectionObserver((changes) => {
      for (const { target, isIntersecting } of changes) this.visible[isIntersecting ? "add" : "delete"](Number(target.dataset.drone));
      refresh();
    });
    this.rows.forEach(({ canvas }) => this.watcher.observe(canvas));
    this.rove();
  }

  // The Tab key reaches only one drone; the up and down keys lead to the others.
  rove() {
    const chips = present(this.plan).map((i) => this.rows[i].chip);
    const reach = (chip) => chips.forEach((other) => (other.tabIndex = other === chip ? 0 : -1));
    reach(chips[0]);
    this.root.addEventListener("focusin", ({ target }) => chips.includes(target) && reach(target));
    this.root.addEventListener("keydown", (event) => {
      const way = { ArrowDown: 1, ArrowUp: -1 }[event.key], at = chips.indexOf(event.target);
      if (!way || at < 0 || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      chips[(at + way + chips.length) % chips.length].focus();
    });
  }

  row(i, pick) {
    const chip = button("chip", "", `drone ${i}: pick it`, () => pick(i)), dot = make("i", "", String(i));
    const colour = colourOf(this.data, this.plan, i), canvas = make("canvas");
    dot.style.cssText = `background: ${colour}; color: ${inkOn(colour)}`;
    canvas.dataset.drone = String(i);
    canvas.setAttribute("aria-hidden", "true");
    const films = make("span", "films"), adds = make("span", "adds");
    chip.append(dot, films, adds, canvas);
    return { chip, films, adds, canvas, stamp: "" };
  }

  describe(step, picked) {
    const { plan, data } = this;
    this.rows.forEach(({ chip, films, adds }, i) => {
      if (!isThere(plan, i)) return;
      const whom = plan.films[i][step], height = data.layers > 1 ? `${heightOf(plan, i, step)} m` : "";
      const who = whom === null ? "nobody" : data.people[whom].name === null ? data.people[whom].called : labelOf(data.people[whom], whom);
      const more = plan.adds.length ? short(plan.adds[i][step]) : "";
      put(films, height ? `${who}, ${height}` : who);
      put(adds, more);
      chip.title = `drone ${i}, ${data.drones[i].camera}: films ${who}`
        + `${height ? `, ${height} ${data.over}` : ""}${more ? `, adds ${more} to J` : ""}`;
      chip.setAttribute("aria-pressed", String(i === picked));
    });
  }

  // Scroll to a drone, if the list is longer than its box.
  show(i) {
    const { chip } = this.rows[i], { root } = this, inner = root.getBoundingClientRect(), outer = chip.getBoundingClientRect();
    if (outer.top < inner.top || outer.bottom > inner.bottom) root.scrollTop += outer.top - inner.top - inner.height / 3;
    if (outer.left < inner.left || outer.right > inner.right) root.scrollLeft += outer.left - inner.left - inner.width / 3;
  }

  // Draw pictures of the drones in view; while something moves, only as many as there is time for,
  // in turn. Return true if all are up to date.
  draw(time, { views, quality }) {
    this.root.classList.toggle("views", views);
    if (!views) return true;
    const begin = performance.now(), fine = quality === FINE;
    const stale = [...this.visible].filter((i) => isThere(this.plan, i) && this.rows[i].stamp !== this.stampOf(i, time));
    stale.sort((a, b) => (a > (this.last ?? -1) ? a : a + 1e6) - (b > (this.last ?? -1) ? b : b + 1e6));
    for (const [k, i] of stale.entries()) {
      if (!fine && k && performance.now() - begin > SPENT) return false;
      const row = this.rows[i];
      Object.assign(this.eye, { canvas: row.canvas, stamp: "" });
      this.eye.draw(time, i, COARSE);
      row.stamp = this.stampOf(i, time);
      this.last = i;
    }
    return true;
  }

  stampOf(i, time) {
    return [time, this.rows[i].canvas.clientWidth, words.version].join();
  }
}
