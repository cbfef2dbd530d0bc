// Numbers as people read them.

const digits = (value, most, least = 0) =>
  value.toLocaleString("en-US", { maximumFractionDigits: most, minimumFractionDigits: least });

const short = (value) => {
  const [unit, size] = value >= 1e6 ? ["M", 1e6] : value >= 1e4 ? ["k", 1e3] : ["", 1];
  return Number((value / size).toPrecision(3)).toLocaleString("en-US", { maximumFractionDigits: 8 }) + unit;
};

const reward = (value) => (Math.abs(value) < 100 ? digits(value, 4) : digits(value, 2, 2));

const density = (value) => (value >= 100 ? digits(Math.round(value), 0) : String(Number(value.toPrecision(3))));

const percent = (share) => `${digits(100 * share, 3)} %`;

const clock = (seconds) => `${digits(seconds, 1, 1)} s`;

// The largest of 1, 2, 5, 10, .. and 0.5, 0.2, .. that is not larger.
function rounded(value) {
  if (!(value > 0)) return 0;
  const ten = 10 ** Math.floor(Math.log10(value) + 1e-9);
  return Number(([5, 2, 1].find((k) => k * ten <= value * (1 + 1e-9)) * ten).toPrecision(3));
}
