// The page that runs cocap-check: it takes files, and shows the command's own output.

(() => {
"use strict";
const script = document.currentScript.src;
const root = document.getElementById("check");
const beside = (name) => new URL(`../check/${name}`, script).href;
const EXAMPLES = [
  ["corridor: its plan and its certificate", ["corridor.instance", "corridor-plan.json", "corridor.json"]],
  ["the same with an altered certificate", ["corridor.instance", "corridor-altered.json"]],
];
const MB = 1e6;
const files = new Map(); // by name: { file, kind }
const state = { worker: null, facts: null, isRunning: false, isAgain: false, begun: 0, lines: [], names: [] };

// -- elements ------------------------------------------------------------------------------

function make(name, cls, text) {
  const element = document.createElement(name);
  if (cls) element.className = cls;
  if (text !== undefined) element.textContent = text; // never as HTML, as names may contain anything
  return element;
}

function button(cls, text, press) {
  const element = make("button", cls, text);
  element.type = "button";
  element.addEventListener("click", press);
  return element;
}

const drop = make("div", "drop"), chosen = make("input"), list = make("ul", "files");
const choose = button("primary", "Choose files", () => chosen.click());
const run = button("primary", "Check", start), cancel = button("", "Cancel", stop), clear = button("", "Remove all", forget);
const told = make("p", "told"), said = make("span"), clock = make("span", "clock"), bar = make("progress");
const verdict = make("p", "verdict"), output = make("pre"), facts = make("p", "facts");

function lay() {
  chosen.type = "file";
  chosen.multiple = true;
  chosen.hidden = true;
  chosen.addEventListener("change", () => {
    add([...chosen.files]);
    chosen.value = ""; // so that the same file can be chosen again
  });
  const words = make("p"), hint = make("p", "hint", "an instance, and any plans, certificates and proofs that are of it");
  words.append(choose, " or drop them here");
  const tries = make("p", "tries", "Or try ");
  tries.append(...EXAMPLES.map(([text, names]) => button("", text, () => load(names))));
  drop.append(words, hint, chosen, tries);
  const actions = make("p", "actions");
  actions.append(run, cancel, clear);
  list.setAttribute("aria-label", "files");
  said.setAttribute("role", "status");
  clock.setAttribute("aria-hidden", "true"); // a screen reader would read out each second
  bar.setAttribute("aria-label", "Python loaded");
  verdict.setAttribute("role", "status");
  output.tabIndex = 0;
  output.setAttribute("aria-label", "text that cocap-check prints");
  told.append(said, clock);
  root.replaceChildren(drop, list, actions, told, bar, verdict, output, facts);
  show();
}

function show() {
  list.replaceChildren(...[...files].map(([name, { file, kind }]) => {
    const item = make("li");
    const remove = button("remove", "✕", () => removed(name));
    remove.setAttribute("aria-label", `remove ${name}`);
    item.append(make("b", "", name), make("span", "kind", `${kind}, ${size(file.size)}`), remove);
    return item;
  }));
  list.hidden = files.size === 0;
  run.hidden = clear.hidden = files.size === 0 || state.isRunning;
  cancel.hidden = !state.isRunning;
  told.classList.toggle("on", state.isRunning);
  if (!state.isRunning) said.textContent = clock.textContent = "";
  bar.hidden = !state.isRunning || state.facts !== null;
  output.hidden = state.lines.length === 0;
  output.textContent = state.lines.join("\n");
  root.setAttribute("aria-busy", String(state.isRunning));
}

const size = (bytes) => (bytes < MB ? `${Math.ceil(bytes / 1000)} kB` : `${(bytes / MB).toFixed(1)} MB`);

// -- files ---------------------------------------------------------------------------------

// The kind of a file, so that the instance comes first; cocap-check itself judges the content.
async function kindOf(file) {
  const begins = (await file.slice(0, 200).text()).trimStart();
  if (begins.startsWith("cocap-instance") || file.name.endsWith(".instance")) return "instance";
  if (!/^[{[]/.test(begins) && !file.name.endsWith(".json")) return "instance";
  const parts = await Promise.all([file.slice(0, 4000).text(), file.slice(-4000).text()]);
  return parts.join("\n").match(/"format": *"cocap-opt (plan|certificate|proof)"/)?.[1] ?? "unknown";
}

async function add(given) {
  const kinds = await Promise.allSettled(given.map(kindOf)), unread = [];
  for (const [k, file] of given.entries()) {
    const kind = kinds[k].value;
    if (kind === undefined) { // a folder, or a file that no longer exists
      unread.push(`${file.name}: ${kinds[k].reason.message}`);
      continue;
    }
    if (kind === "instance") for (const [name, other] of files) if (other.kind === "instance") files.delete(name);
    files.set(file.name, { file, kind });
  }
  show();
  if (unread.length) judge("bad", `Not read: ${unread.join("; ")}`);
  else if (given.length) start();
}

async function load(names) {
  try {
    const found = await Promise.all(names.map(async (name) => {
      const response = await fetch(beside(name));
      if (!response.ok) throw new Error(`${name}: ${response.status}`);
      return new File([await response.blob()], name);
    }));
    files.clear();
    add(found);
  } catch (error) {
    judge("bad", `The example could not be loaded: ${error.message}`);
  }
}

function removed(name) {
  const place = [...files.keys()].indexOf(name);
  files.delete(name);
  blank();
  (list.querySelectorAll("button")[Math.min(place, files.size - 1)] ?? choose).focus();
}

function forget() {
  files.clear();
  blank();
  choose.focus();
}

// Remove the answer on earlier files.
function blank() {
  if (!state.isRunning) {
    state.lines = [];
    judge("", "");
  }
  show();
}

// -- the check -----------------------------------------------------------------------------

const inOrder = () => {
  const all = [...files].map(([name, rest]) => ({ name, ...rest }));
  return [...all.filter(({ kind }) => kind === "instance"), ...all.filter(({ kind }) => kind !== "instance")];
};

function start() {
  if (state.isRunning) {
    state.isAgain = true; // check again, with files added since
    return;
  }
  const [first] = inOrder();
  state.lines = [];
  judge("", "");
  if (first?.kind !== "instance") {
    judge("mild", "The instance is missing. Write it by cocap-opt export SCENE -o scene.instance, and add it here.");
    show();
    return;
  }
  const hadFocus = document.activeElement === run;
  delete root.dataset.code;
  delete root.dataset.seconds;
  Object.assign(state, { isRunning: true, isAgain: false, begun: performance.now() });
  if (state.facts === null) open();
  else send();
  tick();
  show();
  if (hadFocus) cancel.focus();
}

function open() {
  say("loading Python, once");
  bar.removeAttribute("value");
  const worker = new Worker(new URL("check_worker.js", script), { type: "module" });
  state.worker = worker;
  worker.onmessage = ({ data }) => worker === state.worker && heard[data.type](data);
  worker.onerror = (event) => {
    event.preventDefault();
    if (worker === state.worker) heard.failed({ message: event.message || "the worker could not be started" });
  };
}

async function send() {
  const all = inOrder();
  // A name that looks like an option would be read as one.
  state.names = all.map(({ name }) => (name.startsWith("-") ? `./${name}` : name));
  state.lines = [`$ python cocap_check.py ${state.names.map(quoted).join(" ")}`];
  say(`reading ${all[0].name}`);
  show();
  const { worker } = state;
  try {
    const contents = await Promise.all(all.map(({ file }) => file.arrayBuffer()));
    if (worker !== state.worker) return; // cancelled in the meantime
    const sent = contents.map((bytes, k) => ({
      name: all[k].name, argument: state.names[k], bytes: new Uint8Array(bytes),
    }));
    state.begun = performance.now();
    worker.postMessage(sent, contents);
  } catch (error) {
    finish("bad", `Not read: ${error.message}`);
  }
}

const quoted = (name) => (/^[\w./+=@%,:-]+$/.test(name) ? name : `'${name.replaceAll("'", "'\\''")}'`);

const heard = {
  loading({ loaded, total }) {
    bar.max = total;
    bar.value = loaded;
    state.loaded = `${(loaded / MB).toFixed(1)} of ${(total / MB).toFixed(1)} MB, `;
  },
  ready(found) {
    state.facts = found;
    send();
  },
  line({ text }) {
    state.lines.push(text);
    const next = state.names[state.lines.length - 1];
    if (next) say(`checking ${next}, file ${state.lines.length} of ${state.names.length}`);
    show();
  },
  done({ code, seconds }) {
    const { python, pyodide, sha256 } = state.facts;
    facts.textContent = `Exit code ${code}, after ${seconds.toFixed(2)} s here, by Python ${python} of Pyodide ${pyodide}. `
      + `The checker that ran has the SHA-256 ${sha256}.`;
    Object.assign(root.dataset, { code, seconds });
    finish(...words(code));
  },
  failed({ message }) {
    end();
    finish("bad", `Not checked: ${message}`);
  },
};

// The exit code in words.
function words(code) {
  const refused = state.names.flatMap((name) => state.lines.filter((line) => line.startsWith(`${name}: refused: `)));
  const claims = state.names.length - 1;
  if (code === 0 && claims === 0) return ["mild", "The instance can be read. Add a plan, a certificate or a proof."];
  if (code === 0) return ["good", "Checked: all that the files claim holds."];
  if (code === 3) return ["mild", "Too long: a claim rests on a search that takes too long here; its multipliers alone are checked."];
  if (code === 2) return ["bad", `Not checked: ${state.lines.at(-1)}.`];
  const rest = claims > 1 && !refused[0]?.startsWith(`${state.names[0]}: `) ? " The other files were checked all the same." : "";
  const which = refused.length > 1 ? `Refused, ${refused.length} files: ` : "Refused: ";
  return ["bad", refused.length ? `${which}${refused[0].replace(": refused: ", ": ")}.${rest}` : `Exit code ${code}.`];
}

function finish(kind, text) {
  const hadFocus = document.activeElement === cancel;
  state.isRunning = false;
  judge(kind, text);
  show();
  if (hadFocus) run.focus();
  if (state.isAgain) start();
}

function stop() {
  state.isAgain = false;
  end();
  finish("mild", "Cancelled: what was not printed yet was not checked.");
}

// Python cannot be interrupted, but its worker can be ended.
function end() {
  state.worker?.terminate();
  state.worker = state.facts = null;
}

function say(text) {
  state.loaded = "";
  if (said.textContent !== text) said.textContent = text;
}

function judge(kind, text) {
  verdict.className = `verdict ${kind}`;
  verdict.textContent = text;
  if (!text) facts.textContent = "";
}

function tick() {
  if (!state.isRunning) return;
  clock.textContent = `: ${state.loaded ?? ""}${Math.floor((performance.now() - state.begun) / 1000)} s`;
  setTimeout(tick, 200);
}

// -- dropping ------------------------------------------------------------------------------

// Files can be dropped anywhere, as a file that misses the box would open in place of the page.
function listen() {
  const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  window.addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    drop.classList.add("over");
  });
  window.addEventListener("dragleave", (event) => event.relatedTarget || drop.classList.remove("over"));
  window.addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    drop.classList.remove("over");
    add([...event.dataTransfer.files]);
  });
}

if (location.protocol === "file:") {
  judge("mild", "Browsers start no worker for pages that are opened as files. Serve the folder of these pages, "
    + "for example by python -m http.server, and open this page from there.");
  root.replaceChildren(verdict);
} else {
  lay();
  listen();
}
root.dataset.ready = "yes";
})();
