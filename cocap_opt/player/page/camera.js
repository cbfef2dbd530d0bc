// The camera that looks at the scene from outside, in parallel projection: as far away as one likes.

const AROUND = [62, 118]; // degrees, directions that it may look along: north is far away
const FAVOUR = 1.06; // how much better another direction must be than those before it
const MOST_RAYS = 300, LOOK = 60; // m, and how many, to tell how much is hidden
const MOST_AROUND = 1.7; // times the area where things happen, of a map that is shown as a whole
const LEAST = 5; // m, that are in the picture along each axis
const PADDING = { side: 34, top: 46, bottom: 40 }; // px around all that happens

class Camera {
  constructor(data, rays) {
    this.points = happenings(data);
    this.rays = rays;
    this.way = this.leastHidden(surroundings(data));
    this.fitted = false;
    this.space();
  }

  space() {
    this.elevation = 46;
    this.azimuth = this.way;
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

  // The direction in which least is hidden; pages of one scene look at it from the same side.
  leastHidden(points) {
    this.elevation = 46;
    const seen = (azimuth) => {
      this.azimuth = azimuth;
      this.update();
      return 0.5 + this.shareSeen(points);
    };
    return AROUND.map((azimuth) => [azimuth, seen(azimuth)]).reduce((a, b) => (b[1] > a[1] * FAVOUR ? b : a))[0];
  }

  // Put all that happens into a canvas of this size.
  fit(width, height) {
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
    Object.assign(this, { scale, centre, whole: scale, fitted: true });
  }

  // Share of points before which no obstacle stands.
  shareSeen(points) {
    const every = Math.max(Math.floor(points.length / MOST_RAYS), 1), back = this.ahead.map((v) => -v);
    const some = points.filter((_, k) => k % every === 0);
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
// the map, and the obstacles beside them, wholly; the whole map, too, where no drone moves or it is
// not much larger than that.
function happenings({ plans, people, terrain, meshes, scope: [low, high] }) {
  const within = (point) => point.map((v, k) => Math.min(Math.max(v, low[k]), k < 2 ? high[k] : Infinity));
  const drones = plans.flatMap((plan) => plan.paths.flat()).flatMap((place) => aboveGround(terrain, place));
  const inside = [...drones, ...people.flatMap(walked)].map(within), [width, depth] = terrain.size;
  const isSmall = width * depth < MOST_AROUND * (high[0] - low[0]) * (high[1] - low[1]);
  return isSmall || plans.every(isStill) ? [...inside, ...wholeMap(terrain, meshes)] : [...inside, ...beside(meshes, low, high)];
}

// The corners of meshes that reach into the area where things happen, no farther off than it is wide.
function beside(meshes, low, high) {
  const edge = [0, 1].map((k) => high[k] - low[k]), axes = [0, 1];
  const near = (points) => axes.every((k) => points.some((p) => p[k] > low[k]) && points.some((p) => p[k] < high[k]));
  const clamped = (point) => point.map((v, k) => (k < 2 ? Math.min(Math.max(v, low[k] - edge[k]), high[k] + edge[k]) : v));
  return meshes.map(({ vertices }) => triples(vertices)).filter(near).flat().map(clamped);
}

// What is the same for all plans of a scene: starts and people.
function surroundings({ plans: [{ paths }], people, terrain }) {
  return [...paths.flatMap((path) => path.slice(0, 1)).flatMap((start) => aboveGround(terrain, start)), ...people.flatMap(walked)];
}

const aboveGround = (terrain, [x, y, z]) => [[x, y, z], [x, y, groundAt(terrain, x, y)]];

const walked = ({ poses, height }) => poses.flatMap(([x, y, z]) => [[x, y, z], [x, y, z + height]]);

// The corners of a map, the tops of its cells, and the meshes that are on it.
function wholeMap({ size: [width, depth], cell, cells: [, rows], heights }, meshes) {
  const tops = heights.map((z, k) => [(Math.floor(k / rows) + 0.5) * cell, ((k % rows) + 0.5) * cell, z]);
  const solids = meshes.flatMap(({ vertices }) => triples(vertices));
  const onMap = solids.filter(([x, y]) => x >= 0 && y >= 0 && x <= width && y <= depth);
  return [...tops, ...onMap, ...[0, width].flatMap((x) => [0, depth].map((y) => [x, y, 0]))];
}
