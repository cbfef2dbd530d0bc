// The page: a panel for each plan, and one time for all of them.

const data = JSON.parse(document.getElementById("data").textContent);
const find = (id) => document.getElementById(id);
const make = (name, cls, text) => {
  const element = document.createElement(name);
  if (cls) element.className = cls;
  if (text !== undefined) element.textContent = text; // never as HTML: names may be anything
  return element;
};

const MOST_WORDS = 3; // conflicts that are said at once, on a phone one
const NARROW = 500; // px
const SHOWN = ["sights", "tracks", "solid", "closed"]; // check boxes
const state = { time: 0, playing: false, speed: 2, last: 0, dirty: true, moved: -Infinity, slow: false };
const camera = new Camera(data);
const world = new World(data);
const panels = data.plans.map(makePanel);

function makePanel(plan, index) {
  const root = make("section", "panel");
  const moves = plan.moves ? `, ${reward(plan.moves)} of it for moves` : "";
  const head = make("div", "head");
  const title = make("h2", "", plan.title);
  title.title = plan.title;
  head.append(title, make("span", "total", `J = ${reward(plan.reward)}${moves}`));
  const facts = make("div", "facts");
  const now = make("b", "now"), sum = make("b", "sum");
  facts.append(fact("reward at this step", now), fact("so far", sum));
  const lost = make("b", "lost");
  if (plan.gap) facts.append(fact("lost by leaving it", lost));
  const next = make("button", "next");
  facts.append(next);
  const canvas = make("canvas", "view"), bars = make("canvas", "chart");
  canvas.setAttribute("aria-label", `Plan ${plan.title} in its scene`);
  const words = make("div", "words"), tip = make("div", "tip");
  const place = make("div", "place");
  place.append(canvas, words, tip);
  const fleet = make("div", "fleet");
  const chips = data.drones.map((drone, i) => {
    const chip = make("span", "chip"), dot = make("i", "", String(i)), height = make("span");
    dot.style.background = drone.colour;
    chip.append(dot, height);
    fleet.append(chip);
    return height;
  });
  root.append(head, facts, place);
  if (data.layers > 1) root.append(fleet);
  root.append(bars);
  find("panels").append(root);
  const other = data.plans.length === 2 ? data.plans[1 - index] : null;
  const view = new View(data, plan, world, camera, canvas);
  const chart = new Chart(data, plan, other, bars, (step) => jump(step));
  const count = plan.conflicts.length;
  next.textContent = count ? `${count} conflict${count > 1 ? "s" : ""} ▸` : "no conflicts";
  next.title = count ? "go to the next one (C)" : "";
  next.disabled = !count;
  next.addEventListener("click", () => jump(nextConflict([plan])));
  const panel = { plan, view, chart, now, sum, lost, words, chips, tip, canvas };
  steer(panel);
  return panel;
}

function fact(name, value) {
  const box = make("span", "fact", `${name} `);
  box.append(value);
  return box;
}

function nextConflict(plans) {
  const steps = plans.flatMap((plan) => plan.conflicts.map((c) => c.step)).sort((a, b) => a - b);
  return steps.find((step) => step > Math.round(state.time)) ?? steps[0] ?? state.time;
}

// -- time ----------------------------------------------------------------------------------

function jump(time) {
  state.moved = performance.now();
  state.time = Math.min(Math.max(time, 0), data.steps);
  play(false);
  refresh();
}

function play(on) {
  if (on && state.time >= data.steps) state.time = 0;
  state.playing = on;
  find("play").textContent = on ? "❚❚" : "▶";
  find("play").setAttribute("aria-label", on ? "pause" : "play");
  refresh();
}

function refresh() {
  state.dirty = true;
}

function tick(now) {
  requestAnimationFrame(tick);
  const seconds = Math.min((now - state.last) / 1000, 0.25);
  state.last = now;
  if (state.playing) {
    state.time = Math.min(state.time + seconds * state.speed, data.steps);
    if (state.time >= data.steps) play(false);
    refresh();
  }
  const resting = now - state.moved > 200 && !state.playing;
  if (resting && state.quality !== FINE) refresh();
  if (!state.dirty) return;
  state.dirty = false;
  draw(resting);
}

