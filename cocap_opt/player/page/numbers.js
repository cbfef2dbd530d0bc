// Numbers in readable form.

export const digits = (value, most, least = 0) =>
  value.toLocaleString("en-US", { maximumFractionDigits: most, minimumFractionDigits: least });

export const short = (value) => {
  const [unit, size] = value >= 1e6 ? ["M", 1e6] : value >= 1e4 ? ["k", 1e3] : ["", 1];
  return Number((value / size).toPrecision(3)).toLocaleString("en-US", { maximumFractionDigits: 8 }) + unit;
};

export const reward = (value) => (Math.abs(value) < 100 ? digits(value, 4) : digits(value, 2, 2));

export const density = (value) => (value >= 100 ? digits(Math.round(value), 0) : String(Number(value.toPrecision(3))));

export const percent = (share) => `${digits(100 * share, 3)} %`;

export const clock = (seconds) => `${digits(seconds, 1, 1)} s`;

// The largest of 1, 2, 5, 10, .. and 0.5, 0.2, .. that does not exceed a number.
export function rounded(value) {
  if (!(value > 0)) return 0;
  const ten = 10 ** Math.floor(Math.log10(value) + 1e-9);
  return Number(([5, 2, 1].find((k) => k * ten <= value * (1 + 1e-9)) * ten).toPrecision(3));
}

// The smallest of these numbers that is at least the given one.
export function roundedUp(value) {
  const below = rounded(value);
  return below < value * (1 - 1e-9) ? rounded(2.5 * below) : below; // 1, 2, 5, 10, ..
}

export const MOST_WORDS = 3; // conflicts that are listed at once; on a phone one

export function several(words, most) {
  const more = words.length - most;
  return words.slice(0, most).join("; ") + (more > 0 ? `; ${more} more` : "");
}
