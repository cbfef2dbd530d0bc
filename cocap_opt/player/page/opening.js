// Where obstacles are glass: around all that happens in a plan, as far as they stand before it.
//
// It is a coarse picture: how open each block of samples is (0..255), and how deep: the mean w of
// what happens there, in which what is farther away weighs more.

const BLOCK = 2; // log2 of samples along the edge of a block
const FARTHER = 0.7; // 1/m, by which logarithms of weights grow
const MOST_POWER = 60; // of those logarithms
const NEARER = 0.8; // 1/m
const LEAST_OPEN = 6; // below which an obstacle is solid

class Opening {
  constructor(width, height) {
    this.columns = (width >> BLOCK) + 1;
    this.rows = (height >> BLOCK) + 1;
    const size = this.columns * this.rows;
    [this.open, this.weight, this.sum] = [new Uint8Array(size), new Float64Array(size), new Float64Array(size)];
  }

  clear() {
    for (const some of [this.open, this.weight, this.sum]) some.fill(0);
  }

  // A disc of some radius (samples) around what is at x, y (samples) and w.
  add(x, y, w, radius) {
    const block = 1 << BLOCK, [cx, cy, r] = [x / block, y / block, radius / block];
    const far = Math.exp(Math.min(Math.max(-w * FARTHER, -MOST_POWER), MOST_POWER));
    const [top, bottom] = [Math.max(Math.ceil(cy - r), 0), Math.min(Math.floor(cy + r), this.rows - 1)];
    for (let j = top; j <= bottom; j++) {
      const half = Math.sqrt(r * r - (j - cy) ** 2);
      const end = Math.min(Math.floor(cx + half), this.columns - 1);
      for (let i = Math.max(Math.ceil(cx - half), 0); i <= end; i++) {
        const at = j * this.columns + i, inside = 1 - ((i - cx) ** 2 + (j - cy) ** 2) / (r * r);
        const open = Math.min(1, 1.6 * inside * inside), weight = open * far;
        if (255 * open > this.open[at]) this.open[at] = 255 * open;
        this.weight[at] += weight;
        this.sum[at] += weight * w;
      }
    }
  }

  // How open what is at w is (0..255), in a block: more and more, the farther it is before what
  // happens.
  at(block, w) {
    if (!this.open[block]) return 0;
    const before = Math.min((w - this.sum[block] / this.weight[block]) * NEARER, 1);
    return before > 0 ? this.open[block] * before : 0;
  }
}
