// The legend of colours and lines.

import { hex, NOBODY, palette, SCALE, startable } from "./colours.js";
import { find, make } from "./dom.js";
import { rounded, short } from "./numbers.js";
import { isCrowd } from "./plans.js";

export function legend(data) {
  find("airspace").hidden = find("closing").hidden = !data.airspace;
  if (data.airspace) find("limits").textContent = data.airspace.words;
  find("starting").hidden = !data.starts;
  if (data.starts) find("choosers").textContent = data.starts.words;
  tasks(data);
  find("other").hidden = data.plans.length !== 2;
  if (!data.plans.some((plan) => plan.seen.flat().some((pixels) => pixels > 0))) {
    find("scales").hidden = true; // nothing is seen at any step
    return;
  }
  const values = [0, 0.25, 0.5, 0.75].map((share) => rounded(data.most * share ** 2));
  const place = (value) => Math.sqrt(value / data.most);
  const apart = (k) => k === 0 || (place(values[k]) - place(values[k - 1]) > 0.21 && place(values[k]) < 0.86);
  for (const value of [...values.filter((_, k) => apart(k)), data.most]) {
    const tick = make("span", "", short(value));
    tick.style.left = `${100 * place(value)}%`;
    find("ticks").append(tick);
  }
  find("unit").textContent = data.unit;
}

// The colours of drones in a crowd, with the people whom they film most.
function tasks({ drones, plans, tasks: all }) {
  find("tasks").hidden = !isCrowd(drones);
  const found = plans.flatMap((plan) => plan.tasks), shown = all.filter((_, k) => found.includes(k));
  const rows = found.includes(null) ? [...shown, { colour: NOBODY, words: "nobody" }] : shown;
  for (const { colour, words } of rows) {
    const box = make("span", "task"), swatch = make("span", "swatch");
    swatch.style.background = colour;
    box.append(swatch, ` ${words}`);
    find("tasks").append(box);
  }
}

export function colourScale(data) {
  if (data.starts) find("startable").style.background = hex(startable(palette.ground, data.starts));
  find("unseen").style.background = hex(palette.unseen);
  const stops = SCALE.map((colour, k) => `${hex(colour)} ${(100 * k) / (SCALE.length - 1)}%`);
  find("scale").style.background = `linear-gradient(to right, ${stops.join(", ")})`;
}
