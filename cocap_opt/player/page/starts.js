// The page for choosing drones' starts: a map to press on, and the starts as TOML.

const data = JSON.parse(document.getElementById("data").textContent);
const [width, depth] = data.cells, cell = data.cell, [ox, oy] = data.origin;
const KINDS = ["free", "free, above something", "too close to people at step 0", "no-fly zone or ceiling", "blocked"];
const DRONES = ["#1f77b4", "#2ca02c", "#ff7f0e", "#9467bd", "#17becf", "#8c564b", "#bcbd22", "#e377c2", "#7f7f7f"];
const RED = "#b00020", PERSON = "#d1495b", RIM = 14;
const EDGE = 14 + 7 * Math.max(...[oy, oy + depth * cell].map((y) => String(Math.round(y)).length));
const $ = (id) => document.getElementById(id);
const view = $("view"), pen = view.getContext("2d");

let level = 0, pointer = null, scale = 1;
// The chosen starts: those of the recipe, or the nearest free places where these are not free.
let chosen = data.starts
  .filter((start) => !start.why || start.free)
  .map((start) => ({ at: start.free || start.at, height: start.height, heading: start.heading }));
const first = data.levels.findIndex((each) => chosen.some((start) => start.height === each.height));
level = Math.max(first, 0);

const middle = (x, y) => [ox + (x + 0.5) * cell, oy + (y + 0.5) * cell];
const kindOf = (x, y, k = level) => +data.levels[k].kinds[x * depth + y];
const shown = (number) => String(+number.toFixed(6));
export const screen = ([x, y]) => [EDGE + ((x - ox) / cell) * scale, RIM + (depth - (y - oy) / cell) * scale];

function cellAt(event) {
  const box = view.getBoundingClientRect();
  const x = Math.floor((event.clientX - box.left - EDGE) / scale);
  const y = Math.floor(depth - (event.clientY - box.top - RIM) / scale);
  return x >= 0 && y >= 0 && x < width && y < depth ? [x, y] : null;
}

// Images with one pixel per cell, which the canvas draws larger.
const images = data.levels.map(({ kinds }) => {
  const image = document.createElement("canvas");
  image.width = width;
  image.height = depth;
  const rgb = data.colours.map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
  const pixels = new ImageData(width, depth);
  for (let x = 0; x < width; x++) {
    for (let y = 0; y < depth; y++) {
      const [r, g, b] = rgb[+kinds[x * depth + y]], at = 4 * ((depth - 1 - y) * width + x);
      pixels.data.set([r, g, b, 255], at);
    }
  }
  image.getContext("2d").putImageData(pixels, 0, 0);
  return image;
});

function line(points, colour, thick, dash = []) {
  pen.beginPath();
  points.forEach((point, k) => pen[k ? "lineTo" : "moveTo"](...screen(point)));
  pen.strokeStyle = colour;
  pen.lineWidth = thick;
  pen.setLineDash(dash);
  pen.stroke();
  pen.setLineDash([]);
}

function disc(at, radius, fill, rim, words, ink) {
  const [x, y] = screen(at);
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = fill;
  pen.fill();
  pen.lineWidth = 2;
  pen.strokeStyle = rim;
  pen.stroke();
  pen.fillStyle = ink;
  pen.font = "600 11px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(words, x, y + 0.5);
}

function cross(at) {
  const [x, y] = screen(at), r = 7;
  for (const [colour, thick] of [["white", 6], [RED, 3]]) {
    pen.beginPath();
    pen.moveTo(x - r, y - r);
    pen.lineTo(x + r, y + r);
    pen.moveTo(x - r, y + r);
    pen.lineTo(x + r, y - r);
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.stroke();
  }
}

// A round number of metres, about an eighth of the map's length.
function step(length) {
  const rough = length / 8, power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((k) => k * power >= rough);
}

function axes(style) {
  const every = step(Math.max(width, depth) * cell);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = style.getPropertyValue("--soft");
  pen.textBaseline = "top";
  pen.textAlign = "center";
  for (let x = Math.ceil(ox / every) * every; x <= ox + width * cell; x += every) {
    line([[x, oy], [x, oy + depth * cell]], "rgba(255,255,255,.55)", 1);
    pen.fillText(shown(x), screen([x, oy])[0], RIM + depth * scale + 4);
  }
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (let y = Math.ceil(oy / every) * every; y <= oy + depth * cell; y += every) {
    line([[ox, y], [ox + width * cell, y]], "rgba(255,255,255,.55)", 1);
    pen.fillText(shown(y), EDGE - 4, screen([ox, y])[1]);
  }
}

function area(cells, colour) {
  const inside = new Set(cells.map(([x, y]) => x * depth + y));
  const has = (x, y) => x >= 0 && y >= 0 && x < width && y < depth && inside.has(x * depth + y);
  for (const [x, y] of cells) {
    const at = (i, j) => [ox + (x + i) * cell, oy + (y + j) * cell];
    if (!has(x - 1, y)) line([at(0, 0), at(0, 1)], colour, 2);
    if (!has(x + 1, y)) line([at(1, 0), at(1, 1)], colour, 2);
    if (!has(x, y - 1)) line([at(0, 0), at(1, 0)], colour, 2);
    if (!has(x, y + 1)) line([at(0, 1), at(1, 1)], colour, 2);
  }
}