// While something moves, a slow machine gets coarser pictures.
function draw(resting) {
  state.quality = resting || !state.slow ? FINE : COARSE;
  const checked = SHOWN.map((name) => [name, find(name).checked]);
  const options = { quality: state.quality, ...Object.fromEntries(checked) };
  const begin = performance.now();
  for (const panel of panels) {
    panel.view.draw(state.time, options);
    panel.chart.draw(state.time);
    describe(panel);
  }
  if (!resting && performance.now() - begin > 45) state.slow = true;
  const step = Math.round(state.time);
  find("slider").value = String(step);
  find("step").textContent = `step ${step} of ${data.steps}`;
}

function describe({ plan, now, sum, lost, words, chips, canvas }) {
  const step = Math.round(state.time);
  put(now, step < data.first ? "not counted" : reward(plan.rewards[step]));
  now.dataset.value = String(plan.rewards[step]);
  put(sum, reward(plan.rewards.slice(0, step + 1).reduce((a, b) => a + b, 0)));
  if (plan.gap) put(lost, losses(plan.gap, step));
  const most = canvas.clientWidth < NARROW ? 1 : MOST_WORDS;
  put(words, several(conflictsAt(plan, state.time).map((c) => c.words), most));
  chips.forEach((chip, i) => put(chip, `${plan.heights[i][step]} m`));
}

// What drones lose by leaving a step as they do, the one that loses most named.
function losses(gap, step) {
  const lost = gap.losses.map((row) => row[step] ?? 0), most = Math.max(...lost);
  if (most < 5e-6) return "nothing";
  const all = lost.reduce((a, b) => a + b, 0), percent = (share) => `${digits(100 * share, 3)} %`;
  const rest = all - most < 5e-6 ? "" : ` of ${percent(all)}`;
  return `${percent(most)}${rest} by drone ${lost.indexOf(most)}`;
}

function several(words, most) {
  const more = words.length - most;
  return words.slice(0, most).join("; ") + (more > 0 ? `; ${more} more` : "");
}

function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// -- camera --------------------------------------------------------------------------------

// One pointer turns (moves, with shift or another button), two zoom and move; so does the wheel.
function steer({ canvas, view, plan, tip }) {
  const pointers = new Map();
  const moved = () => {
    state.moved = performance.now();
    refresh();
  };
  const middle = () => {
    const all = [...pointers.values()];
    const [x, y] = [0, 1].map((k) => all.reduce((sum, p) => sum + p[k], 0) / all.length);
    return [x, y, Math.hypot(all[0][0] - x, all[0][1] - y)];
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener("pointerleave", () => tip.classList.remove("on"));
  canvas.addEventListener("pointermove", (event) => {
    if (!pointers.has(event.pointerId)) return hint(view, plan, tip, event);
    tip.classList.remove("on");
    const [x, y, apart] = middle();
    pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    const [nx, ny, nowApart] = middle();
    if (pointers.size > 1 && apart > 0) {
      camera.pan(nx - x, ny - y);
      camera.zoom(nowApart / apart, nx - canvas.clientWidth / 2, ny - canvas.clientHeight / 2);
    } else if (event.shiftKey || event.buttons > 1) camera.pan(nx - x, ny - y);
    else camera.orbit(nx - x, ny - y);
    moved();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const { offsetX: x, offsetY: y } = event;
    camera.zoom(1.0015 ** -event.deltaY, x - canvas.clientWidth / 2, y - canvas.clientHeight / 2);
    moved();
  }, { passive: false });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", () => {
    camera.fitted = false;
    refresh();
  });
}

// What is known of the face under the pointer.
function hint(view, plan, tip, { offsetX: x, offsetY: y }) {
  const found = view.faceAt(x, y, state.time);
  tip.classList.toggle("on", found !== undefined);
  if (!found) return;
  const [j, f, face] = found, pixels = plan.seen[Math.round(state.time)][face];
  const seen = pixels > 0 ? `${density(pixels)} ${data.unit}` : "not seen";
  put(tip, `person ${j}, ${data.people[j].names[f]}: ${seen}${overpaid(plan.gap, face)}`);
  tip.style.left = `${Math.max(Math.min(x + 12, view.canvas.clientWidth - tip.clientWidth - 4), 4)}px`;
  tip.style.top = `${Math.max(y - 30, 4)}px`;
}

