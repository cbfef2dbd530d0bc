// The shapes of people and drones: bodies of polygons that face along x. People have height 1, with
// the feet at the origin; drones have radius 1 around the origin. Small pictures get simpler bodies.

import { normalOf, ring, TAU } from "./geometry.js";

export const ellipse = (n, along, across, z, x = 0, y = 0) => ring(n, 1).map(([c, s]) => [x + along * c, y + across * s, z]);

// Polygons, each with a part that selects its colour, in flat arrays, which can be drawn fast.
class Body {
  constructor(polygons) {
    this.parts = polygons.map(({ part }) => part);
    this.corners = polygons.map(({ points }) => Float64Array.from(points.flat()));
    this.normals = polygons.map(({ points }) => normalOf(points));
    this.hollow = polygons.map(({ hollow }) => Boolean(hollow)); // visible from both sides
  }
}

// The hull of rings with equal numbers of corners, from bottom to top, with a lid.
function loft(part, rings) {
  const polygons = [];
  for (let r = 1; r < rings.length; r++) {
    const [low, high] = [rings[r - 1], rings[r]];
    low.forEach((p, k) => {
      const next = (k + 1) % low.length;
      polygons.push({ part, points: [p, low[next], high[next], high[k]] });
    });
  }
  return [...polygons, { part, points: rings[rings.length - 1] }];
}

// Torso and head, with rings of n corners.
function trunk(n, isFine) {
  const torso = loft("shirt", [
    ellipse(n, 0.075, 0.11, 0.48), ellipse(n, 0.095, 0.175, 0.79), ellipse(n, 0.05, 0.08, 0.855),
  ]);
  const [neck, crown] = [ellipse(n, 0.06, 0.055, 0.845), ellipse(n, 0.06, 0.055, 1.0)];
  const cheeks = [[0.088, 0.078, 0.89], [0.092, 0.082, 0.945]].map(([along, across, z]) => ellipse(n, along, across, z));
  const head = loft("skin", [neck, ...(isFine ? cheeks : [cheeks[1]]), crown]);
  const isHair = ([x, , z]) => z > 0.3 || x < -0.25;
  return [...torso, ...head.map((one) => (isHair(normalOf(one.points)) ? { ...one, part: "hair" } : one))];
}

// A leg or an arm that hangs at a height, swung by an angle.
function limb(part, n, [high, low], y, [along, across], angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const swung = ([x, py, z]) => [x * c + (z - high) * s, py, high + (z - high) * c - x * s];
  return loft(part, [low, high].map((z) => ellipse(n, along, across, z, 0, y).map(swung))).slice(0, -1);
}

const STRIDE = 0.42; // rad, by which legs swing
export const PHASES = 12; // phases of the walk cycle

// A person in a phase of the walk cycle.
function person(isFine, phase) {
  const n = isFine ? 6 : 4, swing = STRIDE * Math.sin((phase / PHASES) * TAU);
  const legs = [1, -1].flatMap((side) => limb("legs", n, [0.53, 0], 0.06 * side, [0.06, 0.05], side * swing));
  const arms = [1, -1].flatMap((side) => limb("shirt", n, [0.8, 0.46], 0.19 * side, [0.042, 0.038], -0.8 * side * swing));
  return new Body([...legs, ...trunk(isFine ? 8 : 6, isFine), ...(isFine ? arms : [])]);
}

function quadrotor(isFine) {
  const spokes = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([x, y]) => [0.68 * x, 0.68 * y]);
  const arm = ([x, y]) => {
    const [ox, oy] = [-0.08 * Math.sign(y), 0.08 * Math.sign(x)];
    const points = [[-x - ox, -y - oy, 0.1], [x - ox, y - oy, 0.1], [x + ox, y + oy, 0.1], [-x + ox, -y + oy, 0.1]];
    return { part: "arm", points, hollow: true };
  };
  const rotor = ([x, y]) => ({ part: "rotor", points: ring(isFine ? 12 : 7, 0.42, x, y, 0.17), hollow: true });
  const hub = ([x, y]) => ({ part: "arm", points: ring(6, 0.13, x, y, 0.2), hollow: true });
  const n = isFine ? 10 : 6;
  const hull = loft("hull", [
    ellipse(n, 0.34, 0.26, -0.12), ...(isFine ? [ellipse(n, 0.48, 0.36, 0.05)] : []), ellipse(n, 0.38, 0.28, 0.24),
  ]);
  const lens = loft("lens", [ellipse(6, 0.15, 0.15, -0.3, 0.3), ellipse(6, 0.15, 0.15, -0.05, 0.3)]);
  const nose = { part: "lens", points: [[0.16, -0.19, 0.27], [0.56, 0, 0.2], [0.16, 0.19, 0.27]], hollow: true };
  return new Body([
    ...spokes.map(rotor), ...spokes.slice(0, 2).map(arm), ...(isFine ? [...spokes.map(hub), ...lens] : []), ...hull, nose,
  ]);
}

// Simple and fine bodies.
export const PERSONS = [false, true].map((isFine) => Array.from({ length: PHASES }, (_, phase) => person(isFine, phase)));
export const QUADROTORS = [false, true].map(quadrotor);