function draw() {
  const ratio = window.devicePixelRatio || 1, room = view.parentElement.clientWidth - 24;
  scale = Math.min((room - EDGE - RIM) / width, Math.max(window.innerHeight - 190, 280) / depth);
  const high = depth * scale + RIM + 24, style = getComputedStyle(document.documentElement);
  view.style.height = `${high}px`;
  view.width = room * ratio;
  view.height = high * ratio;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.imageSmoothingEnabled = false;
  pen.drawImage(images[level], EDGE, RIM, width * scale, depth * scale);
  axes(style);
  data.areas.forEach((cells, k) => area(cells, DRONES[(data.starts.length + k) % DRONES.length]));
  data.people.forEach((person, j) => {
    line(person.walk, PERSON, 1.5, [2, 3]);
    disc(person.walk[0], 8, PERSON, "white", j, "white");
  });
  const height = data.levels[level].height;
  for (const start of data.starts) {
    if (!start.why || start.height !== height) continue;
    if (start.free) line([start.at, start.free], RED, 1.5, [5, 3]);
    cross(start.at);
  }
  chosen.forEach((start, k) => {
    const colour = DRONES[k % DRONES.length], here = start.height === height;
    pen.globalAlpha = here ? 1 : 0.35;
    const turn = (start.heading * Math.PI) / 180, far = Math.max(1.6 * cell, 24 / scale * cell);
    line([start.at, [start.at[0] + far * Math.cos(turn), start.at[1] + far * Math.sin(turn)]], colour, 3);
    disc(start.at, 10, "white", colour, k, "#111");
    pen.globalAlpha = 1;
  });
  if (pointer) {
    const [x, y] = screen([ox + pointer[0] * cell, oy + (pointer[1] + 1) * cell]);
    pen.strokeStyle = "#1d2530";
    pen.lineWidth = 1.5;
    pen.strokeRect(x, y, scale, scale);
  }
}

function tell() {
  if (!pointer) return void ($("here").textContent = "\u00a0");
  const [x, y] = middle(...pointer), high = data.above[pointer[0] * depth + pointer[1]];
  const stands = high > 0 ? `, ${shown(high)} m high here` : "";
  const free = data.levels.filter((_, k) => kindOf(...pointer, k) <= 1).map((each) => shown(each.height));
  const also = data.levels.length > 1 ? ` · free at ${free.length ? `${free.join(", ")} m` : "no height"}` : "";
  $("here").textContent = `x = ${shown(x)}, y = ${shown(y)}, cell (${pointer.join(", ")}): ${KINDS[kindOf(...pointer)]}${stands}${also}`;
}

function row(start, k) {
  const line = document.createElement("tr"), words = document.createElement("td"), last = document.createElement("td");
  words.textContent = `${k}: x ${shown(start.at[0])}, y ${shown(start.at[1])}, ${shown(start.height)} m, ${shown(start.heading)}°`;
  const other = chosen.findIndex((each, j) => j < k && Math.hypot(
    each.at[0] - start.at[0], each.at[1] - start.at[1], each.height - start.height) < data.separation);
  if (other >= 0) {
    const near = document.createElement("div");
    near.className = "near";
    near.textContent = `closer to ${other} than ${shown(data.separation)} m`;
    words.append(near);
  }
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "×";
  button.title = "remove";
  button.onclick = () => { chosen.splice(k, 1); update(); };
  last.append(button);
  line.append(words, last);
  return line;
}

function toml() {
  if (!chosen.length) return "";
  const rows = chosen.map(({ at, height, heading }) =>
    `    { x = ${shown(at[0])}, y = ${shown(at[1])}, height = ${shown(height)}, heading = ${shown(heading)} },`);
  return ["starts = [", ...rows, "]"].join("\n");
}

function update() {
  $("chosen").replaceChildren(...chosen.map(row));
  $("none").hidden = chosen.length > 0;
  $("copy").hidden = $("toml").hidden = !chosen.length;
  $("toml").textContent = toml();
  for (const [k, button] of [...document.querySelectorAll("#heights button")].entries()) {
    button.setAttribute("aria-pressed", String(k === level));
  }
  tell();
  draw();
}

function press(event) {
  const at = cellAt(event);
  if (!at) return;
  const place = middle(...at), height = data.levels[level].height;
  const old = chosen.find((start) => start.height === height && start.at.every((v, k) => Math.abs(v - place[k]) < cell / 4));
  if (old) old.heading = (old.heading + 360 / data.headings) % 360;
  else if (kindOf(...at) <= 1) chosen.push({ at: place, height, heading: 0 });
  update();
}

document.querySelector("h1").textContent = `${data.name}: where drones may start`;
document.title = `${data.name}: where drones may start`;
$("heights").append("flight height, m:");
data.levels.forEach((each, k) => {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = shown(each.height);
  button.title = `${shown(each.height)} m ${data.over}`;
  button.onclick = () => { level = k; update(); };
  $("heights").append(button);
});
KINDS.forEach((words, k) => {
  if (!data.levels.some((each) => each.kinds.includes(k))) return;
  const item = document.createElement("span"), swatch = document.createElement("i");
  swatch.style.background = data.colours[k];
  item.append(swatch, words);
  $("legend").append(item);
});
const refused = [...data.starts.filter((start) => start.why).map((start) => `${start.called}: ${start.why}`), ...data.notes];
$("refused").hidden = !refused.length;
$("refused").querySelector("ul").append(...refused.map((words) => {
  const item = document.createElement("li");
  item.textContent = words;
  return item;
}));
$("copy").onclick = async () => {
  try {
    await navigator.clipboard.writeText(toml());
    $("copy").textContent = "Copied";
  } catch {
    getSelection().selectAllChildren($("toml"));
  }
};
view.addEventListener("pointermove", (event) => { pointer = cellAt(event); tell(); draw(); });
view.addEventListener("pointerleave", () => { pointer = null; tell(); draw(); });
view.addEventListener("click", press);
window.addEventListener("resize", draw);
update();
