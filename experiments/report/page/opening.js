// Where obstacles are glass: around all that happens in a plan, as far as they stand before it.
//
// It is a coarse picture: how open each block of samples is (0..255), and how deep (w of the
// farthest that happens there).

const BLOCK = 2; // log2 of samples along the edge of a block
const NEARER = 0.8; // 1/m
const LEAST_OPEN = 6; // below which an obstacle is solid

class Opening {
  constructor(width, height) {
    this.columns = (width >> BLOCK) + 1;
    this.rows = (height >> BLOCK) + 1;
    this.open = new Uint8Array(this.columns * this.rows);
    this.depth = new Float32Array(this.columns * this.rows);
    this.clear();
  }

  clear() {
    this.open.fill(0);
    this.depth.fill(Infinity);
  }

  // A disc of some radius (samples) around what is at x, y (samples) and w.
  add(x, y, w, radius) {
    const block = 1 << BLOCK, [cx, cy, r] = [x / block, y / block, radius / block];
    const [top, bottom] = [Math.max(Math.ceil(cy - r), 0), Math.min(Math.floor(cy + r), this.rows - 1)];
    for (let j = top; j <= bottom; j++) {
      const half = Math.sqrt(r * r - (j - cy) ** 2);
      const end = Math.min(Math.floor(cx + half), this.columns - 1);
      for (let i = Math.max(Math.ceil(cx - half), 0); i <= end; i++) {
        const at = j * this.columns + i, far = Math.hypot(i - cx, j - cy) / r;
        const open = 255 * Math.min(1, 2 * (1 - far));
        if (open > this.open[at]) this.open[at] = open;
        if (w < this.depth[at]) this.depth[at] = w;
      }
    }
  }

  // How open what is at w is (0..255), in a block: more and more, the farther it is before what
  // happens.
  at(block, w) {
    const before = Math.min((w - this.depth[block]) * NEARER, 1);
    return before > 0 ? this.open[block] * before : 0;
  }
}
