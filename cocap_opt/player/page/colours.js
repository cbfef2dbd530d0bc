// Colours by day and by night: numbers 0xAABBGGRR for the raster, as image data has them in memory,
// and words for canvases.

export const rgb = (hex) => {
  const n = parseInt(hex.slice(1), 16);
  return (0xff000000 | ((n & 255) << 16) | (n & 0xff00) | (n >> 16)) >>> 0;
};

export const hex = (n) =>
  "#" + [n & 255, (n >> 8) & 255, (n >> 16) & 255].map((v) => v.toString(16).padStart(2, "0")).join("");

export function mixed(a, b, share) {
  const r = (a & 255) + ((b & 255) - (a & 255)) * share;
  const g = ((a >> 8) & 255) + (((b >> 8) & 255) - ((a >> 8) & 255)) * share;
  const bl = ((a >> 16) & 255) + (((b >> 16) & 255) - ((a >> 16) & 255)) * share;
  return (0xff000000 | (bl << 16) | (g << 8) | r) >>> 0;
}

// The colour of ground above which drones may start.
export const startable = (ground, { colour }) => mixed(ground, rgb(colour), night.matches ? 0.25 : 0.6);

// The colour of ground with land that has its own colour, e.g. water or a street; other ground is unchanged.
export const landed = (ground, colour) => (colour ? mixed(ground, rgb(colour), night.matches ? 0.3 : 1) : ground);

// A colour in light k, of 256; k is cut to a whole number.
export function shaded(colour, light) {
  const k = Math.min(light, 256) | 0;
  const redBlue = (((colour & 0xff00ff) * k) >>> 8) & 0xff00ff, green = (((colour & 0xff00) * k) >>> 8) & 0xff00;
  return (0xff000000 | redBlue | green) >>> 0;
}

const DAY = {
  paper: "#eef0f3", ground: "#f6efe1", high: "#cfc5a6", wall: "#b3c0d3", low: "#d8c49a", mesh: "#c08a5c",
  cut: "#8593aa", wallPlan: "#dcd8d2", lowPlan: "#e3d8bd", edge: "#4b5260", outline: "#4b5260", skyTop: "#a9c6e8", skyLow: "#e9f1f8",
  shadow: "#b3ac9d", unseen: "#5d636e", legs: "#3a4256", skin: "#e0ac85", hair: "#4a3226",
  rotor: "#ffffff", dark: "#20252d", walk: "#b02a45",
};
const NIGHT = {
  paper: "#161a20", ground: "#474b52", high: "#6a6658", wall: "#7488a6", low: "#8d7a52", mesh: "#96683f",
  cut: "#2c3543", wallPlan: "#3b424d", lowPlan: "#5a5342", edge: "#0e1116", outline: "#a9b6ca", skyTop: "#1b2a44", skyLow: "#4a5a73",
  shadow: "#26292e", unseen: "#878d98", legs: "#1f2531", skin: "#d39e78", hair: "#2c1e16",
  rotor: "#dfe6ef", dark: "#0c0f13", walk: "#ff8fa3",
};
const PAGE = {
  day: {
    ink: "#1d2530", soft: "#5b616b", line: "#e2e3e6", halo: "rgba(255,255,255,.92)", ahead: "#c6d4df", done: "#2f6690",
  },
  night: {
    ink: "#e8ebef", soft: "#a2a9b4", line: "#333a45", halo: "rgba(16,20,26,.9)", ahead: "#3d4b5a", done: "#6ba6d6",
  },
};
// Each has a contrast of at least 3 to 1 to the page, by day and by night.
export const RED = "#e0142d";
export const AMBER = "#c47600";
export const VIOLET = "#9a52dc";
export const OTHER = "#c65d1e";
export const CLOSED = rgb("#d0021b"); // zones closed to drones, translucent
export const NOBODY = "#7f7f7f"; // drones in a crowd that film nobody
export const palette = {}; // colours of the raster, filled by `paint`
export const words = {}; // colours of canvases, and the version of all colours

export const night = window.matchMedia("(prefers-color-scheme: dark)");

export function paint() {
  words.version = (words.version ?? 0) + 1; // tells if cached pictures have old colours
  for (const [name, value] of Object.entries(night.matches ? NIGHT : DAY)) palette[name] = rgb(value);
  Object.assign(words, night.matches ? PAGE.night : PAGE.day);
}
paint();

export const SCALE = ["#472a78", "#8e2f8e", "#cc4778", "#f0804e", "#fdc328", "#fbf18a"].map(rgb); // from little to much

// Colour of px/m2, with even steps of its square root, as J sums these roots.
export function seenColour(pixels, most) {
  if (!(pixels > 0)) return palette.unseen;
  const at = Math.min(Math.sqrt(pixels / most), 1) * (SCALE.length - 1);
  const k = Math.min(Math.floor(at), SCALE.length - 2);
  return mixed(SCALE[k], SCALE[k + 1], at - k);
}

// Black or white, whichever is easier to read on a colour.
export function inkOn(colour) {
  const n = rgb(colour), linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const [r, g, b] = [0, 8, 16].map((shift) => linear(((n >> shift) & 255) / 255));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.179 ? "#000000" : "#ffffff";
}
