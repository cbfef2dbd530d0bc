// A plan on the page: facts, its picture, its drones, and the chart.

import { Chart, MARKS, marksOf } from "./chart.js";
import { hex } from "./colours.js";
import { button, make, PHONE, put } from "./dom.js";
import { Eye } from "./eye.js";
import { Fleet } from "./fleet.js";
import { density, digits, MOST_WORDS, percent, reward, several } from "./numbers.js";
import { conflictsAt, isStill, isThere, nearAt, present, turns } from "./plans.js";
import { proofBox } from "./proof.js";
import { Strip } from "./strip.js";
import { View } from "./view.js";

const ASIDE = 20; // px around a box in a corner of the picture
const NOW = 30; // the present moment counts as much as so many others
const REWARD = "more is better: J is the sum, over steps and the sides of people, of the root of the coverage that all "
  + "drones together have of a side";
export const CORNERS = ["top right", "top left", "bottom right", "bottom left"];

export class Panel {
  // `actions` are the functions of buttons: jump(time), pick(drone), toggle(name),
  // watch(step, person), next(kind, plan), refresh().
  constructor(data, plan, other, scene, camera, actions) {
    Object.assign(this, { data, plan, actions });
    this.root = make("section", "panel");
    this.canvas = make("canvas", "view");
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", `Plan ${plan.title} in its scene; arrows turn it, with shift they move it`);
    this.canvas.tabIndex = 0;
    const bars = make("canvas", "chart");
    bars.setAttribute("role", "img");
    bars.setAttribute("aria-label", "what each step adds to J");
    this.tip = make("div", "tip");
    this.sides = make("div", "tip sides");
    this.sides.setAttribute("role", "status");
    this.words = make("div", "words");
    this.view = new View(data, plan, scene, camera, this.canvas);
    const place = make("div", "place");
    place.append(this.canvas, this.words, this.inset(scene), this.tip, this.sides);
    this.strip = new Strip(data, plan, actions.watch);
    this.fleet = new Fleet(data, plan, scene, this.view.bodies, actions);
    const stage = make("div", "stage");
    stage.append(place, this.fleet.root);
    this.root.append(this.head(), this.facts(), stage, this.strip.root, bars);
    this.chart = new Chart(data, plan, other, bars, actions.jump);
  }

  head() {
    const { plan } = this, head = make("div", "head"), title = make("h2", "", plan.planner ?? plan.title);
    title.title = plan.title;
    head.append(title);
    if (plan.planner && plan.planner !== plan.title) head.append(make("span", "file", plan.title));
    head.append(...this.proved(), ...this.kept());
    return head;
  }

  // The proof of the plan, and warnings that must be seen at once; most plans have neither.
  proved() {
    const { data, plan } = this, { gap, conflicts, waits, besidePeople, cutShort } = plan;
    const isStopped = cutShort && !gap?.optimal, isNone = !waits && !turns(plan) && !gap?.optimal;
    const isProved = gap && !conflicts.length, proof = isProved && data.certificate ? proofBox(data, plan) : null;
    const told = [isNone && !isStopped ? "no drone moves" : "", this.bounded(isProved), isStopped ? cutShort : ""].filter(Boolean);
    if (!told.length) return [];
    const badge = proof ? button("badge next", "", "", () => proof.showModal()) : make("span", "badge");
    badge.textContent = told.join("; ");
    badge.title = isStopped ? "the planner was stopped early; more time may give a better plan" : besidePeople.length
      ? besidePeople.join("\n") : isProved ? `the certificate was verified${proof ? " when this page was made; click for its file" : ""}` : "";
    badge.classList.toggle("mild", besidePeople.length > 0 || Boolean(isStopped) || isNone);
    badge.classList.toggle("good", Boolean(isProved && gap.optimal));
    if (proof) {
      badge.append(make("i", "", " ▸"));
      this.root.append(proof);
    }
    return [badge];
  }

  bounded(isProved) {
    const { gap, waits, besidePeople } = this.plan;
    if (besidePeople.length) return `at the start ${several(besidePeople, 1)}`;
    if (isProved) return gap.optimal ? "proved optimal" : `proved within ${percent(gap.total)} of the best`;
    return waits ? "not planned yet" : "";
  }

