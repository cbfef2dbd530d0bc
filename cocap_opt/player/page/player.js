// The page: a panel for each plan, one time and one camera for all of them.

import { Blocks } from "./blocks.js";
import { Camera } from "./camera.js";
import { marksOf } from "./chart.js";
import { night, paint } from "./colours.js";
import { button, find, make, NARROW, PHONE, put } from "./dom.js";
import { ROOM } from "./fleet.js";
import { listenToKeys, listKeys } from "./keys.js";
import { colourScale, legend } from "./legend.js";
import { clock, digits, roundedUp } from "./numbers.js";
import { CORNERS, Panel } from "./panel.js";
import { COARSE, FINE, ROUGH } from "./pen.js";
import { isCrowd, present } from "./plans.js";
import { Rays } from "./rays.js";
import { Steering } from "./steer.js";
import { onLoss, renderer } from "./renderers.js";
import { badSteps } from "./strip.js";
import { Recording } from "./video.js";
import { World } from "./world.js";

const data = JSON.parse(find("data").textContent);
const SHOWN = ["sights", "views", "tracks", "faces", "solid", "closed"]; // check boxes
// ms; slower pictures become coarse while something moves; faster ones become fine again
const SLOW = 20, FAST = 7;
const ZOOM = 1.25; // factor of a key
const USUAL = data.steps > 24 ? 4 : 2; // steps per second
const TICKS = 4; // most numbers below the slider after 0, so that they are apart
const SAID = 4000; // ms that a message stays
const state = {
  time: data.first, playing: false, speed: USUAL, last: 0, dirty: true, moved: -Infinity, slow: false, pace: 0, plan: 0,
};
const blocks = new Blocks(data);
const scene = { blocks, world: new World(data, blocks), rays: new Rays(data, blocks) };
const camera = new Camera(data, scene.rays);
const actions = { jump, next, pick, toggle, moved, fit, watch, hover, refresh };
const panels = data.plans.map((plan, index) => {
  const other = data.plans.length === 2 ? data.plans[1 - index] : null;
  return new Panel(data, plan, other, scene, camera, actions);
});

// -- time ----------------------------------------------------------------------------------

function jump(time) {
  state.time = Math.min(Math.max(time, 0), data.steps);
  play(false);
  moved();
}

function play(on) {
  if (on && state.time >= data.steps) state.time = data.first;
  state.playing = on;
  put(find("play"), on ? "❚❚" : "▶");
  find("play").setAttribute("aria-label", on ? "pause" : "play");
  refresh();
}

// Start a video of the chosen plan's picture, or end it before the last step.
function record() {
  if (state.recording) {
    state.recording.stop();
    state.recording = undefined;
    play(false);
  } else if (Recording.kind()) {
    const { canvas, plan } = panels[state.plan], { speed } = state;
    jump(data.first);
    state.recording = new Recording(canvas, `${data.name} ${plan.planner ?? plan.title} ${digits(speed, 2)} steps per second.webm`);
    play(true);
  }
  find("film").setAttribute("aria-pressed", String(Boolean(state.recording)));
  put(find("film"), state.recording ? "stop" : "record");
}

function refresh() {
  state.dirty = true;
}

function moved() {
  state.moved = performance.now();
  refresh();
}

function tick(now) {
  requestAnimationFrame(tick);
  const seconds = Math.min((now - state.last) / 1000, 0.25);
  state.last = now;
  if (state.playing) {
    state.time = Math.min(state.time + seconds * state.speed, data.steps);
    if (state.time >= data.steps) {
      play(false);
      if (state.recording) record();
    }
    refresh();
  }
  const resting = now - state.moved > 200 && !state.playing;
  if (resting && state.quality !== FINE) refresh();
  if (!state.dirty) return;
  state.dirty = false;
  draw(resting);
}

