// The camera that looks at the scene from outside, in parallel projection: as far away as one likes.

const AROUND = [62, 28, 118, 152, 208, 242, 298, 332]; // degrees, directions that it may look along
const FAVOUR = 1.06; // how much better another direction must be than those before it
const MOST_RAYS = 300, LOOK = 60; // m, and how many, to tell how much is hidden
const LEAST = 5; // m, that are in the picture along each axis
const PADDING = { side: 34, top: 46, bottom: 40 }; // px around all that happens

class Camera {
  constructor(data, rays) {
    this.points = happenings(data);
    this.rays = rays;
    this.fitted = false;
    this.space();
  }

  space() {
    this.elevation = 46;
    this.azimuth = undefined;
    this.fitted = false;
  }

  top() {
    [this.azimuth, this.elevation] = [90, 90];
    this.fitted = false;
  }

  get isAbove() {
    return this.elevation > 80;
  }

  update() {
    const a = this.azimuth * DEGREE, e = this.elevation * DEGREE;
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    this.right = [sa, -ca, 0];
    this.up = [ca * se, sa * se, ce];
    this.ahead = [ca * ce, sa * ce, -se];
  }

  // Put all that happens into a canvas of this size, from where it is large and little hidden.
  fit(width, height) {
    const ways = this.azimuth === undefined ? AROUND : [this.azimuth];
    const framed = ways.map((azimuth) => this.framed(azimuth, width, height));
    const best = framed.reduce((a, b) => (b.scale * b.seen > a.scale * a.seen * FAVOUR ? b : a));
    Object.assign(this, best, { whole: best.scale, fitted: true });
    this.update();
  }

  framed(azimuth, width, height) {
    this.azimuth = azimuth;
    this.update();
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const axes = [this.right, this.up, this.ahead];
    for (const point of this.points) {
      axes.forEach((axis, k) => {
        const along = dot(point, axis);
        low[k] = Math.min(low[k], along);
        high[k] = Math.max(high[k], along);
      });
    }
    const wide = Math.max(high[0] - low[0], LEAST), tall = Math.max(high[1] - low[1], LEAST);
    const free = [Math.max(width - 2 * PADDING.side, 50), Math.max(height - PADDING.top - PADDING.bottom, 50)];
    const scale = Math.min(free[0] / wide, free[1] / tall);
    const middle = low.map((v, k) => (v + high[k]) / 2);
    middle[1] += (PADDING.top - PADDING.bottom) / 2 / scale;
    const centre = [0, 1, 2].map((k) => axes.reduce((sum, axis, n) => sum + middle[n] * axis[k], 0));
    return { azimuth, scale, centre, seen: 0.5 + this.shareSeen() };
  }

  // Share of points before which no obstacle stands.
  shareSeen() {
    const every = Math.max(Math.floor(this.points.length / MOST_RAYS), 1), back = this.ahead.map((v) => -v);
    const some = this.points.filter((_, k) => k % every === 0);
    return some.filter((point) => this.rays.length(point, back, LOOK) === LOOK).length / some.length;
  }

  orbit(dx, dy) {
    this.azimuth -= dx * 0.4;
    this.elevation = Math.min(Math.max(this.elevation + dy * 0.3, 8), 90);
  }

  pan(dx, dy) {
    this.centre = this.centre.map((v, k) => v - (dx * this.right[k] - dy * this.up[k]) / this.scale);
  }

  // Zoom about a point of the canvas, given from its middle.
  zoom(factor, x, y) {
    this.pan(-x, -y);
    this.scale *= factor;
    this.pan(x, y);
  }
}

// Where drones, the ground below them and people are at the steps of all plans, not too far off
// the map.
function happenings({ plans, people, terrain, scope: [low, high] }) {
  const within = (point) => point.map((v, k) => Math.min(Math.max(v, low[k]), k < 2 ? high[k] : Infinity));
  const places = plans.flatMap((plan) => plan.paths.flat());
  const drones = places.flatMap(([x, y, z]) => [[x, y, z], [x, y, groundAt(terrain, x, y)]]);
  const bodies = people.flatMap(({ poses, height }) => poses.flatMap(([x, y, z]) => [[x, y, z], [x, y, z + height]]));
  return [...drones, ...bodies].map(within);
}