  // Whether drones obey the rules, and how close they come to each other and to people: red if they
  // break a rule or would touch, green and "no conflicts" only if they keep the distances that drones
  // should keep. Pressing goes there.
  kept() {
    const { data, plan, actions } = this, { conflicts: { length: count }, closest } = plan;
    const beside = besidePerson(plan), words = keptWords(data, plan);
    if (!words) return [];
    const isBad = count || isTouch(closest), isApart = !closest || closest.isKept, isPerson = beside && isApart;
    const level = isBad ? "bad" : isApart && !beside ? "good" : "mild";
    if (!count && !closest && !beside) return [make("span", `badge ${level}`, words)];
    const go = () => (count ? actions.next("conflict", plan) : actions.jump((isPerson ? beside : closest).time));
    const title = count ? "breaks the rules; go to the next conflict (C)" : isPerson ? nearestPerson(beside) : nearest(plan);
    const badge = button(`badge next ${level}`, words, title, go);
    badge.append(make("i", "", " ▸"));
    return [badge];
  }

  facts() {
    const { plan, data } = this, facts = make("div", "facts");
    const add = (name, value, title = "") => {
      const box = make("span", "fact", `${name} `), number = make("b", "", value);
      box.append(number);
      box.title = title;
      facts.append(box);
      return number;
    };
    if (!plan.waits) {
      const moves = plan.moves ? `, ${reward(plan.moves)} of it for moves` : "";
      add("how well people are seen: J =", `${reward(plan.reward)}${moves}`, REWARD).className = "total";
    }
    if (plan.gap) {
      add("bound on J", reward(plan.gap.bound), "no plan that obeys the rules exceeds it");
      if (!plan.conflicts.length) add("gap", percent(Math.max(plan.gap.total, 0)), "(bound - J) / bound");
    }
    if (!plan.waits) facts.append(...this.hovering());
    add("mean coverage of a face", `${density(plan.meanPixels)} ${data.unit}`, "by all drones together, over all faces and all steps that count").className = "mean";
    this.now = add("J of this step", "", "what this step adds to J");
    this.sum = add("J so far", "", "what all steps up to this one add to J");
    if (turns(plan)) add("flight", plan.knots ? "smooth" : "straight", `between the steps drones fly ${flightOf(plan)}`).className = "flight";
    if (plan.gap?.losses.length) this.lost = add("cost of this move", "");
    if (this.lost) this.lost.className = "lost";
    this.now.className = "now";
    this.sum.className = "sum";
    facts.append(this.marks());
    facts.hidden = data.drones.every((_, i) => !isThere(plan, i)); // no drone has a path, so none sees anything
    return facts;
  }

  // The number of drones that never leave their places, if any.
  hovering() {
    const { plan } = this, still = plan.paths.flatMap((path, i) => (path.length && isStill({ paths: [path] }) ? [i] : []));
    if (!still.length) return [];
    const all = still.length === present(plan).length, one = still.length === 1;
    const fact = make("span", "fact still", all ? "no drone moves" : `${still.length} drone${one ? "" : "s"} hover${one ? "s" : ""}`);
    fact.title = one ? `drone ${still[0]} never leaves its start` : `drones ${still.join(", ")} never leave their starts`;
    return [fact];
  }

  // The number of marks of each kind in the chart; pressing goes to the next one.
  marks() {
    const box = make("span", "marks"), marks = marksOf(this.plan);
    for (const [kind, { colour, sign, one, many, key }] of Object.entries(MARKS)) {
      const count = marks.filter((mark) => mark.kind === kind).length;
      if (!count || kind === "conflict") continue;
      const words = ` ${count} ${count > 1 ? many : one}`;
      const go = () => this.actions.next(kind, this.plan), dot = make("i", "", sign);
      dot.style.color = colour;
      const touches = kind === "near" && isTouch(this.plan.closest);
      box.append(button(`mark ${kind}${touches ? " touch" : ""}`, words, `go to the next ${one} (${key})`, go));
      box.lastChild.prepend(dot);
    }
    return box;
  }