// On a slow machine, pictures are coarser while something moves.
function draw(resting) {
  state.quality = resting || state.recording || !state.slow ? FINE : state.follow ? ROUGH : COARSE;
  const checked = Object.fromEntries(SHOWN.map((name) => [name, find(name).checked]));
  const { quality, picked, follow, alone, person, hovered, sides } = state, begin = performance.now();
  const shown = panels.filter((panel) => panel.root.offsetParent);
  if (shown.length) camera.settle(shown[0].canvas.clientWidth, shown[0].canvas.clientHeight);
  const options = { ...checked, quality, picked, follow, alone, person, hovered, sides };
  if (!shown.map((panel) => panel.draw(state.time, options)).every(Boolean)) refresh();
  if (picked !== undefined) putInsets(shown);
  if (!resting) pace(performance.now() - begin);
  tell();
}

// The step, and the seconds if the length of steps is known.
function tell() {
  const step = Math.round(state.time), slider = find("slider"), { seconds, steps } = data;
  slider.value = String(step);
  put(find("step"), `step ${step} of ${steps}`);
  if (seconds === null) return;
  put(find("seconds"), `${clock(state.time * seconds)} of ${clock(steps * seconds)}`);
  slider.setAttribute("aria-valuetext", `step ${step}, ${clock(step * seconds)}`);
}

// Numbers below the slider: seconds, or steps.
function times() {
  const unit = data.seconds ?? 1, all = data.steps * unit, least = data.seconds ? 0 : 1, every = Math.max(roundedUp(all / TICKS), least);
  for (let k = 0; k * every <= all * (1 + 1e-9); k++) {
    const at = k * every, tick = make("span", "", data.seconds === null ? String(at) : `${digits(at, 2)} s`);
    tick.style.setProperty("--at", String(at / all));
    find("times").append(tick);
  }
}

// Put insets into the corner in which least happens in all pictures, until these change.
function putInsets(shown) {
  const stamp = state.follow ? "follow" : shown.map((panel) => panel.view.stamp).join();
  if (stamp === state.insets) return;
  state.insets = stamp;
  const busy = shown.map((panel) => panel.busy(state.time)).reduce((a, b) => a.map((count, k) => count + b[k]));
  const corner = CORNERS[busy.indexOf(Math.min(...busy))];
  for (const panel of shown) panel.box.className = `inset ${corner}`;
}

// The machine is slow if the mean time of recent pictures is long.
function pace(spent) {
  state.pace += 0.2 * (spent - state.pace);
  if (state.pace > SLOW) state.slow = true;
  else if (state.pace < FAST) state.slow = false;
}

// Go to the next mark of a kind, in all plans or in the given one.
function next(kind, plan) {
  const plans = plan ? [plan] : data.plans;
  const times = plans.flatMap(marksOf).filter((mark) => mark.kind === kind).map((mark) => mark.time).sort((a, b) => a - b);
  goOn(times, nothing(kind));
}

// Go to the next of some moments, or show a message if there is none.
function goOn(times, words) {
  if (times.length) jump(times.find((time) => time > state.time + 1e-6) ?? times[0]);
  say(times.length ? "" : words);
}

// The message if there is no mark of a kind.
function nothing(kind) {
  if (kind === "conflict") return "no rule is broken";
  if (kind === "near") return "no close approaches";
  return data.plans.some(({ gap }) => gap) ? "no costly moves" : "the costs of moves are known only with a certificate";
}

// Show a line over the page for a while; screen readers read it out.
function say(words) {
  put(find("said"), words);
  clearTimeout(state.said);
  state.said = setTimeout(() => put(find("said"), ""), SAID);
}

// Go to the next step at which fewer than two drones see a person, in any plan.
function nextBad() {
  goOn(data.plans.flatMap(badSteps).sort((a, b) => a - b), "everybody is seen by two drones or more");
}

// Pick a person of the strips, who has the same row in all plans, and a step.
function watch(step, person) {
  state.person = person;
  jump(step);
}

function watchNext(way) {
  const count = Math.max(...data.plans.map(({ filmed }) => filmed?.rows.length ?? data.people.length));
  if (count) watch(state.time, ((state.person ?? 0) + way + count) % count); // the strip starts with person 0
}

function toggleSides() {
  state.sides = !state.sides;
  refresh();
}

// -- what is shown -------------------------------------------------------------------------

