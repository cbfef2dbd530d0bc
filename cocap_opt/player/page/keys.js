// Keys of the page, except those that a focused element uses itself.

import { make } from "./dom.js";

const OWN_KEYS = {
  select: /./,
  "canvas.view": /^Arrow/,
  "input[type=range]": /^(Arrow|Page|Home|End)/,
  "input[type=checkbox], button": /^( |Enter)$/,
};

function isOwnKey({ target, key }) {
  return Object.entries(OWN_KEYS).some(([what, own]) => target.matches(what) && own.test(key));
}

// `known` lists keys, their names, descriptions and functions. While the help is open, only its own
// key works; the browser closes it on Esc.
export function listenToKeys(known, helpBox) {
  const actions = new Map(known.map(([key, , , act]) => [key, act]));
  document.addEventListener("keydown", (event) => {
    if (isOwnKey(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    const act = actions.get(event.key.length === 1 ? event.key.toLowerCase() : event.key);
    if (!act || (helpBox.open && event.key !== "?")) return;
    event.preventDefault();
    act();
  });
}

export function listKeys(known, list) {
  for (const [, name, what] of known) list.append(make("dt", "", name), make("dd", "", what));
}