  // The picked drone's view.
  inset(scene) {
    const { actions } = this, canvas = make("canvas"), bar = make("div", "bar");
    this.box = make("figure", "inset");
    this.caption = make("figcaption");
    this.adds = make("span");
    this.own = make("span", "alone");
    this.caption.append(this.adds, this.own);
    this.holds = Object.fromEntries([["follow", "follow (F)"], ["alone", "alone (I)"]].map(([name, title]) => [
      name, button("hold", name, title, () => actions.toggle(name)),
    ]));
    bar.append(...Object.values(this.holds), button("hold", "✕", "deselect (Esc)", () => actions.pick(undefined)));
    this.who = make("b");
    bar.prepend(this.who);
    this.box.append(bar, canvas, this.caption);
    this.box.hidden = true;
    this.eye = new Eye(this.data, this.plan, scene, this.view.bodies, canvas);
    return this.box;
  }

  // How much happens, above all now, in each corner of the picture where the inset may be.
  busy(time) {
    const { view, box, canvas: { clientWidth: width, clientHeight: height } } = this;
    const { camera: { points: all }, bodies } = view, now = bodies.all(time);
    const points = [...all, ...now.flatMap((point) => Array(NOW).fill(point))].map((point) => view.at(point));
    const [wide, tall] = [box.clientWidth + ASIDE, box.clientHeight + ASIDE];
    return CORNERS.map((corner) => points.filter(([x, y]) =>
      (corner.includes("right") ? width - x : x) < wide && (corner.includes("bottom") ? height - y : y) < tall).length);
  }

  // Returns true if everything is drawn.
  draw(time, options) {
    const { picked } = options;
    this.strip.draw(time, options.person); // its height decides the picture's
    this.view.draw(time, options);
    this.box.hidden = picked === undefined;
    if (picked !== undefined) this.eye.draw(time, picked, options.quality);
    this.chart.draw(time, picked);
    this.describe(time, options);
    this.tellSides(time, options);
    return this.fleet.draw(time, options);
  }

  describe(time, options) {
    const { plan, data } = this, step = Math.round(time);
    put(this.now, step < data.first ? "not counted" : reward(plan.rewards[step]));
    this.now.dataset.value = String(plan.rewards[step]);
    put(this.sum, reward(plan.rewards.slice(0, step + 1).reduce((a, b) => a + b, 0)));
    if (this.lost) put(this.lost, losses(plan.gap, step));
    const most = this.canvas.clientWidth < PHONE ? 1 : MOST_WORDS;
    const told = [...conflictsAt(plan, time), ...nearAt(plan, time)].map((one) => one.words);
    put(this.words, several(told, most));
    const isMild = !conflictsAt(plan, time).length && nearAt(plan, time).every(({ apart, person }) => person !== undefined || apart >= plan.closest.body);
    this.words.classList.toggle("mild", isMild);
    this.describeDrones(step, options);
  }

  // What drones see of each side of a person, shown above the person on request.
  tellSides(time, { sides, person = 0 }) {
    const { plan, data, view, sides: box } = this, j = plan.filmed?.rows[person]?.person ?? person, told = sides && data.people[j];
    box.classList.toggle("on", Boolean(told));
    if (!told) return;
    const seen = plan.seen[Math.round(time)], first = view.bodies.first[j];
    put(box, `${told.called}, ${data.unit}: ${sidesWords(told.names, seen.slice(first, first + told.names.length))}`);
    const [x, y, z] = view.bodies.person(j, time), [middle, head] = view.at([x, y, z + told.height]);
    tipAt(box, view.canvas, [middle - box.clientWidth / 2, head - box.clientHeight]); // above the label
  }

  describeDrones(step, { picked, follow, alone }) {
    const { plan, data } = this, stamp = [step, picked, follow, alone].join();
    if (stamp === this.stamp) return;
    this.stamp = stamp;
    this.fleet.describe(step, picked);
    if (picked === undefined) return;
    put(this.who, `drone ${picked}`);
    this.who.style.setProperty("--own", hex(this.view.bodies.colours[picked]));
    const isCounted = plan.adds.length && step >= data.first;
    put(this.adds, isCounted ? `adds ${reward(plan.adds[picked][step])} to J at this step` : "");
    put(this.own, `${isCounted ? "; " : ""}alone it sees a mean of ${density(plan.ownPixels[picked][step])} ${data.unit}`);
    const held = { follow, alone };
    for (const [name, hold] of Object.entries(this.holds)) {
      hold.setAttribute("aria-pressed", String(Boolean(held[name])));
    }
  }
}