// Pick a drone, or release it if it is already picked.
function pick(drone) {
  state.picked = drone === state.picked ? undefined : drone;
  if (state.picked === undefined) [state.follow, state.alone, state.insets] = [false, false, undefined];
  else for (const { fleet } of panels) fleet.show(state.picked);
  refresh();
}

// The drone or person under the pointer, if any; in a crowd, this one gets a label.
function hover(what) {
  if (!isCrowd(data.drones) && !isCrowd(data.people)) return;
  const { drone, person } = what ?? {}, { hovered } = state;
  if (hovered?.drone === drone && hovered?.person === person) return;
  state.hovered = what;
  refresh();
}

function pickNext(way) {
  const there = present(data.plans[0]), count = there.length, at = there.indexOf(state.picked);
  if (count) pick(there[at < 0 ? (way > 0 ? 0 : count - 1) : (at + way + count) % count]);
}

// Follow the picked drone, or show it alone, or stop doing so.
function toggle(name) {
  if (state.picked === undefined) [state.picked] = present(data.plans[0]);
  if (state.picked === undefined) return;
  state[name] = !state[name];
  if (name === "follow" && state.follow) camera.zoom(Math.max(1, (1.8 * camera.whole) / camera.scale), 0, 0);
  refresh();
}

function look(how) {
  camera[how]();
  for (const name of ["space", "top"]) find(name).setAttribute("aria-pressed", String(name === how));
  refresh();
}

function fit() {
  camera.fitted = false;
  panels.forEach(({ strip }) => strip.fit());
  refresh();
}

function zoom(factor) {
  camera.zoom(factor, 0, 0);
  moved();
}

// A phone shows one plan at a time.
function choose(plan) {
  state.plan = plan;
  panels.forEach(({ root }, k) => root.classList.toggle("chosen", k === plan));
  [...find("tabs").children].forEach((tab, k) => tab.setAttribute("aria-pressed", String(k === plan)));
  fit();
}

// -- keys ----------------------------------------------------------------------------------

// Key, its name, its function.
const KEYS = [
  [" ", "space", "play, pause", () => play(!state.playing)],
  ["ArrowRight", "→", "next step", () => jump(Math.floor(state.time) + 1)],
  ["ArrowLeft", "←", "previous step", () => jump(Math.ceil(state.time) - 1)],
  ["Home", "Home", "first step", () => jump(0)],
  ["End", "End", "last step", () => jump(data.steps)],
  ["c", "C", "next conflict", () => next("conflict")],
  ["n", "N", "next close approach", () => next("near")],
  ["m", "M", "next costly move", () => next("costly")],
  ["w", "W", "next step at which somebody is seen by fewer than two drones", nextBad],
  ["p", "P", "the next person in the strip of cameras", () => watchNext(1)],
  ["o", "O", "the previous person there", () => watchNext(-1)],
  ["s", "S", "what drones see of each side of the picked person", () => toggleSides()],
  ["d", "D", "pick the next drone", () => pickNext(1)],
  ["e", "E", "pick the previous drone", () => pickNext(-1)],
  ["f", "F", "follow the picked drone", () => toggle("follow")],
  ["i", "I", "show only the picked drone", () => toggle("alone")],
  ["Escape", "Esc", "deselect it", () => pick(undefined)],
  ["v", "V", "what all drones' cameras see", () => find("views").click()],
  ["r", "R", "start or stop recording a video of the picture", record],
  ["b", "B", "people as figures, or as the faces that count", () => find("faces").click()],
  ["3", "3", "look from the side", () => look("space")],
  ["t", "T", "look from above", () => look("top")],
  ["+", "+", "nearer", () => zoom(ZOOM)],
  ["-", "-", "farther away", () => zoom(1 / ZOOM)],
  ["arrows", "↹ ←↑", "on the picture that has the focus: turn it, with shift move it", () => {}],
  ["0", "0", "fit everything into the picture", fit],
  ["x", "X", "switch plan (narrow screens)", () => choose((state.plan + 1) % panels.length)],
  ["drones", "↹ ↑↓", "in the list of drones: the next, the previous one", () => {}],
  ["?", "?", "this help", help],
];