// What the bound pays for a face beyond the reward for it.
function overpaid(gap, face) {
  const share = gap ? gap.faces[Math.min(Math.round(state.time), gap.faces.length - 1)][face] : 0;
  return share < 5e-6 ? "" : `; the bound pays ${digits(100 * share, 3)} % more`;
}

// -- the rest of the page -------------------------------------------------------------------

function legend() {
  find("airspace").hidden = find("closing").hidden = !data.airspace;
  if (data.airspace) find("limits").textContent = data.airspace.words;
  find("unseen").style.background = UNSEEN;
  if (!data.plans.some((plan) => plan.seen.flat().some((pixels) => pixels > 0))) {
    find("bar").hidden = find("unit").hidden = true; // nothing is seen at any step
    return;
  }
  const bar = find("scale"), stops = SCALE.map((_, k) => {
    const share = k / (SCALE.length - 1);
    return `${seenColour(Math.max(share ** 2, 1e-12), 1)} ${100 * share}%`;
  });
  bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
  const values = [0, 0.25, 0.5, 0.75].map((share) => rounded(data.most * share ** 2));
  const apart = (k) => k === 0 || Math.sqrt(values[k] / data.most) - Math.sqrt(values[k - 1] / data.most) > 0.15;
  for (const value of [...values.filter((_, k) => apart(k)), data.most]) {
    const tick = make("span", "", short(value));
    tick.style.left = `${100 * Math.sqrt(value / data.most)}%`;
    find("ticks").append(tick);
  }
  find("unit").textContent = data.unit;
}

// Keys that a focused element has a use for itself.
const OWN_KEYS = {
  select: /./,
  "input[type=range]": /^(Arrow|Page|Home|End)/,
  "input[type=checkbox], button": /^( |Enter)$/,
};

function isOwnKey({ target, key }) {
  return Object.entries(OWN_KEYS).some(([what, own]) => target.matches(what) && own.test(key));
}

function keys(event) {
  if (isOwnKey(event) || event.ctrlKey || event.metaKey || event.altKey) return;
  const step = Math.round(state.time);
  const actions = {
    " ": () => play(!state.playing),
    ArrowRight: () => jump(step + 1),
    ArrowLeft: () => jump(step - 1),
    Home: () => jump(0),
    End: () => jump(data.steps),
    c: () => jump(nextConflict(data.plans)),
    t: () => look("top"),
    3: () => look("space"),
  };
  const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!action) return;
  event.preventDefault();
  action();
}

function look(how) {
  camera[how]();
  for (const name of ["space", "top"]) find(name).setAttribute("aria-pressed", String(name === how));
  refresh();
}

function begin() {
  document.title = `${data.name}: ${data.plans.map((plan) => plan.title).join(", ")}`;
  find("name").textContent = data.name;
  find("about").textContent = data.about;
  find("panels").dataset.count = String(data.plans.length);
  find("panels").classList.toggle("many", data.plans.length > 2);
  document.body.classList.toggle("tall", data.plans.length > 2);
  find("other").hidden = data.plans.length !== 2;
  legend();
  const slider = find("slider");
  slider.max = String(data.steps);
  slider.addEventListener("input", () => jump(Number(slider.value)));
  find("play").addEventListener("click", () => play(!state.playing));
  const speed = find("speed");
  state.speed = data.steps > 24 ? 4 : 2;
  speed.value = String(state.speed);
  speed.addEventListener("change", () => (state.speed = Number(speed.value)));
  for (const name of ["space", "top"]) find(name).addEventListener("click", () => look(name));
  for (const name of SHOWN) find(name).addEventListener("change", refresh);
  document.addEventListener("keydown", keys);
  window.addEventListener("resize", () => {
    camera.fitted = false;
    refresh();
  });
  play(false);
  tick(performance.now());
  document.documentElement.dataset.ready = "yes";
}

begin();