// The coverage of each side; the parts of a side ("front, half 1") are summed. Commas only group digits.
function sidesWords(names, seen) {
  const sides = new Map();
  names.forEach((name, f) => {
    const [side] = name.split(", ");
    sides.set(side, [...(sides.get(side) ?? []), seen[f]]);
  });
  const told = (parts) => (parts.some((pixels) => pixels > 0) ? parts.map(density).join(" + ") : "not seen");
  return [...sides].map(([side, parts]) => `${side}: ${told(parts)}`).join("; ");
}

// Puts a hint beside a point of a picture, but inside the picture.
export function tipAt(tip, canvas, [x, y]) {
  tip.style.left = `${Math.max(Math.min(x + 12, canvas.clientWidth - tip.clientWidth - 4), 4)}px`;
  tip.style.top = `${Math.max(Math.min(y - 30, canvas.clientHeight - 34), 4)}px`;
}

const flightOf = ({ knots }) => (knots
  ? "smoothly, as cocap-opt fly --smooth writes it: walls, people and other drones are as far away as the rules require"
  : "in straight lines, as cocap-opt fly writes it: no smooth flight obeys the rules");

const distance = (metres) => `${Number(metres.toFixed(2))} m`; // rounded as in `cocap-opt fly`

// True if the drawn bodies of two drones touch, though no rule forbids it.
const isTouch = (closest) => closest && !closest.isKept && closest.apart < closest.body;

// The closest approach of a drone to a person, if it is too close and no rule sets a distance.
const besidePerson = ({ near }) => near.find(({ person }) => person !== undefined);

// The badge's text on rules and distances.
function keptWords({ people }, plan) {
  const { conflicts: { length: count }, closest, waits } = plan, beside = besidePerson(plan);
  const join = (words, by = "; ") => words.filter(Boolean).join(by);
  const apart = closest ? distance(closest.apart) : "", near = apart && `closest ${apart}`;
  const aside = beside ? `${distance(beside.apart)} from ${people[beside.person].called}` : "";
  if (count) return join([`${count} conflict${count > 1 ? "s" : ""}`, near, aside]);
  const isApart = !closest || closest.isKept;
  if (isApart && !aside) return join([waits ? "" : "no conflicts", near]);
  if (apart === distance(0)) return join([`drones touch: ${apart}`, aside]);
  return `no rule broken, but ${join([isApart ? "" : `${isTouch(closest) ? "only " : ""}${apart} apart`, aside], " and ")}`;
}

// The drone that comes closest to a person, when, and how far away drones should be.
const nearestPerson = ({ words, time }) => `${words} at step ${digits(time, 1)}, seen from above, and no rule forbids it. Green: 2 m or more. Go there`;

// The drones that come closest to each other, when, in which flight, and how far apart they should be.
function nearest({ closest: { robots, apart, time, straight, kept, above }, knots }) {
  const flight = knots ? `on the smooth flight (cocap-opt fly --smooth), ${distance(straight)} on straight legs` : "on straight legs";
  return `drones ${robots.join(" and ")} are ${distance(apart)} apart at step ${digits(time, 1)}, ${flight}. `
    + `Green: ${distance(kept)} or more${above ? `, or ${distance(above)} in height` : ""}. Go there`;
}

// The cost of all drones' moves from a step, in % of the bound, and the costliest drone.
function losses(gap, step) {
  const lost = gap.losses.map((row) => row[step] ?? 0), most = Math.max(...lost);
  if (most < 5e-6) return "none";
  const all = lost.reduce((a, b) => a + b, 0), share = all - most < 5e-6 ? "" : `: ${percent(most)}`;
  return `${percent(all)} of bound (drone ${lost.indexOf(most)}${share})`;
}