function help() {
  const box = find("help");
  if (box.open) box.close();
  else box.showModal();
}

// -- the rest of the page -------------------------------------------------------------------

function repaint() {
  paint();
  colourScale(data);
  scene.world = new World(data, blocks);
  refresh();
}

function tabs() {
  const box = find("tabs");
  box.hidden = panels.length < 2;
  panels.forEach(({ plan }, k) => box.append(button("", plan.planner ?? plan.title, plan.title, () => choose(k))));
}

function lay() {
  document.title = `${data.name}: ${data.plans.map((plan) => plan.title).join(", ")}`;
  find("name").textContent = data.name;
  find("about").textContent = data.about;
  find("panels").append(...panels.map((panel) => panel.root));
  find("panels").dataset.count = String(panels.length);
  find("panels").classList.toggle("many", panels.length > 2);
  document.body.classList.toggle("tall", panels.length > 2);
  listKeys(KEYS, find("keys"));
  legend(data);
  colourScale(data);
  times();
  tabs();
  choose(0);
  if (isCrowd(data.drones) && window.innerWidth < PHONE) { // from above and without cones, drones can be distinguished
    look("top");
    find("sights").checked = false;
  }
  // There is room for drones' pictures beside a plan, or below it on a narrow screen with one plan.
  const hasRoom = window.innerWidth <= NARROW || panels.every(({ root }) => root.clientWidth >= ROOM);
  find("views").checked = hasRoom && data.plans.every((plan) => !plan.waits);
}

// If the graphics card is lost, the processor draws its pictures again.
function tellRenderer() {
  document.documentElement.dataset.renderer = renderer();
  put(find("drawn"), renderer() === "webgl" ? "Drawn by the graphics card." : "Drawn without the graphics card.");
  refresh();
}

// Real speed, if the length of steps is known.
function offerRealTime(speed) {
  if (data.seconds === null) return;
  const real = 1 / data.seconds, option = make("option", "", digits(real, 2)), group = make("optgroup");
  const next = [...speed.options].find(({ value }) => Number(value) >= real);
  option.value = String(real);
  group.label = "real time";
  speed.insertBefore(group, next ?? null);
  if (Number(next?.value) === real) next.remove();
  group.append(option);
}

function listen() {
  const slider = find("slider"), speed = find("speed");
  slider.max = String(data.steps);
  slider.addEventListener("input", () => jump(Number(slider.value)));
  find("play").addEventListener("click", () => play(!state.playing));
  offerRealTime(speed);
  state.speed = data.seconds === null ? USUAL : 1 / data.seconds; // real time, if known
  speed.value = String(state.speed);
  speed.addEventListener("change", () => (state.speed = Number(speed.value)));
  for (const name of ["space", "top"]) find(name).addEventListener("click", () => look(name));
  for (const name of SHOWN) find(name).addEventListener("change", refresh);
  find("film").addEventListener("click", record);
  find("film").hidden = !Recording.kind();
  find("ask").addEventListener("click", help);
  find("more").addEventListener("click", ({ target }) => {
    target.setAttribute("aria-expanded", String(target.getAttribute("aria-expanded") === "false"));
  });
  listenToKeys(KEYS, find("help"));
  window.addEventListener("resize", fit);
  night.addEventListener("change", repaint);
  play(false);
  onLoss(tellRenderer);
  tellRenderer();
  const sizes = new ResizeObserver(refresh);
  for (const { canvas } of panels) sizes.observe(canvas);
  for (const panel of panels) new Steering(panel, camera, () => state.time, actions);
}

// A page that is opened with `?film` shows the images of a film: only the plans and their progress.
function film() {
  document.body.classList.add("film");
  for (const name of ["views", "solid"]) find(name).checked = false;
  window.film = {
    shown: { first: data.first, last: data.steps, speed: USUAL },
    look: (view) => look(view === "above" ? "top" : "space"),
    show(time) {
      jump(time);
      state.dirty = false;
      draw(true);
    },
  };
}

lay();
listen();
if (new URLSearchParams(window.location.search).has("film")) film();
tick(performance.now());
document.documentElement.dataset.ready = "yes";
